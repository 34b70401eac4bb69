"""What the command line says of itself: options by purpose, examples that run, versions, near misses, completion."""

import re
import shlex

import click
import numpy as np
from click.shell_completion import BashComplete
from click.testing import CliRunner

from simdtex.cli.command import OPTION_WORDS
from simdtex.commands import COMMAND_WORDS, COMMANDS, EXAMPLES, load, main
from simdtex.io import image

OPTIONS = [(name, one) for name in COMMANDS for one in load(name).params if isinstance(one, click.Option)]
LINES = [words for name in COMMANDS for words, _ in load(name).examples] + [words for words, _ in EXAMPLES]


def run(*words):
    return CliRunner().invoke(main, [str(word) for word in words], prog_name="simdtex")


def help_of(name, width=100):
    flag = "--help-all" if name in COMMANDS and load(name).usual else "--help"
    return CliRunner(env={"COLUMNS": str(width)}).invoke(main, [name, flag], prog_name="simdtex").output


def test_there_are_not_too_many_options():
    assert len([one for name, one in OPTIONS if name == "synth"]) <= 52, "one more is --help"
    assert len({max(one.opts, key=len) for _, one in OPTIONS} | {"--help", "--version"}) <= 122, "each is needed"


def test_helps_fit_a_line_and_list_the_usual_options():
    """In 80 columns, at most fourteen options; the rest with --help-all. Commands begin with examples."""
    for name in COMMANDS:
        command, every = load(name), help_of(name, 80)
        said = CliRunner(env={"COLUMNS": "80"}).invoke(main, [name, "--help"], prog_name="simdtex").output
        assert max(map(len, said.splitlines())) <= 80 or any(len(words) > 70 for words, _ in command.examples)
        assert command.examples or name == "devices"
        assert all(f"  # {what}\n  simdtex {words}\n" in every for words, what in command.examples)
        assert not command.examples or every.index("  simdtex ") < every.index(" --help")
        listed, options = (re.findall(r"^  (-[a-z], )?(--[a-z-]+)", text, re.MULTILINE) for text in (said, every))
        own = [one for one in command.params if isinstance(one, click.Option)]
        if command.usual:
            assert 10 <= len(listed) <= 14
            assert f"`simdtex {name} --help-all` lists the other {len(own) - len(listed)} options too." in said
            assert len(options) >= len(own) + 1, "an option of several methods is listed for each"
        else:
            assert len(listed) == len(own) + 1 or len(own) > 14  # schedules


def test_a_group_names_its_method():
    said = help_of("synth")
    assert re.search(r"Method multires: appearance:\n  --alpha FLOAT +Exchange places", said)
    assert re.search(r"Method mrf: data and guides:\n  --sample-mask FILE +Take pixels only", said)
    assert said.index("Job:") < said.index("Method mrf: scales and edges:") < said.index("Device and messages:")


def test_examples_are_understood_and_the_first_runs(tmp_path, monkeypatch):
    for words in LINES:
        name, *rest = shlex.split(words)
        with load(name).make_context(name, rest) as context:
            assert context.params
    monkeypatch.chdir(tmp_path)
    image.write("gravel.png", np.random.default_rng(1).integers(0, 256, (10, 11), dtype=np.uint8))
    done = run(*shlex.split(load("synth").examples[0][0]), "--order", 2, "--device", "reference")
    assert done.exit_code == 0, done.output
    assert image.read("more.png").pixels.shape == (20, 22)


def test_the_list_of_commands_is_in_groups():
    said = help_of("--help")
    for name, sentence in COMMANDS.items():
        assert re.search(rf"^  {name} +{re.escape(sentence[:30])}", said, re.MULTILINE)
        assert main.commands[name].get_short_help_str(200) == load(name).get_short_help_str(200)
    assert said.index("Textures:") < said.index("Studies:") < said.index("This machine:")


def test_versions(monkeypatch, any_device):
    monkeypatch.setenv("SIMDTEX_DEVICE", str(any_device.index))
    own, libraries, device = run("--version").output.splitlines()
    assert re.fullmatch(r"simdtex \S+", own) and re.fullmatch(r"Python \S+, NumPy \S+, pyopencl \S+", libraries)
    assert device == f"{any_device}, {any_device.version}, driver {any_device.driver}"
    monkeypatch.setenv("SIMDTEX_DEVICE", "nonsense")
    done = run("--version")
    assert done.exit_code == 0 and "No device matches" in done.output.splitlines()[-1]


def test_near_misses_and_words_of_other_programs_name_ours():
    assert "Did you mean 'synth'?" in run("snth").output
    assert "--coherence" in run("synth", "a.png", "-o", "b.png", "--coherense", 1).output
    for ours, theirs in COMMAND_WORDS.items():
        assert f"No such command '{theirs[-1]}': use `simdtex {ours}`." in run(theirs[-1], "a.png").output
    own = {flag for _, one in OPTIONS for flag in one.opts}
    assert all(ours in own or ours.removeprefix("simdtex ") in COMMANDS for ours in (*OPTION_WORDS, *COMMAND_WORDS))
    found = {("synth", "--scale"): "--size.", ("synth", "--seamless"): "simdtex tile.", ("tile", "--scale"): ""}
    for (command, word), ours in {**found, ("fill", "--hole"): "--mask or simdtex fill."}.items():
        said = run(command, "a.png", "-o", "b.png", word).output.splitlines()[-1]
        assert said.partition(": use ")[2] == ours


def test_completion():
    shell = BashComplete(main, {}, "simdtex", "_SIMDTEX_COMPLETE")
    for words, last, found in [
        ([], "sy", ["synth"]),
        (["fill", "a.png"], "--mas", ["--mask"]),
        (["synth", "--method"], "", ["mrf", "multires", "pyramid"]),
        (["synth", "--schedule"], "ra", ["random-subset", "raster", "random-scan"]),
        (["synth", "--edges"], "", ["auto", "reflect", "whole", "mend", "keep", "wrap"]),
        (["extend", "--seamless"], "b", ["both"]),
        (["synth", "--order"], "1", []),
    ]:
        assert [one.value for one in shell.get_completions(words, last)] == found
    assert [one.type for one in shell.get_completions(["synth"], "gr")] == ["file"]

"""What the command line says of itself: options by purpose, examples that run, versions, near misses, completion."""

import re
import shlex

import click
import numpy as np
import pytest
from click.shell_completion import BashComplete
from click.testing import CliRunner

from simdtex.cli.command import OPTION_WORDS, entries_of
from simdtex.commands import COMMAND_WORDS, COMMANDS, EXAMPLES, load, main
from simdtex.io import image

OPTIONS = [(name, one) for name in COMMANDS for one in load(name).params if isinstance(one, click.Option)]
LINES = [words for name in COMMANDS for words, _ in load(name).examples] + [words for words, _ in EXAMPLES]


VERBS = re.findall(
    r"\w+",
    """add arrange average blend compare count couple cover draw evaluate exchange fill follow give join keep label
    learn listen look make match measure open penalise place prefer print reflect relax replace resolve run scale set
    show split start sweep take treat use wrap write""",
)


def run(*words):
    return CliRunner().invoke(main, [str(word) for word in words], prog_name="simdtex")


def help_of(name, width=100):
    """Return the help with all options."""
    flag = "--help-all" if name in COMMANDS and load(name).usual else "--help"
    return CliRunner(env={"COLUMNS": str(width)}).invoke(main, [name, flag], prog_name="simdtex").output


def test_there_are_not_too_many_options():
    assert len([one for name, one in OPTIONS if name == "synth"]) <= 52, "one more is --help"
    assert len({max(one.opts, key=len) for _, one in OPTIONS} | {"--help", "--version"}) <= 120, "each is needed"


@pytest.mark.parametrize("name", COMMANDS)
def test_help_lists_the_usual_options_and_says_where_the_others_are(name):
    """In 80 columns, at most fourteen options; the rest with --help-all."""
    command = load(name)
    said = CliRunner(env={"COLUMNS": "80"}).invoke(main, [name, "--help"], prog_name="simdtex").output
    listed = re.findall(r"^  (-[a-z], )?(--[a-z-]+)", said, re.MULTILINE)
    assert max(map(len, said.splitlines())) <= 80 or any(len(words) > 70 for words, _ in command.examples)
    every = len(re.findall(r"^  (-[a-z], )?(--[a-z-]+)", help_of(name), re.MULTILINE))
    own = [one for one in command.params if isinstance(one, click.Option)]
    if not command.usual:
        assert len(listed) == len(own) + 1 or len(own) > 14  # schedules
        return
    assert 10 <= len(listed) <= 14
    assert f"`simdtex {name} --help-all` lists the other {len(own) - len(listed)} options too." in said
    assert every >= len(own) + 1, "an option of several methods is listed for each"


def test_a_group_names_its_method():
    said = help_of("synth")
    assert re.search(r"Method multires: appearance:\n  --alpha FLOAT +Exchange places", said)
    assert re.search(r"Method mrf: data and guides:\n  --sample-mask FILE +Take pixels only", said)
    for method, first in (("mrf", "Use this many levels, from"), ("pyramid", "Use this many levels of the pyramids")):
        assert re.search(rf"Method {method}: scales and edges:\n  --levels INTEGER +{first}", said)
    assert not re.search(r"\b(mrf|multires|pyramid): [A-Z]", said), "methods are named in headings"
    assert "Method" not in help_of("fill") and "\nSearch:\n" in help_of("fill")
    assert said.index("Job:") < said.index("Method mrf: scales and edges:") < said.index("Device and messages:")


def test_the_help_of_an_option_begins_with_what_it_does():
    for command, one in OPTIONS:
        for _, (_, said) in entries_of(one, click.Context(load(command))):
            assert said[0].isupper() and said.partition(" ")[0].lower() in VERBS, f"{command} {one.opts[0]}: {said}"


@pytest.mark.parametrize("words", LINES, ids=lambda words: words[:40])
def test_examples_are_understood(words):
    name, *rest = shlex.split(words)
    with load(name).make_context(name, rest) as context:
        assert context.params


def test_the_first_example_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    image.write("gravel.png", np.random.default_rng(1).integers(0, 256, (10, 11), dtype=np.uint8))
    done = run(*shlex.split(load("synth").examples[0][0]), "--order", 2, "--device", "reference")
    assert done.exit_code == 0, done.output
    assert image.read("more.png").pixels.shape == (20, 22)


@pytest.mark.parametrize("name", [name for name in COMMANDS if name not in ("devices",)])
def test_a_command_begins_with_examples_that_fit_a_line(name):
    said = help_of(name, 80)
    for words, what in load(name).examples:
        assert f"  # {what}\n  simdtex {words}\n" in said
    assert load(name).examples and said.index("  simdtex ") < said.index(" --help")


def test_the_list_of_commands_is_in_groups():
    said = help_of("--help")
    for name, sentence in COMMANDS.items():
        assert re.search(rf"^  {name} +{re.escape(sentence[:30])}", said, re.MULTILINE)
        assert "..." not in sentence or "SAMPLE..." in sentence
    assert said.index("Textures:") < said.index("Studies:") < said.index("This machine:")


def test_versions(monkeypatch):
    monkeypatch.setenv("SIMDTEX_DEVICE", "reference")
    own, libraries, device = run("--version").output.splitlines()
    assert re.fullmatch(r"simdtex \S+", own)
    assert re.fullmatch(r"Python \S+, NumPy \S+, pyopencl \S+", libraries)
    assert device == "reference"


def test_versions_with_a_device(monkeypatch, any_device):
    monkeypatch.setenv("SIMDTEX_DEVICE", str(any_device.index))
    assert run("--version").output.splitlines()[-1] == f"{any_device}, {any_device.version}, driver {any_device.driver}"


def test_versions_without_a_device(monkeypatch):
    monkeypatch.setenv("SIMDTEX_DEVICE", "nonsense")
    done = run("--version")
    assert done.exit_code == 0 and "No device matches" in done.output.splitlines()[-1]


def test_near_misses_are_named():
    assert "Did you mean 'synth'?" in run("snth").output
    assert "--coherence" in run("synth", "a.png", "-o", "b.png", "--coherense", 1).output


def test_words_of_other_programs_name_ours():
    for ours, theirs in COMMAND_WORDS.items():
        for word in theirs:
            assert ours in COMMANDS and f"No such command '{word}': use `simdtex {ours}`." in run(word, "a.png").output
    own = {flag for _, one in OPTIONS for flag in one.opts}
    for ours, theirs in OPTION_WORDS.items():
        assert theirs and (ours in own or ours.removeprefix("simdtex ") in COMMANDS)
    found = {
        (command, word): run(command, "a.png", "-o", "b.png", word).output.splitlines()[-1].partition(": use ")[2]
        for command, word in [("synth", "--scale"), ("synth", "--seamless"), ("tile", "--scale"), ("fill", "--hole")]
    }
    assert list(found.values()) == ["--size.", "simdtex tile.", "", "--mask or simdtex fill."]


@pytest.mark.parametrize(
    "words, last, found",
    [
        ([], "sy", ["synth"]),
        (["synth"], "--balan", ["--balance"]),
        (["fill", "a.png"], "--mas", ["--mask"]),
        (["synth", "--relaxation"], "g", ["gibbs"]),
        (["synth", "--method"], "", ["mrf", "multires", "pyramid"]),
        (["synth", "--schedule"], "ra", ["random-subset", "raster", "random-scan"]),
        (["synth", "--edges"], "", ["auto", "reflect", "whole", "mend", "keep", "wrap"]),
        (["extend", "--seamless"], "b", ["both"]),
        (["synth", "--order"], "1", []),
    ],
)
def test_completion(words, last, found):
    told = BashComplete(main, {}, "simdtex", "_SIMDTEX_COMPLETE").get_completions(words, last)
    assert [one.value for one in told] == found


def test_completion_of_files():
    files = BashComplete(main, {}, "simdtex", "_SIMDTEX_COMPLETE").get_completions(["synth"], "gr")
    assert [one.type for one in files] == ["file"]

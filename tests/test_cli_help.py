"""What the command line says of itself: options by purpose, examples that run, versions, near misses, completion."""

import re
import shlex
from importlib import import_module

import click
import numpy as np
import pytest
from click.shell_completion import BashComplete
from click.testing import CliRunner

from simdtex.cli import COMMANDS, EXAMPLES, load, main
from simdtex.cli.options import METHODS
from simdtex.io import image
from simdtex.options import Number, Whole, has_presets, is_flag, table

OPTIONS = [(name, one) for name in COMMANDS for one in load(name).params if isinstance(one, click.Option)]
LINES = [words for name in COMMANDS for words, _ in load(name).examples] + [words for words, _ in EXAMPLES]


VERBS = re.findall(
    r"\w+",
    """add arrange average blend compare count couple cover draw evaluate exchange fill follow give keep label learn
    listen look make match measure open penalise place prefer print reflect relax replace resolve run scale set show
    split start sweep take treat use wrap write""",
)


def run(*words):
    return CliRunner().invoke(main, [str(word) for word in words], prog_name="simdtex")


def help_of(name, width=100):
    return CliRunner(env={"COLUMNS": str(width)}).invoke(main, [name, "--help"], prog_name="simdtex").output


def test_there_are_not_too_many_options():
    assert len([one for name, one in OPTIONS if name == "synth"]) < 49, "one more is --help"
    assert len({max(one.opts, key=len) for _, one in OPTIONS} | {"--help", "--version"}) <= 109, "each is needed"


@pytest.mark.parametrize("name", ["synth", "fill", "extend", "simulate", "schedules", "mix", "solid", "classify"])
def test_a_command_has_the_options_of_the_tables_that_it_shows(name):
    params = {one.name: one for one in load(name).params if getattr(one, "kind", None)}
    tables = [table(import_module(f"simdtex.methods.{method}").Options) for method in METHODS.get(name, ("mrf",))]
    declared = {option: one for options in tables for option, one in options.items() if name in one.shown}
    assert set(params) == {*["preset"] * any(map(has_presets, tables)), *declared}
    said = "".join(help_of(name, 1000).split())
    for option, one in declared.items():
        assert f"{one.help}.".replace(" ", "") in said
        default = one.default_of(name)
        if default is not None and default is not False:
            shown = f"{default:g}" if isinstance(default, float) else str(default)
            assert f"[{shown}]" in params[option].help
        number = {Whole: "integer", Number: "float"}.get(type(one.kind), "")
        assert is_flag(one.kind) or params[option].type.name == (number or "text")


def test_a_group_names_its_method():
    said = help_of("synth")
    assert re.search(r"Method multires: appearance:\n  --alpha FLOAT +Exchange places", said)
    assert re.search(r"--known FILE +mrf: Keep these", said), "a group of several methods names each method"
    assert "Method" not in help_of("fill") and "\nSearch:\n" in help_of("fill")
    assert said.index("Job:") < said.index("Scales and edges:") < said.index("Device and messages:")


def test_the_help_of_an_option_begins_with_what_it_does():
    for command, one in OPTIONS:
        said = one.get_help_record(click.Context(load(command)))[1]
        assert said[0].isupper() or re.match("mrf|multires|pyramid", said), f"{command} {one.opts[0]}: {said}"
        for part in re.split(r"(?:^|\] )(?:(?:mrf|multires|pyramid)(?:, |: ))+", said):
            first = part.partition(" ")[0].rstrip(":,").lower()
            assert not part or first in VERBS, f"{command} {one.opts[0]}: {part}"


def test_a_short_list_has_no_groups():
    assert "\nOptions:\n" in help_of("ising") and "\nOptions:\n" not in help_of("synth")


@pytest.mark.parametrize("words", LINES, ids=lambda words: words[:40])
def test_examples_are_understood(words):
    name, *rest = shlex.split(words)
    with load(name).make_context(name, rest) as context:
        assert context.params


def test_the_first_example_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    image.write("gravel.png", np.random.default_rng(1).integers(0, 256, (10, 11), dtype=np.uint8))
    done = run(*shlex.split(load("synth").examples[0][0]), "--device", "reference")
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

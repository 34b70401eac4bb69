"""What the command line says of itself: options by purpose, examples that run, versions, near misses, completion."""

import re
import shlex

import click
import numpy as np
import pytest
from click.shell_completion import BashComplete
from click.testing import CliRunner

from simdtex.cli import COMMANDS, EXAMPLES, load, main
from simdtex.cli.helping import OF_COMMANDS, SECTIONS, TITLES
from simdtex.io import image

OPTIONS = [(name, one) for name in COMMANDS for one in load(name).params if isinstance(one, click.Option)]
LINES = [words for name in COMMANDS for words, _ in load(name).examples] + [words for words, _ in EXAMPLES]


VERBS = re.findall(
    r"\w+",
    """add average be begin blend break bring carry check compare continue cool count draw exchange extend fill
    follow get give go have honour keep launch lay leave let listen look make match measure melt mend open
    prefer print read relax run say show split start sweep take try use weigh write""",
)


def run(*words):
    return CliRunner().invoke(main, [str(word) for word in words], prog_name="simdtex")


def help_of(name, width=100):
    return CliRunner(env={"COLUMNS": str(width)}).invoke(main, [name, "--help"], prog_name="simdtex").output


def test_every_option_has_its_place():
    assert not {one.name for _, one in OPTIONS} - set(TITLES)


def test_no_place_is_of_nothing():
    names = [name for group in SECTIONS.values() for name in group]
    assert len(names) == len(set(names))
    assert set(names) <= {one.name for _, one in OPTIONS}
    assert all(one in TITLES and one in {o.name for _, o in OPTIONS} for own in OF_COMMANDS.values() for one in own)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_is_shown_once(name):
    said = help_of(name)
    for one in load(name).params:
        if isinstance(one, click.Option):
            assert len(re.findall(rf"^  (?:-\w, )?{re.escape(one.opts[-1])}\b(?!-)", said, re.MULTILINE)) == 1, one.name


def test_a_group_that_names_a_method_need_not_be_told_it_again():
    said = help_of("synth")
    assert re.search(r"Method multires:\n  --alpha FLOAT\|auto +Exchange places", said)
    assert re.search(r"--known FILE +mrf: keep what", said), "where options of several methods are together it is told"


def test_the_help_of_an_option_begins_with_what_it_does():
    for command, one in OPTIONS:
        said = one.get_help_record(click.Context(load(command)))[1]
        assert said[0].isupper() or re.match("mrf|multires|pyramid", said), f"{command} {one.opts[0]}: {said}"
        for part in re.split(r"(?:^|\] )(?:(?:mrf|multires|pyramid)(?:, |: ))+", said):
            first = re.sub("(?i)^in a coherent search, ", "", part).partition(" ")[0].rstrip(":,").lower()
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
    assert said.index("More of a texture:") < said.index("Studies:") < said.index("This machine:")


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
        (["solid", "--slices"], "e", ["each"]),
        (["synth", "--order"], "1", []),
    ],
)
def test_completion(words, last, found):
    told = BashComplete(main, {}, "simdtex", "_SIMDTEX_COMPLETE").get_completions(words, last)
    assert [one.value for one in told] == found


def test_completion_of_files():
    files = BashComplete(main, {}, "simdtex", "_SIMDTEX_COMPLETE").get_completions(["synth"], "gr")
    assert [one.type for one in files] == ["file"]

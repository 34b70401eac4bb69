"""No command overwrites what it reads: every command, every option that is a path, every way to name a file twice."""

import os
from pathlib import Path

import click
import numpy as np
import pytest
from commands import refused, run

from simdtex import commands as cli
from simdtex.cli.command import Pair, Place
from simdtex.io import image

COMMANDS = {name: cli.load(name) for name in cli.COMMANDS}
READ, WRITE = ("read", "enter"), ("write", "folder", "either")
TEXTS = {
    # options and arguments of text that name no file; those of `mix` repeat the name of a SAMPLE
    *("host", "device", "size", "method", "preset", "relaxation", "pixel", "search", "edges", "boundary", "weights"),
    *("shares", "proportions", "alpha", "pyramid", "seamless", "workers", "color", "schedule", "array", "average"),
    *("origin", "cell", "several", "outside", "columns", "categories", "variables"),
    *("direction", "light", "mapping", "memory", "film", "phases", "free_sites"),
    *("names", "alphas", "betas", "lattice", "palette", "pattern", "low", "high"),
}
PICTURES = ("synth", "fill", "extend", "mix")


def parameters(*roles):
    """The options of every command that have one of these roles."""
    return [
        (name, option)
        for name, command in COMMANDS.items()
        for option in command.params
        if isinstance(option.type, (Place, Pair)) and (option.type.role in roles or isinstance(option.type, Pair))
    ]


def test_every_path_has_a_role():
    """An option that is new fails here, until it has a role or is known to name no file."""
    found = 0
    for name, command in COMMANDS.items():
        for option in command.params:
            kind = option.type
            assert not isinstance(kind, click.File), (name, option.name)
            if isinstance(kind, (Place, Pair)):
                found += 1
                assert kind.role in READ + WRITE
                continue
            assert not isinstance(kind, click.Path), f"{name} {option.name}: give it a role of simdtex.cli.command"
            if isinstance(kind, click.types.StringParamType):
                assert option.name in TEXTS, f"{name} {option.name}: give it a role, or name it in this test"
    assert found > 40


def test_what_writes_is_known_to_write():
    """The roles of options that are called the same are the same, and outputs are outputs."""
    for name, option in parameters(*READ, *WRITE):
        if isinstance(option.type, Place) and option.name in ("output", "outputs", "stages", "report", "source_map"):
            assert option.type.role in WRITE, (name, option.name)
        if option.name in ("sample", "samples", "picture", "training_image") and isinstance(option, click.Argument):
            assert option.type.role in READ


def words(option, text):
    """An option with a value."""
    return [text] if isinstance(option, click.Argument) else [option.opts[-1], text]


def reading(option, text):
    """An option that reads a file; of a pair, on the left."""
    if isinstance(option.type, Pair) and option.type.named:
        text = f"albedo={text}"
    elif isinstance(option.type, Pair):
        text = f"{text}={'new.png' if option.type.role == 'write' else 'map.png'}"
    return words(option, text)


def writing(option, text):
    """An option that writes a file; of a pair, on the right."""
    return words(option, f"map.png={text}" if isinstance(option.type, Pair) else text)


def required(command, *but):
    """What a command cannot do without."""
    given = []
    for option in command.params:
        if option.required and option not in but:
            given += words(option, "sample.png" if option.type.role in READ else "fresh.npz")
    return given


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in").mkdir()
    for number, name in enumerate(("sample.png", "in/given.png", "map.png", "other.png")):
        image.write(tmp_path / name, np.random.default_rng(number).integers(0, 256, (12, 12), dtype=np.uint8))
    return tmp_path


PAIRS = [
    (name, out, given)
    for name, out in parameters(*WRITE)
    for other, given in parameters(*READ)
    if name == other and out.type.role in WRITE and not (isinstance(given.type, Pair) and given is out)
]


def named(pair):
    name, out, given = pair
    return f"{name} {out.name} {given.name}"


@pytest.mark.parametrize("pair", PAIRS, ids=named)
def test_an_output_is_no_input(folder, pair):
    name, out, given = pair
    file = folder / "in" / "given.png"
    (folder / "link.png").symlink_to(file)
    (folder / "again.png").symlink_to("link.png")
    os.link(file, folder / "hard.png")
    (folder / "way").symlink_to("in")
    rest = required(COMMANDS[name], out, given)
    ways = [
        ("in/given.png", "in/given.png"),
        ("again.png", "in/given.png"),
        ("in/given.png", "hard.png"),
        ("in/given.png", "./in/../in/given.png"),
        ("in/given.png", file),
        ("in/given.png", "link.png"),
        ("way/given.png", "in/given.png"),
    ]
    for one, other in ways if name == "synth" else ways[1:3]:
        args = [*reading(given, one), *rest, *writing(out, other)]
        refused("is an input and would be overwritten; give the output another name", name, *args)


def test_both_sides_of_a_pair(folder):
    for text in ("map.png=map.png", "map.png=./map.png", "map.png,other.png=other.png", "x, other.png=other.png"):
        for name in ("synth", "fill", "extend"):
            args = ["sample.png", "-o", "out.png", "--also", text]
            refused("is an input and would be overwritten", name, *args)
    for text in ("other.png=out.png", "out.png=other.png", "other.png,out.png=map.png"):
        (folder / "out.png").touch()
        for name in ("synth", "simulate"):
            args = ["sample.png", "-o", "out.png", "--guide", text]
            refused("is an input and would be overwritten", name, *args)


@pytest.mark.parametrize("pair", [pair for pair in PAIRS if pair[1].type.role in ("folder", "either")], ids=named)
def test_no_folder_that_is_made_anew_holds_an_input(folder, pair):
    name, out, given = pair
    (folder / "in" / "level0.png").symlink_to(folder / "sample.png")
    (folder / "way").symlink_to("in")
    rest = required(COMMANDS[name], out, given)
    for one, other in [
        ("in/given.png", "in"),
        ("in/level0.png", "in"),
        ("in/given.png", "way"),
        ("way/given.png", "in/."),
    ]:
        args = [*reading(given, one), *rest, *writing(out, other)]
        refused("is an input and is in", name, *args)


OUTPUTS = [
    (name, one, other)
    for name, one in parameters(*WRITE)
    for also, other in parameters(*WRITE)
    if name == also and one.type.role in WRITE and other.type.role in WRITE and one.name < other.name
]


@pytest.mark.parametrize("pair", OUTPUTS, ids=named)
def test_no_output_is_another(folder, pair):
    name, one, other = pair
    rest = required(COMMANDS[name], one, other)
    for a, b in (("new", "new"), ("new", "./in/../new"), ("in", "in")):
        refused("would be written twice", name, *rest, *writing(one, a), *writing(other, b))
    for outer, inner in ((one, other), (other, one)):
        if outer.type.role != "write":
            args = [*rest, *writing(outer, "new"), *writing(inner, "new/x.npz")]
            refused("would be written into new, the folder of another output", name, *args)


def test_names_that_differ_are_let_be(folder):
    (folder / "st").mkdir()
    os.link("sample.png", "st2.png")
    args = ["sample.png", "-o", "Sample.png", "--stages", "st", "--device", "reference", "--order", "2", "-q"]
    before = (folder / "sample.png").read_bytes()
    done = run("synth", *args, "--size", "9x9", "--source-map", "stmap.npz")
    assert done.exit_code == 0, done.output
    assert (folder / "sample.png").read_bytes() == before and (folder / "Sample.png").exists()


@pytest.mark.parametrize("pair", parameters(*READ), ids=lambda pair: f"{pair[0]} {pair[1].name}")
def test_a_missing_input_is_named(folder, pair):
    name, given = pair
    command = COMMANDS[name]
    rest = [*required(command, given), "--device", "reference"]
    if name in PICTURES:
        rest = ["out.png" if word == "fresh.npz" else word for word in rest]
    missing = "none.npz" if given.type.role == "enter" else "none.png"
    if name == "fill" and given.name != "mask":
        rest += ["--mask", "map.png"]
    if name == "extend":
        rest += ["--left", "3"]
    if given.name == "roles":
        rest = [{"sample.png": "in", "out.png": "out"}.get(word, word) for word in rest]
    refused("does not exist: check the path", name, *reading(given, missing), *rest)
    if isinstance(given.type, Place) and given.type.role == "read":
        refused("is a folder", name, *words(given, "in"), *rest)
    empty = run(name, *words(given, ""), *rest)
    assert empty.exit_code == 2 and ("'' must be" if isinstance(given.type, Pair) else "empty") in empty.output


@pytest.mark.parametrize("name", [name for name, c in COMMANDS.items() if any(p.name == "size" for p in c.params)])
def test_an_empty_size_is_no_default(folder, name):
    args = [*required(COMMANDS[name]), "--size", ""]
    if name in PICTURES:
        args = ["out.png" if word == "fresh.npz" else word for word in args]
    if name in ("demo", "schedules"):
        args += ["-o", "report"]
    if name == "estimate":
        args += ["--known", "sample.png"]
    refused("size '' is not ", name, *args)
    assert not Path("report").exists()


def test_a_file_name_in_a_pair_may_contain_an_equals_sign(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("sample.png", "a=b.png", "g=1.png", "d,e.png"):
        image.write(name, np.indices((9, 9)).sum(0).astype(np.uint8) // 4)
    more = ["-o", "o.png", "--size", "9", "--order", "1", "--device", "reference"]

    def synth(*args):
        result = run("synth", "sample.png", *args, *more)
        return result.exit_code, result.stderr

    assert synth("--guide", "g=1.png=g=1.png", "--also", "a=b.png=new=1.png")[0] == 0
    assert (tmp_path / "new=1.png").exists()
    assert synth("--also", "d,e.png=y.png")[0] == 0, "a file may have a comma in its name, too"
    assert "a=b.png is an input and would be overwritten" in synth("--also", "a=b.png=a=b.png")[1]
    (tmp_path / "a").touch()
    words = "--also a=b.png=x.png has two meanings, since a and a=b.png exist: rename one of them"
    assert synth("--also", "a=b.png=x.png") == (2, f"simdtex: {words}\n")
    (tmp_path / "a").unlink()
    image.write("c.png", np.zeros((9, 9), np.uint8))
    code, said = synth("sample.png", "--also", "a=b.png, c.png=x=1.png")
    assert (code, (tmp_path / "x=1.png").exists()) == (0, True), said

"""No command overwrites what it reads: every command, every option that is a path, every way to name a file twice."""

import os
import re

import click
import numpy as np
import pytest
from commands import refused, run

from simdtex import commands as cli
from simdtex.cli.command import Pair, PathType, check_places
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
    return [
        (name, option)
        for name, command in COMMANDS.items()
        for option in command.params
        if isinstance(option.type, (PathType, Pair)) and (option.type.role in roles or isinstance(option.type, Pair))
    ]


def test_every_path_has_a_role():
    """An option that is new fails here, until it has a role or is known to name no file."""
    for name, option in ((name, option) for name, command in COMMANDS.items() for option in command.params):
        kind, where = option.type, f"{name} {option.name}: give it a role of simdtex.cli.command"
        if isinstance(kind, (PathType, Pair)):
            assert kind.role in READ + WRITE
            if isinstance(kind, PathType) and option.name in ("output", "outputs", "stages", "report", "source_map"):
                assert kind.role in WRITE, where
            if option.name in ("sample", "samples", "picture", "training_image") and isinstance(option, click.Argument):
                assert kind.role in READ, where
            continue
        assert not isinstance(kind, (click.File, click.Path)), where
        assert not isinstance(kind, click.types.StringParamType) or option.name in TEXTS, f"{where}, or name it here"
    assert len(parameters(*READ, *WRITE)) > 40


def words(option, text):
    return [text] if isinstance(option, click.Argument) else [option.opts[-1], text]


def reading(option, text):
    """An option that reads a file; of a pair, on the left."""
    if isinstance(option.type, Pair) and option.type.named:
        text = f"albedo={text}"
    elif isinstance(option.type, Pair):
        text = f"{text}={'new.png' if option.type.role == 'write' else 'map.png'}"
    return words(option, text)


def writing(option, text):
    return words(option, f"map.png={text}" if isinstance(option.type, Pair) else text)


def required(command, *but):
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


OUTPUTS = [
    (name, one, other)
    for name, one in parameters(*WRITE)
    for also, other in parameters(*WRITE)
    if name == also and one.type.role in WRITE and other.type.role in WRITE and one.name < other.name
]


def collides(sentence, name, *args):
    """The command ends with this sentence before it does anything."""
    context = COMMANDS[name].make_context(name, [str(word) for word in args])
    with context, pytest.raises(ValueError, match=re.escape(sentence)):
        check_places(context)


def test_an_output_is_no_input(folder):
    file = folder / "in" / "given.png"
    (folder / "link.png").symlink_to(file)
    (folder / "again.png").symlink_to("link.png")
    os.link(file, folder / "hard.png")
    (folder / "way").symlink_to("in")
    sentence = "is an input and would be overwritten; give the output another name"
    for one, other in [("in/given.png", file), ("in/given.png", "./in/../in/given.png"), ("way/given.png", "link.png")]:
        refused(sentence, "synth", one, "-o", other)
    for name, out, given in PAIRS:
        rest = required(COMMANDS[name], out, given)
        for one, other in ("again.png", "in/given.png"), ("in/given.png", "hard.png"):
            collides(sentence, name, *reading(given, one), *rest, *writing(out, other))
    for text in ("map.png=./map.png", "map.png,other.png=other.png", "x, other.png=other.png"):
        collides(sentence, "fill", "sample.png", "-o", "out.png", "--also", text)
    (folder / "out.png").touch()
    for text in ("other.png=out.png", "out.png=other.png", "other.png,out.png=map.png"):
        collides(sentence, "simulate", "sample.png", "-o", "out.png", "--guide", text)


def test_no_folder_that_is_made_anew_holds_an_input(folder):
    (folder / "in" / "level0.png").symlink_to(folder / "sample.png")
    (folder / "way").symlink_to("in")
    ways = [("in/given.png", "in"), ("in/level0.png", "in"), ("in/given.png", "way"), ("way/given.png", "in/.")]
    for name, out, given in PAIRS:
        rest = required(COMMANDS[name], out, given)
        for one, other in ways if out.type.role in ("folder", "either") else ():
            collides("is an input and is in", name, *reading(given, one), *rest, *writing(out, other))


def test_no_output_is_another_or_in_its_folder(folder):
    for name, one, other in OUTPUTS:
        rest = required(COMMANDS[name], one, other)
        for a, b in (("new", "new"), ("new", "./in/../new"), ("in", "in")):
            collides("would be written twice", name, *rest, *writing(one, a), *writing(other, b))
        for outer, inner in ((one, other), (other, one)):
            if outer.type.role != "write":
                args = [*rest, *writing(outer, "new"), *writing(inner, "new/x.npz")]
                collides("would be written into new, the folder of another output", name, *args)


def test_names_that_differ_are_let_be(folder):
    (folder / "st").mkdir()
    os.link("sample.png", "st2.png")
    args = ["sample.png", "-o", "Sample.png", "--stages", "st", "--device", "reference", "--order", "2", "-q"]
    before = (folder / "sample.png").read_bytes()
    done = run("synth", *args, "--size", "9x9", "--source-map", "stmap.npz")
    assert done.exit_code == 0, done.output
    assert (folder / "sample.png").read_bytes() == before and (folder / "Sample.png").exists()


def test_a_missing_input_and_an_empty_path_are_named(folder):
    for name, given in parameters(*READ):
        rest = [*required(COMMANDS[name], given), "--device", "reference"]
        if name in PICTURES:
            rest = ["out.png" if word == "fresh.npz" else word for word in rest]
        if name == "fill" and given.name != "mask":
            rest += ["--mask", "map.png"]
        if name == "extend":
            rest += ["--left", "3"]
        if given.name == "roles":
            rest = [{"sample.png": "in", "out.png": "out"}.get(word, word) for word in rest]
        missing = "none.npz" if given.type.role == "enter" else "none.png"
        refused("does not exist: check the path", name, *reading(given, missing), *rest)
        if isinstance(given.type, PathType) and given.type.role == "read":
            refused("is a folder", name, *words(given, "in"), *rest)
    for args, said in ((("",), "the path is empty"), (("a.png", "--also", ""), "'' must be MAP=OUT")):
        done = run("synth", *args, "-o", "o.png")
        assert done.exit_code == 2 and said in done.output


def test_an_empty_size_is_no_default(folder):
    for name in (name for name, command in COMMANDS.items() if any(one.name == "size" for one in command.params)):
        args = [*required(COMMANDS[name]), "--size", ""]
        if name in PICTURES:
            args = ["out.png" if word == "fresh.npz" else word for word in args]
        args += {"estimate": ["--known", "sample.png"], "demo": ["-o", "o"], "schedules": ["-o", "o"]}.get(name, [])
        refused("size '' is not ", name, *args)


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

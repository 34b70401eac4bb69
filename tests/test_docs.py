"""README, documentation and examples: what they show runs, what they name exists."""

import doctest
import inspect
import re
import runpy
import shlex
import sys
from pathlib import Path

import click
import numpy as np
import pytest
from skimage import data

import simdtex
from simdtex import commands as cli
from simdtex.cli.options import given
from simdtex.io.image import write
from simdtex.jobs.classification import options as classifier
from simdtex.methods import mrf
from simdtex.methods.multires import options as multires
from simdtex.methods.pyramid import options as pyramid
from simdtex.methods.pyramid import solid
from simdtex.options import preset_values, quoted, resolve, table

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = sorted(path for path in (ROOT / "docs").rglob("*.rst") if not {"_build", "gallery"} & set(path.parts))
STORIES = [page for page in PAGES if page.parent.name in ("readers", "from")]
METHODS = {"mrf": mrf, "multires": multires, "pyramid": pyramid}
OF_COMMANDS = {"mix": METHODS["pyramid"], "solid": solid, "classify": classifier}
REFERENCE = "\n".join(
    (ROOT / "docs" / "reference" / name).read_text(encoding="utf-8") for name in ("command-line.rst", "bench.rst")
)
EXTENSION = runpy.run_path(str(ROOT / "docs" / "extensions" / "options.py"))


def page_id(path):
    return str(path.relative_to(ROOT))


def fenced(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def directive(text, language):
    """Bodies of the code blocks of a page, their indentation removed."""
    blocks = re.findall(rf"^\.\. code-block:: {language}\n\n((?:(?:   .*)?\n)+)", text, re.MULTILINE)
    return [re.sub(r"^   ", "", block, flags=re.MULTILINE) for block in blocks]


def commands(text):
    """Lines that call simdtex, without the prompt."""
    blocks = fenced(text, "console") + directive(text, "console")
    lines = [line.removeprefix("$ ") for block in blocks for line in re.sub(r"\\\n *", "", block).splitlines()]
    return [line for line in lines if line.startswith("simdtex ")]


SMALL = {
    **{"[:128, :128]": "[:16, :16]", "(64, 64, 64)": "(8, 10, 12)", "(20, 64, 64)": "(8, 14, 16)"},
    **{"block[:, 20]": "block[:, 2]", "--size 64": "--size 8", "(2, 8, 24, 24)": "(2, 6, 16, 16)"},
    **{"np.arange(24) >= 12": "np.arange(16) >= 8", "data.camera()": "data.camera()[:64, :64]"},
    **{"(256, 256)": "(40, 40)", "256x256": "40x40", "512x512": "40x40", "400x300": "40x30"},
}
"""Sizes of the pages, and those that take a second."""


def small(code):
    """The same code or command at small sizes."""
    for large, less in SMALL.items():
        code = code.replace(large, less)
    return re.sub(r"((ensemble\.)?channels\(\))", r"(image[:40, :40] for image in \1)", code)


@pytest.fixture
def material(tmp_path, monkeypatch):
    """A folder with the files that the texts speak of."""
    sample = data.brick()[:16, :16]
    write(tmp_path / "brick.png", sample)
    write(tmp_path / "gravel.png", data.gravel()[:16, :16])
    write(tmp_path / "brick-height.png", sample.astype(np.uint16) * 257)
    write(tmp_path / "hole.png", np.pad(np.full((3, 4), 255, np.uint8), ((6, 7), (5, 7))))
    write(tmp_path / "brick-normal.png", np.stack([sample] * 3, axis=-1))
    (tmp_path / "brick").mkdir()
    write(tmp_path / "brick" / "brick_albedo.png", sample)
    write(tmp_path / "brick" / "brick_normal.png", np.stack([sample] * 3, axis=-1))
    write(tmp_path / "sample.png", sample)
    write(tmp_path / "training.png", (sample > 128).astype(np.uint8))
    write(tmp_path / "sample-labels.png", np.repeat([0, 1], 8).astype(np.uint8)[:, None] * np.ones(16, np.uint8))
    write(tmp_path / "river-labels.png", np.eye(20, 24, dtype=np.uint8))
    (tmp_path / "wells.csv").write_text("x,y,facies\n3,4,1\n9,12,0\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


PYTHON = {
    code: page_id(page)
    for page in PAGES
    if page not in STORIES
    for code in directive(page.read_text("utf-8"), "python")
}
PYTHON |= {code: "README.md" for code in fenced(README, "python")}  # the pages repeat some of these


@pytest.mark.parametrize(
    ("code", "page"),
    [
        pytest.param(code, page, id=f"{page}-{i}", marks=[pytest.mark.slow] * (page != "README.md"))
        for i, (code, page) in enumerate(PYTHON.items())
    ],
)
def test_python_runs(any_device, code, page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert small(code) != code, "the sizes of this block are not known to the test"
    exec(compile(small(code), page, "exec"), {"__name__": page})


def story(page):
    """The Python blocks and the commands of a page in their order."""
    text = page.read_text(encoding="utf-8")
    for block in re.finditer(r"^\.\. code-block:: (python|console)\n\n((?:(?:   .*)?\n)+)", text, re.MULTILINE):
        body = re.sub(r"^   ", "", block[2], flags=re.MULTILINE)
        yield from [("python", body)] if block[1] == "python" else [("simdtex", line) for line in commands(block[0])]


@pytest.mark.slow
@pytest.mark.parametrize("page", STORIES, ids=page_id)
def test_story_runs(any_device, page, tmp_path, monkeypatch):
    """A page for readers, or for users of another program, from top to bottom in one folder, at small sizes."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SIMDTEX_DEVICE", str(any_device.index))
    names = {"__name__": page.stem}
    for kind, text in story(page):
        if kind == "python":
            exec(compile(small(text), page_id(page), "exec"), names)
            continue
        words = quick(text)[1:]
        assert cli.main(words, standalone_mode=False) in (None, 0), text


def quick(line):
    """The words of a command that makes a small thing soon."""
    words = shlex.split(small(line))
    named = set(words)
    if {"fill", "extend", "tile", "tileset"} & named or ({"synth", "simulate"} & named and "--method" not in words):
        words += ["--order", "8"]
    words += ["--band", "3"] if {"--seamless", "tile"} & named else []  # no more fits a small picture
    words += ["--order", "4", "--seeds", "1", "--size", "12x12"] if "schedules" in words else []
    words += ["--order", "2", "--size", "9x8"] if "maspar" in words[1:2] else []
    return words


def check_outputs(words, folder):
    """What the words say is written is there."""
    if {"synth", "fill", "extend", "tile", "simulate", "solid", "mix"} & set(words):
        outputs = [words[i + 1] for i, word in enumerate(words) if word in ("-o", "--view")]
        outputs += [word.partition("=")[2] for word in words if "=" in word]
        made = "--dry-run" not in words
        assert outputs and all((folder / name).exists() == made for name in outputs)
    if "--stages" in words:
        assert list((folder / "stages").glob("level0-sweep*.png"))


def test_documented_commands_parse_and_doctests_hold():
    for page in PAGES:
        assert doctest.testfile(str(page), module_relative=False, encoding="utf-8").failed == 0, page
        for line in commands(page.read_text("utf-8")):
            _, command, *words = shlex.split(line)
            context = cli.load(command).make_context(command, words)
            params = context.params
            method = METHODS[params["method"]] if "method" in params else OF_COMMANDS.get(command, mrf)
            with context:
                options = {name: value for name, value in given(params).items() if name in table(method.Options)}
            options |= {"preset": params["preset"]} if params.get("preset") else {}
            resolve(method.Options, command, options)


@pytest.mark.slow
def test_the_example_of_the_page_for_geoscientists_runs(any_device):
    """The build of the documentation runs the others, which the gallery shows."""
    made = runpy.run_path(str(ROOT / "examples" / "volume_of_a_reservoir.py"))
    assert 0 < made["p10"] < made["p50"] < made["p90"]


@pytest.mark.slow
def test_what_a_script_needs_is_there(monkeypatch):
    """Its figures are made by hand, so that nothing else would tell."""
    others = (ROOT / "docs" / f"{name}.py" for name in ("blender_window", "pictures", "screenshots"))
    for script in [*sorted((ROOT / "benchmarks").glob("*.py")), *others]:
        with monkeypatch.context() as patch:
            patch.setattr(sys, "path", [str(script.parent), *sys.path])
            names = runpy.run_path(str(script), run_name="imported")
        assert callable(names.get("main")) or "__main__" not in script.read_text(encoding="utf-8"), script


FIRST = (ROOT / "docs" / "index.rst").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("line", dict.fromkeys(commands(README) + commands(FIRST)))
def test_command_of_the_first_pages_runs(any_device, material, line, monkeypatch):
    """In this process, which is quicker than one for each."""
    monkeypatch.setenv("SIMDTEX_DEVICE", str(any_device.index))
    words = quick(line)
    assert cli.main(words[1:], standalone_mode=False) in (None, 0)
    check_outputs(words, material)
    assert simdtex.__file__.startswith(str(ROOT))


def test_the_readme_is_short_and_what_it_names_exists():
    links = [link for link in re.findall(r"\]\(([^)]+)\)", README) if "://" not in link and not link.startswith("#")]
    assert links and [link for link in links if not (ROOT / link.partition("#")[0]).exists()] == []
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    named = re.findall(r"\bmake (demo|test|docs|[a-z]+$)", README, re.MULTILINE)
    assert {"demo", "test", "docs"} <= set(named) <= set(targets)
    assert len(README.splitlines()) < 150


def test_the_first_page_shows_every_command():
    """But those that take minutes, need a run that was stopped, or never end."""
    shown = "\n".join(commands(FIRST))
    every = set(cli.main.commands) - {"bench", "demo", "live", "resume"}
    assert [command for command in every if f"simdtex {command}" not in shown] == []


def test_files_named_on_pages_exist():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        listed = re.findall(r"^   :caption: (.+)$", text, re.MULTILINE)  # what the page has its reader write
        named = re.findall(r"``((?:simdtex|kernels|tests|examples|benchmarks)/[\w/.]+)``", text)
        assert [name for name in named if not (ROOT / name).exists() and name not in listed] == [], page


def test_every_kernel_and_operation_is_in_the_table():
    table = (ROOT / "docs" / "concepts" / "index.rst").read_text(encoding="utf-8")
    for kernel in set((ROOT / "kernels").rglob("*.cl")) - set((ROOT / "kernels" / "maspar").iterdir()):
        named = f"``{kernel.relative_to(ROOT).as_posix()}``"
        assert named in table, kernel
        assert re.search(rf"{named}[^*]*``tests/", table), "its tests are in its row"


def test_every_option_of_the_command_line_is_documented():
    for name in set(cli.main.commands) - {"bench", "devices"}:
        text = re.search(rf"^\.\. command-options:: {name}\n((?:\n|   .*\n)*)", REFERENCE, re.MULTILINE)
        assert f"simdtex {name}\n---" in REFERENCE
        written = EXTENSION["command_options"](name, [line[3:] for line in text[1].splitlines()])
        shown = [part.split()[0] for line in written if line.startswith(".. option") for part in line[11:].split(", ")]
        params = [p for p in cli.load(name).params if isinstance(p, click.Option)]
        assert shown == [flag for p in params for flag in (*p.opts, *p.secondary_opts)]
        unsaid = [line for line in written if len(line.split("[")[-1]) > 1 and "  [" in line]
        assert unsaid == [], "defaults are in words"
    with pytest.raises(AssertionError, match="simdtex fill has no option --nothing"):
        EXTENSION["command_options"]("fill", ["--nothing", "   More on it."])


def test_every_option_of_a_method_has_its_page_with_the_papers_value():
    page = (ROOT / "docs" / "reference" / "options.rst").read_text(encoding="utf-8")
    for method, module in METHODS.items():
        assert set(table(module.Options)) <= set(re.findall(r"``(\w+)``", page))
        rows = "\n".join(EXTENSION["paper_values"](method))
        for name, value in preset_values(module.Options, "paper").items():
            assert re.search(rf"^   \* - ``{name}``\n.*\n     - ``{re.escape(quoted(value))}``$", rows, re.MULTILINE)


WISHES = (ROOT / "docs" / "wishes.rst").read_text(encoding="utf-8")
ASKED = ("synth", "fill", "extend", "simulate")


def test_every_option_answers_a_wish_and_no_wish_names_another():
    params = [p for command in ASKED for p in cli.load(command).params if isinstance(p, click.Option)]
    wished = set(re.findall(r"``(--[\w-]+)", WISHES))
    assert {max(p.opts, key=len) for p in params} <= wished
    assert wished <= {name for p in params for name in (*p.opts, *p.secondary_opts)}
    lines = re.findall(r"^\* .*(?:\n  .*)*", WISHES.partition(".. _wishes-research:")[2], re.MULTILINE)
    assert lines and all("``--" in line and ":doc:" in line for line in lines), "options for research lead to a page"


def test_every_option_of_a_command_is_a_parameter_or_in_the_table_of_names():
    """Except for options that only concern files and messages."""
    page = (ROOT / "docs" / "reference" / "functions.rst").read_text(encoding="utf-8")
    rows = re.findall(r"^   \* - (.*--.*)$", page.partition("Names on the command line")[2], re.MULTILINE)
    others, tables = set(), [*METHODS.values(), *OF_COMMANDS.values()]
    own = {"preset", *(option for one in tables for option in one.Options.__dataclass_fields__)}
    functions = {"synth": "synthesize", "solid": "synthesize_solid", "tile": "extend"}
    for name in ("synth", "fill", "tile", "extend", "simulate", "estimate", "classify", "solid", "mix", "tileset"):
        function = getattr(simdtex, functions.get(name, name))
        options = {max(p.opts, key=len) for p in cli.load(name).params if isinstance(p, click.Option)}
        others |= options - {f"--{one.replace('_', '-')}" for one in own.union(inspect.signature(function).parameters)}
    assert others - {"--report", "--view", "--truth", "--quiet", "--help-all"} == set(
        re.findall(r"--[\w-]+", "\n".join(rows))
    )


def test_public_names_are_in_the_reference():
    page = (ROOT / "docs" / "reference" / "index.rst").read_text(encoding="utf-8")
    assert [name for name in simdtex.__all__ if f"`simdtex.{name}`" not in page] == []

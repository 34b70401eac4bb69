"""An option or an input is declared once: in Python, on the command line, on the live page, and in the types."""

import re
import runpy
import subprocess
import sys
from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from types import SimpleNamespace

import click
import numpy as np
import pytest
from click.testing import CliRunner

import simdtex
from simdtex import declared as inputs
from simdtex.checkpoint import Checkpoint, identity, read
from simdtex.cli import inputs as readers
from simdtex.cli.job import Task, job
from simdtex.cli.options import input_options
from simdtex.jobs import inputs as checks
from simdtex.jobs.classification import options as classifier
from simdtex.methods import mrf
from simdtex.methods.pyramid import options as pyramid
from simdtex.options import Number, documented, option, resolve

ROOT = Path(simdtex.__file__).parents[1]
SAMPLES = SimpleNamespace(channel_axis=None, ascending=None)


def test_the_types_follow_from_the_tables():
    written = (ROOT / "simdtex" / "__init__.pyi").read_text(encoding="utf-8")
    assert written == runpy.run_path(str(ROOT / "docs" / "stubs.py"))["stub"](), "run: python docs/stubs.py"


USES = """\
import numpy as np, simdtex.schedules
sample, size = np.zeros((64, 64)), (256, 256)
simdtex.synthesize(sample, size, full_output=True)[1].source.shape
simdtex.synthesize(sample, size, method="multires", edges="mend", full_output=True)[1].source.shape
simdtex.synthesize(sample, size, method="pyramid", full_output=True)[1].source.shape  # wrong
simdtex.fill(sample, full_output=True)[1].source.shape
simdtex.extend(sample, seamless="x", full_output=True)[1].source.shape
simdtex.synthesize(sample, size, schedule=simdtex.schedules.get("block:8x8"))
simdtex.synthesize(sample, size, schedule="lubi")  # wrong
simdtex.synthesize(sample, size, relaxation="icn")  # wrong
simdtex.synthesize(sample, size, method="mrff")  # wrong
simdtex.synthesize(sample, size, preset="papr")  # wrong
simdtex.simulate(sample, 3, several="meen")  # wrong
simdtex.replay(sample, size, relaxation="icn")  # wrong
"""


@pytest.mark.slow
def test_type_checkers_find_wrong_uses(tmp_path):
    (tmp_path / "uses.py").write_text(USES)
    command = [sys.executable, "-m", "mypy", "--strict", tmp_path / "uses.py"]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout
    wrong = [str(number) for number, line in enumerate(USES.splitlines(), 1) if "wrong" in line]
    assert re.findall(r"uses.py:(\d+): error", said) == wrong, said


def test_signatures_list_options_with_the_defaults_of_the_job():
    for name, method in {"fill": mrf, "extend": mrf, "simulate": mrf, "mix": pyramid, "classify": classifier}.items():
        shown = {one.name: one.default for one in signature(getattr(simdtex, name)).parameters.values()}
        assert vars(resolve(method.Options, name, {})).items() - shown.items() <= {("boundary", "torus")}
    first, of_lcpdf = signature(simdtex.synthesize).parameters, signature(simdtex.lcpdf).parameters
    assert (first["edges"].default, of_lcpdf["order"].default) == ("auto", mrf.Options().neighbourhood)


def test_an_option_that_is_declared_is_everywhere(monkeypatch):
    """In Python with its default, check and preset, in the docstring, on the command line and on the live page."""
    from simdtex.live import job as page

    how = {"jobs": {"mix": 0.75}, "shown": ("mix",), "group": "Appearance", "slider": (0, 1, 0.1)}

    @documented
    @dataclass(frozen=True)
    class Options(pyramid.Options):
        """The options of the method ``pyramid``."""

        glitter: float = option(0.5, Number(0), "Make it glitter", paper=0.25, **how)

    Options.__module__ = "simdtex.methods.pyramid.options"
    monkeypatch.setattr(pyramid, "Options", Options)
    monkeypatch.setitem(page.TABLES, "pyramid", (Options, "mix"))
    given = [
        resolve(Options, job, values).glitter for job, values in [("synth", {}), ("mix", {}), ("mix", {"glitter": 1})]
    ]
    assert given == [0.5, 0.75, 1]
    assert [resolve(Options, "mix", {"preset": "paper", **more}).glitter for more in ({}, {"glitter": 2})] == [0.25, 2]
    with pytest.raises(ValueError, match="glitter is -1; give a number of at least 0"):
        resolve(Options, "synth", {"glitter": -1})
    assert "glitter : float, 0 or more, default 0.5\n" in Options.__doc__ and "Make it glitter." in Options.__doc__
    assert {"name": "glitter", "default": 0.75}.items() <= page.controls("pyramid")[-1].items()

    made = []

    @job()
    def mix(**options):
        """Mix."""
        made.append(options)

    assert CliRunner().invoke(mix, ["--glitter", "0.3"]).exit_code == 0
    assert made[0]["glitter"] == 0.3 and Task
    assert "--glitter FLOAT" in CliRunner().invoke(mix, ["--help"]).output


def test_an_input_that_is_declared_is_everywhere(monkeypatch, tmp_path):
    """A parameter with its default, check, identity and entry in the docstring; an option of the command, and read."""

    @dataclass
    class Fill(inputs.Fill):
        """The inputs of a job."""

        frame: object = inputs.given(
            inputs.Data("(rows, cols) array"),
            "Use the frame in this file",
            "The frame of the picture.",
            checker="frame",
            takes="file",
            reader="read_frame",
        )

    def planned(call):
        """Fill.

        Returns
        -------
        image : array
        """

        def interrupted(*_):
            raise KeyboardInterrupt

        return checks.Work(interrupted, mrf.Options(), call.channel_axis)

    monkeypatch.setitem(inputs.TABLES_OF, "fill", Fill)
    monkeypatch.setitem(checks.CHECKS, "frame", lambda name, value, call: call.image[0] + value)
    monkeypatch.setattr(readers, "read_frame", lambda path, files: f"{files.flag} {path}", raising=False)
    filled = checks.public("fill")(planned)
    assert signature(filled).parameters["frame"].default is None
    assert "frame : (rows, cols) array, optional\n    The frame of the picture.\n" in filled.__doc__
    call, _ = filled.prepare(np.ones((2, 2)), frame=2)
    assert (call.frame == 3).all() and call.grow == 0
    with pytest.raises(ValueError, match="grow is -1; give 0 or more"):
        filled.prepare(np.ones((2, 2)), grow=-1)
    with pytest.raises(KeyboardInterrupt):
        filled(np.ones((2, 2)), frame=2, checkpoint=Checkpoint(tmp_path / "kept"), device="reference")
    assert read(tmp_path / "kept")[0]["inputs"]["frame"] == identity(np.full((2, 2, 1), 3.0))

    command = click.command()(input_options("fill")(lambda **given: print(readers.read_inputs("fill", given, SAMPLES))))
    said = CliRunner().invoke(command, ["--frame", "a.png"]).output
    assert said == "{'channel_axis': None, 'frame': '--frame a.png'}\n"
    assert "--frame FILE" in CliRunner().invoke(command, ["--help"]).output

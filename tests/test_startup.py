"""What starting costs: nothing is imported that is not needed, and the public names are there all the same."""

import json
import os
import re
import signal
import subprocess
import sys
import time
import warnings
from importlib.util import find_spec

import click
import numpy as np
import pytest
from click.testing import CliRunner

import simdtex
from simdtex import commands as cli
from simdtex.cli.command import catch_signals, reporting
from simdtex.io.image import write

HEAVY = {"pyopencl", "scipy", "skimage", "matplotlib", "tifffile", "imagecodecs", "jinja2", "nrrd", "rich"}
HEAVY |= {"xarray", "zarr", "h5netcdf", "pandas", "pyvista", "vtkmodules", "OpenEXR", "pillow_heif"}
HEAVY |= {"rasterio", "sklearn", "joblib"}
PUBLIC = {
    *("Checkpoint", "DeviceError", "Live", "Output", "Progress", "TextureClassifier", "TileStore", "__version__"),
    *("classify", "devices", "ensemble", "estimate", "explain", "extend", "fill", "lcpdf", "mix", "open_machine"),
    *("place_hard_data", "quality", "read_grid", "read_hard_data", "replay", "show", "simulate", "synthesize"),
    *("synthesize_solid", "tileset", "write_grid"),
}
OTHERS = {"importlib.metadata", "PIL.TiffImagePlugin", "simdtex.maspar.accounting", "simdtex.methods.pyramid.algorithm"}
"""What other runs need."""
COMMAND_LINE = """
from simdtex.commands import main
try:
    main({words})
except SystemExit:
    pass
"""


def imported(code):
    """The modules that a process of its own has imported after this code."""
    told = f"{code}\nimport json, sys\nprint(json.dumps([*sys.modules]))"
    result = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True, timeout=120)
    return set(json.loads(result.stdout.splitlines()[-1]))


def test_nothing_is_imported_that_is_not_needed(tmp_path):
    path, out = str(tmp_path / "grey.png"), str(tmp_path / "more.png")
    write(path, np.arange(256, dtype=np.uint8).reshape(16, 16))
    run = ["synth", path, "-o", out, "--size", "8", "--order", "2", "--seed", "1", "--device", "reference"]
    numpy = {*HEAVY, "numpy", "PIL"}
    for code, barred in (
        ("import simdtex; dir(simdtex); simdtex.__version__", numpy),
        (COMMAND_LINE.format(words=["--help"]), numpy),
        (COMMAND_LINE.format(words=["nonsense"]), numpy),
        (COMMAND_LINE.format(words=["synth", "--help"]), HEAVY),
        (COMMAND_LINE.format(words=run), HEAVY | OTHERS),
    ):
        assert imported(code) & barred == set(), code
    assert os.path.exists(out)


@pytest.mark.parametrize(
    ("library", "words", "extra"),
    [
        ("jinja2", ["synth", "a.png", "-o", "b.png", "--report", "page"], "reports"),
        ("matplotlib", ["schedules", "a.png"], "reports"),
        ("nrrd", ["solid", "a.png", "-o", "b.nrrd"], "volumes"),
    ],
)
def test_a_library_of_an_extra_costs_a_sentence(tmp_path, monkeypatch, library, words, extra):
    monkeypatch.chdir(tmp_path)
    write("a.png", np.arange(256, dtype=np.uint8).reshape(16, 16))
    for name in [name for name in sys.modules if name.startswith(("simdtex.figures", library))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, library, None)
    said = CliRunner().invoke(cli.main, words)
    assert (said.exit_code, said.output) == (
        2,
        f"simdtex: {library} is not installed; pip install 'simdtex[{extra}]'\n",
    )
    assert os.listdir() == ["a.png"]


def test_every_public_name_is_there_and_a_name_of_another_program_names_ours():
    assert set(dir(simdtex)) >= PUBLIC and set(simdtex.__all__) == PUBLIC - {"__version__"}
    assert all(getattr(simdtex, name) is not None for name in PUBLIC) and callable(simdtex.devices)
    ours = {"synthesise": "synthesize", "inpaint": "fill", "seamless": "extend", "nonsense": None}
    for theirs, name in ours.items():
        meant = f"; did you mean '{name}'?" if name else ""
        with pytest.raises(AttributeError, match=f"module 'simdtex' has no attribute '{theirs}'{re.escape(meant)}$"):
            getattr(simdtex, theirs)


# Ctrl-C while the command line is starting

INTERRUPT = """
import os, signal, sys

class Finder:
    # sends the signal of Ctrl-C when a module is asked for first
    def find_spec(self, name, path=None, target=None):
        if name == os.environ["INTERRUPT_AT"]:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Finder())
"""
WAYS = {
    "module": ["-m", "simdtex"],
    "script": ["-c", "import sys; from simdtex.__main__ import main; sys.exit(main())"],
}


def interrupted(tmp_path, way, module, size="64", before=None):
    (tmp_path / "sitecustomize.py").write_text(INTERRUPT)
    write(tmp_path / "grey.png", np.arange(256, dtype=np.uint8).reshape(16, 16))
    words = ["synth", str(tmp_path / "grey.png"), "-o", str(tmp_path / "out.png"), "--size", size, "-q"]
    paths = [str(tmp_path), os.environ.get("PYTHONPATH", "")]
    return subprocess.run(
        [sys.executable, *WAYS[way], *words, "--device", "reference"],
        env=os.environ | {"INTERRUPT_AT": module, "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
        timeout=100,
        preexec_fn=before,
    )


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no such signal")
@pytest.mark.parametrize(("way", "module"), [("module", "simdtex.commands"), ("script", "click")])
def test_ctrl_c_during_imports_ends_with_one_line(tmp_path, way, module):
    result = interrupted(tmp_path, way, module)
    assert result.returncode == 130, result.stderr
    assert result.stderr.startswith("simdtex: stopped") and result.stderr.count("\n") == 1
    assert not (tmp_path / "out.png").exists()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no such signal")
def test_a_ctrl_c_that_was_to_be_ignored_is(tmp_path):
    result = interrupted(tmp_path, "module", "click", "4", lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
    assert (result.returncode, result.stderr) == (0, "")
    assert (tmp_path / "out.png").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no such signal")
def test_ctrl_c_waits_where_an_exception_would_do_harm():
    """In the search for runtimes, which would leave its temporary folder, and in callbacks of what is collected."""
    code = "def search(over):\n signal.raise_signal(signal.SIGINT)\n time.sleep(0.05)\n over.append(True)"
    for module in ("simdtex.machine.devices", "_weakrefset"):
        assert find_spec(module)
        over, names = [], {"__name__": module, "signal": signal, "time": time}
        exec(code, names)
        with pytest.raises(KeyboardInterrupt), catch_signals(click.Context(click.Command("any"))):
            names["search"](over)
            for _ in range(600):  # until the signal comes again
                time.sleep(0.1)
        assert over


def test_what_ctrl_c_leaves_undone_is_not_warned_of():
    @click.command()
    @reporting()
    def stopped():
        raise KeyboardInterrupt

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert CliRunner().invoke(stopped).exit_code == 130
        warnings.warn("coroutine 'AsyncGroup.create_array' was never awaited", RuntimeWarning, stacklevel=1)
        with pytest.raises(RuntimeWarning):
            warnings.warn("another", RuntimeWarning, stacklevel=1)

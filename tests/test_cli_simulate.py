"""``simdtex simulate``, end to end."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import simdtex
from simdtex.cli import main
from simdtex.io import image
from simdtex.io.hard_data import read_hard_data

xarray = pytest.importorskip("xarray")
pytest.importorskip("zarr")
pytest.importorskip("h5netcdf")

OPTIONS = {"order": 2, "rng": 5, "device": "reference"}
ENDS = (".png", ".tif", ".npy", ".npz", ".nc", ".zarr", ".csv", ".xyz")


@pytest.fixture
def folder(tmp_path):
    """Training images of three kinds, and tables of hard data."""
    rng = np.random.default_rng(2)
    row, col = np.indices((16, 20))
    grey = np.rint(120 + 80 * np.sin(row * 0.9 + col * 0.5) + rng.uniform(-20, 20, (16, 20))).astype(np.uint8)
    facies = (grey > 120).astype(np.uint8) * np.uint8(3)
    holed = grey.astype(np.float32)
    holed[4:6, 7:9] = np.nan
    pictures = {
        "grey.png": grey,
        "second.png": grey[::-1, :15],
        "facies.png": facies,
        "colour.png": rng.integers(0, 256, (16, 20, 3), dtype=np.uint8),
        "holed.tif": holed,
    }
    for name, pixels in pictures.items():
        image.write(tmp_path / name, pixels)
    tables = {
        "wells.csv": "x,y,value\n3,4,200\n10.4,7,17\n",
        "facies.csv": "x,y,facies\n3,4,3\n10,7,0\n5,5,3\n",
    }
    np.save(tmp_path / "huge.npy", np.where(facies, 1e200, 3.0))
    for name, text in tables.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def simulate(folder, *args):
    """Run the command; what ends like a file, or is a report, is one of the folder."""

    def placed(text):
        if not text.endswith((*ENDS, "report")) or text.startswith("-"):
            return text
        return "=".join(f"{folder}/{part}" for part in text.split("="))

    words = [placed(str(arg)) for arg in args]
    return CliRunner().invoke(main, ["simulate", *words, "--order", "2", "--seed", "5", "--device", "reference"])


def made(folder, *args, out="out.npz"):
    result = simulate(folder, *args, "-o", out)
    assert result.exit_code == 0, result.output
    if not out.endswith(".npz"):
        with xarray.open_dataarray(folder / out) as found:
            return found.load()
    with np.load(folder / out) as arrays:
        dims = ("realisation", "y", "x", "variable")[: arrays["values"].ndim]
        coordinates = {name: arrays[name] for name in ("realisation", "y", "x")}
        coordinates["seed"] = ("realisation", arrays["seed"])
        return xarray.DataArray(arrays["values"], coordinates, dims, attrs=json.loads(str(arrays["attributes"])))


def pixels(folder, name):
    return image.read(folder / name).pixels


def contents(folder):
    """Every file and folder by name, a file with its bytes."""
    return {str(path.relative_to(folder)): path.is_file() and path.read_bytes() for path in folder.rglob("*")}


def assert_same(ours, theirs):
    """Two arrays of realisations agree in values, types, coordinates and attributes."""
    assert (ours.dtype, ours.dims) == (theirs.dtype, theirs.dims)
    assert ours.values.tobytes() == theirs.values.tobytes()
    for name in theirs.coords:
        assert np.array_equal(ours[name], theirs[name])
    assert ours.attrs == theirs.attrs


@pytest.mark.parametrize("suffix", ["npz", "nc", "zarr"])
def test_the_bytes_of_the_function_in_every_format(folder, suffix):
    found = made(folder, "grey.png", "-n", 3, "--first", 2, "--size", "14x12", out=f"out.{suffix}")
    assert_same(found, simdtex.simulate(pixels(folder, "grey.png"), 3, first=2, shape=(12, 14), **OPTIONS))


def test_what_is_told(folder):
    args = ("grey.png", "-n", 2, "--size", "14x12", "-o", "out.npz", "--jobs", 2)
    result = simulate(folder, *args)
    assert result.exit_code == 0
    assert "2 realisations of 14x12 in" in result.output and "on reference" in result.output
    assert "seed 5" in result.output
    assert simulate(folder, *args, "-q").output == ""
    assert "1 realisation of 20x16" in simulate(folder, "grey.png", "-o", "out.npz").output


def test_options_are_handed_on(folder):
    args = ("--size", "14x12", "--novelty", 1, "--boundary", "torus", "--free-sweeps", 1)
    found = made(folder, "grey.png", *args)
    options = {"novelty": 1.0, "boundary": "torus", "free_sweeps": 1} | OPTIONS
    assert_same(found, simdtex.simulate(pixels(folder, "grey.png"), 1, shape=(12, 14), **options))


def test_colour_has_variables(folder):
    found = made(folder, "colour.png", "--size", "14x12")
    assert found.dims == ("realisation", "y", "x", "variable") and found.shape == (1, 12, 14, 3)
    assert_same(found, simdtex.simulate(pixels(folder, "colour.png"), 1, shape=(12, 14), channel_axis=-1, **OPTIONS))


def test_a_table_of_hard_data(folder):
    found = made(folder, "grey.png", "-n", 2, "--known", "wells.csv", "--size", "14x12")
    assert (found.values[:, 4, 3] == 200).all() and (found.values[:, 7, 10] == 17).all()
    table = read_hard_data(folder / "wells.csv")
    assert_same(found, simdtex.simulate(pixels(folder, "grey.png"), 2, shape=(12, 14), known=table, **OPTIONS))


def test_categories(folder):
    found = made(folder, "facies.png", "-n", 2, "--known", "facies.csv", "--size", "14x12", "--categorical")
    assert set(np.unique(found)) == {0, 3}
    assert (found.values[:, 4, 3] == 3).all() and (found.values[:, 7, 10] == 0).all()


def test_an_existing_file_is_replaced(folder):
    made(folder, "grey.png", "-n", 2, "--size", "14x12")
    assert made(folder, "grey.png", "--size", "9x8").shape == (1, 8, 9)


def test_a_report_is_a_page_and_numbers(folder):
    pytest.importorskip("gstools")
    args = ("--known", "facies.csv", "--size", "14x12", "--categorical", "--report", "report")
    made(folder, "facies.png", "-n", 2, *args)
    page = (folder / "report" / "index.html").read_text(encoding="utf-8")
    assert "simdtex simulate" in page and "facies.csv" in page
    results = json.loads((folder / "report" / "results.json").read_text(encoding="utf-8"))
    assert results["files"] == sorted(path.name for path in (folder / "report").iterdir())


GREY = ["grey.png", "-o", "out.npz", "--size", "14x12"]
FACIES = ["facies.png", "-o", "out.npz", "--size", "14x12", "--categorical"]
BAD = {
    "an unknown suffix": (["grey.png", "-o", "out.xyz"], "names no format of realisations"),
    "proportions in words": ([*FACIES, "--proportions", "half"], "numbers parted by commas"),
    "no realisation": ([*GREY, "-n", 0], "n is 0; give 1 or more"),
    "a report of several": (["grey.png", "second.png", "-o", "out.npz", "--report", "report"], "leave it out"),
    "a report of next to nothing": (["grey.png", "-o", "out.npz", "--size", "9x3", "--report", "report"], "4x4 pixels"),
    "a report of colour": (["colour.png", "-o", "out.npz", "--report", "report"], "one variable"),
    "a report of vast values": (["huge.npy", "-o", "out.npz", "--report", "report"], "up to 1e+100; give them in"),
    "a report of gaps": (["holed.tif", "-o", "out.npz", "--report", "report"], "known everywhere"),
}


def refused(folder, args, words):
    before = contents(folder)
    result = simulate(folder, *args)
    assert result.exit_code == 2, result.output
    assert words in result.output
    assert len(result.output.strip().splitlines()) == 1
    assert contents(folder) == before


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gets_one_sentence_and_writes_nothing(folder, case):
    refused(folder, *BAD[case])

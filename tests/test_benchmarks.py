"""Benchmarks: `simdtex bench`, and figures of benchmarks/ on cases whose fault is known."""

import csv
import json
from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest
from cases import texture
from commands import refused, run
from scipy.ndimage import gaussian_filter

from simdtex.figures.tables import benchmark_table
from simdtex.io.image import write
from simdtex.jobs.studies import benchmark
from simdtex.jobs.studies.benchmark import Case, Sizes
from simdtex.machine.devices import DeviceError
from simdtex.machine.reference import Reference

# -- Benchmarks: cases, how they are timed, and the table. No time is asserted.

MRF = Case("mrf", 16, 16, 2, "exact")
TINY = Sizes((Case("multires", 16, 16), Case("pyramid", 16, 16), Case("solid", 16, 8)), (MRF,), 0.0)


def test_the_fastest_run_counts(monkeypatch):
    times, made = [(9.0, 1.0), (5.0, 2.0), (3.0, 2.5), (4.0, 1.5)], []
    monkeypatch.setattr(benchmark, "once", lambda *_: made.append(times[len(made)]) or made[-1])
    for budget, runs in ((9.0, 4), (0.0, 2)):
        made.clear()
        assert benchmark.fastest(Reference(), MRF, budget) == min(made[1:]), "the first compiles"
        assert len(made) == runs


def test_everything_is_measured(any_device, tmp_path, monkeypatch):
    monkeypatch.setattr(benchmark, "QUICK", TINY)
    done = run("bench", "--quick", "--device", any_device.index, "--json", tmp_path / "r.json")
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "r.json").read_text())
    [entry] = found["devices"]
    assert any_device.name.strip() in entry["device"]["name"]
    assert [case["name"] for case in entry["cases"]] == [case.name for case in (*TINY.devices, *TINY.reference)]
    for case in entry["cases"]:
        assert 0 < case["busy"] < case["seconds"] < found["seconds"]
        assert (case["reference"] or 0) >= 0 and (case["reference"] is None) == (case["name"] != MRF.name)
        assert case["name"] in done.stdout
    assert f"the NumPy reference: {MRF.name}" in done.stderr


def test_the_table_shows_ratios():
    case = {"name": "a", "seconds": 2.0, "busy": 1.5, "reference": None}
    device = {"name": "d", "compute_units": 2, "version": "OpenCL 3.0", "driver": "5"}
    shown = benchmark_table({"device": device, "cases": [case, case | {"name": "b", "reference": 123.4}]})
    assert shown.caption == "d, 2 compute units, OpenCL 3.0, driver 5"
    assert [[*row.values()] for row in shown.rows] == [["a", "2 s", "75%", "n/a"], ["b", "2 s", "75%", "123 x"]]


def test_simulators_and_the_reference_are_not_measured(cl_device):
    assert not any(info.simulated or info.kind == "reference" for info in benchmark.chosen())
    with pytest.raises(DeviceError, match="the reference is measured with every device; give an OpenCL device"):
        benchmark.chosen("reference")


def test_bad_input_is_one_sentence_before_anything_is_measured(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(benchmark, "run", None)
    refused("end its name in one of .json", "bench", "--json", "results.txt")
    refused("no such device", "bench", "--device", "no such device")


# -- The figures of benchmarks/classify.py, on labels whose fault is known, and its tables at a tiny size.
NAMES = ("brick", "grass", "gravel")


@pytest.fixture
def classify(script):
    return script("classify")


def test_the_distance_to_a_border_is_that_to_the_nearest_pixel_of_another_label(classify):
    truth = np.ones((40, 44), int)
    truth[:, 20:] = 2
    col = np.arange(44)
    expected = np.where(col < 20, 20 - col, col - 19)
    assert (classify.border_distance(truth) == expected).all()
    assert np.isinf(classify.border_distance(np.ones((4, 5), int))).all()


@pytest.mark.slow
def test_the_tables(classify, tmp_path, monkeypatch):
    for name, seed in (("red", 3), ("blue", 4)):
        write(tmp_path / f"{name}.png", texture((64, 64), 3, seed=seed))
    write(tmp_path / "grey.png", texture((64, 64), seed=5))
    small = SimpleNamespace(**{name: lambda n=n: texture((128, 128), seed=n) for n, name in enumerate(NAMES)})
    for name, value in (("data", small), ("SHOWN", 100), ("FIELDS", [(8, 2)])):
        monkeypatch.setattr(classify, name, value)
    parts = [part for part in classify.PARTS if part == "unknown" or find_spec("sklearn")]
    words = ["--textures", tmp_path, "--only", "*.png", "--draws", "1", "--side", "64", "--out", tmp_path]
    classify.main([*map(str, words), "--parts", ",".join(parts)], standalone_mode=False)
    for part in parts:
        with open(tmp_path / f"{part}.csv", encoding="utf-8", newline="") as file:
            header, *rows = csv.reader(file)
        assert rows and all(len(row) == len(header) for row in rows), part


# -- The figures of benchmarks/fill.py, on fillings whose fault is known.
@pytest.fixture
def fill(script):
    return script("fill")


def test_a_periodic_filling_is_found_in_the_known_part(fill):
    picture = np.tile(np.random.default_rng(1).integers(0, 256, (8, 8), np.uint8), (6, 6))
    known = picture.copy()
    known[40:] = np.random.default_rng(2).integers(0, 256, (8, 48), np.uint8)  # or known patches are all found too
    hole = np.zeros(picture.shape, bool)
    hole[12:24, 12:24] = True
    found = fill.score(known, known, hole)
    assert found["rim"] == found["inside"] == 0


def test_a_bright_filling_has_a_seam_and_a_blurred_one_small_steps(fill):
    picture = np.random.default_rng(1).integers(0, 256, (64, 64), np.uint8)
    hole = np.zeros(picture.shape, bool)
    hole[24:44, 24:48] = True
    blurred = gaussian_filter(picture.astype(float), 1.5)
    smooth = np.where(hole, blurred, picture)
    assert fill.score(picture, smooth, hole)["step"] < 0.5
    soft = blurred.astype(np.uint8)
    raised = np.where(hole, soft + np.uint8(60), soft)
    assert fill.score(soft, soft, hole)["seam"] < 1.2
    assert fill.score(soft, raised, hole)["seam"] > 3


@pytest.mark.slow
def test_one_command_gives_the_tables_and_the_sheets(fill, tmp_path, monkeypatch):
    monkeypatch.setattr(fill, "ADDED", {"right": 4})
    (tmp_path / "in").mkdir()
    write(tmp_path / "in" / "red.png", texture((20, 20), 3))
    words = ["--samples", tmp_path / "in", "--options", "order=2", "--device", "reference", "--out", tmp_path]
    fill.main([*map(str, words)], standalone_mode=False)
    with open(tmp_path / "fill.csv", encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    assert {line["filling"] for line in lines} == {"fill", "order=2", "biharmonic", "original"}
    with open(tmp_path / "tile.csv", encoding="utf-8", newline="") as file:
        assert [line["filling"] for line in csv.DictReader(file)] == 2 * ["as it is", "band 4", "continued"]
    assert (tmp_path / "fill-red.png").is_file() and (tmp_path / "tile-red.png").is_file()


# -- The figures of benchmarks/simulation.py on truths, and the files of SNESIM.
def test_truths_are_no_part_of_their_training_image_and_as_many_as_asked(script, monkeypatch, tmp_path):
    simulation = script("simulation")
    monkeypatch.setattr(simulation, "DRAWN", 2)

    def numbers(shape, seed):
        return np.arange(np.prod(shape)).reshape(shape) + 1e6 * seed

    (tmp_path / "lake.csv").write_text(
        '"U","V","X","Y"\n' + "".join(f"0,{x * y},{x},{y}\n" for y in range(1, 9) for x in range(1, 7))
    )
    drawn, lake = [*simulation.drawn(numbers, 3, 5)], [*simulation.lake(tmp_path / "lake.csv", 3, 5)]
    assert [len(truths) for _, truths in drawn] == [3, 2] and [len(truths) for _, truths in lake] == [2, 1, 1, 1]
    for training, truths in drawn:
        assert training.shape == (6, 6) and not np.isin(truths, training).any()
    assert [training.shape for training, _ in lake] == [(5, 6), (8, 3), (5, 6), (8, 3)]
    assert lake[2][1][0].all() and not lake[0][1][0].all(), "V is largest where x and y are, in the last rows"


def test_intervals_of_draws_of_one_law_have_so_many_truths(script):
    simulation = script("simulation")
    draws = np.random.default_rng(1).normal(size=(21, 4000))
    assert simulation.within(draws[:20], draws[20]).mean() == pytest.approx(0.8 * 19 / 21, abs=0.02)
    image = np.zeros((9, 9), int)
    image[1:3], image[6, 6] = 1, 1
    known = np.ma.masked_all((9, 9), int)
    known[1, 1], known[6, 6], known[4, 4] = 1, 1, 0
    assert simulation.areas(image, known).tolist() == [18, 1] and simulation.areas(image, None) == [18]

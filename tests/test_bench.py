"""Benchmarks: cases, how they are timed, and the ratios. No time is asserted."""

import json
import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from simdtex.bench import cases, limits
from simdtex.bench import run as benchmark
from simdtex.bench.cases import SIZES, Case, Sizes, Sweeps, measure, once
from simdtex.bench.limits import measure_copy, measure_peak
from simdtex.cli import main
from simdtex.machine.devices import DeviceError
from simdtex.machine.opencl import OpenCL
from simdtex.machine.reference import Reference
from simdtex.report.bench import plot, tables

SPEED = Path(__file__).resolve().parent.parent / "benchmarks" / "speed.py"
MRF = Case("mrf", 16, 16, 2, "exact")
TINY = Sizes(
    "tiny",
    repeats=1,
    budget=0.0,
    seconds=0.0,
    jobs=(MRF, Case("multires", 16, 16), Case("pyramid", 16, 16), Case("solid", 16, 8)),
    reference=(MRF,),
    growth={"output pixels": [(Case("mrf", 16, 12, 2, "exact"), MRF)]},
)


@pytest.fixture(scope="module")
def command(any_device, tmp_path_factory):
    """The tiniest benchmark from the command line: what it printed, and the folder that it wrote into."""
    folder = tmp_path_factory.mktemp("bench")
    words = ["--device", str(any_device.index), "--json", str(folder / "r.json"), "--plot", str(folder / "plots")]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(cases, "SIZES", {"quick": TINY})
        patched.setattr(limits, "CACHES", 2**20)
        done = CliRunner().invoke(main, ["bench", "--quick", *words])
    assert done.exit_code == 0, done.output
    return done, folder


@pytest.fixture(scope="module")
def found(command):
    """Its results."""
    return json.loads((command[1] / "r.json").read_text())


# ---------------------------------------------------------------- what is measured


@pytest.mark.parametrize("sizes", SIZES.values(), ids=SIZES)
def test_cases_have_unique_names(sizes):
    names = [case.name for case in sizes.cases]
    assert len(set(names)) == len(names) == len(sizes.cases)
    assert set(sizes.reference) <= set(sizes.jobs)
    assert {(case.search, case.order) for case in sizes.jobs if case.method == "mrf"} >= {
        (search, order) for search in ("exact", "coherent") for order in (8, 18, 32)
    }
    for what, rows in sizes.growth.items():
        for row in rows:
            assert len({case.size[what] for case in row}) == len(row) > 1
            assert len({(case.method, case.search) for case in row}) == 1


def test_names_and_sizes():
    assert Case("solid", 64, 32).name == "solid, 64 -> 32^3"
    assert Case("mrf", 64, 32, 8, "exact").name == "mrf exact, order 8, 64 -> 32"
    assert Case("mrf", 10, 20, 8).size == {
        "output pixels": 400,
        "voxels": 8000,
        "sample pixels": 100,
        "neighbours": 24,
    }


def test_a_case_counts_the_work_of_weighing_every_candidate():
    run = once(Reference(), MRF)
    warm, cold = run["phases"]
    finest = run["levels"][-1]
    assert [phase["phase"] for phase in run["phases"]] == ["warm", "cold"]
    assert warm["relaxations"] + cold["relaxations"] == finest["relaxations"]
    assert cold["relaxations"] == 2 * 16 * 16  # free sweeps
    assert warm["brute_force"] + cold["brute_force"] == finest["fma"]
    assert run["brute_force"] == sum(level["fma"] for level in run["levels"])
    assert 0 < cold["seconds"] < run["seconds"]


def test_sweeps_are_summed_by_phase(monkeypatch):
    clock = iter([0.0, 1.0, 3.0, 7.0, 15.0])
    monkeypatch.setattr("simdtex.bench.cases.perf_counter", lambda: next(clock))
    sweeps = Sweeps(SimpleNamespace(sync=lambda: None, seconds=None))
    for level, phase, ended in (
        (1, "free", True),
        (0, "relax", False),
        (0, "relax", True),
        (0, "free", True),
        (0, "free", True),
    ):
        sweeps(SimpleNamespace(level=level, phase=phase, end_of_sweep=ended))
    assert {phase: list(times) for phase, times in sweeps.times.items()} == {"relax": [2.0, 0.0], "free": [12.0, 0.0]}


def test_a_device_is_timed_with_and_without_a_profile(any_device):
    machine = OpenCL(any_device, profile=True)
    case = measure(machine, MRF, repeats=2)
    assert 0 < case["phases"][1]["busy"] < case["busy"]
    assert {kernel["name"] for kernel in case["kernels"]} >= {"relax_all", "start"}
    assert 0 < case["fma"] <= case["brute_force"]
    plain = measure(Reference(), MRF)
    assert (plain["busy"], plain["kernels"], plain["phases"][0]["busy"]) == (None, None, None)


@pytest.mark.parametrize(("long", "runs"), [(False, 3), (True, 1)])
def test_the_fastest_run_counts(monkeypatch, long, runs):
    seconds = iter([9.0 if long else 0.0, 5.0, 4.0, 6.0, 7.0])
    made = []

    def run(machine, case):
        made.append(next(seconds))
        return {"seconds": made[-1], "levels": [], "device_seconds": 1.0, "kernels": []}

    monkeypatch.setattr(cases, "once", run)
    case = measure(SimpleNamespace(seconds=0.0), Case("pyramid", 8, 8), repeats=3, budget=8.0)
    assert case["seconds"] == (9.0 if long else 4.0)
    assert len(made) == (1 if long else 1 + runs)


def test_limits_are_the_highest_rates_of_all_widths(any_device, monkeypatch):
    monkeypatch.setattr(limits, "CACHES", 2**20)
    machine = OpenCL(any_device)
    for limit, what in ((measure_peak(machine, 0.0), "fma"), (measure_copy(machine, 0.0), "bytes")):
        assert set(limit["by_width"]) == {"1", "4", "8", "16"}
        assert limit[what] == max(limit["by_width"].values()) == limit["by_width"][str(limit["width"])] > 0
    assert set(measure_peak(machine, 0.0, [4])["by_width"]) == {"4"}


def test_the_reference_is_no_device_to_measure(any_device):
    with pytest.raises(DeviceError, match="the reference is measured with every device"):
        benchmark.chosen("reference")
    assert benchmark.chosen(str(any_device.index)) == [any_device]
    assert any_device.name in [info.name for info in benchmark.chosen()]


# ---------------------------------------------------------------- what is written


def test_bench_prints_tables_and_its_progress(command, found):
    done, folder = command
    assert done.stderr.splitlines()[0].startswith("the NumPy reference")
    assert done.stderr.splitlines()[1].endswith("limits")
    assert found["devices"][0]["device"]["name"] in done.stdout
    for text in ("fma/s", "Whole jobs", "LCPDF step", "cold", "Growth of the time"):
        assert text in done.stdout
    assert [Path(line) for line in done.stdout.splitlines()[-3:]] == [
        *(folder / "r.json", folder / "plots" / "roofline.png", folder / "plots" / "growth.png")
    ]
    assert all(path.stat().st_size > 10_000 for path in (folder / "plots").iterdir())


def test_results_have_all_entries(found):
    assert found["sizes"] == "tiny" and found["format"] == benchmark.FORMAT
    assert set(found["host"]) == {"cpu", "cores", "system", "python", "numpy"}
    (entry,) = found["devices"]
    assert set(entry) == {"device", "peak", "copy", "cases", "growth"}
    assert set(entry["device"]) == {"name", "kind", "version", "driver", "units", "memory"}
    assert {case["name"]: case["job"] for case in entry["cases"]} == {
        case.name: case in TINY.jobs for case in TINY.cases
    }
    for case in entry["cases"]:
        assert case["seconds"] > 0 and case["busy"] > 0 and case["kernels"] and case["peak"] > 0
        assert (case["reference"] is not None) == (case["name"] == MRF.name)
    (curve,) = entry["growth"]
    assert (curve["name"], curve["what"], curve["sizes"]) == ("mrf exact", "output pixels", [144, 256])


def test_plots_of_several_devices(found, tmp_path):
    written = plot(found | {"devices": found["devices"] * 2}, tmp_path)
    assert [path.name for path in written] == ["roofline-0.png", "growth-0.png", "roofline-1.png", "growth-1.png"]
    assert all(path.stat().st_size > 10_000 for path in written)


def test_quiet_bench_prints_nothing(any_device, monkeypatch):
    monkeypatch.setattr(benchmark, "run", lambda sizes, infos, tell: tell("something"))
    done = CliRunner().invoke(main, ["bench", "-q", "--device", str(any_device.index)])
    assert (done.exit_code, done.output) == (0, "")


def test_speed_compares_two_results(command, found, monkeypatch, capsys):
    path = str(command[1] / "r.json")
    monkeypatch.setattr(sys, "argv", [str(SPEED), path, path])
    runpy.run_path(str(SPEED), run_name="__main__")
    assert capsys.readouterr().out.count("1.00 x") == 2 * len(found["devices"][0]["cases"])


@pytest.mark.parametrize("text", ["{}", "[1]", "nonsense", '{"format": "simdtex bench 2"}', "\udcff"])
def test_speed_refuses_another_file(tmp_path, text, monkeypatch):
    path = tmp_path / "r.json"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    monkeypatch.setattr(sys, "argv", [str(SPEED), str(path), str(path)])
    with pytest.raises(SystemExit, match=r"r\.json holds no results of simdtex bench"):
        runpy.run_path(str(SPEED), run_name="__main__")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--device", "reference"], "the reference is measured with every device"),
        (["--device", "no such device"], 'No device matches "no such device"'),
        (["--json", "results.txt"], "end its name in one of .json"),
        (["--json", "nowhere/results.json"], "nowhere"),
        (["--plot", "file"], "file is a file: give a folder for the plots"),
        (["--plot", "full"], "holds other files (notes.txt)"),
    ],
)
def test_bad_input_is_one_sentence(any_device, tmp_path, monkeypatch, words, sentence):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes.txt").touch()
    done = CliRunner().invoke(main, ["bench", "--quick", *words])
    assert done.exit_code == 2
    assert sentence in done.output
    assert done.output.count("\n") == 1


# ---------------------------------------------------------------- ratios


def kernel(seconds, fma, moved):
    return {"seconds": seconds, "fma": fma, "bytes": moved}


PHASE = {"phase": "cold", "seconds": 2.0, "busy": 1.0, "relaxations": 100, "brute_force": 80.0}
JOB = {"seconds": 4.0, "busy": 3.0, "fma": 150.0, "brute_force": 200.0, "phases": [PHASE]}
JOB |= {"kernels": [kernel(3.0, 150.0, 30.0)]}


def test_ratios_of_a_job_and_its_phases():
    slow = {"seconds": 60.0, "phases": [PHASE | {"seconds": 6.0, "relaxations": 50}]}
    found = benchmark.ratios(JOB, 100.0, 50.0, slow)
    names = ("peak", "fma_rate", "of_peak", "of_copy", "effective", "reference")
    assert [found[name] for name in names] == [100.0, 50.0, 0.5, 0.2, 0.5, 15.0]
    assert found["phases"] == [PHASE | {"rate": 80.0, "of_peak": 0.8, "effective": 0.4, "reference": 6.0}]
    alone = benchmark.ratios(JOB, 100.0, 50.0, None)
    assert alone["reference"] is alone["phases"][0]["reference"] is None


def test_ratios_of_a_job_whose_kernels_state_their_work():
    other = {"seconds": 2.0, "busy": 1.0, "fma": None, "brute_force": None, "phases": None}
    other |= {"kernels": [kernel(0.75, 15.0, 30.0), kernel(0.25, None, 10.0)]}
    found = benchmark.ratios(other, 50.0, 50.0, None)
    names = ("fma_rate", "of_peak", "of_copy", "effective", "phases")
    assert [found[name] for name in names] == [15.0, 0.3, 0.8, None, None]
    other["kernels"] = [kernel(1.0, 10.0, 4.0), kernel(1.0, None, 4.0)]  # half of the time says nothing
    assert benchmark.ratios(other, 50.0, 50.0, None)["fma_rate"] is None


@pytest.mark.parametrize("power", [0.0, 0.5, 1.0, 2.0])
def test_the_exponent_is_that_of_the_power(power):
    grown = [100.0, 400.0, 900.0]
    assert benchmark.exponent(grown, [3 * size**power for size in grown]) == pytest.approx(power, abs=1e-9)
    assert benchmark.exponent([4.0], [1.0]) is benchmark.exponent([4.0, 4.0], [1.0, 2.0]) is None


def test_the_tables_show_the_ratios():
    case = benchmark.ratios(JOB, 100.0, 50.0, None) | {"name": "a job", "job": True}
    curve = {"name": "mrf", "what": "neighbours", "sizes": [8, 1000], "seconds": [0.5, 2.0], "exponent": None}
    steps, jobs, growth = tables({"cases": [case, case | {"job": False}], "growth": [curve]})
    assert list(steps.rows[0].values()) == ["a job", "cold", "100", "2.00 s", "80.0", "80.0 %", "40.0 %", "-"]
    assert [list(row.values()) for row in jobs.rows] == [
        ["a job", "4.00 s", "75.0 %", "50.0", "50.0 %", "20.0 %", "50.0 %", "-"]
    ]
    assert list(growth.rows[0].values()) == ["mrf", "neighbours", "8: 500 ms", "1,000: 2.00 s", "-"]

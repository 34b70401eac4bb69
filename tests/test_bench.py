"""Benchmarks: cases, results and what is worked out of them. Nothing is timed here to any end."""

import copy
import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from simdtex.bench import limits, sizes
from simdtex.bench import results as worked_out
from simdtex.bench import run as benchmark
from simdtex.bench.cases import Case, Sweeps, brute_force, case_of, measure, once, searches
from simdtex.bench.elsewhere import measure_elsewhere
from simdtex.bench.limits import measure_copy, measure_peak
from simdtex.bench.sizes import FULL, QUICK, Sizes, with_searches
from simdtex.cli import main
from simdtex.machine.devices import DeviceError
from simdtex.machine.opencl import OpenCL
from simdtex.machine.reference import Reference
from simdtex.report.bench import percent, plot, times

SPEED = Path(__file__).resolve().parent.parent / "benchmarks" / "speed.py"
MRF = Case("mrf", 16, 16, 2, searches()[0])
TINY = Sizes(
    "tiny",
    repeats=1,
    budget=0.0,
    seconds=0.0,
    jobs=(Case("mrf", 16, 16, 2), Case("multires", 16, 16)),
    library=(Case("mrf", 16, 16, 2),),
    reference=(Case("pyramid", 16, 16), Case("solid", 16, 8)),
    growth={"mrf: output pixels": (Case("mrf", 16, 12, 2), Case("mrf", 16, 16, 2))},
)


@pytest.fixture(scope="module")
def command(any_device, tmp_path_factory):
    """The tiniest benchmark from the command line: what it printed, and the folder that it wrote into."""
    folder = tmp_path_factory.mktemp("bench")
    words = ["--device", str(any_device.index), "--json", str(folder / "r.json"), "--plot", str(folder / "plots")]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sizes, "QUICK", TINY)
        patched.setattr(sizes, "FULL", None)  # --quick is what is asked for
        patched.setattr(limits, "CACHES", 2**20)
        done = CliRunner().invoke(main, ["bench", "--quick", *words])
    assert done.exit_code == 0, done.output
    return done, folder


@pytest.fixture(scope="module")
def found(command):
    """Its results."""
    return worked_out.load(command[1] / "r.json")


# ---------------------------------------------------------------- what is measured


def test_names_tell_cases_apart_and_back():
    for size in (QUICK, FULL, TINY):
        names = [case.name for case in size.cases]
        assert len(set(names)) == len(names)
        assert [case_of(case.as_dict()) for case in size.cases] == size.cases
        assert [case.cost for case in size.cases] == sorted(case.cost for case in size.cases)
        assert {case.method for case in size.jobs} <= {"mrf", "multires", "pyramid", "solid"}
    assert Case("solid", 64, 32).name == "solid, 64 -> 32^3"
    assert Case("mrf", 64, 32, 8, "exact").name == "mrf exact, order 8, 64 -> 32"


def test_every_search_is_measured(monkeypatch):
    monkeypatch.setattr("simdtex.bench.sizes.searches", lambda: ("exact", "coherent"))
    assert with_searches([Case("mrf", 8, 8, 1), Case("solid", 8, 8)]) == [
        *(Case("mrf", 8, 8, 1, search) for search in ("exact", "coherent")),
        Case("solid", 8, 8),
    ]


def test_the_library_does_jobs_of_the_devices():
    with pytest.raises(ValueError, match="no job of the devices"):
        Sizes("x", 1, 0.0, 0.0, jobs=(), library=(Case("pyramid", 8, 8),), reference=())


def test_a_case_counts_what_weighing_every_candidate_takes():
    run = once(Reference(), MRF)
    phases = run["phases"]
    finest = run["levels"][-1]
    assert phases["warm"]["relaxations"] + phases["cold"]["relaxations"] == finest["relaxations"]
    assert phases["cold"]["relaxations"] == 2 * 16 * 16  # free sweeps
    assert phases["warm"]["brute_force"] + phases["cold"]["brute_force"] == finest["fma"]
    assert run["brute_force"] == sum(level["fma"] for level in run["levels"])
    assert brute_force(MRF, [0, 10])[1] == 2 * 10 * 8 * 2 * finest["candidates"]
    assert 0 < phases["cold"]["seconds"] < run["seconds"]


def test_sweeps_are_told_by_phase(monkeypatch):
    clock = iter([0.0, 1.0, 3.0, 7.0, 15.0])
    monkeypatch.setattr("simdtex.bench.cases.perf_counter", lambda: next(clock))
    machine = SimpleNamespace(sync=lambda: None, seconds=None)
    sweeps = Sweeps(machine)
    for level, phase, ended in (
        (1, "free", True),
        (0, "relax", False),
        (0, "relax", True),
        (0, "free", True),
        (0, "free", True),
    ):
        sweeps(SimpleNamespace(level=level, phase=phase, end_of_sweep=ended))
    assert sweeps.seconds == {"relax": 2.0, "free": 12.0}
    assert sweeps.busy == {"relax": 0.0, "free": 0.0}


def test_phases_are_those_of_the_sweeps(monkeypatch):
    class Told(Sweeps):
        def __call__(self, progress):
            self.seconds, self.busy = {"relax": 5.0, "free": 7.0}, {"relax": 1.0, "free": 2.0}

    monkeypatch.setattr("simdtex.bench.cases.Sweeps", Told)
    phases = once(Reference(), MRF)["phases"]
    assert [(phases[name]["seconds"], phases[name]["busy"]) for name in ("warm", "cold")] == [(5.0, 1.0), (7.0, 2.0)]


def test_a_device_is_timed_with_and_without_a_profile(any_device):
    machine = OpenCL(any_device, profile=True)
    case = measure(machine, MRF, repeats=2)
    assert 0 < case["phases"]["cold"]["busy"] < case["busy"]
    assert {kernel["name"] for kernel in case["kernels"]} >= {"relax_all", "start"}
    before = machine.log.seconds
    plain = measure(Reference(), MRF)
    assert (plain["busy"], plain["kernels"], plain["phases"]["warm"]["busy"]) == (None, None, None)
    assert machine.log.seconds == before


def test_limits_are_the_most_of_all_widths(any_device, monkeypatch):
    monkeypatch.setattr(limits, "CACHES", 2**20)
    machine = OpenCL(any_device)
    for limit, what in ((measure_peak(machine, 0.0), "fma"), (measure_copy(machine, 0.0), "bytes")):
        assert set(limit["by_width"]) == {"1", "4", "8", "16"}
        assert limit[what] == max(limit["by_width"].values()) == limit["by_width"][str(limit["width"])] > 0
    assert set(measure_peak(machine, 0.0, [4])["by_width"]) == {"4"}


def test_a_process_that_fails_is_told_in_one_sentence():
    with pytest.raises(ChildProcessError, match=r"the process of the reference ended with code 1; it said: .*nonsense"):
        measure_elsewhere("reference", 1, [Case("nonsense", 8, 8)])
    assert measure_elsewhere("reference", 1, []) == []


def test_the_reference_is_no_device_to_measure(any_device):
    with pytest.raises(DeviceError, match="the reference is measured beside every device"):
        benchmark.chosen("reference")
    assert benchmark.chosen(str(any_device.index)) == [any_device]
    assert any_device.name in [info.name for info in benchmark.chosen()]


# ---------------------------------------------------------------- what is written


def test_bench_prints_tables_and_says_what_it_does(command, found):
    done, folder = command
    assert done.stderr.splitlines()[0].endswith("limits")
    assert done.stderr.splitlines()[-1].startswith("library code")
    for text in (
        "fma/s",
        "Whole jobs",
        "LCPDF step",
        "cold",
        "Growth of the time",
        found["devices"][0]["device"]["name"],
    ):
        assert text in done.stdout
    assert [Path(line) for line in done.stdout.splitlines()[-3:]] == [
        *(folder / "r.json", folder / "plots" / "roofline.png", folder / "plots" / "growth.png")
    ]


def test_results_are_json_with_all_entries(found):
    assert found["sizes"] == "tiny"
    assert set(found) == {"format", *worked_out.ENTRIES}
    assert set(found["host"]) == {"cpu", "cores", "system", "python", "numpy", "scipy", "blas"}
    (entry,) = found["devices"]
    assert set(entry) == {"device", "peak", "copy", "cases", "jobs", "growth"}
    assert set(entry["device"]) == {"name", "kind", "version", "driver", "units", "threads", "memory"}
    assert {case["name"] for case in entry["cases"]} == {case.name for case in TINY.cases}
    for case in entry["cases"]:
        assert case["seconds"] > 0 and case["busy"] > 0 and case["kernels"]
        assert (case["peak"] is None) == (case["name"] not in entry["jobs"])
    assert [(host["machine"], len(host["cases"])) for host in found["hosts"]] == [("reference", 2), ("library", 1)]
    assert found["hosts"][1]["threads"] == entry["device"]["threads"]


@pytest.mark.parametrize("text", ["{}", "[1]", "nonsense", '{"format": "simdtex bench 1"}', "\udcff"])
def test_another_file_is_refused(tmp_path, text):
    path = tmp_path / "r.json"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(ValueError, match=r"r\.json holds no results of simdtex bench"):
        worked_out.load(path)


def test_pictures_are_drawn_of_each_device(command, found, tmp_path, monkeypatch):
    assert all(path.stat().st_size > 10_000 for path in (command[1] / "plots").iterdir())
    for name in ("_roofline", "_curves"):
        monkeypatch.setattr(f"simdtex.report.bench.{name}", lambda entry, path: path.touch())
    twice = found | {"devices": found["devices"] * 2}
    assert [path.name for path in plot(twice, tmp_path)] == [
        *("roofline-0.png", "growth-0.png", "roofline-1.png", "growth-1.png")
    ]


def test_quiet_bench_prints_nothing(any_device, monkeypatch):
    monkeypatch.setattr(benchmark, "run", lambda sizes, infos, tell: tell("something"))
    done = CliRunner().invoke(main, ["bench", "-q", "--device", str(any_device.index)])
    assert (done.exit_code, done.output) == (0, "")


def test_speed_compares_two_results(command, found, monkeypatch, capsys):
    path = str(command[1] / "r.json")
    monkeypatch.setattr(sys, "argv", [str(SPEED), path, path])
    runpy.run_path(str(SPEED), run_name="__main__")
    assert capsys.readouterr().out.count("1.00 x") == 2 * len(found["devices"][0]["cases"])
    monkeypatch.setattr(sys, "argv", [str(SPEED), path, str(SPEED)])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(SPEED), run_name="__main__")
    assert "holds no results of simdtex bench" in str(ended.value)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--device", "reference"], "the reference is measured beside every device"),
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


# ---------------------------------------------------------------- what is worked out


def kernel(name, seconds, fma, moved):
    rates = {"fma_rate": fma and fma / seconds, "byte_rate": moved and moved / seconds}
    return {"name": name, "seconds": seconds, "fma": fma, "bytes": moved, **rates}


def made_up():
    """Results with round numbers."""
    phases = {"cold": {"seconds": 2.0, "busy": 1.0, "relaxations": 100, "brute_force": 80.0}}
    job = Case("mrf", 16, 16, 2).as_dict() | {
        "seconds": 4.0,
        "busy": 3.0,
        "fma": 150.0,
        "brute_force": 200.0,
        "peak": 100.0,
    }
    job |= {"phases": phases, "kernels": [kernel("k", 3.0, 150.0, 30.0)]}
    other = Case("pyramid", 16, 16).as_dict() | {"seconds": 2.0, "busy": 1.0, "fma": None, "brute_force": None}
    other |= {"phases": None, "peak": 50.0, "kernels": [kernel("s", 0.75, 15.0, 30.0), kernel("t", 0.25, None, 10.0)]}
    slow = copy.deepcopy(job) | {"seconds": 40.0, "busy": None, "kernels": None}
    slow["phases"]["cold"] |= {"seconds": 6.0, "relaxations": 50}
    return {
        "devices": [
            {
                "device": {"name": "d", "threads": 2},
                "peak": {"fma": 100.0},
                "copy": {"bytes": 50.0},
                "cases": [other, job],
                "jobs": [job["name"], other["name"]],
                "growth": {},
            }
        ],
        "hosts": [
            {"machine": "reference", "threads": 1, "cases": [slow | {"seconds": 60.0}]},
            {"machine": "library", "threads": 1, "cases": []},
            {"machine": "library", "threads": 2, "cases": [slow]},
        ],
    }


def test_jobs_are_put_in_ratios():
    results = made_up()
    job, other = worked_out.jobs(results, results["devices"][0])
    assert job == {
        **{"case": "mrf, order 2, 16 -> 16", "seconds": 4.0, "busy": 0.75, "fma_rate": 50.0, "of_peak": 0.5},
        **{"of_copy": 0.2, "effective": 0.5, "reference": 15.0, "library": 10.0},
    }
    assert other == {
        **{"case": "pyramid, 16 -> 16", "seconds": 2.0, "busy": 0.5, "fma_rate": 15.0, "of_peak": 0.3},
        **{"of_copy": 0.8, "effective": None, "reference": None, "library": None},
    }


def test_steps_are_put_in_ratios():
    results = made_up()
    (step,) = worked_out.steps(results, results["devices"][0])
    assert step == {
        **{"case": "mrf, order 2, 16 -> 16", "phase": "cold", "relaxations": 100, "seconds": 2.0},
        **{"rate": 80.0, "of_peak": 0.8, "effective": 0.4, "reference": 6.0, "library": 6.0},
    }


def test_a_rate_that_says_little_is_not_given():
    known, unknown = kernel("a", 1.0, 10.0, 4.0), kernel("b", 1.0, None, 4.0)
    assert worked_out.stated([known, unknown], "fma") is None
    assert worked_out.stated([known, unknown], "bytes") == 4.0
    assert worked_out.stated([kernel("a", 3.0, 10.0, 4.0), unknown], "fma") == 2.5
    assert worked_out.stated(None, "fma") is worked_out.stated([], "bytes") is None


def test_a_coherent_search_is_compared_with_weighing_everything():
    case = Case("mrf", 16, 16, 2, "coherent").as_dict()
    assert worked_out.in_library(case["name"], case) == Case("mrf", 16, 16, 2, "exact").name
    case = Case("pyramid", 16, 16).as_dict()
    assert worked_out.in_library(case["name"], case) == case["name"]


@pytest.mark.parametrize("power", [0.0, 0.5, 1.0, 2.0])
def test_the_exponent_is_that_of_the_power(power):
    grown = [100.0, 400.0, 900.0]
    assert worked_out.exponent(grown, [3 * size**power for size in grown]) == pytest.approx(power, abs=1e-9)
    assert worked_out.exponent([4.0], [1.0]) is worked_out.exponent([4.0, 4.0], [1.0, 2.0]) is None


def test_what_grows_is_counted():
    case = Case("mrf", 10, 20, 8)
    large = {what: worked_out.growing(case, what) for what in ("output pixels", "sample pixels", "neighbours")}
    assert large == {"output pixels": 400, "sample pixels": 100, "neighbours": 24}
    assert worked_out.growing(Case("solid", 10, 20), "voxels") == 8000


def test_growth_has_a_curve_for_each_search():
    names = [Case("mrf", 16, side, 2, search) for search in ("exact", "coherent") for side in (10, 20)]
    cases = [case.as_dict() | {"seconds": float(case.output**2)} for case in names]
    curves = worked_out.growth({"cases": cases, "growth": {"mrf: output pixels": cases}})
    assert [curve["name"] for curve in curves] == ["mrf exact", "mrf coherent"]
    assert [curve["sizes"] for curve in curves] == [[100, 400], [100, 400]]
    assert [curve["exponent"] for curve in curves] == pytest.approx([1.0, 1.0])


def test_a_roofline_has_kernels_that_state_both():
    entry = made_up()["devices"][0]
    entry["cases"].append(entry["cases"][1] | {"kernels": [kernel("k", 9.0, 90.0, 30.0)]})
    assert worked_out.points(entry) == [
        {"name": "s", "method": "pyramid", "intensity": 0.5, "rate": 20.0},
        {"name": "k", "method": "mrf", "intensity": 3.0, "rate": 10.0},  # where it worked longest
    ]


def test_results_are_compared_by_peak_too():
    before, after = made_up(), made_up()
    after["devices"][0]["peak"] = {"fma": 200.0}
    for case in after["devices"][0]["cases"]:
        case["seconds"] /= 4
    found = worked_out.compared(before, after)
    assert [(row["times"], row["by_peak"]) for row in found] == [(4.0, 2.0)] * 2
    after["devices"][0]["device"]["name"] = "another"
    assert worked_out.compared(before, after) == []


def test_numbers_that_are_not_known_are_dashes():
    assert (percent(None), times(None), percent(0.853), times(12.34)) == ("-", "-", "85.3 %", "12.3 x")
    assert worked_out.ratio(1.0, None) is worked_out.ratio(None, 1.0) is worked_out.ratio(1.0, 0.0) is None
    assert np.isclose(worked_out.ratio(1.0, 4.0), 0.25)

"""Benchmarks: cases, how they are timed, and the table. No time is asserted."""

import json

import pytest
from click.testing import CliRunner

from simdtex.bench import run as benchmark
from simdtex.bench.run import FULL, QUICK, Case, Sizes
from simdtex.cli import main
from simdtex.machine.devices import DeviceError
from simdtex.machine.reference import Reference
from simdtex.report.tables import benchmark_table

MRF = Case("mrf", 16, 16, 2, "exact")
TINY = Sizes((Case("multires", 16, 16), Case("pyramid", 16, 16), Case("solid", 16, 8)), (MRF,), 0.0)


@pytest.fixture(scope="module")
def command(any_device, tmp_path_factory):
    """The tiniest benchmark from the command line: what it printed, and what it wrote."""
    path = tmp_path_factory.mktemp("bench") / "r.json"
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(benchmark, "QUICK", TINY)
        done = CliRunner().invoke(main, ["bench", "--quick", "--device", str(any_device.index), "--json", str(path)])
    assert done.exit_code == 0, done.output
    return done, json.loads(path.read_text())


@pytest.mark.parametrize("sizes", [QUICK, FULL])
def test_cases_have_unique_names(sizes):
    names = [case.name for case in (*sizes.devices, *sizes.reference)]
    assert len(set(names)) == len(names)
    methods = {case.method for case in sizes.reference}
    assert methods == {case.method for case in sizes.devices} == {"mrf", "multires", "pyramid", "solid"}


def test_a_name_tells_a_case():
    assert Case("solid", 64, 32).name == "solid, 64 -> 32^3"
    assert Case("mrf", 64, 32, 8, "exact").name == "mrf exact, order 8, 64 -> 32"


@pytest.mark.parametrize(("budget", "runs"), [(9.0, 4), (0.0, 2)])
def test_the_fastest_run_counts(monkeypatch, budget, runs):
    times = [(9.0, 1.0), (5.0, 2.0), (3.0, 2.5), (4.0, 1.5)]
    made = []

    def once(machine, case):
        made.append(times[len(made)])
        return made[-1]

    monkeypatch.setattr(benchmark, "once", once)
    assert benchmark.fastest(Reference(), MRF, budget) == min(made[1:]), "the first compiles"
    assert len(made) == runs


def test_everything_is_measured(command, any_device):
    done, found = command
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
    assert [list(row.values()) for row in shown.rows] == [
        ["a", "2 s", "75%", "n/a"],
        ["b", "2 s", "75%", "123 x"],
    ]


def test_simulators_and_the_reference_are_not_measured(cl_device):
    assert not any(info.simulated or info.kind == "reference" for info in benchmark.chosen())
    with pytest.raises(DeviceError, match="the reference is measured with every device; give an OpenCL device"):
        benchmark.chosen("reference")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--json", "no/such/file.json"], "no/such"),
        (["--json", "results.txt"], "end its name in one of .json"),
        (["--device", "no such device"], "no such device"),
    ],
)
def test_bad_input_is_one_sentence_before_anything_is_measured(monkeypatch, tmp_path, words, sentence):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(benchmark, "run", None)
    done = CliRunner().invoke(main, ["bench", *words])
    assert done.exit_code == 2
    assert sentence in done.output and done.output.count("\n") == 1

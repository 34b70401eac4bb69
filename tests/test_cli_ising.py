"""``simdtex ising``, as its user meets it."""

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from simdtex.cli import main
from simdtex.experiments.ising import Finding
from simdtex.report.schedules import _sublattice
from simdtex.report.schedules import ising_tables as tables
from simdtex.report.tables import print_table

PICTURES = ["energy.png", "lattices.png"]


def run(*args):
    return CliRunner().invoke(main, ["ising", *(str(arg) for arg in args)])


def small(*args, device="reference", schedules="coloring,synchronous"):
    few = ("--size", "6x4", "--seeds", 4, "--sweeps", 12, "--burn-in", 4)
    return run("--schedule", schedules, *few, "--device", device, *args)


def test_a_table_for_each_temperature():
    done = small("--temperature", 2, "--temperature", 3.5, schedules="luby,raster,block:2x3")
    assert done.exit_code == 0, done.output
    for word in ("T = 2:", "T = 3.5:", "luby", "raster", "block:2x3", "keeps", "breaks", "on reference (NumPy)"):
        assert word in done.output
    assert "No deviation from the Ising model" in done.output
    assert "schedule 3 of 3: block:2x3" in done.output  # progress, there being no terminal


def test_the_synchronous_schedule_fails_and_coloring_does_not(any_device, tmp_path):
    options = ("--size", 8, "--seeds", 16, "--sweeps", 150, "--burn-in", 60, "-q", "-o", tmp_path / "report")
    done = run("--schedule", "coloring,synchronous", "--temperature", 2.6, *options, "--device", any_device.index)
    assert (done.exit_code, done.output) == (0, "")
    results = json.loads((tmp_path / "report" / "results.json").read_text())
    right, wrong = results["findings"]
    assert not right["differs"] and right["independent"] and right["schedule"] == "coloring"
    assert wrong["differs"] and wrong["sigmas"] > 8 and not wrong["independent"]
    assert abs(wrong["neighbours"]) < 0.03 < 0.2 < right["neighbours"]
    assert results["conclusion"] == [
        "No deviation from the Ising model at any temperature: coloring.",
        "Something else is sampled by: synchronous.",
    ]


def test_a_report_is_complete(tmp_path):
    folder = tmp_path / "report"
    done = small("-o", folder, schedules="coloring,synchronous,random-scan")
    assert done.exit_code == 0, done.output
    assert str(folder / "index.html") in done.output
    assert sorted(path.name for path in folder.iterdir()) == sorted([*PICTURES, "index.html", "results.json"])
    for name in PICTURES:
        with Image.open(folder / name) as picture:
            assert min(picture.size) > 300 and len(np.unique(np.asarray(picture.convert("L")))) > 1
    page = (folder / "index.html").read_text()
    for word in ("Two interleaved lattices", "T = 2.3", "random-scan", "Kaufman"):
        assert word in page
    results = json.loads((folder / "results.json").read_text())
    assert results["settings"]["rows"] == 4 and results["settings"]["columns"] == 6
    assert results["settings"]["temperatures"] == [2.0, 2.3, 2.6]
    assert [one["schedule"] for one in results["findings"]] == ["coloring", "synchronous", "random-scan"] * 3
    assert set(results["findings"][0]) == {field.name for field in fields(Finding)}
    assert results["runs"]["random-scan"]["steps"] == 16 * 24


def without_times(folder):
    results = json.loads((folder / "results.json").read_text())
    assert str(folder) in results.pop("command")
    for one in results["runs"].values():
        assert one.pop("seconds") > 0
    return results


def test_the_same_seed_gives_the_same_report_but_for_times(tmp_path):
    for name in ("one", "two"):
        assert small("--seed", 3, "-q", "-o", tmp_path / name).exit_code == 0
    one, two = tmp_path / "one", tmp_path / "two"
    assert without_times(one) == without_times(two)
    for name in PICTURES:
        assert (one / name).read_bytes() == (two / name).read_bytes()
    assert small("--seed", 4, "-q", "-o", tmp_path / "two").exit_code == 0  # over the report that is there
    assert without_times(one)["findings"] != without_times(two)["findings"]


def test_a_device_finds_what_the_reference_finds(any_device, tmp_path):
    for name, device in (("ours", any_device.index), ("theirs", "reference")):
        assert small("-q", "-o", tmp_path / name, device=device).exit_code == 0
    ours, theirs = (without_times(tmp_path / name) for name in ("ours", "theirs"))
    assert ours["findings"] == theirs["findings"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--temperature", "0"], "temperature is 0.0; give a number above 0"),
        (["--schedule", "chess"], "unknown schedule 'chess'; choose one of: coloring"),
        (["--size", "1"], "a side of the lattice is 1; give 2 or more"),
        (["--size", "big"], "size 'big' is not WIDTHxHEIGHT"),
        (["--seeds", "1"], "--seeds is 1; give 2 or more"),
        (["--sweeps", "1"], "--sweeps is 1; give 2 or more"),
        (["--device", "no such device"], "no such device"),
        (["-o", "nowhere/report"], "the folder nowhere does not exist: create it first"),
    ],
)
def test_bad_input_gives_one_sentence_and_nothing_else(arguments, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = small(*arguments)
    assert done.exit_code == 2
    assert sentence in done.output and done.output.startswith("simdtex: ") and done.output.count("\n") == 1
    assert not list(Path().iterdir())


def test_a_schedule_or_a_temperature_given_twice_counts_once():
    done = small("--temperature", 2.5, "--temperature", 2.5, schedules="coloring, coloring")
    assert done.exit_code == 0, done.output
    assert done.output.count("T = 2.5:") == 1 and "schedule 1 of 1" in done.output


def test_a_narrow_terminal_gets_whole_cells(capsys):
    one = Finding("random-subset:0.25", False, 2.0, -1.74, 0.01, -1.745, 55, 0.911, 0.04, True)
    (table,) = tables([one])
    print_table(table, 80)
    shown = capsys.readouterr().out
    assert "…" not in shown and max(map(len, shown.splitlines())) <= 80
    words = " ".join(shown.split())
    assert all(word in words for row in table.rows for cell in row.values() for word in cell.split())


@pytest.mark.parametrize("shape", [(4, 6), (5, 5), (2, 3)])
def test_a_sublattice_apart_shows_its_own_sites_only(shape):
    row, col = np.indices(shape)
    for odd in (0, 1):
        spins = ((row + col) % 2 == odd).astype(np.uint8)  # its own sites are up, the others down
        assert _sublattice(spins, odd).all()
        assert not _sublattice(1 - spins, odd).any()

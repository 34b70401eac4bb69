"""``simdtex schedules``, end to end, as its user meets it."""

import json

import pytest
from cases import texture
from click.testing import CliRunner
from test_page import assert_needs_nothing_else, embedded, read_page

from simdtex.cli import main
from simdtex.io import image

FILES = [
    *("index.html", "oscillation.png", "pictures.png", "results.json", "seeds.png", "temperature.png"),
]


@pytest.fixture
def folder(tmp_path):
    image.write(tmp_path / "sample.png", texture((16, 16)))
    return tmp_path


def run(*args):
    return CliRunner().invoke(main, ["schedules", *(str(arg) for arg in args)])


def small(folder, *args):
    job = ["--order", 2, "--size", "12x10", "--device", "reference", "--schedule", "coloring,synchronous"]
    return run(folder / "sample.png", "-o", folder / "report", *job, "--seeds", 2, *args)


def listing(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_a_report(folder):
    result = small(folder)
    assert result.exit_code == 0, result.output
    assert listing(folder / "report") == FILES
    reader = read_page(folder / "report" / "index.html")
    assert_needs_nothing_else(reader)
    beside = {path.read_bytes() for path in (folder / "report").glob("*.png")}
    assert set(embedded(reader)) == beside and len(embedded(reader)) == len(beside) == 4
    assert "breaks (14)" in reader.text
    job = "-o REPORT --order 2 --size 12x10 --device reference --schedule coloring,synchronous --seeds 2"
    assert f"$ simdtex schedules SAMPLE {job}" in reader.text.replace(str(folder / "report"), "REPORT").replace(
        str(folder / "sample.png"), "SAMPLE"
    )
    found = json.loads((folder / "report" / "results.json").read_text(encoding="utf-8"))
    assert [entry["name"] for entry in found["schedules"]] == ["coloring", "synchronous"]
    assert [entry["keeps_equation_14"] for entry in found["schedules"]] == [True, False]
    assert found["seeds"] == [1, 2] and found["shape"] == [10, 12]
    lines = result.output.splitlines()
    assert sum(line.split()[:3] == ["synchronous", "breaks", "(14)"] for line in lines) == 4
    assert sum(line.split()[:3] == ["coloring", "keeps", "(14)"] for line in lines) == 4
    assert sum("of 4: " in line for line in lines) == 4
    assert "index.html" in lines[-1]


def test_the_same_command_gives_the_same_pictures(folder):
    small(folder, "-q")
    first = {path.name: path.read_bytes() for path in (folder / "report").glob("*.png")}
    assert small(folder, "-q").output == ""
    again = {path.name: path.read_bytes() for path in (folder / "report").glob("*.png")}
    assert first == again


def test_options_reach_the_runs(folder):
    given = ["--free-sweeps", 3, "--relaxation", "gibbs", "--boundary", "open", "--coherence", 0, "--levels", 1]
    result = small(folder, *given, "--array", "8x8:hierarchical", "--seed", 7)
    assert result.exit_code == 0, result.output
    found = json.loads((folder / "report" / "results.json").read_text(encoding="utf-8"))
    options = found["options"]
    assert (options["free_sweeps"], options["relaxation"], options["boundary"]) == (3, "gibbs", "open")
    assert (options["coherence"], options["levels"]) == (0, 1)
    assert found["seeds"] == [7, 8]
    accounting = found["schedules"][0]["runs"][0]["accounting"]
    assert (accounting["array"], accounting["mapping"]) == ("8x8", "hierarchical")


def test_without_a_sample_it_is_brick(any_device, tmp_path):
    args = ["--order", 2, "--size", "9x9", "--seeds", 1, "--schedule", "coloring", "--device", any_device.index, "-q"]
    result = run("-o", tmp_path / "report", *args)
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "report" / "results.json").read_text(encoding="utf-8"))
    assert found["sample_shape"] == [128, 128]
    assert "seeds.png" not in listing(tmp_path / "report")


BAD = {
    "unknown schedule": (["--schedule", "coloring,lubi"], "choose one of: coloring"),
    "a schedule twice": (["--schedule", "luby,luby"], "given twice"),
    "no seeds": (["--seeds", 0], "give 1 or more"),
    "size in words": (["--size", "large"], "size"),
    "size too small to measure": (["--size", "8x20"], "give 9 or more"),
    "device": (["--device", "no such device"], "no such device"),
}


def assert_refused(result, words):
    assert result.exit_code == 2, result.output
    assert words in result.output
    said = [line for line in result.output.strip().splitlines() if not line.startswith("run ")]
    assert len(said) == 1


@pytest.mark.parametrize("case", BAD)
def test_bad_options_get_one_sentence_and_write_nothing(folder, case):
    args, words = BAD[case]
    before = listing(folder)
    assert_refused(small(folder, *args), words)
    assert listing(folder) == before


@pytest.mark.parametrize(
    ("report", "words"),
    [("file", "is a file"), ("nowhere/report", "does not exist"), ("full", "holds other files")],
)
def test_bad_folders_are_refused_before_the_work(folder, report, words):
    (folder / "file").touch()
    (folder / "full").mkdir()
    (folder / "full" / "notes.txt").touch()
    before = listing(folder)
    result = run(folder / "sample.png", "-o", folder / report, "--order", 2)
    assert_refused(result, words)
    assert listing(folder) == before


def test_ctrl_c_leaves_no_report(folder, monkeypatch):
    def stop(*args, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("simdtex.experiments.comparison.synthesize", stop)
    result = small(folder)
    assert result.exit_code == 130 and "stopped" in result.output
    assert listing(folder) == ["sample.png"]

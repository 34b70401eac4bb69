"""Schedules compared: what is recorded of a run, who keeps equation (14), and ``simdtex schedules``."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from cases import texture
from commands import names, run
from pages import assert_needs_nothing_else, embedded, read_page

from simdtex.figures.page import Figure
from simdtex.io import image
from simdtex.jobs.studies.comparison import Entry, Recorder, Spread, compare
from simdtex.jobs.studies.report import comparison_tables as tables
from simdtex.jobs.studies.report import sections

# -- A comparison of schedules: what is recorded of a run, who keeps equation (14), and that seeds decide everything.


def feed(recorder, pictures, level=0, phase="free", **more):
    """Let a recorder see a level whose sweeps end with these pictures."""
    for number, picture in enumerate(pictures, 1):
        picture = np.asarray(picture)
        said = {"level": level, "sweep": number, "phase": phase, "step": 3 * number, "temperature_left": 1 / number}
        said |= {"image": lambda picture=picture: picture, "temperature": lambda: np.full((2, 2), 0.25)}
        recorder(SimpleNamespace(**said | {"stage": "level0-sweep01"} | more))


def test_shares_of_a_sequence_by_hand():
    recorder = Recorder()
    feed(recorder, [[[0, 0], [0, 0]], [[1, 0], [2, 0]], [[1, 5], [0, 0]], [[1, 0], [3, 0]], [[1, 0], [3, 0]]])
    assert [sweep.changed for sweep in recorder.sweeps] == [None, 0.5, 0.5, 0.5, 0]
    assert [sweep.returned for sweep in recorder.sweeps] == [None, None, 0.25, 0.25, 0]
    assert [(s.sweep, s.steps, s.before, s.left) for s in recorder.sweeps[:2]] == [(1, 3, 1, 0.25), (2, 6, 0.5, 0.25)]


def test_a_pixel_changes_where_any_channel_does():
    first = np.zeros((2, 2, 2))
    second = first.copy()
    second[0, 1, 1] = second[1, 0, 0] = second[1, 0, 1] = 1
    recorder = Recorder(0)
    feed(recorder, [np.moveaxis(picture, -1, 0) for picture in (first, second, first)])
    assert [sweep.changed for sweep in recorder.sweeps] == [None, 0.5, 0.5]
    assert recorder.sweeps[-1].returned == 0.5


def test_levels_are_not_compared_and_only_ends_of_sweeps_are_recorded():
    seen = []
    recorder = Recorder(then=seen.append)
    feed(recorder, [np.zeros((1, 1)), np.ones((1, 1))], level=1)
    feed(recorder, [np.zeros((2, 2)), np.zeros((2, 2))], level=0)
    feed(recorder, [np.zeros((2, 2))] * 3, stage=None)
    assert [sweep.changed for sweep in recorder.sweeps] == [None, 1, None, 0]
    assert len(seen) == 7, "all progress is passed on"


SAMPLE = texture((18, 16))
FILES = ["index.html", "oscillation.png", "pictures.png", "results.json", "seeds.png", "temperature.png"]
JOB = {"order": 2, "device": "reference", "levels": 2}
NAMES = ["coloring", "synchronous", "block:6x6"]


def without_times(results):
    if isinstance(results, dict):
        return {k: without_times(v) for k, v in results.items() if k not in ("seconds", "device_seconds")}
    return [without_times(item) for item in results] if isinstance(results, list) else results


@pytest.fixture(scope="module")
def told():
    """A comparison, and the progress that was told of it."""
    seen = []
    return compare(SAMPLE, (12, 12), NAMES, seeds=(3, 5), callback=seen.append, **JOB), seen


@pytest.fixture
def found(told):
    return told[0]


def test_seeds_decide_everything_but_times(found):
    again = compare(SAMPLE, (12, 12), ["synchronous"], seeds=(3, 5), **JOB)
    assert without_times(found.results())["schedules"][1:2] == without_times(again.results())["schedules"]
    json.dumps(found.results(), allow_nan=False)


def test_a_device_gives_what_the_reference_gives(found, any_device):
    on_device = compare(SAMPLE, (12, 12), ["coloring"], seeds=(3,), **JOB | {"device": any_device.index})
    ours, theirs = on_device.entries[0].runs[0], found.entries[0].runs[0]
    assert np.array_equal(ours.image, theirs.image) and ours.sweeps == theirs.sweeps
    assert ours.figures["device_seconds"] > 0


def test_runs_are_what_the_statistics_say(found):
    for entry in found.entries:
        assert [one.seed for one in entry.runs] == [3, 5]
        for one in entry.runs:
            finest = one.levels[-1]
            assert len(one.finest) == finest["sweeps"] and one.finest[-1].steps == finest["steps"]
            cooling = [sweep for sweep in one.finest if sweep.phase == "relax"]
            assert one.figures["steps"] == cooling[-1].steps == finest["equilibrium"]["steps"]
            assert one.figures["sweeps"] == len(cooling)
            assert cooling[0].before == 0.75 and cooling[-1].left == 0
            assert one.image.shape == (12, 12) and one.figures["seconds"] > 0
            assert 0 < one.figures["utilisation"] <= 1
    synchronous = found.entries[1].runs[0]
    assert synchronous.figures["steps"] == synchronous.figures["sweeps"]


def test_figures_over_seeds(found):
    for entry in found.entries:
        values = [run.figures["plausibility"] for run in entry.runs]
        spread = Spread(pytest.approx(np.mean(values)), pytest.approx(np.std(values, ddof=1)), tuple(values))
        assert entry.figure("plausibility") == spread
    assert Entry("one", (True,), found.entries[0].runs[:1]).figure("copying").deviation is None


def test_who_keeps_equation_14(found):
    assert [entry.independent for entry in found.entries] == [True, False, False]
    for side, keeps in ((12, True), (11, False)):  # at an odd side the torus has a seam
        other = compare(SAMPLE, (side, 12), ["checkerboard"], seeds=[1], **{**JOB, "order": 1, "free_sweeps": 1})
        assert other.entries[0].independent == keeps
        assert other.entries[0].figure("changed_free") is not None
        assert other.entries[0].figure("oscillation_free") is None, "it takes two free sweeps"


def test_a_level_at_which_it_breaks_is_enough(found):
    tiles = found.entries[2]
    assert tiles.claims == (True, False) and not tiles.independent
    (section,) = (section for section in sections(found) if section.title == "Until equilibrium")
    assert "At level 1 block:6x6 keeps equation (14)" in section.parts[0].note


def test_every_table_says_who_breaks_it(found):
    assert len(tables(found)) == 4
    keeps = [("coloring", "keeps (14)"), ("synchronous", "breaks (14)"), ("block:6x6", "breaks (14)")]
    for table in tables(found):
        assert [(row["Schedule"], row["Equation (14)"]) for row in table.rows] == keeps
        assert "n/a" not in table.rows[0].values() or "Device time, s" in table.header


def test_figures_of_the_page_and_channels_on_any_axis(found):
    figures = [part for section in sections(found) for part in section.parts if isinstance(part, Figure)]
    assert [figure.file for figure in figures] == FILES[2:3] + FILES[4:] + FILES[1:2]
    sample = np.moveaxis(texture((16, 16), channels=3), -1, 0)
    other = compare(sample, (10, 12), ["coloring"], seeds=[1], channel_axis=0, **JOB)
    assert other.entries[0].runs[0].image.shape == (3, 10, 12)
    assert sections(other)


def test_progress_runs_from_0_to_1(told):
    fractions = [progress.fraction for progress in told[1]]
    assert fractions == sorted(fractions) and fractions[-1] == pytest.approx(1) and fractions[0] < 0.1
    jobs = [f"run {n + 1} of 6: {NAMES[n % 3]}, seed {(3, 5)[n // 3]}" for n in range(6)]
    assert list(dict.fromkeys(progress.job for progress in told[1])) == jobs


def test_bad_input():
    good = {"sample": SAMPLE, "shape": (12, 12), "schedules": ["coloring"], **JOB}
    for change, error, words in (
        ({"schedules": []}, ValueError, "no schedules"),
        ({"schedules": ["luby", "luby"]}, ValueError, "given twice"),
        ({"seeds": []}, ValueError, "no seeds"),
        ({"shape": (8, 20)}, ValueError, "give 9 or more"),
        ({"array": None}, ValueError, "leave array out for a full MP-1"),
        ({"sample": np.zeros((8, 20))}, ValueError, "too small"),
        ({"schedule": "luby"}, TypeError, "schedules"),
    ):
        with pytest.raises(error, match=words):
            compare(**{**good, **change})


# -- ``simdtex schedules``, end to end, as its user meets it.


@pytest.fixture
def folder(tmp_path):
    image.write(tmp_path / "sample.png", texture((16, 16)))
    return tmp_path


def small(folder, *args):
    job = ["--order", 2, "--size", "12x10", "--device", "reference", "--schedule", "coloring,synchronous"]
    return run("schedules", folder / "sample.png", "-o", folder / "report", *job, "--seeds", 2, *args)


def test_a_report(folder):
    result = small(folder)
    assert result.exit_code == 0, result.output
    assert names(folder / "report") == FILES
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


@pytest.mark.slow
def test_without_a_sample_it_is_brick_and_options_reach_the_runs(any_device, tmp_path):
    args = ["--order", 2, "--size", "9x9", "--seeds", 1, "--schedule", "coloring", "--device", any_device.index, "-q"]
    result = run("schedules", "-o", tmp_path / "report", *args, "--array", "8x8:hierarchical", "--seed", 7)
    assert (result.exit_code, result.output) == (0, "")
    found = json.loads((tmp_path / "report" / "results.json").read_text(encoding="utf-8"))
    assert found["sample_shape"] == [128, 128] and found["seeds"] == [7]
    accounting = found["schedules"][0]["runs"][0]["accounting"]
    assert (accounting["array"], accounting["mapping"]) == ("8x8", "hierarchical")
    assert "seeds.png" not in names(tmp_path / "report")


def test_ctrl_c_leaves_no_report(folder, monkeypatch):
    def stop(*args, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("simdtex.jobs.studies.comparison.synthesize", stop)
    result = small(folder)
    assert result.exit_code == 130 and "stopped" in result.output
    assert names(folder) == ["sample.png"]

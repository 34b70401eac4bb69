"""A replay has the fields of the run, after any set of sites, and explains any pixel at any moment."""

import numpy as np
import pytest
from cases import texture
from skimage import data

import simdtex
from simdtex.methods.mrf import replay as module

BRICK = data.brick()[:24, :24]
SHAPE = (18, 21)
RULES = {"order": 4, "levels": 2, "free_sweeps": 1, "rng": 3}
SCHEDULES = ["coloring", "luby", "checkerboard", "synchronous", "random-subset", "raster", "random-scan", "block:6x7"]


def run(schedule, device):
    """The fields at the end of every sweep of a run, in order."""
    seen = []

    def watch(progress):
        if progress.end_of_sweep:
            seen.append((progress.level, progress.sweep, progress.image(), progress.source(), progress.temperature()))

    simdtex.synthesize(BRICK, SHAPE, schedule=schedule, **RULES, device=device, callback=watch)
    return seen


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_fields_are_those_of_the_run(machine, schedule):
    seen = run(schedule, machine)
    replay = simdtex.replay(BRICK, SHAPE, schedule=schedule, **RULES, device=machine)
    assert [(one.level, one.sweep) for one in replay.sweeps] == [one[:2] for one in seen]
    for n in {0, len(seen) // 2, len(seen) - 1}:
        found = replay.at(n)
        for one, other in zip((found.image[..., 0], found.source, found.temperature), seen[n][2:], strict=True):
            np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(replay.at(n - len(seen)).image, found.image)


@pytest.mark.parametrize("schedule", ["coloring", "checkerboard", "synchronous", "random-subset", "random-scan"])
def test_a_set_changes_its_own_sites_alone(schedule):
    replay = simdtex.replay(BRICK, SHAPE, schedule=schedule, **RULES, device="reference")
    n = len(replay.sweeps) - 1
    sweep = replay.sweeps[n]
    before, relaxed = replay.at(n, 0), 0
    assert not before.relaxed.any()
    np.testing.assert_array_equal(before.image, replay.at(n - 1).image)
    for sets in range(1, min(12, sweep.sets) + 1):
        after = replay.at(n, sets)
        last = after.relaxed == 2
        np.testing.assert_array_equal(after.relaxed > 0, last | (before.relaxed > 0))
        np.testing.assert_array_equal(after.source[~last], before.source[~last])
        relaxed += int(last.sum())
        before = after
    if sweep.sets == sets and schedule != "random-subset":
        assert relaxed == sweep.sites == 18 * 21  # a free sweep relaxes all


def test_checkerboard_has_two_sets_and_raster_one_for_each_site():
    for schedule, sets in [("checkerboard", 2), ("synchronous", 1), ("raster", 18 * 21)]:
        assert simdtex.replay(BRICK, SHAPE, schedule=schedule, **RULES, device="reference").sweeps[-1].sets == sets


def test_states_that_are_not_kept_are_computed_again(monkeypatch):
    kept = simdtex.replay(BRICK, SHAPE, **RULES, device="reference")
    monkeypatch.setattr(module.Replay.__init__, "__defaults__", (0,))
    bare = simdtex.replay(BRICK, SHAPE, **RULES, device="reference")
    n = len(kept.sweeps) - 3
    assert len(bare.sweeps) == n + 3
    assert list(bare._states) == [0] and len(kept._states) == n + 3
    for one, other in zip(vars(kept.at(n, 2)).values(), vars(bare.at(n, 2)).values(), strict=True):
        np.testing.assert_array_equal(one, other)
    assert kept.explain_pixel(3, 5, n).table() == bare.explain_pixel(3, 5, n).table()


@pytest.mark.parametrize("schedule", ["coloring", "random-scan", "block:6x7"])
def test_a_pixel_is_explained_by_its_last_relaxation(schedule):
    sample = texture((24, 24), 3)
    rules = RULES | {"schedule": schedule, "channel_axis": -1, "device": "reference", "xi": -8.0}
    replay = simdtex.replay(sample, SHAPE, **rules)
    n, rng = len(replay.sweeps) - 1, np.random.default_rng(1)
    for _ in range(6):
        number = int(rng.integers(n // 2, n + 1))
        sets = int(rng.integers(replay.sweeps[number].sets + 1))
        site = tuple(int(rng.integers(side)) for side in SHAPE)
        try:
            why = replay.explain_pixel(*site, number, sets)
        except ValueError as error:
            assert "has not relaxed yet" in str(error)
            assert any(n % 2 for n in site)  # a pixel without a site above
            continue
        now = replay.at(number, sets)
        level = now.level
        shown = now.source[site[0] >> level, site[1] >> level]
        np.testing.assert_array_equal(why.candidates.place[why.taken], shown)
        if schedule != "random-scan":  # which may relax the site once more in the same sweep
            assert replay.explain(why.site, why.level, why.sweep).table() == why.table()
        if level == 0 and why.level == 0:
            assert why.cooled == now.temperature[site]


def test_a_pixel_that_keeps_its_value_is_explained_on_the_level_above():
    replay = simdtex.replay(BRICK, SHAPE, **RULES, device="reference")
    first = next(n for n, one in enumerate(replay.sweeps) if one.level == 0)
    why = replay.explain_pixel(4, 6, first)
    assert (why.level, why.site) == (1, (2, 3))
    assert why.sweep == replay.sweeps[first - 1].sweep
    with pytest.raises(ValueError, match="has not relaxed yet"):
        replay.explain_pixel(3, 5, first, 0)
    with pytest.raises(ValueError, match="has not relaxed yet"):
        replay.explain_pixel(0, 0, 0, 0)
    with pytest.raises(IndexError):
        replay.at(1000)

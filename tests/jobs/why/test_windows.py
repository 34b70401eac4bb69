"""Parts of a run: a window with a halo has the bits of the whole, and a replay the fields of any moment."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, laid_out, opencl, texture
from skimage import data

import simdtex
from simdtex import random
from simdtex.jobs.filling.job import plan_filling
from simdtex.jobs.why import replay as module
from simdtex.jobs.why.holes import HoleReplay
from simdtex.methods import mrf
from simdtex.methods.mrf.algorithm import first_state, sweep
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.methods.mrf.start import start
from simdtex.model.lattice import Grid
from simdtex.schedules import SCHEDULES, get

# -- Sites are known by their place in the whole: a window with a halo relaxes to the bits of that of the whole.

WINDOWS = [name for name in SCHEDULES if get(name).windows]
SEARCHES = {
    "coherent": {"search": "coherent"},
    "coherent draws": {"search": "coherent", "relaxation": "gibbs"},
    "exact": {"search": "exact"},
    "exact draws": {"search": "exact", "relaxation": "gibbs", "pixel": "density"},
}


def test_these_schedules_claim_windows_and_a_window_that_does_not_fit_is_refused():
    assert WINDOWS == ["coloring", "coloring-fixed", "checkerboard", "synchronous"]
    closed = Grid.of((8, 9), 1, False)
    for grid, window in ((Grid((8, 9)), (0, 0, 9, 3)), (closed, (6, 0, 3, 3)), (closed, (-1, 0, 3, 3))):
        with pytest.raises(ValueError, match="window"):
            grid.window(*window)


def cut(saved, window):
    """The part that a window holds of a whole's saved state."""
    return [np.ascontiguousarray(window.cut(saved[name])) for name in Field._fields]


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize(
    ("name", "number", "how"), [*zip(WINDOWS, (0, 0, 0, 0), SEARCHES, strict=True), ("coloring", 1, "exact draws")]
)
def test_a_window_relaxes_as_the_whole(any_device, name, number, how, boundary):
    """Sweep by sweep: the halo is as deep as a sweep reaches, steps times the radius of the neighbourhood."""
    machine = opencl(any_device)
    given = SEARCHES[how] | {"order": 2, "schedule": name, "boundary": boundary, "levels": 3}
    shape = (26 << number, (31 << number) - number)  # the last column of the coarse lattice is a pixel short
    run = laid_out(machine, texture((40, 41), seed=2)[..., None], shape, mrf.Options(**given), 2**40 + 9)
    level = run.level(number)
    state, compared = run.enter(number, None), 0
    for done in range(4):
        state = state._replace(active=0) if done == 3 else state  # a free sweep
        before = run.save(state)
        state, (chosen,) = sweep(level, run.load(before))
        halo, grid = len(chosen.ranges) * 1, level.setting.grid
        corners = [(-halo - 3, 20 - halo), (5, 3)] if boundary == "torus" else [(0, 31 - 2 * halo - 5), (3, 1)]
        for top, left in corners:
            rows, cols = min(2 * halo + 7, grid.rows), min(2 * halo + 5, grid.cols)
            if boundary == "open":
                top, left = min(top, grid.rows - rows), min(max(0, left), grid.cols - cols)
            small = run.level(number, (top, left, rows, cols))
            window = small.setting.grid
            inner = first_state(small, Field(*map(machine.put, cut(before, window))))
            inner = inner._replace(penalty=before["penalty"], active=before["active"])  # those of the whole
            inner = inner._replace(schedule=inner.schedule._replace(sweep=before["schedule"].sweep))
            inner, _ = sweep(small, inner)
            ours = [np.array(machine.get(plane)) for plane in inner.field]
            theirs = cut(run.save(state), window)
            inside = slice(halo, rows - halo), slice(halo, cols - halo)
            for mine, whole in zip(ours, theirs, strict=True):
                assert_same_bits(mine[..., *inside].copy(), whole[..., *inside].copy())
            compared += mine[inside].size
    assert compared > 200


def test_a_window_begins_as_the_whole():
    run = laid_out(REFERENCE, texture((12, 13))[..., None], (22, 27), mrf.Options(order=2, levels=2), 3)
    everywhere = run.sample.places(np.zeros((1, 2), np.int32), 1).positions
    for number in (0, 1):
        whole, window = run.enter(number, None).field, run.grid(number).window(-3, 5, 8, 6)
        ours = start(REFERENCE, run.planes, everywhere, window, run.seed)
        assert_same_bits([*ours], [np.ascontiguousarray(window.cut(plane)) for plane in whole])


def test_a_window_of_a_window_lies_where_it_should():
    grid = Grid.of((40, 50), 2)
    inner = grid.window(15, -4, 12, 9).window(3, 2, 4, 5)
    assert inner == grid.window(18, -2, 4, 5) and inner.whole == grid
    places = grid.places(np.arange(grid.size)).reshape(grid.shape)
    assert_same_bits(inner.places(np.arange(inner.size)), inner.cut(places).ravel())


def test_places_beyond_32_bits_draw_numbers_of_their_own(machine):
    """The upper bits of a place stand above level and purpose: no two sites of 10^6 x 10^6 share a counter."""
    vast = Grid((10**6, 10**6))
    places = []
    for top, left in [(0, 0), (4294, 967296), (999_990, 999_990), (42949, 672960)]:
        window = vast.window(top, left, 4, 5)
        found = window.places(np.arange(window.size))
        places.append(found)
        planes, pixels = machine.put(np.arange(97, dtype=np.float32)[None]), machine.put(np.arange(97, dtype=np.int32))
        ours = machine.get(start(machine, planes, pixels, window, 11).source)
        lo, hi, *_ = random.draw4(11, 0, 0, found, random.START)
        assert_same_bits(ours.ravel(), random.below(lo, hi, 97).astype(np.int32))
    assert np.unique(np.concatenate(places)).size == 80


# -- A replay has the fields of the run, after any set of sites, and explains any pixel at any moment.

BRICK = data.brick()[:24, :24]
SMALL = (9, 11)
RULES = {"order": 4, "levels": 2, "free_sweeps": 1, "rng": 3}


@pytest.mark.parametrize(("schedule", "on"), [("coloring", "reference"), ("random-scan", "device")])
def test_fields_are_those_of_the_run(any_device, schedule, on):
    rules = RULES | {"schedule": schedule, "device": opencl(any_device) if on == "device" else REFERENCE}
    seen = []

    def watch(progress):
        if progress.stage:
            seen.append((progress.level, progress.sweep, progress.image(), progress.source(), progress.temperature()))

    simdtex.synthesize(BRICK, SMALL, **rules, callback=watch)
    replay = simdtex.replay(BRICK, SMALL, **rules)
    assert [one[:2] for one in replay.sweeps] == [one[:2] for one in seen]
    for n in (0, len(seen) // 2, -1):
        found = replay.at(n)
        for one, other in zip((found.image[..., 0], found.source, found.temperature), seen[n][2:], strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("schedule", ["coloring", "random-subset"])
def test_a_set_changes_its_own_sites_alone(schedule):
    replay = simdtex.replay(BRICK, SMALL, schedule=schedule, **RULES, device="reference")
    n = len(replay.sweeps) - 1
    sweep = replay.sweeps[n]
    before, relaxed = replay.at(n, 0), 0
    assert not before.relaxed.any()
    np.testing.assert_array_equal(before.image, replay.at(n - 1).image)
    for sets in range(1, min(40, sweep.sets) + 1):
        after = replay.at(n, sets)
        last = after.relaxed == 2
        np.testing.assert_array_equal(after.relaxed > 0, last | (before.relaxed > 0))
        np.testing.assert_array_equal(after.source[~last], before.source[~last])
        relaxed += int(last.sum())
        before = after
    if sweep.sets == sets and schedule != "random-subset":
        assert relaxed == sweep.sites == 9 * 11  # a free sweep relaxes all


def test_checkerboard_has_two_sets_and_raster_one_for_each_site():
    for schedule, sets in [("checkerboard", 2), ("synchronous", 1), ("raster", 6 * 7)]:
        assert simdtex.replay(BRICK, (6, 7), schedule=schedule, **RULES, device="reference").sweeps[-1].sets == sets


def test_states_that_are_not_kept_are_computed_again(monkeypatch):
    kept = simdtex.replay(BRICK, SMALL, **RULES, device="reference")
    monkeypatch.setattr(module.Replay.__init__, "__defaults__", (0,))
    bare = simdtex.replay(BRICK, SMALL, **RULES, device="reference")
    n = len(kept.sweeps) - 3
    assert len(bare.sweeps) == n + 3
    assert list(bare._states) == [0] and len(kept._states) == n + 3
    np.testing.assert_array_equal(kept.at(n, 2).source, bare.at(n, 2).source)
    assert kept.explain_pixel(3, 5, n).table() == bare.explain_pixel(3, 5, n).table()


@pytest.mark.parametrize("schedule", ["coloring", "random-scan"])
def test_a_pixel_is_explained_by_its_last_relaxation(schedule):
    rules = RULES | {"schedule": schedule, "channel_axis": -1, "device": "reference", "xi": -8.0}
    replay = simdtex.replay(texture((16, 16), 3), SMALL, **rules)
    n, rng, explained = len(replay.sweeps) - 1, np.random.default_rng(1), 0
    for _ in range(4):
        number = int(rng.integers(n // 2, n + 1))
        sets = int(rng.integers(replay.sweeps[number].sets + 1))
        site = tuple(int(rng.integers(side)) for side in SMALL)
        try:
            why = replay.explain_pixel(*site, number, sets)
        except ValueError as error:
            assert "has not relaxed yet" in str(error) and any(n % 2 for n in site)  # a pixel without a site above
            continue
        now, explained = replay.at(number, sets), explained + 1
        shown = now.source[site[0] >> now.level, site[1] >> now.level]
        np.testing.assert_array_equal(why.candidates.place[why.taken], shown)
        if schedule != "random-scan":  # which may relax the site once more in the same sweep
            assert replay.explain(why.site, why.level, why.sweep).table() == why.table()
        if now.level == why.level == 0:
            assert why.cooled == now.temperature[site]
    assert explained


def test_a_pixel_that_keeps_its_value_is_explained_on_the_level_above():
    replay = simdtex.replay(BRICK, SMALL, **RULES, device="reference")
    first = next(n for n, one in enumerate(replay.sweeps) if one.level == 0)
    why = replay.explain_pixel(4, 6, first)
    assert (why.level, why.site, why.sweep) == (1, (2, 3), replay.sweeps[first - 1].sweep)
    for pixel, n in (((3, 5), first), ((0, 0), 0)):
        with pytest.raises(ValueError, match="has not relaxed yet"):
            replay.explain_pixel(*pixel, n, 0)
    with pytest.raises(IndexError):
        replay.at(1000)


def test_the_replay_of_a_hole_is_in_pixels_of_the_picture():
    image, hole = texture((20, 26)), np.zeros((20, 26), bool)
    hole[6:13, 8:17] = True
    how = {"order": 2, "schedule": "synchronous", "finish": 0.0}
    replay = HoleReplay(plan_filling(image, hole, **how), REFERENCE, 3)
    made, output = simdtex.fill(image, hole, **how, rng=3, device=REFERENCE, full_output=True)
    assert_same_bits(replay.at(-1).image, made[..., None])
    np.testing.assert_array_equal(replay.at(-1).source, output.source)
    why = replay.explain_pixel(9, 12)
    np.testing.assert_array_equal(why.candidates.place[why.taken], output.source[9, 12])
    assert replay.explain(why.site).table() == why.table()
    assert replay.together(replay.at(-1, 1)).all(), "all sites at once"
    with pytest.raises(ValueError, match="not in the hole"):
        replay.explain_pixel(0, 12)

"""Sites are known by their place in the whole: a window with a halo relaxes to the bits of the same window of the
whole."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, laid_out, opencl, texture

from simdtex import random
from simdtex.methods import mrf
from simdtex.methods.mrf.algorithm import opened, sweep
from simdtex.model.lattice import Grid
from simdtex.ops.neighbourhood import Field
from simdtex.ops.start import start
from simdtex.schedules import SCHEDULES, get

WINDOWS = [name for name in SCHEDULES if get(name).windows]
SEARCHES = {
    "coherent": {"search": "coherent"},
    "coherent draws": {"search": "coherent", "relaxation": "gibbs"},
    "exact": {"search": "exact"},
    "exact draws": {"search": "exact", "relaxation": "gibbs", "pixel": "density"},
}


def test_these_schedules_claim_windows():
    assert WINDOWS == ["coloring", "coloring-fixed", "checkerboard", "synchronous"]


def cut(saved, grid, window):
    """The part that a window holds of a whole's saved state."""
    return [np.ascontiguousarray(window.cut(grid.view(saved[name]))) for name in Field._fields]


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize("how", SEARCHES)
@pytest.mark.parametrize(("name", "number"), [*((name, 0) for name in WINDOWS), ("coloring", 1)])
def test_a_window_relaxes_as_the_whole(any_device, name, how, boundary, number):
    """Sweep by sweep: the halo is as deep as a sweep reaches, steps times the radius of the neighbourhood."""
    machine = opencl(any_device)
    given = SEARCHES[how] | {"order": 2, "schedule": name, "boundary": boundary, "levels": 3}
    shape = (26 << number, (31 << number) - number)  # the last column of the coarse lattice is a pixel short
    run = laid_out(machine, texture((40, 41), seed=2)[..., None], shape, mrf.Options(**given), 2**40 + 9)
    level = run.level(number)
    state, compared = run.enter(number, run.begin().field), 0
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
            inner = opened(small, Field(*map(machine.put, cut(before, run.grid(number), window))))
            inner = inner._replace(penalty=before["penalty"], active=before["active"])  # those of the whole
            inner = inner._replace(schedule=inner.schedule._replace(sweep=before["schedule"].sweep))
            inner, _ = sweep(small, inner)
            ours = [np.array(machine.get(plane)) for plane in inner.field]
            theirs = cut(run.save(state), run.grid(number), window)
            inside = slice(halo, rows - halo), slice(halo, cols - halo)
            for mine, whole in zip(ours, theirs, strict=True):
                assert_same_bits(mine[..., *inside].copy(), whole[..., *inside].copy())
            compared += mine[inside].size
    assert compared > 200


@pytest.mark.parametrize("machine_", ["reference", "device"])
def test_a_window_begins_as_the_whole(request, machine_):
    machine = REFERENCE if machine_ == "reference" else opencl(request.getfixturevalue("any_device"))
    run = laid_out(machine, texture((12, 13))[..., None], (22, 27), mrf.Options(order=2, levels=2), 3)
    everywhere = machine.put(run.sample.places(np.zeros((1, 2), np.int32), 1).positions)
    whole = [np.array(machine.get(plane)) for plane in run.begin().field]
    for number in (0, 1):
        grid = run.grid(number)
        window = grid.window(-3, 5, 8, 6)
        ours = [machine.get(a) for a in start(machine, run.planes, everywhere, window, run.seed)]
        assert_same_bits(ours, [np.ascontiguousarray(window.cut(grid.view(a))) for a in whole])


def test_a_window_of_a_window_lies_where_it_should():
    grid = Grid(40, 50, 2)
    outer = grid.window(15, -4, 12, 9)
    inner = outer.window(3, 2, 4, 5)
    assert inner.within == grid.window(18, -2, 4, 5).within
    assert inner.whole.within == grid.window(0, 0, 20, 25).within
    assert_same_bits(inner.places(inner.sites()), inner.cut(grid.sites().reshape(20, 25)).ravel().astype(np.int64))


@pytest.mark.parametrize(
    ("grid", "window"),
    [(Grid(8, 9), (0, 0, 9, 3)), (Grid(8, 9, 1, False), (6, 0, 3, 3)), (Grid(8, 9, 1, False), (-1, 0, 3, 3))],
    ids=str,
)
def test_a_window_that_does_not_fit_is_refused(grid, window):
    with pytest.raises(ValueError, match="window"):
        grid.window(*window)


def test_places_beyond_32_bits_draw_numbers_of_their_own(machine):
    """The upper bits of a place stand above level and purpose: no two sites of 10^6 x 10^6 share a counter."""
    vast = Grid(10**6, 10**6)
    places = []
    for top, left in [(0, 0), (4294, 967296), (999_990, 999_990), (42949, 672960)]:
        window = Grid(4, 5, part=vast.within._replace(top=top, left=left))
        found = window.places(window.sites())
        places.append(found)
        planes, pixels = machine.put(np.arange(97, dtype=np.float32)[None]), machine.put(np.arange(97, dtype=np.int32))
        ours = machine.get(start(machine, planes, pixels, window, 11).source)
        lo, hi, *_ = random.draw4(11, 0, 0, found, random.START)
        assert_same_bits(ours.ravel(), random.below(lo, hi, 97).astype(np.int32))
    assert np.unique(np.concatenate(places)).size == 80

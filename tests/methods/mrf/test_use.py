"""The penalty on use: how often each candidate is a source, and what it costs for that."""

import numpy as np
import pytest
from cases import REFERENCE, problem

from simdtex.methods.mrf.neighbourhood import Field
from simdtex.methods.mrf.use import FairUse, Regions, use, use_penalty
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.model.source_map import counts, effective_use


@pytest.mark.parametrize(
    ("how", "every"), [({"nowhere": 0.5}, True), ({"nowhere": 0.3, "masked": 0.4, "spacing": 2}, False)], ids=str
)
def test_what_is_from_nowhere_uses_nothing(machine, how, every):
    """And a number is that of a candidate, or of its place among all."""
    p = problem(2, shape=(30, 28), edges="reflect", **how)
    candidates = p.candidates(REFERENCE, every)
    expected = dict.fromkeys(candidates.positions[: candidates.size].tolist(), 0)
    for source, t in zip(p.field.source.ravel().tolist(), p.field.temperature.ravel().tolist(), strict=True):
        if t < 1024 and source >= 0 and p.sample.inside.ravel()[source]:
            expected[source] += 1
    assert sum(expected.values())
    for m in (REFERENCE, machine):
        _, field, _ = p.on(m)
        assert use(m, field, p.grid, p.candidates(m, every)).tolist() == list(expected.values())


@pytest.mark.parametrize("radius", [0, 1, 9])
def test_the_price_is_the_excess_over_the_fair_share(radius):
    rng = np.random.default_rng(radius)
    counts = rng.integers(0, 4, (7, 9)) * (rng.random((7, 9)) < 0.3)
    counts[2, 3] = 60
    expected = np.zeros((7, 9))
    for i, j in np.ndindex(7, 9):
        here = counts[max(0, i - radius) : i + radius + 1, max(0, j - radius) : j + radius + 1]
        expected[i, j] = 12.5 * min(4, max(0, here.mean() / counts.mean() - 1))
    found = use_penalty(counts.ravel(), FairUse((7, 9), radius), 12.5)
    assert found.dtype == np.float32
    assert np.allclose(found, expected.ravel(), rtol=1e-6, atol=1e-6)


FAIR = np.int64([[2, 0, 2, 1], [0, 0, 1, 1], [4, 4, 0, 1]])


def test_what_is_fair_may_differ_and_nobody_is_where_nothing_is_fair():
    """Use in proportion to what is fair costs nothing; a number runs over places, or over candidates alone."""
    there = FAIR.ravel() > 0
    for listed in (False, True):
        fair_use = FairUse((3, 4), 0, FAIR.ravel(), listed)
        where = slice(None) if not listed else there
        used = 3 * FAIR.ravel()
        assert not use_penalty(used[where], fair_use, 7.0)[there[where]].any()
        used[0] += 8  # 14 of a total of 56, where 12 of 48 are due ... 2 of 16
        found = use_penalty(used[where], fair_use, 7.0)
        assert found[0] == np.float32(7.0 * (14 * 16 / (2 * 56) - 1))
        assert np.isinf(found).tolist() == (~there[where]).tolist()
        again = use_penalty(used[where], fair_use, 7.0, found)
        assert np.array_equal(again, found), "an infinite penalty stays so"


def test_what_is_fair_counts_in_the_square_around():
    fair_use = FairUse((3, 4), 1, FAIR.ravel())
    used = np.zeros(12, int)
    used[0], used[8] = 6, 4
    found = use_penalty(used, fair_use, 1.0).reshape(3, 4)
    due, whole = {(0, 0): 2, (2, 1): 9}, 16
    assert found[0, 0] == np.float32(min(4, 6 * whole / (due[0, 0] * 10) - 1))
    assert found[2, 1] == 0.0 == np.float32(max(0, 4 * whole / (due[2, 1] * 10) - 1))


def test_the_penalty_of_a_kind_adds_up_where_it_is_not_as_often_as_asked():
    """Of two regions, from the sweep before or from the level above, beside the penalties of candidates."""
    fair_use = FairUse((2, 2), 0, wanted=np.array([[0.25, 0.75, 0.0], [1.0, 0.0, 0.0]]), gain=100, cold=True)
    used, kinds = np.array([8, 0, 0, 0]), np.array([2, 9, 1, 0, 0, 0])  # of 12: 3, 9 and 0 are due
    kept, before = np.float32([7, 0, 0, 5, 0, 0]), np.array([2, 4, 0, 6], np.float32)
    found = use_penalty(np.append(used, kinds), fair_use, 1.0, np.append(before, kept))
    assert found[:4].tolist() == [2.5, 2, 0, 3]
    assert found[4:].tolist() == [7 + round(-100 / 3 * 12 / 16), 0, 100 * 12 / 16, 5, 0, 0]
    warm = use_penalty(np.append(used, kinds), fair_use, 1.0, np.append(before, kept), 0.5)
    assert warm[:4].tolist() == [1.375, 2, 0, 3]
    assert warm[4:].tolist() == [7 + round(-100 / 12 * 12 / 16), 0, 25 * 12 / 16 // 1 + 1, 5, 0, 0], "as distances are"
    begun = use_penalty(np.append(used, kinds), fair_use, 1.0, kept)
    assert begun.tolist() == [3, 0, 0, 0, *kept], "a level begins with those of the level above"
    assert not use_penalty(np.append(used, kinds), fair_use, 1.0)[4:].any(), "the coarsest with none"


def test_a_kind_is_counted_where_a_region_has_a_relaxed_site_of_it():
    grid = Grid((2, 4))
    of = np.repeat(np.int32([[0, 0, 1, -1]]), 2, 0)
    regions = Regions(np.ones((2, 2, 4)), of, lambda source: source % 2, grid, 1, np.float32(0.5))
    temperature = np.array([[0, 1024, 0, 0], [1023, 0, 0, 0]], np.uint16)
    field = Field(None, np.int32([[4, 5, 6, 7], [8, 9, -1, 5]]), temperature)
    assert regions.counts(field, grid).tolist() == [2, 1, 1, 0, *[0] * 4]
    soft = np.float32([[[0, 8, 0, 1]] * 2, [[3, 0, 0, 0]] * 2, [[9, 9, 9, 9]] * 2])
    found = regions.costs(soft, np.float32([2, 4, -6, 0, *[0] * 4]), grid)
    assert found[:, 0].tolist() == [[0, 7, 0, 1], [4, 0, 3, 0], [9] * 4]


@pytest.mark.parametrize(("shape", "split"), [((100, 110), 0), ((4, 20, 23), 1)])
def test_the_sites_of_a_region_that_lack_neighbours_are_others(shape, split):
    """By the distance from the border; of the region in which they are 32 or more, on the finest, open lattice."""
    within, p = (
        [neighbourhood_offsets(order, len(shape)) for order in (1, 4)],
        np.random.default_rng(1).random((2, *shape)),
    )
    of = np.full(shape, split, np.int32)
    of[..., :2, 10:13], of[..., 0] = 1 - split, -1
    for torus, step in ((False, 1), (False, 2), (True, 1)):
        regions = Regions(p, of, lambda source: source, Grid.of(shape, 1, torus), 2, np.float32(1))
        grid = Grid.of(shape, step, torus)
        sites = np.arange(grid.size, dtype=np.int32)
        rings = sum((grid.neighbours(sites, near) < 0).any(0).astype(int) for near in within).reshape(grid.shape)
        found, plain = regions.at(grid), grid.decimated(of)
        assert (found == np.where((rings > 0) & (plain == split), plain + 2 * rings, plain)).all()
        for number, share in enumerate(regions.wanted(grid)):
            those = grid.decimated(p)[:, found == number]
            assert np.allclose(share, those.mean(1) if those.size else 0)
        if len(shape) == 2:
            assert (regions.at(grid.window(1, 2, 4, 6)) == found[1:5, 2:8]).all()


def test_where_nothing_is_known_nothing_costs():
    nobody = np.zeros(6, np.int32)
    assert use_penalty(nobody, FairUse((2, 3), 1), 5.0).tolist() == [0] * 6
    assert use_penalty(nobody + 1, FairUse((2, 3), 1), 0.0).tolist() == [0] * 6
    assert use_penalty(nobody, FairUse((2, 3), 1), 5.0, np.full(6, 4, np.float32)).tolist() == [2] * 6, (
        "and a penalty fades"
    )


def test_each_sample_is_counted_alone():
    rng = np.random.default_rng(2)
    source = np.dstack([rng.integers(0, 4, (9, 8)), rng.integers(0, 5, (9, 8)), rng.integers(0, 2, (9, 8))])
    source[3, :, :2] = -1
    for sample in range(3):
        own = source[(source[..., 2] == sample) & (source[..., 0] >= 0)]
        expected = np.zeros((4, 5), int)
        for row, col, _ in own:
            expected[row, col] += 1
        assert counts(source, (4, 5), sample=sample).tolist() == expected.tolist()
        if sample < 2:
            found = effective_use(source, (4, 5), piece=2, sample=sample)
            assert found == effective_use(own[np.newaxis, :, :2], (4, 5), piece=2)
    source[0, 0] = (90, 0, 1)  # outside of the smaller sample, but not of its own
    assert counts(source, (4, 5), sample=0).sum() == counts(source, (91, 5), sample=0).sum()
    with pytest.raises(ValueError, match="outside a sample of 4 x 5"):
        counts(source, (4, 5), sample=1)


def test_errors_of_counting():
    one, three = np.zeros((2, 2, 2), int), np.zeros((2, 2, 3), int)
    with pytest.raises(ValueError, match="several samples: say which"):
        counts(three, (4, 4))
    with pytest.raises(ValueError, match="sample is 1: give None"):
        counts(one, (4, 4), sample=1)
    with pytest.raises(ValueError, match="sample is -1: give 0 or more"):
        counts(three, (4, 4), sample=-1)
    with pytest.raises(ValueError, match="no pixel was taken from the sample"):
        effective_use(np.full((3, 3, 2), -1), (4, 4))
    for bad in (np.array([[[-1, 0]]]), np.array([[[0, -1]]]), np.array([[[-2, -2]]]), one[:0]):
        with pytest.raises(ValueError, match="source map"):
            counts(bad, (4, 4))

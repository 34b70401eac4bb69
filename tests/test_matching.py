"""Histogram matching by rank and by lookup, the inverse cdf of a target, and the distance of two histograms."""

import importlib
from fractions import Fraction
from math import floor

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import wasserstein_distance
from skimage.exposure import match_histograms
from tolerances import CONTRAST

from simdtex.ops.matching import distance, inverse_cdf, match_lookup, match_ranks, sort

MODULE = importlib.import_module("simdtex.ops.matching")
LOW, HIGH = -(2**31), 2**31 - 1
UNIT = 2**20
KINDS = {
    "all": lambda rng, shape: rng.integers(LOW, HIGH, shape, endpoint=True),
    "subband": lambda rng, shape: np.rint(rng.normal(0, 2**17, shape)),
    "heavy": lambda rng, shape: np.rint(rng.standard_t(2, shape) * 2**14),
    "ties": lambda rng, shape: rng.integers(-3, 3, shape, endpoint=True),
    "ends": lambda rng, shape: rng.choice([LOW, LOW + 1, 0, HIGH - 1, HIGH], shape),
    "constant": lambda rng, shape: np.full(shape, rng.integers(LOW, HIGH)),
}
kinds = st.sampled_from(sorted(KINDS))
seeds = st.integers(0, 2**16)
histograms = st.sampled_from([2, 3, 16, 255, 256, 4096])


def picture(shape, kind="subband", seed=0):
    return KINDS[kind](np.random.default_rng(seed), shape).astype(np.int64).astype(np.int32)


def tables(targets, bins=256):
    return np.stack([inverse_cdf(np.sort(t), bins) for t in targets])


@st.composite
def pairs(draw, lengths=(1, 2, 7, 40)):
    """Segments, and targets that one to three segments share."""
    n, m, count = draw(st.sampled_from(lengths)), draw(st.sampled_from(lengths)), draw(st.integers(1, 3))
    values = picture((count * draw(st.integers(1, 3)), n), draw(kinds), draw(seeds))
    return values, picture((count, m), draw(kinds), draw(seeds))


def on(machine, operation, *arrays):
    return np.asarray(machine.get(operation(machine, *(machine.put(a) for a in arrays))))


def ordered(values, seed=0):
    first = np.random.default_rng(seed).permutation(values.shape[1]).astype(np.int32)
    return on(REFERENCE, sort, values, first)


def by_rank(values, targets, seed=0):
    return on(REFERENCE, match_ranks, ordered(values, seed), np.sort(targets, 1))


@given(pairs())
def test_the_k_th_smallest_takes_the_value_of_its_rank(case):
    values, targets = case
    order, targets = ordered(values), np.sort(targets, 1)
    (segments, n), m = values.shape, targets.shape[1]
    found = on(REFERENCE, match_ranks, order, targets)
    assert (found.dtype, found.shape) == (np.int32, values.shape)
    for s in range(segments):
        for k in range(n):
            rank = floor((k + Fraction(1, 2)) / n * m)
            assert found[s, order[s, k]] == targets[s * len(targets) // segments, rank]


def test_pictures_without_ties_are_matched_as_by_scikit_image():
    rng = np.random.default_rng(5)
    values, target = (rng.permutation(5000)[:900].astype(np.int32).reshape(30, 30) for _ in range(2))
    expected = match_histograms(values, target)
    assert (by_rank(values.reshape(1, -1), target.reshape(1, -1)) == expected.reshape(1, -1)).all()


def exact_inverse(target, bins):
    """The least x with cdf(x) >= i / bins, by going up through the bins one after another."""
    target = sorted(int(t) for t in target)
    low, width, m = target[0], target[-1] - target[0], len(target)
    counts = [0] * bins
    for t in target:
        counts[min(bins - 1, floor(Fraction(t - low, max(width, 1)) * bins))] += 1
    inverse = []
    for i in range(bins + 1):
        wanted, b = Fraction(i * m, bins), 0
        while wanted > counts[b]:
            wanted, b = wanted - counts[b], b + 1
        part = wanted / counts[b] if wanted else 0
        inverse.append(low + (b + part) * Fraction(width, bins))
    return inverse


@given(st.integers(1, 60), kinds, seeds, st.sampled_from([2, 3, 16, 255, 256]))
def test_the_table_is_the_inverse_of_the_cdf(m, kind, seed, bins):
    target = np.sort(picture((m,), kind, seed))
    table = inverse_cdf(target, bins)
    assert (table.dtype, table.shape) == (np.int32, (bins + 1,))
    assert table.tolist() == [floor(x + Fraction(1, 2)) for x in exact_inverse(target, bins)]
    assert (np.diff(table.astype(np.int64)) >= 0).all()
    assert (table[0], table[-1]) == (target[0], target[-1])


def looked_up(segment, table, down):
    """Exact places in a bin and in the table, which `down` may round; before the result is rounded."""
    segment, table = [int(v) for v in segment], [int(t) for t in table]
    n, bins, low = len(segment), len(table) - 1, min(segment)
    width = max(segment) - low
    counts = [0] * bins
    for v in segment:
        counts[min(bins - 1, (v - low) * bins // max(width, 1))] += 1
    result = []
    for v in segment:
        place = Fraction(bins, 2)
        if width:
            b = min(bins - 1, (v - low) * bins // width)
            part = down(Fraction((v - low) * bins, width) - b)
            place = down(Fraction(bins, n) * (sum(counts[:b]) + counts[b] * part))
        k = min(bins - 1, floor(place))
        result.append(table[k] + (table[k + 1] - table[k]) * (place - k))
    return result


@given(pairs(), st.sampled_from([2, 3, 16, 256]))
def test_a_value_goes_through_the_cdf_and_the_table(case, bins):
    values, targets = case
    inverse = tables(targets, bins)
    found = on(REFERENCE, match_lookup, values, inverse)
    assert (found.dtype, found.shape) == (np.int32, values.shape)
    for s, own in enumerate(values):
        table = inverse[s * len(targets) // len(values)]
        rounded = looked_up(own, table, lambda x: Fraction(floor(x * UNIT), UNIT))
        assert found[s].tolist() == [floor(x + Fraction(1, 2)) for x in rounded]
        steepest = int(np.diff(table.astype(np.int64)).max())
        for ours, exact in zip(found[s].tolist(), looked_up(own, table, Fraction), strict=True):
            assert abs(ours - exact) <= Fraction(1, 2) + Fraction((bins + 1) * steepest, UNIT)


@pytest.mark.parametrize("bins", [2, 3, 255, 256, 4096])
def test_a_constant_segment_takes_the_median(machine, bins):
    """The table's own, and within a bin and a rounding the target's."""
    values, targets = picture((2, 40), "constant"), np.sort(picture((2, 301)))
    inverse = tables(targets, bins).astype(np.int64)
    middle = (inverse[:, bins // 2] + inverse[:, (bins + 1) // 2] + 1) // 2
    for backend in (REFERENCE, machine):
        found = on(backend, match_lookup, values, inverse.astype(np.int32))
        assert (found == middle[:, None]).all()
        if bins >= 255:
            assert (abs(found - targets[:, 150:151]) <= np.ptp(targets, 1)[:, None] / bins + 1).all()


@given(pairs(), seeds)
def test_the_distance_is_the_sum_of_differences(case, seed):
    before = case[0]
    after = picture(before.shape, "all", seed)
    found = on(REFERENCE, distance, before, after)
    assert (found.dtype, found.shape) == (np.int64, before.shape[:1])
    for s, total in enumerate(found.tolist()):
        assert total == sum(abs(int(a) - int(b)) for a, b in zip(before[s], after[s], strict=True))


@pytest.mark.parametrize("m", [50, 150, 300])
def test_after_ranks_it_is_the_wasserstein_distance(m):
    values, targets = picture((2, 300)), picture((2, m), "heavy")
    found = on(REFERENCE, distance, values, by_rank(values, targets))
    for total, one, other in zip(found, values, targets, strict=True):
        assert abs(total - 300 * wasserstein_distance(one, other)) <= CONTRAST * total


def everything(machine, values, targets, bins=256):
    """What each operation makes of a case."""
    ranked = on(machine, match_ranks, ordered(values), np.sort(targets, 1))
    found = on(machine, match_lookup, values, tables(targets, bins))
    return [ranked, found, on(machine, distance, values, ranked)]


@given(case=pairs(lengths=(1, 2, 40, 300)), bins=histograms)
@settings(max_examples=40)
def test_a_device_has_the_references_bits(machine, case, bins):
    assert_same_bits(everything(machine, *case, bins), everything(REFERENCE, *case, bins))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_long_segments_in_several_runs(machine, kind):
    case = picture((2, 20_001), kind), picture((2, 300))
    assert MODULE.run_length(machine, 2, 20_001) < 20_001
    assert_same_bits(everything(machine, *case), everything(REFERENCE, *case))


@pytest.mark.parametrize("length", [3, 64, 299])
def test_the_length_of_a_run_changes_no_bit(machine, monkeypatch, length):
    monkeypatch.setattr(MODULE, "run_length", lambda *_: length)
    for kind in ("all", "heavy"):
        case = picture((6, 300), kind), picture((3, 40))
        for bins in (2, 256):
            assert_same_bits(everything(machine, *case, bins), everything(REFERENCE, *case, bins))


def test_runs_are_not_shorter_than_their_tables_of_counters(machine, monkeypatch):
    """However short a device would have them; so counters take no more memory than values and one table."""
    monkeypatch.setattr(MODULE, "run_length", lambda *_: 1)
    made = []
    empty = machine.empty
    monkeypatch.setattr(machine, "empty", lambda shape, dtype: made.append(shape) or empty(shape, dtype))
    on(machine, match_lookup, picture((3, 600)), tables(picture((1, 40))))
    assert (3, 3, 256) in made
    assert all(np.prod(shape) <= 3 * (600 + 256) for shape in made)

"""Histogram matching by rank and by lookup: sort, ranks, distance, and histograms averaged and spliced."""

import importlib
from fractions import Fraction
from math import floor
from types import SimpleNamespace

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, host, texture
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.methods.pyramid.matcher import Histograms, average, averaged, spliced
from simdtex.methods.pyramid.matcher import histograms as histograms_histograms
from simdtex.methods.pyramid.matching import distance, inverse_cdf, match_lookup, match_ranks, ranking, sort
from simdtex.methods.pyramid.pyramids import Transform

# -- The order of the values of segments: a stable radix sort, the ties in a given order.

MODULE = importlib.import_module("simdtex.methods.pyramid.matching")
LOW, HIGH = -(2**31), 2**31 - 1
KINDS = {
    "all": lambda rng, shape: rng.integers(LOW, HIGH, shape, endpoint=True),
    "subband": lambda rng, shape: np.rint(rng.normal(0, 2**17, shape)),
    "ties": lambda rng, shape: rng.integers(-3, 3, shape, endpoint=True),
    "ends": lambda rng, shape: rng.choice([LOW, LOW + 1, -256, -1, 0, 1, 255, HIGH - 1, HIGH], shape),
    "constant": lambda rng, shape: np.full(shape, rng.integers(LOW, HIGH)),
    "heavy": lambda rng, shape: np.rint(rng.standard_t(2, shape) * 2**14),
    "12 bits": lambda rng, shape: LOW + rng.choice([0, 1, 2**11 - 1, 2**11], shape),
    "22 bits": lambda rng, shape: rng.choice([0, 2**11, 2**22 - 1], shape) - 5,
    "23 bits": lambda rng, shape: rng.choice([0, 2**11, 2**22 - 1, 2**22], shape) - 5,
}


def test_scratch_memory_is_bounded(machine, monkeypatch):
    """Keys and indices for SCRATCH values, and no table of counters for segments of a single value each."""
    monkeypatch.setattr(MODULE, "SCRATCH", 2**12)
    made = []
    empty = machine.empty
    monkeypatch.setattr(machine, "empty", lambda shape, dtype: made.append(shape) or empty(shape, dtype))
    for segments, n in ((100, 300), (3000, 1)):
        problem = case_ranking(segments, n, 1, kind="all")[:2]
        arrays = [machine.put(array) for array in problem]
        made.clear()
        assert_same_bits(np.asarray(machine.get(sort(machine, *arrays))), sort(REFERENCE, *problem))
        assert made[0] == (segments, n)
        assert all(np.prod(shape) <= 2 * 2**12 for shape in made[1:])


# -- Histogram matching by rank in one operation, beside the sort, the ranks and the distance that it is made of.


def case_ranking(segments, n, m, targets=1, kind="subband", seed=0):
    """Values, the order of equal ones, sorted targets."""
    rng = np.random.default_rng(seed)
    values = KINDS[kind](rng, (segments, n)).astype(np.int64).astype(np.int32)
    wanted = np.sort(rng.integers(LOW, HIGH, (targets, m), endpoint=True).astype(np.int32), 1)
    return values, rng.permutation(n).astype(np.int32), wanted


@st.composite
def cases_ranking(draw):
    targets = draw(st.integers(1, 3))
    n, m = (draw(st.sampled_from([1, 2, 7, 40, 300])) for _ in range(2))
    kind, seed = draw(st.sampled_from(sorted(KINDS))), draw(st.integers(0, 2**16))
    return case_ranking(targets * draw(st.integers(1, 3)), n, m, targets, kind, seed)


def run_ranking(machine, problem):
    return host(machine, ranking(machine, *(machine.put(a) for a in problem)))


@given(cases_ranking())
def test_the_reference_is_a_sort_in_python(problem):
    values, first, targets = problem
    matched, moved = run_ranking(REFERENCE, problem)
    (segments, n), m = values.shape, targets.shape[1]
    assert (matched.dtype, moved.dtype, moved.shape) == (np.int32, np.int64, (segments,))
    for s, own in enumerate(values.tolist()):
        target, total = targets[s * len(targets) // segments].tolist(), 0
        for k, i in enumerate(sorted(first.tolist(), key=own.__getitem__)):
            assert matched[s, i] == target[(2 * k + 1) * m // (2 * n)]
            total += abs(own[i] - target[(2 * k + 1) * m // (2 * n)])
        assert moved[s] == total


@given(problem=cases_ranking())
@settings(max_examples=60)
def test_a_device_has_the_references_bits_of_ranking(machine, problem):
    assert_same_bits(run_ranking(machine, problem), run_ranking(REFERENCE, problem))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_work_item_and_several_have_the_same_bits(machine, monkeypatch, kind):
    problem = case_ranking(4, 5000, 3000, 2, kind)
    expected = run_ranking(REFERENCE, problem)
    for alone in (True, False):
        monkeypatch.setattr(MODULE, "alone", lambda *_, alone=alone: alone)
        assert_same_bits(run_ranking(machine, problem), expected)


def test_segments_of_more_values_than_a_word_numbers(machine, monkeypatch):
    monkeypatch.setattr(MODULE, "alone", lambda *_: True)
    problem = case_ranking(1, 2**21 + 1, 1000, kind="all")
    assert_same_bits(run_ranking(machine, problem), run_ranking(REFERENCE, problem))


def test_pieces_of_whole_segments_change_no_bit_of_ranking(machine, monkeypatch):
    """One, two or four segments at a time, the last piece a smaller one; no array beyond the scratch memory."""
    monkeypatch.setattr(MODULE, "alone", lambda *_: True)
    made, empty = [], machine.empty
    monkeypatch.setattr(machine, "empty", lambda shape, dtype: made.append(np.prod(shape)) or empty(shape, dtype))
    problem = case_ranking(5, 300, 100)
    for scratch in (1, 7000, 13_000):
        monkeypatch.setattr(MODULE, "SCRATCH", scratch)
        made.clear()
        assert_same_bits(run_ranking(machine, problem), run_ranking(REFERENCE, problem))
        assert max(made) <= max(MODULE.COUNTERS, 2 * scratch)


def test_who_sorts_alone():
    processor = SimpleNamespace(info=SimpleNamespace(kind="cpu", compute_units=8))
    graphics = SimpleNamespace(info=SimpleNamespace(kind="gpu", compute_units=8))
    assert MODULE.alone(processor, 1, MODULE.SHORT)
    assert not MODULE.alone(processor, 3, MODULE.SHORT + 1)
    assert MODULE.alone(processor, 4, MODULE.LONG)
    assert not MODULE.alone(processor, 4, MODULE.LONG + 1)
    assert not MODULE.alone(graphics, 4, 1)


# -- Histogram matching by rank and by lookup, the inverse cdf of a target, and the distance of two histograms.

UNIT = 2**20
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


@given(st.integers(1, 60), kinds, seeds, st.sampled_from([2, 3, 16, 256]))
@settings(max_examples=40)
def test_the_table_is_the_inverse_of_the_cdf(m, kind, seed, bins):
    target = np.sort(picture((m,), kind, seed))
    table = inverse_cdf(target, bins)
    assert (table.dtype, table.shape) == (np.int32, (bins + 1,))
    assert table.tolist() == [floor(x + Fraction(1, 2)) for x in exact_inverse(target, bins)]
    assert (np.diff(table.astype(np.int64)) >= 0).all()
    assert (table[0], table[-1]) == (target[0], target[-1])


def looked_up(segment, table):
    """By exact places in a bin and in the table, rounded down to the unit."""
    segment, table = [int(v) for v in segment], [int(t) for t in table]
    n, bins, low = len(segment), len(table) - 1, min(segment)
    width = max(segment) - low
    at = [min(bins - 1, (v - low) * bins // max(width, 1)) for v in segment]
    for v, b in zip(segment, at, strict=True):
        place = Fraction(bins, 2)
        if width:
            part = Fraction(((v - low) * bins - b * width) * UNIT // width, UNIT)
            below = sum(other < b for other in at) + at.count(b) * part
            place = Fraction(floor(below * bins * UNIT / n), UNIT)
        k = min(bins - 1, floor(place))
        yield floor(table[k] + (table[k + 1] - table[k]) * (place - k) + Fraction(1, 2))


@given(pairs(), st.sampled_from([2, 3, 16, 256]))
@settings(max_examples=40)
def test_a_value_goes_through_the_cdf_and_the_table(case, bins):
    values, targets = case
    inverse = tables(targets, bins)
    found = on(REFERENCE, match_lookup, values, inverse)
    assert (found.dtype, found.shape) == (np.int32, values.shape)
    for s, own in enumerate(values):
        assert found[s].tolist() == [*looked_up(own, inverse[s * len(targets) // len(values)])]


def everything(machine, values, targets, bins=256):
    """What each operation makes of a case."""
    ranked = on(machine, match_ranks, ordered(values), np.sort(targets, 1))
    found = on(machine, match_lookup, values, tables(targets, bins))
    return [ranked, found, on(machine, distance, values, ranked)]


@given(case=pairs(lengths=(1, 2, 40, 300)), bins=histograms)
@settings(max_examples=40)
def test_a_device_has_the_references_bits_of_matching(machine, case, bins):
    assert_same_bits(everything(machine, *case, bins), everything(REFERENCE, *case, bins))


def test_the_length_of_a_run_changes_no_bit_of_matching(machine, monkeypatch):
    case = picture((2, 20_001), "heavy"), picture((2, 300))
    assert MODULE.run_length(machine, 2, 20_001) < 20_001
    assert_same_bits(everything(machine, *case), everything(REFERENCE, *case))
    for length, kind, bins in ((3, "all", 2), (64, "heavy", 256), (299, "constant", 2)):
        monkeypatch.setattr(MODULE, "run_length", lambda *_, length=length: length)
        case = picture((6, 300), kind), picture((3, 40))
        assert_same_bits(everything(machine, *case, bins), everything(REFERENCE, *case, bins))


def test_runs_are_not_shorter_than_their_tables_of_counters(machine, monkeypatch):
    """However short a device would have them; so counters take no more memory than values and one table."""
    monkeypatch.setattr(MODULE, "run_length", lambda *_: 1)
    assert MODULE._runs(machine, 3, 600, 256) == (3, (3, 600, 3, 256))


# -- Histograms as sorted values: of a channel and its pyramids, averaged and spliced.


def sorted_values(rng, bands, m, top):
    return np.sort(rng.integers(-top, top, (bands, m), np.int32, endpoint=True), axis=1)


def test_counts_are_averaged():
    """Every value as often as its share demands, then m quantiles: the least value at which the cdf reaches p."""
    for sizes, weights in (((4, 8), (1, 1)), ((8, 2, 4), (1, 2, 1)), ((2, 2), (3, 1))):  # shares that are exact
        parts = [sorted_values(np.random.default_rng(m), 2, m, 6) for m in sizes]
        m = max(sizes)
        found = average(parts, weights)
        assert (found.dtype, found.shape) == (np.int32, (2, m))
        for band, own in enumerate(found):
            often = [p[band].repeat(w * 8 // p.shape[1]) for p, w in zip(parts, weights, strict=True)]
            pool = np.sort(np.concatenate(often))
            assert own.tolist() == [pool[-(-(2 * k + 1) * pool.size // (2 * m)) - 1] for k in range(m)]


def test_histograms_are_averaged_band_by_band_or_spliced_at_a_subband():
    rng = np.random.default_rng(4)
    a, b = (
        Histograms(sorted_values(rng, 1, m, 99), [sorted_values(rng, f, m // 2, 99) for f in (1, 4)]) for m in (20, 12)
    )
    found = averaged([a, b], [1, 2])
    assert (found.pixels == average([a.pixels, b.pixels], [1, 2])).all()
    for own, first, second in zip(found.subbands, a.subbands, b.subbands, strict=True):
        assert (own == average([first, second], [1, 2])).all()
    assert (average([a.pixels, b.pixels, a.pixels], [0, 0.25, 0]) == b.pixels).all(), "a weight of 0 counts nothing"
    joined = spliced(a, b, 1)
    assert joined.pixels is a.pixels
    assert [*map(id, joined.subbands)] == [id(b.subbands[0]), id(a.subbands[1])]


def test_those_of_a_channel_are_its_pixels_and_its_pyramids_one_after_another():
    channel = texture((12, 11)).astype(np.int32) * 4000
    pyramids = [Transform(REFERENCE, "laplacian", 1, 4, False), Transform(REFERENCE, "steerable", 2, 2, False)]
    found = histograms_histograms(REFERENCE, channel, *pyramids)
    assert (found.pixels == np.sort(channel, axis=None)[None]).all()
    expected = [band for pyramid in pyramids for band in pyramid.make(channel[None])]
    assert [band.shape for band in found.subbands] == [(len(band), band[0].size) for band in expected]
    for own, band in zip(found.subbands, expected, strict=True):
        for values, plane in zip(own, band, strict=True):
            assert (values == np.sort(plane, axis=None)).all()

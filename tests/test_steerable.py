"""The steerable pyramid in integers: its filters, its two operations, and pyramids made with them."""

import numpy as np
import plain_pyramid as plain
import pytest
from cases import REFERENCE, assert_same_bits, opencl
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pyrtools.pyramids import SteerablePyramidSpace
from pyrtools.pyramids.filters import parse_filter
from tolerances import HALF, PYRTOOLS, UNIT32

from simdtex.ops.steerable import ORIENTATIONS, UNIT, filters, steerable_join, steerable_split

TOP = 2**20
BANKS = pytest.mark.parametrize("orientations", ORIENTATIONS)
BORDERS = pytest.mark.parametrize("torus", [True, False], ids=["torus", "mirror"])


def noise(shape, seed=0, top=TOP):
    return np.random.default_rng(seed).integers(-top, top, shape, np.int32, endpoint=True)


def any_taps(count, side, seed):
    """Filters of any taps at all, so that nothing may be turned or swapped unseen."""
    taps = np.random.default_rng(seed).normal(0, 1 / side, (count, side, side))
    return (np.rint(taps * UNIT) / UNIT).astype(np.float32)


def split(machine, picture, taps, torus, step=1):
    arrays = machine.put(np.ascontiguousarray(picture)), machine.put(taps)
    return np.asarray(machine.get(steerable_split(machine, *arrays, torus, step)))


def join(machine, terms, shape, torus):
    terms = [(machine.put(np.ascontiguousarray(bands)), machine.put(taps), step) for bands, taps, step in terms]
    return np.asarray(machine.get(steerable_join(machine, terms, shape, torus)))


def half(shape):
    return tuple(-(-n // 2) for n in shape)


def build(machine, picture, orientations, levels, torus):
    """High-pass residue, bands of every level, finest first, and low-pass residue: (bands, planes, rows, cols) each."""
    bank = filters(orientations)
    subbands = [split(machine, picture, bank.high[None], torus)]
    low = split(machine, picture, bank.low[None], torus)
    for _ in range(levels):
        subbands.append(split(machine, low[0], bank.bands, torus))
        low = split(machine, low[0], bank.down[None], torus, 2)
    return [*subbands, low]


def collapse(machine, subbands, orientations, torus):
    bank = filters(orientations)
    high, *levels, low = subbands
    for bands in reversed(levels):
        terms = [(bands, bank.bands, 1), (low, 4 * bank.down[None], 2)]
        low = join(machine, terms, bands.shape[2:], torus)[None]
    return join(machine, [(high, bank.high[None], 1), (low, bank.low[None], 1)], high.shape[2:], torus)


def float32_error(terms):
    """How far a sum of products in float32 may be from the exact one, given each product's largest taps and values."""
    count = sum(taps.size for _, taps, _ in terms)
    total = sum(abs(taps).sum(dtype=float) * max(1, abs(values).max()) for values, taps, _ in terms)
    return HALF + (count + 1) * UNIT32 * total


@BANKS
def test_the_filters_are_those_of_pyrtools(orientations):
    theirs = parse_filter(f"sp{orientations - 1}_filters", normalize=False)
    ours = filters(orientations)
    side = ours.bands.shape[1]
    bands = theirs["bfilts"].T.reshape(orientations, side, side).swapaxes(1, 2)
    for found, known in [
        *((ours.high, theirs["hi0filt"]), (ours.low, theirs["lo0filt"])),
        *((ours.down, theirs["lofilt"] / 2), (ours.bands, bands)),
    ]:
        assert found.dtype == np.float32
        assert (found == np.rint(known * UNIT) / UNIT).all()
        assert found.shape == known.shape
        assert not found.flags.writeable


@pytest.mark.parametrize("orientations", [0, 3, 5, 8, -1])
def test_other_orientations_are_refused(orientations):
    with pytest.raises(ValueError, match=rf"orientations is {orientations}; give one of 1, 2, 4, 6"):
        filters(orientations)


@pytest.mark.parametrize("orientations", [2, 4, 6])
def test_an_orientation_answers_to_waves_along_its_angle(orientations):
    bands = filters(orientations).bands
    row, col = np.indices(bands.shape[1:]) - bands.shape[1] // 2
    degrees = np.arange(180)
    angle = np.deg2rad(degrees)[:, None, None]
    wave = np.exp(1.4j * (np.cos(angle) * col - np.sin(angle) * row))  # counter-clockwise: towards lower rows
    answer = abs(np.einsum("aij,fij->fa", wave, bands))
    assert (answer.argmax(1) == degrees[:: 180 // orientations]).all()


@st.composite
def splits(draw, counts=(1, 2, 4, 6)):
    shape = draw(st.integers(1, 3)), draw(st.integers(1, 9)), draw(st.integers(1, 9))
    seed = draw(st.integers(0, 2**16))
    taps = any_taps(draw(st.sampled_from(counts)), draw(st.sampled_from([3, 5, 9])), seed)
    return noise(shape, seed), taps, draw(st.booleans()), draw(st.sampled_from([1, 2]))


@st.composite
def joins(draw):
    planes, shape = draw(st.integers(1, 3)), (draw(st.integers(1, 9)), draw(st.integers(1, 9)))
    seed, terms = draw(st.integers(0, 2**16)), []
    for n in range(draw(st.integers(1, 3))):
        count, side, step = (draw(st.sampled_from(some)) for some in ([1, 2, 4], [3, 5, 9], [1, 2]))
        size = half(shape) if step == 2 else shape
        terms.append((noise((count, planes, *size), seed + n), any_taps(count, side, seed + n), step))
    return terms, shape, draw(st.booleans())


@given(splits())
@settings(max_examples=60)
def test_the_reference_correlates_by_the_rule(case):
    picture, taps, torus, step = case
    found = split(REFERENCE, *case)
    assert found.dtype == np.int32
    assert found.shape == (len(taps), *picture[:, ::step, ::step].shape)
    for f, bands in zip(taps, found, strict=True):
        bound = float32_error([(picture, f, step)])
        for g, band in zip(picture, bands, strict=True):
            assert abs(band - plain.split(g, f, torus, step)).max() <= bound


@given(joins())
@settings(max_examples=60)
def test_the_reference_joins_by_the_rule(case):
    terms, shape, torus = case
    found = join(REFERENCE, *case)
    assert found.dtype == np.int32
    assert found.shape == (terms[0][0].shape[1], *shape)
    bound = float32_error(terms)
    for plane, picture in enumerate(found):
        single = [(b[plane], f, step) for bands, taps, step in terms for b, f in zip(bands, taps, strict=True)]
        assert abs(picture - plain.join(single, shape, torus)).max() <= bound


@given(st.integers(1, 8), st.integers(1, 8), st.sampled_from([1, 2]), st.integers(0, 2**16))
def test_on_a_torus_a_join_is_the_transpose_of_a_split(rows, cols, step, seed):
    """<split(x), y> is <x, join(y)>: sums of products of rounded numbers, in float64."""
    taps, x = any_taps(2, 5, seed), noise((1, rows, cols), seed)
    bands = split(REFERENCE, x, taps, True, step)
    y = noise(bands.shape, seed + 1)
    joined = join(REFERENCE, [(y, taps, step)], (rows, cols), True)
    there, back = np.vdot(bands.astype(float), y), np.vdot(x.astype(float), joined)
    bound = abs(y).sum(dtype=float) * float32_error([(x, taps, 1)]) + abs(x).sum(dtype=float) * float32_error(
        [(y, taps, 1)]
    )
    assert abs(there - back) <= bound


@given(case=splits(counts=(4,)))  # the other banks follow below; each is compiled anew
@example(case=(noise((1, 1, 1)), any_taps(4, 9, 0), False, 2))
@example(case=(noise((2, 2, 3)), any_taps(1, 9, 0), True, 2))
@settings(max_examples=25)
def test_a_device_correlates_to_the_references_bits(machine, case):
    assert_same_bits(split(machine, *case), split(REFERENCE, *case))


@given(case=joins())
@example(case=([(noise((1, 1, 1, 1)), any_taps(1, 9, 0), 2)], (1, 1), False))
@example(case=([(noise((2, 1, 1, 2)), any_taps(2, 9, 0), 2)], (1, 3), True))
@settings(max_examples=25)
def test_a_device_joins_to_the_references_bits(machine, case):
    assert_same_bits(join(machine, *case), join(REFERENCE, *case))


@BORDERS
@BANKS
def test_a_device_builds_and_collapses_to_the_references_bits(machine, orientations, torus):
    for shape in ((3, 37, 41), (2, 18, 64)):
        picture = noise(shape)
        subbands = build(REFERENCE, picture, orientations, 2, torus)
        assert_same_bits(build(machine, picture, orientations, 2, torus), subbands)
        whole = collapse(REFERENCE, subbands, orientations, torus)
        assert_same_bits(collapse(machine, subbands, orientations, torus), whole)


@pytest.mark.parametrize(("scratch", "bound"), [(2**12, 2**12), (2**17, 2**17), (1, 10 * 48 * 4)])
def test_scratch_memory_is_bounded(any_device, scratch, bound):
    """What is laid out at a time fits in it, or is the rows of one work-item; all launches use the same."""
    machine, sizes = opencl(any_device, scratch=scratch), []
    arrays, empty = [machine.put(array) for array in (noise((4, 37, 31)), filters(4).bands)], machine.empty
    machine.empty = lambda shape, dtype: (sizes.append((shape, dtype)), empty(shape, dtype))[1]
    try:
        steerable_split(machine, *arrays, True, 1)
    finally:
        machine.empty = empty
    padded = [4 * int(np.prod(shape)) for shape, dtype in sizes if dtype == np.float32]
    assert len(padded) == 1
    assert padded[0] <= bound


@BORDERS
@pytest.mark.parametrize("shape", [(72, 90), (71, 93)], ids=["even", "odd"])
@BANKS
def test_a_pyramid_is_that_of_pyrtools(orientations, shape, torus):
    picture, levels = noise((1, *shape)), 3
    subbands = build(REFERENCE, picture, orientations, levels, torus)
    theirs = SteerablePyramidSpace(
        picture[0].astype(float),
        height=levels,
        order=orientations - 1,
        edge_type="circular" if torus else "reflect1",
    )

    def close(found, known):
        assert found.shape == known.shape
        assert abs(found - known).max() <= PYRTOOLS * abs(known).max()

    high, *bands, low = subbands
    close(high[0, 0], theirs.pyr_coeffs["residual_highpass"])
    close(2.0**levels * low[0, 0], theirs.pyr_coeffs["residual_lowpass"])
    for level, own in enumerate(bands):
        for i in range(orientations):
            close(2.0**level * own[i, 0], theirs.pyr_coeffs[level, i])
    close(collapse(REFERENCE, subbands, orientations, torus)[0], theirs.recon_pyr())

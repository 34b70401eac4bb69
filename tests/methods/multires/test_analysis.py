"""The analysis of a sample: the Laplacian pyramid, the bank of filters, features and their energy."""

from fractions import Fraction

import numpy as np
import plain_multires as plain
import pytest
from cases import REFERENCE, analyse, assert_same_bits, host, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import TAP

from simdtex.methods.multires.analysis import pyramid
from simdtex.methods.pyramid.laplacian import bank, filters, half, laplacian_band, laplacian_collapse, laplacian_reduce
from simdtex.methods.pyramid.stretched import TOP, Stretched

# -- The Laplacian pyramid in integers, equations (5) and (6): its steps, its inverse, and tiles.

RANGES = {"sample": (0, TOP), "bits": (0, 1), "signed": (-TOP, TOP), "small": (-3, 3)}
sides = st.integers(1, 9)


def picture(shape, planes=1, values="sample", seed=0):
    low, high = RANGES[values]
    return np.random.default_rng(seed).integers(low, high, (planes, *shape), np.int32, endpoint=True)


@st.composite
def pictures(draw):
    shape, planes = (draw(sides), draw(sides)), draw(st.integers(1, 3))
    return picture(shape, planes, draw(st.sampled_from(sorted(RANGES))), draw(st.integers(0, 2**16)))


@st.composite
def levels_of_an_output(draw):
    """A band of the sample, pixels of it that make up a level of whole and broken tiles, and the level above."""
    tile, planes = (draw(sides), draw(sides)), draw(st.integers(1, 3))
    shape = draw(st.integers(1, 2 * tile[0] + 1)), draw(st.integers(1, 2 * tile[1] + 1))
    seed = draw(st.integers(0, 2**16))
    rng = np.random.default_rng(seed)
    source = rng.integers(0, tile[0] * tile[1], shape).astype(np.int32)
    above = [n // m * k + -(-(n % m) // 2) for n, m, k in zip(shape, tile, half(tile), strict=True)]
    limit = draw(st.sampled_from([TOP, 2**24]))
    coarse = rng.choice([-limit, limit, 0, 1, *rng.integers(-limit, limit, 5)], (planes, *above)).astype(np.int32)
    return picture(tile, planes, "signed", seed), source, coarse


def steps(machine, g, torus):
    """One reduction and the band it leaves."""
    fine = machine.put(g)
    coarse = laplacian_reduce(machine, fine, torus)
    return host(machine, [coarse, laplacian_band(machine, fine, coarse, torus)])


def collapse(machine, band, source, coarse, torus, blend=False):
    arrays = [machine.put(np.ascontiguousarray(a)) for a in (band, source, coarse)]
    return np.asarray(machine.get(laplacian_collapse(machine, *arrays, torus, blend)))


@given(pictures(), st.booleans())
def test_the_reference_is_the_rule(g, torus):
    coarse, band = steps(REFERENCE, g, torus)
    assert (coarse.dtype, band.dtype) == (np.int32, np.int32)
    for plane, own in enumerate(g):
        (_, above), (expected, _) = plain.pyramid(own, 2, torus)
        assert (coarse[plane] == above).all()
        assert (band[plane] == expected).all()


@given(levels_of_an_output(), st.booleans())
def test_the_reference_collapses_and_blends_by_the_rule(case, torus):
    band, source, coarse = case
    cut, blended = (collapse(REFERENCE, *case, torus, blend) for blend in (False, True))
    assert cut.dtype == blended.dtype == np.int32
    for plane, own in enumerate(coarse):
        up = plain.expanded(own, source.shape, band.shape[1:], torus)
        assert (cut[plane] == band[plane].ravel()[source] + up).all()
        assert (blended[plane] == plain.faded(band[plane], source, torus) + up).all()


def test_nothing_overflows_at_the_limits(machine):
    """Sums of the sample, of what 30 levels can add up to, and of integers up to the 2**24 that is promised."""
    rng = np.random.default_rng(3)
    for g in (np.full((1, 8, 8), -TOP), rng.choice([-TOP, TOP], (1, 8, 8))):
        for torus in (True, False):
            coarse, band = steps(machine, g.astype(np.int32), torus)
            assert_same_bits(steps(REFERENCE, g.astype(np.int32), torus), [coarse, band])
            assert abs(coarse).max() <= TOP
            assert abs(band).max() <= 2 * TOP
    for most in (2**24, 30 * TOP):
        for sign in (1, -1):
            coarse = np.full((1, 4, 4), sign * most, np.int32)
            band = np.full((1, 8, 8), sign * TOP, np.int32)
            for blend in (False, True):
                source = np.arange(64, dtype=np.int32).reshape(8, 8)
                fine = collapse(machine, band, source, coarse, True, blend)
                assert (fine == sign * (most + TOP)).all()


# -- Local texture measures, equation (7): the bank of filters and the responses to it.

UNIT = 2**14


def run(machine, picture, band, taps, torus):
    arrays = [machine.put(np.ascontiguousarray(a, np.int32)) for a in (picture, band, taps)]
    return np.asarray(machine.get(filters(machine, *arrays, torus)))


@st.composite
def levels(draw):
    """A level, its band, and filters of any taps at all, so that nothing may be turned or swapped unseen."""
    rows, cols, planes = draw(st.integers(1, 9)), draw(st.integers(1, 9)), draw(st.integers(1, 3))
    count, side = draw(st.integers(0, 3)), draw(st.sampled_from([3, 5]))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    picture = rng.integers(-TOP, TOP, (planes, rows, cols), endpoint=True)
    band = rng.integers(-TOP, TOP, (planes, rows, cols), endpoint=True)
    taps = rng.integers(-UNIT // 4, UNIT // 4, (count, side, side), endpoint=True)
    return picture, band, taps, draw(st.booleans())


@given(levels())
def test_the_reference_is_the_rule_of_filters(case):
    picture, band, taps, torus = case
    planes, rows, cols = picture.shape
    features = run(REFERENCE, *case)
    assert features.dtype == np.int32
    assert features.shape == (rows * cols, planes * (1 + len(taps)))
    expected = []
    for g, own in zip(picture, band, strict=True):
        expected += [own, *(plain.response(g, f, torus) for f in taps)]
    assert (features == np.stack(expected, -1).reshape(rows * cols, -1)).all()


def test_sums_beyond_32_bits_are_exact(machine):
    picture = np.full((1, 6, 5), TOP)
    taps = np.full((2, 5, 5), UNIT)
    taps[1] *= -1
    for m in (REFERENCE, machine):
        features = run(m, picture, picture, taps, True)
        assert (features == [TOP, 25 * TOP, -25 * TOP]).all()


@pytest.mark.parametrize("orientations", [1, 3, 4, 6])
def test_the_bank_is_the_derivatives_of_a_gaussian(orientations):
    """Taps are made on the host, and none is near a tie, so the last bits of another exp and cos change none."""
    parts = [plain.derivative(degree, a, 0.7, 3) for degree in (1, 2) for a in plain.angles(orientations)]
    formula, taps = np.array([f * UNIT / positive for f, positive in parts]), bank(orientations)
    assert (taps.dtype, taps.shape) == (np.int32, formula.shape)
    assert not taps.sum((1, 2)).any(), "the centre makes up for the others"
    taps, formula = (np.delete(f.reshape(len(f), -1), 4, 1) for f in (taps, formula))
    assert abs(taps - formula).max() <= TAP
    assert abs(formula % 1 - 0.5).min() > 1e-4


# -- The analysis of a sample: its levels, its features and their energy, and what does not change them.


def run_analysis(machine, pixels, **options):
    """Everything that an analysis holds, in NumPy arrays."""
    found = analyse(machine, pixels, **options)
    return [*host(machine, found.bands), np.asarray(machine.get(found.features)), found.energy]


def by_level(found):
    """Features of the levels from 1 on, each (rows * cols, M)."""
    sizes = [rows * cols for rows, cols in found.shapes[1:]]
    assert len(found.features) == sum(sizes)
    return np.split(found.features, np.cumsum(sizes)[:-1])


@st.composite
def analyses(draw):
    """Pixels and options, all of them."""
    shape, channels = (draw(st.integers(1, 12)), draw(st.integers(1, 12))), draw(st.sampled_from([1, 2, 3]))
    dtype = draw(st.sampled_from([np.uint8, np.uint16, np.float32]))
    most = 1 + (max(shape) - 1).bit_length()
    return texture(shape, channels, dtype, draw(st.integers(0, 99))), {
        "orientations": draw(st.sampled_from([0, 1, 2, 4])),
        "levels": draw(st.none() | st.integers(1, most)),
        "boundary": draw(st.sampled_from(["torus", "open"])),
    }


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (33, 16), (13, 9)])
def test_levels_go_down_to_a_single_pixel_or_to_the_number_given(size):
    pixels = texture(size, 2)
    whole = analyse(REFERENCE, pixels)
    assert max(whole.shapes[-1]) == 1 and all(max(shape) > 1 for shape in whole.shapes[:-1])
    assert whole.shapes == [tuple(-(-n // 2**level) for n in size) for level in range(whole.levels)]
    for levels in range(1, whole.levels + 1):
        found = analyse(REFERENCE, pixels, levels=levels)
        assert found.shapes == whole.shapes[:levels]
        assert_same_bits(found.bands[:-1], whole.bands[: levels - 1])
        assert_same_bits(found.energy[:-1], whole.energy[: levels - 1])
        gaussian, _ = pyramid(REFERENCE, whole.sample.planes, levels, torus=True)
        assert_same_bits(found.bands[-1], gaussian[-1])
        assert levels > 1 or not (found.features.any() or found.energy.any()), "a single level has no nodes"
    words = rf"^levels={whole.levels + 1} is too many for this sample; give at most {whole.levels}$"
    with pytest.raises(ValueError, match=words):
        analyse(REFERENCE, pixels, levels=whole.levels + 1)


@given(analyses())
@settings(max_examples=40)
def test_the_reference_is_the_rule_of_analysis(case):
    """Bands, features and energy from the pixels on."""
    pixels, options = case
    found = analyse(REFERENCE, pixels, **options)
    torus = options["boundary"] == "torus"
    assert found.torus == torus
    sample = Stretched(pixels)
    for plane, own in enumerate(sample.planes):
        _, bands = plain.pyramid(own, found.levels, torus)
        for level, band in enumerate(bands):
            assert (found.bands[level][plane] == band).all()
    if found.levels == 1:
        return
    taps = bank(options["orientations"])
    [luminance] = sample.luminance
    gaussian, bands = plain.pyramid(luminance, found.levels, torus)
    assert found.features.dtype == np.int32
    for level, features in enumerate(by_level(found), 1):
        fits = min(found.shapes[level]) >= 3
        nothing = np.zeros(found.shapes[level])
        columns = [bands[level], *(plain.response(gaussian[level], f, torus) if fits else nothing for f in taps)]
        assert (features == np.stack(columns, -1).reshape(len(features), -1)).all()
        for m, column in enumerate(features.T.tolist()):
            assert found.energy[level, m] == energy(column, level == found.levels - 1 and m % (1 + len(taps)) == 0)


def energy(column, residue):
    """Z of (10) to the closest float64: the mean square, or the variance."""
    square = Fraction(sum(x * x for x in column), len(column))
    return float(square - Fraction(sum(column), len(column)) ** 2 if residue else square)


def test_the_energy_of_many_large_features_is_exact():
    """Sums beyond 2**53, which float64 does not hold, and beyond one block of them."""
    from simdtex.methods.multires.analysis import _energy

    features = np.random.default_rng(2).integers(-2 * TOP, 2 * TOP, (2**20 + 3, 2), np.int32)
    features[:, 1] //= 2**15
    features[:, 1] += 2 * TOP
    columns = features.T.tolist()
    assert _energy(features).tolist() == [energy(column, False) for column in columns]
    assert _energy(features, about_mean=True).tolist() == [energy(column, True) for column in columns]


def test_it_warns_where_no_level_is_as_large_as_the_filters(caplog):
    for shape, options, told in (((4, 40), {}, True), ((5, 5), {}, False), ((4, 4), {"orientations": 0}, False)):
        caplog.clear()
        analyse(REFERENCE, texture(shape, 1), **options)
        said = [record.getMessage() for record in caplog.records if "is as large as the filters" in record.getMessage()]
        assert len(said) == told
        assert not told or "4 rows x 40 columns" in said[0]


@given(case=analyses())
@settings(max_examples=15)
def test_a_device_has_the_references_bits_of_analysis(machine, case):
    pixels, options = case
    assert_same_bits(run_analysis(machine, pixels, **options), run_analysis(REFERENCE, pixels, **options))

"""The analysis of a sample: its levels, its features and their energy, and what does not change them."""

import logging
from fractions import Fraction

import numpy as np
import plain_multires as plain
import pytest
from cases import REFERENCE, analyse, assert_same_bits, host, texture
from hypothesis import example, given, settings
from hypothesis import strategies as st

from simdtex.methods.multires.analysis import pyramid
from simdtex.model.stretched import TOP, Stretched
from simdtex.ops.pyramids import bank

WARNING = "is as large as the filters"
sides = st.integers(1, 12)


def run(machine, pixels, **options):
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
    shape, channels = (draw(sides), draw(sides)), draw(st.sampled_from([1, 2, 3]))
    dtype = draw(st.sampled_from([np.uint8, np.uint16, np.float32]))
    most = 1 + (max(shape) - 1).bit_length()
    return texture(shape, channels, dtype, draw(st.integers(0, 99))), {
        "orientations": draw(st.sampled_from([0, 1, 2, 4])),
        "levels": draw(st.none() | st.integers(1, most)),
        "boundary": draw(st.sampled_from(["torus", "open"])),
    }


@given(sides, sides)
@example(1, 1)
@example(1, 40)
@example(33, 16)
def test_levels_go_down_to_a_single_pixel(rows, cols):
    found = analyse(REFERENCE, texture((rows, cols), 1))
    assert found.shapes[0] == (rows, cols)
    assert found.shapes[-1] == (1, 1)
    for level, shape in enumerate(found.shapes):
        assert shape == (-(-rows // 2**level), -(-cols // 2**level))
        assert found.bands[level].shape == (1, *shape)
    assert all(max(shape) > 1 for shape in found.shapes[:-1])
    assert found.levels == len(found.shapes) == len(found.bands) == len(found.energy)


def test_the_number_of_levels_can_be_given():
    pixels = texture((13, 9), 2)
    whole = analyse(REFERENCE, pixels)
    assert whole.levels == 5
    assert analyse(REFERENCE, pixels, levels=5).shapes == whole.shapes
    for levels in (1, 2, 3, 4):
        found = analyse(REFERENCE, pixels, levels=levels)
        assert found.shapes == whole.shapes[:levels]
        assert_same_bits(found.bands[:-1], whole.bands[: levels - 1])
        assert_same_bits(found.energy[:-1], whole.energy[: levels - 1])
        gaussian, _ = pyramid(REFERENCE, whole.sample.planes, levels, torus=True)
        assert_same_bits(found.bands[-1], gaussian[-1])


@pytest.mark.parametrize(("shape", "levels", "most"), [((13, 9), 6, 5), ((1, 1), 2, 1), ((8, 8), 5, 4), ((1, 9), 9, 5)])
def test_too_many_levels_are_an_error_that_says_how_many_there_are(shape, levels, most):
    with pytest.raises(ValueError, match=rf"^levels={levels} is too many for this sample; give at most {most}$"):
        analyse(REFERENCE, texture(shape, 1), levels=levels)


def test_a_single_level_has_no_nodes():
    found = analyse(REFERENCE, texture((9, 7), 1), levels=1)
    assert_same_bits(found.bands, [found.sample.planes])
    assert not found.features.any()
    assert not found.energy.any()


@given(analyses())
@settings(max_examples=40)
def test_the_reference_is_the_rule(case):
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


@pytest.mark.parametrize("boundary", ["torus", "open"])
def test_levels_smaller_than_the_filters_have_no_responses_but_a_band(boundary):
    found = analyse(REFERENCE, texture((40, 20), 1), boundary=boundary)
    fitting = 0
    for (rows, cols), features, z in zip(found.shapes[1:], by_level(found), found.energy[1:], strict=True):
        if min(rows, cols) >= 3:
            assert features.any(0).all()
            assert (z > 0).all()
            fitting += 1
        else:
            assert features[:, 0].any()
            assert not features[:, 1:].any()
            assert not z[1:].any()
    assert fitting == 3


def test_no_orientations_leave_the_bands_alone(machine):
    pixels = texture((9, 8), 2)
    for m in (REFERENCE, machine):
        bare = run(m, pixels, orientations=0)
        whole = run(REFERENCE, pixels, orientations=2)
        assert_same_bits(bare[:-2], whole[:-2])
        assert_same_bits(bare[-2:], [np.ascontiguousarray(a[:, ::5]) for a in whole[-2:]])


@pytest.mark.parametrize("boundary", ["torus", "open"])
def test_contrast_and_a_constant_change_nothing(boundary):
    byte = texture((13, 10), 3)
    options = {"boundary": boundary}
    expected = run(REFERENCE, byte, **options)
    for a, b, dtype in ((1, 1000, np.uint16), (257, 0, np.uint16), (100, -20000, np.int16), (0.25, -3, np.float32)):
        assert_same_bits(run(REFERENCE, (byte.astype(np.float64) * a + b).astype(dtype), **options), expected)
    for a, b in ((1 / 255, 0.0), (1e300, -1e302), (2.0**-1000, 0.0)):
        assert_same_bits(run(REFERENCE, byte * a + b, **options), expected)
    dull = byte // 2 + np.uint8(7)
    assert_same_bits(run(REFERENCE, dull * np.uint16(3), **options), run(REFERENCE, dull, **options))


def test_on_a_torus_a_shift_of_the_sample_shifts_its_features():
    pixels = texture((16, 24), 1)
    before = analyse(REFERENCE, pixels, levels=4, edges="keep")
    after = analyse(REFERENCE, np.roll(pixels, (8, -16), (0, 1)), levels=4, edges="keep")
    assert_same_bits(after.energy, before.energy)
    for level, (u, v) in enumerate(zip(by_level(before), by_level(after), strict=True), 1):
        rows, cols = before.shapes[level]
        assert_same_bits(np.roll(u.reshape(rows, cols, -1), (8 >> level, -16 >> level), (0, 1)).reshape(u.shape), v)


@pytest.mark.parametrize(
    ("shape", "options", "told"),
    [
        ((4, 4), {}, True),
        ((4, 40), {}, True),
        ((5, 5), {}, False),
        ((64, 64), {}, False),
        ((64, 64), {"levels": 2}, False),
        ((4, 4), {"orientations": 0}, False),
    ],
    ids=str,
)
def test_it_warns_where_no_level_is_as_large_as_the_filters(caplog, shape, options, told):
    with caplog.at_level(logging.WARNING, logger="simdtex"):
        analyse(REFERENCE, texture(shape, 1), **options)
    said = [record.getMessage() for record in caplog.records if WARNING in record.getMessage()]
    assert len(said) == told
    if told:
        assert f"{shape[0]} rows x {shape[1]} columns" in said[0]


@given(case=analyses())
@settings(max_examples=15)
def test_a_device_has_the_references_bits(machine, case):
    pixels, options = case
    assert_same_bits(run(machine, pixels, **options), run(REFERENCE, pixels, **options))

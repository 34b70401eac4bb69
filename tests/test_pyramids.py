"""Pyramids of pictures in their own unit, and the transform that methods use."""

import numpy as np
import plain_pyramid as plain
import pytest
from cases import REFERENCE, assert_same_bits, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from pyrtools.pyramids import SteerablePyramidSpace
from tolerances import HALF, MIRRORED, PARSEVAL, PYRTOOLS, RECONSTRUCTION

from benchmarks.subbands import decompose
from simdtex.methods.pyramid.pyramids import Transform, most_levels

KINDS = pytest.mark.parametrize("kind", ["steerable", "laplacian"])
BORDERS = pytest.mark.parametrize("boundary", ["open", "torus"])
BANKS = pytest.mark.parametrize("orientations", [1, 2, 4, 6])


def white(shape, seed=0):
    return np.random.default_rng(seed).normal(100, 5, shape)


def made(picture, **options):
    return decompose(picture, device=REFERENCE, **options)


def lost(picture, pyramid):
    """rms of what is lost, relative to the picture's standard deviation."""
    return np.sqrt(np.mean((pyramid.collapse(device=REFERENCE)[..., 0] - picture) ** 2)) / picture.std()


@given(
    st.tuples(st.integers(1, 13), st.integers(1, 13)),
    st.sampled_from(["open", "torus"]),
    st.sampled_from([np.uint8, np.float64, np.bool_, np.uint16]),
    st.integers(0, 20),
)
@settings(max_examples=60)
def test_a_laplacian_pyramid_is_exact_to_half_a_unit(shape, boundary, dtype, levels):
    """But on a torus with an odd side, where every level is rounded twice."""
    picture, levels = texture(shape, None, dtype), min(levels, most_levels(*shape))
    pyramid = made(picture, kind="laplacian", boundary=boundary, levels=levels)
    back = pyramid.collapse(device=REFERENCE)
    assert back.shape == (*shape, 1)
    odd = sum(any(n % 2 for n in band.shape[2:]) for band in pyramid.subbands[:-1])
    assert abs(back[..., 0] - picture.astype(float)).max() <= (HALF + (boundary == "torus") * odd) * pyramid.unit


@pytest.mark.parametrize("shape", [(64, 64), (65, 97), (70, 50), (33, 64)])
@BANKS
def test_a_steerable_pyramid_loses_little_on_a_torus_of_any_size(orientations, shape):
    """Whatever the mean: half as many rows of an odd number would leave a seam, which a mean makes worse."""
    for levels in (1, 3):
        picture = white(shape, levels)
        pyramid = made(picture, orientations=orientations, levels=levels, boundary="torus")
        assert lost(picture, pyramid) <= RECONSTRUCTION[orientations]


@BANKS
def test_with_mirrored_borders_it_loses_more_near_them(orientations):
    picture = white((96, 96))
    pyramid = made(picture, orientations=orientations, levels=3)
    assert lost(picture, pyramid) <= MIRRORED
    error = (pyramid.collapse(device=REFERENCE)[..., 0] - picture)[40:-40, 40:-40]
    assert np.sqrt(np.mean(error**2)) / picture.std() <= 1.5 * RECONSTRUCTION[orientations], "the mean of few pixels"


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (5, 3), (2, 2)])
@KINDS
@BORDERS
def test_tiny_pictures_have_a_pyramid_of_every_height(shape, kind, boundary):
    picture = texture(shape, None, np.float64)
    for levels in range(most_levels(*shape) + 1):
        pyramid = made(picture, kind=kind, levels=levels, boundary=boundary)
        assert len(pyramid.subbands) == levels + (2 if kind == "steerable" else 1)
        back = pyramid.collapse(device=REFERENCE)
        assert np.isfinite(back).all()
        assert pyramid.subbands[0].shape == (1, 1, *shape)


@pytest.mark.parametrize("boundary", ["open", "torus"])
@BANKS
def test_a_steerable_pyramid_is_that_of_pyrtools_in_the_pictures_unit(orientations, boundary):
    picture = white((72, 96))
    pyramid = made(picture, orientations=orientations, levels=3, boundary=boundary)
    edges = {"open": "reflect1", "torus": "circular"}[boundary]
    theirs = SteerablePyramidSpace(picture, height=3, order=orientations - 1, edge_type=edges).pyr_coeffs
    # What is left of a constant: bands have none, and the residue has that of what was taken away.
    high, *bands, low = pyramid.subbands
    low = 8 * low[0, 0]
    known = theirs["residual_lowpass"]
    constant = (known - low).mean() / pyramid.offset
    assert constant == pytest.approx(8, rel=1e-3)
    close = [(high[0, 0], theirs["residual_highpass"]), (low + constant * pyramid.offset, known)]
    close += [
        (2.0**level * own[i, 0], theirs[level, i]) for level, own in enumerate(bands) for i in range(orientations)
    ]
    for found, band in close:
        assert found.shape == band.shape
        assert abs(found - band).max() <= PYRTOOLS * max(abs(band).max(), np.ptp(picture))


@pytest.mark.parametrize("shape", [(24, 20), (23, 17)])
def test_a_laplacian_pyramid_is_that_of_the_plain_sums(shape):
    picture = white(shape)
    pyramid = made(picture, kind="laplacian", levels=3)
    theirs = list(plain.Laplacian(picture - pyramid.offset, 3, 1, False).subbands.values())
    for found, band in zip(pyramid.subbands, theirs, strict=True):
        assert abs(found[0, 0] - band).max() <= 4 * pyramid.unit, "rounded once a level"


@BANKS
def test_a_steerable_pyramid_keeps_the_sum_of_squares(orientations):
    picture = white((64, 96))
    picture -= picture.mean()
    high, *bands, low = made(picture, orientations=orientations, levels=3, boundary="torus").subbands
    low = low + made(picture, levels=0).offset
    squares = (high**2).sum() + 4**3 * (low**2).sum()
    squares += sum(4**level * (own**2).sum() for level, own in enumerate(bands))
    assert squares == pytest.approx((picture**2).sum(), rel=PARSEVAL[orientations])


@KINDS
def test_a_constant_is_all_offset(kind):
    pyramid = made(np.full((9, 9), 7.5), kind=kind, levels=2)
    assert not any(band.any() for band in pyramid.subbands)
    assert pyramid.offset == 7.5
    assert (pyramid.collapse(device=REFERENCE) == 7.5).all()


@KINDS
@BORDERS
def test_a_device_has_the_references_bits(machine, kind, boundary):
    for shape in ((37, 41), (18, 64)):
        picture = white(shape)
        ours = decompose(picture, kind=kind, levels=2, boundary=boundary, device=machine)
        theirs = made(picture, kind=kind, levels=2, boundary=boundary)
        assert_same_bits(ours.subbands, theirs.subbands)
        assert_same_bits(ours.collapse(device=machine), theirs.collapse(device=REFERENCE))


@KINDS
def test_names_are_as_many_as_subbands(kind):
    transform = Transform(REFERENCE, kind, 2, 4, True)
    made_of = transform.make(np.zeros((1, 9, 8), np.int32))
    assert len(transform.names) == len(made_of)
    assert transform.names[-3:] == ["level 0", "level 1", "low"]

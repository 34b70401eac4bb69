"""Solid textures: blocks whose slices look like a sample, along the axes and across them; and a mixture with grey."""

import numpy as np
import plain_pyramid as plain
import pytest
from cases import REFERENCE, assert_same_bits, opencl, texture
from scipy.stats import wasserstein_distance
from skimage import data
from subbands import decompose
from tolerances import SLICE_PIXELS, SLICE_SUBBANDS, SOLID_SEAM

import simdtex
from simdtex.methods.pyramid.solid import FAMILIES

SIDE, ON = 32, {"rng": 3, "device": REFERENCE}
WAYS = {
    "together": {"solids": "turns", "slices": "together"},
    "each": {"solids": "turns", "slices": "each"},
    "paper": {"solids": "average", "slices": "each"},
}


def solid(sample, shape, **options):
    return simdtex.synthesize_solid(sample, shape, **(ON | options))


@pytest.mark.parametrize(("way", "dtype"), [*zip(WAYS, (np.uint8, np.float64, np.bool_), strict=True)])
def test_a_multiple_of_the_sample_has_exactly_its_pixels(way, dtype):
    sample = texture((8, 9), None, dtype)
    made = solid(sample, (6, 8, 9), iterations=2, **WAYS[way])
    assert_same_bits(np.sort(made, axis=None), np.sort(np.repeat(sample, 6)))


def test_any_block_works():
    sample = texture((16, 15), None, np.float32)
    for shape, kind in (((1, 1, 1), "steerable"), ((1, 5, 7), "laplacian"), ((9, 10, 11), "steerable")):
        made = solid(sample, shape, pyramid=kind)
        assert made.shape == shape
        assert_same_bits(np.sort(made, axis=None), plain.quantiles(sample, made.size))


def test_a_constant_gives_the_constant_and_grey_stays_grey():
    assert (solid(np.full((8, 8), 7, np.uint8), (3, 4, 5)) == 7).all()
    grey = np.repeat(texture((16, 16))[..., None], 3, -1)
    made = solid(grey, (8, 9, 10), channel_axis=-1)
    assert made.shape == (8, 9, 10, 3)
    assert (made == made[..., :1]).all()
    assert_same_bits(made[..., 0].copy(), solid(grey[..., 0], (8, 9, 10)))


def test_a_block_has_its_channels_last_and_so_has_its_start_which_may_be_grey():
    sample, grey = texture((12, 12), 3), texture((36, 6)).reshape(6, 6, 6)
    how = {"iterations": 1, "channel_axis": -1}
    known = solid(sample, (6, 6, 6), start=np.stack([grey] * 3, -1), **how)
    assert_same_bits(solid(sample, (6, 6, 6), start=grey, **how), known)
    assert_same_bits(solid(np.moveaxis(sample, -1, 0), (6, 6, 6), start=grey, iterations=1, channel_axis=0), known)


def test_a_start_is_followed():
    sample = texture((16, 16))
    layers = np.broadcast_to((np.arange(12) // 6)[:, None, None], (12, 12, 12))
    made = solid(sample, (12, 12, 12), start=layers, iterations=0)
    assert made[:6].max() <= made[6:].min()


def test_a_callback_sees_every_part_of_a_turn():
    seen, shapes = [], set()

    def callback(progress):
        seen.append((progress.iteration, progress.fraction, bool(progress.stage)))
        shapes.add(progress.image().shape)

    solid(texture((12, 12), 3), (6, 7, 8), channel_axis=-1, iterations=2, callback=callback)
    assert shapes == {(6, 7, 8, 3)}
    assert [f for _, f, _ in seen] == pytest.approx([k / 24 for k in range(1, 25)])
    assert [(i, end) for i, _, end in seen] == [(i, k == 11) for i in (1, 2) for k in range(12)]


@pytest.mark.parametrize(
    ("shape", "options", "words"),
    [
        ((4, 5), {}, r"shape must be three integers \(depth, rows, columns\), not \(4, 5\)"),
        ((2**11, 2**11, 2**11), {}, "a block of 2048 x 2048 x 2048 is beyond 2"),
        ((4, 5, 6), {"slices": "all"}, "unknown slices 'all'; choose one of: each, together"),
        ((4, 5, 6), {"levels": 3}, "levels=3 is too many for a side of 4 pixels; give at most 2"),
        ((4, 5, 6), {"start": np.zeros((5, 6))}, r"start has shape \(5, 6\); give one of 4 x 5 x 6 pixels"),
    ],
)
def test_what_is_wrong_is_one_sentence(shape, options, words):
    with pytest.raises(ValueError, match=words):
        solid(texture((9, 9)), shape, **options)


def test_a_grey_pattern_has_the_colours_of_a_palette_along_one_axis():
    """Without a pattern the other two axes would be noise; and a flat band has no deviation of its own."""
    samples = [texture((16, 16), 3) // 2 + 64, texture((16, 16), seed=1)]
    made, output = simdtex.mix(samples, (16, 16), palette=0, pattern=1, channel_axis=-1, full_output=True, **ON)
    spread = np.linalg.svd(made.reshape(-1, 3) - made.mean((0, 1)))[1]
    assert spread[1] < 16 * 0.5 < spread[0], "no more than rounding"
    assert max(output.statistics["iterations"][-1]["distances"].values()) < 1
    stripes = np.tile(np.arange(32, dtype=np.uint8) % 5, (32, 1))
    _, output = simdtex.synthesize(stripes, (16, 16), method="pyramid", full_output=True, **ON)
    assert max(output.statistics["iterations"][-1]["distances"].values()) < 5


def moved(sample, made):
    """The Wasserstein distance of two sets of values in standard deviations of the first."""
    return wasserstein_distance(np.ravel(sample), np.ravel(made)) / np.std(sample)


def of_subbands(sample, slices):
    """The same of every subband, all slices of a family together; by subband, finest first."""
    options = {"levels": 2, "device": REFERENCE}
    middle = sample.mean()
    own = decompose(sample - middle, **options)
    theirs = decompose(np.moveaxis(slices, 0, -1) - middle, boundary="torus", channel_axis=-1, **options)
    low = own.subbands[-1] + own.offset
    pairs = [*zip(own.subbands[:-1], theirs.subbands[:-1], strict=True), (low, theirs.subbands[-1] + theirs.offset)]
    return [np.mean([moved(a, b) for a, b in zip(*pair, strict=True)]) for pair in pairs]


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_slices_have_the_samples_statistics_and_no_seam(any_device, way):
    ratios = []
    for name in ("gravel", "grass"):
        sample = getattr(data, name)()[:64, :64]
        block = solid(sample, (SIDE,) * 3, device=opencl(any_device), **WAYS[way])
        for axes, back in FAMILIES.values():
            slices = block.transpose(axes)
            assert (slices.transpose(back) == block).all()
            each = [moved(sample, one) for one in slices]
            assert np.mean(each) <= SLICE_PIXELS[way][0] and max(each) <= SLICE_PIXELS[way][1]
            assert max(of_subbands(sample, slices)) <= SLICE_SUBBANDS[way]
            steps = abs(np.diff(slices.astype(float), axis=0, append=slices[:1])).mean((1, 2))
            ratios.append(steps[-1] / steps[:-1].mean())
    noise = solid(sample, (SIDE,) * 3, iterations=0)
    assert max(of_subbands(sample, noise)) > 3 * max(SLICE_SUBBANDS.values()), "else the test shows nothing"
    assert abs(np.mean(ratios) - 1) <= SOLID_SEAM / 2
    assert max(abs(np.array(ratios) - 1)) <= 2 * SOLID_SEAM

"""Solid textures: blocks whose slices look like a sample, along the axes and across them."""

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


def slices_of(volume, name):
    """A family of slices (slice, row, column, ...) of a volume (depth, rows, cols, ...)."""
    return np.transpose(volume, (*FAMILIES[name][0], *range(3, volume.ndim)))


def sample_of(name):
    return getattr(data, name)()[:64, :64]


@pytest.fixture(scope="module")
def blocks(any_device):
    """Each kind of block, made once."""
    made = {}

    def block(name, way):
        if (name, way) not in made:
            made[name, way] = solid(sample_of(name), (SIDE,) * 3, device=opencl(any_device), **WAYS[way])
        return made[name, way]

    return block


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("dtype", [np.uint8, np.float64, np.bool_])
def test_a_multiple_of_the_sample_has_exactly_its_pixels(way, dtype):
    sample = texture((8, 9), None, dtype)
    made = solid(sample, (6, 8, 9), iterations=2, **WAYS[way])
    assert_same_bits(np.sort(made, axis=None), np.sort(np.repeat(sample, 6)))


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 5, 7), (3, 1, 4), (5, 4, 1), (9, 10, 11)], ids=str)
@pytest.mark.parametrize("kind", ["steerable", "laplacian"])
def test_any_block_works(shape, kind):
    sample = texture((16, 15), None, np.float32)
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


def test_channels_come_last_whatever_axis_the_sample_has_them_on():
    sample = texture((12, 13), 3)
    options = {"iterations": 1}
    theirs = solid(sample, (6, 7, 8), channel_axis=-1, **options)
    assert_same_bits(solid(np.moveaxis(sample, -1, 0), (6, 7, 8), channel_axis=0, **options), theirs)


def moved(sample, made):
    """The Wasserstein distance of two sets of values in standard deviations of the first."""
    return wasserstein_distance(np.ravel(sample), np.ravel(made)) / np.std(sample)


def of_subbands(sample, slices, boundary):
    """The same of every subband, all slices of a family together; by subband, finest first."""
    options = {"levels": 2, "device": REFERENCE}
    middle = sample.mean()
    own = decompose(sample - middle, **options)
    theirs = decompose(np.moveaxis(slices, 0, -1) - middle, boundary=boundary, channel_axis=-1, **options)
    low = own.subbands[-1] + own.offset
    pairs = [*zip(own.subbands[:-1], theirs.subbands[:-1], strict=True), (low, theirs.subbands[-1] + theirs.offset)]
    return [np.mean([moved(a, b) for a, b in zip(*pair, strict=True)]) for pair in pairs]


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["gravel", "grass"])
def test_slices_have_the_samples_statistics(blocks, name, way):
    sample, block = sample_of(name), blocks(name, way)
    for family in FAMILIES:
        slices = slices_of(block, family)
        each = [moved(sample, one) for one in slices]
        assert np.mean(each) <= SLICE_PIXELS[way][0]
        assert max(each) <= SLICE_PIXELS[way][1]
        assert max(of_subbands(sample, slices, "torus")) <= SLICE_SUBBANDS[way]


def test_noise_of_the_same_pixels_has_not():
    """Else the tests above would show nothing."""
    sample, block = sample_of("gravel"), solid(sample_of("gravel"), (SIDE,) * 3, iterations=0)
    assert max(of_subbands(sample, block, "torus")) > 3 * max(SLICE_SUBBANDS.values())


@pytest.mark.parametrize("way", WAYS)
def test_a_block_has_no_seam_in_any_direction(blocks, way):
    ratios = []
    for name in ("gravel", "grass"):
        block = blocks(name, way).astype(float)
        for axis in range(3):
            inside = abs(np.diff(block, axis=axis)).mean()
            ratios.append(abs(block.take(0, axis) - block.take(-1, axis)).mean() / inside)
    assert abs(np.mean(ratios) - 1) <= SOLID_SEAM / 2
    assert max(abs(np.array(ratios) - 1)) <= 2 * SOLID_SEAM


def test_families_are_all_slices_and_turn_back():
    volume = np.arange(24).reshape(2, 3, 4)
    assert (slices_of(volume, "x-y")[1] == volume[1]).all()
    assert (slices_of(volume, "x-z")[2] == volume[:, 2]).all()
    assert (slices_of(volume, "y-z")[3] == volume[:, :, 3]).all()
    for axes, back in FAMILIES.values():
        assert (volume.transpose(axes).transpose(back) == volume).all()


def test_a_start_is_followed():
    sample = texture((16, 16))
    layers = np.broadcast_to((np.arange(12) // 6)[:, None, None], (12, 12, 12))
    made = solid(sample, (12, 12, 12), start=layers, iterations=0)
    assert made[:6].max() <= made[6:].min()
    whole = solid(sample, (12, 12, 12))
    again = solid(sample, (12, 12, 12), start=whole, iterations=0)
    assert abs(again.astype(int) - whole).max() <= 1, "it has all pixels already"


@pytest.mark.parametrize("axis", [-1, 0])
def test_a_start_has_the_blocks_axes_whatever_those_of_the_sample(axis):
    """A block has its channels last; a grey one has none."""
    sample = np.moveaxis(texture((12, 12), 3), -1, axis)
    grey = texture((36, 6)).reshape(6, 6, 6)
    colour = np.stack([grey, grey, grey], -1)
    known = solid(texture((12, 12), 3), (6, 6, 6), start=colour, channel_axis=-1)
    options = {"channel_axis": axis}
    assert_same_bits(solid(sample, (6, 6, 6), start=colour, **options), known)
    grey_start = solid(sample, (6, 6, 6), start=grey, **options)
    assert_same_bits(grey_start, solid(texture((12, 12), 3), (6, 6, 6), start=grey, channel_axis=-1))


def test_a_callback_sees_every_part_of_a_turn():
    seen, shapes = [], set()

    def callback(progress):
        seen.append((progress.iteration, progress.fraction, bool(progress.stage)))
        shapes.add(progress.image().shape)

    solid(texture((12, 12), 3), (6, 7, 8), channel_axis=-1, iterations=2, callback=callback)
    assert shapes == {(6, 7, 8, 3)}
    assert [f for _, f, _ in seen] == pytest.approx([k / 24 for k in range(1, 25)])
    assert [i for i, _, _ in seen] == [1] * 12 + [2] * 12
    assert [end for _, _, end in seen] == ([False] * 11 + [True]) * 2


@pytest.mark.parametrize(
    ("shape", "options", "error", "words"),
    [
        ((4, 5), {}, ValueError, r"shape must be three integers \(depth, rows, columns\), not \(4, 5\)"),
        (5, {}, ValueError, "shape must be three integers"),
        ((3, 4, 5, 6), {}, ValueError, "shape must be three integers"),
        ((0, 4, 5), {}, ValueError, "depth of the output is 0; give 1 or more"),
        ((4, 5, -1), {}, ValueError, "columns of the output is -1; give 1 or more|block"),
        ((4.0, 5, 6), {}, TypeError, "depth of the output must be an integer, not 4.0"),
        ((2**11, 2**11, 2**11), {}, ValueError, "a block of 2048 x 2048 x 2048 is beyond 2"),
        ((4, 5, 6), {"slices": "all"}, ValueError, "unknown slices 'all'; choose one of: each, together"),
        (
            (4, 5, 6),
            {"slice": "all"},
            TypeError,
            "unknown option 'slice' of the method 'pyramid' .did you mean 'slices'",
        ),
        ((4, 5, 6), {"levels": 3}, ValueError, "levels=3 is too many for a side of 4 pixels; give at most 2"),
        ((4, 5, 6), {"start": np.zeros((5, 6))}, ValueError, r"start has shape \(5, 6\); give one of 4 x 5 x 6 pixels"),
    ],
)
def test_what_is_wrong_is_one_sentence(shape, options, error, words):
    with pytest.raises(error, match=words):
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

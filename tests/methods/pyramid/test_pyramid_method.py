"""The method ``pyramid`` against a plain Match-texture, and mixtures of textures."""

from math import prod

import numpy as np
import plain_pyramid as plain
import pytest
from cases import REFERENCE, assert_same_bits, texture
from scipy.stats import wasserstein_distance
from skimage import data
from subbands import decompose
from tolerances import HALVES, KEPT, MIXED_BANDS, PALETTE, PLAIN_TEXTURE, SEAM, SPREAD

import simdtex
from simdtex.jobs.studies.quality import histogram_distance, seam
from simdtex.methods.pyramid.laplacian import noise

# -- The method ``pyramid``: against a plain float64 Match-texture, and what Heeger and Bergen's method promises.

TYPES = [np.bool_, np.uint8, np.int64, np.float16, np.float64]


def synthesize(sample, shape, **options):
    return simdtex.synthesize(sample, shape, **({"method": "pyramid", "rng": 1, "device": REFERENCE} | options))


def gravel(side=64):
    return data.gravel()[100 : 100 + side, 100 : 100 + side]


def first_noise(shape, seed, channel=0):
    """What a channel begins with."""
    return noise(REFERENCE, 1, prod(shape), seed, channel).reshape(shape).astype(float)


@pytest.mark.parametrize(
    ("kind", "orientations", "shape"),
    [("steerable", 4, (60, 84)), ("laplacian", 4, (48, 72))],
)
def test_it_is_match_texture_of_the_paper(kind, orientations, shape):
    """Pixel by pixel, but where a rounding changes the order of two values: the more iterations, the more often."""
    sample, seed = gravel(), 7
    begun, mean = first_noise(shape, seed), sample.mean()
    for iterations, share in PLAIN_TEXTURE.items():
        theirs = plain.match_texture(begun, sample - mean, kind, 2, orientations, iterations) + mean
        options = {"pyramid": kind, "levels": 2, "orientations": orientations, "iterations": iterations}
        ours = synthesize(sample, shape, rng=seed, **options)
        assert (np.sort(ours, axis=None) == np.rint(np.sort(theirs, axis=None))).all()
        assert (ours == np.rint(theirs)).mean() >= share
        assert np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] > 0.999


@pytest.mark.parametrize("kind", ["steerable", "laplacian"])
def test_colours_are_matched_as_decorrelated_channels(kind):
    sample = data.immunohistochemistry()[100:148, 100:148]
    begun = [first_noise((40, 48), 7, channel) for channel in range(3)]
    for iterations, share in PLAIN_TEXTURE.items():
        theirs = plain.match_color_texture(begun, sample, kind, 2, 4, iterations)
        options = {"pyramid": kind, "levels": 2, "iterations": iterations, "channel_axis": -1}
        ours = synthesize(sample, (40, 48), rng=7, **options)
        assert (ours == np.clip(np.rint(theirs), 0, 255)).mean() >= share


@pytest.mark.parametrize("dtype", TYPES)
def test_a_multiple_of_the_sample_has_exactly_its_pixels(dtype):
    sample = texture((12, 10), None, dtype)
    made = synthesize(sample, (24, 30))
    assert made.dtype == sample.dtype
    assert_same_bits(np.sort(made, axis=None), np.sort(np.tile(sample, (2, 3)), axis=None))


def test_another_size_has_the_samples_quantiles():
    for dtype, shape in ((np.uint8, (9, 9)), (np.float64, (17, 13)), (np.uint8, (1, 7))):
        sample = texture((12, 10), None, dtype)
        made = synthesize(sample, shape)
        assert_same_bits(np.sort(made, axis=None), plain.quantiles(sample, prod(shape)))


def test_a_torus_has_no_seam():
    """The gradient across the seam is that inside: the mean of some pictures, as a seam is short."""
    sample = data.gravel()[:96, :96]
    ratios = [seam(synthesize(sample, (97, 74), rng=seed, iterations=3)) for seed in range(6)]
    assert abs(np.mean(ratios) - 1) <= SEAM


def test_a_flat_start_gives_no_gradient():
    """Equal values come in a random order, not in that of the rows."""
    sample, shape = gravel(), (64, 64)
    made = [synthesize(sample, shape, rng=seed, start=np.full(shape, 3.0), levels=2) for seed in range(4)]
    for m in (np.array(made, float), np.swapaxes(made, 1, 2).astype(float)):
        assert abs(m[:, :32].mean() - m[:, 32:].mean()) <= HALVES * sample.std()
    assert len({m.tobytes() for m in made}) == 4


def test_a_start_shows_in_the_result_and_its_contrast_does_not():
    sample = gravel()
    kept = {"start": sample, "edges": "wrap"}
    made, output = synthesize(sample, sample.shape, full_output=True, **kept)
    assert np.corrcoef(made.ravel(), sample.ravel())[0, 1] >= KEPT
    assert max(output.statistics["iterations"][0]["distances"].values()) < 0.05
    assert (synthesize(sample, sample.shape, iterations=0, **kept) == sample).all()
    stripes = np.indices((64, 64))[1] // 16 % 2
    made = synthesize(sample, (64, 64), start=stripes, iterations=1)
    assert np.corrcoef(made.ravel(), stripes.ravel())[0, 1] > 0.3
    for same in (stripes[..., None] * 1e-200, stripes * -1e9 * -1 + 7):
        assert_same_bits(synthesize(sample, (64, 64), start=same, iterations=1), made)


def test_a_start_may_be_grey_or_have_the_samples_channels():
    sample, grey = texture((16, 16), 3), texture((10, 12), seed=4)
    colour = np.repeat(grey[..., None], 3, -1)
    made = synthesize(sample, (10, 12), start=colour, channel_axis=-1)
    assert made.shape == (10, 12, 3)
    first = np.moveaxis(sample, -1, 0)
    ours = synthesize(first, (10, 12), start=np.moveaxis(colour, -1, 0), channel_axis=0)
    assert_same_bits(np.moveaxis(ours, 0, -1).copy(), made)
    assert synthesize(first, (10, 12), start=grey, channel_axis=0).shape == (3, 10, 12)


def test_a_flat_channel_stays_flat():
    for dtype, color in ((np.uint8, "decorrelate"), (np.float64, "channels")):
        sample = texture((16, 16), 3, dtype)
        sample[..., 1] = 1
        made = synthesize(sample, (20, 18), channel_axis=-1, color=color)
        assert np.ptp(made[..., 1]) == 0 < np.ptp(made[..., 0])
        assert made[0, 0, 1] == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize(("channels", "color"), [(3, "decorrelate"), (5, "channels")])
def test_any_number_of_channels_keeps_means_and_covariance(channels, color):
    sample = texture((32, 32), channels, np.float64)
    made = synthesize(sample, (32, 32), channel_axis=-1, color=color)
    flat, own = made.reshape(-1, channels), sample.reshape(-1, channels)
    assert flat.mean(0) == pytest.approx(own.mean(0), abs=0.02 * own.std())
    assert flat.std(0) == pytest.approx(own.std(0), rel=SPREAD[color])


def test_a_huge_or_a_tiny_range_makes_no_difference():
    sample = np.rint(texture((12, 12), None, np.float64) * 1000)
    for scale in (1e300, 5e-324 * 2**30):
        assert_same_bits(synthesize(sample * scale, (15, 14)), synthesize(sample, (15, 14)) * scale)
        colour = texture((12, 12), 3, np.float64) * scale
        made = synthesize(colour, (15, 14), channel_axis=-1)
        assert colour.min() <= made.min() < made.max() <= colour.max()
    ends = np.iinfo(np.int64)
    sample = np.array([[ends.min, ends.max, 0, 5]] * 4, np.int64)
    assert set(np.unique(synthesize(sample, (8, 8)))) == {ends.min, ends.max, 0, 5}


@pytest.mark.parametrize("kind", ["steerable", "laplacian"])
def test_tiny_samples_and_outputs_and_no_levels_work(kind):
    for shape in ((1, 1), (1, 7), (5, 3)):
        pixels = texture(shape)
        for options in ({}, {"match": "lookup", "edges": "wrap"}):
            made = synthesize(pixels, (6, 7), pyramid=kind, **options)
            assert pixels.min() <= made.min() <= made.max() <= pixels.max()
        assert synthesize(texture((7, 9)), shape, pyramid=kind).shape == shape
    assert (np.sort(synthesize(pixels, (5, 3), levels=0, pyramid=kind), None) == np.sort(pixels, None)).all()


def test_a_callback_sees_every_channel_of_every_iteration():
    seen = []

    def callback(progress):
        assert progress.doing == f"iteration {progress.iteration} of {progress.iterations}"
        seen.append((progress.iteration, progress.fraction, progress.stage, progress.image()))

    sample = np.moveaxis(texture((12, 11), 3), -1, 0)
    made = synthesize(sample, (10, 9), channel_axis=0, iterations=2, callback=callback)
    ends = [(i, f"iteration0{i}" if c == 2 else None) for i in (1, 2) for c in range(3)]
    assert [(i, end) for i, _, end, _ in seen] == ends
    assert [fraction for _, fraction, *_ in seen] == pytest.approx([k / 6 for k in range(1, 7)])
    assert_same_bits(seen[-1][-1], made)
    assert_same_bits(seen[2][-1], synthesize(sample, (10, 9), channel_axis=0, iterations=1))


def test_statistics_say_what_was_done():
    _, output = synthesize(texture((24, 20)), (16, 17), full_output=True, rng=9, start=np.zeros((16, 17)))
    said = output.statistics
    assert (said["device"], said["seed"], said["device_seconds"]) == (REFERENCE.name, 9, None)
    assert said["options"] == {
        **{"pyramid": "steerable", "levels": 1, "orientations": 4, "iterations": 5, "match": "rank"},
        **{"edges": "reflect", "color": "decorrelate"},
    }
    assert said["seconds"] >= sum(report["seconds"] for report in said["iterations"]) > 0
    assert output.source is None
    assert output.stages == []


def test_a_distance_is_that_of_two_histograms():
    """With a Laplacian pyramid of no levels, the residue's distance is that of the pixels before."""
    sample = texture((16, 16), None, np.float64)
    begun = np.exp(np.linspace(0, 3, 256)).reshape(16, 16)
    options = {"start": begun, "pyramid": "laplacian", "levels": 1, "iterations": 1}
    made, output = synthesize(sample, (16, 16), full_output=True, **options)
    matched = plain.match_histogram(begun, sample)
    bands, own = (plain.Laplacian(p, 1, 1, torus).subbands for p, torus in ((matched, True), (sample, False)))
    for name, known in ((0, "level 0"), ("low", "low")):
        moved = abs(np.sort(bands[name], axis=None) - np.sort(own[name], axis=None)).mean() / own[name].std()
        assert output.statistics["iterations"][0]["distances"][known] == pytest.approx(moved, rel=1e-4)
    assert histogram_distance(sample, made) == pytest.approx(0, abs=1e-6)


# -- Mixtures of textures: colours of one with the pattern of another, averages, low and high frequencies.


def mix(samples, shape, **options):
    return simdtex.mix(samples, shape, **({"rng": 4, "device": REFERENCE} | options))


def colours(hue, seed, shape=(48, 40)):
    """A picture of two colours blended by a texture of its own, and some noise."""
    rng = np.random.default_rng(seed)
    share = texture(shape, None, np.float64, seed)[..., None]
    picture = 128 + 25 * share * np.array(hue) + rng.normal(0, 3, (*shape, 3))
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


WARM, COLD = colours((2.0, 0.5, -1.0), 1), colours((-1.0, 0.3, 2.0), 2, (44, 52))
GREYS = [getattr(data, name)()[:96, :96] for name in ("grass", "gravel")]


def moments(picture):
    flat = picture.reshape(-1, picture.shape[-1]).astype(float)
    return flat.mean(0), np.cov(flat.T, bias=True)


def distances(sample, made, levels=3):
    """By subband, finest first: the Wasserstein distance from the sample's in its standard deviations."""
    bands = [
        decompose(p - p.mean(), levels=levels, boundary=boundary, device=REFERENCE).subbands
        for p, boundary in ((sample, "open"), (made, "torus"))
    ]

    def apart(a, b):
        return wasserstein_distance(a.ravel() - a.mean(), b.ravel() - b.mean()) / a.std()

    return [np.mean([*map(apart, *pair)]) for pair in zip(*bands, strict=True)]


def test_a_mixture_has_the_colours_of_its_palette():
    samples, palette, pattern = [WARM, COLD], 0, 1
    made = mix(samples, (64, 64), palette=palette, pattern=pattern, channel_axis=-1)
    (mean, covariance), (known, wanted), (other, _) = map(moments, (made, samples[palette], samples[pattern]))
    assert abs(mean - known).max() <= PALETTE * np.sqrt(np.diag(wanted)).max()
    assert abs(mean - known).max() < 0.2 * abs(mean - other).max()
    assert abs(covariance - wanted).max() <= 2 * PALETTE * wanted.max()


def test_one_sample_for_all_is_the_texture_itself():
    sample = WARM[:20, :16]
    expected = synthesize(sample, (17, 20), channel_axis=-1, rng=4)
    for samples, options in (
        ([sample], {"palette": 0, "pattern": 0}),
        ([sample], {"average": [3.0]}),
        ([sample, sample], {}),
        ([sample, sample], {"low": 0, "high": 1}),
    ):
        assert_same_bits(mix(samples, (17, 20), channel_axis=-1, **options), expected)


def test_the_average_of_pixels_is_between_them():
    black, white = np.full((16, 16), 10, np.uint8), np.full((16, 16), 200, np.uint8)
    made = mix([black, white], (20, 20), average=[3, 1])
    assert set(np.unique(made)) == {10, 200}
    assert (made == 10).mean() == pytest.approx(0.75, abs=1 / 256)


def test_low_and_high_frequencies_come_from_where_they_should():
    a, b = GREYS
    for low, high in ((a, b), (b, a)):
        made = mix([low, high], (96, 96), low=0, high=1, split=1, levels=3)
        assert max(distances(high, made)[:2] + distances(low, made)[2:]) <= MIXED_BANDS
        assert np.mean(distances(low, made)[:2]) > np.mean(distances(high, made)[:2])


WRONG = [
    ({"palette": 2}, ValueError, "palette is 2; give the number of a sample, 0 to 1"),
    ({"pattern": -1}, ValueError, "pattern is -1; give the number"),
    ({"patern": 0}, TypeError, "unknown option 'patern' of the method 'pyramid' .did you mean 'pattern'"),
    ({"low": 0}, ValueError, "low and high go together; give both, or neither"),
    ({"pattern": 0, "average": [1, 1]}, ValueError, "a mixture has one pattern; give pattern, average, or low and"),
    ({"average": [1]}, ValueError, "average has 1 weights for 2 samples; give one for each"),
    ({"average": [0, 0]}, ValueError, "all weights of average are 0; give one above 0"),
    ({"average": [-1, 2]}, ValueError, "a weight of average is -1"),
    ({"average": ["a", 2]}, TypeError, "a weight of average must be a number"),
    ({"average": 5}, TypeError, "average"),
    ({"split": 1}, ValueError, "split parts low from high; give these two, or leave split out"),
    ({"low": 0, "high": 1, "split": 5}, ValueError, "split is 5 and the pyramids have 1 levels"),
    ({"levels": 9}, ValueError, "levels=9 is too many for a side of 16 pixels; give at most 4"),
    ({"orientations": 3}, ValueError, "orientations is 3; the steerable filters have one of: 1, 2, 4, 6"),
    ({"boundary": "open"}, TypeError, "unknown option 'boundary' of the method 'pyramid'"),
    ({"start": np.zeros((17, 17))}, ValueError, r"start has shape \(17, 17\); give one of 17 x 16 pixels"),
    ({"start": np.zeros((17, 16, 2))}, ValueError, r"start has shape \(17, 16, 2\); give one of 17 x 16 pixels"),
    ({"start": np.full((17, 16), np.nan)}, ValueError, "start|finite"),
]
NO_SAMPLES = [
    ([], None, ValueError, "there is no sample; give one or more"),
    (np.zeros((2, 8, 8)), None, TypeError, "samples is a single array; give a list of samples"),
    ([np.zeros((8, 8)), np.zeros((8, 8), int)], None, TypeError, "sample 1 is of int64 and the first of float64"),
    ([np.zeros((8, 8, 2)), np.zeros((8, 8, 3))], -1, ValueError, "sample 0 has 2 channels and another 3"),
    ([np.zeros((8, 8, 3))], None, ValueError, "3-dimensional"),
]


def test_a_wrong_mixture_is_one_sentence():
    for options, error, words in WRONG:
        with pytest.raises(error, match=words):
            mix([texture((16, 18)), texture((19, 16))], (17, 16), **options)
    for samples, axis, error, words in NO_SAMPLES:
        with pytest.raises(error, match=words):
            mix(samples, (9, 9), channel_axis=axis)

"""Mixtures of textures: colours of one with the pattern of another, averages, low and high frequencies."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, texture
from scipy.stats import wasserstein_distance
from skimage import data
from tolerances import MIXED_BANDS, PALETTE

import simdtex
from benchmarks.subbands import decompose


def mix(samples, shape, **options):
    return simdtex.mix(samples, shape, **({"rng": 4, "device": REFERENCE} | options))


def synthesize(sample, shape, **options):
    return simdtex.synthesize(sample, shape, **({"method": "pyramid", "rng": 4, "device": REFERENCE} | options))


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
    pairs = zip(
        decompose(sample - sample.mean(), levels=levels, device=REFERENCE).subbands,
        decompose(made - made.mean(), levels=levels, boundary="torus", device=REFERENCE).subbands,
        strict=True,
    )
    return [
        np.mean(
            [
                wasserstein_distance(a.ravel() - a.mean(), b.ravel() - b.mean()) / a.std()
                for a, b in zip(*pair, strict=True)
            ]
        )
        for pair in pairs
    ]


@pytest.mark.parametrize(("palette", "pattern"), [(0, 1), (1, 0)])
def test_a_mixture_has_the_colours_of_its_palette(palette, pattern):
    samples = [WARM, COLD]
    made = mix(samples, (64, 64), palette=palette, pattern=pattern, channel_axis=-1)
    (mean, covariance), (known, wanted), (other, _) = map(moments, (made, samples[palette], samples[pattern]))
    assert abs(mean - known).max() <= PALETTE * np.sqrt(np.diag(wanted)).max()
    assert abs(mean - known).max() < 0.2 * abs(mean - other).max()
    assert abs(covariance - wanted).max() <= 2 * PALETTE * wanted.max()


def test_grey_mixtures_have_the_pixels_of_one_and_the_bands_of_the_other():
    a, b = GREYS
    made = mix([a, b], (96, 96), palette=0, pattern=1)
    assert wasserstein_distance(made.ravel(), a.ravel()) <= 1, "a grey level, as all channels are rounded"
    unlike, like = distances(a, made), distances(b * (a.std() / b.std()), made)
    assert np.mean(like) < 0.6 * np.mean(unlike)


def test_one_sample_for_all_is_the_texture_itself():
    for sample, axis in ((GREYS[0], None), (WARM, -1)):
        plain = synthesize(sample, (40, 48), channel_axis=axis)
        for samples, options in (
            ([sample], {}),
            ([sample], {"palette": 0, "pattern": 0}),
            ([sample], {"average": [3.0]}),
            ([sample, sample], {}),
            ([sample, sample], {"low": 0, "high": 1}),
        ):
            assert_same_bits(mix(samples, (40, 48), channel_axis=axis, **options), plain)


def test_the_average_of_pixels_is_between_them():
    black, white = np.full((16, 16), 10, np.uint8), np.full((16, 16), 200, np.uint8)
    made = mix([black, white], (20, 20), average=[3, 1])
    assert set(np.unique(made)) == {10, 200}
    assert (made == 10).mean() == pytest.approx(0.75, abs=1 / 256)


def test_an_average_lies_between_its_textures():
    a, b = GREYS
    made = mix([a, b], (96, 96))
    whole = distances(a, b.astype(float))
    for sample in (a, b):
        assert np.mean(distances(sample, made)) < np.mean(whole)
    weighted = mix([a, b], (96, 96), average=[9, 1])
    assert np.mean(distances(a, weighted)) < np.mean(distances(a, made))


def test_low_and_high_frequencies_come_from_where_they_should():
    a, b = GREYS
    one = mix([a, b], (96, 96), low=0, high=1, split=1, levels=3)
    other = mix([a, b], (96, 96), low=1, high=0, split=1, levels=3)
    for made, low, high in ((one, a, b), (other, b, a)):
        finest = distances(high, made)[:2]
        coarse = distances(low, made)[2:]
        assert max(finest + coarse) <= MIXED_BANDS
    assert np.mean(distances(a, other)[:2]) < np.mean(distances(a, one)[:2])
    assert np.mean(distances(a, one)[2:]) < np.mean(distances(a, other)[2:])


def test_a_start_and_a_callback_are_those_of_the_method():
    seen = []
    start = np.indices((40, 40))[0] // 10 % 2
    made, output = mix(
        [WARM, COLD], (40, 40), start=start, channel_axis=-1, iterations=1, full_output=True, callback=seen.append
    )
    assert [one.fraction for one in seen] == pytest.approx([1 / 3, 2 / 3, 1])
    assert_same_bits(seen[-1].image(), made)
    assert np.corrcoef(made[..., 0].ravel(), start.ravel())[0, 1] ** 2 > 0.05
    assert output.statistics["seed"] == 4


@pytest.mark.parametrize("options", [{"palette": 0, "pattern": 1}, {}, {"low": 0, "high": 1, "levels": 2}], ids=str)
def test_a_device_has_the_references_bits(machine, options):
    samples = [texture((16, 18), 3, seed=1), texture((19, 16), 3, seed=2)]
    options |= {"channel_axis": -1, "iterations": 2}
    assert_same_bits(mix(samples, (17, 15), device=machine, **options), mix(samples, (17, 15), **options))


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"palette": 2}, ValueError, "palette is 2; give the number of a sample, 0 to 1"),
        ({"palette": True}, ValueError, "palette is True; give the number"),
        ({"pattern": -1}, ValueError, "pattern is -1; give the number"),
        ({"low": 0}, ValueError, "low and high go together; give both, or neither"),
        ({"low": 0, "high": 9}, ValueError, "high is 9; give the number"),
        ({"pattern": 0, "average": [1, 1]}, ValueError, "a mixture has one pattern; give pattern, average, or low and"),
        ({"average": [1]}, ValueError, "average has 1 weights for 2 samples; give one for each"),
        ({"average": [0, 0]}, ValueError, "all weights of average are 0; give one above 0"),
        ({"average": [-1, 2]}, ValueError, "a weight of average is -1"),
        ({"average": [np.nan, 2]}, ValueError, "a weight of average is nan"),
        ({"average": ["a", 2]}, TypeError, "a weight of average must be a number"),
        ({"average": 5}, TypeError, "average"),
        ({"split": 1}, ValueError, "split parts low from high; give these two, or leave split out"),
        ({"low": 0, "high": 1, "split": 5}, ValueError, "split is 5 and the pyramids have 1 levels"),
        ({"low": 0, "high": 1, "split": -1}, ValueError, "split is -1; give 0 or more"),
        ({"alpha": 1}, TypeError, "unknown option 'alpha'"),
        ({"levels": 9}, ValueError, "levels=9 is too many for a side of 16 pixels; give at most 4"),
    ],
    ids=lambda value: str(value) if isinstance(value, dict) else "",
)
def test_a_wrong_option_is_one_sentence(options, error, words):
    with pytest.raises(error, match=words):
        mix([texture((16, 18)), texture((19, 16))], (17, 16), **options)


@pytest.mark.parametrize(
    ("samples", "axis", "error", "words"),
    [
        ([], None, ValueError, "there is no sample; give one or more"),
        (np.zeros((2, 8, 8)), None, TypeError, "samples is a single array; give a list of samples"),
        (None, None, TypeError, "samples"),
        ([np.zeros((8, 8)), np.zeros((8, 8), int)], None, TypeError, "sample 1 is of int64 and the first of float64"),
        ([np.zeros((8, 8, 2)), np.zeros((8, 8, 3))], -1, ValueError, "sample 0 has 2 channels and another 3"),
        ([np.zeros((8, 8, 3))], None, ValueError, "3-dimensional"),
    ],
)
def test_wrong_samples_are_one_sentence(samples, axis, error, words):
    with pytest.raises(error, match=words):
        mix(samples, (9, 9), channel_axis=axis)

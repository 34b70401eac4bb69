"""The option ``light``: what the trend of a sample is, what is made without it, and where the light comes back."""

import tracemalloc

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, opencl
from commands import run
from scipy.ndimage import gaussian_filter
from skimage import data

import simdtex
from simdtex.io import image
from simdtex.jobs.filling.job import plan_filling
from simdtex.model.light import ROUND, light_sentence, trend, unevenness

QUICK = {"order": 2, "rng": 1, "xi": -8.0, "free_sweeps": 0, "device": REFERENCE}
GRAIN = np.ascontiguousarray(data.brick()[:288:3, :288:3])
STONES = np.ascontiguousarray(data.gravel()[:384:4, :384:4])


def sheet(shape=(96, 96), height=60.0):
    """A quadratic, from about -height / 2 to height / 2, brightest at the right and bent."""
    y, x = (np.linspace(-1, 1, side) for side in shape)
    return height / 2 * (0.8 * x + 0.3 * y[:, None] * x - 0.5 * (y[:, None] ** 2 - 1 / 3))


def shaded(pixels, height=60.0):
    return np.clip(np.rint(pixels + sheet(pixels.shape[:2], height)), 0, 255).astype(np.uint8)


def grains(shape, seed=0):
    """Fine grain around 128, which repeats nowhere."""
    return gaussian_filter(np.random.default_rng(seed).normal(128, 40, shape), 0.7)


def clouds(pixels):
    return gaussian_filter(pixels.astype(float), 12, mode="wrap").std()


@pytest.mark.parametrize("method, more", [("multires", {}), ("pyramid", {"iterations": 2})])
def test_an_output_of_a_shaded_sample_is_even(any_device, method, more):
    def made(sample, **options):
        how = {"method": method, "device": opencl(any_device)} | more | options
        return [simdtex.synthesize(sample, (128, 128), rng=rng, **how) for rng in range(2)]

    plain, uneven, even = made(STONES), made(shaded(STONES)), made(shaded(STONES), light="even")
    plain, uneven, left = (np.mean([clouds(one) for one in those]) for those in (plain, uneven, even))
    assert left <= 1.2 * plain and uneven > 1.8 * plain
    assert abs(np.mean(even) - shaded(STONES).mean()) < 5, "the mean is kept"


def test_the_trend_is_the_sheet_whatever_lies_on_it_and_is_hidden():
    shape = (60, 90)
    picture = grains(shape) + sheet(shape)
    picture[5:25, 60:80] += 400  # unlike the rest
    use = np.indices(shape)[1] > 36
    found = trend(np.where(use, picture, np.nan)[..., None], use)
    left = (found.at(*map(np.arange, shape))[..., 0] - sheet(shape))[use]
    assert np.ptp(left) < 8
    low, high = found.ends[:, 0]
    steps = found.terms / (high - low) * ROUND
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
    assert found.limits[0] <= found.at(np.arange(60), np.arange(37)).min(), "it is not extrapolated"


def test_a_channel_of_few_values_has_no_trend():
    two = np.stack([shaded(GRAIN), np.where(sheet() > 0, 255, 0).astype(np.uint8)], -1)
    found = trend(two)
    assert found.terms[:, 0].any() and not found.terms[:, 1].any()
    assert_same_bits(np.ascontiguousarray(found.removed(two)[..., 1]), np.ascontiguousarray(two[..., 1]))


def test_holes_of_a_sky_have_even_light_by_default():
    fine = (grains((40, 40)) - 128) / 8
    sky, wall = ((128 + fine + more).astype(np.uint8) for more in (sheet((40, 40), 120), sheet((40, 40), 8)))
    hole = np.zeros(sky.shape, bool)
    hole[14:24, 16:26] = True

    def light(picture, **how):
        _, output = simdtex.fill(picture, hole, full_output=True, **(QUICK | how))
        return output.statistics["light"]["light"]

    assert light(sky) == light(wall, light="even") == "even"
    for picture, how in ((wall, {}), (sky, {"finish": 0}), (sky, {"reach": 9}), (sky, {"boundary": "torus"})):
        assert light(picture, **how) == "keep"


@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_a_hole_gets_the_light_of_its_place(dtype):
    picture = (grains((48, 64)) + sheet((48, 64), 120)).clip(0, 255).astype(dtype)
    hole = np.zeros(picture.shape, bool)
    hole[14:34, 6:22] = hole[10:30, 45:60] = True
    sample, seen = (grains((40, 40), 1) + sheet((40, 40))).clip(0, 255).astype(dtype), []
    painted, how = np.where(hole, 255, picture).astype(dtype), QUICK | {"sample": sample, "levels": 2}
    made = simdtex.fill(painted, hole, light="even", callback=lambda now: seen.append(now.image()), **how)
    plain = simdtex.fill(painted, hole, light="keep", **how)
    assert made.dtype == dtype
    assert_same_bits(made[~hole], picture[~hole])
    for part in (np.s_[14:34, 6:22], np.s_[10:30, 45:60]):
        wrong = [abs(float(one[part].mean()) - 128 - sheet((48, 64), 120)[part].mean()) for one in (made, plain)]
        assert wrong[0] < 6 < wrong[1]
    for one in seen:
        assert_same_bits(one[~hole], picture[~hole])
    job = plan_filling(painted, hole, light="even", sample=sample)
    assert np.ptp(trend(job.sample.pixels[0]).limits) < np.ptp(trend(sample[..., None]).limits) / 10


def test_beyond_an_edge_the_light_is_that_of_the_edge():
    picture, seen = (grains((40, 48)) + sheet((40, 48), 120)).clip(0, 255).astype(np.uint8), []
    how = QUICK | {"light": "even", "full_output": True, "callback": seen.append}
    made, output = simdtex.extend(picture, right=24, left=32, **how)
    edges = 128 + sheet((40, 48), 120).mean(0)[[0, -1]]
    np.testing.assert_allclose([made[:, 20:30].mean(), made[:, 84:].mean()], edges, atol=12)
    assert len(output.stages) > 1
    for one in [made, *(stage.image for stage in output.stages)]:
        step = picture.shape[0] // one.shape[0]
        assert_same_bits(one[:, 32 // step : 80 // step], picture[::step, ::step])


@pytest.mark.parametrize("seamless, kept", [(True, 0.0), ("x", 1.0)])
def test_what_wraps_around_is_even(seamless, kept):
    """Along a direction that does not wrap around, the light stays."""
    light = 30 * np.linspace(-1, 1, 60)
    picture = (grains((60, 60)) + light + light[:, None]).clip(0, 255).astype(np.uint8)
    made = simdtex.extend(picture, seamless=seamless, light="even", **QUICK).astype(float)
    across, along = [np.polyfit(light, line, 1)[0] for line in (made.mean(0), made.mean(1))]
    assert abs(across) < 0.15 and abs(along - kept) < 0.15


def test_values_of_categories_have_no_light():
    few = (GRAIN[:32, :32] > 100) * np.uint8(255)
    for sample, how, words in (
        (few, {"light": "even"}, "categories, or at most 16"),
        (GRAIN[:32, :32], {"light": "even", "categorical": True}, "categories, or at most 16"),
        (few, {"light": "dark"}, "unknown light 'dark'; choose one of: keep, even"),
    ):
        with pytest.raises(ValueError, match=words):
            simdtex.synthesize(sample, (8, 8), **how)


def test_uneven_light_is_said_where_it_is_clear(tmp_path, monkeypatch):
    """Not of large parts of the picture, such as tissue, fur or stones."""
    monkeypatch.chdir(tmp_path)
    told = {name: light_sentence({"light": "keep", **unevenness(one[..., None])}) for name, one in NATURAL.items()}
    assert [name for name, sentence in told.items() if sentence] == ["shaded"]
    image.write("shaded.png", shaded(GRAIN)[:48])
    words = ("synth", "shaded.png", "-o", "out.png", "--size", 8, "--order", 1, "--seed", 1, "--report", "r")
    assert "light is uneven" in run(*words).output and "light is uneven" in (tmp_path / "r/index.html").read_text()
    assert "light is uneven" not in run(*words, "--light", "even").output


NATURAL = {
    "tissue": data.immunohistochemistry()[76:172, 126:222].mean(-1),
    "fur": data.chelsea()[150:246, 200:296].mean(-1),
    "gravel": data.gravel()[:96, :96],
    "grain": GRAIN,
    "shaded": shaded(GRAIN),
}


def test_tiles_and_the_store_have_it(tmp_path):
    zarr = pytest.importorskip("zarr")
    sample, how = shaded(GRAIN)[:24, :26], QUICK | {"light": "even", "order": 1, "levels": 1}
    made = simdtex.synthesize(sample, (12, 14), store=simdtex.TileStore(tmp_path / "out.zarr", 8), **how)
    assert_same_bits(made.compute(), simdtex.synthesize(sample, (12, 14), **how))
    assert zarr.open_group(tmp_path / "out.zarr", mode="r").attrs["simdtex"]["light"] == "even"


def test_a_large_picture_is_judged_by_a_part_of_its_pixels():
    picture = np.random.default_rng(1).integers(0, 256, (2048, 2048, 1), np.uint8)
    use = np.ones(picture.shape[:2], bool)
    found = trend(picture, use)
    tracemalloc.start()
    assert not found.explains(picture, use)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 * picture.size, "no copy in float64"

# SPDX-License-Identifier: BSD-3-Clause
"""The figures of merit against their definitions written as loops."""

from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import wasserstein_distance

from simdtex.experiments import quality

RNG_TOLERANCE = 1e-5  # single precision of centred values of a few standard deviations


def noise(seed, shape, dtype="uint8"):
    return np.random.default_rng(seed).integers(0, 200, shape).astype(dtype)


def planes(array):
    return array.astype(float)[..., None] if array.ndim == 2 else array.astype(float)


def deviation(sample):
    channels = planes(sample).reshape(-1, planes(sample).shape[2])
    return np.sqrt(channels.var(axis=0).mean()) or 1.0


def naive_nearest(queries, candidates, scale):
    def patches(p):
        return [p[i : i + 7, j : j + 7] for i in range(p.shape[0] - 6) for j in range(p.shape[1] - 6)]

    return np.mean([min(np.sqrt(((a - b) ** 2).mean()) for b in patches(candidates)) / scale for a in patches(queries)])


def naive_mean_nearest(queries, candidates, scale):
    means = []
    queries, candidates = planes(queries), planes(candidates)
    for _ in range(3):
        if min(queries.shape[:2] + candidates.shape[:2]) < 7:
            break
        means.append(naive_nearest(queries, candidates, scale))
        queries, candidates = (
            np.array(
                [
                    [p[2 * i : 2 * i + 2, 2 * j : 2 * j + 2].mean((0, 1)) for j in range(p.shape[1] // 2)]
                    for i in range(p.shape[0] // 2)
                ]
            )
            for p in (queries, candidates)
        )
    return np.mean(means)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("channels", [(), (3,)])
def test_nearest_patches_against_loops(dtype, channels):
    sample, output = noise(1, (15, 17, *channels), dtype), noise(2, (16, 18, *channels), dtype)
    output[:9, :10] = sample[3:12, 2:12]
    scale = deviation(sample)
    assert quality.plausibility(sample, output) == pytest.approx(
        naive_mean_nearest(output, sample, scale), rel=RNG_TOLERANCE
    )
    assert quality.coverage(sample, output) == pytest.approx(
        naive_mean_nearest(sample, output, scale), rel=RNG_TOLERANCE
    )


def test_blocks_do_not_change_the_answer(monkeypatch):
    sample, output = noise(3, (24, 31, 2)), noise(4, (33, 26, 2))
    whole = quality.plausibility(sample, output)
    monkeypatch.setattr(quality, "BLOCK_ROWS", 13)
    monkeypatch.setattr(quality, "BLOCK_BYTES", 4 * 98 * 17)
    assert quality.plausibility(sample, output) == pytest.approx(whole, rel=1e-12)


def test_a_cut_of_the_sample_is_plausible_and_incomplete():
    sample = noise(5, (40, 40))
    cut = sample[4:36, 8:32]
    assert quality.plausibility(sample, cut) == 0.0  # cut at multiples of 4: so are its halves
    assert quality.copying(sample, cut) == 1.0
    assert quality.coverage(sample, cut) > 0.1


def test_units_do_not_matter():
    sample, output = noise(6, (20, 20), float), noise(7, (24, 22), float)
    for figure in (quality.plausibility, quality.coverage, quality.histogram_distance):
        assert figure(100 + 3 * sample, 100 + 3 * output) == pytest.approx(figure(sample, output), rel=RNG_TOLERANCE)


def test_stride_takes_every_kth_patch(monkeypatch):
    sample, output = noise(8, (20, 20)), noise(9, (60, 60))
    every = quality.plausibility(sample, output, stride=1)
    assert quality.plausibility(sample, output, stride=7) == pytest.approx(every, rel=0.05)
    assert quality.plausibility(sample, output) == every
    monkeypatch.setattr(quality, "QUERIES", 1458)
    field = output.astype(np.float32)[..., None]
    assert np.diff(quality._every(field, None))[0] == 5  # 2 and 4 divide the row of 54 or its half
    with pytest.raises(ValueError, match="stride is 0"):
        quality.coverage(sample, output, stride=0)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([(), (2,)]), st.sampled_from([2, 200]))
def test_copying_against_loops(seed, channels, levels):
    rng = np.random.default_rng(seed)
    sample = rng.integers(0, levels, (13, 12, *channels)).astype(np.uint8)
    output = rng.integers(0, levels, (12, 14, *channels)).astype(np.uint8)
    output[1:12, 2:12] = sample[2:13, 1:11]
    output[rng.integers(12), rng.integers(14)] = 1
    known = {sample[i : i + 9, j : j + 9].tobytes() for i in range(5) for j in range(4)}
    made = [output[i : i + 9, j : j + 9].tobytes() for i in range(4) for j in range(6)]
    assert quality.copying(sample, output) == pytest.approx(np.mean([m in known for m in made]))


def test_copying_is_exact_under_hash_collisions(monkeypatch):
    sample, output = noise(10, (14, 14)), noise(11, (14, 14))
    output[2:13, 2:13] = sample[1:12, 3:14]
    expected = quality.copying(sample, output)
    assert 0 < expected < 1
    monkeypatch.setattr(quality, "_hashes", lambda p: np.zeros((p.shape[0] - 8) * (p.shape[1] - 8), np.uint64))
    assert quality.copying(sample, output) == expected


@given(st.integers(0, 2**32 - 1), st.sampled_from(["uint8", "float64"]))
def test_histogram_distance_against_scipy(seed, dtype):
    sample, output = noise(seed, (9, 8, 2), dtype), noise(seed + 1, (7, 11, 2), dtype) // 2
    expected = np.mean([wasserstein_distance(sample[..., k].ravel(), output[..., k].ravel()) for k in range(2)])
    assert quality.histogram_distance(sample, output) == pytest.approx(expected / deviation(sample))


def test_seam():
    wave = np.sin(2 * np.pi * np.arange(32) / 32)
    assert quality.seam(np.add.outer(wave, wave)) == pytest.approx(1.0, abs=0.6)
    ramp = np.add.outer(np.zeros(5), np.arange(10.0))
    assert quality.seam(ramp) == pytest.approx((9 + 1) / 2)
    assert quality.seam(np.zeros((4, 4, 3), np.uint8)) == 1.0
    with pytest.raises(ValueError, match="2 x 2"):
        quality.seam(np.zeros((1, 4)))


def test_source_use():
    every = np.stack(np.indices((4, 6)), axis=-1)
    assert quality.source_use(every, (4, 6)) == pytest.approx((1.0, 1.0))
    assert quality.source_use(np.zeros((5, 5, 2), int), (4, 6)) == pytest.approx((1 / 24, 0.0))
    half = quality.source_use(every[:2], (4, 6))
    assert half == pytest.approx((0.5, np.log(12) / np.log(24)))
    with pytest.raises(ValueError, match="outside a sample of 4 x 5"):
        quality.source_use(every, (4, 5))
    with pytest.raises(ValueError, match="integers"):
        quality.source_use(every.astype(float), (4, 6))


def test_measure_gathers_all():
    sample, output = noise(12, (20, 21, 3)), noise(13, (24, 23, 3))
    source = np.stack(np.indices((20, 21)), axis=-1)
    figures = quality.measure(sample, output, source)
    assert figures.plausibility == quality.plausibility(sample, output)
    assert figures.coverage == quality.coverage(sample, output)
    assert figures.source_share == 1.0
    assert all(isinstance(value, float) for value in asdict(figures).values())
    assert quality.measure(sample, output).source_entropy is None


def test_constant_pictures_and_errors():
    flat = np.full((12, 12), 9, np.uint8)
    figures = quality.measure(flat, flat)
    assert (figures.plausibility, figures.coverage, figures.copying) == (0.0, 0.0, 1.0)
    assert figures.histogram_distance == 0.0
    with pytest.raises(ValueError, match="same number of channels"):
        quality.plausibility(flat, np.zeros((12, 12, 3)))
    with pytest.raises(ValueError, match="the output is 8 x 12 pixels: give at least 9 x 9"):
        quality.copying(flat, flat[:8])

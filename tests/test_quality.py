# SPDX-License-Identifier: BSD-3-Clause
"""The figures of merit against their definitions written as loops."""

from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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

    return np.mean([min(np.sqrt(((a - b) ** 2).mean()) for b in quality(candidates)) / scale for a in quality(queries)])


def naive_mean_nearest(queries, candidates, scale):
    means, pair = [], [planes(queries), planes(candidates)]
    while min(side for p in pair for side in p.shape[:2]) >= 7:
        means.append(naive_nearest(*pair, scale))
        pair = [half_size(p[: len(p) // 2 * 2, : p.shape[1] // 2 * 2]) for p in pair]
    return np.mean(means[:3])


def half_size(picture):
    p = planes(picture)
    return (p[::2, ::2] + p[1::2, ::2] + p[::2, 1::2] + p[1::2, 1::2]) / 4


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


def test_many_patches_are_looked_up_in_strides(monkeypatch):
    sample, output = noise(8, (20, 20)), noise(9, (60, 60))
    every = quality.plausibility(sample, output)
    monkeypatch.setattr(quality, "QUERIES", 1458)
    assert np.diff(quality._every(planes(output)))[0] == 5  # 2 and 4 divide the row of 54 or its half
    assert every != quality.plausibility(sample, output) == pytest.approx(every, rel=0.05)


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


@pytest.mark.parametrize("dtype", ["uint8", "float32", "float64"])
def test_histogram_distance_is_the_mean_of_channels_in_deviations(dtype):
    sample = noise(10, (9, 8, 2), dtype)
    output = np.stack([sample[..., 0], sample[..., 1] + 3], -1)  # one channel moved by 3
    assert quality.histogram_distance(sample, output) == pytest.approx(1.5 / deviation(sample))


def test_seam():
    wave = np.sin(2 * np.pi * np.arange(32) / 32)
    assert quality.seam(np.add.outer(wave, wave)) == pytest.approx(1.0, abs=0.6)
    ramp = np.add.outer(np.zeros(5), np.arange(10.0))
    assert quality.seam(ramp) == pytest.approx((9 + 1) / 2)
    assert quality.seam(np.zeros((4, 4, 3), np.uint8)) == 1.0
    with pytest.raises(ValueError, match="2 x 2"):
        quality.seam(np.zeros((1, 4)))


def place_map(rows, cols, shape):
    """A source map that cuts (rows, cols) pixels out of a sample from its first pixel on, over and over."""
    row, col = np.indices(shape)
    return np.stack([row % rows, col % cols], axis=-1)


def test_effective_use_against_its_equation():
    rng = np.random.default_rng(38)
    source = rng.integers(0, (20, 13), (25, 31, 2)) ** 2 // (20, 13)
    rows, cols = [0, 10, 20], [0, 6, 13]  # 20 / 8 is 2.5 and 13 / 8 is 1.6: two parts each
    area, uses = {}, {}
    for i, j in np.ndindex(2, 2):
        inside = (source >= (rows[i], cols[j])).all(-1) & (source < (rows[i + 1], cols[j + 1])).all(-1)
        area[i, j], uses[i, j] = (rows[i + 1] - rows[i]) * (cols[j + 1] - cols[j]), inside.sum()
    assert sum(uses.values()) == source.shape[0] * source.shape[1]
    expected = sum(uses.values()) ** 2 / (sum(area.values()) * sum(uses[p] ** 2 / area[p] for p in uses))
    found = quality.effective_use(source, (20, 13))
    assert found.effective_share == pytest.approx(expected)
    most = max(uses, key=lambda p: uses[p] / area[p])
    assert found.most_used == (pytest.approx(uses[most] / 775 / (area[most] / 260)), 0, 0, 10, 6) and most == (0, 0)


def test_effective_use_as_a_dict_and_errors():
    found = quality.effective_use(place_map(8, 8, (9, 9)), (8, 9)).as_dict()
    assert found["most_used"] == {"times_fair_share": 1.0, "row": 0, "col": 0, "rows": 8, "cols": 9}
    assert set(found) == {"effective_share", "most_used"}
    with pytest.raises(ValueError, match="outside a sample of 7 x 9"):
        quality.effective_use(place_map(8, 8, (9, 9)), (7, 9))
    with pytest.raises(ValueError, match="integers"):
        quality.effective_use(np.zeros((4, 4)), (4, 4))
    with pytest.raises(ValueError, match="piece is 0"):
        quality.effective_use(place_map(8, 8, (9, 9)), (8, 8), piece=0)


def test_measure_gathers_all():
    sample, output = noise(12, (48, 50, 3)), np.tile(noise(13, (52, 40, 3)), (1, 2, 1))
    source = place_map(48, 50, (52, 80))
    found = asdict(quality.measure(sample, output, source))
    use = quality.effective_use(source, (48, 50))
    assert (found.pop("effective_share"), found.pop("most_used")) == (
        use.effective_share,
        use.most_used.times_fair_share,
    )
    assert found.pop("seam") == quality.seam(output)
    assert found == {name: getattr(quality, name)(sample, output) for name in found} and len(found) == 6
    assert quality.measure(sample, output).effective_share is None


def test_constant_pictures_and_errors():
    flat = np.full((12, 12), 9, np.uint8)
    found = quality.measure(flat, flat)
    assert (found.plausibility, found.coverage, found.copying, found.histogram_distance) == (0.0, 0.0, 1.0, 0.0)
    with pytest.raises(ValueError, match="same number of channels"):
        quality.plausibility(flat, np.zeros((12, 12, 3)))
    with pytest.raises(ValueError, match="the output is 8 x 12 pixels: give at least 9 x 9"):
        quality.copying(flat, flat[:8])

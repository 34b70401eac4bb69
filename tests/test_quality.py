# SPDX-License-Identifier: BSD-3-Clause
"""The figures of merit against their definitions written as loops."""

from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.experiments import quality
from simdtex.experiments.quality import likeness, patches

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
    monkeypatch.setattr(patches, "BLOCK_ROWS", 13)
    monkeypatch.setattr(patches, "BLOCK_BYTES", 4 * 98 * 17)
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
    monkeypatch.setattr(likeness, "QUERIES", 1458)
    assert np.diff(likeness._every(planes(output)))[0] == 5  # 2 and 4 divide the row of 54 or its half
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


# ---------------------------------------------------------------- repeats


def naive_repeats(picture, scale, step):
    """The share of patches of 16 x 16 that stand again at half the size."""
    half = half_size(picture)
    places = [(i, j) for i in range(half.shape[0] - 15) for j in range(half.shape[1] - 15)]
    asked = [(i, j) for i, j in places if i % (step // 2) == j % (step // 2) == 0]
    again = 0
    for i, j in asked:
        here = half[i : i + 16, j : j + 16]
        far = [(k, m) for k, m in places if max(abs(i - k), abs(j - m)) >= 8]
        again += any(np.sqrt(((here - half[k : k + 16, m : m + 16]) ** 2).mean()) < 0.35 * scale for k, m in far)
    return again / len(asked)


@pytest.mark.parametrize("channels", [(), (3,)])
def test_repeats_against_loops(channels):
    sample, output = noise(20, (56, 60, *channels)), noise(21, (64, 80, *channels))
    output[26:64, :40] = output[:38, 40:]
    scale = deviation(half_size(sample))
    expected = naive_repeats(output, scale, 8), naive_repeats(sample, scale, 8)
    assert 0 < expected[0] < 1
    assert quality.repeats(sample, output) == pytest.approx(expected)


def test_a_repeat_is_as_near_as_035_and_as_far_as_half_a_patch():
    ground = noise(22, (24, 48), float).repeat(2, 0).repeat(2, 1)  # 48 x 96
    ground *= 10 / ground.std()
    sign = np.where(noise(23, (24, 48)) > 100, 1.0, -1.0).repeat(2, 0).repeat(2, 1)

    def share(off, apart):
        made = noise(24, (24, 48), float).repeat(2, 0).repeat(2, 1)
        made[:, apart : apart + 32] = (ground + off * 10 * sign)[:, :32]
        made[:, :32] = ground[:, :32]
        return quality.repeats(ground, made).share

    assert share(0.3, 40) > 0 == share(0.4, 40)
    for period, expected in ((14, 0), (16, 2 / 3), (28, 0)):  # of three places each way the outer two are 16 apart
        columns = np.tile(noise(25, (48, period // 2), float).repeat(2, 1), (1, 4))[:, :48]
        assert quality.repeats(columns, columns).share == pytest.approx(expected)
        assert quality.repeats(columns, columns.T[:48]).share == pytest.approx(expected)


def test_a_patch_with_no_elsewhere_is_not_repeated():
    flat = np.full((48, 48), 7, np.uint8)  # the middle one of three places each way is less than 16 pixels from all
    assert quality.repeats(flat, flat) == pytest.approx((8 / 9, 8 / 9))


def test_fine_grain_makes_nothing_alike():
    coarse, grain = noise(29, (48, 48), float).repeat(2, 0).repeat(2, 1), np.indices((96, 96)).sum(0) % 2 * 2000.0
    assert quality.repeats(coarse + grain, coarse + grain) == (0.0, 0.0)  # the grain is gone at half the size


def test_repeats_of_tiles_and_of_noise():
    sample = noise(26, (64, 64))
    tiled = quality.repeats(sample, np.tile(sample, (2, 2)))
    assert tiled == (pytest.approx(1 - 3**2 / 13**2), 0.0)  # three of 13 places each way are 64 pixels from no other
    assert quality.repeats(sample, noise(27, (96, 80))) == (0.0, 0.0)
    regular = np.tile(sample[:32, :32], (2, 2))
    assert quality.repeats(regular, np.tile(regular, (2, 1))) == (1.0, pytest.approx(1 - 3**2 / 5**2))


def test_many_patches_make_the_grid_wider(monkeypatch):
    sample, asked, real = noise(28, (64, 64)), [], likeness.nearest
    monkeypatch.setattr(
        likeness,
        "nearest",
        lambda planes, which, *args, **more: asked.append(which) or real(planes, which, *args, **more),
    )
    monkeypatch.setattr(likeness, "PATCHES", 10)
    quality.repeats(sample, sample)
    assert [len(which) for which in asked] == [9, 9]  # 17 places a side: every 6th
    with pytest.raises(ValueError, match="the sample is 47 x 64 pixels: give at least 48 x 48"):
        quality.repeats(sample[:47], sample)


# ---------------------------------------------------------------- salt and tones


@pytest.mark.parametrize("channels", [(), (3,)])
@pytest.mark.parametrize("levels", [2, 200])
def test_a_sample_has_its_own_salt(channels, levels):
    sample = np.random.default_rng(30).integers(0, levels, (40, 50, *channels)).astype(np.uint8)
    assert quality.salt(sample, sample) == pytest.approx(1.0)


def test_salt_counts_odd_pixels():
    sample = np.zeros((40, 50), np.uint8)
    sample[5::10, 5::10] = np.arange(100, 120).reshape(4, 5)  # 20 of 2000 are odd: the 10 largest make 0.5 %
    assert quality.salt(sample, np.zeros_like(sample)) == 0.0
    output = np.zeros_like(sample)
    output[3::6, 3::6] = 200  # 7 x 8
    assert quality.salt(sample, output) == pytest.approx(56 / 2000 / 0.005)
    output[output > 0] = 105  # less than the threshold of 109
    assert quality.salt(sample, output) == 0.0
    in_blue = np.stack([sample * 0, sample * 0, sample], axis=-1)
    made = np.stack([output * 0, (output > 0) * 200, output * 0], axis=-1)
    assert quality.salt(in_blue, made) == pytest.approx(56 / 2000 / 0.005)  # of any channel


def test_tones_against_their_equations():
    sample, output = noise(31, (33, 50, 3)), noise(32, (48, 40, 3)) // 2
    scale = deviation(sample)
    first, second = planes(sample), planes(output)

    def coarse(p):
        means = [p[i : i + 16, j : j + 16].mean((0, 1)) for i in range(0, p.shape[0] - 15, 16)
                 for j in range(0, p.shape[1] - 15, 16)]  # fmt: skip
        return np.sqrt(np.var(means, axis=0).mean())

    shift = np.sqrt(np.mean((second.mean((0, 1)) - first.mean((0, 1))) ** 2)) / scale
    expected = deviation(output) / scale, shift, (coarse(second) - coarse(first)) / scale
    assert quality.tones(sample, output) == pytest.approx(expected)


def test_tones_of_simple_pictures():
    ramp = np.add.outer(np.zeros(64), np.arange(64.0))
    assert quality.tones(ramp, ramp) == (1.0, 0.0, 0.0)
    flat = np.full((32, 32), 31.5)
    coarse = np.std([7.5, 23.5, 39.5, 55.5]) / ramp.std()
    assert quality.tones(ramp, flat) == pytest.approx((0.0, 0.0, -coarse))
    assert quality.tones(flat, flat + 2) == (1.0, 2.0, 0.0)
    mixed = np.random.default_rng(33).permuted(ramp, axis=1)  # the same values in no order
    found = quality.tones(ramp, mixed)
    assert found.contrast == pytest.approx(1.0) and found.coarse_contrast < -0.8 * coarse
    with pytest.raises(ValueError, match="at least 32 x 32"):
        quality.tones(flat[:31], flat)


# ---------------------------------------------------------------- innovation


def test_innovation_of_copies_and_of_noise():
    sample = noise(34, (30, 32, 3))
    assert quality.innovation(sample, sample[3:28, 5:30]) == 0.0
    assert quality.innovation(sample, noise(35, (30, 30, 3))) > 0.6  # patches overlap, so chance continues some
    halves = np.concatenate([sample[:20, :16], sample[8:28, 14:30]], axis=1)
    assert 0 < quality.innovation(sample, halves) < 0.5
    turned = np.rot90(sample)
    assert quality.innovation(sample, turned) > 0.6  # every pixel is of the sample, and none continues


def test_innovation_against_loops(monkeypatch):
    sample, output = noise(36, (16, 15)), noise(37, (20, 18))
    output[:9, :10] = sample[3:12, 2:12]

    def source(i, j):
        here = output[i : i + 7, j : j + 7].astype(float)
        far = [((sample[k : k + 7, m : m + 7] - here) ** 2).sum() for k in range(10) for m in range(9)]
        return np.array(divmod(int(np.argmin(far)), 9))

    places = np.array([[source(i, j) for j in range(12)] for i in range(14)])

    def expected(upper):
        rows = sorted({*upper, *(i + 1 for i in upper)})
        across = np.mean([(places[i, 1:] - places[i, :-1] == (0, 1)).all(-1) for i in rows])
        down = np.mean([(places[i + 1] - places[i] == (1, 0)).all(-1) for i in upper])
        return 1 - (across + down) / 2

    assert quality.innovation(sample, output) == pytest.approx(expected([0, 2, 4, 6, 8, 10, 12]))
    monkeypatch.setattr(likeness, "QUERIES", 3 * 24)
    assert quality.innovation(sample, output) == pytest.approx(expected([0, 6, 12]))


# ---------------------------------------------------------------- the source map


def test_effective_use_is_the_share_that_would_do():
    every = place_map(32, 48, (64, 96))
    assert quality.effective_use(every, (32, 48)) == (1.0, (1.0, 0, 0, 8, 8))
    half = quality.effective_use(place_map(32, 24, (64, 96)), (32, 48))
    assert half == (pytest.approx(0.5), (pytest.approx(2.0), 0, 0, 8, 8))
    one = np.broadcast_to(np.array([17, 42]), (30, 30, 2))
    assert quality.effective_use(one, (32, 48)) == (pytest.approx(1 / 24), (pytest.approx(24.0), 16, 40, 8, 8))
    assert quality.effective_use(one, (32, 48), piece=16) == (
        pytest.approx(1 / 6),
        (pytest.approx(6.0), 16, 32, 16, 16),
    )


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


# ---------------------------------------------------------------- all of them


def test_measure_gathers_all():
    sample, output = noise(12, (48, 50, 3)), np.tile(noise(13, (52, 40, 3)), (1, 2, 1))
    source = place_map(48, 50, (52, 80))
    figures = quality.measure(sample, output, source)
    assert figures.repeats > 0.5 and figures.own_repeats == 0
    assert figures.plausibility == quality.plausibility(sample, output)
    assert figures.coverage == quality.coverage(sample, output)
    assert (figures.repeats, figures.own_repeats) == quality.repeats(sample, output)
    assert (figures.contrast, figures.shift, figures.coarse_contrast) == quality.tones(sample, output)
    assert figures.innovation == quality.innovation(sample, output)
    assert figures.salt == quality.salt(sample, output)
    use = quality.effective_use(source, (48, 50))
    assert (figures.effective_share, figures.most_used) == (use.effective_share, use.most_used.times_fair_share)
    assert all(isinstance(value, float) for value in asdict(figures).values())
    without = quality.measure(sample, output)
    assert {name for name, value in asdict(without).items() if value is None} == {
        *("effective_share", "most_used"),
    }


def test_measure_leaves_out_what_small_pictures_have_not():
    found = quality.measure(noise(14, (33, 47)), noise(15, (40, 60)))
    assert found.repeats is None and found.own_repeats is None and found.contrast is not None
    found = quality.measure(noise(14, (31, 47)), noise(15, (40, 60)))
    assert found.contrast is None and found.salt is not None and found.innovation is not None


def test_measure_computes_what_is_asked_for():
    sample, output = noise(16, (20, 20)), noise(17, (20, 20))
    found = quality.measure(sample, output, figures=["salt", "seam"])
    assert {name for name, value in asdict(found).items() if value is not None} == {"salt", "seam"}
    assert quality.measure(sample, output, figures="seam").seam == found.seam
    with pytest.raises(ValueError, match=r"there is no figure sale: choose of plausibility, .*, effective_use"):
        quality.measure(sample, output, figures=["sale"])
    with pytest.raises(ValueError, match="the figure effective_use needs a source map"):
        quality.measure(sample, output, figures=["effective_use"])
    with pytest.raises(ValueError, match="give at least 48 x 48"):
        quality.measure(sample, output, figures=["repeats"])


def test_constant_pictures_and_errors():
    flat = np.full((12, 12), 9, np.uint8)
    figures = quality.measure(flat, flat)
    assert (figures.plausibility, figures.coverage, figures.copying) == (0.0, 0.0, 1.0)
    assert figures.histogram_distance == 0.0
    with pytest.raises(ValueError, match="same number of channels"):
        quality.plausibility(flat, np.zeros((12, 12, 3)))
    with pytest.raises(ValueError, match="the output is 8 x 12 pixels: give at least 9 x 9"):
        quality.copying(flat, flat[:8])

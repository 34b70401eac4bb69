"""What data say of each cell is the LCPDF of equations (6), (7) and (12), datum by datum in plain loops."""

from math import exp, log2

import numpy as np
import pytest
from cases import assert_same_bits, texture

import simdtex
from simdtex.io.hard_data import HardData

TRAINING = (np.add.outer(np.arange(20) // 3, np.arange(24) // 5) % 3).astype(np.uint8) * 4
SHAPE = (9, 11)


def data(values, shape=SHAPE, share=0.12, seed=3):
    rng = np.random.default_rng(seed)
    found = np.full(shape, np.nan)
    there = rng.random(shape) < share
    found[there] = rng.choice(np.unique(values), there.sum())
    return found


def within(i, n):
    """Mirrored at the border, whose pixels are not repeated."""
    i = abs(i)
    return i if i < n else 2 * (n - 1) - i


def weights(training, known, cell, nearest, reach, bandwidth, differs, variance, channels):
    """w_p of every position p: exp(-sum_r (x_r - y_r)^2 / 2h^2) over the nearest data."""
    place = [tuple(at) for at in np.argwhere(~np.isnan(known)).tolist()]
    far = {at: (at[0] - cell[0]) ** 2 + (at[1] - cell[1]) ** 2 for at in place}
    near = sorted((at for at in place if far[at] <= reach**2), key=lambda at: (far[at], at))[:nearest]
    n, d = training.size, channels * (len(near) + 1)
    h = bandwidth * variance**0.5 * (4 / (n * (2 * d + 1))) ** (1 / (d + 4))
    found = np.zeros(training.shape)
    for p in np.ndindex(*training.shape):
        total = 0.0
        for at in near:
            there = [within(p[k] + at[k] - cell[k], training.shape[k]) for k in (0, 1)]
            total += differs(known[at], training[tuple(there)])
        found[p] = exp(-total / (2 * h * h))
    return found


@pytest.mark.parametrize(
    ("kinds", "how"), [(3, {}), (3, {"nearest": 0}), (2, {"nearest": 3, "reach": 5, "bandwidth": 0.6})], ids=str
)
def test_probabilities_are_those_of_plain_loops(kinds, how):
    training = TRAINING if kinds == 3 else (TRAINING > 3).astype(np.uint8)
    known, names = data(training), np.unique(training)
    found = simdtex.estimate(training, known=known, categorical=True, device="reference", **how)
    assert found.probability.dims == ("category", "y", "x") and found.category.values.tolist() == names.tolist()
    # channels that are 0 or 1 where one category is or not; two of them differ between two categories of three
    channels = 1 if kinds == 2 else 3
    shares = [(training == name).mean() for name in names[-channels:]]
    variance = sum(share * (1 - share) for share in shares) / channels
    settings = {"nearest": 8, "reach": 2, "bandwidth": 1.0} | how
    for cell in np.ndindex(*SHAPE):
        if not np.isnan(known[cell]):
            assert (found.probability.values[:, *cell] == (names == known[cell])).all()
            continue
        w = weights(
            training, known, cell, **settings, variance=variance, channels=channels,
            differs=lambda a, b: (1 if channels == 1 else 2) * (a != b),
        )  # fmt: skip
        expected = [w[training == name].sum() / w.sum() for name in names]
        np.testing.assert_allclose(found.probability.values[:, *cell], expected, atol=2e-5)
        entropy = -sum(p * log2(p) for p in expected if p)
        assert found.entropy.values[cell] == pytest.approx(entropy, abs=1e-3)


def test_mean_and_variance_are_those_of_plain_loops():
    training = texture((16, 18), dtype=np.float64)
    known = data(training)
    found = simdtex.estimate(training, known=known, nearest=4, reach=6, device="reference")
    for cell in np.ndindex(*SHAPE):
        mean, variance = found["mean"].values[cell], found["variance"].values[cell]
        if not np.isnan(known[cell]):
            assert (mean, variance) == (known[cell], 0)
            continue
        w = weights(
            training, known, cell, nearest=4, reach=6, bandwidth=1.0, variance=training.var(), channels=1,
            differs=lambda a, b: (a - b) ** 2,
        )  # fmt: skip
        expected = (w * training).sum() / w.sum()
        assert mean == pytest.approx(expected, abs=0.02 * training.std())
        assert variance == pytest.approx((w * (training - expected) ** 2).sum() / w.sum(), abs=0.05 * training.var())


def test_a_device_has_the_references_bits(cl_device):
    for options in ({"categorical": True}, {"reach": 7}):
        known = data(TRAINING, (9, 8))
        both = [
            simdtex.estimate(TRAINING, known=known, device=device, **options)
            for device in ("reference", str(cl_device.index))
        ]
        for name in both[0].data_vars:
            assert_same_bits(both[1][name].values, both[0][name].values)


def test_masks_of_several_training_images_and_attributes():
    options, known = {"shape": SHAPE, "categorical": True, "device": "reference"}, np.full(SHAPE, np.nan)
    known[2, 3], known[3, 4] = 4, 8
    pictures, usable = [TRAINING, TRAINING[:12]], [np.ones((20, 24), bool), np.zeros((12, 24), bool)]
    two, masked = (simdtex.estimate(pictures, known=known, mask=mask, **options) for mask in (None, usable))
    assert not np.array_equal(two.probability, masked.probability)
    names = ("version", "device", "nearest", "reach", "bandwidth", "training_image", "hard_data")
    assert {*two.attrs} == {*names}
    placed = simdtex.estimate(pictures, known=known, origin=(5, 6), cell=(10, 20), **options)
    assert {*placed.attrs} == {*names, "cell_x", "cell_y"} and placed.x[1] == 15


BAD = {
    "nearest": ({"nearest": 65}, "nearest is 65; give 64 or fewer"),
    "reach": ({"reach": 20}, "reach is 20; give 19 or fewer"),
    "bandwidth": ({"bandwidth": 0}, "bandwidth is 0; give"),
    "values": (
        {"training": TRAINING * 1e307, "categorical": False},
        "the training image has values beyond 1e.100: give them in a larger unit",
    ),
    "several": (
        {"known": HardData(np.zeros((2, 2)), np.array([[0.0], [8]]), ("facies",)), "several": "mean"},
        "several is 'mean', which invents categories; give 'most', or 'refuse'",
    ),
    "category": ({"known": data(TRAINING + 1)}, "known has the category [159] and the sample has 0, 4, 8"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_with_a_remedy(case):
    change, words = BAD[case]
    call = {"training": TRAINING, "known": data(TRAINING), "categorical": True, "device": "reference"}
    with pytest.raises(ValueError, match=words):
        simdtex.estimate(**call | change)


def test_the_callback_sees_the_share_and_the_maps(monkeypatch):
    monkeypatch.setattr("simdtex.methods.mrf.density.AT_ONCE", 5)
    seen = []
    known = np.full((4, 6), np.nan)
    known[2, 1] = 1
    training, look = np.tile([0.0, 0, 0, 1], (32, 8)), lambda progress: seen.append((progress, progress.image()))
    found = simdtex.estimate(training, known=known, device="reference", callback=look)
    shares = [progress.fraction for progress, _ in seen]
    assert shares == sorted(set(shares)) and len(shares) > 3 and shares[-1] == 1
    assert [np.isfinite(maps[..., 0]).mean() for _, maps in seen] == shares
    cells = np.isnan(known)
    assert np.array_equal(seen[-1][1][cells], np.stack([found["mean"], found.variance], -1)[cells])

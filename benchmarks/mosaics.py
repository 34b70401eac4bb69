# SPDX-License-Identifier: BSD-3-Clause
"""Mosaics of textures with training parts that lie apart, figures of their labels, and classifiers to compare with.

These learn from features of windows, by a random forest of scikit-learn.
"""

from typing import NamedTuple

import common
import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.signal import fftconvolve
from scipy.stats import rankdata
from skimage import data
from skimage.feature import local_binary_pattern
from skimage.filters import gabor_kernel

LUMA = (0.299, 0.587, 0.114)
NUMBER = 5  # textures of a mosaic
PATTERNS = ((8, 1), (8, 2), (16, 3))  # points and radius of local binary patterns
FREQUENCIES, DIRECTIONS = (0.05, 0.1, 0.2, 0.35), 6  # of Gabor filters; cycles a pixel
SHOWN = 3000  # pixels of each class that a forest learns from
LEAST = 0.01  # added to a forest's probabilities, which may be 0
AWAY = 16  # pixels from a border beyond which a pixel lies away from it


class Texture(NamedTuple):
    """Parts of a picture, (rows, cols, 3) uint8: for training, for tests, and of the test part two apart."""

    training: np.ndarray
    test: np.ndarray
    further: np.ndarray
    rest: np.ndarray


class Mosaic(NamedTuple):
    """A picture (rows, cols, 3), the ``truth`` (rows, cols), 1 the first of its textures, and those by name."""

    picture: np.ndarray
    truth: np.ndarray
    textures: dict


def grey(picture):
    """The luma of a picture with three bands, uint8."""
    return np.rint(picture @ LUMA).astype(np.uint8)


def parted(picture):
    """The parts of a picture of 256 or more pixels a side, by its corners, or of a smaller one, by its halves."""
    colour = picture[..., :3] if picture.ndim == 3 else np.stack([picture] * 3, -1)
    rows, cols = colour.shape[:2]
    if min(rows, cols) >= 512:
        test = colour[-256:, -256:]
        return Texture(colour[:128, :128], test, colour[-128:, :128], test)
    test = colour[:, cols // 2 :]
    return Texture(colour[:, : cols // 2], test, test[rows // 2 :], test[: rows // 2])


def textures(folder, only=""):
    """The textures of a folder, and brick, grass and gravel of scikit-image, by name."""
    found = common.folder(folder, only)
    found |= {name: getattr(data, name)() for name in ("brick", "grass", "gravel")}
    return {name: parted(picture) for name, picture in found.items()}


def regions(side, rng, curved, number=NUMBER):
    """Labels 1 to 5 of a mosaic: quadrants and a square in the middle, or the greatest of random fields."""
    if curved:
        noise = rng.standard_normal((number, side, side))
        fields = np.array([gaussian_filter(one, side / 7, mode="reflect") for one in noise])
        return 1 + (fields / fields.std((1, 2), keepdims=True)).argmax(0)
    half, quarter = side // 2, side // 4
    found = 1 + np.add.outer(2 * (np.arange(side) >= half), np.arange(side) >= half)
    found[quarter:-quarter, quarter:-quarter] = number
    return found


def laid(picture, side):
    """A picture of a side, filled with another side by side."""
    return np.tile(picture, [*(-(-side // length) for length in picture.shape[:2]), 1])[:side, :side]


def drawn(known, seed, side=256):
    """Two mosaics of the same five textures drawn at random, with straight borders and with curved ones."""
    rng = np.random.default_rng(seed)
    chosen = {name: known[name] for name in rng.choice(sorted(known), NUMBER, replace=False).tolist()}
    found = []
    for curved in (False, True):
        truth = regions(side, rng, curved)
        filled = np.array([laid(one.test, side) for one in chosen.values()])
        found.append(Mosaic(np.take_along_axis(filled, truth[None, ..., None] - 1, 0)[0], truth, chosen))
    return found


def border_distance(truth):
    """How far each pixel is from the nearest of another label; infinite if there is none."""
    found = np.full(truth.shape, np.inf)
    for label in np.unique(truth):
        if not (own := truth == label).all():
            found[own] = distance_transform_edt(own)[own]
    return found


def accuracy(labels, truth):
    """The shares of right labels away from borders, and of all."""
    right = labels == truth
    return right[border_distance(truth) >= AWAY].mean(), right.mean()


def auroc(unknown, known):
    """The area under the curve of right against false alarms, of scores that are lower for the unknown."""
    unknown, known = np.ravel(unknown), np.ravel(known)
    ranks = rankdata(np.concatenate([unknown, known]))[len(unknown) :]
    return (ranks.sum() - len(known) * (len(known) + 1) / 2) / len(known) / len(unknown)


def own_fit(output):
    """The fit of each pixel's most probable class, (rows, cols)."""
    return np.take_along_axis(output.fit, output.probability.argmax(-1)[..., None], -1)[..., 0]


def averaged(planes, picture, window):
    """Means of planes over Gaussian windows, with the mean and the contrast of the picture, (..., features)."""
    values = picture.astype(np.float32)
    mean, square = (gaussian_filter(one, window) for one in (values, values * values))
    means = [gaussian_filter(np.asarray(plane, np.float32), window) for plane in planes]
    return np.stack([*means, mean, np.sqrt(np.maximum(square - mean * mean, 0))], -1)


def patterns(picture):
    """Where each local binary pattern occurs in a grey picture."""
    for points, radius in PATTERNS:
        code = local_binary_pattern(picture, points, radius, "uniform")
        yield from (code == value for value in range(points + 2))


def energies(picture):
    """The energy of each Gabor filter in a grey picture."""
    values = picture / 255
    for frequency in FREQUENCIES:
        for turn in range(DIRECTIONS):
            kernel = gabor_kernel(frequency, theta=np.pi * turn / DIRECTIONS)
            rows, cols = (length // 2 for length in kernel.shape)
            padded = np.pad(values, ((rows, rows), (cols, cols)), mode="symmetric")
            yield abs(fftconvolve(padded, kernel, mode="valid"))


FEATURES = {"binary patterns": patterns, "Gabor energies": energies}


def probabilities(training, pictures, features, window):
    """Logarithms of probabilities by a random forest, (classes, rows, cols) for each of grey pictures."""
    try:
        from sklearn.ensemble import RandomForestClassifier
    except ModuleNotFoundError:
        raise SystemExit("the baselines need scikit-learn: pip install -e '.[benchmarks]'") from None

    def pixels(picture):
        found = averaged(features(picture), picture, window)
        return found.reshape(-1, found.shape[-1])

    rng = np.random.default_rng(1)
    shown = [rng.permutation(pixels(one))[:SHOWN] for one in training]
    forest = RandomForestClassifier(100, n_jobs=2, random_state=1, min_samples_leaf=3)
    forest.fit(np.concatenate(shown), np.repeat(np.arange(len(shown)), [len(one) for one in shown]))
    return [np.log(forest.predict_proba(pixels(one)).T.reshape(-1, *one.shape) + LEAST) for one in pictures]

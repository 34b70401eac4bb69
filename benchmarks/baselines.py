# SPDX-License-Identifier: BSD-3-Clause
"""Classifiers of texture to compare with: features of windows, and a random forest of scikit-learn."""

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.signal import fftconvolve
from skimage.feature import local_binary_pattern
from skimage.filters import gabor_kernel

PATTERNS = ((8, 1), (8, 2), (16, 3))  # points and radius of local binary patterns
FREQUENCIES, DIRECTIONS = (0.05, 0.1, 0.2, 0.35), 6  # of Gabor filters; cycles a pixel
SHOWN = 3000  # pixels of each class that a forest learns from
LEAST = 0.01  # added to a forest's probabilities, which may be 0


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
    rng, shown = np.random.default_rng(1), []
    for one in training:
        found = averaged(features(one), one, window)
        pixels = found.reshape(-1, found.shape[-1])
        shown.append(pixels[rng.permutation(len(pixels))[:SHOWN]])
    forest = RandomForestClassifier(100, n_jobs=2, random_state=1, min_samples_leaf=3)
    forest.fit(np.concatenate(shown), np.repeat(np.arange(len(shown)), [len(one) for one in shown]))
    result = []
    for one in pictures:
        found = averaged(features(one), one, window)
        chance = forest.predict_proba(found.reshape(-1, found.shape[-1]))
        result.append(np.log(chance.T.reshape(-1, *one.shape) + LEAST))
    return result

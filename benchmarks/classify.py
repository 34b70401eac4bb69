# SPDX-License-Identifier: BSD-3-Clause
"""How well `simdtex.classify` labels textures, beside classifiers of other kinds.

    python benchmarks/classify.py [--textures DIR] [--only '*.png'] [--parts accuracy,equalised,unknown] [--draws N]
                                  [--seed N] [--side N] [--out DIR] [--device TEXT]

Textures are brick, grass and gravel of scikit-image, with the pictures of a folder or, without one, five random fields.
What is learned from and what is labelled lie apart: the left and the right half of a picture, or of one with 512 or
more pixels a side [:128, :128] and [-256:, -256:]. The draws take 2, 3, ... 8, 2, ... textures at random, for a mosaic
with straight borders (the nearest of random points) and one with curved borders. ``--out`` takes a table for each part:

accuracy   shares of right labels 16 or more pixels from borders, and of all pixels; of the classifier, and of random
           forests on local binary patterns and on energies of Gabor filters, without and with the same Potts field. The
           baselines need scikit-learn (``pip install -e '.[benchmarks]'``).
equalised  the same with grey textures whose histograms are flat, so that no single pixel tells them apart.
unknown    in mosaics of which one class was not learned: the area under the curve (AUROC) of the fit of the label, and
           the shares of the pixels of the unknown texture, and of known ones, that are called unknown.
"""

from collections import defaultdict
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import common
import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.signal import fftconvolve
from scipy.stats import rankdata
from skimage import data
from skimage.feature import local_binary_pattern
from skimage.filters import gabor_kernel

import simdtex
from simdtex.jobs.classification.operations import WEIGHTS, gaussian, potts, window

ASKED = 0.05  # the probability of calling a known texture unknown
FIELDS = [(8, weight) for weight in (4, 7, 12, 20)]  # of the baselines; they get the best
UNITS = 2**18  # of evidence and votes
SHARES = ["straight, away", "straight, all", "curved, away", "curved, all"]
LUMA = (0.299, 0.587, 0.114)
NUMBERS = range(2, 9)  # of textures of mosaics
LEAST_SHARE = 0.35  # of a texture in a mosaic, relative to equal shares
GABOR = ((0.06, 0.1, 0.17, 0.28), 6)  # frequencies in 1 / pixels, and the number of directions
PATTERNS = ((8, 1), (8, 2), (16, 3))  # points and radius of local binary patterns
WINDOW = 4  # pixels of the Gaussian windows of their means
SHOWN = 3000  # pixels of each class that a forest learns from
LEAST = 0.01  # added to a forest's probabilities, which may be 0
AWAY = 16  # pixels from a border beyond which a pixel lies away from it


class Texture(NamedTuple):
    """Parts of a picture for training and for tests, (rows, cols, 3) uint8."""

    training: np.ndarray
    test: np.ndarray


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
        return Texture(colour[:128, :128], colour[-256:, -256:])
    return Texture(colour[:, : cols // 2], colour[:, cols // 2 :])


def generated(side=256):
    """Five random fields by name, equalised: grain, streaks along columns and along rows, blots, and ripples."""
    rng = np.random.default_rng(1)

    def noise(*sd):
        return gaussian_filter(rng.standard_normal((side, side)), sd, mode="wrap")

    white = noise(0.5, 0.5)
    ripples = gaussian_filter(white, 1.5, mode="wrap") - gaussian_filter(white, 2.5, mode="wrap")
    fields = {
        "grain": noise(1, 1),
        "rain": noise(5, 1),
        "fibres": noise(1, 5),
        "blots": noise(4, 4),
        "ripples": ripples,
    }
    ranks = {name: rankdata(one, "ordinal").reshape(one.shape) - 1 for name, one in fields.items()}
    return {name: (256 * one // one.size).astype(np.uint8) for name, one in ranks.items()}


def read(folder, only=""):
    """The textures of a folder, or random fields without one, and brick, grass and gravel of scikit-image, by name."""
    found = common.folder(folder, only) if folder else generated()
    found |= {name: getattr(data, name)() for name in ("brick", "grass", "gravel")}
    return {name: parted(picture) for name, picture in found.items()}


def equalised(texture):
    """A texture in grey with the flat histogram of its training part."""
    parts = [grey(one) for one in texture]
    below = np.cumsum(np.bincount(parts[0].ravel(), minlength=256)) / parts[0].size
    return Texture(*(np.stack([np.rint(255 * below[one]).astype(np.uint8)] * 3, -1) for one in parts))


def regions(side, rng, curved, number):
    """Labels 1, 2... of a mosaic, none with a small share: the nearest of points, or the greatest of random fields."""
    while True:
        if curved:
            noise = rng.standard_normal((number, side, side))
            fields = np.array([gaussian_filter(one, side / 7, mode="reflect") for one in noise])
            found = (fields / fields.std((1, 2), keepdims=True)).argmax(0)
        else:
            row, col = np.indices((side, side))
            found = np.array([np.hypot(row - y, col - x) for y, x in rng.uniform(0, side, (number, 2))]).argmin(0)
        if np.bincount(found.ravel(), minlength=number).min() >= LEAST_SHARE * found.size / number:
            return 1 + found


def laid(picture, side):
    """A picture of a side, filled with another side by side."""
    return np.tile(picture, [*(-(-side // length) for length in picture.shape[:2]), 1])[:side, :side]


def drawn(known, seed, number, side=256):
    """Two mosaics of the same textures drawn at random, with straight borders and with curved ones."""
    rng = np.random.default_rng(seed)
    chosen = {name: known[name] for name in rng.choice(sorted(known), number, replace=False).tolist()}
    found = []
    for curved in (False, True):
        truth = regions(side, rng, curved, number)
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


def averaged(planes, picture):
    """Means of planes over Gaussian windows, with the mean and the contrast of the picture, (..., features)."""
    values = picture.astype(np.float32)
    mean, square = (gaussian_filter(one, WINDOW) for one in (values, values * values))
    means = [gaussian_filter(np.asarray(plane, np.float32), WINDOW) for plane in planes]
    return np.stack([*means, mean, np.sqrt(np.maximum(square - mean * mean, 0))], -1)


def patterns(picture):
    """Where each local binary pattern occurs in a grey picture."""
    for points, radius in PATTERNS:
        code = local_binary_pattern(picture, points, radius, "uniform")
        yield from (code == value for value in range(points + 2))


def energies(picture):
    """Logarithms of the energies of Gabor filters in a grey picture, in its windows."""
    padded = np.pad(picture.astype(np.float32), 32, "reflect")
    for frequency, turn in product(GABOR[0], range(GABOR[1])):
        kernel = gabor_kernel(frequency, theta=np.pi * turn / GABOR[1])
        yield np.log1p(abs(fftconvolve(padded, kernel, "same")[32:-32, 32:-32]))


def probabilities(training, pictures, planes=patterns):
    """Logarithms of probabilities by a random forest, (classes, rows, cols) for each of grey pictures."""
    try:
        from sklearn.ensemble import RandomForestClassifier
    except ModuleNotFoundError:
        raise SystemExit("the baselines need scikit-learn: pip install -e '.[benchmarks]'") from None

    def pixels(picture):
        found = averaged(planes(picture), picture)
        return found.reshape(-1, found.shape[-1])

    rng = np.random.default_rng(1)
    shown = [rng.permutation(pixels(one))[:SHOWN] for one in training]
    forest = RandomForestClassifier(100, n_jobs=2, random_state=1, min_samples_leaf=3)
    forest.fit(np.concatenate(shown), np.repeat(np.arange(len(shown)), [len(one) for one in shown]))
    return [np.log(forest.predict_proba(pixels(one)).T.reshape(-1, *one.shape) + LEAST) for one in pictures]


def labelled(machine, picture, samples, colour=False, **options):
    """Labels and output of the classifier, for pictures with three bands, which are made grey unless in colour."""
    kind = np.asarray if colour else grey
    given = {"rng": 1, "device": machine, "channel_axis": -1 if colour else None} | options
    given["textures"] = {texture: kind(one) for texture, one in samples.items()}
    return simdtex.classify(kind(picture), full_output=True, **given)


def parts(textures):
    """The training part of every texture, by name."""
    return {name: one.training for name, one in textures.items()}


def field(machine, evidence, coupling, weight, sweeps=10):
    """Labels 1, 2... of the Potts field of the classifier, for other evidence (classes, rows, cols)."""
    given = machine.put(np.rint(evidence * UNITS).astype(np.int32))
    sites = machine.put(np.arange(evidence[0].size, dtype=np.int32))
    classes, taps = machine.put(np.arange(len(evidence), dtype=np.int32)), machine.put(gaussian(coupling))
    before = evidence.argmax(0).astype(np.uint8)
    for _ in range(sweeps):
        labels = machine.put(before)
        votes = window(machine, labels, classes, taps)
        after = machine.get(potts(machine, sites, given, votes, round(WEIGHTS * weight), labels))
        if (after == before).all():
            break
        before = after
    return 1 + before


def measure_accuracy(machine, pairs, kinds=("grey", "colour")):
    """Accuracy of the classifier and of the baselines, and in how many mosaics each is ahead of the classifier."""
    found, planes = defaultdict(list), {"binary patterns": patterns, "Gabor energies": energies}
    for pair in pairs:
        samples, pictures = parts(pair[0].textures), [grey(m.picture) for m in pair]

        def note(method, labels, pair=pair):
            found[method].append([accuracy(one, m.truth) for m, one in zip(pair, labels, strict=True)])

        for kind, (text, weight) in product(kinds, (("", {}), (", no field", {"weight": 0}))):
            options = {"colour": kind == "colour", "unknown": 0, **weight}
            note(f"classify, {kind}{text}", [labelled(machine, m.picture, samples, **options)[0] for m in pair])
        for name, kind in planes.items():
            chances = probabilities([grey(one) for one in samples.values()], pictures, kind)
            note(f"{name}, no field", [1 + one.argmax(0) for one in chances])
            for setting in FIELDS:
                note((name, *setting), [field(machine, one, *setting) for one in chances])
    kept = {method: np.array(shares) for method, shares in found.items() if isinstance(method, str)}
    for name in planes:
        best = max(((name, *setting) for setting in FIELDS), key=lambda method: np.mean(found[method]))
        kept["{}, field {}, {}".format(*best)] = np.array(found[best])
    reference = kept["classify, grey"][..., 1]
    return ["classifier", *SHARES, "least of all", f"ahead, of {reference.size}"], [
        [
            method,
            *(f"{share:.3f}" for share in (*shares.mean(0).ravel(), shares[..., 1].min())),
            int((shares[..., 1] > reference).sum()),
        ]
        for method, shares in kept.items()
    ]


def measure_unknown(machine, pairs):
    """AUROC of the fits of the labels in mosaics of which one class was not learned."""
    left = {}

    def judged(strange, known):
        return auroc(strange, known), (strange < ASKED).mean(), (known < ASKED).mean()

    for number, pair in enumerate(pairs):
        mosaic = pair[number % 2]
        for label, missing in enumerate(mosaic.textures, 1):
            samples = {name: one for name, one in parts(mosaic.textures).items() if name != missing}
            fit, strange = own_fit(labelled(machine, mosaic.picture, samples)[1]), mosaic.truth == label
            left[f"{missing} (draw {number + 1})"] = judged(fit[strange], fit[~strange])
    worst = ", ".join(f"{one} {left[one][0]:.3f}" for one in sorted(left, key=left.get)[:3])
    area, share, alarms = np.mean([*left.values()], 0)
    return ["AUROC, mean", "worst", "called unknown at 5 %", "known ones called so"], [
        [f"{area:.3f}", worst, f"{100 * share:.0f} %", f"{100 * alarms:.0f} %"]
    ]


PARTS = {
    "accuracy": measure_accuracy,
    "equalised": partial(measure_accuracy, kinds=("grey",)),
    "unknown": measure_unknown,
}


@common.command
def main(textures=Path, only="", parts="", draws=7, seed=1, side=256, out=Path, device=None):
    chosen, known = common.chosen(PARTS, parts), read(textures, only)
    machine, numbers = common.opened(device), [min(NUMBERS[n % len(NUMBERS)], len(known)) for n in range(draws)]
    print(f"textures: {', '.join(sorted(known))}")
    for part, measure in chosen.items():
        shown = {name: equalised(one) for name, one in known.items()} if part == "equalised" else known
        pairs = [drawn(shown, (seed, draw), number, side) for draw, number in enumerate(numbers)]
        common.table(part, *measure(machine, pairs), out and out / f"{part}.csv")


if __name__ == "__main__":
    main()

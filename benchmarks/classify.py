# SPDX-License-Identifier: BSD-3-Clause
"""How well `simdtex.classify` labels textures, beside classifiers of other kinds, and how long it takes.

    python benchmarks/classify.py DIR [--only '*.png'] [--parts accuracy,unknown,calibration,order,defaults,time]
                                  [--draws N] [--seed N] [--side N] [--out DIR] [--device TEXT]

Textures are the pictures of a folder, and brick, grass and gravel of scikit-image. What is learned from and what is
labelled lie apart: the left and the right half of a picture, or of one with 512 or more pixels a side [:128, :128] and
[-256:, -256:]. Each draw takes five textures at random, for a mosaic with straight borders (quadrants, and a square in
the middle) and one with curved borders. ``--out`` takes a table for each part:

accuracy     shares of right labels 16 or more pixels from borders, and of all pixels; of the classifier, and of
             random forests on local binary patterns and on Gabor energies, without and with the same Potts field.
             The baselines need scikit-learn (``pip install -e '.[benchmarks]'``).
unknown      the area under the curve (AUROC) of fits: of each class alone, its held-out part against whole pictures
             of every other texture; and in mosaics of which one class was not learned.
calibration  the shares of pixels called unknown that are of a known texture, by the probability asked for.
order        accuracy by the order of neighbourhoods; of whole ones, and of the pixel given its neighbours: equation
             (6) with the bandwidth of equation (8), by `simdtex.lcpdf` at every fourth row and column.
defaults     accuracy with other values of the options.
time         512x512 against five samples of 128x128 (by --side), seconds on the device by kernel, best of three;
             and how much faster than the NumPy reference a small case is.
"""

import argparse
import time
import timeit
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tables
from baselines import FEATURES, probabilities
from mosaics import accuracy, auroc, drawn, grey, own_fit, textures
from skimage import data

import simdtex
from simdtex.ops.classes import WEIGHTS, gaussian, potts, window

ASKED = (0.01, 0.05, 0.1)  # probabilities of calling a known texture unknown
FIELDS = [(coupling, weight) for coupling in (8, 11) for weight in (2, 4, 7, 12)]  # of the baselines; they get the best
ORDERS = (1, 2, 4, 8, 18)
STEP = 4  # rows and columns between the sites that the density of a pixel is computed at
DEFAULTS = {
    "typical": (0.0, 0.6),
    "levels": (1, 2),
    "exemplars": (500, 4000),
    "coupling": (4.0, 12.0),
    "weight": (3.0, 12.0),
}
UNITS = 2**18  # of evidence and votes
SHARES = ["straight, away", "straight, all", "curved, away", "curved, all"]


class Bench(NamedTuple):
    """What every part is given: ``known`` textures by name, the numbers of draws, and a ``side`` in pixels."""

    machine: Any
    known: dict
    draws: int = 10
    seed: int = 1
    side: int = 256

    def pairs(self, draws=None):
        """Two mosaics, straight and curved, for each draw."""
        return [drawn(self.known, (self.seed, draw), self.side) for draw in range(draws or self.draws)]


def labelled(bench, picture, samples, colour=False, **options):
    """Labels and output of the classifier, for pictures with three bands, which are made grey unless in colour."""
    kind, axis = (np.asarray, -1) if colour else (grey, None)
    given = {name: kind(one) for name, one in samples.items()}
    if "validation" in options:
        options["validation"] = {name: kind(one) for name, one in options["validation"].items()}
    given = {"rng": 1, "device": bench.machine, "channel_axis": axis} | options | {"textures": given}
    return simdtex.classify(kind(picture), full_output=True, **given)


def training(textures):
    """The parts of textures to learn from, by name."""
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


def measure_accuracy(bench):
    """Accuracy of the classifier and of the baselines, and in how many mosaics each is ahead of the classifier."""
    found = {}

    def note(method, pair, labels):
        found.setdefault(method, []).append([accuracy(one, m.truth) for m, one in zip(pair, labels, strict=True)])

    pairs = bench.pairs()
    for pair in pairs:
        samples = training(pair[0].textures)
        for kind in ("grey", "colour"):
            for text, weight in (("", {}), (", no field", {"weight": 0})):
                options = {"colour": kind == "colour", "unknown": 0, **weight}
                labels = [labelled(bench, m.picture, samples, **options)[0] for m in pair]
                note(f"classify, {kind}{text}", pair, labels)
        parts, pictures = [grey(one) for one in samples.values()], [grey(m.picture) for m in pair]
        for name, features in FEATURES.items():
            for size in (4, 10):
                chances = probabilities(parts, pictures, features, size)
                note((name, size), pair, [1 + one.argmax(0) for one in chances])
                for setting in FIELDS:
                    labels = [field(bench.machine, one, *setting) for one in chances]
                    note((name, size, *setting), pair, labels)
    kept = {method: np.array(shares) for method, shares in found.items() if isinstance(method, str)}
    for name in FEATURES:
        for size in (4, 10):
            kept[f"{name}, window {size}, no field"] = np.array(found[name, size])
            best = max(FIELDS, key=lambda setting: np.mean(found[name, size, *setting]))
            kept[f"{name}, window {size}, field {best[0]}, {best[1]}"] = np.array(found[name, size, *best])
    reference = kept["classify, grey"][..., 1]
    for method, shares in kept.items():
        for draw, curved in np.argwhere(shares[..., 1] > reference) if "classify" not in method else ():
            figures = f"{shares[draw, curved, 1]:.3f}, classify {reference[draw, curved]:.3f}"
            names = ", ".join(pairs[draw][curved].textures)
            print(f"ahead: {method}: {figures}; {('straight', 'curved')[curved]} {names}")
    return ["classifier", *SHARES, f"ahead, of {reference.size}"], [
        [method, *(f"{share:.3f}" for share in shares.mean(0).ravel()), int((shares[..., 1] > reference).sum())]
        for method, shares in kept.items()
    ]


def measure_unknown(bench):
    """AUROC of the fit of each class alone, and of the labels' own in mosaics of which one class was not learned."""
    cases = {"one class, other pictures": {}, "a class left out of a mosaic": {}}
    alone, left = cases.values()

    def judged(strange, known):
        return auroc(strange, known), (strange < ASKED[1]).mean()

    for name, own in bench.known.items():
        classifier = simdtex.TextureClassifier(rng=1, device=bench.machine)
        classifier.fit(grey(own.training), np.ones(own.training.shape[:2], int))
        others = [
            classifier.predict_fit(grey(picture))[::4, ::4].ravel()
            for other, texture in bench.known.items()
            for picture in (texture.training, texture.test)
            if other != name
        ]
        alone[name] = judged(np.concatenate(others), classifier.predict_fit(grey(own.test))[..., 0])
    for number, pair in enumerate(bench.pairs()):
        mosaic = pair[number % 2]
        for label, missing in enumerate(mosaic.textures, 1):
            samples = {name: one for name, one in training(mosaic.textures).items() if name != missing}
            fit, strange = own_fit(labelled(bench, mosaic.picture, samples)[1]), mosaic.truth == label
            left[f"{missing} (draw {number + 1})"] = judged(fit[strange], fit[~strange])
    rows = []
    for case, values in cases.items():
        worst = sorted(values, key=values.get)[:3]
        told = ", ".join(f"{one} {values[one][0]:.3f}" for one in worst)
        area, share = np.mean([*values.values()], 0)
        rows.append([case, f"{area:.3f}", told, f"{100 * share:.0f} %"])
    return ["case", "AUROC, mean", "worst", "called unknown at 5 %"], rows


def measure_calibration(bench):
    """The shares of known textures that are called unknown, by problem and by the probability that was asked for."""
    found = {}

    def note(problem, fits):
        found.setdefault(problem, []).append([np.mean([(fit < asked).mean() for fit in fits]) for asked in ASKED])

    for number, pair in enumerate(bench.pairs()):
        samples, problems = training(pair[0].textures), {"": {}}
        problems[", with validation"] = {"validation": {name: one.further for name, one in pair[0].textures.items()}}
        for text, options in problems.items():
            held = [own_fit(labelled(bench, t.rest, samples, **options)[1]) for t in pair[0].textures.values()]
            note(f"five classes{text}", held)
        note("five classes, in mosaics", [own_fit(labelled(bench, pair[number % 2].picture, samples)[1])])
    for name, one in bench.known.items():
        for text, options in (("", {}), (", with validation", {"validation": {name: one.further}})):
            note(f"one class{text}", [own_fit(labelled(bench, one.rest, {name: one.training}, **options)[1])])
    return ["problem", *(f"{100 * asked:g} %" for asked in ASKED), "most at 5 %"], [
        [problem, *(f"{100 * share:.1f} %" for share in np.mean(shares, 0)), f"{100 * np.max(shares, 0)[1]:.0f} %"]
        for problem, shares in sorted(found.items())
    ]


def densities(bench, mosaic, order):
    """Logarithms of the LCPDF of each class at every fourth row and column, (classes, rows, cols)."""
    picture = grey(mosaic.picture)
    sites = np.stack(np.mgrid[: picture.shape[0] : STEP, : picture.shape[1] : STEP], -1)
    flat, values = sites.reshape(-1, 2), picture[::STEP, ::STEP].ravel()
    options = {"order": order, "boundary": "open", "device": bench.machine}
    logs = []
    for one in mosaic.textures.values():
        density = simdtex.lcpdf(picture, grey(one.training), flat, **options)[np.arange(len(flat)), values]
        logs.append(np.log(np.maximum(density, 1e-9)).reshape(sites.shape[:2]))
    return np.array(logs)


def measure_order(bench):
    """Accuracy by order, for whole neighbourhoods and for the pixel given its neighbours, without and with a field."""
    rows = []
    pairs = bench.pairs(-(-bench.draws // 2))
    mosaics = [mosaic for pair in pairs for mosaic in pair]
    for order in ORDERS:
        shares = {}
        for mosaic in mosaics:
            options = {"order": order, "weight": 0, "unknown": 0}
            labels, output = labelled(bench, mosaic.picture, training(mosaic.textures), **options)
            evidence = np.log(np.maximum(np.moveaxis(output.probability, -1, 0), 1e-30))
            for name, found in (("whole", labels), ("whole, field", field(bench.machine, evidence, 8, 7))):
                shares.setdefault(name, []).append((found == mosaic.truth).mean())
            logs, truth = densities(bench, mosaic, order), mosaic.truth[::STEP, ::STEP]
            shares.setdefault("pixel", []).append((1 + logs.argmax(0) == truth).mean())
            for setting in FIELDS:
                labels = field(bench.machine, logs, setting[0] / STEP, setting[1])
                shares.setdefault(setting, []).append((labels == truth).mean())
        mean = {name: np.mean(values) for name, values in shares.items()}
        best = max(FIELDS, key=mean.get)
        found = (mean["whole"], mean["whole, field"], mean["pixel"], mean[best])
        rows.append([order, *(f"{share:.3f}" for share in found)])
    return ["order", "whole, no field", "whole, field", "pixel, no field", "pixel, field"], rows


def measure_defaults(bench):
    """Accuracy with the defaults, and with one option changed."""
    settings = {"defaults": {}}
    settings |= {f"{name} {value:g}": {name: value} for name, values in DEFAULTS.items() for value in values}
    pairs, rows = bench.pairs(-(-bench.draws // 2)), []
    for text, options in settings.items():
        shares = [
            [accuracy(labelled(bench, m.picture, training(m.textures), unknown=0, **options)[0], m.truth) for m in pair]
            for pair in pairs
        ]
        rows.append([text, *(f"{share:.3f}" for share in np.mean(shares, 0).ravel())])
    return ["options", *SHARES], rows


def large(side, size):
    """A picture and five samples, of brick, grass, gravel and two of them turned."""
    pictures = [getattr(data, name)() for name in ("brick", "grass", "gravel")]
    pictures += [np.rot90(pictures[0]), np.rot90(pictures[1])]
    place = np.add.outer(np.arange(side) // -(-side // 3) * 3, np.arange(side) // -(-side // 3)) % 5
    picture = np.choose(place, [one[-side:, -side:] for one in pictures])
    return picture, {str(number): one[:size, :size] for number, one in enumerate(pictures)}


def measure_time(bench):
    """Seconds of a run on the device by kernel, and the ratio to the NumPy reference."""
    machine = bench.machine
    picture, samples = large(2 * bench.side, bench.side // 2)
    runs = []
    for _ in range(4):  # the first compiles
        began = time.perf_counter()
        _, output = simdtex.classify(picture, samples, rng=1, device=machine, full_output=True)
        runs.append((time.perf_counter() - began, output.statistics.get("kernels", [])))
    seconds, kernels = min(runs[1:], key=lambda run: run[0])
    rows = [[f"{2 * bench.side}x{2 * bench.side}, the whole call", "", f"{seconds:.2f} s"]]
    rows += [[one["name"], one["calls"], f"{one['seconds']:.3f} s"] for one in kernels]
    side, size = bench.side // 4, bench.side * 3 // 16
    picture, samples = large(side, size)
    plain, fast = (
        min(timeit.repeat(partial(simdtex.classify, picture, samples, rng=1, device=device), number=1, repeat=3))
        for device in (simdtex.open_machine("reference"), machine)
    )
    rows.append([f"{side}x{side}, five samples of {size}x{size}", "", f"{fast:.3f} s"])
    rows.append(["the same by the reference", "", f"{plain:.3f} s, {plain / fast:.0f} times"])
    return ["what", "launches", "time"], rows


PARTS = {
    "accuracy": measure_accuracy,
    "unknown": measure_unknown,
    "calibration": measure_calibration,
    "order": measure_order,
    "defaults": measure_defaults,
    "time": measure_time,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("samples", type=Path, help="folder of pictures, each a texture")
    parser.add_argument("--only", default="", help="names or patterns of its files, brick,*.png")
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("--draws", type=int, default=10, help="of five textures; order and defaults take half of them")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--side", type=int, default=256, help="of mosaics, pixels")
    parser.add_argument("--out", type=Path, help="folder for the tables")
    parser.add_argument("--device")
    options = parser.parse_args()
    parts = options.parts.split(",")
    if strange := [part for part in parts if part not in PARTS]:
        parser.error(f"there is no part {strange[0]}: choose of {', '.join(PARTS)}")
    try:
        known = textures(options.samples, options.only)
    except ValueError as error:
        parser.error(str(error))
    bench = Bench(simdtex.open_machine(options.device, profile=True), known, options.draws, options.seed, options.side)
    print(f"device: {bench.machine.name}; textures: {len(known)}")
    for part in parts:
        began = time.perf_counter()
        header, rows = PARTS[part](bench)
        tables.show(f"{part}, {time.perf_counter() - began:.0f} s", header, rows)
        if options.out:
            tables.write(options.out / f"{part}.csv", header, rows)


if __name__ == "__main__":
    main()

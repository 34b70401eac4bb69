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
             (6) with the bandwidth of equation (8), by `simdtex.lcpdf` at every fourth row and column. Half the draws.
defaults     accuracy with other values of the options. Half the draws.
time         512x512 against five samples of 128x128 (by --side), seconds on the device by kernel, best of three;
             and how much faster than the NumPy reference a small case is.
"""

from collections import defaultdict
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import common
import numpy as np
from mosaics import FEATURES, accuracy, auroc, drawn, grey, own_fit, probabilities, textures
from skimage import data

import simdtex
from simdtex.ops.classes import WEIGHTS, gaussian, potts, window

ASKED = (0.01, 0.05, 0.1)  # probabilities of calling a known texture unknown
FIELDS = [(coupling, weight) for coupling in (8, 11) for weight in (2, 4, 7, 12)]  # of the baselines; they get the best
ORDERS = (1, 2, 4, 8, 18)
STEP = 4  # rows and columns between the sites that the density of a pixel is computed at
DEFAULTS = {"typical": (0.0, 0.6), "levels": (1, 2), "exemplars": (500, 4000), "coupling": (4, 12), "weight": (3, 12)}
UNITS = 2**18  # of evidence and votes
SHARES = ["straight, away", "straight, all", "curved, away", "curved, all"]


class Bench(NamedTuple):
    """What every part is given: ``known`` textures by name, the numbers of draws, and a ``side`` in pixels."""

    machine: Any
    known: dict
    draws: int
    seed: int
    side: int

    def pairs(self, part=1):
        """Two mosaics, straight and curved, for each draw or for a part of the draws."""
        return [drawn(self.known, (self.seed, draw), self.side) for draw in range(-(-self.draws // part))]


def labelled(bench, picture, samples, colour=False, **options):
    """Labels and output of the classifier, for pictures with three bands, which are made grey unless in colour."""
    kind = np.asarray if colour else grey
    given = {"rng": 1, "device": bench.machine, "channel_axis": -1 if colour else None} | options
    for name, pictures in {"textures": samples, "validation": options.get("validation")}.items():
        if pictures:
            given[name] = {texture: kind(one) for texture, one in pictures.items()}
    return simdtex.classify(kind(picture), full_output=True, **given)


def parts(textures, part="training"):
    """A part of every texture, by name."""
    return {name: getattr(one, part) for name, one in textures.items()}


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
    found, pairs = defaultdict(list), bench.pairs()
    for pair in pairs:
        samples, pictures = parts(pair[0].textures), [grey(m.picture) for m in pair]

        def note(method, labels, pair=pair):
            found[method].append([accuracy(one, m.truth) for m, one in zip(pair, labels, strict=True)])

        for kind, (text, weight) in product(("grey", "colour"), (("", {}), (", no field", {"weight": 0}))):
            options = {"colour": kind == "colour", "unknown": 0, **weight}
            note(f"classify, {kind}{text}", [labelled(bench, m.picture, samples, **options)[0] for m in pair])
        for name, size in product(FEATURES, (4, 10)):
            chances = probabilities([grey(one) for one in samples.values()], pictures, FEATURES[name], size)
            note((name, size), [1 + one.argmax(0) for one in chances])
            for setting in FIELDS:
                note((name, size, *setting), [field(bench.machine, one, *setting) for one in chances])
    kept = {method: np.array(shares) for method, shares in found.items() if isinstance(method, str)}
    for name, size in product(FEATURES, (4, 10)):
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
    alone, left = {}, {}

    def judged(strange, known):
        return auroc(strange, known), (strange < ASKED[1]).mean()

    for name, own in bench.known.items():
        classifier = simdtex.TextureClassifier(rng=1, device=bench.machine)
        classifier.fit(grey(own.training), np.ones(own.training.shape[:2], int))
        others = [one for other, one in bench.known.items() if other != name]
        whole = [picture for one in others for picture in (one.training, one.test)]
        strange = np.concatenate([classifier.predict_fit(grey(picture))[::4, ::4].ravel() for picture in whole])
        alone[name] = judged(strange, classifier.predict_fit(grey(own.test))[..., 0])
    for number, pair in enumerate(bench.pairs()):
        mosaic = pair[number % 2]
        for label, missing in enumerate(mosaic.textures, 1):
            samples = {name: one for name, one in parts(mosaic.textures).items() if name != missing}
            fit, strange = own_fit(labelled(bench, mosaic.picture, samples)[1]), mosaic.truth == label
            left[f"{missing} (draw {number + 1})"] = judged(fit[strange], fit[~strange])
    rows = []
    for case, values in {"one class, other pictures": alone, "a class left out of a mosaic": left}.items():
        worst = ", ".join(f"{one} {values[one][0]:.3f}" for one in sorted(values, key=values.get)[:3])
        area, share = np.mean([*values.values()], 0)
        rows.append([case, f"{area:.3f}", worst, f"{100 * share:.0f} %"])
    return ["case", "AUROC, mean", "worst", "called unknown at 5 %"], rows


def measure_calibration(bench):
    """The shares of known textures that are called unknown, by problem and by the probability that was asked for."""
    found = defaultdict(list)

    def note(problem, fits):
        found[problem].append([np.mean([(fit < asked).mean() for fit in fits]) for asked in ASKED])

    def held(textures, **options):
        samples = parts(textures)
        return [own_fit(labelled(bench, rest, samples, **options)[1]) for rest in parts(textures, "rest").values()]

    groups = [("five classes", pair[0].textures) for pair in bench.pairs()]
    groups += [("one class", {name: one}) for name, one in bench.known.items()]
    for problem, group in groups:
        note(problem, held(group))
        note(f"{problem}, with validation", held(group, validation=parts(group, "further")))
    for number, pair in enumerate(bench.pairs()):
        output = labelled(bench, pair[number % 2].picture, parts(pair[0].textures))[1]
        note("five classes, in mosaics", [own_fit(output)])
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
    found = [simdtex.lcpdf(picture, grey(one), flat, **options) for one in parts(mosaic.textures).values()]
    own = np.array(found)[:, np.arange(len(flat)), values]
    return np.log(np.maximum(own, 1e-9)).reshape(-1, *sites.shape[:2])


def measure_order(bench):
    """Accuracy by order, for whole neighbourhoods and for the pixel given its neighbours, without and with a field."""
    rows = []
    for order in ORDERS:
        shares = defaultdict(list)
        for mosaic in (mosaic for pair in bench.pairs(2) for mosaic in pair):
            options = {"order": order, "weight": 0, "unknown": 0}
            labels, output = labelled(bench, mosaic.picture, parts(mosaic.textures), **options)
            evidence = np.log(np.maximum(np.moveaxis(output.probability, -1, 0), 1e-30))
            logs, truth = densities(bench, mosaic, order), mosaic.truth[::STEP, ::STEP]
            shares["whole"].append((labels == mosaic.truth).mean())
            shares["whole, field"].append((field(bench.machine, evidence, 8, 7) == mosaic.truth).mean())
            shares["pixel"].append((1 + logs.argmax(0) == truth).mean())
            for coupling, weight in FIELDS:
                labels = field(bench.machine, logs, coupling / STEP, weight)
                shares[coupling, weight].append((labels == truth).mean())
        mean = {name: np.mean(values) for name, values in shares.items()}
        found = (mean["whole"], mean["whole, field"], mean["pixel"], max(mean[setting] for setting in FIELDS))
        rows.append([order, *(f"{share:.3f}" for share in found)])
    return ["order", "whole, no field", "whole, field", "pixel, no field", "pixel, field"], rows


def measure_defaults(bench):
    """Accuracy with the defaults, and with one option changed."""
    settings, rows = {"defaults": {}}, []
    settings |= {f"{name} {value:g}": {name: value} for name, values in DEFAULTS.items() for value in values}
    for text, options in settings.items():
        shares = [
            [accuracy(labelled(bench, m.picture, parts(m.textures), unknown=0, **options)[0], m.truth) for m in pair]
            for pair in bench.pairs(2)
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

    def fastest(side, size, machine):
        job = partial(simdtex.classify, *large(side, size), rng=1, device=machine, full_output=True)
        (_, output), seconds = min(common.in_turns(3, {"": partial(common.timed, job)})[""], key=lambda run: run[1])
        return seconds, output.statistics.get("kernels", [])

    seconds, kernels = fastest(2 * bench.side, bench.side // 2, bench.machine)
    rows = [[f"{2 * bench.side}x{2 * bench.side}, the whole call", "", f"{seconds:.2f} s"]]
    rows += [[one["name"], one["calls"], f"{one['seconds']:.3f} s"] for one in kernels]
    side, size = bench.side // 4, bench.side * 3 // 16
    plain, fast = (fastest(side, size, machine)[0] for machine in (simdtex.open_machine("reference"), bench.machine))
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


@common.command
def main(samples, only="", parts="", draws=10, seed=1, side=256, out=Path, device=None):
    chosen, known = common.chosen(PARTS, parts), textures(samples, only)
    bench = Bench(common.opened(device, profile=True), known, draws, seed, side)
    print(f"textures: {len(known)}")
    for part, measure in chosen.items():
        (header, rows), seconds = common.timed(measure, bench)
        common.show(f"{part}, {seconds:.0f} s", header, rows)
        if out:
            common.write(out / f"{part}.csv", header, rows)


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: BSD-3-Clause
"""What options do to a texture, by figures and for the eye.

    python benchmarks/study.py --out OUT [--method mrf] [--samples DIR] [--only brick,grass] [--options NAME=VALUE,...]
                               [--seeds N] [--device TEXT]

Samples are those of `common.py`, or the pictures of a folder. Outputs are twice the sample in each direction. Without
``--options``, which may be given several times (``default`` are none), the settings of the documentation are tried:
``--method mrf --seeds 2``, ``--method multires`` and ``--method pyramid``, whose first lines are other methods with
their defaults and one seed. Writes a table, METHOD.csv, with means over the seeds, and for each sample a sheet of the
pictures of the last seed, METHOD-NAME.png, and prints the mean and the worst of every figure of each setting.
"""

from math import log
from pathlib import Path

import common
import numpy as np
from scipy.ndimage import median_filter

import simdtex
from simdtex.jobs.studies.quality import as_pair, halved, in_deviations, nearest, spread

FIGURES = {
    "mrf": ("plausibility", "coverage", "copying", "repeats", "salt", "contrast", "seam"),
    **dict.fromkeys(
        ("multires", "pyramid"),
        ("plausibility", "coverage", "copying", "histogram_distance", "seam", "repetition"),
    ),
}
SETTINGS = {
    "mrf": "default|search=exact|balance=0|balance=1|structure=0|structure=1|novelty=0|novelty=2|overview=64|finish=0"
    "|finish=2|coherence=0|coherence=1|edges=reflect|order=8|chance=0|xi=-2|free_sweeps=0",
    "multires": "alpha=0|alpha=0.05|alpha=0.1|alpha=0.2|default, alpha=0.3|alpha=0.4|alpha=0.6|alpha=1|alpha=inf"
    "|alpha=1, beta=1|alpha=4, beta=2|alpha=8, beta=3|parity=free|orientations=0|orientations=2|orientations=8"
    "|boundary=open",
    "pyramid": "default|iterations=1|iterations=2|iterations=10|iterations=20|iterations=100|pyramid=laplacian"
    "|orientations=1|orientations=2|orientations=6|levels=1|levels=2|levels=3|levels=5|match=lookup|edges=wrap"
    "|color=channels",
}
"""Settings of the documentation, as the table names them."""

UNSEEN = "orientations=2|orientations=8|xi=-2|free_sweeps=0|iterations=2|iterations=10|levels=3|levels=5|edges=wrap"
"""Those not on the sheets, where they look like others."""


def tried(method, given, in_colour):
    """What is tried on a sample: the label and the options."""
    if not given and method != "mrf":
        yield "mrf", {"method": "mrf", "search": "exact"}
    if not given and method == "pyramid":
        yield "multires", {"method": "multires"}
    for label in given or SETTINGS[method].split("|"):
        options = {} if "default" in label else common.parsed(label)
        if given or in_colour or "color" not in options:
            yield label, {"method": method} | options


SIDE, APART = 32, 16
"""The side of a patch, and how far from it at least it may come back, pixels."""

ALIKE = 0.35
"""Standard deviations of the sample at half its size below which two patches are alike."""

MOST = 1024
"""Patches looked up, of a grid of 8 pixels or wider."""

ODD = 0.005
"""Share of the sample's pixels that count as odd."""


def repeats(sample, output):
    """Return the shares of the 32 x 32 patches of output and sample that occur elsewhere in the same picture, 0 to 1.

    Both are reduced to half their size, so that fine grain makes nothing alike. Two patches are alike if the root of
    their mean squared difference is below `ALIKE`. Pictures have 48 x 48 pixels or more.
    """
    first, second = as_pair(sample, output, SIDE + APART)
    small, large = (halved(planes) for planes in in_deviations(first, first, second))
    own, made = (_share(planes) for planes in in_deviations(small, small, large))
    return made, own


def _share(planes):
    side, spacing = SIDE // 2, 4
    rows, cols = (length - side + 1 for length in planes.shape[:2])
    while -(-rows // spacing) * -(-cols // spacing) > MOST:
        spacing += 1
    asked = np.add.outer(np.arange(0, rows, spacing) * cols, np.arange(0, cols, spacing)).ravel()
    return float((nearest(planes, asked, planes, side, apart=APART // 2) < ALIKE).mean())


def salt(sample, output):
    """Return how many odd pixels the output has, as a multiple of the sample's.

    A pixel's deviation is its distance from the median of the 3 x 3 pixels around it, the largest over the channels; it
    is odd if that exceeds the 99.5 % point of the sample's deviations. Ties count so that the sample itself has 1.
    """
    had, has = (_off_median(planes) for planes in as_pair(sample, output, 3))
    threshold = np.quantile(had, 1 - ODD, method="inverted_cdf")
    weight = (ODD - (had > threshold).mean()) / (had == threshold).mean()
    return float(((has > threshold).mean() + weight * (has == threshold).mean()) / ODD)


def _off_median(planes):
    return np.abs(planes.astype(np.float64) - median_filter(planes, size=(3, 3, 1), mode="nearest")).max(axis=2)


def contrast(sample, output):
    """Return the standard deviation of the output over that of the sample; both over all channels."""
    first, second = as_pair(sample, output, 1)
    return spread(second) / spread(first) if spread(first) else 1.0


def further(sample, output):
    """Return the figures of this module that need no source; repeats only of pictures that are large enough."""
    found = {"salt": salt(sample, output), "contrast": contrast(sample, output)}
    if min(*sample.shape[:2], *output.shape[:2]) >= SIDE + APART:
        found["repeats"], _ = repeats(sample, output)
    return found


def repetition(sample, made):
    """Correlation of a picture with itself displaced by the sample's rows, columns and both, the mean of the three."""
    rows, cols = sample.shape[:2]
    centred = made - made.mean((0, 1))
    moves = ((rows, 0), (0, cols), (rows, cols))
    return np.mean([(centred * np.roll(centred, move, (0, 1))).mean() for move in moves]) / (centred**2).mean()


def measured(sample, seed, options, machine):
    """A picture of twice the sample's sides, and its figures by name without those that it lacks."""
    given = {"channel_axis": common.axis(sample), "rng": seed, "device": machine, "full_output": True} | options
    picture, output = simdtex.synthesize(sample, (2 * sample.shape[0], 2 * sample.shape[1]), **given)
    quality = vars(simdtex.quality.measure(sample, picture, output.source)) | further(sample, picture)
    quality["repetition"] = repetition(sample, picture)
    return picture, {figure: value for figure, value in quality.items() if value is not None}


def worst(figure, values):
    """The worst of a figure's values by sample: the sample and its value."""

    def badness(value):  # salt and contrast are best at 1
        return abs(log(max(value, 1e-9))) if figure in ("salt", "contrast") else abs(value)

    return max(values.items(), key=lambda each: badness(each[1]))


@common.command
def main(out=Path, method="mrf", samples=Path, only="", options=list, seeds=3, device=None):
    if out is None:
        raise ValueError("--out is missing: give a folder for the sheets and the table")
    common.chosen(SETTINGS, method)
    known, machine, wanted = common.samples(samples, only), common.opened(device), FIGURES[method]
    rows, means = [], {}
    for name, sample in known.items():
        cells = [(name, sample, "")]
        for label, given in tried(method, options, sample.ndim == 3):
            last = 1 if label in SETTINGS else seeds  # another method is there for comparison
            runs = [measured(sample, seed, given, machine) for seed in range(1, last + 1)]
            mean = {
                figure: np.mean([figures[figure] for _, figures in runs]) for figure in wanted if figure in runs[0][1]
            }
            rows.append([name, label, *(f"{mean[figure]:.2f}" if figure in mean else "" for figure in wanted)])
            print(*rows[-1], flush=True)
            for figure, value in mean.items():
                means.setdefault((label, figure), {})[name] = value
            if options or label not in UNSEEN.split("|"):
                cells.append((label, runs[-1][0], common.told(mean) if options else ""))
        common.sheet(out / f"{method}-{name}.png", cells, min(4, len(cells)))
    header = ["sample", "setting", *(figure.replace("_", " ") for figure in wanted)]
    common.table("Means over the seeds", header, rows, out / f"{method}.csv")
    ends = {case: worst(case[1], values) for case, values in means.items()}
    lines = [
        [*case, f"{np.mean(list(means[case].values())):.3f}", f"{ends[case][1]:.3f}", ends[case][0]] for case in ends
    ]
    common.table("Mean and worst", ["setting", "figure", "mean", "worst", "of"], lines)


if __name__ == "__main__":
    main()

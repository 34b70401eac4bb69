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
from figures import further

import simdtex

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

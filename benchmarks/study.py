# SPDX-License-Identifier: BSD-3-Clause
"""What the options of a method do to a texture, by figures and for the eye.

    python benchmarks/study.py [--method mrf] [--out docs/study] [--seeds N] [--only brick,grass] [--device TEXT]
                               [--quick]

Writes a table (mean over the seeds) and one sheet of pictures per sample, and prints each line as it is made:
mrf.csv and mrf-NAME.png for `mrf`, likewise for `multires` and `pyramid`, and for `exact`: `mrf` with the exact search.
The first lines of `multires` and `pyramid` are other methods with their defaults. Outputs are twice the sample in
each direction. ``--quick`` takes half of each sample's sides. Seeds are 1 with `exact` and 3 with others by default.

    python benchmarks/study.py --samples DIR --out DIR [--method mrf] [--after OPTIONS] [--seeds N] [--only '*.png']
                               [--before OPTIONS]

does it for every picture of a folder, with the defaults or with the options ``--after``, and compares with the options
``--before`` (as ``"search=exact,order=8"``, or ``""`` for the defaults). Writes NAME.png for each sample
(NAME-seed2.png for the second seed and so on, before/NAME.png for those made with ``--before``), sheets/NAME.png with
sample, before and after at 1:1, a seed a row, sheets.png with all samples, and figures.csv; prints mean and worst of
every figure.
"""

from dataclasses import fields
from math import log
from pathlib import Path
from typing import NamedTuple

import common
import numpy as np
from figures import further

import simdtex
from simdtex.io.image import to_display, write
from simdtex.report.sheet import contact_sheet

OF_MRF = ("plausibility", "coverage", "copying", "repeats", "salt", "contrast", "seam")
OF_OTHERS = ("plausibility", "coverage", "copying", "histogram_distance", "seam", "repetition")
FIGURES = (
    *(field.name for field in fields(simdtex.quality.Quality)),
    *("salt", "contrast", "repeats", "own_repeats", "repeats_beyond_own", "seconds"),
)
"""The columns of the table of a folder; `repeats_beyond_own` is what an output repeats beyond what its sample does."""

SETTINGS = {
    "mrf": "default|search=exact|balance=0|balance=1|structure=0|structure=1|novelty=0|novelty=2|overview=64|finish=0"
    "|finish=2|coherence=0|coherence=1|edges=reflect|order=8|chance=0|xi=-2|free_sweeps=0",
    "exact": "default|coherence=0|coherence=1|balance=0|structure=0|order=8|relaxation=gibbs|free_sweeps=0"
    "|edges=reflect|edges=whole|phases=all|pixel=density|preset=paper|preset=paper, icm|preset=paper, bandwidth=0.15",
    "multires": "alpha=0|alpha=0.05|alpha=0.1|alpha=0.2|default, alpha=0.3|alpha=0.4|alpha=0.6|alpha=1|alpha=inf"
    "|alpha=1, beta=1|alpha=4, beta=2|alpha=8, beta=3|parity=free|orientations=0|orientations=2|orientations=8"
    "|boundary=open",
    "pyramid": "default|iterations=1|iterations=2|iterations=10|iterations=20|iterations=100|pyramid=laplacian"
    "|orientations=1|orientations=2|orientations=6|levels=1|levels=2|levels=3|levels=5|match=lookup|edges=wrap"
    "|color=channels",
}
"""Settings of each study, as the table names them."""

SHORT = {
    "phases=all": "phases=all,levels=4",
    "pixel=density": "pixel=density,relaxation=gibbs",
    "preset=paper, icm": "preset=paper,relaxation=icm,pixel=source",
}
"""Names that leave some options out."""

IN_COLOUR = ("default", "coherence=0", "coherence=1", "balance=0", "structure=0", "order=8", "relaxation=gibbs")
"""Those of the exact search that are tried on samples in colour too."""

UNSEEN = "orientations=2|orientations=8|xi=-2|free_sweeps=0|iterations=2|iterations=10|levels=3|levels=5|edges=wrap"
"""Those not on the sheets, where they look like others."""


class Result(NamedTuple):
    """A picture and its figures, by name; a figure that it lacks is missing."""

    sample: str
    setting: str
    seed: int
    picture: np.ndarray
    figures: dict


def naming(study):
    """The options that name the method of a study."""
    return {"method": "mrf", "search": "exact"} if study == "exact" else {"method": study}


def tried(study, in_colour):
    """What a study tries on a sample: label, options, seeds (None: as asked for)."""
    if study in ("multires", "pyramid"):
        yield "mrf", naming("exact"), 1
    if study == "pyramid":
        yield "multires", naming("multires"), 1
    for label in SETTINGS[study].split("|"):
        options = {} if "default" in label else common.parsed(SHORT.get(label, label))
        left_out = (study == "exact" and label not in IN_COLOUR) if in_colour else "color" in options
        if not left_out:
            yield label, naming(study) | options, None


def repetition(sample, made):
    """Correlation of a picture with itself displaced by the sample's rows, columns and both, the mean of the three."""
    rows, cols = sample.shape[:2]
    centred = made - made.mean((0, 1))
    moves = ((rows, 0), (0, cols), (rows, cols))
    return np.mean([(centred * np.roll(centred, move, (0, 1))).mean() for move in moves]) / (centred**2).mean()


def made(sample, name, setting, seed, options, machine):
    """A picture of twice the sample's sides, with all of its figures; the seconds are those of its synthesis."""
    given = {"channel_axis": common.axis(sample), "rng": seed, "device": machine, "full_output": True} | options
    shape = (2 * sample.shape[0], 2 * sample.shape[1])
    (picture, output), seconds = common.timed(simdtex.synthesize, sample, shape, **given)
    quality = vars(simdtex.quality.measure(sample, picture, output.source)) | further(sample, picture)
    figures = {figure: value for figure, value in quality.items() if value is not None}
    if "repeats" in figures:
        figures["repeats_beyond_own"] = figures["repeats"] - figures["own_repeats"]
    return Result(name, setting, seed, picture, figures | {"seconds": seconds})


# ---------------------------------------------------------------- a folder of samples


def badness(figure, value):
    """A number that is larger the worse a figure is."""
    if figure in ("salt", "contrast"):  # of which 1 is best
        return abs(log(max(value, 1e-9)))
    return -value if figure == "effective_share" else abs(value)


def summary(results):
    """Mean, worst and whose that is, for each figure that there is: {figure: (mean, worst, sample, seed)}."""
    found = {}
    for figure in FIGURES:
        those = [result for result in results if figure in result.figures]
        if those:
            worst = max(those, key=lambda result: badness(figure, result.figures[figure]))
            mean = float(np.mean([result.figures[figure] for result in those]))
            found[figure] = mean, worst.figures[figure], worst.sample, worst.seed
    return found


def over_folder(known, out, settings, seeds, machine):
    """Make and measure a picture of every sample, seed and setting, and write pictures, sheets and the table.

    `known` are the samples by name, `settings` the options by name: ``after``, and ``before`` to compare with.
    """
    folders = {"before": out / "before", "after": out}
    for folder in (folders[setting] for setting in settings):
        folder.mkdir(parents=True, exist_ok=True)
    results, first, columns = [], [], 1 + len(settings)
    short = {"cover": "coverage", "repeat": "repeats", "salt": "salt"}
    for name, sample in known.items():
        limits, cells = (float(sample.min()), float(sample.max())), []
        for seed in range(1, seeds + 1):
            cells.append((name, to_display(sample, limits), ""))
            for setting, options in settings.items():
                one = made(sample, name, setting, seed, options, machine)
                suffix = "png" if sample.dtype in ("uint8", "uint16") else "tif"
                write(folders[setting] / f"{name}{'' if seed == 1 else f'-seed{seed}'}.{suffix}", one.picture)
                results.append(one)
                shown = {figure: one.figures[figure] for figure in OF_MRF if figure in one.figures}
                print(f"{name:16}{setting:8}seed {seed}:", common.told(shown), flush=True)
                caption = common.told({word: shown[figure] for word, figure in short.items() if figure in shown})
                cells.append((f"{setting}, seed {seed}", to_display(one.picture, limits), caption))
        common.sheet(out / "sheets" / f"{name}.png", cells, columns)
        first += cells[:columns]
    common.sheet(out / "sheets.png", first, columns)
    rows = [
        [*one[:3], *(f"{one.figures[figure]:.4f}" if figure in one.figures else "" for figure in FIGURES)]
        for one in results
    ]
    common.write(out / "figures.csv", ["sample", "setting", "seed", *FIGURES], rows)
    for setting in settings:
        print(f"\n{setting:20}{'mean':>8}{'worst':>8}")
        for figure, (mean, worst, name, seed) in summary([r for r in results if r.setting == setting]).items():
            print(f"{figure:20}{mean:8.3f}{worst:8.3f}  {name}{f', seed {seed}' if seeds > 1 else ''}")


# ---------------------------------------------------------------- the studies of the documentation


def of_options(study, known, out, seeds, machine):
    """Try the settings of a study on every sample, and write the table and a sheet for each."""
    wanted, rows = OF_MRF if study in ("mrf", "exact") else OF_OTHERS, []
    for name, sample in known.items():
        pictures = [(name, sample)]
        for label, given, fixed in tried(study, sample.ndim == 3):
            each = range(1, (fixed or seeds or (1 if study == "exact" else 3)) + 1)
            runs = [made(sample, name, label, seed, given, machine) for seed in each]
            found = [run.figures | {"repetition": repetition(sample, run.picture)} for run in runs]
            mean = [np.mean([figures[figure] for figures in found]) for figure in (*wanted, "seconds")]
            rows.append([name, label, *(f"{value:.2f}" for value in mean[:-1])])
            print(f"{name:8}{label:32}", *rows[-1][2:], f"{mean[-1]:.1f} s", flush=True)
            if label not in UNSEEN.split("|"):
                pictures.append((label, runs[-1].picture))
        out.mkdir(parents=True, exist_ok=True)
        (out / f"{study}-{name}.png").write_bytes(common.png(contact_sheet(pictures, columns=4)))
    header = ["sample", "setting", *(figure.replace("_", " ") for figure in wanted)]
    common.write(out / f"{study}.csv", header, rows)


@common.command
def main(method="mrf", out=Path, seeds=int, only="", device=None, quick=False, samples=Path, after="", before=str):
    common.chosen(SETTINGS, method)
    if samples and out is None:
        raise ValueError("--samples needs --out, a folder for the pictures and the table")
    if not samples and (before is not None or after):
        raise ValueError("--before and --after are for --samples; leave them out, or give a folder of samples")
    known = common.samples(samples, only)
    if quick:
        known = {name: sample[: len(sample) // 2, : sample.shape[1] // 2] for name, sample in known.items()}
    machine = common.opened(device)
    if samples:
        given = ({} if before is None else {"before": before}) | {"after": after}
        settings = {name: naming(method) | common.parsed(text) for name, text in given.items()}
        over_folder(known, out, settings, seeds or 1, machine)
    else:
        of_options(method, known, out or common.DOCS / "study", seeds, machine)


if __name__ == "__main__":
    main()

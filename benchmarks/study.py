# SPDX-License-Identifier: BSD-3-Clause
"""What the options of a method do to a texture, by figures and for the eye.

    python benchmarks/study.py [--method mrf] [--out docs/study] [--seeds N] [--only brick,grass] [--device TEXT]
                               [--quick]

Writes a table (mean over the seeds) and one sheet of pictures per sample, and prints each line as it is made:
mrf.csv and mrf-NAME.png for `mrf`, likewise for `multires` and `pyramid`, and for `exact`: `mrf` with the exact search.
The first lines of `multires` and `pyramid` are other methods with their defaults. Outputs are twice the sample in
each direction. ``--quick`` takes half of each sample's sides.

    python benchmarks/study.py --samples DIR --out DIR [--method mrf] [--after OPTIONS] [--seeds N] [--only '*.png']
                               [--before OPTIONS]

does it for every picture of a folder, with the defaults or with the options ``--after``, and compares with the options
``--before`` (as ``"search=exact,order=8"``, or ``""`` for the defaults). Writes NAME.png for each sample
(NAME-seed2.png for the second seed and so on, before/NAME.png for those made with ``--before``), sheets/NAME.png with
sample, before and after at 1:1, a seed a row, sheets.png with all samples, and figures.csv; prints mean and worst of
every figure.
"""

import argparse
from pathlib import Path

import numpy as np
import over_folder
import samples
import tables
from pyramid_figures import png

import simdtex
from simdtex.report.sheet import contact_sheet

MRF = {
    "default": {},
    "search=exact": {"search": "exact"},
    "balance=0": {"balance": 0.0},
    "balance=1": {"balance": 1.0},
    "structure=0": {"structure": 0.0},
    "structure=1": {"structure": 1.0},
    "novelty=0": {"novelty": 0.0},
    "novelty=2": {"novelty": 2.0},
    "overview=64": {"overview": 64},
    "finish=0": {"finish": 0.0},
    "finish=2": {"finish": 2.0},
    "coherence=0": {"coherence": 0.0},
    "coherence=1": {"coherence": 1.0},
    "edges=reflect": {"edges": "reflect"},
    "order=8": {"order": 8},
    "chance=0": {"chance": 0},
    "xi=-2": {"xi": -2.0},
    "free_sweeps=0": {"free_sweeps": 0},
}
EXACT = {
    "default": {},
    "coherence=0": {"coherence": 0.0},
    "coherence=1": {"coherence": 1.0},
    "balance=0": {"balance": 0.0},
    "structure=0": {"structure": 0.0},
    "order=8": {"order": 8},
    "relaxation=gibbs": {"relaxation": "gibbs"},
    "free_sweeps=0": {"free_sweeps": 0},
    "edges=reflect": {"edges": "reflect"},
    "edges=whole": {"edges": "whole"},
    "phases=all": {"phases": "all", "levels": 4},
    "pixel=density": {"pixel": "density", "relaxation": "gibbs"},
    "preset=paper": {"preset": "paper"},
    "preset=paper, icm": {"preset": "paper", "relaxation": "icm", "pixel": "source"},
    "preset=paper, bandwidth=0.15": {"preset": "paper", "bandwidth": 0.15},
}
MULTIRES = {
    "alpha=0": {"alpha": 0.0},
    "alpha=0.05": {"alpha": 0.05},
    "alpha=0.1": {"alpha": 0.1},
    "alpha=0.2": {"alpha": 0.2},
    "default, alpha=0.3": {},
    "alpha=0.4": {"alpha": 0.4},
    "alpha=0.6": {"alpha": 0.6},
    "alpha=1": {"alpha": 1.0},
    "alpha=inf": {"alpha": np.inf},
    "alpha=1, beta=1": {"alpha": 1.0, "beta": 1.0},
    "alpha=4, beta=2": {"alpha": 4.0, "beta": 2.0},
    "alpha=8, beta=3": {"alpha": 8.0, "beta": 3.0},
    "parity=free": {"parity": "free"},
    "orientations=0": {"orientations": 0},
    "orientations=2": {"orientations": 2},
    "orientations=8": {"orientations": 8},
    "boundary=open": {"boundary": "open"},
}
PYRAMID = {
    "default": {},
    "iterations=1": {"iterations": 1},
    "iterations=2": {"iterations": 2},
    "iterations=10": {"iterations": 10},
    "iterations=20": {"iterations": 20},
    "iterations=100": {"iterations": 100},
    "pyramid=laplacian": {"pyramid": "laplacian"},
    "orientations=1": {"orientations": 1},
    "orientations=2": {"orientations": 2},
    "orientations=6": {"orientations": 6},
    "levels=1": {"levels": 1},
    "levels=2": {"levels": 2},
    "levels=3": {"levels": 3},
    "levels=5": {"levels": 5},
    "match=lookup": {"match": "lookup"},
    "edges=wrap": {"edges": "wrap"},
    "color=channels": {"color": "channels"},
}
IN_COLOUR = ("default", "coherence=0", "coherence=1", "balance=0", "structure=0", "order=8", "relaxation=gibbs")
"""Those of the exact search that are tried on samples in colour too."""

UNSEEN = {  # not on the sheets, where they look like others
    "orientations=2",
    "orientations=8",
    "xi=-2",
    "free_sweeps=0",
    "iterations=2",
    "iterations=10",
    "levels=3",
    "levels=5",
    "edges=wrap",
}
OF_MRF = ("plausibility", "coverage", "copying", "repeats", "salt", "contrast", "seam")
OF_OTHERS = ("plausibility", "coverage", "copying", "histogram_distance", "seam", "repetition")


def repetition(sample, made):
    """Correlation of a picture with itself displaced by the sample's rows, columns and both, the mean of the three."""
    rows, cols = sample.shape[:2]
    centred = made - made.mean((0, 1))
    ways = [np.roll(centred, by, (0, 1)) for by in ((rows, 0), (0, cols), (rows, cols))]
    return np.mean([(centred * displaced).mean() for displaced in ways]) / (centred**2).mean()


STUDIES = {"mrf": MRF, "exact": EXACT, "multires": MULTIRES, "pyramid": PYRAMID}
"""The settings of each study by its name, which its files have too."""


def tried(study, in_colour):
    """The settings to try in turn on samples with or without colours: label, options, seeds (None: as asked for)."""
    if study in ("multires", "pyramid"):
        yield "mrf", {"method": "mrf", "search": "exact"}, 1
    if study == "pyramid":
        yield "multires", {"method": "multires"}, 1
    for label, given in STUDIES[study].items():
        left_out = (study == "exact" and label not in IN_COLOUR) if in_colour else "color" in given
        if not left_out:
            yield label, own_options(study) | given, None


def own_options(study):
    """What a study passes on to name its method."""
    return {"method": "mrf", "search": "exact"} if study == "exact" else {"method": study}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--method", choices=STUDIES, default="mrf")
    parser.add_argument("--out", type=Path, help="docs/study unless given; needed with --samples")
    parser.add_argument("--seeds", type=int, help="1 with exact and 3 with others unless given")
    parser.add_argument("--only", default="")
    parser.add_argument("--device")
    parser.add_argument("--quick", action="store_true", help="small samples")
    parser.add_argument("--samples", type=Path, help="folder of pictures, each a sample")
    parser.add_argument("--after", default="", help="options as NAME=VALUE,NAME=VALUE; the defaults unless given")
    parser.add_argument("--before", help="other options, for the pictures to compare with")
    options = parser.parse_args()
    if options.samples:
        if options.out is None:
            parser.error("--samples needs --out, a folder for the pictures and the table")
        try:
            over_folder.main(options, own_options(options.method))
        except (ValueError, TypeError) as error:
            parser.error(str(error))
        return
    if options.before is not None or options.after:
        parser.error("--before and --after are for --samples; leave them out, or give a folder of samples")
    options.out = options.out or Path(__file__).parent.parent / "docs" / "study"
    study = options.method
    wanted = OF_MRF if study in ("mrf", "exact") else OF_OTHERS
    machine = simdtex.open_machine(options.device)
    print(f"device: {machine.name}")
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for name, sample in samples.chosen(None, options.only).items():
        if options.quick:
            sample = sample[: len(sample) // 2, : len(sample) // 2]
        pictures = [(name, sample)]
        for label, given, fixed in tried(study, sample.ndim == 3):
            seeds = range(1, (fixed or options.seeds or (1 if study == "exact" else 3)) + 1)
            runs = [over_folder.made(sample, name, label, seed, given, machine) for seed in seeds]
            found = [run.figures | {"repetition": repetition(sample, run.picture)} for run in runs]
            mean = [np.mean([figures[figure] for figures in found]) for figure in (*wanted, "seconds")]
            rows.append([name, label, *(f"{value:.2f}" for value in mean[:-1])])
            print(f"{name:8}{label:32}", *rows[-1][2:], f"{mean[-1]:.1f} s", flush=True)
            if label not in UNSEEN:
                pictures.append((label, runs[-1].picture))
        (options.out / f"{study}-{name}.png").write_bytes(png(contact_sheet(pictures, columns=4)))
    header = ["sample", "setting", *(figure.replace("_", " ") for figure in wanted)]
    tables.write(options.out / f"{study}.csv", header, rows)


if __name__ == "__main__":
    main()

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
import csv
import time
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import over_folder
import samples
from figures import further
from pyramid_figures import png

import simdtex
from simdtex.experiments.quality import measure
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
IN_COLOUR = ("default", "coherence=0", "coherence=1", "balance=0", "structure=0", "order=8", "relaxation=gibbs")
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
FIGURES = ("plausibility", "coverage", "copying", "histogram_distance", "seam")
OF_MRF = ("plausibility", "coverage", "copying", "repeats", "salt", "contrast", "seam")


def repetition(sample, made):
    """Correlation of a picture with itself displaced by the sample's rows, columns and both, the mean of the three."""
    rows, cols = sample.shape[:2]
    centred = made - made.mean((0, 1))
    ways = [np.roll(centred, by, (0, 1)) for by in ((rows, 0), (0, cols), (rows, cols))]
    return np.mean([(centred * displaced).mean() for displaced in ways]) / (centred**2).mean()


class Study(NamedTuple):
    """The settings of a method, those that colour or grey samples leave out, and what the files are called."""

    settings: dict
    skipped: dict
    figures: tuple
    seeds: int
    table: str
    prefix: str


STUDIES = {
    "mrf": Study(
        settings=MRF,
        skipped={"colour": [], "grey": []},
        figures=OF_MRF,
        seeds=3,
        table="mrf.csv",
        prefix="mrf-",
    ),
    "exact": Study(
        settings=EXACT,
        skipped={"colour": [setting for setting in EXACT if setting not in IN_COLOUR], "grey": []},
        figures=OF_MRF,
        seeds=1,
        table="exact.csv",
        prefix="exact-",
    ),
    "multires": Study(
        settings=MULTIRES,
        skipped={"colour": [], "grey": []},
        figures=(*FIGURES, "repetition"),
        seeds=3,
        table="multires.csv",
        prefix="multires-",
    ),
    "pyramid": Study(
        settings=PYRAMID,
        skipped={"colour": [], "grey": ["color=channels"]},
        figures=(*FIGURES, "repetition"),
        seeds=3,
        table="pyramid.csv",
        prefix="pyramid-",
    ),
}


def tried(method):
    """The settings to try in turn: label, options, seeds (None: as many as asked for)."""
    if method in ("multires", "pyramid"):
        yield "mrf", {"method": "mrf", "search": "exact"}, 1
    if method == "pyramid":
        yield "multires", {"method": "multires"}, 1
    own = own_options(method)
    for label, given in STUDIES[method].settings.items():
        yield label, own | given, None


def own_options(method):
    """What a study passes on to name its method."""
    return {"method": "mrf", "search": "exact"} if method == "exact" else {"method": method}


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
    study = STUDIES[options.method]
    machine = simdtex.open_machine(options.device)
    print(f"device: {machine.name}")
    options.out.mkdir(parents=True, exist_ok=True)
    known = {**samples.grey(), **samples.colour()}
    chosen = options.only.split(",") if options.only else list(known)
    rows = []
    for name in chosen:
        sample = known[name]
        if options.quick:
            sample = sample[: len(sample) // 2, : len(sample) // 2]
        in_colour = sample.ndim == 3
        pictures = [(name, sample)]
        for label, given, fixed in tried(options.method):
            setting = label
            if label in study.skipped["colour" if in_colour else "grey"]:
                continue
            figures, seconds = [], []
            for seed in range(1, (fixed or options.seeds or study.seeds) + 1):
                began = time.perf_counter()
                made = simdtex.synthesize(
                    sample,
                    (2 * sample.shape[0], 2 * sample.shape[1]),
                    channel_axis=-1 if in_colour else None,
                    rng=seed,
                    device=machine,
                    **given,
                )
                seconds.append(time.perf_counter() - began)
                found = {
                    **asdict(measure(sample, made)),
                    **further(sample, made),
                    "repetition": repetition(sample, made),
                }
                figures.append([found[figure] for figure in study.figures])
            mean = np.mean(figures, 0)
            rows.append([name, setting, *(f"{value:.2f}" for value in mean)])
            print(f"{name:8}{setting:32}", *rows[-1][2:], f"{np.mean(seconds):.1f} s", flush=True)
            if label not in UNSEEN:
                pictures.append((setting, made))
        (options.out / f"{study.prefix}{name}.png").write_bytes(png(contact_sheet(pictures, columns=4)))
    with open(options.out / study.table, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["sample", "setting", *(figure.replace("_", " ") for figure in study.figures)])
        writer.writerows(rows)


if __name__ == "__main__":
    main()

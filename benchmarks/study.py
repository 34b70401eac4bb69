# SPDX-License-Identifier: BSD-3-Clause
"""What the options of `mrf` do to a texture, by figures and for the eye.

    python benchmarks/study.py [--out docs/study] [--seeds 1] [--only brick,grass] [--device TEXT]

Writes table.csv (mean over the seeds) and one sheet of pictures per sample, and prints each line as it is made.
Outputs are twice the sample in each direction.
"""

import argparse
import csv
import time
from pathlib import Path

import numpy as np
import samples

import simdtex
from simdtex.quality import measure
from simdtex.report.sheet import contact_sheet

SETTINGS = {
    "default": {},
    "coherence=0": {"coherence": 0.0},
    "coherence=0.5": {"coherence": 0.5},
    "coherence=2": {"coherence": 2.0},
    "order=8": {"order": 8},
    "relaxation=gibbs": {"relaxation": "gibbs"},
    "free_sweeps=0": {"free_sweeps": 0},
    "edges=reflect": {"edges": "reflect"},
    "edges=whole": {"edges": "whole"},
    "phases=all": {"phases": "all", "levels": 4},
    "coarsest=same": {"coarsest": "same"},
    "pixel=density": {"pixel": "density"},
    "preset=paper": {"preset": "paper"},
    "preset=paper, icm": {"preset": "paper", "relaxation": "icm", "coarsest": "gibbs"},
    "preset=paper, bandwidth=0.15": {"preset": "paper", "bandwidth": 0.15},
}
IN_COLOUR = ("default", "coherence=0", "coherence=0.5", "coherence=2", "order=8", "relaxation=gibbs")
FIGURES = ("plausibility", "coverage", "copying", "histogram_distance", "seam")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent.parent / "docs" / "study")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--device")
    options = parser.parse_args()
    machine = simdtex.open_machine(options.device)
    print(f"device: {machine.name}")
    options.out.mkdir(parents=True, exist_ok=True)
    known = {**samples.grey(), **samples.colour()}
    chosen = options.only.split(",") if options.only else list(known)
    rows = []
    for name in chosen:
        sample = known[name]
        in_colour = sample.ndim == 3
        pictures = [(name, sample)]
        for setting, given in SETTINGS.items():
            if in_colour and setting not in IN_COLOUR:
                continue
            figures, seconds = [], []
            for seed in range(1, options.seeds + 1):
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
                figures.append([getattr(measure(sample, made), figure) for figure in FIGURES])
            mean = np.mean(figures, 0)
            rows.append([name, setting, *(f"{value:.2f}" for value in mean)])
            print(f"{name:8}{setting:32}", *rows[-1][2:], f"{np.mean(seconds):.1f} s", flush=True)
            pictures.append((setting, made))
        contact_sheet(pictures, options.out / f"{name}.png", columns=4)
    with open(options.out / "table.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["sample", "setting", *(figure.replace("_", " ") for figure in FIGURES)])
        writer.writerows(rows)


if __name__ == "__main__":
    main()

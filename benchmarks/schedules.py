# SPDX-License-Identifier: BSD-3-Clause
"""Every parallel schedule on brick, grass and gravel: what it costs, how it moves, what comes of it.

    python benchmarks/schedules.py [--out docs/schedules] [--seeds 3] [--size 128] [--free-sweeps 8] [--only brick]
                                   [--device TEXT]

Writes docs/study/schedules.csv (mean and standard deviation over the seeds) and, into docs/schedules, pictures and
plots for each sample, and prints tables. The options are those of ``simdtex synth`` but for the free sweeps: with
more of them, what oscillates is told from what still settles.
"""

import argparse
import csv
import time
from pathlib import Path

import samples

import simdtex
from simdtex.experiments.comparison import FIGURES, compare
from simdtex.report.page import Figure
from simdtex.report.schedules import sections, tables
from simdtex.report.tables import print_table

DOCS = Path(__file__).parent.parent / "docs"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=DOCS / "schedules")
    parser.add_argument("--table", type=Path, default=DOCS / "study" / "schedules.csv")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--free-sweeps", type=int, default=8)
    parser.add_argument("--only", default="")
    parser.add_argument("--device")
    options = parser.parse_args()
    machine = simdtex.open_machine(options.device, profile=True)
    print(f"device: {machine.name}")
    options.out.mkdir(parents=True, exist_ok=True)
    known = samples.grey()
    lines = []
    for name in options.only.split(",") if options.only else known:
        began = time.perf_counter()
        found = compare(
            known[name],
            (options.size, options.size),
            seeds=range(1, options.seeds + 1),
            device=machine,
            array="maspar-mp1-16k",
            free_sweeps=options.free_sweeps,
        )
        print(f"\n{name}, {time.perf_counter() - began:.0f} s\n")
        for table in tables(found):
            print_table(table, 220)
        figures = [part for section in sections(found) for part in section.parts if isinstance(part, Figure)]
        for figure in figures:
            # temperatures depend on the schedule and the seed, not on the pixels: one plot is every sample's
            if figure.file in ("pictures.png", "oscillation.png", "temperature.png"):
                prefix = "" if figure.file == "temperature.png" else f"{name}-"
                (options.out / f"{prefix}{figure.file}").write_bytes(figure.png)
        for entry in found.entries:
            figures = {figure: entry.figure(figure) for figure in FIGURES}
            cells = [cell for figure in FIGURES for cell in written(figures[figure])]
            lines.append([name, entry.name, "yes" if entry.independent else "no", *cells])
    with open(options.table, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        heads = [head for figure in FIGURES for head in (figure.replace("_", " "), f"{figure.replace('_', ' ')} +-")]
        writer.writerow(["sample", "schedule", "keeps (14)", *heads])
        writer.writerows(lines)


def written(spread):
    if spread is None:
        return ["", ""]
    return [f"{spread.mean:.5g}", "" if spread.deviation is None else f"{spread.deviation:.2g}"]


if __name__ == "__main__":
    main()

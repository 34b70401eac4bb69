# SPDX-License-Identifier: BSD-3-Clause
"""Every parallel schedule on brick, grass and gravel: what it costs, how it moves, what comes of it.

    python benchmarks/schedules.py [--out docs/schedules] [--seeds 3] [--size 128] [--free-sweeps 8] [--only brick]
                                   [--device TEXT]

Writes pictures and a table of figures (mean and standard deviation over the seeds) for each sample, plots and cost.csv
for the first one, and prints tables. The options are those of ``simdtex synth`` but for the free sweeps: with
more of them, what oscillates is told from what still settles.
"""

import argparse
import time
from pathlib import Path

import samples
from tables import write

import simdtex
from simdtex.experiments.comparison import compare
from simdtex.report.page import Figure
from simdtex.report.schedules import comparison_tables as tables
from simdtex.report.schedules import sections
from simdtex.report.tables import print_table

COST = {
    "steps": ("steps", "{:,.0f}", 1),
    "relaxations_per_site": ("relaxations per site", "{:.1f}", 1),
    "seconds": ("seconds, wall", "{:.1f}", 1),
    "device_seconds": ("seconds, device", "{:.1f}", 1),
    "model_seconds": ("MP-1, hours", "{:.1f}", 1 / 3600),
}
RESULT = {
    "oscillation_cooling": ("flip back, cooling, %", "{:.2f} ± {:.2f}", 100),
    "oscillation_free": ("flip back, free, %", "{:.2f} ± {:.2f}", 100),
    "plausibility": ("plausibility", "{:.2f} ± {:.2f}", 1),
    "coverage": ("coverage", "{:.2f} ± {:.2f}", 1),
    "histogram_distance": ("histogram", "{:.2f} ± {:.2f}", 1),
    "copying": ("copying", "{:.2f} ± {:.2f}", 1),
}
"""Columns of the tables by figure: heading, form of mean and deviation, and factor."""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent.parent / "docs" / "schedules")
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
    for number, name in enumerate(options.only.split(",") if options.only else known):
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
        # temperatures depend on the schedule and the seed, not on the pixels: one plot is every sample's
        plots = ("oscillation.png", "temperature.png") if number == 0 else ()
        for part in (part for section in sections(found) for part in section.parts if isinstance(part, Figure)):
            if part.file in ("pictures.png", *plots):
                (options.out / f"{'' if part.file in plots else f'{name}-'}{part.file}").write_bytes(part.png)
        header = ["schedule", *(heading for heading, *_ in RESULT.values())]
        write(options.out / f"{name}.csv", header, [[entry.name, *cells(entry, RESULT)] for entry in found.entries])
        if number == 0:
            rows = [[one.name, "yes" if one.independent else "no", *cells(one, COST)] for one in found.entries]
            write(options.out / "cost.csv", ["schedule", "keeps (14)", *(head for head, *_ in COST.values())], rows)


def cells(entry, columns):
    """The cells of a schedule in some columns."""
    found = [(entry.figure(name), form, factor) for name, (_, form, factor) in columns.items()]
    return [one and form.format(factor * one.mean, factor * (one.deviation or 0)) for one, form, factor in found]


if __name__ == "__main__":
    main()

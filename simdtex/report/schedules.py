# SPDX-License-Identifier: BSD-3-Clause
"""The report of a comparison of schedules: pictures, plots and tables, on a page and on the terminal."""

from __future__ import annotations

import os
from collections.abc import Sequence
from math import floor, log10
from typing import Any, NamedTuple

import rich.table

from simdtex import __version__
from simdtex.experiments.comparison import Comparison, Entry, Spread
from simdtex.report import schedule_plots as plots
from simdtex.report.page import Figure, Section, Table, Text, write_report

__all__ = ["mark", "sections", "terminal_tables", "write_comparison"]

LEAST_FREE = 6  # free sweeps from which on an oscillation can be told from settling


class Form(NamedTuple):
    """How a number is written: ``digits`` behind the point, None for three figures in all; a factor and a unit."""

    digits: int | None = None
    factor: float = 1.0
    unit: str = ""

    def __call__(self, value: float, deviation: float | None = None) -> str:
        """The number, and its standard deviation to as many digits."""
        value *= self.factor
        digits = self.digits
        if digits is None:
            exact = value == int(value) and not deviation
            digits = 0 if value >= 99.5 or exact else 2 - min(2, max(-2, floor(log10(abs(value))) if value else 0))
        spread = "" if deviation is None else f" ± {deviation * self.factor:,.{digits}f}"
        return f"{value:,.{digits}f}{spread}{self.unit}"


FIGURES, PERCENT, THREE, TWO = Form(), Form(2, 100, " %"), Form(3), Form(2)


class Column(NamedTuple):
    """A column of the tables: a figure of `FIGURES` of the comparison, its heads on the page and the terminal."""

    figure: str
    head: str
    short: str
    form: Form = FIGURES


EQUILIBRIUM = (
    Column("steps", "Steps", "steps"),
    Column("sweeps", "Sweeps", "sweeps"),
    Column("relaxations_per_site", "Relaxations per site", "relax. per site"),
    Column("all_steps", "Steps, all levels", "steps, all levels"),
    Column("all_sweeps", "Sweeps, all levels", "sweeps, all levels"),
    Column("all_relaxations_per_site", "Relaxations per site, all levels", "relax., all levels"),
)
TIMES = (
    Column("seconds", "Wall time, s", "wall s"),
    Column("device_seconds", "Device time, s", "device s"),
    Column("passes", "SIMD steps", "passes"),
    Column("utilisation", "Utilisation", "utilis.", PERCENT),
    Column("model_seconds", "MP-1 by the model, s", "MP-1 s"),
)
MOVES = (
    Column("changed_cooling", "Changed a sweep, cooling", "changed, cooling", PERCENT),
    Column("oscillation_cooling", "Oscillation, cooling", "oscill., cooling", PERCENT),
    Column("changed_free", "Changed, last free sweep", "changed, free", PERCENT),
    Column("oscillation_free", "Oscillation, last free sweep", "oscill., free", PERCENT),
)
QUALITY = (
    Column("plausibility", "Plausibility", "plausib.", THREE),
    Column("coverage", "Coverage", "coverage", THREE),
    Column("histogram_distance", "Histogram distance", "histogram", THREE),
    Column("copying", "Copying", "copying", THREE),
    Column("seam", "Seam", "seam", TWO),
)


ABOUT_EQUILIBRIUM = "A sweep relaxes as many sites as were still warm when it began. Free sweeps are not counted."
ABOUT_TIMES = (
    "Wall time is without what watching the run took; device time is that spent in kernels. Utilisation is the mean "
    "share of PEs with a site to relax, over the SIMD steps. The model counts the arithmetic of the distances and the "
    "fetching of neighbourhoods only."
)
ABOUT_MOVES = (
    "Changed: another value than a sweep ago. Oscillation: another value than a sweep ago, and the same as two sweeps "
    "ago. Cooling: mean over the sweeps until equilibrium. In a free sweep all sites relax, those long cold too."
)
ABOUT_QUALITY = (
    "Plausibility, coverage and histogram distance are in sample standard deviations, 0 is best. Copying is the share "
    "of 9 x 9 patches that stand in the sample to the last bit. A seam of 1 does not show."
)


def mark(entry: Entry) -> str:
    """What every table says of a schedule and equation (14)."""
    if entry.caught:
        return "breaks (14), against its claim"
    return "keeps (14)" if entry.independent else "breaks (14)"


def write_comparison(folder: str | os.PathLike[str], comparison: Comparison, command: str = "") -> None:
    """Write the report of a comparison: ``index.html``, PNG pictures and plots, ``results.json``.

    Parameters
    ----------
    folder : path
        See `simdtex.report.page.check_folder`.
    comparison : Comparison
    command : str
        The command line to show, where there was one.

    Raises
    ------
    ValueError
        The folder cannot be written.
    """
    height, width = comparison.shape
    rows, cols = plots.channels_last(comparison, comparison.sample).shape[:2]
    seeds = len(comparison.seeds)
    lead = (
        f"{len(comparison.entries)} schedules do the same job, {width} x {height} pixels from a sample of "
        f"{cols} x {rows}, with {seeds} {'seeds' if seeds > 1 else 'seed'} each. A schedule says which sites relax "
        "together. Equation (14) asks that no two of them are neighbours; every table says who breaks it."
    )
    results = {**comparison.results(), "version": __version__, "command": command}
    write_report(folder, "Parallel schedules compared", lead, sections(comparison, command), results)


def sections(comparison: Comparison, command: str = "") -> list[Section]:
    """The parts of the page."""
    entries = comparison.entries
    note = "Hollow markers and dashed lines: breaks (14)."
    seeds = f" Mean ± standard deviation over {len(comparison.seeds)} seeds." if len(comparison.seeds) > 1 else ""
    array = entries[0].runs[0].accounting
    pictures: list[Text | Table | Figure] = [
        Figure(
            "The sample, and what each schedule makes of it with the first seed.",
            plots.first_seed(comparison),
            "The sample and one picture for each schedule",
            "pictures.png",
        )
    ]
    if len(comparison.seeds) > 1:
        every = Figure(
            "All seeds, one a row.", plots.all_seeds(comparison), "A picture for each seed and schedule", "seeds.png"
        )
        pictures.append(every)
    return [
        Section("What to look at", [Text(reading(comparison))]),
        Section("Pictures", pictures),
        Section(
            "Until equilibrium",
            [
                _table(
                    comparison,
                    "Of the finest level, and of all levels together, until no temperature was left",
                    EQUILIBRIUM,
                    f"{ABOUT_EQUILIBRIUM}{_by_level(entries)}{seeds}",
                ),
                Figure(
                    f"Mean temperature left at the finest level after every sweep, against steps. {note}",
                    plots.temperature(comparison),
                    "Curves of the temperature left against step",
                    "temperature.png",
                ),
            ],
        ),
        Section(
            "Time and the processor array",
            [
                _table(
                    comparison,
                    f"Whole runs, on {comparison.device} and by a model of the {_array_name(array)}",
                    TIMES,
                    f"{ABOUT_TIMES}{seeds}",
                ),
                Figure(
                    f"Parallelism and what it costs. Short strokes are single seeds. {note}",
                    plots.costs(comparison),
                    "Steps, wall time, utilisation and model time of each schedule",
                    "costs.png",
                ),
            ],
        ),
        Section(
            "How the picture moves",
            [
                _table(
                    comparison,
                    "Share of the finest level's pixels, a sweep",
                    MOVES,
                    f"{ABOUT_MOVES}{_few_free(comparison)}{seeds}",
                ),
                Figure(
                    f"Pixels that change, sweep by sweep; markers are free sweeps. {note}",
                    plots.per_sweep(comparison, "changed", "Share of pixels that changed"),
                    "Curves of the share of pixels that changed in each sweep",
                    "changed.png",
                ),
                Figure(
                    f"Pixels that return to their value before last; markers are free sweeps. {note}",
                    plots.per_sweep(comparison, "returned", "Oscillation index"),
                    "Curves of the oscillation index of each sweep",
                    "oscillation.png",
                ),
            ],
        ),
        Section(
            "Against the sample",
            [
                _table(
                    comparison,
                    "Figures of merit of the outputs",
                    QUALITY,
                    f"{ABOUT_QUALITY}{seeds}",
                ),
                Figure(
                    f"Mean and standard deviation over the seeds. Short strokes are single seeds. {note}",
                    plots.qualities(comparison),
                    "Figures of merit of each schedule with their spread",
                    "quality.png",
                ),
            ],
        ),
        Section("The job", _job(comparison, command)),
    ]


# ---------------------------------------------------------------- text and tables


def reading(comparison: Comparison) -> str:
    """What to look at: a few sentences with their numbers from the results."""
    entries = comparison.entries
    keeps = [entry.name for entry in entries if entry.independent]
    breaks = [entry.name for entry in entries if not entry.independent]
    said = []
    if keeps:
        verb = "keep" if len(keeps) > 1 else "keeps"
        said.append(f"{_listed(keeps)} {verb} equation (14), which was checked at every step.")
    if breaks:
        verb = "break" if len(breaks) > 1 else "breaks"
        said.append(f"{_listed(breaks)} {verb} it: neighbours relax at once, or one sees an old value of the other.")
    still = ("oscillation_cooling", "Pixels that flip back in a sweep, until equilibrium")
    if comparison.options["free_sweeps"] >= LEAST_FREE:
        still = ("oscillation_free", "Pixels that still flip back in the last free sweep")
    parts = [
        " ".join(said),
        _extremes(entries, "steps", "Parallelism: steps until equilibrium at the finest level"),
        _extremes(entries, "seconds", "Wall time of a run on this device, in seconds"),
        _extremes(entries, *still, PERCENT),
        *(_gap(entries, key, what) for key, what in (("plausibility", "Plausibility"), ("coverage", "Coverage"))),
    ]
    return "\n\n".join(part for part in parts if part)


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:-1]) + " and " * (len(names) > 1) + names[-1]


def _ranked(entries: Sequence[Entry], figure: str) -> list[tuple[str, Spread]]:
    found = [(entry.name, entry.figure(figure)) for entry in entries]
    return sorted(((name, spread) for name, spread in found if spread), key=lambda pair: pair[1].mean)


def _extremes(entries: Sequence[Entry], figure: str, what: str, form: Form = FIGURES) -> str:
    ranked = _ranked(entries, figure)
    if len(ranked) < 2:
        return ""
    (low, least), (high, most) = ranked[0], ranked[-1]
    return f"{what}: least with {low} ({form(least.mean)}), most with {high} ({form(most.mean)})."


def _gap(entries: Sequence[Entry], figure: str, what: str) -> str:
    """The best and the worst, and whether seeds differ as much."""
    ranked = _ranked(entries, figure)
    if len(ranked) < 2:
        return ""
    (low, least), (high, most) = ranked[0], ranked[-1]
    said = f"{what}: best with {low} ({least.mean:.3f}), worst with {high} ({most.mean:.3f})."
    deviations = [spread.deviation for _, spread in ranked if spread.deviation is not None]
    if not deviations:
        return f"{said} One seed does not say how much of that is chance."
    gap, chance = most.mean - least.mean, max(deviations)
    verdict = "no more than seeds of one schedule differ" if gap <= 2 * chance else "more than seeds of one schedule do"
    return f"{said} They differ by {gap:.3f}, {verdict} (standard deviation up to {chance:.3f})."


def _cell(entry: Entry, column: Column, *, spread: bool = True) -> str:
    found = entry.figure(column.figure)
    if found is None:
        return "n/a"
    return column.form(found.mean, found.deviation if spread else None)


def _table(comparison: Comparison, caption: str, columns: Sequence[Column], note: str) -> Table:
    header = ["Schedule", "Equation (14)", *(column.head for column in columns)]
    rows = [[entry.name, mark(entry), *(_cell(entry, column) for column in columns)] for entry in comparison.entries]
    return Table(caption, header, rows, note)


def _by_level(entries: Sequence[Entry]) -> str:
    """Who keeps equation (14) at some levels only."""
    said = []
    for entry in entries:
        kept = [str(level) for level, claim in enumerate(reversed(entry.claims)) if claim]
        if kept and len(kept) < len(entry.claims) and not entry.caught:
            said.append(f" At level {_listed(kept)} {entry.name} keeps equation (14).")
    return "".join(said)


def _few_free(comparison: Comparison) -> str:
    free = int(comparison.options["free_sweeps"])
    if free >= LEAST_FREE:
        return ""
    return (
        f" With {free} free sweep{'s' * (free != 1)} what still settles is not told from what oscillates; "
        f"{LEAST_FREE} or more tell."
    )


def _array_name(accounting: dict[str, Any]) -> str:
    if accounting["mapping"] == "packed":
        return f"{accounting['array']} PEs of a MasPar MP-1, active sites packed"
    return f"{accounting['array']} PEs of a MasPar MP-1, {accounting['mapping']}"


def _job(comparison: Comparison, command: str) -> list[Text | Table | Figure]:
    about = {
        "simdtex": __version__,
        "device": comparison.device,
        "seeds": ", ".join(map(str, comparison.seeds)),
        "sample": " x ".join(map(str, comparison.sample.shape)) + f", {comparison.sample.dtype}",
        "output": " x ".join(map(str, comparison.shape)) + " (rows x columns)",
        **{name: str(value) for name, value in comparison.options.items()},
    }
    shown: list[Text | Table | Figure] = [Text(f"$ {command}")] if command else []
    return [*shown, Table("The same for every schedule", ["What", "Value"], [[k, v] for k, v in about.items()])]


COMPACT = (
    *EQUILIBRIUM[:4],
    EQUILIBRIUM[5],
    *(column for column in TIMES if column.figure != "passes"),
    *MOVES[1:],
    *QUALITY[:4],
)


def terminal_tables(comparison: Comparison, width: int) -> list[rich.table.Table]:
    """One line for each schedule: in one table where the terminal is wide enough, else in several.

    Parameters
    ----------
    comparison : Comparison
    width : int
        Of the terminal, characters.
    """
    spread = {column.figure for column in QUALITY}
    names = [entry.name for entry in comparison.entries]
    marks = ["yes" if e.independent else "NO, but claims to" if e.caught else "NO" for e in comparison.entries]
    room = width - max(map(len, ["schedule", *names])) - max(map(len, ["keeps (14)", *marks])) - 4
    pages: list[list[tuple[Column, list[str]]]] = [[]]
    used = 0
    for column in COMPACT:
        cells = [_cell(entry, column, spread=column.figure in spread) for entry in comparison.entries]
        wide = 2 + _width(column, cells)
        if pages[-1] and used + wide > room:
            pages.append([])
            used = 0
        pages[-1].append((column, cells))
        used += wide
    tables = []
    for page in pages:
        table = rich.table.Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
        table.add_column("schedule", no_wrap=True)
        table.add_column("keeps (14)", no_wrap=True)
        for column, cells in page:
            table.add_column(column.short, justify="right", width=_width(column, cells))
        for place, name in enumerate(names):
            style = None if marks[place] == "yes" else "yellow"
            table.add_row(name, marks[place], *(cells[place] for _, cells in page), style=style)
        tables.append(table)
    return tables


def _width(column: Column, cells: Sequence[str]) -> int:
    return max(map(len, [*cells, *column.short.split()]))  # heads wrap, cells do not

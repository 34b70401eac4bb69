# SPDX-License-Identifier: BSD-3-Clause
"""The report of the Ising experiment: which schedules sample the right distribution, in tables and pictures."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import rich.box
import rich.table
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Plot
from numpy.typing import NDArray

from simdtex.experiments.comparison import Spread
from simdtex.experiments.estimates import FAIR, LEVEL, Estimate, Finding
from simdtex.experiments.ising import Chains
from simdtex.experiments.onsager import CRITICAL
from simdtex.report.page import Figure, Section, Table, Text, write_report
from simdtex.report.plots import INK, dots, figure_png, named_rows, new_figure, styles, tidy

__all__ = ["conclusion", "results", "terminal_tables", "write_ising"]

HEAD = ("Schedule", "(14)", "Verdict", "Energy", "Sigma", "|m|", "Staggered", "Neighbours", "τ energy", "τ |m|")


def terminal_tables(found: Sequence[Finding], width: int) -> list[rich.table.Table]:
    """One table for each temperature, without the columns that matter least where not all fit the width."""
    cells = [_cells(one) for one in found]
    wide = [max(len(text) for text in column) + 3 for column in zip(HEAD, *cells, strict=True)]
    shown = list(range(len(HEAD)))
    for name in ("Staggered", "τ |m|", "τ energy", "Neighbours", "|m|", "(14)"):
        if sum(wide[k] for k in shown) > width - 2:
            shown.remove(HEAD.index(name))
    tables = []
    for temperature, rows in _by_temperature(found).items():
        title = f"T = {temperature:g}: {_known(rows[0])}"
        table = rich.table.Table(title=title, title_justify="left", box=rich.box.SIMPLE)
        for k in shown:
            table.add_column(HEAD[k], justify="left" if k < 3 else "right", no_wrap=True)
        for row in rows:
            table.add_row(*(_cells(row)[k] for k in shown), style="red" if row.differs else "")
        tables.append(table)
    return tables


def conclusion(found: Sequence[Finding]) -> list[str]:
    """What the whole table says: a sentence each of the schedules that agree everywhere and of those that do not."""
    names = list(dict.fromkeys(one.schedule for one in found))
    wrong = [name for name in names if any(one.differs for one in found if one.schedule == name)]
    right = [name for name in names if name not in wrong]
    said = []
    if right:
        said.append(f"No deviation from the Ising model at any temperature: {', '.join(right)}.")
    if wrong:
        said.append(f"Something else is sampled by: {', '.join(wrong)}.")
    odd = [name for name in names if (name in wrong) == next(o.independent for o in found if o.schedule == name)]
    if odd:
        said.append(
            f"Against what equation (14) lets expect: {', '.join(odd)}. More sweeps or a longer burn-in may tell."
        )
    return said


def results(found: Sequence[Finding], runs: Sequence[Chains], settings: dict[str, Any]) -> dict[str, Any]:
    """The numbers, for JSON; only ``seconds`` differ from run to run."""
    return {
        "settings": settings,
        "findings": [
            vars(one) | {n: vars(e) for n, e in vars(one).items() if isinstance(e, Estimate)} for one in found
        ],
        "runs": {
            run.schedule: {
                "independent": run.independent,
                "steps": run.steps,
                "relaxations": run.relaxations,
                "launches": run.launches,
                "seconds": run.seconds,
            }
            for run in runs
        },
        "conclusion": conclusion(found),
    }


def write_ising(
    folder: str | os.PathLike[str],
    found: Sequence[Finding],
    runs: Sequence[Chains],
    pictures: Sequence[Chains],
    settings: dict[str, Any],
    command: str,
) -> None:
    """Write the report.

    Parameters
    ----------
    folder : path
        See `simdtex.report.page.check_folder`.
    found : sequence of Finding
        Of `runs`.
    runs : sequence of Chains
    pictures : sequence of Chains
        One chain each, at one temperature, from a random start.
    settings : dict
        Of the experiment; written to ``results.json``.
    command : str
        The command line.
    """
    sections = [
        Section("What was found", [Text("\n\n".join(conclusion(found))), *_tables(found), _energy(found)]),
        Section("Magnetisation and autocorrelation", [_magnetisation(found), _autocorrelation(found)]),
        Section("Two interleaved lattices", [_lagged(found), _lattices(pictures)]),
        Section("How it was run", [Text(f"$ {command}"), _cost(runs, settings)]),
    ]
    lead = (
        "Heat-bath Ising spins are relaxed by each schedule, and the energy per spin is held against its exact value "
        "on this very torus (Kaufman 1949). The conditional distributions are those of the Ising model under every "
        "schedule, so whatever deviates is the schedule's doing."
    )
    write_report(folder, "Which schedules sample the Ising model?", lead, sections, results(found, runs, settings))


# ---------------------------------------------------------------- tables


def _by_temperature(found: Sequence[Finding]) -> dict[float, list[Finding]]:
    rows: dict[float, list[Finding]] = {}
    for one in found:
        rows.setdefault(one.temperature, []).append(one)
    return rows


def _known(one: Finding) -> str:
    known = f"exact energy {one.exact_energy:.5f} on this torus, {one.onsager_energy:.5f} on the infinite lattice"
    if one.temperature < CRITICAL:
        known += f"; magnetisation there {one.yang_magnetisation:.4f}"
    return known


def _cells(one: Finding) -> list[str]:
    m = one.magnetisation
    return [
        one.schedule,
        "keeps" if one.independent else "breaks",
        one.verdict,
        f"{one.energy.mean:.5f} ± {one.energy.error:.5f}",
        f"{one.energy_sigmas:+.1f}",
        f"{m.mean:.4f} ± {m.error:.4f}",
        f"{one.staggered:.3f}",
        f"{one.neighbours:z.3f}",
        f"{one.energy.tau:.0f}",
        f"{m.tau:.0f}",
    ]


def _tables(found: Sequence[Finding]) -> list[Table]:
    note = (
        "Errors are one standard error: the larger of that of the chains' means and that of all sweeps with their "
        "autocorrelation time τ, which is in sweeps. Sigma: deviation from the exact energy in errors. Staggered: mean "
        "of |m_even - m_odd| / 2. Neighbours: correlation of neighbouring spins beyond what the magnetisations of "
        "their sublattices make of it; 0 where even and odd sites know nothing of one another. Differs: Student's t "
        f"gives the deviation a probability below {LEVEL:g} over the number of comparisons, in the energy or, below "
        f"T_c where sides are {FAIR} correlation lengths, in |m|. Agrees: it does not."
    )
    tables = [
        Table(f"T = {temperature:g}: {_known(rows[0])}", HEAD, [_cells(row) for row in rows])
        for temperature, rows in _by_temperature(found).items()
    ]
    return [*tables[:-1], Table(tables[-1].caption, tables[-1].header, tables[-1].rows, note)]


def _lagged(found: Sequence[Finding]) -> Table:
    contrast = next((one.schedule for one in found if one.independent), None)
    rows = [
        [
            one.schedule,
            f"{one.temperature:g}",
            f"{one.energy.mean:.5f} ± {one.energy.error:.5f}",
            f"{one.lagged.mean:.5f} ± {one.lagged.error:.5f}",
            f"{one.exact_energy:.5f}",
            f"{one.neighbours:z.4f}",
        ]
        for one in found
        if not one.independent or one.schedule == contrast
    ]
    note = (
        "Across a sweep, one spin of each bond is taken before it and the other after. Under the synchronous schedule "
        "on even sides that is where the Ising model is: even sites now and odd sites then are one lattice, odd sites "
        "now and even sites then another, and the two never meet. For other schedules the "
        "column means nothing in particular."
    )
    header = ("Schedule", "T", "Energy at one time", "Energy across a sweep", "Exact", "Neighbours")
    return Table("Energy at one time and across a sweep", header, rows, note)


def _cost(runs: Sequence[Chains], settings: dict[str, Any]) -> Table:
    rows = [
        [run.schedule, f"{run.steps:,}", f"{run.relaxations:,}", f"{run.launches:,}", f"{run.seconds:.1f}"]
        for run in runs
    ]
    note = ", ".join(f"{name.replace('_', ' ')} {_text(value)}" for name, value in settings.items())
    return Table("Work", ("Schedule", "Steps", "Relaxations in a chain", "Launches", "Seconds"), rows, note)


def _text(value: Any) -> str:
    return " and ".join(_text(v) for v in value) if isinstance(value, (list, tuple)) else f"{value}"


# ---------------------------------------------------------------- pictures


def _panels(found: Sequence[Finding], wide: float = 3.6) -> tuple[Plot, dict[float, tuple[Axes, list[Finding]]]]:
    """A panel for each temperature, a row for each schedule."""
    by = _by_temperature(found)
    names = [one.schedule for one in next(iter(by.values()))]
    figure = new_figure(1.4 + wide * len(by), max(2.4, 1.1 + 0.32 * len(names)))
    axes = figure.subplots(1, len(by), sharey=True, squeeze=False)[0]
    named_rows(axes[0], names)
    axes[0].set_ylim(len(names) - 0.5, -0.5)
    return figure, {t: (panel, rows) for panel, (t, rows) in zip(axes, by.items(), strict=True)}


def _bars(axes: Axes, rows: Sequence[Finding], means: Sequence[float], errors: Sequence[float]) -> None:
    looks = styles({row.schedule: row.independent for row in rows})
    found = [Spread(mean, error, ()) for mean, error in zip(means, errors, strict=True)]
    dots(axes, dict(zip(looks, found, strict=True)), looks)


def _energy(found: Sequence[Finding]) -> Figure:
    figure, panels = _panels(found)
    for t, (axes, rows) in panels.items():
        axes.axvline(0, color=INK, linewidth=1)
        axes.set_xscale("symlog", linthresh=0.02)
        _bars(axes, rows, [r.energy.mean - r.exact_energy for r in rows], [r.energy.error for r in rows])
        tidy(axes, f"T = {t:g}", "energy per spin, minus the exact one")
        most = 2 * max([0.02, *(abs(r.energy.mean - r.exact_energy) for r in rows)])
        axes.set_xlim(-most, most)
        ticks = [tick for tick in (-1.0, -0.1, -0.01, 0.0, 0.01, 0.1, 1.0) if abs(tick) <= most]
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    return Figure(
        "Deviation from the exact energy, with one standard error; the scale is linear up to 0.02 and logarithmic "
        "beyond. Hollow: schedules that break equation (14).",
        figure_png(figure),
        f"For each temperature, each schedule's deviation from the exact energy. {' '.join(conclusion(found))}",
        "energy.png",
    )


def _magnetisation(found: Sequence[Finding]) -> Figure:
    figure, panels = _panels(found)
    for t, (axes, rows) in panels.items():
        axes.axvline(rows[0].yang_magnetisation, color=INK, linewidth=1, linestyle="-" if rows[0].fair else ":")
        _bars(axes, rows, [r.magnetisation.mean for r in rows], [r.magnetisation.error for r in rows])
        tidy(axes, f"T = {t:g}", "|m|")
        axes.locator_params(axis="x", nbins=4)
    return Figure(
        "Mean of |m|, with one standard error. The line is the spontaneous magnetisation of the infinite lattice, "
        "dotted where this lattice is too small to be held against it: |m| of a finite lattice is above 0 at any "
        "temperature.",
        figure_png(figure),
        "For each temperature, the mean of |m| of each schedule.",
        "magnetisation.png",
    )


def _autocorrelation(found: Sequence[Finding]) -> Figure:
    figure, panels = _panels(found)
    for t, (axes, rows) in panels.items():
        looks = styles({row.schedule: row.independent for row in rows})
        for place, row in enumerate(rows):
            look = looks[row.schedule]
            times = (row.energy.tau, row.magnetisation.tau)
            axes.plot(times, (place, place), color=look.color, linewidth=0.8, alpha=0.5)
            axes.plot(times[0], place, look.marker, color=look.color, markersize=6)
            axes.plot(times[1], place, look.marker, color=look.color, markersize=6, markerfacecolor="white")
        axes.set_xscale("log")
        tidy(axes, f"T = {t:g}", "sweeps")
        high = 1.5 * max(max(row.energy.tau, row.magnetisation.tau) for row in rows)
        axes.set_xlim(0.8, high)  # no time is below 1
        ticks = [tick for tick in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000) if tick <= high]
        axes.set_xticks(ticks, [f"{tick}" for tick in ticks])
        axes.minorticks_off()
    return Figure(
        "Integrated autocorrelation time of the energy (filled) and of |m| (hollow): sweeps that pass until a sample "
        "is worth a new one.",
        figure_png(figure),
        "For each temperature, the autocorrelation times of each schedule.",
        "autocorrelation.png",
    )


def _lattices(pictures: Sequence[Chains]) -> Figure:
    figure = new_figure(1.9 * max(2, len(pictures)) + 0.8, 6.3)
    axes = figure.subplots(3, len(pictures), squeeze=False)
    for column, run in enumerate(pictures):
        spins = run.spins[0, 0]
        for row, picture in enumerate((spins, *(_sublattice(spins, odd) for odd in (0, 1)))):
            panel = axes[row, column]
            panel.imshow(picture, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
            panel.set_xticks([])
            panel.set_yticks([])
        axes[0, column].set_title(run.schedule, fontsize=10, color=INK)
    for row, name in enumerate(("all spins", "even sites", "odd sites")):
        axes[row, 0].set_ylabel(name, color=INK)
    sweeps, temperature = pictures[0].energy.shape[-1], pictures[0].temperatures[0]
    return Figure(
        f"Spins after {sweeps} sweeps from a random start at T = {temperature:g}, white up; below them the sites of "
        "each sublattice alone, row + column even and odd, each drawn two sites wide. Where a schedule is right, both "
        "show the same domains. The synchronous schedule's are two lattices that have nothing to do with one another, "
        "and where they disagree all spins together are a checkerboard.",
        figure_png(figure),
        "The spins of each schedule, and of its two sublattices apart.",
        "lattices.png",
    )


def _sublattice(spins: NDArray[np.uint8], odd: int) -> NDArray[np.uint8]:
    """The sites of one parity, each drawn over itself and the site to its right."""
    row, col = np.indices(spins.shape)
    there: NDArray[np.uint8] = spins[row, np.clip(col - (row + col + odd) % 2, 0, None)]
    first = (col == 0) & ((row + odd) % 2 == 1)  # what belongs to it lies to the right
    there[first] = np.roll(spins, -1, 1)[first]
    return there

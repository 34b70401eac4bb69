# SPDX-License-Identifier: BSD-3-Clause
"""The report of the Ising experiment: which schedules sample the right distribution."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.experiments.estimates import LEVEL, Finding
from simdtex.experiments.ising import Chains
from simdtex.report.page import Figure, Section, write_report
from simdtex.report.plots import INK, new_figure, styles, tidy
from simdtex.report.tables import Table

ERRORS = (
    "Errors are one standard error of the chains' means. Sigma: deviation from the exact energy in errors. |m|: mean "
    "absolute magnetisation. Neighbours: correlation of neighbouring spins beyond the product of the magnetisations of "
    "their sublattices; 0 if even and odd sites are independent of one another. Differs: Student's t gives the "
    f"deviation a probability below {LEVEL:g} over the number of comparisons. Agrees: it does not."
)


def conclusion(found: Sequence[Finding]) -> list[str]:
    """Return a sentence each on the schedules that agree everywhere and on those that do not."""
    keeps = {one.schedule: one.independent for one in found}
    wrong = [name for name in keeps if any(one.differs for one in found if one.schedule == name)]
    right = [name for name in keeps if name not in wrong]
    odd = [name for name in keeps if keeps[name] == (name in wrong)]
    said = {
        "No deviation from the Ising model at any temperature: {}.": right,
        "Something else is sampled by: {}.": wrong,
        "Against the expectation from equation (14): {}. More sweeps or a longer burn-in may decide.": odd,
    }
    return [sentence.format(", ".join(names)) for sentence, names in said.items() if names]


def results(found: Sequence[Finding], runs: Sequence[Chains], settings: dict[str, Any]) -> dict[str, Any]:
    """Return the numbers for JSON; only ``seconds`` differ from run to run."""
    counts = ("independent", "steps", "relaxations", "launches", "seconds")
    return {
        "settings": settings,
        "findings": [vars(one) for one in found],
        "runs": {run.schedule: {name: getattr(run, name) for name in counts} for run in runs},
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

    ``found`` are the findings of ``runs``; ``pictures`` have one chain each, at one temperature, from a random start;
    and the ``settings`` of the experiment are written to ``results.json``.
    """
    sections = [
        Section("Result", ["\n\n".join(conclusion(found)), *tables(found), _energy(found)]),
        Section("Two interleaved lattices", [_lattices(pictures)]),
        Section("The runs", [_work(runs, settings)]),
    ]
    lead = (
        "Heat-bath Ising spins are relaxed by each schedule, and the energy per spin is compared with its exact value "
        "on this very torus (Kaufman 1949). The conditional distributions are those of the Ising model under every "
        "schedule, so any deviation is due to the schedule."
    )
    write_report(
        folder, "Which schedules sample the Ising model?", lead, sections, results(found, runs, settings), command
    )


def tables(found: Sequence[Finding]) -> list[Table]:
    """Return a table of the schedules for each temperature."""
    groups = _by_temperature(found)
    return [
        Table(
            f"T = {t:g}: exact energy {rows[0].exact:.5f} on this torus",
            [_row(one) for one in rows],
            ERRORS if t == groups[-1][0] else "",
        )
        for t, rows in groups
    ]


def _by_temperature(found: Sequence[Finding]) -> list[tuple[float, list[Finding]]]:
    return [(t, list(rows)) for t, rows in groupby(found, key=lambda one: one.temperature)]


def _row(one: Finding) -> dict[str, str]:
    return {
        "Schedule": one.schedule,
        "(14)": "keeps" if one.independent else "breaks",
        "Verdict": one.verdict,
        "Energy": f"{one.energy:.5f} ± {one.error:.5f}",
        "Sigma": f"{one.sigmas:+.1f}",
        "|m|": f"{one.magnetisation:.4f}",
        "Neighbours": f"{one.neighbours:z.3f}",
    }


def _work(runs: Sequence[Chains], settings: dict[str, Any]) -> Table:
    rows = [
        {
            "Schedule": run.schedule,
            "Steps": f"{run.steps:,}",
            "Relaxations in a chain": f"{run.relaxations:,}",
            "Launches": f"{run.launches:,}",
            "Seconds": f"{run.seconds:.1f}",
        }
        for run in runs
    ]
    texts = {k: " and ".join(map(str, v)) if isinstance(v, (list, tuple)) else v for k, v in settings.items()}
    return Table("Work", rows, ", ".join(f"{name.replace('_', ' ')} {text}" for name, text in texts.items()))


def _energy(found: Sequence[Finding]) -> Figure:
    groups = _by_temperature(found)
    looks = styles({row.schedule: row.independent for row in found})
    plot = new_figure(1.4 + 3.6 * len(groups), 1.65 + 0.32 * len(looks))
    for axes, (t, rows) in zip(plot.subplots(1, len(groups), sharey=True, squeeze=False)[0], groups, strict=True):
        off = [row.energy - row.exact for row in rows]
        axes.axvline(0, color=INK, linewidth=1)
        axes.set_xscale("symlog", linthresh=0.02)
        for place, (row, deviation) in enumerate(zip(rows, off, strict=True)):
            style = looks[row.schedule]
            axes.errorbar(deviation, place, xerr=row.error, **style, markersize=8, elinewidth=1.6, capsize=3)
        most = 2 * max(0.02, *map(abs, off))
        axes.set_xlim(-most, most)
        axes.set_xticks([tick for tick in (-1.0, -0.1, -0.01, 0.0, 0.01, 0.1, 1.0) if abs(tick) <= most])
        axes.xaxis.set_major_formatter("{x:g}")
        axes.set_yticks(range(len(looks)), list(looks))
        axes.set_ylim(len(looks) - 0.5, -0.5)
        tidy(axes, f"T = {t:g}", "energy per spin, minus the exact one")
    return Figure(
        "energy.png",
        plot,
        "Deviation of each schedule from the exact energy, with one standard error; the scale is linear up to 0.02 and "
        "logarithmic beyond. Hollow: schedules that break equation (14).",
    )


def _lattices(pictures: Sequence[Chains]) -> Figure:
    plot = new_figure(1.9 * max(2, len(pictures)) + 0.8, 6.3)
    grid = plot.subplots(3, len(pictures), squeeze=False)
    for column, run in zip(grid.T, pictures, strict=True):
        spins = run.spins[0, 0]
        for axes, shown in zip(column, (spins, _sublattice(spins, 0), _sublattice(spins, 1)), strict=True):
            axes.imshow(shown, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
            axes.set_xticks([])
            axes.set_yticks([])
        column[0].set_title(run.schedule, fontsize=10, color=INK)
    for axes, name in zip(grid[:, 0], ("all spins", "even sites", "odd sites"), strict=True):
        axes.set_ylabel(name, color=INK)
    sweeps, temperature = pictures[0].energy.shape[-1], pictures[0].temperatures[0]
    return Figure(
        "lattices.png",
        plot,
        f"Spins after {sweeps} sweeps from a random start at T = {temperature:g}, white up; below them the sites of "
        "each sublattice alone, row + column even and odd, each drawn two sites wide. If a schedule is right, both "
        "show the same domains. Those of the synchronous schedule are two independent lattices, and all spins "
        "together are a checkerboard where they disagree.",
    )


def _sublattice(spins: NDArray[np.uint8], odd: int) -> NDArray[np.uint8]:
    """Return the spins of one sublattice, each drawn over itself and the site to its right."""
    row, col = np.indices(spins.shape)
    shown: NDArray[np.uint8] = spins[row, np.clip(col - (row + col + odd) % 2, 0, None)]
    first = (col == 0) & ((row + odd) % 2 == 1)  # belongs to the site on its right
    shown[first] = np.roll(spins, -1, 1)[first]
    return shown

# SPDX-License-Identifier: BSD-3-Clause
"""The report of a comparison of schedules, with the Ising model."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Plot
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from simdtex import __version__
from simdtex.figures.page import INK, Figure, Part, Section, legend, new_figure, styles, tidy, write_report
from simdtex.figures.sheet import common_scale, contact_sheet
from simdtex.figures.tables import Table, number_text, settings_table
from simdtex.io.image import to_display
from simdtex.jobs.studies.comparison import Comparison, Entry, ScheduleRun, Spread
from simdtex.jobs.studies.ising import ENOUGH, LEVEL, Chains, Finding, Spins

PERCENT = ("utilisation", "changed_cooling", "oscillation_cooling", "changed_free", "oscillation_free")
"""Figures written in percent."""


class Topic(NamedTuple):
    """A section of the page with a table; `columns` are headings and names of figures of the comparison."""

    title: str
    columns: dict[str, str]
    note: str


EQUILIBRIUM = Topic(
    "Until equilibrium",
    {
        "Steps": "steps",
        "Sweeps": "sweeps",
        "Relaxations per site": "relaxations_per_site",
        "Steps, all levels": "all_steps",
        "Sweeps, all levels": "all_sweeps",
        "Relaxations per site, all levels": "all_relaxations_per_site",
    },
    "A sweep relaxes as many sites as had a temperature above 0 when it began. Free sweeps are not counted.",
)
TIME = Topic(
    "Time and the processor array",
    {
        "Wall time, s": "seconds",
        "Device time, s": "device_seconds",
        "SIMD steps": "passes",
        "Utilisation": "utilisation",
        "MP-1 by the model, s": "model_seconds",
    },
    "Wall time excludes the time of observing the run; device time is spent in kernels. Utilisation is the mean share "
    "of PEs with a site to relax, over the SIMD steps. The model counts the arithmetic of the distances and the "
    "fetching of neighbourhoods only.",
)
MOVEMENT = Topic(
    "Movement of the picture",
    {
        "Changed a sweep, cooling": "changed_cooling",
        "Oscillation, cooling": "oscillation_cooling",
        "Changed, last free sweep": "changed_free",
        "Oscillation, last free sweep": "oscillation_free",
    },
    "Changed: another value than a sweep ago. Oscillation: another value than a sweep ago, and the same as two sweeps "
    "ago. Cooling: mean over the sweeps until equilibrium. In a free sweep all sites relax, at temperature 0 too; "
    "it takes 6 of them or more to tell oscillation from settling.",
)
LIKENESS = Topic(
    "Likeness to the sample",
    {
        "Plausibility": "plausibility",
        "Coverage": "coverage",
        "Histogram distance": "histogram_distance",
        "Copying": "copying",
        "Seam": "seam",
    },
    "Plausibility, coverage and histogram distance are in sample standard deviations, 0 is best. Copying is the share "
    "of 9 x 9 patches that are in the sample bit for bit. A seam of 1 is invisible.",
)


def write_comparison(
    folder: str | os.PathLike[str], comparison: Comparison, command: str = "", spins: Spins | None = None
) -> None:
    """Write the report of a comparison: ``index.html``, PNG pictures and plots, ``results.json``.

    Parameters
    ----------
    folder : path
        See `simdtex.figures.page.check_folder`.
    comparison : Comparison
    command : str
        The command line, if there is one.
    spins : simdtex.jobs.studies.ising.Spins, optional
        The Ising model under the same schedules.

    Raises
    ------
    ValueError
        The folder cannot be written.
    """
    height, width = comparison.shape
    rows, cols = _channels_last(comparison, comparison.sample).shape[:2]
    seeds = len(comparison.seeds)
    lead = (
        f"{len(comparison.entries)} schedules do the same job, {width} x {height} pixels from a sample of "
        f"{cols} x {rows}, with {seeds} {'seeds' if seeds > 1 else 'seed'} each. A schedule decides which sites relax "
        "together. Equation (14) demands that no two of them are neighbours; every table says which schedules break it."
    )
    parts, results = sections(comparison), comparison.results()
    if spins:
        parts.append(ising_section(spins))
        results["ising"] = {
            "findings": [vars(finding) for finding in spins.findings],
            "conclusion": conclusion(spins.findings),
        }
    write_report(folder, "Parallel schedules compared", lead, parts, results, command)


def sections(comparison: Comparison) -> list[Section]:
    """Return the sections of the page."""
    hollow = "Hollow markers and dashed lines: breaks (14)."
    equilibrium, time, movement, likeness = comparison_tables(comparison)
    temperature = Figure(
        "temperature.png",
        _temperature(comparison),
        f"Mean temperature left at the finest level after every sweep, against steps. {hollow}",
    )
    oscillation = Figure(
        "oscillation.png",
        _oscillation(comparison),
        f"Pixels that return to their value before last, sweep by sweep; markers are free sweeps. {hollow}",
    )
    return [
        Section("Pictures", _pictures(comparison)),
        Section(EQUILIBRIUM.title, [equilibrium, temperature]),
        Section(TIME.title, [time]),
        Section(MOVEMENT.title, [movement, oscillation]),
        Section(LIKENESS.title, [likeness]),
        Section("The job", [_job(comparison)]),
    ]


def comparison_tables(comparison: Comparison) -> list[Table]:
    """Return four comparison_tables with a row for each schedule: equilibrium, time, movement and likeness."""
    array = comparison.entries[0].runs[0].accounting
    pes = f"{array['array']} PEs of a MasPar MP-1, {array['mapping']}"
    model = f"Whole runs, on {comparison.device} and by a model of {pes}"
    seeds = f" Mean ± standard deviation over {len(comparison.seeds)} seeds." if len(comparison.seeds) > 1 else ""

    def table(topic: Topic, caption: str, remark: str = "") -> Table:
        rows = [
            {"Schedule": entry.name, "Equation (14)": "keeps (14)" if entry.independent else "breaks (14)"}
            | {heading: _text(name, entry.figure(name)) for heading, name in topic.columns.items()}
            for entry in comparison.entries
        ]
        return Table(caption, rows, f"{topic.note}{remark}{seeds}")

    return [
        table(
            EQUILIBRIUM,
            "Until no temperature was left: the finest level, and all levels together",
            "".join(map(_kept_levels, comparison.entries)),
        ),
        table(TIME, model),
        table(MOVEMENT, "Share of the finest level's pixels, a sweep"),
        table(LIKENESS, "Figures of merit of the outputs"),
    ]


def _text(name: str, spread: Spread | None) -> str:
    """Return the mean of a figure over the seeds and its standard deviation as text."""
    if spread is None:
        return "n/a"
    factor, unit = (100, " %") if name in PERCENT else (1, "")
    deviation = None if spread.deviation is None else factor * spread.deviation
    return number_text(factor * spread.mean, deviation, unit)


def _kept_levels(entry: Entry) -> str:
    """Return a sentence on a schedule that keeps equation (14) at some levels only, else nothing."""
    kept = [str(level) for level, claim in enumerate(reversed(entry.claims)) if claim]
    if not kept or len(kept) == len(entry.claims):
        return ""
    return f" At level {', '.join(kept)} {entry.name} keeps equation (14)."


def _job(comparison: Comparison) -> Table:
    about = {
        "simdtex": __version__,
        "device": comparison.device,
        "seeds": ", ".join(map(str, comparison.seeds)),
        "sample": " x ".join(map(str, comparison.sample.shape)) + f", {comparison.sample.dtype}",
        "output": " x ".join(map(str, comparison.shape)) + " (rows x columns)",
        **comparison.options,
    }
    return settings_table("The same for every schedule", about)


def _channels_last(comparison: Comparison, image: NDArray[Any]) -> NDArray[Any]:
    return image if comparison.channel_axis is None else np.moveaxis(image, comparison.channel_axis, -1)


def _label(entry: Entry) -> str:
    return entry.name if entry.independent else f"{entry.name}, breaks (14)"


def _pictures(comparison: Comparison) -> list[Part]:
    limits = float(comparison.sample.min()), float(comparison.sample.max())

    def shown(image: NDArray[Any]) -> NDArray[np.uint8]:
        return to_display(_channels_last(comparison, image), limits)

    first = [("the sample", shown(comparison.sample))]
    first += [(_label(entry), shown(entry.runs[0].image)) for entry in comparison.entries]
    scale = common_scale([image for _, image in first])
    sheet = contact_sheet(first, columns=min(3, len(first)), scale=scale)
    parts: list[Part] = [Figure("pictures.png", sheet, "The sample, and the output of each schedule with one seed.")]
    if len(comparison.seeds) > 1:
        turns = zip(*(entry.runs for entry in comparison.entries), strict=True)
        every = [(f"{run.schedule}, {run.seed}", shown(run.image)) for runs in turns for run in runs]
        sheet = contact_sheet(every, columns=min(3, len(comparison.entries)), scale=scale)
        parts.append(Figure("seeds.png", sheet, "The outputs of all seeds, seed by seed, in the same scale."))
    return parts


Points = tuple[list[float], list[float], list[int]]
"""The x and y of a curve, and which of its points have a marker."""


def _curves(
    comparison: Comparison, points: Callable[[ScheduleRun], Points], title: str, x: str, y: str
) -> tuple[Plot, Axes]:
    """Plot a curve for each run, those of the first seed on top and labelled."""
    entries = comparison.entries
    plot = new_figure(9.2, 4.4)
    axes = plot.subplots()
    tidy(axes, title, x, y)
    for entry, style in zip(entries, styles({e.name: e.independent for e in entries}).values(), strict=True):
        for run in entry.runs[:0:-1]:
            axes.plot(*points(run)[:2], **style | {"marker": None, "linewidth": 0.8, "alpha": 0.35})
        *curve, marked = points(entry.runs[0])
        axes.plot(*curve, markevery=marked, linewidth=1.7, markersize=6, label=_label(entry), **style)
    legend(plot, axes, "outside right upper", 1)
    return plot, axes


def _temperature(comparison: Comparison) -> Plot:
    """Plot the temperature left at the finest level against its steps, until equilibrium."""

    def points(run: ScheduleRun) -> Points:
        sweeps = [sweep for sweep in run.finest if sweep.phase == "relax"]
        x = [0.0, *(float(sweep.steps) for sweep in sweeps)]
        return x, [sweep.before for sweep in sweeps[:1]] + [sweep.left for sweep in sweeps], list(range(len(x)))

    plot, axes = _curves(comparison, points, "Temperature left", "Step of the finest level", "Mean temperature")
    axes.set_xscale("symlog", linthresh=1.0, linscale=0.3)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    return plot


def _oscillation(comparison: Comparison) -> Plot:
    """Plot the share of the finest level's pixels that return to their value before last, against its sweeps."""

    def points(run: ScheduleRun) -> Points:
        known = [(sweep, sweep.returned) for sweep in run.finest if sweep.returned is not None]
        free = [place for place, (sweep, _) in enumerate(known) if sweep.phase == "free"]
        return [float(sweep.sweep) for sweep, _ in known], [100 * share for _, share in known], free

    plot, axes = _curves(comparison, points, "Oscillation index", "Sweep of the finest level", "Pixels, %")
    axes.set_yscale("symlog", linthresh=0.1, linscale=0.3)
    axes.set_ylim(bottom=0.0)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    return plot


ERRORS = (
    "Errors are one standard error of the chains' means. Sigma: deviation from the exact energy in errors. |m|: mean "
    "absolute magnetisation. Neighbours: correlation of neighbouring spins beyond the product of the magnetisations of "
    "their sublattices; 0 if even and odd sites are independent of one another. Differs: Student's t gives the "
    f"deviation a probability below {LEVEL:g} over the number of comparisons. Agrees: it does not. A verdict needs "
    f"{ENOUGH} chains or more; --ising runs 32 at each temperature, whatever --seeds is."
)


def conclusion(findings: Sequence[Finding]) -> list[str]:
    """Return a sentence each on the schedules that agree everywhere and on those that do not."""
    if any(finding.chains < ENOUGH for finding in findings):
        return [f"No verdict: it needs {ENOUGH} chains or more at each temperature."]
    keeps = {finding.schedule: finding.independent for finding in findings}
    wrong = [name for name in keeps if any(finding.differs for finding in findings if finding.schedule == name)]
    right = [name for name in keeps if name not in wrong]
    odd = [name for name in keeps if keeps[name] == (name in wrong)]
    said = {
        "No deviation from the Ising model at any temperature: {}.": right,
        "Something else is sampled by: {}.": wrong,
        "Against the expectation from equation (14): {}. More sweeps or a longer burn-in may decide.": odd,
    }
    return [sentence.format(", ".join(names)) for sentence, names in said.items() if names]


def ising_section(spins: Spins) -> Section:
    """Return the section on the Ising model: which schedules sample its distribution."""
    lead = (
        "Heat-bath Ising spins are relaxed by each schedule, and the energy per spin is compared with its exact value "
        "on this very torus (Kaufman 1949). The conditional distributions are those of the Ising model under every "
        "schedule, so any deviation is due to the schedule."
    )
    findings = spins.findings
    text = "\n\n".join([lead, *conclusion(findings)])
    return Section("The Ising model", [text, *ising_tables(findings), _energy(findings), _lattices(spins.pictures)])


def ising_tables(findings: Sequence[Finding]) -> list[Table]:
    """Return a table of the schedules for each temperature."""
    groups = _by_temperature(findings)
    return [
        Table(
            f"T = {t:g}: exact energy {rows[0].exact:.5f} on this torus",
            [_row(row) for row in rows],
            ERRORS if t == groups[-1][0] else "",
        )
        for t, rows in groups
    ]


def _by_temperature(findings: Sequence[Finding]) -> list[tuple[float, list[Finding]]]:
    return [(t, list(rows)) for t, rows in groupby(findings, key=lambda row: row.temperature)]


def _row(row: Finding) -> dict[str, str]:
    return {
        "Schedule": row.schedule,
        "(14)": "keeps" if row.independent else "breaks",
        "Verdict": row.verdict,
        "Energy": f"{row.energy:.5f} ± {row.error:.5f}",
        "Sigma": f"{row.sigmas:+.1f}",
        "|m|": f"{row.magnetisation:.4f}",
        "Neighbours": f"{row.neighbours:z.3f}",
    }


def _energy(findings: Sequence[Finding]) -> Figure:
    groups = _by_temperature(findings)
    looks = styles({row.schedule: row.independent for row in findings})
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
    """Return the spins of one sublattice of an even width, each drawn two sites wide."""
    row, col = np.indices(spins.shape)
    shown: NDArray[np.uint8] = spins[row, col // 2 * 2 + (row + odd) % 2]
    return shown

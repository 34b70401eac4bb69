# SPDX-License-Identifier: BSD-3-Clause
"""The reports of schedules: a comparison, with the Ising model, and an execution on the processor array of 1998."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import PIL.Image
import PIL.ImageDraw
import PIL.ImageFont
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Plot
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from simdtex import __version__, schedules
from simdtex.experiments.comparison import Comparison, Entry, Run, Spread
from simdtex.experiments.ising import ENOUGH, LEVEL, Chains, Finding, Spins
from simdtex.io.image import pillow_bytes, to_display
from simdtex.jobs.array import Execution
from simdtex.jobs.synthesis import synthesize
from simdtex.machine.reference import Reference
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.report.page import INK, Figure, Part, Section, legend, new_figure, styles, tidy, write_report
from simdtex.report.sheet import TEXT, contact_sheet, magnified, rgb
from simdtex.report.tables import Table, duration_text, number_text, seconds_text, settings_table
from simdtex.run import Progress
from simdtex.schedules.schedule import Masked, Setting

SHOWN_SIDE = 256  # smaller pictures are enlarged by a whole factor to about this, pixels


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
        See `simdtex.report.page.check_folder`.
    comparison : Comparison
    command : str
        The command line, if there is one.
    spins : simdtex.experiments.ising.Spins, optional
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
            "findings": [vars(one) for one in spins.findings],
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


def _text(name: str, found: Spread | None) -> str:
    """Return the mean of a figure over the seeds and its standard deviation as text."""
    if found is None:
        return "n/a"
    factor, unit = (100, " %") if name in PERCENT else (1, "")
    deviation = None if found.deviation is None else factor * found.deviation
    return number_text(factor * found.mean, deviation, unit)


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
    scale = _scale([image for _, image in first])
    sheet = contact_sheet(first, columns=min(3, len(first)), scale=scale)
    parts: list[Part] = [Figure("pictures.png", sheet, "The sample, and the output of each schedule with one seed.")]
    if len(comparison.seeds) > 1:
        turns = zip(*(entry.runs for entry in comparison.entries), strict=True)
        every = [(f"{run.schedule}, {run.seed}", shown(run.image)) for runs in turns for run in runs]
        sheet = contact_sheet(every, columns=min(3, len(comparison.entries)), scale=scale)
        parts.append(Figure("seeds.png", sheet, "The outputs of all seeds, seed by seed, in the same scale."))
    return parts


def _scale(pictures: Sequence[NDArray[Any]]) -> int:
    """Return the whole factor for all pictures: the smallest is about `SHOWN_SIDE` wide, the largest at most twice."""
    sides: list[int] = [max(one.shape[:2]) for one in pictures]
    return max(1, min(round(SHOWN_SIDE / min(sides)), 2 * SHOWN_SIDE // max(sides)))


Points = tuple[list[float], list[float], list[int]]
"""The x and y of a curve, and which of its points have a marker."""


def _curves(comparison: Comparison, points: Callable[[Run], Points], title: str, x: str, y: str) -> tuple[Plot, Axes]:
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

    def points(run: Run) -> Points:
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

    def points(run: Run) -> Points:
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


def conclusion(found: Sequence[Finding]) -> list[str]:
    """Return a sentence each on the schedules that agree everywhere and on those that do not."""
    if any(one.chains < ENOUGH for one in found):
        return [f"No verdict: it needs {ENOUGH} chains or more at each temperature."]
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


def ising_section(spins: Spins) -> Section:
    """Return the section on the Ising model: which schedules sample its distribution."""
    lead = (
        "Heat-bath Ising spins are relaxed by each schedule, and the energy per spin is compared with its exact value "
        "on this very torus (Kaufman 1949). The conditional distributions are those of the Ising model under every "
        "schedule, so any deviation is due to the schedule."
    )
    found = spins.findings
    text = "\n\n".join([lead, *conclusion(found)])
    return Section("The Ising model", [text, *ising_tables(found), _energy(found), _lattices(spins.pictures)])


def ising_tables(found: Sequence[Finding]) -> list[Table]:
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
    """Return the spins of one sublattice of an even width, each drawn two sites wide."""
    row, col = np.indices(spins.shape)
    shown: NDArray[np.uint8] = spins[row, col // 2 * 2 + (row + odd) % 2]
    return shown


Steps = Iterator[NDArray[np.bool_]]
"""The sites that relax together, step by step, each (rows, cols)."""

FRAMES, PAUSE = 60, 200
"""The frames of a film, and the milliseconds between two."""

SIDE, GAP = 256, 14
"""The side of a lattice in a film, about, and the space around it, pixels."""

COLOURS = np.array([(34, 38, 43), (60, 92, 130), (255, 190, 60)], np.uint8)
"""The colours of a PE that waits, of one that has relaxed its site in this sweep, and of one that does so now."""

SHOWN = "The sample, and the picture that the array made. It has the bytes of simdtex synth --preset paper."
ACTIVE = (
    "The share of PEs that relax a site, step by step. The others wait under the mask: their sites have another colour "
    "or the temperature 0, or, at coarse levels, they have no site."
)
FILM = (
    "Above: PEs that relax a site now (light), and that have done so in this sweep (blue); a frame is a step. Below: "
    "the picture that simdtex synth makes with this schedule, from its start to its end; a frame is a 60th of each run."
)
WHY = (
    "The paper relaxes sites together only if none is a neighbour of another, equation (14), because a site must see "
    "the present values of its neighbours. coloring does so in as few steps as there are colours. raster keeps the "
    "rule too, one site a step. synchronous relaxes all sites in one step and checkerboard in two, but neighbours "
    "among them: what they draw need not have the distribution of the model (see simdtex schedules --ising)."
)


def write_array(
    folder: str | os.PathLike[str],
    sample: NDArray[Any],
    made: NDArray[Any],
    run: Execution,
    pictures: Mapping[str, Sequence[NDArray[Any]]],
    command: str = "",
) -> None:
    """Write a page on an execution: its picture, seconds and active PEs, and a film of schedules and their pictures."""
    facts = run.statistics
    total = sum(sum(section.values()) for section in run.seconds.values())
    grid = Grid.of((made.shape[0], made.shape[1]))
    moving = film({name: steps(name, grid, facts["options"]["order"], facts["seed"]) for name in pictures}, pictures)
    lead = (
        f"{made.shape[1]} x {made.shape[0]} pixels on {facts['array']} PEs ({facts['mapping']}, {facts['layers']} "
        f"virtual layers): by the model a MasPar MP-1 would have taken {duration_text(total)}."
    )
    seen = contact_sheet([("sample", sample), ("the picture", made)], columns=2, scale=_scale([sample, made]))
    page = [
        Section("The picture", [Figure("pictures.png", seen, SHOWN)]),
        Section("Seconds of 1998", [section_table(run)]),
        Section("PEs at work", [Figure("active.png", _utilisation(run), ACTIVE)]),
        Section("Schedules", [WHY, Figure("film.png", moving, FILM)]),
    ]
    results = {"seconds": run.seconds, "statistics": facts, "utilisation": [one.active.mean() for one in run.steps]}
    write_report(folder, "The processor array of 1998", lead, page, results, command)


def section_table(run: Execution) -> Table:
    """Return a table of modelled seconds by section of the program and kind of instruction, and of idle PEs."""
    seconds, kinds = dict(run.seconds), sorted({kind for section in run.seconds.values() for kind in section})
    seconds["all"] = {kind: sum(section.get(kind, 0.0) for section in run.seconds.values()) for kind in kinds}
    idle = {name: _idle(run, [name]) for name in run.seconds} | {"all": _idle(run, list(run.seconds))}
    rows = [
        {"section": name}
        | {kind: seconds_text(each[kind]) if each.get(kind) else "" for kind in kinds}
        | {"together": seconds_text(sum(each.values())), "idle PEs": f"{idle[name]:.0%}"}
        for name, each in seconds.items()
    ]
    return Table(f"A MasPar MP-1 of {run.statistics['array']} PEs, by the model", rows)


def _idle(run: Execution, sections: Sequence[str]) -> float:
    """Return the share of PEs under the mask, over the seconds of sections."""
    rows, cols = (int(side) for side in run.statistics["array"].split("x"))
    pairs = [(run.seconds[name][kind], one) for name in sections for kind, one in run.counts[name].items()]
    time = sum(seconds for seconds, _ in pairs)
    busy = sum(seconds * one.active / max(1, one.instructions * rows * cols) for seconds, one in pairs)
    return 1 - busy / time if time else 0.0


def _utilisation(run: Execution) -> Plot:
    """Return a plot of the share of active PEs in each step, over the virtual layers with an active PE."""
    shares = [one.active[one.active.any((1, 2))].mean() for one in run.steps]
    levels = np.array([one.level for one in run.steps])
    plot = new_figure(7.2, 3.0)
    axes = plot.add_subplot()
    for level in sorted(set(levels.tolist()), reverse=True):
        at = np.flatnonzero(levels == level)
        axes.plot(at + 1, 100 * np.array(shares)[at], ".", markersize=3, label=f"level {level}")
    tidy(axes, x="step", y="active PEs, %")
    axes.set_ylim(0)
    legend(plot, axes, columns=6)
    return plot


def steps(name: str, grid: Grid, order: int, seed: int) -> Steps:
    """Yield the sites of each step of a schedule, sweep after sweep without end, as if all were active."""
    schedule = schedules.get(name)
    setting = Setting(Reference(), grid, neighbourhood_offsets(order), order, seed, 0)
    state, everywhere = schedule.init(setting), Masked(grid)
    while True:
        state, info = schedule.step(setting, state, everywhere)
        for step in info.apart(setting.machine):
            plane = np.zeros(grid.shape, bool)
            plane.flat[step.sites] = True
            yield plane


def develop(sample: NDArray[Any], shape: tuple[int, int], schedule: str, **given: Any) -> list[NDArray[Any]]:
    """Return `FRAMES` pictures of a run of the paper's preset with a schedule, at equal shares of the run."""
    seen: list[NDArray[Any]] = []

    def see(progress: Progress) -> None:
        if progress.image is not None and progress.fraction * FRAMES >= len(seen) + 1:
            seen.extend([progress.image()] * (int(progress.fraction * FRAMES) - len(seen)))

    made = synthesize(sample, shape, preset="paper", schedule=schedule, callback=see, **given)
    return [*seen[: FRAMES - 1], *[made] * (FRAMES - min(len(seen), FRAMES - 1))]


def film(shown: Mapping[str, Steps], pictures: Mapping[str, Sequence[NDArray[Any]]]) -> bytes:
    """Return an animated PNG: the sites of each schedule side by side, a frame for each step, above its picture."""
    font, frames = PIL.ImageFont.load_default(TEXT), []
    done: dict[str, Any] = dict.fromkeys(shown, False)
    for number in range(1, FRAMES + 1):
        panels = []
        for name, ahead in shown.items():
            now = next(ahead)
            before = np.broadcast_to(done[name] & ~np.any(done[name] & now), now.shape)  # a site again: a new sweep
            done[name] = before | now
            colours = magnified(COLOURS[np.where(now, 2, before.astype(int))], max(1, round(SIDE / max(now.shape))))
            made = PIL.Image.fromarray(rgb(pictures[name][number - 1])).resize(colours.shape[1::-1], 0)  # nearest
            colours = np.concatenate([colours, np.full_like(colours[:GAP], 255), np.array(made)])
            panels.append((f"{name}\n{np.count_nonzero(now):,} of {now.size:,} sites", colours))
        width = sum(len(one[0]) + GAP for _, one in panels) + GAP
        frame = PIL.Image.new("RGB", (width, len(panels[0][1]) + 4 * TEXT + 2 * GAP), "white")
        pen, left = PIL.ImageDraw.Draw(frame), GAP
        pen.text((GAP, 4), f"step {number}", fill="black", font=font)
        for text, colours in panels:
            pen.multiline_text((left, 8 + TEXT), text, fill="black", font=font)
            frame.paste(PIL.Image.fromarray(colours), (left, 4 * TEXT + GAP))
            left += len(colours[0]) + GAP
        frames.append(frame)
    return pillow_bytes(frames[0], "PNG", save_all=True, append_images=frames[1:], duration=PAUSE, loop=0)

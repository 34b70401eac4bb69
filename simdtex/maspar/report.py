# SPDX-License-Identifier: BSD-3-Clause
"""The report of the processor array of 1998, and the film of its sites."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import PIL.Image
import PIL.ImageDraw
import PIL.ImageFont
from matplotlib.figure import Figure as Plot
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.driver import drive
from simdtex.figures.page import Figure, Section, legend, new_figure, tidy, write_report
from simdtex.figures.sheet import TEXT, common_scale, contact_sheet, magnified, rgb
from simdtex.figures.tables import Table, duration_text, seconds_text
from simdtex.inputs import check_inputs
from simdtex.io.image import pillow_bytes
from simdtex.machine import open_machine
from simdtex.machine.reference import Reference
from simdtex.maspar.job import Execution
from simdtex.methods import mrf
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.options import resolve
from simdtex.run import Progress
from simdtex.schedules.schedule import Masked, Setting

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
    seen = contact_sheet([("sample", sample), ("the picture", made)], columns=2, scale=common_scale([sample, made]))
    page = [
        Section("The picture", [Figure("pictures.png", seen, SHOWN)]),
        Section("Seconds of 1998", [section_table(run)]),
        Section("PEs at work", [Figure("active.png", _utilisation(run), ACTIVE)]),
        Section("Schedules", [WHY, Figure("film.png", moving, FILM)]),
    ]
    results = {"seconds": run.seconds, "statistics": facts, "utilisation": [step.active.mean() for step in run.steps]}
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
    pairs = [(run.seconds[name][kind], count) for name in sections for kind, count in run.counts[name].items()]
    time = sum(seconds for seconds, _ in pairs)
    busy = sum(seconds * count.active / max(1, count.instructions * rows * cols) for seconds, count in pairs)
    return 1 - busy / time if time else 0.0


def _utilisation(run: Execution) -> Plot:
    """Return a plot of the share of active PEs in each step, over the virtual layers with an active PE."""
    shares = [step.active[step.active.any((1, 2))].mean() for step in run.steps]
    levels = np.array([step.level for step in run.steps])
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


def develop(
    sample: NDArray[Any],
    shape: tuple[int, int],
    schedule: str,
    *,
    channel_axis: int | None,
    rng: int,
    device: Any,
    **options: Any,
) -> list[NDArray[Any]]:
    """Return `FRAMES` pictures of a run of the paper's preset with a schedule, at equal shares of the run."""
    seen: list[NDArray[Any]] = []

    def see(progress: Progress) -> None:
        if progress.image is not None and progress.fraction * FRAMES >= len(seen) + 1:
            seen.extend([progress.image()] * (int(progress.fraction * FRAMES) - len(seen)))

    chosen: Any = resolve(mrf.Options, "synth", {"preset": "paper", "schedule": schedule} | options)
    plan = mrf.plan(check_inputs(sample, shape, channel_axis).pictures, shape, chosen)
    made, _ = drive(plan, open_machine(device), rng, see)
    return [*seen[: FRAMES - 1], *[made] * (FRAMES - min(len(seen), FRAMES - 1))]


def film(shown: Mapping[str, Steps], pictures: Mapping[str, Sequence[NDArray[Any]]]) -> bytes:
    """Return an animated PNG: the sites of each schedule side by side, a frame for each step, above its picture."""
    font, frames = PIL.ImageFont.load_default(TEXT), []
    done: dict[str, Any] = dict.fromkeys(shown, False)
    for step in range(1, FRAMES + 1):
        panels = []
        for name, ahead in shown.items():
            now = next(ahead)
            before = np.broadcast_to(done[name] & ~np.any(done[name] & now), now.shape)  # a site again: a new sweep
            done[name] = before | now
            colours = magnified(COLOURS[np.where(now, 2, before.astype(int))], max(1, round(SIDE / max(now.shape))))
            made = PIL.Image.fromarray(rgb(pictures[name][step - 1])).resize(colours.shape[1::-1], 0)  # nearest
            colours = np.concatenate([colours, np.full_like(colours[:GAP], 255), np.array(made)])
            panels.append((f"{name}\n{np.count_nonzero(now):,} of {now.size:,} sites", colours))
        width = sum(len(image[0]) + GAP for _, image in panels) + GAP
        frame = PIL.Image.new("RGB", (width, len(panels[0][1]) + 4 * TEXT + 2 * GAP), "white")
        pen, left = PIL.ImageDraw.Draw(frame), GAP
        pen.text((GAP, 4), f"step {step}", fill="black", font=font)
        for text, colours in panels:
            pen.multiline_text((left, 8 + TEXT), text, fill="black", font=font)
            frame.paste(PIL.Image.fromarray(colours), (left, 4 * TEXT + GAP))
            left += len(colours[0]) + GAP
        frames.append(frame)
    return pillow_bytes(frames[0], "PNG", save_all=True, append_images=frames[1:], duration=PAUSE, loop=0)

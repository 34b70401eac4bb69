# SPDX-License-Identifier: BSD-3-Clause
"""Synthesis on the processor array of 1998: `simdtex.maspar.synthesize`, the program with the paper's options."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from math import prod, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.checkpoint import Checkpointing
from simdtex.driver import Device, Seed, run
from simdtex.inputs import check_inputs, check_shape
from simdtex.machine import Machine
from simdtex.machine.memory import require
from simdtex.maspar.algorithm import ArrayLevel, Problem, Program, by_lane
from simdtex.maspar.array import EXECUTED, ProcessorArray
from simdtex.maspar.machine import MP1, Count, Plural
from simdtex.methods import mrf
from simdtex.methods.mrf.level import Lattices
from simdtex.methods.mrf.record import expected_work, fraction_done, known_before
from simdtex.methods.mrf.square import LANES
from simdtex.model.array import MAPPINGS, parse_array
from simdtex.model.light import Light
from simdtex.model.pictures import Pictures
from simdtex.options import one_of, resolve
from simdtex.run import Callback, Output, Progress, Stage

MEMORY = {"16K": 2**14, "64K": 2**16}
"""The bytes of a PE's memory, in the two sizes that were sold."""


class Step(NamedTuple):
    """A step of the program: its level and sweep, and a mask of the PEs that relaxed sites, packed into bits."""

    level: int
    sweep: int
    packed: NDArray[np.uint8]
    shape: tuple[int, int, int]

    @property
    def active(self) -> NDArray[np.bool_]:
        """The mask, (layers, rows, cols) of PEs."""
        return np.unpackbits(self.packed, count=prod(self.shape)).reshape(self.shape).astype(bool)


@dataclass(frozen=True, repr=False)
class Execution(Output):
    """The additional results of `simdtex.maspar.synthesize`.

    Attributes
    ----------
    counts : dict of dict of Count
        The instructions of the layers, and the active PEs in them, by section of the program and kind of instruction
        (`simdtex.maspar.machine.COSTS`).
    seconds : dict of dict of float
        The modelled seconds of a MasPar MP-1 in the same order.
    steps : list of Step
        The PEs that relaxed sites in each step.
    """

    counts: dict[str, dict[str, Count]] = field(default_factory=dict)
    seconds: dict[str, dict[str, float]] = field(default_factory=dict)
    steps: list[Step] = field(default_factory=list)


def synthesize(
    sample: ArrayLike,
    shape: tuple[int, int],
    *,
    array: str = "maspar-mp1-16k",
    mapping: str = MAPPINGS[0],
    memory: str = "64K",
    channel_axis: int | None = None,
    rng: Seed = None,
    device: Device = None,
    callback: Callback | None = None,
    full_output: bool = False,
    **options: Any,
) -> Any:
    """Synthesise a picture by Algorithm 1 on an emulated MasPar MP-1, the array of the 1998 paper.

    Parameters
    ----------
    sample : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array
        The texture; any real type, without unknown pixels.
    shape : (int, int)
        Rows and columns of the output.
    array : str
        ``"maspar-mp1-1k"`` to ``"maspar-mp1-16k"``, or ROWSxCOLS.
    mapping : {"cut-and-stack", "hierarchical"}
        The places of pixels if the picture is larger than the array, see `simdtex.maspar.array.ProcessorArray`.
    memory : {"64K", "16K"}
        The memory of a PE. A picture or neighbourhood too large for it is refused.
    channel_axis, rng, device
        As in `simdtex.synthesize`.
    callback : callable, optional
        Called with a `simdtex.run.Progress` after every step.
    full_output : bool
        Return counts, modelled seconds and the active PEs of each step too.
    **options
        ``order``, ``levels``, ``overview``, ``boundary``, ``edges``, ``phases``, ``bandwidth``, ``xi``, ``relaxation``,
        ``pixel``, ``free_sweeps`` and ``free_sites`` of `simdtex.methods.mrf.Options`; their defaults are the paper's.

    Returns
    -------
    image : array of the sample's type
        The bytes of ``simdtex.synthesize`` with ``preset="paper"`` and the same arguments, for any array.
    output : Execution
        Only with ``full_output=True``.

    Raises
    ------
    ValueError, TypeError
        An argument is invalid, the program does not execute an option, or the memory of a PE does not suffice; the
        message names the remedy.

    Notes
    -----
    Cost: the multiply-adds of ``simdtex.synthesize`` with these options, and some hundred launches per step. Memory on
    the device: at most that of all PEs, 1 GiB with 16,384 PEs of 64 KiB, and 4 bytes per candidate, neighbour and
    channel.

    Examples
    --------
    >>> from skimage import data
    >>> from simdtex import maspar
    >>> maspar.synthesize(data.brick()[:32, :32], (16, 16), array="16x16", order=2, rng=1).shape
    (16, 16)
    """
    one_of("memory", memory, tuple(MEMORY))
    one_of("mapping", mapping, MAPPINGS)
    pes, size = ProcessorArray(*parse_array(array, mapping)), check_shape(shape)
    inputs = check_inputs(sample, size, channel_axis)
    if not inputs.pictures.clean:
        raise ValueError("the array takes one sample without unknown pixels; use simdtex.synthesize for others")
    chosen: Any = resolve(mrf.Options, "synth", {"preset": "paper"} | options)
    paper = resolve(mrf.Options, "synth", {"preset": "paper"})
    for name, value in vars(chosen).items():
        if name not in EXECUTED and value != getattr(paper, name):
            raise ValueError(
                f"the program of the array does not execute {name}={value!r}; leave it out, or use simdtex.synthesize"
            )
    job = Emulation(inputs.pictures, size, chosen, pes, MEMORY[memory], channel_axis)
    picture, output = run("maspar.synthesize", job, rng, device, callback, None)
    return (picture, output) if full_output else picture


@dataclass(frozen=True)
class Emulation:
    """The job of `synthesize`: the program on an ``array`` whose PEs have ``memory`` bytes each."""

    pictures: Pictures
    shape: tuple[int, int]
    options: mrf.Options
    array: ProcessorArray
    memory: int
    channel_axis: int | None
    light = Light()

    def make(
        self, machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Execution]:
        """Run the program, and return the picture, channels last, and the rest of the output."""
        array, memory = self.array, self.memory
        run = Lattices(mrf.plan(self.pictures, self.shape, self.options), machine, seed)
        mp1 = MP1(machine, array, self.shape, memory)
        need = 8 * (run.sample.top + 1) * run.choice(0).mode
        if not mp1.fits(need):
            raise ValueError(
                f"the mode of a density takes {need} bytes of each PE for {run.sample.top + 1} grey levels, and a PE "
                f'has {memory}; give more memory, pixel="source" or relaxation="gibbs"'
            )
        n, terms = max(run.places(k).positions.size for k in range(run.levels)), len(run.offsets) * run.sample.channels
        held = min(memory, need + mp1.layers * (8 * terms + 160))
        require(machine, array.size * held + 4 * terms * n, 4 * terms * n, "give a smaller array or sample")
        program, steps, stages = Program(mp1, problem(run)), [], []
        address = mp1.layout.address[: self.shape[0], : self.shape[1]]

        def values(of: Plural) -> NDArray[Any]:
            """Return a variable in the pixels of the picture, (words, rows, cols)."""
            held = machine.get(of.data)
            return np.moveaxis(held.reshape(-1, held.shape[-1])[address], -1, 0)

        def picture(level: int) -> NDArray[Any]:
            grid = run.grid(level)
            x, source = values(program.state)[:-1].astype(np.uint16), values(program.source)[0]
            return run.sample.picture(grid.decimated(x), grid.decimated(source))

        expected, seen, left = expected_work(run), (-1, 0), 1.0
        for level in reversed(range(run.levels)):
            for sweep, active in program.relax(level_of(run, level)):
                steps.append(Step(level, sweep, np.packbits(active), (mp1.layers, array.rows, array.cols)))
                if callback is None:
                    continue
                if seen != (level, sweep):
                    seen, t = (level, sweep), values(program.state)[-1]
                    left = float(run.grid(level).decimated(t).mean()) / 1024
                share = fraction_done(expected, level, 1 - sqrt(min(1.0, left)), 0.0)
                doing, now = f"level {level}, sweep {sweep}", partial(picture, level)
                callback(Progress(level=level, levels=run.levels, fraction=share, doing=doing, image=now))
            stages.append(Stage(level, picture(level)))
        counts: dict[str, dict[str, Count]] = {}
        for (section, kind), count in mp1.counts.items():
            counts.setdefault(section, {})[kind] = count
        source = run.sample.place(values(program.source)[0])
        statistics = known_before(run) | {"seed": seed, "device": machine.name}
        statistics |= {"array": f"{array.rows}x{array.cols}", "mapping": array.mapping, "layers": mp1.layers}
        more: dict[str, Any] = {"counts": counts, "seconds": mp1.seconds(), "steps": steps}
        t = values(program.state)[-1] / 1024
        return stages[-1].image, Execution(source, t, stages, statistics, **more)


def problem(run: Lattices) -> Problem:
    """Return the input of the program for all levels."""
    source = run.sample.places(np.zeros((1, 2), np.int32), 1).positions
    first = np.concatenate([source[None], run.sample.working[:, source].astype(np.int32)])
    xi = min(-1, round(run.options.xi * 1024))
    return Problem(first, run.offsets[by_lane(run.offsets)], run.options.neighbourhood, xi, run.seed)


def level_of(run: Lattices, level: int) -> ArrayLevel:
    """Return the input of the program for a level."""
    places, working = run.places(level), run.sample.working.astype(np.float32)
    reach, centre = places.reach[by_lane(run.offsets)], working[:, places.positions]
    around = np.moveaxis(working[:, reach[:, None] + places.positions], 1, 0)
    cols = places.col.size
    runs = min(places.spacing // places.step, cols)  # as in simdtex.methods.mrf.square.Square
    row, col = np.divmod(np.arange(places.positions.size, dtype=np.int32), cols)
    noise = (row * runs + col % runs) * -(-cols // (runs * LANES)) * LANES + col // runs
    free = run.free_sweeps(level), run.kept_only
    return ArrayLevel(level, run.grid(level), run.choice(level), places.positions, centre, around, noise, *free)

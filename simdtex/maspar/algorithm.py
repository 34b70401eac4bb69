# SPDX-License-Identifier: BSD-3-Clause
"""Algorithm 1 of Paget and Longstaff (1998) as a program for the processor array of the paper.

Everything but the numbers of the ACU is an instruction of `simdtex.maspar.machine.MP1`. The numbers in the comments are
the paper's. The program has the bytes of `simdtex.synthesize` with ``preset="paper"``.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from math import prod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.maspar import instructions
from simdtex.maspar.coloring import coloring
from simdtex.maspar.costs import EXP, PHILOX, WIDE
from simdtex.maspar.instructions import STEPPED, Block, Draw
from simdtex.maspar.machine import MP1, Mask
from simdtex.maspar.walk import Walk
from simdtex.model.lattice import Grid
from simdtex.ops.lcpdf import Choice, Key, turns

AT_ONCE = 16
"""The most times `STEPPED` candidates of one launch; fewer on an array beyond the largest MP-1."""


class Level(NamedTuple):
    """The constants of a level on the ACU.

    ``number`` is l, ``grid`` S^l, and ``choice`` the Gaussian of (7) and what is drawn from it; ``source`` (n,) are the
    pixel indices of the candidates, ``own`` (C, n) their values, and ``sample`` (N, C, n) those of their neighbours.
    """

    number: int
    grid: Grid
    choice: Choice
    source: NDArray[np.int32]
    own: NDArray[np.float32]
    sample: NDArray[np.float32]


class Problem(NamedTuple):
    """The input on the ACU.

    ``first`` has the pixel indices and the values (C + 1, n) that sites begin with, ``offsets`` (N, 2) are those of the
    neighbourhood of ``order``, ``xi`` of (13) is in 1/1024, and ``seed`` keys all random numbers.
    """

    first: NDArray[np.int32]
    offsets: NDArray[np.int32]
    order: int
    xi: int
    seed: int


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


class Program:
    """The plural variables of the program: ``state`` has C grey levels x and the temperature t, in 1/1024."""

    def __init__(self, mp1: MP1, problem: Problem) -> None:
        self.mp1, self.problem, self.channels = mp1, problem, len(problem.first) - 1
        self.state, self.source, self.place = mp1.plural(size=self.channels + 1), mp1.plural(), mp1.plural()
        self.temperature = self.state[self.channels]
        with mp1.section("start"):
            self.place.set(mp1.row * mp1.shape[1] + mp1.col)  # 2
            bits = mp1.random(self.place, Key(problem.seed, 0, 0), random.START)
            drawn = bits.share(problem.first.shape[1]).as_type("int32")
            mp1.table(self.source, problem.first[0], drawn)
            for c in range(self.channels):
                mp1.table(self.state[c], problem.first[1 + c], drawn)
            self.temperature.set(1024)  # 5

    def relax(self, level: Level) -> Iterator[Step]:
        """Relax a level until its equilibrium, and yield its steps.

        Sites of the level above have t = 0, since that is its equilibrium; all others have t = 1 yet.
        """
        mp1, t, seed = self.mp1, self.temperature, self.problem.seed
        with mp1.frame():
            with mp1.section("colouring"):
                walk = Walk(mp1, level.grid, self.problem.offsets)  # 3, 4, 6.1
                color, colors = coloring(mp1, walk, self.problem.order, seed)
            relaxation = Pass(self, level, walk)
            for sweep in count(1):
                with mp1.section("schedule"), mp1.where(walk.sites):
                    if not mp1.any(t > 0):  # 6.2
                        break
                bits = random.draw4(seed, level.number, sweep, np.arange(colors), random.SCHEDULE)[0]
                for now in np.argsort(bits, kind="stable").tolist():  # 6.2.1
                    with mp1.section("schedule"), mp1.where(walk.sites), mp1.where((color == now) & (t > 0)) as chosen:
                        mp1.count("reduction")  # which layers have a site to relax
                    if chosen.layers:
                        relaxation.relax(chosen, sweep)  # 6.2.2
                        shape = (mp1.layers, mp1.array.rows, mp1.array.cols)
                        yield Step(level.number, sweep, np.packbits(chosen.active), shape)


class Pass:
    """The relaxation of all chosen sites of a level in parallel, 6.2.2."""

    def __init__(self, program: Program, level: Level, walk: Walk) -> None:
        mp1, (neighbours, channels, n) = program.mp1, level.sample.shape
        self.mp1, self.program, self.level, self.walk = mp1, program, level, walk
        self.near, self.heat = mp1.plural("float32", neighbours * (channels + 1)), mp1.plural()
        self.bits, self.chosen = mp1.plural("uint64"), mp1.plural()
        mp1.plural(size=channels + 1)  # what walks through the neighbourhoods
        mp1.reserve(4 + 8 + 8)  # the least distance, the sum of weights and the target
        window, greys = level.choice.window, (level.choice.window.top + 1) * level.choice.mode
        mp1.reserve(8 * greys)  # the sums of weights of each grey level
        self.keeps = mp1.fits(4 * n)  # else all distances are computed again for each use
        mp1.reserve(4 * n if self.keeps else 4)
        most = STEPPED * max(1, min(AT_ONCE, 2**18 // mp1.array.size))
        held = -(-(n if self.keeps else min(n, most)) // STEPPED) * STEPPED
        distances, least = (mp1.expression("float32", (mp1.array.size, *more)).data for more in ((held,), ()))
        total, target = (mp1.expression("uint64", (mp1.array.size,)).data for _ in range(2))
        mass = mp1.expression("uint64", (mp1.array.size, max(1, greys))).data
        own, noise, gauss = (mp1.put(table) for table in (level.own, window.noise, window.gauss))
        words = (distances, least, total, target, self.bits.data, self.chosen.data)
        self.draw = Draw(*words, own, noise, gauss, mass, level.choice)
        self.blocks = [self._block(p, min(n - p, most)) for p in range(0, n, most)]

    def _block(self, first: int, size: int) -> Block:
        part = self.level.sample[..., first : first + size]
        if self.mp1.machine:
            part = np.pad(part, ((0, 0), (0, 0), (0, -size % STEPPED)))
        return Block(self.mp1.put(part), size, first, first if self.keeps else 0)

    def relax(self, chosen: Mask, sweep: int) -> None:
        """Relax the chosen sites."""
        mp1, program, level = self.mp1, self.program, self.level
        key = Key(program.problem.seed, level.number, sweep)
        with mp1.section("neighbourhood"):
            self._gather()
        with mp1.where(chosen):
            if level.choice.draws:
                with mp1.section("draw"):
                    self.bits.set(mp1.random(program.place, key, random.DRAW))
            for layer in chosen.layers:
                for block in self.blocks:  # 6.2.2.1
                    self._distances(layer, block)
                if level.choice.draws:  # 6.2.2.2, the Gibbs sampler; ICM takes the nearest candidate, or the mode
                    self._weigh(layer, choose=False)
                    self._weigh(layer, choose=True)
                elif level.choice.mode:
                    self._mode(layer)
            with mp1.section("draw"):
                self._take(key)
            with mp1.section("cooling"):  # 6.2.2.3
                cooled = self.heat + program.problem.xi  # (13)
                program.temperature.set(cooled * (cooled > 0) // self.walk.members)

    def _gather(self) -> None:
        """Fetch the neighbours by one walk, keep them in canonical order, and add up their temperatures."""
        mp1, program = self.mp1, self.program
        self.heat.set(0)
        for number, there in self.walk.neighbours(program.state):
            mp1.count("float", 1 + program.channels)
            mp1.count("integer")
            mp1.execute(instructions.keep, self.near.data, number, there.data, self.heat.data)

    def _distances(self, layer: int, block: Block, again: bool = False) -> None:
        """Accumulate the distances (12) of a block of candidates, and find the least one, to which weights relate."""
        mp1, terms = self.mp1, block.number * self.level.sample[..., 0].size
        with mp1.section("distance"):
            mp1.count("broadcast", terms, layer)
            mp1.count("float", 4 * terms + block.number, layer)
            if not self.level.choice.draws:
                mp1.count("integer", block.number, layer)  # the number of the least one
            mp1.execute(instructions.distance, layer, self.near.data, block, self.draw, not (block.first or again))

    def _weigh(self, layer: int, choose: bool) -> None:
        """Add up the weights (7) of all candidates or, to ``choose`` one, once more as far as the target."""
        mp1, shares = self.mp1, self.program.channels * self.level.choice.density
        for block in self.blocks:
            if not self.keeps:
                self._distances(layer, block, again=True)
            with mp1.section("draw" if choose else "weights"):
                mp1.count("float", EXP * block.number, layer)
                mp1.count("broadcast", shares * block.number, layer)  # the legal share of each channel's kernel
                mp1.count("integer", (2 + 2 * choose + WIDE * shares) * block.number, layer)
                mp1.execute(instructions.weigh, layer, block, self.draw, choose)

    def _mode(self, layer: int) -> None:
        """Move from the nearest candidates to the mode, channel by channel, and choose those that give most."""
        mp1, channels, window = self.mp1, self.program.channels, self.level.choice.window
        greys, width = window.top + 1, 2 * window.radius + 1
        for turn, c in enumerate([*turns(channels), -1]):
            others = channels - (c >= 0)
            for block in self.blocks:
                if not self.keeps:
                    self._distances(layer, block, again=True)
                with mp1.section("weights"):
                    mp1.count("float", (EXP + 2 * others) * block.number, layer)  # converted, times the kernel
                    mp1.count("broadcast", channels * block.number, layer)
                    mp1.count("integer", (2 + 2 * others) * block.number, layer)
                    mp1.execute(instructions.mode, layer, block, self.draw, self.program.state.data, c, not turn)
            with mp1.section("draw"):
                terms, looked = greys * width * (c >= 0), channels * self.level.own[0].size * (not turn)
                mp1.count("broadcast", terms + looked, layer)
                mp1.count("integer", 3 * greys * (c >= 0) + looked, layer)
                mp1.count("float", 2 * terms + greys * (c >= 0), layer)  # smoothed, and the highest

    def _take(self, key: Key) -> None:
        """Take the chosen candidates, or a grey level around each of them."""
        mp1, program, choice = self.mp1, self.program, self.level.choice
        mp1.table(program.source, self.level.source, self.chosen)
        for c in range(0 if choice.mode else program.channels):
            mp1.table(program.state[c], self.level.own[c], self.chosen)
            if choice.density and choice.draws:
                mp1.count("broadcast", len(choice.window.noise))
                mp1.count("integer", PHILOX + len(choice.window.noise))
                mp1.execute(instructions.step, (program.state.data, c), self.draw, program.place.data, key)

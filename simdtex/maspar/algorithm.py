# SPDX-License-Identifier: BSD-3-Clause
"""Algorithm 1 of Paget and Longstaff (1998) as a program for the processor array of the paper.

Everything but the numbers of the ACU is an instruction of `simdtex.maspar.machine.MP1`. The numbers in the comments are
the paper's. The program has the bytes of `simdtex.synthesize` with ``preset="paper"``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.maspar import instructions
from simdtex.maspar.instructions import STEPPED, Broadcast
from simdtex.maspar.machine import EXP, MP1, NOISE, PHILOX, Mask, Plural
from simdtex.maspar.sites import Walk, coloring
from simdtex.methods.mrf.lcpdf import Key, SiteChoice, log_legal, turns
from simdtex.methods.mrf.square import LANES
from simdtex.model.lattice import Grid


class ArrayLevel(NamedTuple):
    """The constants of a level on the ACU.

    ``number`` is l, ``grid`` S^l, and ``choice`` the Gaussian of (7) and what is drawn from it; ``source`` (n,) are the
    pixel indices of the candidates, ``own`` (C, n) their values, ``sample`` (N, C, n) those of their neighbours, and
    ``noise`` (n,) int32 the numbers of their Gumbel noise: 16 times the unit, and the lane (kernels/common/gumbel.h);
    ``free``, the number of sweeps after the equilibrium, which relax all sites or those that are ``kept``.
    """

    number: int
    grid: Grid
    choice: SiteChoice
    source: NDArray[np.int32]
    own: NDArray[np.float32]
    sample: NDArray[np.float32]
    noise: NDArray[np.int32]
    free: int = 0
    kept: bool = False


class Problem(NamedTuple):
    """The input on the ACU.

    ``first`` has the pixel indices and the values (C + 1, n) that sites begin with, ``offsets`` (N, 2) are those of the
    neighbourhood of ``order``, lane by lane (`by_lane`), ``xi`` of (13) is in 1/1024, and ``seed`` keys all random
    numbers.
    """

    first: NDArray[np.int32]
    offsets: NDArray[np.int32]
    order: int
    xi: int
    seed: int


def by_lane(offsets: NDArray[np.int32]) -> NDArray[np.intp]:
    """Return the order (N,) of a neighbourhood's offsets in the sum (12): lane by lane, and row by row in each."""
    return np.lexsort((offsets[:, 1], offsets[:, 0], lane_of(offsets)))


def lane_of(offsets: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the lane (N,) of each offset: its column in the square around the neighbourhood, modulo `LANES`."""
    columns: NDArray[np.int32] = offsets[:, 1] + offsets[:, 1].max()
    return columns % np.int32(LANES)


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

    def relax(self, level: ArrayLevel) -> Iterator[tuple[int, NDArray[np.bool_]]]:
        """Relax a level until its end; after each step, yield its sweep and the (layers, PEs) that relaxed.

        Sites of the level above have t = 0, since that is its equilibrium; all others have t = 1 yet.
        """
        mp1, t, seed = self.mp1, self.temperature, self.problem.seed
        with mp1.frame():
            with mp1.section("colouring"):
                walk = Walk(mp1, level.grid, self.problem.offsets)  # 3, 4, 6.1
                color, colors = coloring(mp1, walk, self.problem.order, seed)
            relaxation, free = Pass(self, level, walk), level.free
            for sweep in count(1):
                with mp1.section("schedule"), mp1.where(walk.sites):
                    active = t > 0
                    if not mp1.any(active):  # 6.2
                        free -= 1
                        active = (walk.row | walk.col) % 2 == 0 if level.kept else walk.row >= 0
                if free < 0:
                    break
                bits = random.draw4(seed, level.number, sweep, np.arange(colors), random.SCHEDULE)[0]
                for now in np.argsort(bits, kind="stable").tolist():  # 6.2.1
                    with mp1.section("schedule"), mp1.where(walk.sites), mp1.where((color == now) & active) as chosen:
                        mp1.count(reduction=1)  # which layers have a site to relax
                    if chosen.layers:
                        relaxation.relax(chosen, sweep)  # 6.2.2
                        yield sweep, chosen.active


class Pass:
    """The relaxation of all chosen sites of a level in parallel, 6.2.2."""

    def __init__(self, program: Program, level: ArrayLevel, walk: Walk) -> None:
        mp1, (neighbours, channels, _), choice = program.mp1, level.sample.shape, level.choice
        self.mp1, self.program, self.level, self.walk, self.channels = mp1, program, level, walk, channels
        self.near, self.heat = mp1.plural("float32", neighbours * (channels + 1)), mp1.plural()
        self.least, self.chosen = mp1.plural("float32"), mp1.plural()
        mp1.reserve(4 * (channels + 1) * mp1.layers)  # what walks through the neighbourhoods
        self.mass = mp1.plural("uint64", (choice.window.top + 1) * choice.mode, shared=True)
        self.shares = channels * (choice.draws and choice.density)  # legal shares of kernels
        share = log_legal(level.own, choice.window) if self.shares else np.zeros_like(level.own)
        lanes = np.searchsorted(lane_of(program.problem.offsets), np.arange(LANES + 1)).astype(np.int32)
        self.sample = Broadcast(mp1.put(level.sample, STEPPED), lanes, *map(mp1.put, (level.own, share, level.noise)))

    def relax(self, chosen: Mask, sweep: int) -> None:
        """Relax the chosen sites."""
        mp1, program, choice = self.mp1, self.program, self.level.choice
        key = Key(program.problem.seed, self.level.number, sweep)
        with mp1.section("neighbourhood"):
            self._gather()
        with mp1.where(chosen), mp1.section("draw"):
            for layer in chosen.layers:
                with mp1.where(layer):  # 6.2.2.1, and 6.2.2.2: the Gibbs sampler with noise, ICM without, or the mode
                    self._broadcast(float=1, integer=2)  # comparison, and what is the best so far
                    if choice.draws:
                        noise = {"integer": NOISE["integer"], "float": NOISE["float"] + self.shares}
                        self._each(**noise, broadcast=1 + self.shares)
                    best = (self.near, self.least, self.chosen)
                    draw = (choice.spread, program.place, key)
                    mp1.execute(instructions.lcpdf_choose, self.sample, *best, *draw, C=self.channels)
                    if choice.mode:
                        self._mode()
            self._take(key)
            with mp1.section("cooling"):  # 6.2.2.3
                cooled = self.heat + program.problem.xi  # (13)
                program.temperature.set(cooled * (cooled > 0) // self.walk.members)

    def _gather(self) -> None:
        """Fetch the neighbours by one walk, keep them in canonical order, and add up their temperatures."""
        mp1 = self.mp1
        self.heat.set(0)
        for offset, there in self.walk.neighbours(self.program.state):
            mp1.count(float=1 + self.channels, integer=1)
            mp1.execute(instructions.lcpdf_keep, self.near, offset, there, self.heat, C=self.channels)

    def _broadcast(self, **each: int) -> None:
        """Count the broadcast of all candidates, the distances (12), summed by lane, and instructions for each."""
        terms = self.level.sample[..., 0].size
        with self.mp1.section("distance"):
            self._each(broadcast=terms, float=4 * terms + LANES - 1)
        self._each(**each)

    def _each(self, **numbers: int) -> None:
        self.mp1.count(**{kind: count * self.level.own.shape[1] for kind, count in numbers.items()})

    def _mode(self) -> None:
        """Move from the nearest candidates to the mode, channel by channel, and choose those that give most."""
        mp1, x, window = self.mp1, self.program.state, self.level.choice.window
        greys, width = window.top + 1, 2 * window.radius + 1
        for c in range(self.channels):
            mp1.table(x[c], self.level.own[c], self.chosen)
        for c in [*turns(self.channels), -1]:
            others = self.channels - (c >= 0)
            with mp1.section("weights"):  # converted, times (7)
                self._broadcast(float=EXP + 2 * others, broadcast=self.channels, integer=2 + 2 * others)
                best = (self.near, self.least, self.chosen)
                mp1.execute(instructions.lcpdf_mode, self.sample, *best, window, self.mass, x, c, C=self.channels)
            if c >= 0:
                mp1.count(broadcast=greys * width, integer=3 * greys, float=(2 * width + 1) * greys)
                mp1.execute(instructions.lcpdf_highest, self.mass, window, x[c], C=self.channels)

    def _take(self, key: Key) -> None:
        """Take the chosen candidates, or a grey level around each of them."""
        mp1, program, choice = self.mp1, self.program, self.level.choice
        mp1.table(program.source, self.level.source, self.chosen)
        for c in range(0 if choice.mode else self.channels):
            mp1.table(program.state[c], self.level.own[c], self.chosen)
            if self.shares:
                mp1.count(broadcast=len(choice.window.noise), integer=PHILOX + len(choice.window.noise))
                mp1.execute(instructions.lcpdf_step, program.state[c], choice.window, program.place, key, c)


def heat_bath_chances(temperatures: Sequence[float], neighbours: int) -> NDArray[np.uint32]:
    """Return the probabilities of spin up, in units of 2**-32: (temperatures, N + 1, N + 1) uint32.

    P(up) = 1 / (1 + exp(-2 S / T)), rounded, for a site with n neighbours on the lattice of which u are up, S = 2 u -
    n, and temperatures in units of J / k_B. Probabilities that round to 1 are 1 - 2**-32.
    """
    from scipy.special import expit

    members, up = np.indices((neighbours + 1, neighbours + 1))
    field = 2.0 * (2 * up - members)
    with np.errstate(over="ignore"):  # at a tiny temperature the probabilities are 0, 1/2 and 1
        chance = expit(field / np.asarray(temperatures, np.float64)[:, None, None])
    whole: NDArray[np.uint32] = np.minimum(np.rint(chance * 2.0**32), 2.0**32 - 1).astype(np.uint32)
    return whole


def ising(mp1: MP1, temperature: float, sweeps: int, seed: int, synchronous: bool = False) -> Plural:
    """Return Ising spins, 0 or 1, after sweeps of heat-bath relaxation of a checkerboard, or of all sites together.

    The picture fills the array, so that the X-Net's edges are those of a torus. All spins are up at first.
    """
    chances = heat_bath_chances([temperature], 4)[0, 4]
    spin, chance, place = mp1.plural(), mp1.plural("uint64"), mp1.row * mp1.shape[1] + mp1.col
    spin.set(1)
    square = (mp1.row + mp1.col) % (1 if synchronous else 2)
    for sweep in range(1, sweeps + 1):
        for color in range(1 if synchronous else 2):
            with mp1.where(square == color):  # no other PE changes its spin
                up = mp1.xnet(spin, -1, 0) + mp1.xnet(spin, 0, -1) + mp1.xnet(spin, 0, 1) + mp1.xnet(spin, 1, 0)
                mp1.table(chance, chances, up)  # of this temperature, by the number of neighbours that are up
                bits = mp1.random(place, Key(seed, 0, sweep), random.DRAW) & (2**32 - 1)
                spin.set(bits < chance)
    return spin

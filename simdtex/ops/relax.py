# SPDX-License-Identifier: BSD-3-Clause
"""Step 6.2.2 of Algorithm 1: the relaxation of a site, for all sites of a step in parallel.

A `Relaxation` defines how a site relaxes: its neighbourhood, the proposed candidates (`Everything` or `Listed`), the
choice among them, and its cooling. `relax` works in place, step after step; `relax_apart` does not change the field.
The twins call the parts one after another. A device executes one kernel, ``kernels/relax.cl``, or several kernels if
there are more candidates than a work-item can keep, or for the mode of a density.
"""

from __future__ import annotations

from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import LATTICE, Grid
from simdtex.model.sample import Candidates
from simdtex.ops import lcpdf
from simdtex.ops.charge import charge
from simdtex.ops.coherence import coherence, continuing, sources
from simdtex.ops.commit import commit
from simdtex.ops.costs import Costs
from simdtex.ops.lcpdf import Choice, Distances, Key, Relaxed
from simdtex.ops.nearest import Strip, nearest
from simdtex.ops.neighbourhood import USUAL, Confidences, Field, gathered, neighbourhood
from simdtex.ops.square import Square
from simdtex.ops.temperature import temperature

AGAIN = np.float32(4)
"""Ratio of the penalty for repeating a neighbour's source to that for continuing it, as in kernels/relax.cl."""

KEPT = 1024
"""The most distances that a work-item can keep; several kernels evaluate more candidates."""

EXHAUSTIVE = 64
"""The most candidates of a level that a coherent search evaluates exhaustively."""

SUGGESTING = 12
"""Number of nearest neighbours that each suggest a candidate in a coherent search, as in kernels/relax.cl."""


class Everything(NamedTuple):
    """The exact search, which proposes every candidate of the level; ``strip`` has their pixels row by row."""

    candidates: Candidates
    strip: Strip

    @property
    def slots(self) -> int:
        """Number of candidates that a site evaluates."""
        return self.candidates.size

    def weighed(
        self, sites: NDArray[np.int32], field: Field, relaxation: Relaxation, turn: int
    ) -> tuple[NDArray[np.int64], Distances]:
        """Return the numbers (slots, 1) of the candidates, and their distances with all costs."""
        near = neighbourhood.reference(sites, field, relaxation.offsets, relaxation.grid, relaxation.confidences)
        found = lcpdf.distance.reference(near, self.candidates)
        where = (sites, field, relaxation.offsets, relaxation.grid)
        found = coherence.reference(found, self.candidates, *where, relaxation.discount)
        found = charge.reference(found, self.candidates, sites, relaxation.costs)
        if relaxation.novelty > 0:
            self.add_novelty(found.distance, sites, field, relaxation)
        return np.arange(self.slots)[:, None], found

    def add_novelty(
        self, d: NDArray[np.float32], sites: NDArray[np.int32], field: Field, relaxation: Relaxation
    ) -> None:
        """Add to distances (slots, S), in place, the cost of continuing or repeating a neighbour's source."""
        source = sources(relaxation.grid.neighbours(sites, relaxation.offsets), field)
        same = np.where(source >= 0, self.candidates.index_of[source], -1)
        for pair in zip(continuing(self.candidates, source), same, strict=True):  # in canonical order
            for numbers, cost in zip(pair, (relaxation.novelty, AGAIN * relaxation.novelty), strict=True):
                here = np.flatnonzero(numbers >= 0)
                d[numbers[here], here] += cost


class Listed(NamedTuple):
    """The coherent search, which proposes the candidates that neighbours suggest and a few more.

    ``square``: the candidates' pixels side by side; ``neighbours``: N; ``chance``: the number of random candidates.
    """

    candidates: Candidates
    square: Square
    neighbours: int
    chance: int

    @property
    def slots(self) -> int:
        """The most candidates that a site evaluates."""
        return min(most_listed(self.neighbours, self.chance), self.candidates.size)

    def weighed(
        self, sites: NDArray[np.int32], field: Field, relaxation: Relaxation, turn: int
    ) -> tuple[NDArray[np.int64], Distances]:
        """Return the numbers (slots, S) of the candidates, -1 in empty slots, and their distances, infinity there."""
        r = relaxation.grid.neighbours(sites, relaxation.offsets)
        numbers, suggested = self._list(sites, r, field, relaxation, turn)
        offsets = relaxation.offsets
        if relaxation.confidences.guides:
            offsets = np.concatenate([offsets, np.zeros((1, 2), np.int32)])
        d = self.square.distance(numbers, *gathered(sites, r, field, relaxation.confidences), offsets)
        d = relaxation.costs.added(np.where(suggested, d * relaxation.discount, d), numbers, sites, self.candidates)
        return numbers, Distances(d, None, sites.size)

    def _list(
        self, sites: NDArray[np.int32], r: NDArray[np.int32], field: Field, relaxation: Relaxation, turn: int
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the numbers of the candidates, and a mask of those that neighbours suggest."""
        numbers = np.full((self.slots + 1, sites.size), -1)  # one more for a repeated number
        size = np.zeros(sites.size, np.int64)

        def add(number: NDArray[np.integer[Any]]) -> None:
            new = (number >= 0) & ~(numbers == number).any(0)
            numbers[size[new], np.flatnonzero(new)] = number[new]
            size[new] += 1

        for suggestion in continuing(self.candidates, sources(r, field))[:SUGGESTING]:
            add(suggestion)
        suggested = np.arange(self.slots)[:, None] < size
        present = field.source.ravel()[sites]
        add(np.where(present < 0, -1, self.candidates.index_of[present]))
        draws, places = np.maximum(self.chance, size == 0), relaxation.grid.places(sites)
        for k in range(draws.max()):
            word = random.draw4(relaxation.seed, relaxation.level, turn, places, random.SEARCH, k // 4)[k % 4]
            number = (word.astype(np.uint64) * np.uint64(self.candidates.size)) >> np.uint64(32)
            add(np.where(k < draws, number.astype(np.int64), -1))
        return numbers[:-1], suggested


def most_listed(neighbours: int, chance: int) -> int:
    """Return the most candidates that a coherent search proposes: suggestions, the current source, random ones."""
    return min(SUGGESTING, neighbours) + 1 + max(1, chance)


LEVEL = np.dtype(
    [
        ("lattice", LATTICE),
        ("seed", np.uint64),
        ("level", np.uint32),
        *((name, np.int32) for name in ("area", "neighbours", "pixels", "candidates", "chance")),
        *((name, np.int32) for name in ("plane", "down", "deep", "first", "pitch", "size", "strip_rows", "strip_cols")),
        *((name, np.int32) for name in ("strip_high", "thick")),
        *((name, np.float32) for name in ("discount", "scale")),
        *((name, np.int32) for name in ("radius", "top", "draws", "xi")),
        ("novelty", np.float32),
        ("centre", np.float32),
        ("hard", np.float32),
    ],
    align=True,
)
"""The struct ``Level`` of kernels/common/level.h."""


def constants(grid: Grid, **values: Any) -> np.void:
    """Return a value of the type `LEVEL` with the grid and the fields ``values``; all other fields are 0."""
    numbers = np.zeros((), LEVEL)
    numbers["lattice"] = grid.struct
    for name, value in values.items():
        numbers[name] = value
    struct: np.void = numbers[()]  # type: ignore[assignment]
    return struct


class Relaxation(NamedTuple):
    """The definition of a site's relaxation.

    ``grid`` and ``offsets``: its lattice and neighbourhood; ``proposal``: the candidates; ``discount``: 1 / (1 +
    coherence), the factor of the distance of candidates that continue a neighbour's source; ``novelty``: the penalty
    for each neighbour whose source the candidate continues, and `AGAIN` times that for each whose source it is;
    ``costs`` of each candidate; ``choice`` among them; ``confidences`` of values; ``xi`` of equation (13) in 1/1024;
    ``seed`` and ``level``: the keys of its random numbers.
    """

    grid: Grid
    offsets: Array
    proposal: Everything | Listed
    discount: np.float32
    novelty: np.float32
    costs: Costs
    choice: Choice
    xi: int
    seed: int
    level: int
    confidences: Confidences = USUAL

    @property
    def fused(self) -> bool:
        """Whether a device relaxes a site in one kernel."""
        return isinstance(self.proposal, Listed) or (self.proposal.slots <= KEPT and not self.choice.mode)


@Operation
def relax_apart(
    machine: Launcher | None, sites: Array, field: Field, weighed: Array, relaxation: Relaxation, turn: int
) -> tuple[Relaxed, Array]:
    """Return new values and temperatures of sites that relax together, without a change of the field."""
    if machine is None:
        key, places = Key(relaxation.seed, relaxation.level, turn), relaxation.grid.places(sites)
        proposal = relaxation.proposal
        numbers, distances = proposal.weighed(sites, field, relaxation, turn)  # 6.2.2.1
        relaxed = lcpdf.taken(numbers, distances, proposal.candidates, places, relaxation.choice, key)  # 6.2.2.2
        cooled = temperature.reference(sites, field, relaxation.offsets, relaxation.grid, relaxation.xi)  # 6.2.2.3
        if isinstance(proposal, Listed):
            weighed.ravel()[sites] += (numbers >= 0).sum(0).astype(np.int32)
        return relaxed, cooled
    if not relaxation.fused:
        return _staged(machine, sites, field, relaxation, turn)
    made = len(field.values) - relaxation.confidences.guides
    relaxed = Relaxed(machine.empty((sites.size,), np.int32), machine.empty((made, sites.size), np.uint16))
    cooled = machine.empty((sites.size,), np.uint16)
    name, defines, arguments = _fused(machine, sites, field, weighed, relaxation, turn)
    defines["APART"] = 1
    machine.launch(name, (sites.size,), *arguments, relaxed.values, relaxed.choice, cooled, defines=defines)
    return relaxed, cooled


@Operation
def relax(
    machine: Launcher | None,
    sites: Array,
    steps: NDArray[np.int64],
    field: Field,
    weighed: Array,
    relaxation: Relaxation,
    turn: int,
) -> Field:
    """Relax sites step after step, in place, and return the field.

    Sites ``steps[0, 0]`` to ``steps[0, 1]`` - 1 of a list relax together, then those of ``steps[1]``, and so on; no two
    that relax together may be neighbours. ``steps`` (steps, 2) int64; ``weighed`` (H, W) int32 counts the candidates of
    `Listed` that each site has evaluated. Cost: evaluated candidates x |N| x C x 2 fma.
    """
    if machine is None:
        most = max(1, 2**20 // relaxation.proposal.slots)
        for begin, end in steps.tolist():
            pieces = [sites[first : min(end, first + most)] for first in range(begin, end, most)]
            done = [relax_apart.reference(here, field, weighed, relaxation, turn) for here in pieces]
            for here, (relaxed, cooled) in zip(pieces, done, strict=True):
                field = commit.reference(field, here, relaxed, cooled)
        return field
    if relaxation.fused:
        name, defines, arguments = _fused(machine, sites, field, weighed, relaxation, turn)
        machine.launch_groups(name, steps, *arguments, *field, defines=defines)
        return field
    for begin, end in steps.tolist():
        here = machine.part(sites, begin, end)
        relaxed, cooled = _staged(machine, here, field, relaxation, turn)
        field = commit(machine, field, here, relaxed, cooled)
    return field


def _staged(machine: Launcher, sites: Array, field: Field, relaxation: Relaxation, turn: int) -> tuple[Relaxed, Array]:
    """Return new values and temperatures by the exact search in several kernels."""
    grid, offsets, proposal, choice = relaxation.grid, relaxation.offsets, relaxation.proposal, relaxation.choice
    assert isinstance(proposal, Everything)
    candidates = proposal.candidates
    if not (choice.draws or choice.mode or relaxation.confidences.own):
        relaxed = nearest(
            machine, sites, field, offsets, grid, candidates, proposal.strip, relaxation.discount, relaxation.costs
        )
    else:
        near = neighbourhood(machine, sites, field, offsets, grid, relaxation.confidences)
        distances = lcpdf.distance(machine, near, candidates)
        if relaxation.discount != 1:
            distances = coherence(machine, distances, candidates, sites, field, offsets, grid, relaxation.discount)
        distances = charge(machine, distances, candidates, sites, relaxation.costs)
        key = Key(relaxation.seed, relaxation.level, turn)
        relaxed = lcpdf.take(machine, distances, candidates, sites, grid, choice, key)
    return relaxed, temperature(machine, sites, field, offsets, grid, relaxation.xi)


def _fused(
    machine: Launcher, sites: Array, field: Field, weighed: Array, relaxation: Relaxation, turn: int
) -> tuple[str, dict[str, int], list[Any]]:
    """Return the kernel of a relaxation, its -D constants, and its arguments without its results."""
    grid, offsets, proposal, choice = relaxation.grid, relaxation.offsets, relaxation.proposal, relaxation.choice
    candidates, window, confidences = proposal.candidates, choice.window, relaxation.confidences
    level: dict[str, Any] = {
        **{"seed": relaxation.seed, "level": relaxation.level, "area": prod(field.source.shape)},
        **{"neighbours": offsets.shape[0], "pixels": candidates.plane, "candidates": candidates.size},
        **{"discount": relaxation.discount, "scale": window.scale, "top": window.top, "draws": choice.draws},
        **{"radius": window.radius if choice.density else -1, "xi": relaxation.xi, "novelty": relaxation.novelty},
        **{"centre": confidences.centre, "hard": confidences.hard},
    }
    common = (offsets, candidates.reach, candidates.index_of, candidates.positions)
    noise, key = machine.constant(window.noise), np.uint32(turn)
    defines = {"C": len(field.values), "V": machine.vector} | ({"TILES": 1} if grid.tile else {})
    defines |= confidences.defines | relaxation.costs.defines
    costs = relaxation.costs.arguments(machine, candidates)
    own: list[Any]
    if isinstance(proposal, Everything):
        strip = proposal.strip
        level |= {"first": strip.first, "pitch": strip.pitch, "size": strip.pixels.shape[1]}
        level |= {"strip_rows": strip.rows, "strip_cols": strip.cols, "strip_high": strip.high, "thick": strip.thick}
        most = 256 if proposal.slots <= 256 else KEPT  # so that few programs suffice
        defines |= {"ALL": most, "N": -(-offsets.shape[0] // 64) * 64, "STEP": machine.step}
        name, own = "relax_all", [strip.pixels, strip.reach, *costs, noise, key]
    else:
        square = proposal.square
        level |= {"plane": square.levels.shape[1], "down": square.down, "deep": square.deep, "chance": proposal.chance}
        defines |= {"CUBE": 1} if grid.layers > 1 else {}
        defines |= {"RADIUS": square.disc.shape[0] // 2, "SLOTS": -(-proposal.slots // 64) * 64}
        name, own = "relax_list", [square.disc, square.at, square.levels, *costs, noise, weighed, key]
    arguments = [sites, 0, sites.size, *field, constants(grid, **level), *common, *own]
    return name, defines, arguments

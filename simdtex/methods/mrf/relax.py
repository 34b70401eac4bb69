# SPDX-License-Identifier: BSD-3-Clause
"""Step 6.2.2 of Algorithm 1: the relaxation of a site, for all sites of a step in parallel.

A `Relaxation` defines how a site relaxes: its neighbourhood, the proposed candidates (`AllCandidates` or
`CandidateList`), their costs (`simdtex.methods.mrf.costs`), the choice among them, and its cooling. `relax` works in
place, step after step; `relax_out_of_place` does not change the field. A device executes one kernel,
of ``kernels/mrf/relax_coherent.cl`` or ``relax_exact.cl``, or for the mode of a density of ``lcpdf.cl``.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import prod
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.methods.mrf import lcpdf
from simdtex.methods.mrf.arithmetic import minus_gumbel
from simdtex.methods.mrf.commit import commit
from simdtex.methods.mrf.costs import Costs, continuing
from simdtex.methods.mrf.lcpdf import Key, Relaxed, SiteChoice
from simdtex.methods.mrf.neighbourhood import USUAL, Confidences, Field, Near, near
from simdtex.methods.mrf.square import LANES, Square
from simdtex.methods.mrf.temperature import temperature
from simdtex.model.guide import UNKNOWN
from simdtex.model.lattice import LATTICE, Grid
from simdtex.model.sample import Candidates

EXHAUSTIVE = 64
"""The most candidates of a level that a coherent search evaluates exhaustively."""

SUGGESTING = 12
"""Number of nearest neighbours that each suggest a candidate in a coherent search: kernels/mrf/relax_coherent.cl."""

ALIKE = 64
"""The most candidates that count as alike in known variables, unless they are equal in these."""

IN_PHASE = 128
"""The most candidates of a phase."""

FEW = 16
"""Candidates of a phase, on average, below which those of the neighbouring phases are added."""

BLOCK = tuple((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1))
"""A phase and its 8 neighbours."""

PAIRS = 2**18
"""The most pairs of sites and candidates that the twin evaluates together."""


class AllCandidates(NamedTuple):
    """The exact search, which proposes every candidate of the level; ``square`` has their pixels side by side."""

    candidates: Candidates
    square: Square

    @property
    def slots(self) -> int:
        """Number of candidates that a site evaluates."""
        return self.candidates.size

    @property
    def chance(self) -> int:
        """Number of random candidates: none."""
        return 0

    def propose(self, around: Near, relaxation: Relaxation, turn: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the numbers (slots, 1) of the candidates, and a mask (slots, S) of those that are coherent."""
        coherent = np.zeros((self.slots, around.sites.size), bool)
        candidate = continuing(self.candidates, around.source)
        k, s = np.nonzero(candidate >= 0)
        coherent[candidate[k, s], s] = True
        return np.arange(self.slots)[:, None], coherent


class InPhase(NamedTuple):
    """The candidates of each phase of a regular sample, or those that are alike in the variables known at a site.

    ``begin`` (phases + 1,) int32: those of phase f are ``numbers[begin[f]]`` .. ``numbers[begin[f + 1] - 1]``, int32;
    ``sites`` (H, W) int32, the phase of each site.
    """

    begin: Array
    numbers: Array
    sites: Array


def in_phase(of: NDArray[np.int32], divisions: tuple[int, int]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return ``begin`` and ``numbers`` of `InPhase` for candidates with the phases ``of`` (n,).

    Where a phase has few candidates on average, those of its 8 neighbours are added. A phase without any has some of
    all. Of more than `IN_PHASE` candidates so many remain, evenly spaced.
    """
    count, numbers = divisions[0] * divisions[1], np.arange(of.size, dtype=np.int32)
    some = numbers[:: -(-of.size // IN_PHASE)]
    if of.size < FEW * count:
        row, col = np.divmod(of, divisions[1])
        around = [((row + i) % divisions[0]) * divisions[1] + (col + j) % divisions[1] for i, j in BLOCK]
        of, numbers = np.concatenate(around), np.tile(numbers, len(BLOCK))
    empty = np.flatnonzero(np.bincount(of, minlength=count) == 0)
    of = np.concatenate([of, np.repeat(empty, some.size)])
    numbers = np.concatenate([numbers, np.tile(some, empty.size)])
    order = np.argsort(of.astype(np.min_scalar_type(count)), kind="stable")  # of 16 bits in linear time
    many = np.bincount(of, minlength=count)
    first, kept = np.cumsum(many) - many, np.minimum(many, IN_PHASE)
    begin = np.concatenate([[0], np.cumsum(kept)])
    place = np.arange(begin[-1]) - np.repeat(begin[:-1], kept)
    chosen = np.repeat(first, kept) + place * np.repeat(many, kept) // np.repeat(np.maximum(kept, 1), kept)
    return begin.astype(np.int32), numbers[order[chosen]]


def alike(own: NDArray[np.uint16], wanted: NDArray[np.uint16]) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Yield the numbers of some candidates that are alike in known variables, and the sites with about their values.

    ``own`` (K, n) are the levels of the candidates, ``wanted`` (K, sites) those of the sites, `UNKNOWN` if unknown. The
    candidates are halved at the median of the variable with the largest range, until they are no more than `ALIKE`.
    """
    known = wanted != UNKNOWN
    for those in np.unique(known, axis=1).T:
        parts = [(np.arange(own.shape[1]), np.flatnonzero((those == known.T).all(1)))] if those.any() else []
        while parts:
            numbers, sites = parts.pop()
            ranges = np.ptp(own[:, numbers], 1) * those
            if numbers.size <= ALIKE or not ranges.any():
                yield numbers, sites
                continue
            y, x = own[ranges.argmax(), numbers], wanted[ranges.argmax(), sites]
            middle = max(np.partition(y, y.size // 2)[y.size // 2], y.min() + 1)
            halves = ((numbers[low], sites[at]) for low, at in ((y < middle, x < middle), (y >= middle, x >= middle)))
            parts += [half for half in halves if half[1].size]


class CandidateList(NamedTuple):
    """The coherent search, which proposes the candidates that neighbours suggest and a few more.

    ``square``: the candidates' pixels side by side; ``neighbours``: N; ``chance``: the number of random candidates;
    ``phases``: the candidates of each phase, of which the random ones are.
    """

    candidates: Candidates
    square: Square
    neighbours: int
    chance: int
    phases: InPhase | None = None

    @property
    def slots(self) -> int:
        """The most candidates that a site evaluates."""
        return min(most_listed(self.neighbours, self.chance), self.candidates.size)

    def propose(self, around: Near, relaxation: Relaxation, turn: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the numbers (slots, S) of the candidates, -1 in empty slots, and a mask of those that are coherent."""
        sites = around.sites
        numbers = np.full((self.slots + 1, sites.size), -1)  # one more for a repeated number
        size = np.zeros(sites.size, np.int64)

        def add(candidate: NDArray[np.integer[Any]]) -> None:
            new = (candidate >= 0) & ~(numbers == candidate).any(0)
            numbers[size[new], np.flatnonzero(new)] = candidate[new]
            size[new] += 1

        for suggestion in continuing(self.candidates, around.source)[:SUGGESTING]:
            add(suggestion)
        coherent = np.arange(self.slots)[:, None] < size
        add(self.candidates.number_of(around.own))
        draws, places = np.maximum(self.chance, size == 0), relaxation.grid.places(sites)
        every = np.zeros(sites.size, np.int64), np.full(sites.size, self.candidates.size)
        first, many = every if self.phases is None else self._of_phase(sites)
        for k in range(draws.max()):
            word = random.draw4(relaxation.seed, relaxation.level, turn, places, random.SEARCH, k // 4)[k % 4]
            candidate = ((word.astype(np.uint64) * many.astype(np.uint64)) >> np.uint64(32)).astype(np.int64)
            if self.phases is not None:  # if there are no more than draws, each of them once
                candidate = np.where(many <= draws, np.where(k < many, k, -1), candidate)
                candidate = np.where(candidate < 0, -1, self.phases.numbers[np.maximum(first + candidate, 0)])
            add(np.where(k < draws, candidate, -1))
        return numbers[:-1], coherent

    def _of_phase(self, sites: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return where the candidates of each site's phase begin in ``phases.numbers``, and how many there are."""
        assert self.phases
        begin = self.phases.begin.astype(np.int64)
        phase = self.phases.sites.ravel()[sites]
        return begin[phase], begin[phase + 1] - begin[phase]


def most_listed(neighbours: int, chance: int) -> int:
    """Return the most candidates that a coherent search proposes: suggestions, the current source, random ones."""
    return min(SUGGESTING, neighbours) + 1 + max(1, chance)


LEVEL = np.dtype(
    [
        ("lattice", LATTICE),
        ("seed", np.uint64),
        ("level", np.uint32),
        *((name, np.int32) for name in ("area", "neighbours", "pixels", "candidates", "chance")),
        *((name, np.int32) for name in ("plane", "row_stride", "layer_stride", "cols", "runs")),
        *((name, np.float32) for name in ("discount", "scale", "spread")),
        *((name, np.int32) for name in ("radius", "top", "xi")),
        *((name, np.float32) for name in ("novelty", "centre", "hard", "centre_known")),
    ],
    align=True,
)
"""The struct ``Level`` of kernels/mrf/level.h."""


def constants(grid: Grid, **values: Any) -> np.void:
    """Return a value of the type `LEVEL` with the grid and the fields ``values``; all other fields are 0."""
    numbers = np.zeros((), LEVEL)
    numbers["lattice"] = grid.struct
    for name, value in values.items():
        numbers[name] = value
    return cast(np.void, numbers[()])


class Evaluated(NamedTuple):
    """Candidates of sites, in NumPy: their ``numbers`` (slots, S or 1), and the ``cost`` (slots, S) of each.

    An empty slot has the number -1 and an infinite cost.
    """

    numbers: NDArray[np.int64]
    cost: NDArray[np.float32]


class Relaxation(NamedTuple):
    """The definition of a site's relaxation.

    ``grid`` and ``offsets``: its lattice and neighbourhood; ``proposal``: the candidates; ``costs`` of each candidate;
    ``choice`` among them; ``xi`` of equation (13) in 1/1024; ``seed`` and ``level``: the keys of its random numbers;
    ``confidences`` of values.
    """

    grid: Grid
    offsets: Array
    proposal: AllCandidates | CandidateList
    costs: Costs
    choice: SiteChoice
    xi: int
    seed: int
    level: int
    confidences: Confidences = USUAL

    def evaluate(
        self, sites: NDArray[np.int32], field: Field, turn: int, terms: dict[str, Any] | None = None
    ) -> Evaluated:
        """Return the candidates of sites with all costs, in NumPy; ``terms`` receives each cost (slots, S) by name."""
        around = near(sites, field, self.offsets, self.grid, self.confidences)
        numbers, coherent = self.proposal.propose(around, self, turn)
        candidates, square = self.proposal[:2]
        cost = self.costs.evaluate(numbers, coherent, around, candidates, square, self.offsets, terms)
        return Evaluated(numbers, cost)

    def noise(self, numbers: NDArray[np.int64], places: NDArray[np.int64], turn: int) -> NDArray[np.float32]:
        """Return the noise of a draw, -G_p, of candidates (slots, S or 1) at places (S,): kernels/common/gumbel.h.

        For a density the logarithm of the legal share of each pixel's kernel is subtracted.
        """
        candidates, square = self.proposal[:2]
        row, col = np.divmod(np.maximum(numbers, 0), square.cols)
        units = -(-square.cols // (square.runs * LANES))
        unit, lane = np.divmod(col // square.runs, LANES)
        unit = unit + (row * square.runs + col % square.runs) * units
        draws, at = np.unique(unit // 4 * LANES + lane, return_inverse=True)
        at = at.reshape(numbers.shape)
        words = np.stack(random.draw4(self.seed, self.level, turn, places, random.GUMBEL, draws[:, None]))
        noise = minus_gumbel(words[unit % 4, at, np.arange(places.size)])
        for plane in candidates.pixels if self.choice.density else ():
            noise = noise - lcpdf.log_legal(plane[candidates.positions[np.maximum(numbers, 0)]], self.choice.window)
        return noise

    def arguments(self, machine: Launcher, sites: Array, field: Field) -> tuple[dict[str, int], list[Any]]:
        """Return the -D constants and the first arguments of kernels that evaluate candidates."""
        (candidates, square), choice, costs = self.proposal[:2], self.choice, self.costs
        window, confidences = choice.window, self.confidences
        level: dict[str, Any] = {
            **{"seed": self.seed, "level": self.level, "area": prod(field.source.shape), "xi": self.xi},
            **{"neighbours": self.offsets.shape[0], "pixels": candidates.plane, "candidates": candidates.size},
            **{"plane": square.levels.shape[1], "row_stride": square.row_stride},
            **{"layer_stride": square.layer_stride, "cols": square.cols, "runs": square.runs},
            **{"discount": costs.discount, "novelty": costs.novelty},
            **{"scale": window.scale, "spread": choice.spread, "top": window.top},
            **{"radius": window.radius if choice.density else -1, "centre": confidences.centre},
            **{"hard": confidences.hard, "centre_known": confidences.centre_known, "chance": self.proposal.chance},
        }
        most = -(-self.offsets.shape[0] // 64) * 64  # so that few programs suffice
        defines = {"C": len(field.values), "V": machine.vector, "RADIUS": square.disc.shape[0] // 2, "N": most}
        defines |= {"ORDER": square.order * self.grid.layered, "TILES": int(bool(self.grid.tile)), "ITEMS": 1, "HOT": 0}
        defines |= confidences.defines | costs.defines | self.grid.defines
        return defines, [
            *(sites, 0, sites.size, *field, constants(self.grid, **level), self.offsets),
            *(candidates.reach, candidates.index_of, candidates.positions, square.disc, square.looks),
            *(square.at, square.levels, *costs.arguments(machine, candidates)),
        ]


@Operation
def relax_out_of_place(
    machine: Launcher | None, sites: Array, field: Field, evaluations: Array, relaxation: Relaxation, turn: int
) -> tuple[Relaxed, Array]:
    """Return new values and temperatures of sites that relax together, without a change of the field."""
    choice = relaxation.choice
    if machine is None:
        places = relaxation.grid.places(sites)
        numbers, cost = relaxation.evaluate(sites, field, turn)  # 6.2.2.1
        noise = relaxation.noise(numbers, places, turn) if choice.draws else np.float32(0)
        key = Key(relaxation.seed, relaxation.level, turn)
        relaxed = lcpdf.taken(numbers, cost, noise, relaxation.proposal.candidates, places, choice, key)  # 6.2.2.2
        cooled = temperature.reference(sites, field, relaxation.offsets, relaxation.grid, relaxation.xi)  # 6.2.2.3
        if isinstance(relaxation.proposal, CandidateList):
            evaluations.ravel()[sites] += (numbers >= 0).sum(0).astype(np.int32)
        return relaxed, cooled
    if choice.mode:
        _, relaxed = lcpdf.density_and_mode(machine, sites, field, relaxation)
        return relaxed, temperature(machine, sites, field, relaxation.offsets, relaxation.grid, relaxation.xi)
    made = len(field.values) - relaxation.confidences.guides
    relaxed = Relaxed(machine.empty((sites.size,), np.int32), machine.empty((made, sites.size), np.uint16))
    cooled = machine.empty((sites.size,), np.uint16)
    kernel, defines, arguments = _kernel(machine, sites, sites.size, field, evaluations, relaxation, turn)
    arguments += [relaxed.values, relaxed.choice, cooled]
    machine.launch(kernel, (sites.size,), *arguments, defines=defines | {"APART": 1})
    return relaxed, cooled


@Operation
def relax(
    machine: Launcher | None,
    sites: Array,
    steps: NDArray[np.int64],
    field: Field,
    evaluations: Array,
    relaxation: Relaxation,
    turn: int,
) -> Field:
    """Relax sites step after step, in place, and return the field.

    Sites ``steps[0, 0]`` to ``steps[0, 1]`` - 1 of a list relax together, then those of ``steps[1]``, and so on; no two
    that relax together may be neighbours. ``steps`` (steps, 2) int64; ``evaluations`` (H, W) int32 counts the
    candidates of `CandidateList` that each site has evaluated. Cost: evaluated candidates x |N| x C x 2 fma.
    """
    if machine is not None and not relaxation.choice.mode:
        count = int((steps[:, 1] - steps[:, 0]).sum())
        kernel, defines, arguments = _kernel(machine, sites, count, field, evaluations, relaxation, turn)
        machine.launch_groups(kernel, steps, *arguments, *field, defines=defines)
        return field
    for begin, end in steps.tolist():
        most = max(1, PAIRS // relaxation.proposal.slots) if machine is None else max(1, end - begin)
        for first in range(begin, end, most):  # no site sees another of its step
            last = min(end, first + most)
            if machine is None:
                here = sites[first:last]
                done = relax_out_of_place.reference(here, field, evaluations, relaxation, turn)
                field = commit.reference(field, here, *done)
            else:
                here = machine.part(sites, first, last)
                done = relax_out_of_place(machine, here, field, evaluations, relaxation, turn)
                field = commit(machine, field, here, *done)
    return field


def _kernel(
    machine: Launcher, sites: Array, count: int, field: Field, evaluations: Array, relaxation: Relaxation, turn: int
) -> tuple[str, dict[str, int], list[Any]]:
    """Return the kernel that relaxes ``count`` of some sites, its -D constants, and its arguments but the results."""
    defines, arguments = relaxation.arguments(machine, sites, field)
    proposal, noise = relaxation.proposal, machine.constant(relaxation.choice.window.noise)
    defines |= {"APART": 0, "NOVEL": int(relaxation.costs.novelty > 0)}
    if isinstance(proposal, AllCandidates):
        kernel, defines["STEP"] = "relax_exact", machine.step
        terms = (relaxation.offsets.shape[0] + bool(relaxation.confidences.guides)) * len(field.values)
        arguments += [noise, np.uint32(turn), machine.fma_counters(sites.size, 2 * count * proposal.slots * terms)]
    else:
        kernel, nothing = "relax_coherent", machine.constant(np.zeros(1, np.int32))
        defines["SLOTS"] = -(-most_listed(proposal.neighbours, proposal.chance) // 64) * 64
        defines |= {"PHASES": int(proposal.phases is not None), "HOT": proposal.square.hot * (machine.vector > 1)}
        arguments += [noise, np.uint32(turn), evaluations, *(proposal.phases or (nothing,) * 3)]
    if machine.items > 1 and _shared(defines, machine.items) <= machine.local_memory:
        defines["ITEMS"] = machine.items
    return kernel, defines, arguments


def _shared(defines: dict[str, int], items: int) -> int:
    """Return the most bytes of local memory that a group of work-items takes in kernels/mrf/relax_*.cl."""
    channels, most, side = defines["C"], defines["N"], 2 * defines["RADIUS"] + 1
    each = channels + (channels if defines["OWN"] else 1)  # confidences and values
    rows, columns = side ** (2 if defines.get("AXES") == 3 else 1), -(-side // LANES) * LANES
    lists = 2 * defines.get("SLOTS", 0) + 2 * most * defines["NOVEL"]
    if "STEP" in defines:
        lists = (most + 8) * (5 + each) + max(most + 1, items * defines["STEP"])
    return 4 * (rows * columns * each + 2 * items + lists)

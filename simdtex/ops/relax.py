# SPDX-License-Identifier: BSD-3-Clause
"""Step 6.2.2 of Algorithm 1: the relaxation of a site, for all sites of a step in parallel.

A `Relaxation` says how a site relaxes: its neighbourhood, which candidates are proposed (`Everything` or `Listed`),
what is chosen of them, and how it cools. `relax` does so in place, step after step; `relax_apart` leaves the field as
it is. The twins compose the parts one after another. A device does the same in one kernel, ``kernels/relax.cl``, or,
where it has to weigh more candidates than a work-item can keep, in several.
"""

from __future__ import annotations

from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import Grid
from simdtex.model.sample import Candidates
from simdtex.ops import lcpdf
from simdtex.ops.charge import charge
from simdtex.ops.coherence import coherence, continuing, sources
from simdtex.ops.commit import commit
from simdtex.ops.lcpdf import Distances, Relaxed, Window
from simdtex.ops.level import constants
from simdtex.ops.nearest import Strip, nearest
from simdtex.ops.neighbourhood import NOTHING, Beside, Field, gathered, neighbourhood
from simdtex.ops.square import Square
from simdtex.ops.temperature import temperature

AGAIN = np.float32(4)
"""What it costs a candidate to be a neighbour's source, over what continuing it costs: as in kernels/relax.cl."""

KEPT = 1024
"""Distances that a work-item can keep; where there are more candidates, several kernels weigh them."""


# -- proposers: step 6.2.2.1 --------------------------------------------------------------------------------------


class Everything(NamedTuple):
    """The exact search: every candidate of the level is proposed.

    ``strip`` their pixels laid out row by row.
    """

    candidates: Candidates
    strip: Strip

    @property
    def slots(self) -> int:
        """Candidates that a site weighs."""
        return self.candidates.size

    def weighed(
        self, sites: NDArray[np.int32], field: Field, relaxation: Relaxation, turn: int
    ) -> tuple[NDArray[np.int64], Distances]:
        """Numbers (slots, 1) of the candidates, and their distances, favoured where they continue a neighbour."""
        near = neighbourhood.reference(sites, field, relaxation.offsets, relaxation.grid, relaxation.beside)
        found = lcpdf.distance.reference(near, self.candidates)
        where = (sites, field, relaxation.offsets, relaxation.grid)
        found = coherence.reference(found, self.candidates, *where, relaxation.favour)
        found = charge.reference(found, self.candidates, relaxation.price)
        if relaxation.novelty > 0:
            copied(found.distance, self.candidates, *where, relaxation.novelty)
        return np.arange(self.slots)[:, None], found


def copied(
    distance: NDArray[np.float32],
    candidates: Candidates,
    sites: NDArray[np.int32],
    field: Field,
    offsets: NDArray[np.int32],
    grid: Grid,
    novelty: np.float32,
) -> None:
    """Charge each candidate for every neighbour whose source it continues, or is; in place, in canonical order."""
    source = sources(grid.neighbours(sites, offsets), field)
    following, same = continuing(candidates, source), np.where(source >= 0, candidates.index_of[source], -1)
    for k in range(len(source)):
        for numbers, cost in ((following[k], novelty), (same[k], AGAIN * novelty)):
            here = np.flatnonzero(numbers >= 0)
            distance[numbers[here], here] += cost


class Listed(NamedTuple):
    """The coherent search: a few candidates are proposed, those that neighbours suggest and some more.

    ``square`` their pixels side by side; ``similar`` (n, K) int32, the candidates most similar to each, (1, 1) where
    ``likes`` K is 0; ``suggesting`` nearest neighbours that suggest; ``chance`` candidates at random.
    """

    candidates: Candidates
    square: Square
    similar: Array
    likes: int
    suggesting: int
    chance: int

    @property
    def slots(self) -> int:
        """Most candidates that a site weighs."""
        few = (self.suggesting + 1) * (1 + self.likes) + max(1, self.chance)
        return int(min(few, self.candidates.size))

    def weighed(
        self, sites: NDArray[np.int32], field: Field, relaxation: Relaxation, turn: int
    ) -> tuple[NDArray[np.int64], Distances]:
        """Numbers (slots, S) of the candidates, -1 past the last, and their distances, infinity there."""
        r = relaxation.grid.neighbours(sites, relaxation.offsets)
        numbers, suggested = self._list(sites, r, field, relaxation, turn)
        offsets = relaxation.offsets
        if relaxation.beside.guides:
            offsets = np.concatenate([offsets, np.zeros((1, 2), np.int32)])
        d = self.square.distance(numbers, *gathered(sites, r, field, relaxation.beside), offsets)
        d = np.where(suggested, d * relaxation.favour, d) + relaxation.price[np.maximum(numbers, 0)]
        return numbers, Distances(d, None, sites.size)

    def _list(
        self, sites: NDArray[np.int32], r: NDArray[np.int32], field: Field, relaxation: Relaxation, turn: int
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """The numbers, and which of them neighbours suggest."""
        numbers = np.full((self.slots + 1, sites.size), -1)  # one more for what is listed already
        size = np.zeros(sites.size, np.int64)

        def add(number: NDArray[np.integer[Any]]) -> None:
            new = (number >= 0) & ~(numbers == number).any(0)
            numbers[size[new], np.flatnonzero(new)] = number[new]
            size[new] += 1

        for suggestion in continuing(self.candidates, sources(r, field))[: self.suggesting]:
            add(suggestion)
        suggested = np.arange(self.slots)[:, None] < size
        present = field.source.ravel()[sites]
        add(np.where(present < 0, -1, self.candidates.index_of[present]))
        own = size.copy()
        for k in range(own.max() if self.likes else 0):
            for like in self.similar[np.maximum(numbers[k], 0)].T:
                add(np.where(k < own, like, -1))
        draws, places = np.maximum(self.chance, size == 0), relaxation.grid.places(sites)
        for k in range(draws.max()):
            word = random.draw4(relaxation.seed, relaxation.level, turn, places, random.SEARCH, k // 4)[k % 4]
            number = (word.astype(np.uint64) * np.uint64(self.candidates.size)) >> np.uint64(32)
            add(np.where(k < draws, number.astype(np.int64), -1))
        return numbers[:-1], suggested


# -- what is chosen: step 6.2.2.2 ---------------------------------------------------------------------------------


class Choice(NamedTuple):
    """What a site takes of its candidates.

    ``draws`` whether it draws from the LCPDF, or takes its mode; ``density`` whether that is the Parzen density over
    grey levels, or one over the sample's pixels; ``window`` of equation (7).
    """

    draws: bool
    density: bool
    window: Window

    @property
    def stores(self) -> bool:
        """Whether it takes more of the distances than the least."""
        return self.draws or self.density

    def mode(self, channels: int) -> Operation[[Distances, Candidates, Window], Relaxed]:
        """The mode of a density: over grey levels where there are few of them, else over pixel vectors."""
        return lcpdf.mode if channels == 1 and self.window.top == 255 else lcpdf.mode_vector

    def taken(
        self,
        numbers: NDArray[np.int64],
        distances: Distances,
        sites: NDArray[np.int32],
        relaxation: Relaxation,
        turn: int,
    ) -> Relaxed:
        """What each site takes, in NumPy."""
        candidates, d = relaxation.proposal.candidates, distances.distance
        if self.density and not self.draws:
            return self.mode(len(candidates.pixels)).reference(distances, candidates, self.window)
        keys, places = (relaxation.seed, relaxation.level, turn), relaxation.grid.places(sites)
        if self.draws:
            w = lcpdf.weights(d, self.window.scale)
            pixels = candidates.pixels[:, candidates.positions[np.maximum(numbers, 0)]]
            slot = lcpdf.drawn(w, pixels, places, self.window, self.density, *keys)
            chosen = np.broadcast_to(numbers, d.shape)[slot, np.arange(sites.size)]
        else:
            chosen = np.where(d == d.min(0), numbers, candidates.size).min(0)
        choice = candidates.positions[chosen]
        values = candidates.pixels[: candidates.made, choice].astype(np.uint16)
        if self.draws and self.density:
            values = np.stack([lcpdf.stepped(x, c, places, self.window, *keys) for c, x in enumerate(values)])
        return Relaxed(choice, values)


# -- the relaxation ---------------------------------------------------------------------------------------------------


class Relaxation(NamedTuple):
    """How a site relaxes.

    ``grid``, ``offsets`` its lattice and neighbourhood; ``proposal`` the candidates; ``favour`` 1 / (1 + coherence),
    by which the distance of those is multiplied that continue a neighbour's source; ``novelty`` what is added to it for
    each neighbour whose source is continued, and `AGAIN` times that for each whose source the candidate is; ``price``
    (n or more,) float32 what is added to that of each candidate (`simdtex.ops.use`); ``choice`` what it takes of them;
    ``beside`` which channels are guides;
    ``xi`` of equation (13) in 1/1024; ``seed`` and ``level`` the keys of its random numbers.
    """

    grid: Grid
    offsets: Array
    proposal: Everything | Listed
    favour: np.float32
    novelty: np.float32
    price: Array
    choice: Choice
    xi: int
    seed: int
    level: int
    beside: Beside = NOTHING

    @property
    def fused(self) -> bool:
        """Whether a device relaxes a site in one kernel."""
        if isinstance(self.proposal, Listed):
            return True
        return self.proposal.slots <= KEPT and (self.choice.draws or not self.choice.density)


def _apart_reference(
    sites: NDArray[np.int32], field: Field, weighed: NDArray[np.int32], relaxation: Relaxation, turn: int
) -> tuple[Relaxed, NDArray[np.uint16]]:
    numbers, distances = relaxation.proposal.weighed(sites, field, relaxation, turn)  # 6.2.2.1
    relaxed = relaxation.choice.taken(numbers, distances, sites, relaxation, turn)  # 6.2.2.2
    cooled = temperature.reference(sites, field, relaxation.offsets, relaxation.grid, relaxation.xi)  # 6.2.2.3
    if isinstance(relaxation.proposal, Listed):
        weighed.ravel()[sites] += (numbers >= 0).sum(0).astype(np.int32)
    return relaxed, cooled


def _reference(
    sites: NDArray[np.int32],
    steps: NDArray[np.int64],
    field: Field,
    weighed: NDArray[np.int32],
    relaxation: Relaxation,
    turn: int,
) -> Field:
    most = max(1, 2**20 // relaxation.proposal.slots)
    for begin, end in steps.tolist():
        pieces = [sites[first : min(end, first + most)] for first in range(begin, end, most)]
        done = [_apart_reference(here, field, weighed, relaxation, turn) for here in pieces]
        for here, (relaxed, cooled) in zip(pieces, done, strict=True):
            field = commit.reference(field, here, relaxed, cooled)
    return field


def _launch(
    machine: Launcher,
    sites: Array,
    steps: NDArray[np.int64],
    field: Field,
    weighed: Array,
    relaxation: Relaxation,
    turn: int,
) -> Field:
    if relaxation.fused:
        name, defines, arguments = _fused(machine, sites, field, weighed, relaxation, turn)
        kernel = machine.kernel("relax", name, **defines)
        machine.launch_groups(kernel, steps, *arguments, field.values, field.source, field.temperature)
        return field
    for begin, end in steps.tolist():
        here = machine.part(sites, begin, end)
        relaxed, cooled = _apart_launch(machine, here, field, weighed, relaxation, turn)
        field = commit(machine, field, here, relaxed, cooled)
    return field


def _apart_launch(
    machine: Launcher, sites: Array, field: Field, weighed: Array, relaxation: Relaxation, turn: int
) -> tuple[Relaxed, Array]:
    if not relaxation.fused:
        return _staged(machine, sites, field, relaxation, turn)
    made = len(field.values) - relaxation.beside.guides
    relaxed = Relaxed(machine.empty((sites.size,), np.int32), machine.empty((made, sites.size), np.uint16))
    cooled = machine.empty((sites.size,), np.uint16)
    name, defines, arguments = _fused(machine, sites, field, weighed, relaxation, turn)
    machine.launch(
        machine.kernel("relax", name, **defines, APART=1),
        (sites.size,),
        *arguments,
        relaxed.values,
        relaxed.choice,
        cooled,
    )
    return relaxed, cooled


def _staged(machine: Launcher, sites: Array, field: Field, relaxation: Relaxation, turn: int) -> tuple[Relaxed, Array]:
    """The exact search in several kernels: of many candidates, or for the mode of a density."""
    grid, offsets, proposal, choice = relaxation.grid, relaxation.offsets, relaxation.proposal, relaxation.choice
    assert isinstance(proposal, Everything)
    candidates, window = proposal.candidates, choice.window
    if not (choice.stores or relaxation.beside.own):
        terms = (relaxation.favour, relaxation.price)
        relaxed = nearest(machine, sites, field, offsets, grid, candidates, proposal.strip, *terms)
    else:
        near = neighbourhood(machine, sites, field, offsets, grid, relaxation.beside)
        distances = lcpdf.distance(machine, near, candidates)
        if relaxation.favour != 1:
            distances = coherence(machine, distances, candidates, sites, field, offsets, grid, relaxation.favour)
        distances = charge(machine, distances, candidates, relaxation.price)
        if not choice.stores:
            relaxed = lcpdf.least(machine, distances, candidates, window)
        elif choice.draws:
            keys = (choice.density, relaxation.seed, relaxation.level, turn)
            relaxed = lcpdf.draw(machine, distances, candidates, sites, grid, window, *keys)
        else:
            relaxed = choice.mode(len(candidates.pixels))(machine, distances, candidates, window)
    return relaxed, temperature(machine, sites, field, offsets, grid, relaxation.xi)


def _fused(
    machine: Launcher, sites: Array, field: Field, weighed: Array, relaxation: Relaxation, turn: int
) -> tuple[str, dict[str, int], list[Any]]:
    """The kernel for it, its -D constants, and its arguments but for what it writes."""
    grid, offsets, proposal, choice = relaxation.grid, relaxation.offsets, relaxation.proposal, relaxation.choice
    candidates, window = proposal.candidates, choice.window
    level: dict[str, Any] = {
        **{"seed": relaxation.seed, "level": relaxation.level, "area": prod(field.source.shape)},
        **{"neighbours": offsets.shape[0], "pixels": candidates.index_of.size, "candidates": candidates.size},
        **{"favour": relaxation.favour, "scale": window.scale, "top": window.top, "draws": choice.draws},
        **{"radius": window.radius if choice.density else -1, "xi": relaxation.xi, "novelty": relaxation.novelty},
        **{"centre": relaxation.beside.centre, "hard": relaxation.beside.hard},
    }
    common = (offsets, candidates.reach, candidates.index_of, candidates.positions)
    noise, key = machine.constant(window.noise), np.uint32(turn)
    defines = {"C": len(field.values), "V": machine.vector} | ({"TILES": 1} if grid.tile else {})
    defines |= relaxation.beside.defines
    own: list[Any]
    if isinstance(proposal, Everything):
        strip = proposal.strip
        level |= {"first": strip.first, "pitch": strip.pitch, "size": strip.pixels.shape[1]}
        level |= {"strip_rows": strip.rows, "strip_cols": strip.cols}
        most = 256 if proposal.slots <= 256 else KEPT  # so that few programs serve all
        defines |= {"ALL": most, "N": -(-offsets.shape[0] // 64) * 64, "STEP": machine.step}
        name, own = "relax_all", [strip.pixels, strip.reach, relaxation.price, noise, key]
    else:
        square = proposal.square
        level |= {"plane": square.levels.shape[1], "down": square.down}
        level |= {"suggesting": proposal.suggesting, "similar": proposal.likes, "chance": proposal.chance}
        defines |= {"RADIUS": square.disc.shape[0] // 2, "SLOTS": -(-proposal.slots // 64) * 64}
        name = "relax_list"
        own = [square.disc, square.at, square.levels, proposal.similar, relaxation.price, noise, weighed, key]
    arguments = [sites, np.int32(sites.size), *field, constants(grid, **level), *common, *own]
    return name, defines, arguments


relax = Operation("relax", _reference, _launch)
"""``relax(machine, sites, steps, field, weighed, relaxation, turn)``: relax sites step after step, in place.

Those of a list from ``steps[0, 0]`` to ``steps[0, 1]`` - 1 relax together, then those of ``steps[1]``, and so on; no
two that relax together may be neighbours.
``steps`` (steps, 2) int64; ``weighed`` (H, W) int32 counts the candidates that each site has weighed, of `Listed`.
Cost: candidates weighed x |N| x C x 2 fma.
"""

relax_apart = Operation("relax", _apart_reference, _apart_launch)
"""``relax_apart(machine, sites, field, weighed, relaxation, turn)``: what sites that relax together become, (Relaxed,
temperatures), the field as it was; any sites may."""

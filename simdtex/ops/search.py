# SPDX-License-Identifier: BSD-3-Clause
"""Coherent search: relaxation that weighs a few candidates a site, those that its neighbours suggest and some more.

`table` lays out what a level needs; `search` relaxes a whole sweep in place; `search_apart` relaxes some sites without
changing the field. The kernel is ``kernels/search.cl``.
"""

from __future__ import annotations

from itertools import pairwise
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Machine, Operation
from simdtex.model.lattice import Grid
from simdtex.model.sample import Candidates
from simdtex.ops import lcpdf
from simdtex.ops.arithmetic import fma32
from simdtex.ops.commit import commit
from simdtex.ops.lcpdf import Distances, Relaxed, Window
from simdtex.ops.neighbourhood import Field, Neighbourhoods
from simdtex.ops.temperature import temperature

LANES = 16
"""Partial sums of a distance: one for each column, modulo 16, of the square around a neighbourhood."""

KEPT = 256
"""Distances that a work-item can keep; of more candidates they are computed again."""


class Table(NamedTuple):
    """What coherent search needs of a level.

    ``candidates`` of the level; ``at`` (n,) int32 their places in ``lattice`` (C, plane) uint16, the sample's working
    levels with the columns that are a level's spacing apart side by side; ``down`` from one row of the level's grid to
    the next there; ``disc`` (side, columns) float32, 1 on the neighbourhood; ``similar`` (n, K) int32, the candidates
    most similar to each, (1, 1) where ``likes`` K is 0; ``suggesting`` nearest neighbours that suggest; ``chance``
    candidates at random; ``exhaustive`` whether all candidates are weighed instead.
    """

    candidates: Candidates
    at: Array
    lattice: Array
    down: int
    disc: Array
    similar: Array
    likes: int
    suggesting: int
    chance: int
    exhaustive: bool

    @property
    def slots(self) -> int:
        """Most candidates that a site may weigh."""
        few = (self.suggesting + 1) * (1 + self.likes) + max(1, self.chance)
        return int(self.candidates.size if self.exhaustive else min(few, self.candidates.size))


class Rule(NamedTuple):
    """How a site relaxes.

    ``favour`` 1 / (1 + coherence); ``xi`` of equation (13) in 1/1024; ``window`` of equation (7); ``gibbs`` whether it
    draws or takes the mode; ``noisy`` whether a draw also spreads over grey levels; ``seed`` and ``level`` its keys.
    """

    favour: np.float32
    xi: int
    window: Window
    gibbs: bool
    noisy: bool
    seed: int
    level: int


def table(
    machine: Machine,
    candidates: Candidates,
    working: NDArray[np.uint16],
    offsets: NDArray[np.int32],
    spacing: int,
    *,
    suggesting: int,
    similar: int,
    chance: int,
    exhaustive: bool,
) -> Table:
    """Lay out what coherent search needs of a level.

    Parameters
    ----------
    machine : Machine
    candidates : Candidates
        Of the level.
    working : (C, rows * cols) uint16 array
        The sample with its margin.
    offsets : (N, 2) int32 array
    spacing : int
        2**level.
    suggesting, similar, chance, exhaustive
        As in `Table`; ``similar`` is K, with a cost of n^2 N C 2 fma.
    """
    radius, rows, cols = int(offsets.max()), candidates.rows, candidates.cols
    side, columns = 2 * radius + 1, -(-(2 * radius + 1) // LANES) * LANES
    disc = np.zeros((side, columns), np.float32)
    disc[tuple((offsets + radius).T)] = 1
    wide = -(-cols // spacing)
    around = ((0, 0), (0, 0), (0, wide * spacing - cols))
    planes = np.pad(working.reshape(-1, rows, cols), around, mode="edge").reshape(-1, rows, wide, spacing)
    lattice = planes.swapaxes(2, 3).reshape(len(planes), -1)
    positions = machine.get(candidates.positions)[: candidates.size]
    row, col = np.divmod(positions, np.int32(cols))
    at = (row * np.int32(spacing) + col % np.int32(spacing)) * np.int32(wide) + col // np.int32(spacing)
    similar = 0 if exhaustive else min(similar, candidates.size - 1)
    return Table(
        candidates,
        machine.put(at),
        machine.put(np.pad(lattice, ((0, 0), (0, columns)))),  # whole vectors are read at the end, too
        spacing * spacing * wide,
        machine.put(disc),
        _similar(machine, candidates, working, offsets, spacing, similar),
        similar,
        len(offsets) if exhaustive else min(suggesting, len(offsets)),
        chance,
        exhaustive,
    )


def _similar(
    machine: Machine,
    candidates: Candidates,
    working: NDArray[np.uint16],
    offsets: NDArray[np.int32],
    spacing: int,
    k: int,
) -> Array:
    """The k candidates most similar to each, (n, k) int32."""
    if not k:
        return machine.put(np.zeros((1, 1), np.int32))
    positions = machine.get(candidates.positions)[: candidates.size]
    reach = machine.get(candidates.reach)
    found = machine.put(np.zeros((candidates.size, k), np.int32))
    step = machine.chunk(candidates.size, len(offsets), len(working))
    for first in range(0, candidates.size, step):
        here = positions[first : first + step]
        padded = np.pad(here, (0, -len(here) % 16))  # whole vectors of sites
        x = np.moveaxis(working[:, padded + reach[:, None]], 0, 1).astype(np.float32)
        near = Neighbourhoods(machine.put(np.ones((len(reach), padded.size), np.float32)), machine.put(x), padded.size)
        distances = lcpdf.distance(machine, near, candidates)._replace(sites=len(here))
        found = most_similar(machine, distances, candidates, first, found)
        machine.sync(2 * candidates.size * x.size)
    return found


# -- the candidates most similar to each ------------------------------------------------------------------------


def _most_similar_reference(
    distances: Distances, candidates: Candidates, first: int, found: NDArray[np.int32]
) -> NDArray[np.int32]:
    d = distances.distance[:, : distances.sites].copy()
    d[np.arange(first, first + distances.sites), np.arange(distances.sites)] = np.inf
    found[first : first + distances.sites] = np.argsort(d, 0, kind="stable")[: found.shape[1]].T
    return found


def _most_similar_launch(
    machine: Launcher, distances: Distances, candidates: Candidates, first: int, found: Array
) -> Array:
    machine.launch(
        machine.kernel("search", "search_similar"),
        (distances.sites,),
        *(distances.distance, np.int32(first), np.int32(distances.sites), np.int32(distances.distance.shape[1])),
        *(np.int32(candidates.size), np.int32(found.shape[1]), found),
    )
    return found


most_similar = Operation("search", _most_similar_reference, _most_similar_launch)
"""``most_similar(machine, distances, candidates, first, found)``: rows ``first`` on of (n, K), nearest first."""


# -- relaxation, in NumPy -----------------------------------------------------------------------------------------


def _apart_reference(
    sites: NDArray[np.int32],
    field: Field,
    weighed: NDArray[np.int32],
    table: Table,
    offsets: NDArray[np.int32],
    grid: Grid,
    rule: Rule,
    turn: int,
) -> tuple[Relaxed, NDArray[np.uint16]]:
    r = grid.neighbours(sites, offsets)
    numbers, suggested = _candidates(sites, r, field, table, rule, turn)
    weighed.ravel()[sites] += (numbers >= 0).sum(0).astype(np.int32)
    d = _distances(numbers, r, field, table, offsets)
    d = np.where(suggested, d * rule.favour, d)
    lattice, columns = table.lattice, np.arange(sites.size)
    if rule.gibbs:
        w = lcpdf.weights(d, rule.window.scale)
        if rule.noisy:
            for plane in lattice:
                _, mass = lcpdf.legal(plane[table.at[np.maximum(numbers, 0)]], rule.window)
                w = np.where(w > 0, np.maximum(random.below(np.zeros_like(mass), mass, w), 1), 0)
        cumulative = np.cumsum(w, 0, dtype=np.uint64)
        lo, hi, *_ = random.draw4(rule.seed, rule.level, turn, sites, random.DRAW, 0)
        chosen = numbers[(cumulative > random.below(lo, hi, cumulative[-1])).argmax(0), columns]
    else:
        chosen = np.where(d == d.min(0), numbers, table.candidates.size).min(0)
    values = lattice[:, table.at[chosen]]
    if rule.gibbs and rule.noisy:
        keys = (rule.seed, rule.level, turn)
        values = np.stack([lcpdf.stepped(x, c, sites, rule.window, *keys) for c, x in enumerate(values)])
    cooled = temperature.reference(sites, field, offsets, grid, rule.xi)
    return Relaxed(table.candidates.positions[chosen], values), cooled


def _candidates(
    sites: NDArray[np.int32], r: NDArray[np.int32], field: Field, table: Table, rule: Rule, turn: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The numbers of the candidates of each site, (slots, S), -1 past the last, and which neighbours suggest."""
    listed = table.candidates
    suggestions = np.full((table.suggesting, sites.size), -1)
    for k in range(table.suggesting):
        p = field.source.ravel()[r[k]] - listed.reach[k]
        inside = (r[k] >= 0) & (field.temperature.ravel()[r[k]] < 1024) & (p >= 0) & (p < listed.index_of.size)
        suggestions[k] = np.where(inside, listed.index_of[np.where(inside, p, 0)], -1)
    if table.exhaustive:
        numbers = np.repeat(np.arange(listed.size)[:, None], sites.size, 1)
        return numbers, (numbers[:, None] == suggestions).any(1)
    numbers = np.full((table.slots + 1, sites.size), -1)  # one more for what is listed already
    count = np.zeros(sites.size, np.int64)

    def add(number: NDArray[np.integer[Any]]) -> None:
        new = (number >= 0) & ~(numbers == number).any(0)
        numbers[count[new], np.flatnonzero(new)] = number[new]
        count[new] += 1

    for suggestion in suggestions:
        add(suggestion)
    suggested = np.arange(table.slots)[:, None] < count
    add(listed.index_of[field.source.ravel()[sites]])
    own = count.copy()
    for k in range(own.max() if table.likes else 0):
        for like in table.similar[np.maximum(numbers[k], 0)].T:
            add(np.where(k < own, like, -1))
    draws = np.maximum(table.chance, count == 0)
    for k in range(draws.max()):
        word = random.draw4(rule.seed, rule.level, turn, sites, random.SEARCH, k // 4)[k % 4]
        number = (word.astype(np.uint64) * np.uint64(listed.size)) >> np.uint64(32)
        add(np.where(k < draws, number.astype(np.int64), -1))
    return numbers[:-1], suggested


def _distances(
    numbers: NDArray[np.int64], r: NDArray[np.int32], field: Field, table: Table, offsets: NDArray[np.int32]
) -> NDArray[np.float32]:
    """Equation (12) for each candidate, (slots, S), infinity where there is none; summed as the kernel does."""
    u = np.where(r < 0, np.float32(0), (1024 - field.temperature.ravel()[r].astype(np.float32)) / np.float32(1024))
    radius = int(offsets.max())
    d = np.zeros((LANES, *numbers.shape), np.float32)
    for k in np.lexsort((offsets[:, 1], offsets[:, 0])):
        row, col = offsets[k]
        apart = row * table.down + col
        for x, y in zip(field.values.reshape(len(field.values), -1), table.lattice, strict=True):
            e = (x[r[k]] - y[table.at[np.maximum(numbers, 0)] + apart].astype(np.float32)) * u[k]
            lane = (col + radius) % LANES
            d[lane] = fma32(e, e, d[lane])
    while len(d) > 1:
        d = d[: len(d) // 2] + d[len(d) // 2 :]
    return np.where(numbers < 0, np.float32(np.inf), d[0])


def _reference(
    sites: NDArray[np.int32],
    bounds: NDArray[np.int64],
    field: Field,
    weighed: NDArray[np.int32],
    table: Table,
    offsets: NDArray[np.int32],
    grid: Grid,
    rule: Rule,
    turn: int,
) -> Field:
    most = max(1, 2**20 // table.slots)
    for begin, end in pairwise(bounds.tolist()):
        pieces = [sites[first : min(end, first + most)] for first in range(begin, end, most)]
        done = [_apart_reference(here, field, weighed, table, offsets, grid, rule, turn) for here in pieces]
        for here, (relaxed, cooled) in zip(pieces, done, strict=True):
            field = commit.reference(field, here, relaxed, cooled)
    return field


# -- relaxation, on a device ----------------------------------------------------------------------------------------


def _launch(
    machine: Launcher,
    sites: Array,
    bounds: NDArray[np.int64],
    field: Field,
    weighed: Array,
    table: Table,
    offsets: Array,
    grid: Grid,
    rule: Rule,
    turn: int,
) -> Field:
    arguments = _arguments(machine, sites, field, weighed, table, offsets, grid, rule, turn)
    kernel = machine.kernel("search", "search", **_defines(machine, field, table, grid))
    machine.launch_groups(kernel, bounds, *arguments, field.values, field.source, field.temperature)
    return field


def _apart_launch(
    machine: Launcher,
    sites: Array,
    field: Field,
    weighed: Array,
    table: Table,
    offsets: Array,
    grid: Grid,
    rule: Rule,
    turn: int,
) -> tuple[Relaxed, Array]:
    relaxed = Relaxed(machine.empty((sites.size,), np.int32), machine.empty((len(field.values), sites.size), np.uint16))
    cooled = machine.empty((sites.size,), np.uint16)
    machine.launch_sites(
        ("search", "search"),
        (sites.size,),
        *_arguments(machine, sites, field, weighed, table, offsets, grid, rule, turn),
        *(relaxed.values, relaxed.choice, cooled),
        defines=_defines(machine, field, table, grid) | {"APART": 1},
    )
    return relaxed, cooled


def _defines(machine: Launcher, field: Field, table: Table, grid: Grid) -> dict[str, int]:
    slots = table.suggesting if table.exhaustive else table.slots
    whole = -(-slots // 64) * 64  # so that few programs serve all
    defines = {"C": len(field.values), "RADIUS": table.disc.shape[0] // 2, "SLOTS": whole, "V": machine.vector}
    defines |= {"TILES": 1} if grid.tile else {}
    return defines | ({"ALL": 1, "KEPT": KEPT if table.slots <= KEPT else 0} if table.exhaustive else {})


def _arguments(
    machine: Launcher,
    sites: Array,
    field: Field,
    weighed: Array,
    table: Table,
    offsets: Array,
    grid: Grid,
    rule: Rule,
    turn: int,
) -> list[Any]:
    listed, win = table.candidates, rule.window
    return [
        *(sites, np.int32(sites.size), *field, weighed, np.int32(prod(field.source.shape)), *grid.args),
        *(offsets, np.int32(offsets.shape[0]), table.disc, listed.reach, np.int32(table.suggesting)),
        *(listed.index_of, np.int32(listed.index_of.size), listed.positions, table.at, np.int32(listed.size)),
        *(table.lattice, np.int32(table.lattice.shape[1]), np.int32(table.down), table.similar, np.int32(table.likes)),
        *(np.int32(table.chance), rule.favour, np.int32(rule.xi), win.scale, machine.constant(win.noise)),
        *(np.int32(win.radius if rule.noisy else -1), np.int32(win.top), np.uint64(rule.seed)),
        *(np.uint32(rule.level), np.uint32(turn), np.int32(rule.gibbs)),
    ]


search = Operation("search", _reference, _launch)
"""``search(machine, sites, bounds, field, weighed, table, offsets, grid, rule, turn)``: relax sites ``bounds[0]`` to
``bounds[1]`` - 1 together, then those up to ``bounds[2]``, and so on, in place; no two that relax together may be
neighbours.

``weighed`` (H, W) int32 counts the candidates of each site. Cost: candidates weighed x |N| x C x 2 fma.
"""

search_apart = Operation("search", _apart_reference, _apart_launch)
"""``search_apart(machine, sites, field, weighed, table, offsets, grid, rule, turn)``: what sites that relax together
become, (Relaxed, temperatures), the field as it was; any sites may."""

# SPDX-License-Identifier: BSD-3-Clause
"""The explanation of a site's choice: one relaxation by the engine's own operations, with each of its terms.

`explained` relaxes a site by the twins of the operations, from a copy of the field on the host, and changes nothing. So
it serves both a run in progress (`simdtex.run.Progress.explain`) and a run that is made for the explanation
(`simdtex.explain`). The twins have the device's bits, so both take the same candidate.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.methods.mrf import lcpdf
from simdtex.methods.mrf.costs import continuing
from simdtex.methods.mrf.level import Lattices, with_penalty
from simdtex.methods.mrf.neighbourhood import Field, near
from simdtex.methods.mrf.relax import SUGGESTING, AllCandidates, Relaxation, relax_out_of_place
from simdtex.model.explanation import Explanation, Neighbours, Ranked
from simdtex.model.lattice import MOST_ORDER, gathered, neighbourhood_offsets
from simdtex.options import real, whole

MOST = 100
"""The most candidates whose terms are returned, the first by rank."""


class Moment(NamedTuple):
    """A moment of a run, on the host.

    ``level``; ``sweep``, from 1; ``field`` before the relaxation; ``penalty`` of the state during the sweep; and
    ``turn``, the key of the random numbers.
    """

    level: int
    sweep: int
    field: Field
    penalty: NDArray[np.float32]
    turn: int


def explained(twin: Lattices, moment: Moment, site: tuple[int, ...]) -> Explanation:
    """Return an explanation of the relaxation of a site, (row, column) or (layer, row, column), at a moment.

    ``twin`` is the run's plan on the reference. Cost: about two relaxations by the twins.
    """
    level, twin = twin.level(moment.level), twin.of(moment.level)
    pixel = np.array([site_number(twin, moment.level, site)], np.int32)
    field, relaxation = moment.field, with_penalty(level, moment.penalty)
    choice, candidates = relaxation.choice, relaxation.proposal.candidates

    terms: dict[str, NDArray[np.float32]] = {}
    result = relaxation.evaluate(pixel, field, moment.turn, terms)
    evaluated = np.flatnonzero(np.isfinite(result.cost[:, 0]))  # the other slots have no candidate
    total, numbers = result.cost[evaluated, 0], result.numbers[evaluated, 0]
    costs = {name: np.broadcast_to(term, result.cost.shape)[evaluated, 0] for name, term in terms.items()}
    relaxed, cooled = relax_out_of_place.reference(
        pixel, field, np.zeros(field.source.shape, np.int32), relaxation, moment.turn
    )
    pixels = candidates.pixels[:, candidates.positions[numbers], None]
    weights = lcpdf.weights(total[:, None], choice.window.scale)
    mass = lcpdf.masses(weights, pixels, choice)[:, 0].astype(np.float64)

    ranked = np.lexsort((numbers, total))
    rank = np.flatnonzero(np.arange(ranked.size) < MOST)
    is_taken = candidates.positions[numbers[ranked]] == relaxed.choice
    rank = np.union1d(rank, np.flatnonzero(is_taken))
    first = ranked[rank]
    neighbours, continued = _neighbours(twin, relaxation, pixel, field)
    shown, matched, guides = twin.sample.shown, twin.sample.channels, candidates.guides
    channels = ("picture",) * shown + ("structure",) * (matched - shown) + ("guide",) * guides
    position = candidates.positions[numbers[first]]
    around = position[:, None] + candidates.reach
    return Explanation(
        site=site,
        level=moment.level,
        sweep=moment.sweep,
        drawn=choice.draws,
        exact=isinstance(relaxation.proposal, AllCandidates),
        weighed=total.size,
        bandwidth=float(np.sqrt(0.5 / np.float64(choice.window.scale))),
        temperature=float(field.temperature.ravel()[pixel[0]]) / 1024,
        cooled=float(cooled[0]) / 1024,
        neighbours=neighbours,
        candidates=Ranked(
            rank=rank,
            place=twin.sample.place(position),
            values=candidates.pixels[:, position].T.astype(np.uint16),
            around=np.moveaxis(candidates.pixels[:, around], 0, -1).astype(np.uint16),
            continues=(continued == numbers[first][:, None]).sum(1),
            distance=costs.pop("distance")[first],
            costs={name: cost[first] for name, cost in costs.items()},
            total=total[first],
            probability=mass[first] / mass.sum(),
            pixels=twin.sample.around(position, np.append(np.int32(0), candidates.reach)),
        ),
        taken=int(np.flatnonzero(is_taken[rank])[0]),
        values=relaxed.values[:, 0],
        channels=channels,
        totals=np.sort(total),
        density=_density(weights, pixels[: candidates.made], choice) if choice.density else None,
    )


def largest_order(twin: Lattices, level: int) -> int:
    """Return the largest order that `with_order` takes at a level, 0 unless the search is exact there."""
    sample = twin.of(level)
    if not isinstance(sample.level(level).proposal, AllCandidates):
        return 0
    side = min(min(levels.shape[1:]) for levels in sample.sample.levels)
    radius = min(sample.sample.margin // sample.spacing(level), (side - 1) // 2)
    return min(MOST_ORDER, (int(radius) + 1) ** 2 - 1)


def with_order(twin: Lattices, moment: Moment, order: int) -> tuple[Lattices, Moment]:
    """Return a run's plan with a neighbourhood of another order, and a moment of the run with its candidates.

    Raises ValueError if the order is beyond `largest_order`, or if the candidates differ and the run has penalties.
    """
    level, before, most = moment.level, twin.of(moment.level), largest_order(twin, moment.level)
    if not most:
        raise ValueError('a site has another order only if it evaluates all candidates; give search="exact"')
    whole(f"order at level {level}", order, 1, most)
    offsets, options = neighbourhood_offsets(order, before.offsets.shape[1]), replace(before.options, order=order)
    plan = replace(before.plan, offsets=offsets, options=options, coarser=None)
    after = Lattices(plan, before.machine, before.seed, None if before is twin else before.conditions)
    here, there = (lattices.level(level).proposal.candidates.positions for lattices in (before, after))
    if np.array_equal(here, there):
        return after, moment
    if moment.penalty.any():
        raise ValueError(f"order {order} has other candidates, whose use is not counted; give balance=0")
    return after, moment._replace(penalty=np.zeros(len(there), np.float32))


def with_trust(moment: Moment, pixel: int, trust: float) -> Moment:
    """Return a moment at which all sites but one have (1 - ``trust``) times their temperatures."""
    real("trust", trust, 0, 1)
    temperature = np.round(moment.field.temperature * (1 - trust)).astype(np.uint16)
    temperature.flat[pixel] = moment.field.temperature.flat[pixel]
    return moment._replace(field=moment.field._replace(temperature=temperature))


def site_number(run: Lattices, level: int, site: tuple[int, ...]) -> int:
    """Return the number of a site of a level; raise ValueError if it is not of the level's lattice."""
    shape = run.grid(level).shape
    if len(site) != len(shape) or not all(0 <= n < side for n, side in zip(site, shape, strict=True)):
        sides = " x ".join(map(str, shape))
        raise ValueError(f"site {site} is not of the {sides} sites of level {level}; give one of these, from 0")
    return int(np.ravel_multi_index(site, shape))


def _neighbours(
    twin: Lattices, relaxation: Relaxation, pixel: NDArray[np.int32], field: Field
) -> tuple[Neighbours, NDArray[np.int32]]:
    """Return the neighbourhood of a site, and the candidate that continues the source of each evaluated neighbour."""
    grid, sample, given = relaxation.grid, twin.sample, twin.plan.given
    r, proposal = grid.neighbours(pixel, relaxation.offsets), relaxation.proposal
    _, values, certain, source, _ = near(pixel, field, relaxation.offsets, grid, relaxation.confidences)
    looked_at = len(r) if isinstance(proposal, AllCandidates) else SUGGESTING
    continued = continuing(proposal.candidates, source)[:looked_at, 0]
    offsets = relaxation.offsets
    if relaxation.confidences.guides:
        r, source, offsets = (np.pad(array, ((0, 1), (0, 0))) for array in (r, source, offsets))
        r[-1], source[-1] = pixel, -1
    there, made = r >= 0, len(values[0]) - relaxation.confidences.guides
    pixels = sample.picture(values[:, :made].transpose(1, 0, 2), gathered(field.source.ravel(), r, -1))[:, 0]
    if given:
        index = np.where(there, r % grid.size, -1)[:, 0]
        planes = (grid.decimated(np.moveaxis(plane, -1, 0)) for plane in (given.known, given.values))
        known, told = (gathered(plane.reshape(len(plane), -1), index, 0).T for plane in planes)
        pixels = np.where(known, told, pixels)
    neighbours = Neighbours(
        offsets=offsets.astype(np.int32),
        values=np.where(there, values[..., 0], 0).astype(np.uint16),
        confidence=np.ascontiguousarray(np.broadcast_to(certain, values.shape)[..., 0]),
        source=sample.place(source[:, 0]),
        pixels=np.where(there, pixels, np.zeros((), pixels.dtype)),
    )
    return neighbours, continued


def _density(weights: NDArray[np.uint64], pixels: NDArray[Any], choice: lcpdf.SiteChoice) -> NDArray[np.float64]:
    """Return the LCPDF of each channel, (C, greys), of weights (slots, 1) and grey levels (C, slots, 1)."""
    rows = []
    for c, grey in enumerate(pixels):
        others = lcpdf.masses(weights, np.delete(pixels, c, 0), choice)  # whose drawn levels are legal, too
        rows.append(lcpdf.smoothed(grey[:, 0].astype(np.int64), others, choice.window)[:, 0].astype(np.float64))
    return np.stack([row / row.sum() for row in rows])

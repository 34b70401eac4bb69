# SPDX-License-Identifier: BSD-3-Clause
"""The local conditional probability density function, equations (6) to (8) and (12), on the machine.

`distance` gives d_p for every site and candidate; `draw`, `mode`, `mode_vector` and `density` are what
relaxation and users take from it. The kernels are in ``kernels/lcpdf.cl``.
"""

from __future__ import annotations

from itertools import accumulate
from math import exp, log, pow, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation, touching
from simdtex.model.lattice import Grid
from simdtex.model.sample import BLOCK, Candidates
from simdtex.ops.arithmetic import exp32, fma32
from simdtex.ops.neighbourhood import Neighbourhoods

HEAVIEST = 16
"""Candidates whose values compete for the mode of a pixel vector."""

NO_WEIGHT = np.float32(28)
"""exp(-28) 2**40 < 1."""


class Distances(NamedTuple):
    """``distance`` (candidates, P) d_p of equation (12); ``nearest`` (blocks, P), devices only; ``sites`` S."""

    distance: Array
    nearest: Array
    sites: int


class Relaxed(NamedTuple):
    """``choice`` (S,) pixel index in the sample; ``values`` (C, S) working grey levels."""

    choice: Array
    values: Array


class Window(NamedTuple):
    """The Gaussian of equation (7) at a bandwidth h, as tables over whole grey levels.

    ``scale`` 1 / 2h^2; ``noise`` (2 radius + 1,) uint32 cumulative probabilities of the steps -radius..radius in
    2**-32; ``gauss`` (radius + 1,) float32 exp(-k^2 / 2h^2); ``top`` the highest legal level.
    """

    scale: np.float32
    noise: NDArray[np.uint32]
    gauss: NDArray[np.float32]
    radius: int
    top: int


def optimal_bandwidth(variance: float, candidates: int, dimensions: int) -> float:
    """h_opt of equation (8).

    Parameters
    ----------
    variance : float
        sigma^2, the mean marginal variance.
    candidates : int
        n, the number of sample data.
    dimensions : int
        d = channels (N + 1).
    """
    return sqrt(variance) * pow(4 / (candidates * (2 * dimensions + 1)), 1 / (dimensions + 4))


def window(bandwidth: float, top: int) -> Window:
    """The tables for a bandwidth h in working grey levels.

    h below 10^-10, or 0 for a constant sample, stands for that: any difference then weighs nothing already, and
    1 / 2h^2 stays finite. The tables end before the Gaussian falls below 2**-33, so they hold no subnormal number.

    math.exp is rounded to 2**-24 or coarser here, so the last bit of a platform's libm does not show.
    """
    h = max(bandwidth, 1e-10)
    scale = np.float32(1 / (2 * h * h))
    radius = min(top, int(h * sqrt(2 * log(2.0**33))))
    gauss = [exp(-k * k / (2 * h * h)) for k in range(radius + 1)]
    steps = gauss[:0:-1] + gauss
    sums = list(accumulate(steps))  # Python 3.12's own sum() rounds in another way
    noise = [min(2**32 - 1, round(partial / sums[-1] * 2**32)) for partial in sums]
    noise[-1] = 2**32 - 1
    return Window(scale, np.array(noise, np.uint32), np.array(gauss, np.float32), radius, top)


# -- distances, equation (12) ---------------------------------------------------------------------------------


def _distance_reference(near: Neighbourhoods, candidates: Candidates) -> Distances:
    confidence, weighted, sites = near
    position = candidates.positions[: candidates.size]
    d = np.zeros((position.size, sites), np.float32)
    for k, offset in enumerate(candidates.reach):
        certain = confidence[k].astype(np.float64)
        for c, y in enumerate(candidates.pixels):
            u = certain if certain.ndim == 1 else certain[c]
            e = weighted[k, c] - u * y[position + offset][:, None].astype(np.float64)
            d = (e * e + d).astype(np.float32)  # fits 53 bits, so this is the device's fma: see Sample
    return Distances(d, None, sites)


def _distance_launch(machine: Launcher, near: Neighbourhoods, candidates: Candidates) -> Distances:
    terms, _, padded = near.weighted.shape
    blocks = candidates.positions.size // BLOCK
    distance = machine.empty((blocks * BLOCK, padded), np.float32)
    nearest = machine.empty((blocks, padded), np.float32)
    own = {"OWN": 1} if len(near.confidence.shape) > 2 else {}
    machine.launch(
        machine.kernel("lcpdf", "lcpdf_distance", **_defines(machine, candidates), **own),
        (padded // machine.vector, blocks),
        *(near.confidence, near.weighted, np.int32(terms), np.int32(padded)),
        *(candidates.pixels, _plane(candidates), candidates.positions, np.int32(candidates.size)),
        *(candidates.reach, np.int32(blocks), distance, nearest),
        local=machine.tile,
        work=touching(*near[:2], distance, fma=2 * near.weighted.size / padded * near.sites * candidates.size),
    )
    return Distances(distance, nearest, near.sites)


distance = Operation("distance", _distance_reference, _distance_launch)


# -- weights, equation (7) ------------------------------------------------------------------------------------


def weights(distance: NDArray[np.float32], scale: np.float32) -> NDArray[np.uint64]:
    """W_p = floor(2^40 exp(-(d_p - min d) / 2h^2)), (candidates, S)."""
    a = (distance - distance.min(0)) * scale
    near = np.minimum(a, NO_WEIGHT)
    return np.where(a < NO_WEIGHT, exp32(-near) * np.float32(2**40), 0).astype(np.uint64)


# -- the Gibbs sampler ----------------------------------------------------------------------------------------


def _draw_reference(
    distances: Distances,
    candidates: Candidates,
    sites: NDArray[np.int32],
    grid: Grid,
    win: Window,
    noisy: bool,
    seed: int,
    level: int,
    turn: int,
) -> Relaxed:
    w = weights(distances.distance, win.scale)
    positions = candidates.positions[: candidates.size]
    pixels = candidates.pixels[:, positions][..., None]
    taken = drawn(w, pixels, grid.places(sites), win, noisy, seed, level, turn)
    choice, places = positions[taken], grid.places(sites)
    values = candidates.pixels[: candidates.made, choice].astype(np.uint16)
    if noisy:
        values = np.stack([stepped(x, c, places, win, seed, level, turn) for c, x in enumerate(values)])
    return Relaxed(choice, values)


def drawn(
    w: NDArray[np.uint64],
    pixels: NDArray[Any],
    places: NDArray[np.int64],
    win: Window,
    noisy: bool,
    seed: int,
    level: int,
    turn: int,
) -> NDArray[np.intp]:
    """Which of the candidates each site draws, (S,): with a probability in proportion to its mass.

    Parameters
    ----------
    w : (slots, S) uint64 array
        Weights; with `noisy` times the share of the kernel around each pixel that is legal.
    pixels : (C, slots, S or 1) array
        Working grey levels of the candidates.
    places : (S,) int64 array
        Of the sites in the whole picture.
    """
    for plane in pixels if noisy else ():
        _, mass = legal(plane, win)
        mass = np.broadcast_to(mass, w.shape)
        w = np.where(w > 0, np.maximum(random.below(np.zeros_like(mass), mass, w), 1), 0)
    cumulative = np.cumsum(w, 0, dtype=np.uint64)
    lo, hi, *_ = random.draw4(seed, level, turn, places, random.DRAW, 0)
    taken: NDArray[np.intp] = (cumulative > random.below(lo, hi, cumulative[-1])).argmax(0)
    return taken


def stepped(
    x: NDArray[np.uint16], c: int, places: NDArray[np.int64], win: Window, seed: int, level: int, turn: int
) -> NDArray[np.uint16]:
    """Grey levels drawn from the kernel of equation (7) around those of channel c."""
    low, mass = legal(x, win)
    bits = random.draw4(seed, level, turn, places, random.DRAW, 1 + c)[0].astype(np.uint64)
    u = low + ((bits * mass) >> np.uint64(32)).astype(np.uint32)
    step = np.searchsorted(win.noise, u, side="right") - win.radius
    return (x.astype(np.int64) + step).astype(np.uint16)


def legal(y: NDArray[Any], win: Window) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Where the legal steps from grey level y begin among the cumulative probabilities, and their mass."""
    y = y.astype(np.int64)
    cumulative = np.concatenate([[0], win.noise]).astype(np.uint32)
    low = cumulative[np.maximum(0, win.radius - y)]
    return low, cumulative[np.minimum(2 * win.radius, win.radius + win.top - y) + 1] - low


def _draw_launch(
    machine: Launcher,
    distances: Distances,
    candidates: Candidates,
    sites: Array,
    grid: Grid,
    win: Window,
    noisy: bool,
    seed: int,
    level: int,
    turn: int,
) -> Relaxed:
    counters = (np.uint64(seed), np.uint32(level), np.uint32(turn))
    kernel = (machine.constant(win.noise), np.int32(win.radius if noisy else -1), np.int32(win.top))
    return _take(machine, "draw", distances, candidates, win, sites, grid.struct, *counters, *kernel)


draw = Operation("draw", _draw_reference, _draw_launch)


# -- iterated conditional modes -----------------------------------------------------------------------------------


def _least_reference(distances: Distances, candidates: Candidates, win: Window) -> Relaxed:
    choice = candidates.positions[distances.distance.argmin(0)]
    return Relaxed(choice, candidates.pixels[: candidates.made, choice].astype(np.uint16))


def _least_launch(machine: Launcher, distances: Distances, candidates: Candidates, win: Window) -> Relaxed:
    return _take(machine, "least", distances, candidates, win)


least = Operation("least", _least_reference, _least_launch)
"""``least(machine, distances, candidates, window)``: the nearest candidate of each site, of several the first."""

# -- iterated conditional modes of a density ------------------------------------------------------------------


def smoothed(mass: NDArray[np.uint64], win: Window) -> NDArray[np.float32]:
    """f(x) = sum over v of mass[v] exp(-(x - v)^2 / 2h^2), (levels,), level 0 first."""
    levels = np.arange(mass.size)
    f = np.zeros(mass.size, np.float32)
    for v in np.flatnonzero(mass):
        gap = abs(levels - v)
        reached = gap <= win.radius
        f[reached] = fma32(mass[v].astype(np.float32), win.gauss[gap[reached]], f[reached])
    return f


def _mode_reference(distances: Distances, candidates: Candidates, win: Window) -> Relaxed:
    w = weights(distances.distance, win.scale)
    position = candidates.positions[: candidates.size]
    grey = candidates.pixels[0][position].astype(np.int64)
    choice = np.zeros(distances.sites, np.int32)
    values = np.zeros((1, distances.sites), np.uint16)
    for s in range(distances.sites):
        mass = np.zeros(256, np.uint64)
        np.add.at(mass, grey, w[:, s])
        f = smoothed(mass, win)
        mode = int(f.argmax())
        gap = abs(grey - mode)
        share = w[:, s].astype(np.float32) * win.gauss[np.minimum(gap, win.radius)]
        share[(w[:, s] == 0) | (gap > win.radius)] = -1
        choice[s] = position[share.argmax()]
        values[0, s] = mode
    return Relaxed(choice, values)


def _mode_launch(machine: Launcher, distances: Distances, candidates: Candidates, win: Window) -> Relaxed:
    gauss = (machine.constant(win.gauss), np.int32(win.radius))
    return _take(machine, "mode", distances, candidates, win, *gauss)


mode = Operation("mode", _mode_reference, _mode_launch)


def _mode_vector_reference(distances: Distances, candidates: Candidates, win: Window) -> Relaxed:
    w = weights(distances.distance, win.scale)
    position = candidates.positions[: candidates.size]
    y = candidates.pixels[:, position]
    choice = np.zeros(distances.sites, np.int32)
    for s in range(distances.sites):
        heavy = np.flatnonzero(w[:, s])
        heaviest = heavy[np.argsort(~w[heavy, s], kind="stable")][:HEAVIEST]
        f = np.zeros(heaviest.size, np.float32)
        for p in heavy:
            gap = np.zeros(heaviest.size, np.float32)
            for c in range(len(y)):
                e = y[c, heaviest] - y[c, p]
                gap = fma32(e, e, gap)
            a = gap * win.scale
            more = fma32(w[p, s].astype(np.float32), exp32(-np.minimum(a, NO_WEIGHT)), f)
            f = np.where(a < NO_WEIGHT, more, f)
        choice[s] = position[heaviest[f.argmax()]]
    return Relaxed(choice, candidates.pixels[:, choice].astype(np.uint16))


def _mode_vector_launch(machine: Launcher, distances: Distances, candidates: Candidates, win: Window) -> Relaxed:
    return _take(machine, "mode_vector", distances, candidates, win)


mode_vector = Operation("mode_vector", _mode_vector_reference, _mode_vector_launch)


# -- the whole density -------------------------------------------------------------------------------


def _densities_reference(distances: Distances, candidates: Candidates, win: Window) -> NDArray[np.float32]:
    w = weights(distances.distance, win.scale)
    grey = candidates.pixels[0][candidates.positions[: candidates.size]].astype(np.int64)
    table = np.zeros((distances.sites, win.top + 1), np.float32)
    for s in range(distances.sites):
        mass = np.zeros(win.top + 1, np.uint64)
        np.add.at(mass, grey, w[:, s])
        table[s] = smoothed(mass, win)
    return table


def _densities_launch(machine: Launcher, distances: Distances, candidates: Candidates, win: Window) -> Array:
    shape = (distances.sites, win.top + 1)
    mass, table = machine.empty(shape, np.uint64), machine.empty(shape, np.float32)
    machine.launch(
        machine.kernel("lcpdf", "lcpdf_density", **_defines(machine, candidates)),
        (distances.sites,),
        *_weighing(distances, win),
        *(candidates.pixels, candidates.positions, machine.constant(win.gauss)),
        *(np.int32(win.radius), np.int32(win.top + 1), mass, table),
    )
    return table


density = Operation("density", _densities_reference, _densities_launch)


# -- what the launchers share ---------------------------------------------------------------------------------


def _defines(machine: Launcher, candidates: Candidates) -> dict[str, int]:
    sizes = {"V": machine.vector, "C": candidates.pixels.shape[0], "BLOCK": BLOCK, "STEP": machine.step}
    return sizes | {"HEAVIEST": HEAVIEST} | ({"G": candidates.guides} if candidates.guides else {})


def _plane(candidates: Candidates) -> np.int32:
    return np.int32(candidates.rows * candidates.cols)


def _weighing(distances: Distances, win: Window) -> list[Any]:
    """The arguments that every kernel on distances begins with."""
    blocks, padded = distances.nearest.shape
    sizes = [np.int32(blocks), np.int32(distances.sites), np.int32(padded)]
    return [distances.distance, distances.nearest, *sizes, win.scale]


def _take(
    machine: Launcher,
    name: str,
    distances: Distances,
    candidates: Candidates,
    win: Window,
    *arguments: Any,
) -> Relaxed:
    """Launch a kernel that gives each site a source and a value."""
    sites, made = distances.sites, candidates.made
    out = Relaxed(machine.empty((sites,), np.int32), machine.empty((made, sites), np.uint16))
    machine.launch(
        machine.kernel("lcpdf", f"lcpdf_{name}", **_defines(machine, candidates)),
        (distances.sites,),
        *_weighing(distances, win),
        *(candidates.pixels, _plane(candidates), candidates.positions),
        *(*arguments, *out),
    )
    return out

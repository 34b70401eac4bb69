# SPDX-License-Identifier: BSD-3-Clause
"""The local conditional probability density function, equations (4) to (8) and (12), on the machine.

`density` and `histogram` return the function, `taken` is the choice of a site among its candidates.
"""

from __future__ import annotations

from itertools import accumulate
from math import exp, log, pow, sqrt
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.methods.mrf.arithmetic import exp32, fma32, log32
from simdtex.methods.mrf.neighbourhood import Confidences, Field
from simdtex.model.sample import Candidates

NO_WEIGHT = np.float32(28)
"""The exponent from which a weight is 0: exp(-28) 2**40 < 1."""


LOG_ONE = np.float32(22.1807098)
"""log 2**32: the logarithm of the mass if all steps of a kernel are legal."""


class Relaxed(NamedTuple):
    """Relaxed sites: ``choice`` (S,), pixel indices in the sample; ``values`` (C, S), working grey levels."""

    choice: Array
    values: Array


class ParzenWindow(NamedTuple):
    """The Gaussian of equation (7) at a bandwidth h, as tables over integer grey levels.

    ``scale``, 1 / 2h^2; ``noise`` (2 radius + 1,) uint32, the cumulative probabilities of the steps -radius..radius in
    2**-32; ``gauss`` (radius + 1,) float32, exp(-k^2 / 2h^2); ``top``, the highest legal level.
    """

    scale: np.float32
    noise: NDArray[np.uint32]
    gauss: NDArray[np.float32]
    radius: int
    top: int


class SiteChoice(NamedTuple):
    """The choice of a site among its candidates, step 6.2.2.2.

    ``draws``: whether it draws from the LCPDF, or takes its mode; ``density``: whether it takes a grey level of the
    Parzen density, or a pixel of the sample; ``window``: that of equation (7).
    """

    draws: bool
    density: bool
    window: ParzenWindow

    @property
    def spread(self) -> np.float32:
        """2 h^2 if a site draws, the factor of its noise; otherwise 0."""
        return np.float32(1) / self.window.scale if self.draws else np.float32(0)

    @property
    def mode(self) -> bool:
        """Whether a site takes the mode of the density."""
        return self.density and not self.draws


class Rule(Protocol):
    """The part of `simdtex.methods.mrf.relax.Relaxation` that the density at a site depends on."""

    @property
    def choice(self) -> SiteChoice:
        """The choice, with the window of equation (7)."""

    @property
    def proposal(self) -> Any:
        """The proposer, of all candidates."""

    @property
    def confidences(self) -> Confidences:
        """The confidences of guides and data."""

    def evaluate(self, sites: NDArray[np.int32], field: Field, turn: int) -> Any:
        """Return the candidates of sites with their costs, in NumPy."""

    def arguments(self, machine: Launcher, sites: Array, field: Field) -> tuple[dict[str, int], list[Any]]:
        """Return the -D constants and the arguments of a kernel that evaluates candidates."""


class Key(NamedTuple):
    """Keys of a step's random numbers: ``seed``, ``level``, ``turn``."""

    seed: int
    level: int
    turn: int


def optimal_bandwidth(variance: float, candidates: int, dimensions: int) -> float:
    """Return h_opt of equation (8): ``variance`` is sigma^2, ``candidates`` n, ``dimensions`` d = channels (N + 1)."""
    return sqrt(variance) * pow(4 / (candidates * (2 * dimensions + 1)), 1 / (dimensions + 4))


def window(bandwidth: float, top: int) -> ParzenWindow:
    """Return the tables for a bandwidth h in working grey levels.

    h below 10^-10, as of a constant sample, is replaced by 10^-10: 1 / 2h^2 is finite. The tables end before the
    Gaussian falls below 2**-33: none of their numbers is subnormal. math.exp is rounded to 2**-24 or coarser here, so
    the last bit of a platform's libm does not matter.
    """
    h = max(bandwidth, 1e-10)
    scale = np.float32(1 / (2 * h * h))
    radius = min(top, int(h * sqrt(2 * log(2.0**33))))
    gauss = [exp(-k * k / (2 * h * h)) for k in range(radius + 1)]
    steps = gauss[:0:-1] + gauss
    sums = list(accumulate(steps))  # sum() of Python 3.12 rounds differently
    noise = [min(2**32 - 1, round(partial / sums[-1] * 2**32)) for partial in sums]
    noise[-1] = 2**32 - 1
    return ParzenWindow(scale, np.array(noise, np.uint32), np.array(gauss, np.float32), radius, top)


def weights(distance: NDArray[np.float32], scale: np.float32) -> NDArray[np.uint64]:
    """Return W_p = floor(2^40 exp(-(d_p - min d) / 2h^2)), (candidates, S)."""
    a = (distance - distance.min(0)) * scale
    near = np.minimum(a, NO_WEIGHT)
    return np.where(a < NO_WEIGHT, exp32(-near) * np.float32(2**40), 0).astype(np.uint64)


def masses(w: NDArray[np.uint64], pixels: NDArray[Any], choice: SiteChoice) -> NDArray[np.uint64]:
    """Return the weights ``w`` (slots, S) or, of a density, their products with the legal shares of pixels' kernels."""
    for plane in pixels if choice.density else ():
        _, mass = legal(plane, choice.window)
        mass = np.broadcast_to(mass, w.shape)
        w = np.where(w > 0, np.maximum(random.below(np.zeros_like(mass), mass, w), 1), 0)
    return w


def stepped(
    x: NDArray[np.uint16], c: int, places: NDArray[np.int64], win: ParzenWindow, key: Key
) -> NDArray[np.uint16]:
    """Return grey levels drawn from the kernel of equation (7) around the grey levels ``x`` of channel ``c``."""
    low, mass = legal(x, win)
    bits = random.draw4(*key, places, random.DRAW, 1 + c)[0].astype(np.uint64)
    u = low + ((bits * mass) >> np.uint64(32)).astype(np.uint32)
    step = np.searchsorted(win.noise, u, side="right") - win.radius
    return (x.astype(np.int64) + step).astype(np.uint16)


def legal(y: NDArray[Any], win: ParzenWindow) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Return the start of the legal steps from grey level y among the cumulative probabilities, and their mass."""
    y = y.astype(np.int64)
    cumulative = np.concatenate([[0], win.noise]).astype(np.uint32)
    low = cumulative[np.maximum(0, win.radius - y)]
    return low, cumulative[np.minimum(2 * win.radius, win.radius + win.top - y) + 1] - low


def log_legal(y: NDArray[Any], win: ParzenWindow) -> NDArray[np.float32]:
    """Return the logarithm of the legal share of the kernel around grey level y."""
    return log32(legal(y, win)[1].astype(np.float32)) - LOG_ONE


def taken(
    numbers: NDArray[np.int64],
    cost: NDArray[np.float32],
    noise: NDArray[np.float32] | np.float32,
    candidates: Candidates,
    places: NDArray[np.int64],
    choice: SiteChoice,
    key: Key,
) -> Relaxed:
    """Return the choice of each site among the candidates ``numbers`` (slots, S or 1), in NumPy.

    That is the first of the least cost (slots, S), of a draw plus 2 h^2 times ``noise``.
    """
    total = cost
    if choice.draws:  # an empty slot stays empty
        total = np.where(
            np.isinf(cost), cost, fma32(choice.spread, noise, np.where(np.isinf(cost), np.float32(0), cost))
        )
    chosen = np.where(total == total.min(0), numbers, candidates.size).min(0)
    source = candidates.positions[chosen]
    values = candidates.pixels[: candidates.made, source].astype(np.uint16)
    if choice.mode:  # of all candidates
        pixels = candidates.pixels[: candidates.made, candidates.positions[: candidates.size]].astype(np.int64)
        source = candidates.positions[to_mode(values, weights(cost, choice.window.scale), pixels, choice.window)]
    elif choice.density:
        values = np.stack([stepped(x, c, places, choice.window, key) for c, x in enumerate(values)])
    return Relaxed(source, values)


def to_mode(
    x: NDArray[np.uint16], w: NDArray[np.uint64], pixels: NDArray[np.int64], win: ParzenWindow
) -> NDArray[np.intp]:
    """Move grey levels ``x`` (C, S) to the mode, in place, and return the slot (S,) that gives most there.

    Each channel in turn, and once more, takes the mode given the others, of several levels the lowest.
    ``w`` (slots, S) are the weights, ``pixels`` (C, slots) the grey levels of the candidates.
    """
    for c in turns(len(x)):
        x[c] = smoothed(pixels[c], weighed(x, w, pixels, win, c), win).argmax(0)
    return np.asarray(weighed(x, w, pixels, win, -1).argmax(0))


def turns(channels: int) -> list[int]:
    """Return the channels that take the mode given the others, in their order."""
    return [*range(channels)] * (2 if channels > 1 else 1)


def weighed(
    x: NDArray[Any], w: NDArray[np.uint64], pixels: NDArray[np.int64], win: ParzenWindow, but: int
) -> NDArray[np.uint64]:
    """Return the weights times the kernel of equation (7) at ``x`` in all channels ``but`` one, see `to_mode`."""
    for c, grey in enumerate(pixels):
        gap = abs(grey[:, None] - x[c])
        kernel = np.where(gap <= win.radius, win.gauss[np.minimum(gap, win.radius)], np.float32(0))
        w = w if c == but else (w.astype(np.float32) * kernel).astype(np.uint64)
    return w


def smoothed(y: NDArray[np.int64], w: NDArray[np.uint64], win: ParzenWindow) -> NDArray[np.float32]:
    """Return f(x) = sum over p of w_p exp(-(x - y_p)^2 / 2h^2), (greys, S), of y (slots,) and w (slots, S)."""
    mass = np.zeros((win.top + 1, w.shape[1]), np.uint64)
    np.add.at(mass, y, w)
    return spread(mass, win)


def spread(mass: NDArray[np.uint64], win: ParzenWindow) -> NDArray[np.float32]:
    """Return f(x), (greys, S), of the sums of weights of each grey level, (greys, S)."""
    greys, f = np.arange(win.top + 1), np.zeros(mass.shape, np.float32)
    for v in np.flatnonzero(mass.any(1)):
        gap = abs(greys - v)
        reached = gap <= win.radius
        f[reached] = fma32(mass[v].astype(np.float32), win.gauss[gap[reached], None], f[reached])
    return f


@Operation
def density(machine: Launcher | None, sites: Array, field: Field, relaxation: Rule, kind: Array | None = None) -> Array:
    """Return the density of one channel at each grey level, up to a factor, (S, greys) float32.

    ``relaxation`` proposes all candidates, and its random numbers are not read. ``kind`` (1, plane) float32 is the grey
    level of each candidate at its place in the square's ``levels``; None: these.
    """
    if machine is None:
        cost = relaxation.evaluate(sites, field, 0).cost
        return smoothed(
            _greys(relaxation, kind), weights(cost, relaxation.choice.window.scale), relaxation.choice.window
        ).T
    return density_and_mode(machine, sites, field, relaxation, kind)[0]


def density_and_mode(
    machine: Launcher, sites: Array, field: Field, relaxation: Rule, kind: Array | None = None
) -> tuple[Array, Relaxed]:
    """Return the density of the last channel, (S, greys), and the mode that each site takes, on a device."""
    made, win = len(field.values) - relaxation.confidences.guides, relaxation.choice.window
    shape = (sites.size, win.top + 1)
    mass, table = machine.empty(shape, np.uint64), machine.empty(shape, np.float32)
    mode = Relaxed(machine.empty((sites.size,), np.int32), machine.empty((made, sites.size), np.uint16))
    arguments = (machine.constant(win.gauss), mass, table, *mode)
    _table(machine, "lcpdf_density", sites, field, relaxation, kind, shape[1], *arguments)
    return table, mode


@Operation
def histogram(machine: Launcher | None, sites: Array, field: Field, relaxation: Rule, greys: int) -> Array:
    """Return the number of candidates of each grey level that match a site exactly, (S, greys) uint32: (4) and (5)."""
    if machine is None:
        cost, tally = relaxation.evaluate(sites, field, 0).cost, np.zeros((sites.size, greys), np.uint32)
        p, s = np.nonzero(cost == 0)
        np.add.at(tally, (s, _greys(relaxation, None)[p]), 1)
        return tally
    counts = machine.empty((sites.size, greys), np.uint32)
    _table(machine, "lcpdf_histogram", sites, field, relaxation, None, greys, counts)
    return counts


def _greys(relaxation: Rule, kind: NDArray[np.float32] | None) -> NDArray[np.int64]:
    """Return the grey level of each candidate in the first channel."""
    square = relaxation.proposal.square
    greys: NDArray[np.int64] = (square.levels if kind is None else kind)[0][square.at].astype(np.int64)
    return greys


def _table(
    machine: Launcher,
    kernel: str,
    sites: Array,
    field: Field,
    relaxation: Rule,
    kind: Array | None,
    greys: int,
    *results: Array,
) -> None:
    defines, arguments = relaxation.arguments(machine, sites, field)
    levels = relaxation.proposal.square.levels if kind is None else kind
    defines |= {} if kind is None else {"CHANNELS": len(kind)}
    machine.launch(kernel, (sites.size,), *arguments, levels, greys, *results, defines=defines)

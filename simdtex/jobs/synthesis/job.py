# SPDX-License-Identifier: BSD-3-Clause
"""The functions that most users need: `synthesize`, `explain`, `replay`, `lcpdf`."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from math import isqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.driver import with_channels_last
from simdtex.inputs import Synth, options_of
from simdtex.jobs.inputs import Work, check_inputs, public, with_light
from simdtex.machine import Machine, open_machine
from simdtex.methods import mrf
from simdtex.methods.mrf.options import ORDERS
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.model.sample import Sample
from simdtex.options import SMALLER, one_of, real, real_array, resolve, whole

TILED = f"{SMALLER}, or make it in tiles: --tiles 2048, or simdtex.jobs.tiles"
"""The remedy if an output of the method ``mrf`` is too large for this machine."""


@public("synth")
def synthesize(call: Synth) -> Work:
    """Synthesise a picture of any size with the texture of a sample.

    Returns
    -------
    image : array of the sample's type
        `shape` plus the channel axis, if the sample has one.

    Notes
    -----
    Cost of ``mrf``: by default some 100 fma for every output pixel, neighbour and channel, whatever the sample's size,
    since a site evaluates about six candidates; the structure channel is one more channel. With ``search="exact"`` it
    is about 14 fma for every output pixel, sample pixel, neighbour and channel, less those that bounds skip; nearly all
    of it at the finest level, since each coarser one has a quarter of the sites and of the candidates. ``multires``:
    some hundred comparisons for every output pixel, growing slowly with the sample and quickly with alpha. ``pyramid``:
    some 1700 multiply-adds and 8 sorted values for every output pixel, channel and iteration, whatever the sample's
    size. Memory grows with output pixels plus sample pixels, never with their product.

    Examples
    --------
    >>> from skimage import data
    >>> import simdtex
    >>> brick = data.brick()[:64, :64]
    >>> more = simdtex.synthesize(brick, (80, 96), order=2, rng=1)
    >>> more.shape
    (80, 96)
    """
    call.inputs = check_inputs(
        call.sample, call.shape, call.channel_axis, None, call.known, call.known_source, call.guide
    )
    if call.method != "mrf" and not call.inputs.plain:
        raise ValueError(
            f"the method {call.method} takes one sample that is known everywhere, no mask, no known values and no "
            'guide; give method="mrf"'
        )
    given = with_channels_last(call.options, call.channel_axis)
    chosen: Any = resolve(options_of("synth")[call.method], "synth", given)
    sample, light = with_light(call.sample, call.light, getattr(chosen, "categorical", False))
    if call.method == "mrf":
        plan: Any = replace(mrf.plan(sample, call.shape, chosen, call.inputs.given, call.inputs.guide), remedy=TILED)
    else:
        plan = import_module(f"simdtex.methods.{call.method}.algorithm").Plan(sample.pixels[0], call.shape, chosen)
    return Work(plan, chosen, call.channel_axis, light=light)


def lcpdf(
    image: ArrayLike,
    sample: ArrayLike,
    sites: ArrayLike,
    *,
    order: int = ORDERS[2],
    bandwidth: float = 1.0,
    temperature: ArrayLike | None = None,
    greys: int = 256,
    estimator: Literal["parzen", "histogram"] = "parzen",
    boundary: Literal["torus", "open"] = "torus",
    device: str | Machine | None = None,
) -> NDArray[np.float64]:
    """Return the local conditional probability density function of a nonparametric MRF.

    Parameters
    ----------
    image : (rows, cols) array of integers, 0 .. greys - 1
        x, the image whose neighbourhoods are compared.
    sample : (rows, cols) array of integers, 0 .. greys - 1
        y, the sample from which the density is estimated.
    sites : (S, 2) array of integers
        (row, column) of the sites s.
    order : int
        The order o of the neighbourhood, equation (3); by default that of `synthesize` with a large sample.
    bandwidth : float
        h in units of h_opt, equation (8). 1.0 is the paper's.
    temperature : (rows, cols) array, 0 to 1, optional
        t of equation (12), rounded to multiples of 1/1024; None is 0 everywhere.
    greys : int
        Number of grey levels, 2 to 4096.
    estimator : {"parzen", "histogram"}
        Equations (6) to (8), or counts of exact matches, (4) and (5); the latter disregards `bandwidth`, and
        neighbours with a temperature of 1 need not match.
    boundary : {"torus", "open"}
        Boundary of the image. Neighbours outside an open boundary have no weight.
    device : str, optional
        As in `synthesize`.

    Returns
    -------
    (S, greys) float64 array
        P(x_s = x | x_r, r in N_s); every row adds up to 1. Computed in float32: the same bits on every
        device, within 1e-5 of the formula in exact arithmetic.

    Raises
    ------
    ValueError
        The neighbourhood does not fit the sample, a grey level is out of range, or a site has no exact match.

    Notes
    -----
    Cost: S x sample pixels x neighbours x 2 fma, and 12 x greys bytes for each of the sites computed together, 4096 at
    most.
    """
    from simdtex.methods.mrf.density import lcpdf_at
    from simdtex.methods.mrf.neighbourhood import Field

    whole("greys", greys, 2, 4096)
    real("bandwidth", bandwidth, 0, above=True)
    one_of("estimator", estimator, ("parzen", "histogram"))
    one_of("boundary", boundary, ("torus", "open"))
    x = _check_grey("image", image, greys)
    y = _check_grey("sample", sample, greys)
    where = _check_sites(sites, x.shape)
    offsets = neighbourhood_offsets(order)
    if len(offsets) * (greys - 1) ** 2 > 2**33:  # beyond which (12) is not exact: see Sample
        most = 1 + isqrt(2**33 // len(offsets))
        raise ValueError(f"greys is {greys}; give at most {most} for order {order}")
    grey = Sample.of_levels(y, greys)
    mrf.check_fit(y.shape, int(offsets.max()), order)

    machine, grid = open_machine(device), Grid(x.shape[:2], boundary == "torus")
    planes = x[None].astype(np.uint16), np.zeros(x.shape, np.int32), _check_temperature(temperature, x.shape)
    field = Field(*map(machine.put, planes))
    return lcpdf_at(machine, field, grey, where, offsets, grid, bandwidth, estimator)


def _check_grey(name: str, array: ArrayLike, greys: int) -> NDArray[np.int64]:
    a = real_array(name, array)
    if a.ndim != 2 or not a.size:
        raise ValueError(f"{name} must be a (rows, cols) array that is not empty, not shape {a.shape}")
    if a.dtype.kind == "f":
        raise TypeError(f"{name} must hold integers 0 to {greys - 1}, not {a.dtype}")
    if a.min() < 0 or a.max() >= greys:
        raise ValueError(f"{name} holds {a.min()} to {a.max()}, beyond 0 to {greys - 1}; give more greys or rescale it")
    return a.astype(np.int64)


def _check_sites(sites: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.int32]:
    a = real_array("sites", sites)
    if a.size == 0:
        return np.zeros(0, np.int32)
    if a.ndim != 2 or a.shape[1] != 2 or a.dtype.kind not in "iu":
        raise ValueError(f"sites must be an (S, 2) array of whole (row, column), not {a.dtype} {a.shape}")
    if (a < 0).any() or (a >= np.array(shape)).any():
        raise ValueError(f"a site lies outside the image of {shape[0]} rows x {shape[1]} columns")
    return np.asarray(np.ravel_multi_index(tuple(a.T), shape), np.int32)


def _check_temperature(temperature: ArrayLike | None, shape: tuple[int, ...]) -> NDArray[np.uint16]:
    t = np.zeros(shape) if temperature is None else real_array("temperature", temperature).astype(np.float64)
    if t.shape != shape:
        raise ValueError(f"temperature has shape {t.shape}; give the image's, {shape}")
    if t.min() < 0 or t.max() > 1:
        raise ValueError("temperatures must lie between 0 and 1")
    return np.rint(t * 1024).astype(np.uint16)

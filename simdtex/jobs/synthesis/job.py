# SPDX-License-Identifier: BSD-3-Clause
"""The synthesis of a texture of any size, and the LCPDF: `synthesize` and `lcpdf`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import isqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.checkpoint import Checkpointing
from simdtex.driver import Device, Kept, Seed, drive, run
from simdtex.inputs import check_inputs, check_samples, check_shape, with_channels_last
from simdtex.io.hard_data import HardData
from simdtex.jobs.tiles.job import TileStore
from simdtex.machine import Machine, open_machine
from simdtex.maspar import observers
from simdtex.methods import mrf
from simdtex.methods.mrf.options import ORDERS
from simdtex.methods.multires import options as multires
from simdtex.methods.pyramid import options as pyramid
from simdtex.model.given import Given
from simdtex.model.guide import GuidePair, Surroundings
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.model.light import Light, in_light
from simdtex.model.pictures import Pictures
from simdtex.model.sample import Sample
from simdtex.options import SMALLER, one_of, real, real_array, resolve, whole
from simdtex.run import Callback, Output

TILED = f"{SMALLER}, or make it in tiles: --tiles 2048, or store=simdtex.TileStore(path)"
"""The remedy if an output of the method ``mrf`` is too large for this machine."""


def synthesize(
    sample: ArrayLike | Sequence[ArrayLike],
    shape: tuple[int, int],
    *,
    method: Literal["mrf", "multires", "pyramid"] = "mrf",
    mask: ArrayLike | Sequence[ArrayLike] | None = None,
    known: ArrayLike | HardData | str | os.PathLike[str] | None = None,
    known_source: ArrayLike | None = None,
    guide: tuple[Any, Any] | None = None,
    light: Literal["keep", "even"] = "keep",
    channel_axis: int | None = None,
    rng: Seed = None,
    device: Device = None,
    callback: Callback | None = None,
    checkpoint: Kept = None,
    store: TileStore | None = None,
    full_output: bool = False,
    **options: Any,
) -> Any:
    """Synthesise a picture of any size with the texture of a sample.

    Parameters
    ----------
    sample : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array; or a list of such
        The texture; any real type, any size that holds a neighbourhood. With ``mrf`` unknown pixels may be NaN or
        masked, and there may be several samples of one type, of any sizes.
    shape : (int, int)
        Rows and columns of the output, each 1 or more; smaller or larger than the sample.
    method : {"mrf", "multires", "pyramid"}
        The method of Paget and Longstaff (1998), of De Bonet (1997), or of Heeger and Bergen (1995).
    mask : (rows, cols) bool array, or a list of such, optional
        ``mrf``: True for pixels of the sample that may be taken; all other pixels are still neighbours.
    known : array of `shape` (and the channel axis), HardData, pandas.DataFrame or path, optional
        ``mrf``: conditioning data, values of the output that do not change by a bit: a masked array, floats with NaN
        for unknown values, a table of x, y and value (`simdtex.read_hard_data`), its file or a DataFrame. Some
        variables (channels) of a pixel may be known and others not. With `categorical` too, all defaults are those of
        `simdtex.simulate`: the output is open (``boundary``), and has the sample's shares.
    known_source : (rows, cols, 2) int array, optional
        ``mrf``: the (row, column) in the sample of known pixels, with several samples (row, column, sample); -1 for
        pixels from elsewhere. Known pixels with a position suggest candidates that continue it.
    guide : (array, array), optional
        ``mrf``: two pictures of labels or numbers, (rows, cols) or (rows, cols, G), of the sample's size and of the
        output's. A pixel comes from places where the first is like the second at the pixel; NaN in the second means no
        guide. With several samples, the first is a list of pictures.
    light : {"keep", "even"}
        Keep the light of the sample, or make it even: remove a quadratic of row and column from each channel.
    channel_axis : int, optional
        The axis of pictures that holds channels; None for grey pictures.
    rng : int or numpy.random.Generator, optional
        The seed: the same one gives the same bytes on every device. None draws one at random.
    device : str or Machine, optional
        Part of a name, index of ``simdtex devices``, or ``"reference"``. None: SIMDTEX_DEVICE, else a GPU, else a CPU.
    callback : callable, optional
        Called several times a second with a `simdtex.run.Progress`; an error that it raises ends the run.
    checkpoint : path or simdtex.Checkpoint, optional
        Keep the state of the run in this file, from which the same call continues it; removed when the run has ended.
    store : simdtex.TileStore, optional
        ``mrf``: make the output in tiles in this Zarr store, for outputs larger than one machine. The store keeps the
        state of the run, which `TileStore.resume` continues.
    full_output : bool
        Return a `simdtex.run.Output` too.
    **options
        Those of the method, see `simdtex.methods.mrf.Options`, `simdtex.methods.multires.options.Options` and
        `simdtex.methods.pyramid.options.Options`.

    Returns
    -------
    image : array of the sample's type
        `shape` plus the channel axis, if the sample has one. With `store` a dask array, read on demand.
    output : simdtex.run.Output
        Only with ``full_output=True``.

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.

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
    about: dict[str, Any] = {"method": method, "mask": mask, "known": known, "known_source": known_source}
    job = plan_synthesis(sample, shape, guide=guide, light=light, channel_axis=channel_axis, **about, **options)
    if store is not None:
        if not isinstance(store, TileStore):
            raise TypeError(f"store is a {type(store).__name__}; give simdtex.TileStore(path)")
        if checkpoint is not None or full_output:
            raise ValueError(
                "a store keeps the state and the source map of its run; leave checkpoint and full_output out"
            )
        return store.make(job, store.plan(job, rng), device, callback)
    picture, output = run("synthesize", job, rng, device, callback, checkpoint)
    return (picture, output) if full_output else picture


@dataclass(frozen=True)
class Synthesis:
    """The job of `synthesize`: one run of a method; ``remedy`` is the user's if the memory does not suffice."""

    pictures: Pictures
    shape: tuple[int, int]
    method: str
    options: Any
    given: Given | None
    guide: GuidePair | Surroundings | None
    light: Light
    channel_axis: int | None = field(compare=False)
    remedy: str = field(default=SMALLER, compare=False)

    def plan(self) -> Any:
        """Return the plan of the run."""
        if self.method == "mrf":
            plan = mrf.plan(self.pictures, self.shape, self.options, self.given, self.guide)
            return replace(plan, remedy=self.remedy)
        if self.method == "multires":  # each loads what the others do not need
            from simdtex.methods.multires.algorithm import MultiresPlan

            return MultiresPlan(self.pictures.pixels[0], self.shape, self.options)
        from simdtex.methods.pyramid.algorithm import PyramidPlan

        return PyramidPlan(self.pictures.pixels[0], self.shape, self.options)

    def make(
        self, machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Output]:
        """Run the plan, and return its result."""
        others = observers(self.options.array) if self.method == "mrf" else ()
        return drive(self.plan(), machine, seed, callback, checkpointing, others)


METHODS: dict[str, Any] = {"mrf": mrf.Options, "multires": multires.Options, "pyramid": pyramid.Options}
"""The options of each method."""


def plan_synthesis(
    sample: Any,
    shape: tuple[int, int],
    *,
    method: str = "mrf",
    mask: Any = None,
    known: Any = None,
    known_source: Any = None,
    guide: Any = None,
    light: str = "keep",
    channel_axis: int | None = None,
    **options: Any,
) -> Synthesis:
    """Check the arguments of `synthesize`, and return its job."""
    one_of("method", method, METHODS)
    pictures, size = check_samples(sample, channel_axis, mask), check_shape(shape)
    inputs = check_inputs(pictures, size, channel_axis, None, known, known_source, guide)
    if method != "mrf" and not inputs.plain:
        raise ValueError(
            f"the method {method} takes one sample that is known everywhere, no mask, no known values and no "
            'guide; give method="mrf"'
        )
    job = "simulate" if known is not None and options.get("categorical", False) else "synth"
    chosen: Any = resolve(METHODS[method], job, with_channels_last(options, channel_axis), synthesize)
    lit, about = in_light(pictures, light, vars(chosen).get("categorical", False))
    if job == "simulate" and not (chosen.proportions or guide) and lit.pixels[0].shape[-1] == 1:
        chosen = replace(chosen, proportions=tuple(chosen.of(lit).proportions().tolist()))
    return Synthesis(lit, size, method, chosen, inputs.given, inputs.guide, about, channel_axis, TILED)


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
    device : str or Machine, optional
        Part of a name, index of ``simdtex devices``, or ``"reference"``. None: SIMDTEX_DEVICE, else a GPU, else a CPU.

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

# SPDX-License-Identifier: BSD-3-Clause
"""The functions that most users need: `synthesize`, `synthesize_solid`, `explain`, `replay` and `lcpdf`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from math import isqrt
from operator import index
from typing import Any, Literal, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.checkpoint import Checkpoint
from simdtex.driver import Plan, check_shape, check_sides, drive, execute, with_channels_last
from simdtex.io.hard_data import HardData
from simdtex.io.image import check_sample
from simdtex.jobs.inputs import check_inputs
from simdtex.machine import Machine, open_machine
from simdtex.methods import mrf, multires, pyramid
from simdtex.methods.mrf.replay import Replay
from simdtex.methods.pyramid import solid
from simdtex.methods.typed_options import MrfOptions, MrfSynth, MultiresSynth, PyramidSynth, SolidSynth
from simdtex.model.explanation import Explanation
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.model.sample import Sample
from simdtex.options import SMALLER, lists_options, one_of, real, resolve, unmasked, whole
from simdtex.random import as_seed
from simdtex.run import Callback, Output, OutputWithSource

TILED = f"{SMALLER}, or make it in tiles: --tiles 2048, or simdtex.distributed"
"""The remedy if an output of the method ``mrf`` is too large for this machine."""

METHODS = ("mrf", "multires", "pyramid")
"""The packages of `simdtex.methods` for synthesis; the algorithm of each is loaded at its first use."""


@overload
def synthesize(
    sample: ArrayLike, shape: tuple[int, int], *, full_output: Literal[True], **options: Unpack[MrfSynth]
) -> tuple[NDArray[Any], OutputWithSource]: ...
@overload
def synthesize(
    sample: ArrayLike, shape: tuple[int, int], *, full_output: Literal[False] = ..., **options: Unpack[MrfSynth]
) -> NDArray[Any]: ...
@overload
def synthesize(
    sample: ArrayLike, shape: tuple[int, int], *, full_output: Literal[True], **options: Unpack[MultiresSynth]
) -> tuple[NDArray[Any], OutputWithSource]: ...
@overload
def synthesize(
    sample: ArrayLike, shape: tuple[int, int], *, full_output: Literal[False] = ..., **options: Unpack[MultiresSynth]
) -> NDArray[Any]: ...
@overload
def synthesize(
    sample: ArrayLike, shape: tuple[int, int], *, full_output: Literal[True], **options: Unpack[PyramidSynth]
) -> tuple[NDArray[Any], Output]: ...
@overload
def synthesize(
    sample: ArrayLike, shape: tuple[int, int], *, full_output: Literal[False] = ..., **options: Unpack[PyramidSynth]
) -> NDArray[Any]: ...
@lists_options("synth", mrf.Options, multires.Options, pyramid.Options)
def synthesize(
    sample: ArrayLike,
    shape: tuple[int, int],
    *,
    method: Literal["mrf", "multires", "pyramid"] = "mrf",
    channel_axis: int | None = None,
    mask: ArrayLike | Sequence[ArrayLike] | None = None,
    known: ArrayLike | HardData | str | os.PathLike[str] | None = None,
    known_source: ArrayLike | None = None,
    guide: tuple[Any, Any] | None = None,
    rng: int | np.random.Generator | None = None,
    device: str | Machine | None = None,
    callback: Callback | None = None,
    full_output: bool = False,
    checkpoint: str | os.PathLike[str] | Checkpoint | None = None,
    **options: Any,
) -> NDArray[Any] | tuple[NDArray[Any], Output]:
    """Synthesise a picture of any size with the texture of a sample.

    Parameters
    ----------
    sample : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array; or a list of such
        The texture; any real type, any size that holds a neighbourhood. With ``mrf`` unknown pixels may be NaN or
        masked, and there may be several samples of one type, of any sizes.
    shape : (int, int)
        Rows and columns of the output, each 1 or more; smaller or larger than the sample.
    method : {"mrf", "multires", "pyramid"}
        Paget and Longstaff's nonparametric multiscale Markov random field (1998), Algorithm 1; De Bonet's
        multiresolution sampling (1997); or Heeger and Bergen's pyramid matching (1995).
    channel_axis : int, optional
        The axis of the sample that holds channels; None for a grey sample.
    mask : (rows, cols) bool array, or a list of such, optional
        ``mrf``: True for pixels of the sample that may be taken; all other pixels are still neighbours.
    known : array of `shape` (and the channel axis), HardData or path, optional
        ``mrf``: conditioning data, values of the output that do not change by a bit: a masked array, floats with NaN
        for unknown values, a table (`simdtex.read_hard_data`) or its file. Some variables (channels) of a pixel may be
        known and others not.
    known_source : (rows, cols, 2) int array, optional
        ``mrf``: the (row, column) in the sample of known pixels, with several samples (row, column, sample); -1 for
        pixels from elsewhere. Known pixels with a position suggest candidates that continue it.
    guide : (array, array), optional
        ``mrf``: two pictures of labels or numbers, (rows, cols) or (rows, cols, G), of the sample's size and of the
        output's. A pixel comes from places where the first is like the second at the pixel; NaN in the second means no
        guide. With several samples, the first is a list of pictures.
    rng : int or numpy.random.Generator, optional
        The seed. The same seed gives the same bytes on every device. None draws a random seed.
    device : str, optional
        Part of a device's name or platform, an index of ``simdtex devices``, or ``"reference"``. None takes
        SIMDTEX_DEVICE, else a GPU, else a CPU.
    callback : callable, optional
        Called with a `simdtex.run.Progress` several times a second.
    full_output : bool
        Return statistics, stages, the source map and, with ``mrf``, temperatures too; with ``pyramid`` only statistics.
    checkpoint : path or simdtex.Checkpoint, optional
        A file that keeps the state of the run. If the file has the state of an interrupted run of the same call, the
        run continues from it, to the same bytes. The file is removed when the function returns.
    **options
        Options of the method, and ``preset``: see `simdtex.methods.mrf.Options`, `simdtex.methods.multires.Options` and
        `simdtex.methods.pyramid.Options`. The signature shows the defaults of ``mrf`` where methods share a name.

    Returns
    -------
    image : array of the sample's type
        `shape` plus the channel axis, if the sample has one.
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
    one_of("method", method, METHODS)
    size = check_shape(shape)
    inputs = check_inputs(sample, size, channel_axis, mask, known, known_source, guide)
    if method != "mrf" and not inputs.plain:
        raise ValueError(
            f"the method {method} takes one sample that is known everywhere, no mask, no known values and no guide; "
            'give method="mrf"'
        )
    table = import_module(f"simdtex.methods.{method}").Options
    chosen: Any = resolve(table, "synth", with_channels_last(options, channel_axis))
    plan: Plan
    if method == "mrf":
        plan = replace(mrf.plan(inputs.pictures, size, chosen, inputs.given, inputs.guide), remedy=TILED)
    else:
        plan = import_module(f"simdtex.methods.{method}.algorithm").Plan(inputs.pictures.pixels[0], size, chosen)

    def identity() -> dict[str, Any]:
        return {"method": method, "shape": size, "options": chosen, **inputs.identity()}

    return execute(
        "synthesize", partial(drive, plan), identity, channel_axis, rng, device, callback, full_output, checkpoint
    )


@overload
def synthesize_solid(
    sample: ArrayLike, shape: tuple[int, int, int], *, full_output: Literal[True], **options: Unpack[SolidSynth]
) -> tuple[NDArray[Any], Output]: ...
@overload
def synthesize_solid(
    sample: ArrayLike, shape: tuple[int, int, int], *, full_output: Literal[False] = ..., **options: Unpack[SolidSynth]
) -> NDArray[Any]: ...
@lists_options("solid", solid.Options)
def synthesize_solid(
    sample: ArrayLike,
    shape: tuple[int, int, int],
    *,
    channel_axis: int | None = None,
    rng: int | np.random.Generator | None = None,
    device: str | Machine | None = None,
    callback: Callback | None = None,
    full_output: bool = False,
    checkpoint: str | os.PathLike[str] | Checkpoint | None = None,
    **options: Any,
) -> NDArray[Any] | tuple[NDArray[Any], Output]:
    """Make a solid texture: a block whose slices look like a sample (Heeger and Bergen 1995, section 4).

    Parameters
    ----------
    sample : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array
        The texture. It should be isotropic, since every slice of the block looks like it.
    shape : (int, int, int)
        Depth, rows and columns of the block, each 1 or more. It repeats without a seam in every direction.
    channel_axis : int, optional
        The axis of the sample that holds channels; None for a grey sample.
    rng, device
        As in `synthesize`.
    callback : callable, optional
        Called with a `simdtex.run.Iterating` after every part of an iteration.
    full_output : bool
        Return statistics too.
    checkpoint
        As in `synthesize`.
    **options
        See `simdtex.methods.pyramid.solid.Options`; ``start`` is a block, channels last. With ``pyramid="steerable"``
        the 3-D Laplacian pyramid and the steerable pyramids of all x-y, x-z and y-z slices are matched; ``"laplacian"``
        matches only the first.

    Returns
    -------
    volume : (depth, rows, cols) array of the sample's type
        With `channel_axis`, the channels are last.
    output : simdtex.run.Output
        Only with ``full_output=True``.

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.

    Notes
    -----
    Cost: some 5000 multiply-adds and 25 sorted values for every voxel, channel and iteration. Memory: see
    ``docs/concepts/pyramid.rst``.

    Examples
    --------
    >>> from skimage import data
    >>> import simdtex
    >>> block = simdtex.synthesize_solid(data.gravel()[:64, :64], (16, 24, 32), rng=1)
    >>> block.shape
    (16, 24, 32)
    """
    pixels = check_sample(sample, channel_axis)
    size: Any = check_sides(shape, ("depth", "rows", "columns"))
    chosen = resolve(solid.Options, "solid", options)
    run, axis = partial(drive, solid.Plan(pixels, size, chosen)), None if channel_axis is None else -1
    inputs = {"shape": size, "options": chosen, "sample": pixels}
    return execute("synthesize_solid", run, lambda: inputs, axis, rng, device, callback, full_output, checkpoint)


@lists_options("synth", mrf.Options)
def explain(
    sample: ArrayLike,
    shape: tuple[int, int],
    site: tuple[int, int],
    *,
    level: int = 0,
    sweep: int | None = None,
    channel_axis: int | None = None,
    mask: ArrayLike | Sequence[ArrayLike] | None = None,
    known: ArrayLike | HardData | str | os.PathLike[str] | None = None,
    known_source: ArrayLike | None = None,
    guide: tuple[Any, Any] | None = None,
    rng: int | np.random.Generator | None = None,
    device: str | Machine | None = None,
    **options: Unpack[MrfOptions],
) -> Explanation:
    """Return an explanation of why a site takes its candidate, in a synthesis by the method ``mrf``.

    The run is that of `synthesize` with the same arguments, up to the step of the sweep in which the site relaxes. The
    explanation describes that relaxation, with the field just before it.

    Parameters
    ----------
    sample, shape
        As in `synthesize`.
    site : (int, int)
        (row, column) on the level's lattice: pixel (2**level row, 2**level column) of the output.
    level : int
        0 is the finest.
    sweep : int, optional
        A sweep of the level, from 1, in which the site relaxes. None: the last such sweep, which made the pixel.
    channel_axis, mask, known, known_source, guide, rng, device
        As in `synthesize`; give the seed of the run to explain.
    **options
        See `simdtex.methods.mrf.Options`.

    Returns
    -------
    simdtex.model.explanation.Explanation

    Raises
    ------
    ValueError, TypeError
        An argument is invalid, or the site does not relax there, because its value is known or is that of the level
        above.

    Notes
    -----
    Cost: the run up to the end of the level, with a copy to the host after each of its sweeps; with `sweep`, the run up
    to that sweep.

    Examples
    --------
    >>> from skimage import data
    >>> import simdtex
    >>> why = simdtex.explain(data.brick()[:32, :32], (32, 32), (5, 7), order=2, rng=1)
    >>> why.drawn, int(why.candidates.rank[why.taken])
    (False, 0)
    """
    whole("level", level, 0)
    if sweep is not None:
        whole("sweep", sweep, 1)
    try:
        row, col = map(index, site)
    except (TypeError, ValueError):
        raise ValueError(f"site must be two integers (row, column), not {site!r}") from None
    given: Any = {"channel_axis": channel_axis, "mask": mask, "known": known, "known_source": known_source}
    given |= {"guide": guide, "rng": rng, "device": device}
    return replay(sample, shape, **given, **options).explain((row, col), level, sweep)


@lists_options("synth", mrf.Options)
def replay(
    sample: ArrayLike,
    shape: tuple[int, int],
    *,
    channel_axis: int | None = None,
    mask: ArrayLike | Sequence[ArrayLike] | None = None,
    known: ArrayLike | HardData | str | os.PathLike[str] | None = None,
    known_source: ArrayLike | None = None,
    guide: tuple[Any, Any] | None = None,
    rng: int | np.random.Generator | None = None,
    device: str | Machine | None = None,
    **options: Unpack[MrfOptions],
) -> Replay:
    """Return a replay of a synthesis by the method ``mrf``, with its field after any set of sites that relax together.

    Parameters
    ----------
    sample, shape, channel_axis, mask, known, known_source, guide, rng, device, **options
        As in `explain`.

    Returns
    -------
    simdtex.methods.mrf.replay.Replay

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.

    Notes
    -----
    Cost: the run, and memory of the host, see `simdtex.methods.mrf.replay.Replay`.

    Examples
    --------
    >>> from skimage import data
    >>> import simdtex
    >>> replay = simdtex.replay(data.brick()[:32, :32], (32, 32), order=2, schedule="checkerboard", rng=1)
    >>> last = replay.sweeps[-1]
    >>> last.level, last.sets
    (0, 2)
    >>> replay.at(-1, sets=1).image.shape
    (32, 32, 1)
    """
    size = check_shape(shape)
    inputs = check_inputs(sample, size, channel_axis, mask, known, known_source, guide)
    chosen: Any = resolve(mrf.Options, "synth", options)
    plan = mrf.plan(inputs.pictures, size, chosen, inputs.given, inputs.guide)
    return Replay(plan, open_machine(device), as_seed(rng))


def lcpdf(
    image: ArrayLike,
    sample: ArrayLike,
    sites: ArrayLike,
    *,
    order: int = mrf.Options.order,
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
        The order o of the neighbourhood, equation (3); by default that of `synthesize`.
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
    from simdtex.ops.neighbourhood import Field

    whole("greys", greys, 2)
    if greys > 4096:
        raise ValueError(f"greys is {greys}; give 4096 or fewer")
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

    machine, grid = open_machine(device), Grid(x.shape[0], x.shape[1], 1, boundary == "torus")
    planes = x[None].astype(np.uint16), np.zeros(x.shape, np.int32), _check_temperature(temperature, x.shape)
    field = Field(*map(machine.put, planes))
    return lcpdf_at(machine, field, grey, where, offsets, grid, bandwidth, estimator)


def _check_grey(name: str, array: ArrayLike, greys: int) -> NDArray[np.int64]:
    unmasked(name, array)
    a = np.asarray(array)
    if a.ndim != 2 or not a.size:
        raise ValueError(f"{name} must be a (rows, cols) array that is not empty, not shape {a.shape}")
    if not np.issubdtype(a.dtype, np.integer) and a.dtype != np.bool_:
        raise TypeError(f"{name} must hold integers 0 to {greys - 1}, not {a.dtype}")
    if a.min() < 0 or a.max() >= greys:
        raise ValueError(f"{name} holds {a.min()} to {a.max()}, beyond 0 to {greys - 1}; give more greys or rescale it")
    return a.astype(np.int64)


def _check_sites(sites: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.int32]:
    unmasked("sites", sites)
    a = np.asarray(sites)
    if a.size == 0:
        return np.zeros(0, np.int32)
    if a.ndim != 2 or a.shape[1] != 2 or not np.issubdtype(a.dtype, np.integer):
        raise ValueError(f"sites must be an (S, 2) array of whole (row, column), not {a.dtype} {a.shape}")
    if (a < 0).any() or (a >= np.array(shape)).any():
        raise ValueError(f"a site lies outside the image of {shape[0]} rows x {shape[1]} columns")
    flat: NDArray[np.int32] = (a[:, 0] * shape[1] + a[:, 1]).astype(np.int32)
    return flat


def _check_temperature(temperature: ArrayLike | None, shape: tuple[int, ...]) -> NDArray[np.uint16]:
    unmasked("temperature", temperature)
    t = np.zeros(shape) if temperature is None else np.asarray(temperature, np.float64)
    if t.shape != shape:
        raise ValueError(f"temperature has shape {t.shape}; give the image's, {shape}")
    if not ((t >= 0) & (t <= 1)).all():
        raise ValueError("temperatures must lie between 0 and 1")
    return np.rint(t * 1024).astype(np.uint16)

# SPDX-License-Identifier: BSD-3-Clause
"""The functions of pyramid matching alone: `mix` and `synthesize_solid`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.driver import Device, Kept, Seed, SingleRun, run
from simdtex.inputs import check_shape, check_sides, with_channels_last
from simdtex.io.image import check_sample
from simdtex.methods.pyramid import solid
from simdtex.methods.pyramid.mixtures import Mixture
from simdtex.methods.pyramid.options import Options
from simdtex.options import real, resolve, whole
from simdtex.run import Callback


def mix(
    samples: Sequence[ArrayLike],
    shape: tuple[int, int],
    *,
    palette: int | None = None,
    pattern: int | None = None,
    average: Sequence[float] | None = None,
    low: int | None = None,
    high: int | None = None,
    split: int | None = None,
    channel_axis: int | None = None,
    rng: Seed = None,
    device: Device = None,
    callback: Callback | None = None,
    checkpoint: Kept = None,
    full_output: bool = False,
    **options: Any,
) -> Any:
    """Return a mixture of several textures, by pyramid matching.

    Parameters
    ----------
    samples : sequence of (rows, cols) or, with `channel_axis`, three-dimensional arrays
        One or more, of one type and any sizes. With `channel_axis`, grey ones may have two axes.
    shape : (int, int)
        Rows and columns of the output.
    palette : int, optional
        The sample, by number from 0, whose decorrelating transform and pixel histogram the output has. Channels of the
        transform in which the pattern is flat, as in a grey one, have the palette's mean. None: those of the pattern.
    pattern : int, optional
        The sample whose subband histograms are matched. None: the average of all.
    average : sequence of float, optional
        A weight for every sample, 0 or more. By default all weights are equal.
    low, high : int, optional
        The samples of the low and of the high frequencies.
    split : int, 0 or more, optional
        Number of levels, from the finest on, that are high frequencies; by default half of them.
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
    full_output : bool
        Return a `simdtex.run.Output` too.
    **options
        Those of the method, see `simdtex.methods.pyramid.options.Options`.

    Returns
    -------
    image : array of the samples' type
        `shape` plus the channel axis, if the samples have one.
    output : simdtex.run.Output
        Only with ``full_output=True``.

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.

    Notes
    -----
    Cost: that of `simdtex.synthesize` with ``method="pyramid"``, and an analysis of every sample.

    Examples
    --------
    >>> from skimage import data
    >>> import simdtex
    >>> brick, gravel = data.brick()[:64, :64], data.gravel()[:64, :64]
    >>> simdtex.mix([brick, gravel], (96, 96), average=[1, 2], rng=1).shape
    (96, 96)
    """
    pictures, size = _check_samples(samples, channel_axis), check_shape(shape)
    parts = {name: n for name, n in (("pattern", pattern), ("low", low), ("high", high)) if n is not None}
    for name, index in {**parts, "palette": palette}.items():
        integer = isinstance(index, Integral) and not isinstance(index, bool)
        if index is not None and not (integer and 0 <= int(index) < len(pictures)):
            raise ValueError(f"{name} is {index!r}; give the number of a sample, 0 to {len(pictures) - 1}")
    sides = None if low is None or high is None else (low, high, split)
    if not sides and {"low", "high"} & {*parts}:
        raise ValueError("low and high go together; give both, or neither")
    if (pattern is not None) + (average is not None) + (sides is not None) > 1:
        raise ValueError("a mixture has one pattern; give pattern, average, or low and high")
    if split is not None:
        whole("split", split, 0)
        if not sides:
            raise ValueError("split parts low from high; give these two, or leave split out")
    used = [float(n in parts.values()) for n in range(len(pictures))]
    weights = used if parts else _check_weights(average, len(pictures))
    chosen = resolve(Options, "mix", with_channels_last(options, channel_axis), mix)
    job = Mix(pictures, size, chosen, weights, sides, palette, channel_axis)
    picture, output = run("mix", job, rng, device, callback, checkpoint)
    return (picture, output) if full_output else picture


@dataclass(frozen=True)
class Mix(SingleRun, Mixture):
    """The job of `mix`."""

    channel_axis: int | None = field(compare=False)


def _check_samples(samples: Sequence[ArrayLike], channel_axis: int | None) -> list[NDArray[Any]]:
    """Return the samples as (rows, cols, channels), grey ones with the number of channels of colour ones."""
    if not isinstance(samples, Sequence):
        kind = "a single array" if isinstance(samples, np.ndarray) else f"of {type(samples).__name__}"
        raise TypeError(f"samples is {kind}; give a list of samples")
    pictures = [check_sample(sample, None if np.ndim(sample) == 2 else channel_axis) for sample in samples]
    if not pictures:
        raise ValueError("there is no sample; give one or more")
    dtype, channels = pictures[0].dtype, max(p.shape[-1] for p in pictures)
    for index, p in enumerate(pictures):
        if p.dtype != dtype:
            raise TypeError(f"sample {index} is of {p.dtype} and the first of {dtype}; convert them to one type")
        if p.shape[-1] not in (1, channels):
            counts = f"{p.shape[-1]} channels and another {channels}"
            raise ValueError(f"sample {index} has {counts}; give all the same, or grey ones")
    return [np.broadcast_to(p, (*p.shape[:2], channels)) for p in pictures]


def _check_weights(average: Sequence[float] | None, count: int) -> list[float]:
    """Return the weights of samples in the pattern; None are equal ones."""
    if average is not None and not isinstance(average, (Sequence, np.ndarray)):
        raise TypeError(f"average is {average!r}; give a list of weights, one for each sample")
    weights = [1.0] * count if average is None else list(average)
    if len(weights) != count:
        raise ValueError(f"average has {len(weights)} weights for {count} samples; give one for each")
    for weight in weights:
        real("a weight of average", weight, 0)
    if not any(weights):
        raise ValueError("all weights of average are 0; give one above 0")
    return [float(weight) for weight in weights]


def synthesize_solid(
    sample: ArrayLike,
    shape: tuple[int, int, int],
    *,
    channel_axis: int | None = None,
    rng: Seed = None,
    device: Device = None,
    callback: Callback | None = None,
    checkpoint: Kept = None,
    full_output: bool = False,
    **options: Any,
) -> Any:
    """Make a solid texture: a block whose slices look like a sample (Heeger and Bergen 1995, section 4).

    Parameters
    ----------
    sample : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array
        The texture. It should be isotropic, since every slice of the block looks like it.
    shape : (int, int, int)
        Depth, rows and columns of the block, each 1 or more. It repeats without a seam in every direction.
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
    full_output : bool
        Return a `simdtex.run.Output` too.
    **options
        Those of the method, see `simdtex.methods.pyramid.solid.Options`.

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
    pixels, (depth, rows, cols) = check_sample(sample, channel_axis), check_sides(shape, ("depth", "rows", "columns"))
    chosen = resolve(solid.Options, "solid", options, synthesize_solid)
    job = Solid(pixels, (depth, rows, cols), chosen, None if channel_axis is None else -1)
    volume, output = run("synthesize_solid", job, rng, device, callback, checkpoint)
    return (volume, output) if full_output else volume


@dataclass(frozen=True)
class Solid(SingleRun, solid.SolidPlan):
    """The job of `synthesize_solid`; its channels are last."""

    channel_axis: int | None = field(compare=False)

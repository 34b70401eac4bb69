# SPDX-License-Identifier: BSD-3-Clause
"""The functions of pyramid matching alone: `synthesize_solid` and `mix`."""

from __future__ import annotations

from simdtex.declared import Mix, Solid
from simdtex.driver import with_channels_last
from simdtex.jobs.inputs import Work, public
from simdtex.methods.pyramid import options as pyramid
from simdtex.methods.pyramid import solid
from simdtex.methods.pyramid.mixtures import mixture
from simdtex.options import resolve


@public("solid")
def synthesize_solid(call: Solid) -> Work:
    """Make a solid texture: a block whose slices look like a sample (Heeger and Bergen 1995, section 4).

    Returns
    -------
    volume : (depth, rows, cols) array of the sample's type
        With `channel_axis`, the channels are last.

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
    chosen = resolve(solid.Options, "solid", call.options)
    return Work(solid.Plan(call.sample, call.shape, chosen), chosen, None if call.channel_axis is None else -1)


@public("mix")
def mix(call: Mix) -> Work:
    """Return a mixture of several textures, by pyramid matching.

    Its pattern is that of one sample (`pattern`), the average of several (`average`, the default), or the low
    frequencies of one sample with the high frequencies of another (`low`, `high`). Its colours are those of its
    pattern, or of another sample (`palette`).

    Returns
    -------
    image : array of the samples' type
        `shape` plus the channel axis, if the samples have one.

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
    chosen = resolve(pyramid.Options, "mix", with_channels_last(call.options, call.channel_axis))
    pattern = (call.pattern, call.average, call.low, call.high, call.split)
    plan = mixture(call.samples, call.shape, call.channel_axis, chosen, call.palette, *pattern)
    call.samples = plan.pictures
    return Work(plan, chosen, call.channel_axis)

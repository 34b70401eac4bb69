# SPDX-License-Identifier: BSD-3-Clause
"""A look inside a synthesis by the method ``mrf``: `explain` and `replay`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from operator import index
from typing import Any, Literal

from numpy.typing import ArrayLike

from simdtex.driver import Device, Seed
from simdtex.io.hard_data import HardData
from simdtex.jobs.synthesis.job import plan_synthesis
from simdtex.jobs.why.replay import Replay
from simdtex.machine import open_machine
from simdtex.model.explanation import Explanation
from simdtex.options import whole
from simdtex.random import as_seed


def explain(
    sample: ArrayLike | Sequence[ArrayLike],
    shape: tuple[int, int],
    site: tuple[int, int],
    *,
    level: int = 0,
    sweep: int | None = None,
    mask: ArrayLike | Sequence[ArrayLike] | None = None,
    known: ArrayLike | HardData | str | os.PathLike[str] | None = None,
    known_source: ArrayLike | None = None,
    guide: tuple[Any, Any] | None = None,
    light: Literal["keep", "even"] = "keep",
    channel_axis: int | None = None,
    rng: Seed = None,
    device: Device = None,
    **options: Any,
) -> Explanation:
    """Return an explanation of why a site takes its candidate, in a synthesis by the method ``mrf``.

    The run is that of `synthesize` with the same arguments, up to the step of the sweep in which the site relaxes. The
    explanation describes that relaxation, with the field just before it.

    Parameters
    ----------
    sample, shape, mask, known, known_source, guide, light, channel_axis, device, **options
        As in `synthesize`; the options are those of `simdtex.methods.mrf.Options`.
    site : (int, int)
        (row, column) on the level's lattice: pixel (2**level row, 2**level column) of the output.
    level : int
        0 is the finest.
    sweep : int, optional
        A sweep of the level, from 1, in which the site relaxes. None: the last such sweep, which made the pixel.
    rng : int or numpy.random.Generator, optional
        The seed of the run to explain.

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
    about: dict[str, Any] = {"mask": mask, "known": known, "known_source": known_source, "guide": guide, "light": light}
    about |= {"channel_axis": channel_axis, "rng": rng, "device": device}
    return replay(sample, shape, **about, **options).explain((row, col), level, sweep)


def replay(
    sample: ArrayLike | Sequence[ArrayLike],
    shape: tuple[int, int],
    *,
    mask: ArrayLike | Sequence[ArrayLike] | None = None,
    known: ArrayLike | HardData | str | os.PathLike[str] | None = None,
    known_source: ArrayLike | None = None,
    guide: tuple[Any, Any] | None = None,
    light: Literal["keep", "even"] = "keep",
    channel_axis: int | None = None,
    rng: Seed = None,
    device: Device = None,
    **options: Any,
) -> Replay:
    """Return a replay of a synthesis by the method ``mrf``, with its field after any set of sites that relax together.

    Parameters
    ----------
    sample, shape, mask, known, known_source, guide, light, channel_axis, rng, device, **options
        As in `explain`.

    Returns
    -------
    simdtex.jobs.why.replay.Replay

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.

    Notes
    -----
    Cost: the run, and memory of the host, see `simdtex.jobs.why.replay.Replay`.

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
    about: dict[str, Any] = {"mask": mask, "known": known, "known_source": known_source, "guide": guide, "light": light}
    job = plan_synthesis(sample, shape, channel_axis=channel_axis, **about, **options)
    return Replay(job.plan(), open_machine(device), as_seed(rng))

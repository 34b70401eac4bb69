# SPDX-License-Identifier: BSD-3-Clause
"""One sample under several thresholds, as in Figures 11 and 12 of De Bonet (1997)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.driver import check_shape, drive, restored
from simdtex.io.image import check_sample
from simdtex.machine import Machine, open_machine
from simdtex.methods.multires.algorithm import Plan
from simdtex.methods.multires.analysis import analyse
from simdtex.methods.multires.options import Options
from simdtex.options import resolve
from simdtex.random import as_seed

__all__ = ["Member", "series"]


@dataclass(frozen=True)
class Member:
    """One picture of a series.

    Attributes
    ----------
    alpha, beta : float
        Of T = alpha / k**beta, equation (13).
    image : (rows, cols[, channels]) array
        In the sample's type.
    levels : list of dict
        What `simdtex.run.Output.statistics` has for each level: ``candidates`` and more, the coarsest first.
    seconds : float
    """

    alpha: float
    beta: float
    image: NDArray[Any]
    levels: list[dict[str, Any]]
    seconds: float


def series(
    sample: ArrayLike,
    shape: tuple[int, int],
    alphas: Iterable[float],
    betas: Iterable[float] = (0.0,),
    *,
    channel_axis: int | None = None,
    rng: int | np.random.Generator | None = None,
    device: str | Machine | None = None,
    callback: Callable[[float, Member | None], Any] | None = None,
    **options: Any,
) -> list[Member]:
    """Synthesise a sample by ``multires`` under every pair of thresholds, with one analysis and one seed.

    Parameters
    ----------
    sample, shape, channel_axis, rng, device
        As in `simdtex.synthesize`.
    alphas, betas : iterables of float
        Every alpha under the first beta, then under the next.
    callback : callable, optional
        Called several times a second with the share that is done, 0 to 1, and the last member that is, if any.
    **options
        Others of the method, see `simdtex.methods.multires.Options`.

    Returns
    -------
    list of Member

    Raises
    ------
    ValueError, TypeError
        What is wrong and what would be right, in one sentence, before any of them is made.
    """
    pixels, size, seed = check_sample(sample, channel_axis), check_shape(shape), as_seed(rng)
    alphas = list(alphas)
    made: list[Member] = []
    pairs = [{"alpha": alpha, "beta": beta} for beta in betas for alpha in alphas]
    chosen = [resolve(Options, "sheet", pair | options) for pair in pairs]
    if not chosen:
        raise ValueError("there is no alpha or no beta; give one of each or more")
    machine = open_machine(device)
    analysis = analyse(machine, pixels, **chosen[0].analysis)
    for number, one in enumerate(chosen):

        def tell(progress: Any, number: int = number) -> None:
            if callback:
                callback((number + progress.fraction) / len(chosen), made[-1] if made else None)

        image, output = drive(Plan(pixels, size, one, analysis), machine, seed, tell)
        found = output.statistics
        image = restored(image, channel_axis)
        made.append(Member(found["options"]["alpha"], one.beta, image, found["levels"], found["seconds"]))
    return made

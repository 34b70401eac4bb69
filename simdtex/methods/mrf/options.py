# SPDX-License-Identifier: BSD-3-Clause
"""The options of the method ``mrf``, their defaults, and the presets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.maspar.array import MAPPINGS, parse_array
from simdtex.model.lattice import check_order
from simdtex.model.pictures import Pictures
from simdtex.options import build, check, integer, number_of, one_of, real, shown, switch, whole, words

PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "paper": {
        "relaxation": "gibbs",
        "bandwidth": 1.0,
        "coherence": 0.0,
        "xi": -1.0,
        "free_sweeps": 0,
        "pixel": "density",
        "phases": "decimated",
        "edges": "whole",
        "coarsest": "same",
        "search": "exact",
        "overview": 64,
        "balance": 0.0,
        "structure": 0.0,
        "novelty": 0.0,
        "finish": 0.0,
    },
}
"""``paper`` keeps the 1998 rules to the letter."""


CATEGORIES = 16
"""Different pixels up to which a sample is taken for a map of categories."""

FINISH = 1.5
"""The default standard deviation of the finish, pixels."""

NARROWEST, WIDEST = 0.01, 16.0
"""The least and the largest standard deviation of a finish."""

SIMILAR, CHANCE = 64, 4096
"""The most of the candidates that a search by coherence weighs for each suggestion, and at random."""

SEARCHED = ("search", "suggesting", "similar", "chance", "exhaustive")
"""The options that say how candidates are searched for, which makes no difference at the coarsest level."""


@dataclass(frozen=True)
class Options:
    """The options of the method ``mrf``.

    Parameters
    ----------
    order : int
        o of equation (3): neighbours within the distance sqrt(o); 1 to 4096.
    levels : int, optional
        M of Algorithm 1. None: the most levels at which the sample still has `overview` candidates, and the output's
        lattice a whole neighbourhood.
    overview : int
        Candidates that the sample still has at the coarsest of the default levels, at least. The fewer, the more of
        the sample's own layout comes out again.
    relaxation : {"icm", "gibbs"}
        Take the LCPDF's mode, or draw from it.
    bandwidth : float
        h in units of h_opt, equation (8); above 0.
    coherence : float
        The squared distance of a candidate that continues a neighbour's source is divided by 1 + coherence.
    balance : float
        lambda of the price on use: a candidate whose surroundings serve more sites than their share costs
        lambda N C sigma^2 min(4, u - 1), u their use over the fair share. 0: nobody counts.
    structure : float
        Weight of a channel that tells how far a pixel is from the sample's edges, matched like the others and not
        shown; its standard deviation in units of the sample's, or less where grey levels would not hold it. 0, and with
        ``pixel="density"``: there is none.
    novelty : float
        mu: at the coarsest level, of n candidates, one costs mu C sigma^2 min(1, 256 / n) for each neighbour whose
        source it continues, and four times that for each whose source it is, where a site takes a sample's pixel and n
        is 1024 or less.
    finish : float, optional
        Each output pixel is the mean of what its neighbours' sources say of it, with Gaussian weights of this
        standard deviation, pixels; 0: it is its own source's. None: 1.5, but 0 where a sample has 16 different pixels
        or fewer, since a mean of categories is none of them, and with ``pixel="density"``. 0.01 to 16, or 0.
    xi : float
        xi < 0 of equation (13): the further below 0, the fewer sweeps.
    free_sweeps : int
        Sweeps over all sites of a level, held ones too, after its equilibrium.
    pixel : {"source", "density"}
        A relaxed site takes the pixel of its source in the sample, or a grey level of the Parzen density, whose
        kernel also spreads over x_s.
    phases : {"all", "decimated"}
        Candidates at coarse levels: every sample position, or those of the decimated sample, equation (10).
    edges : {"auto", "reflect", "whole"}
        Candidates are those sample positions whose whole neighbourhood lies in the sample, equation (4)
        (``whole``), or all, those near the edge with a neighbourhood completed by reflection (``reflect``);
        ``auto`` reflects at all levels but the finest, and there where fewer than three quarters of them have a whole
        neighbourhood.
    coarsest : {"gibbs", "same"}
        How the coarsest level relaxes: by draws, or as the other levels. Its mode says nothing while all is unknown.
    schedule : str or simdtex.schedules.Schedule
        Which sites relax together: ``"coloring"``, ``"coloring-fixed"``, ``"luby"``, ``"checkerboard"``,
        ``"synchronous"``, ``"random-subset"``, ``"raster"``, ``"random-scan"``, ``"block"``, or one of your own.
    check_schedule : bool
        Check at every step that a schedule which claims independent sites keeps equation (14).
    boundary : {"torus", "open"}
        Whether the output wraps around.
    array : str, optional
        A processor array to account for: ``"ROWSxCOLS"`` or ``"maspar-mp1-1k"`` to ``"maspar-mp1-16k"``. None
        accounts for packed active sites on a full MP-1. No byte of the result depends on it.
    mapping : {"cut-and-stack", "hierarchical"}
        How a picture larger than the array lies on it.
    search : {"auto", "exact", "coherent"}
        Whether a site weighs all candidates of a level, or, at all but the coarsest level, only a few: those that
        continue the source of a neighbour, its own source, and some more. ``auto`` is ``coherent`` for
        ``relaxation="icm"`` with ``pixel="source"``, and ``exact`` where a site draws or takes the mode of a density.
    suggesting : int
        ``coherent``: nearest neighbours whose sources suggest a candidate each.
    similar : int
        ``coherent``: candidates more for each of these, those whose neighbourhoods in the sample are most like its own;
        64 or fewer.
    chance : int
        ``coherent``: candidates at random, 4096 or fewer.
    exhaustive : int
        ``coherent``: a level with so many candidates or fewer weighs them all.
    categorical : bool or tuple of int
        Whether the sample's numbers name categories: two differ or they do not, and none is ever a mean of others. A
        tuple names the variables (channels) of which that is so.
    weights : tuple of float, optional
        One for each variable (channel): each is brought to the same spread, times its weight. None: all are on one
        scale, as colours are, but for categories.
    shares : tuple of float, optional
        One for each of several samples: how much of the output they are to be used for, kept by the price on use. None:
        every pixel of all samples counts alike.
    proportions : tuple of float, optional
        Of a sample of categories: how much of the output each category, in ascending order, is to be, kept by a price.
        None: as comes of the sample and of what is given.
    data_weight : float
        How many neighbours a known site counts for that is from nowhere in the sample: hard data.
    guide_weight : float
        Variance of the guide in units of the sample's.
    labels : bool, optional
        Whether the guide's numbers are names. None: integers of at most 16 different values are.
    unsure : float
        Where a sample is not known everywhere: the share of a candidate's neighbours that may be unknown, 0 to 1. These
        are taken to be as the nearest known pixel.

    Notes
    -----
    Where no other range is said, numbers are 0 to 1e6, and whole numbers 2**31 - 1 or less.
    """

    order: int = 18
    levels: int | None = integer(None, 1)
    overview: int = integer(128, 1)
    relaxation: str = words("icm", "icm", "gibbs")
    bandwidth: float = number_of(0.15, 0, above=True)
    coherence: float = number_of(0.5, 0)
    balance: float = number_of(0.5, 0)
    structure: float = number_of(2.0, 0)
    novelty: float = number_of(1.0, 0)
    finish: float | None = number_of(None, 0, WIDEST)
    xi: float = number_of(-1.0, -1e6)
    free_sweeps: int = integer(2, 0)
    pixel: str = words("source", "source", "density")
    phases: str = words("decimated", "all", "decimated")
    edges: str = words("auto", "auto", "reflect", "whole")
    coarsest: str = words("gibbs", "gibbs", "same")
    schedule: str | schedules.Schedule = "coloring"
    check_schedule: bool = switch(False)
    boundary: str = words("torus", "torus", "open")
    array: str | None = None
    mapping: str = words("cut-and-stack", *MAPPINGS)
    search: str = words("auto", "auto", "exact", "coherent")
    suggesting: int = integer(12, 1)
    similar: int = integer(0, 0, SIMILAR)
    chance: int = integer(4, 0, CHANCE)
    exhaustive: int = integer(64, 0)
    categorical: bool | tuple[int, ...] = False
    weights: tuple[float, ...] | None = None
    shares: tuple[float, ...] | None = None
    proportions: tuple[float, ...] | None = None
    data_weight: float = number_of(16.0, 0)
    guide_weight: float = number_of(1.0, 0)
    labels: bool | None = switch(None)
    unsure: float = number_of(0.25, 0, 1)

    def __post_init__(self) -> None:
        """Check every value."""
        check_order(self.order)
        check(self)
        if self.finish and self.finish < NARROWEST:
            raise ValueError(f"finish is {self.finish}; give 0, or a number of at least {NARROWEST}")
        if self.xi >= 0:
            raise ValueError(f"xi is {self.xi}; give a number below 0")
        if (self.search, self.relaxation, self.pixel) == ("coherent", "icm", "density"):
            raise ValueError(
                'search="coherent" finds no mode of a density; '
                'give search="exact", pixel="source" or relaxation="gibbs"'
            )
        schedules.get(self.schedule)
        parse_array(self.array or "1x1", self.mapping)
        lists = {"weights": self.weights, "shares": self.shares, "proportions": self.proportions}
        for name, value in lists.items():
            _numbers(name, value)
        if not isinstance(self.categorical, bool):
            if not isinstance(self.categorical, tuple) or not self.categorical:
                raise TypeError(
                    f"categorical must be True, False or a tuple of channels, not {shown(self.categorical)}"
                )
            for channel in self.categorical:
                whole("a channel of categorical", channel, 0)
        if self.pixel == "density" and (self.categorical or self.weights):
            raise ValueError('categories and weights go with pixels of the sample; give pixel="source"')
        if self.categorical and self.finish:
            raise ValueError(f"finish={self.finish:g} takes means, and of categories there are none; leave it out")

    def of(self, pictures: Pictures) -> Pictures:
        """The pictures of a sample with what these options say of their kind."""
        variables, count = pictures.pixels[0].shape[-1], len(pictures.pixels)
        kinds = (self.categorical,) * variables if isinstance(self.categorical, bool) else None
        if isinstance(self.categorical, tuple):
            if max(self.categorical) >= variables:
                raise ValueError(
                    f"categorical names channel {max(self.categorical)} of {variables}; give 0 to {variables - 1}"
                )
            kinds = tuple(channel in self.categorical for channel in range(variables))
        if self.weights and len(self.weights) != variables:
            raise ValueError(f"there are {len(self.weights)} weights and {variables} variables; give one for each")
        if self.shares and len(self.shares) != count:
            raise ValueError(f"there are {len(self.shares)} shares and {count} samples; give one for each")
        return replace(pictures, categorical=kinds, weights=self.weights, shares=self.shares)

    def resolved(self, pictures: Pictures) -> Options:
        """The same as it is executed: what ``search="auto"`` and ``finish=None`` mean for a sample.

        The grey levels of a density are nobody's, so nothing says how far from an edge they are: no structure channel.
        """
        nearest = (self.relaxation, self.pixel) == ("icm", "source")
        search = ("coherent" if nearest else "exact") if self.search == "auto" else self.search
        finish = self.finish
        if finish is None:
            categories = (pictures.categorical and any(pictures.categorical)) or few(pictures.pixels)
            finish = 0.0 if self.pixel == "density" or categories else FINISH
        structure = 0.0 if self.pixel == "density" else self.structure
        return replace(self, search=search, finish=finish, structure=structure)


def begins(before: Options, now: Options, levels: int) -> int:
    """The first level at which a run with other options differs from one before, of so many levels, all else the same.

    Returns
    -------
    int
        ``levels - 1``, the coarsest, where all of it may differ; the level after that where the search does; -1 where
        nothing but the finish may.
    """
    old, new = vars(before), vars(now)
    different = {name for name in old if old[name] != new[name]}
    if different <= {"finish"}:
        return -1
    if different <= {"finish", *SEARCHED} and levels > 1:  # the coarsest level weighs all candidates
        return levels - 2
    return levels - 1


def few(pictures: Sequence[NDArray[Any]]) -> bool:
    """Whether a sample, pictures (rows, cols, C), has at most `CATEGORIES` different pixels: a map of them."""
    seen = np.zeros((0, pictures[0].shape[-1]), pictures[0].dtype)
    for picture in pictures:
        flat = picture.reshape(-1, picture.shape[-1])
        for part in np.split(flat, range(2**8, len(flat), 2**16)):  # the first, a small one, tells of most
            seen = np.unique(np.concatenate([seen, part]), axis=0)
            if len(seen) > CATEGORIES:
                return False
    return True


def _numbers(name: str, value: Any) -> None:
    """Raise unless a value is None or a tuple of numbers of which one is above 0."""
    if value is None:
        return
    if not isinstance(value, tuple) or not value:
        raise TypeError(f"{name} must be a tuple of numbers, not {shown(value)}")
    for number in value:
        real(f"one of {name}", number, 0)
    if not any(value):
        raise ValueError(f"{name} are all 0; give a number above 0")


def make_options(preset: str = "default", **given: Any) -> Options:
    """Options from a preset and what the user gave; unknown names are a TypeError that lists the valid ones."""
    one_of("preset", preset, PRESETS)
    given = {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}
    return build(Options, "mrf", PRESETS[preset] | given, also=("preset",))

# SPDX-License-Identifier: BSD-3-Clause
"""The options of the method ``mrf``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from numpy.typing import NDArray

from simdtex import schedules
from simdtex.model.array import ARRAYS, parse_array
from simdtex.model.lattice import MOST_ORDER
from simdtex.model.pictures import CATEGORIES, Pictures, few
from simdtex.model.regularity import LATTICES, parse_lattice
from simdtex.options import (
    Choice,
    Number,
    Numbers,
    Other,
    Switch,
    Whole,
    check,
    documented,
    option,
    shown,
    whole,
)

COLOURS = 64
"""Different pixels up to which a sample in colour is taken for one of a palette."""

ORDERS = {2: 18, 3: 12}
"""The default order by the number of axes."""

FINISH = 1.5
"""The default standard deviation of the finish, pixels."""

NARROWEST, WIDEST = 0.01, 16.0
"""The least and the largest standard deviation of a finish."""

CHANCE = 4096
"""The most candidates that a coherent search weighs at random."""

COARSE = 2
"""The first level of the options ``coarse_...``: there are few sites, and they decide how things connect."""

SEARCHED = ("search", "chance", "coarse_chance")
"""The options that say how candidates are searched for, which makes no difference at the coarsest level."""


def check_categorical(value: Any) -> None:
    """Raise unless a value is True, False or a tuple of channels."""
    if not isinstance(value, bool):
        if not isinstance(value, tuple) or not value:
            raise TypeError(f"categorical must be True, False or a tuple of channels, not {shown(value)}")
        for channel in value:
            whole("a channel of categorical", channel, 0)


ALL = ("synth", "tileset", "fill", "extend", "simulate", "schedules")
DATA = ("synth", "tileset", "fill", "extend", "simulate")
VALUES = ("simulate values", "simulate 3-D values")  # simulations of values that are no categories

appearance = partial(option, group="Appearance", shown=ALL)
scales = partial(option, group="Scales and edges", shown=ALL)
searching = partial(option, group="Search", shown=ALL)
sampling = partial(option, group="Sampling", shown=ALL)
parallel = partial(option, group="Schedule and processor array", shown=("synth",))
data = partial(option, group="Data and guides", shown=DATA)


@documented
@dataclass(frozen=True)
class Options:
    """The options of the method ``mrf``.

    Numbers are at most 1e6 and integers at most 2**31 - 1, if no other limit is given.
    """

    order: int | None = appearance(
        None,
        Whole(1, MOST_ORDER),
        "Compare neighbours within sqrt(order) pixels: order 8 has 24, order 18 has 60; a larger order keeps larger "
        "shapes",
        more="The time grows with the number of neighbours. In three dimensions order 8 has 92 and order 12 has 178.",
        none="18; 12 in three dimensions; of a sample of fewer than 9 pixels the largest that fits",
        label="Size of features (order)",
        symbol="o of equation (3)",
        slider=(2, 40, 1),
    )
    structure: float = appearance(
        2.0,
        Number(0),
        "Match the sample's outlines with this weight: more keeps joints and contours whole",
        more="It is the weight of an additional channel that is matched like the others and is not in the output: the "
        "signed distance from the border between the sample's bright and dark parts. The weight is its standard "
        "deviation in units of the sample's; it is smaller if grey levels cannot hold the channel. With 0, and with "
        '``pixel="density"``, there is no such channel.',
        label="Keep structure",
        paper=0.0,
        slider=(0, 6, 0.25),
    )
    lattice: str | tuple[tuple[float, float], tuple[float, float]] = option(
        "auto",
        Other(parse_lattice, "str or two vectors", valid=LATTICES),
        "Keep a regular texture on the lattice of the sample (auto), on that of two vectors DY,DX,DY,DX in pixels, or "
        "on none",
        more="``auto`` finds the lattice of a sample of 32 or more rows and columns, if it has one. A pixel's place "
        "within a cell is then a guide, as in `guide`, of weight 1, and random candidates are of a site's own place in "
        "the cell unless the search is exact. On a torus the lattice is deformed to fit, by 15 % "
        'at most. With categories, and with ``pixel="density"``, there is no lattice.',
        hint="Keep a regular texture on the lattice of the sample (auto), or not (none)",
        paper="none",
        group="Appearance",
        shown=DATA,
    )
    coherence: float = appearance(
        0.5,
        Number(0),
        "Prefer candidates that continue a neighbour's source: more keeps larger pieces of the sample",
        more="The squared distance of a candidate that continues a neighbour's source is divided by 1 + coherence.",
        paper=0.0,
        jobs={"simulate": 0.0, "simulate 3-D": 0.5},
        slider=(0, 4, 0.1),
    )
    balance: float = appearance(
        0.5,
        Number(0),
        "Penalise parts of the sample that are used often: more repeats them less",
        more="A candidate whose surroundings are used more than their fair share costs lambda N C sigma^2 "
        "min(4, u - 1): lambda is the balance, u the use divided by the fair share. In ``simulate``, values that are "
        "no categories count by the mean squared difference of neighbours, if that is below sigma^2.",
        label="Repeat less (balance)",
        paper=0.0,
        jobs={"fill": 0.0, "extend": 0.0, "simulate": 1.0, "simulate 3-D": 0.5} | dict.fromkeys(VALUES, 0.15),
        slider=(0, 4, 0.1),
    )
    novelty: float = appearance(
        1.0,
        Number(0),
        "Penalise copies of the sample's layout: more departs further from it",
        more="At the coarsest level, with n decimated pixels, a candidate costs mu C sigma^2 min(1, 256 / n, "
        "(n / 128)^2) for each neighbour whose source it continues, and four times that for each neighbour whose "
        "source it is: mu is the novelty. This applies if sites take pixels of the sample.",
        paper=0.0,
        jobs={"fill": 0.0, "extend": 0.0, "simulate 3-D": 0.25},
        slider=(0, 4, 0.25),
    )
    finish: float | None = appearance(
        None,
        Number(0, WIDEST),
        "Blend seams over this many pixels; with 0 every pixel is one of the sample's",
        more="Each output pixel is the mean of the pixels that continue its neighbours' sources, with Gaussian weights "
        "of this standard deviation, 0.01 to 16 or 0. A sample of at most 16 different pixels is a map of categories, "
        "which have no mean, and one of at most 64 colours, each of 4 pixels on average, has a palette.",
        none="1.5; 0 for samples of at most 16 different pixels or of a palette, and for pixels of the density",
        jobs={"simulate": 0.0},
        label="Soften seams (finish)",
        unit="pixels",
        paper=0.0,
        slider=(0, 4, 0.25),
    )
    overview: int = appearance(
        128,
        Whole(1),
        "Keep at least this many candidates at the coarsest of the default levels; fewer repeat more of the sample's "
        "layout",
        more="For four levels or fewer 32 are enough, so that the coarsest spacing is 8 pixels for a small sample too. "
        "With fewer than 32, the output's coarsest lattice has 2x2 sites or more, as in the paper's Figure 5.",
        paper=1,
        shown=(),
        slider=(16, 1024, 16),
    )
    levels: int | None = scales(
        None,
        Whole(1),
        "Use this many levels, from coarse to fine",
        more="By default the sample has `overview` candidates or more at the coarsest level, and the output's lattice "
        "holds a whole neighbourhood; in ``fill`` the number depends on the size of the hole.",
        none="as many as sample and output allow",
        symbol="M of Algorithm 1",
        slider=(1, 8, 1),
    )
    reduction: int | None = scales(
        None,
        Whole(1),
        "Compare means over squares of up to this many pixels a side at coarse levels: larger parts of the sample stay "
        "whole, in less time",
        more="At a level whose sites are 2 to `reduction` pixels apart, a pixel is the mean of a square of that side, "
        "a power of 2; coarser levels decimate the most reduced sample. A level with a larger sample than the level "
        "above begins with the arrangement of that level, at temperature 0, and has free sweeps only. With 1, all "
        "levels are decimated.",
        none="the coarsest sites are 8 pixels of the reduced sample apart, and a cell of a lattice has 20 along each "
        "vector; 1 with categories, palettes, exact searches, volumes and known values from elsewhere",
        unit="pixels",
        symbol="equation (10)",
        paper=1,
        jobs={"simulate": 1, "simulate 3-D": 1},
        slider=(1, 32, 1),
        shown=("synth",),
    )
    boundary: str = scales(
        "torus",
        Choice(("torus", "open")),
        "Wrap the output around, so that it tiles (torus), or not (open)",
        jobs={"fill": "open", "simulate": "open"},
        shown=("synth", "fill", "simulate", "schedules"),
    )
    edges: str = scales(
        "auto",
        Choice(("auto", "reflect", "whole")),
        "Take only candidates whose neighbourhood is inside the sample (whole), reflect the sample to take all "
        "(reflect), or reflect it at all levels but the finest (auto)",
        more="``auto`` reflects at the finest level too if fewer than three quarters of the positions have a whole "
        "neighbourhood in the sample; ``whole`` reflects at coarse levels with fewer than 1000 such positions.",
        symbol="equation (4)",
        paper="whole",
    )
    phases: int = scales(
        1,
        Whole(1, 2**16),
        "Take candidates at coarse levels from up to this many decimations of the sample along each axis; more copy "
        "less of the sample",
        more="At a level whose sites are s pixels apart, candidates are s / phases pixels apart, or 1; a number that "
        "is no power of 2 counts as the next smaller one. With 1 they are those of the decimated sample. At the "
        "coarsest level, which evaluates all of them, fewer decimations count if there are over 4096 candidates.",
        symbol="equation (10)",
        paper=1,
        jobs={"simulate": 4, "simulate 3-D": 1},
        shown=(),
    )
    search: str = searching(
        "auto",
        Choice(("auto", "exact", "coherent")),
        "Evaluate all candidates (exact), a few of them, which is much faster (coherent), or as the relaxation "
        "requires (auto)",
        more="``coherent`` evaluates, at all but the coarsest level, the candidates that continue the source of a "
        "neighbour, the site's own source and some more, unless a level has 64 candidates or fewer. ``auto`` is "
        '``coherent`` for ``relaxation="icm"``, and ``exact`` if a site draws or takes the mode of a density.',
        paper="exact",
        jobs={"schedules": "exact"},
    )
    chance: int = searching(
        4,
        Whole(0, CHANCE),
        "Evaluate this many random candidates more, in a coherent search",
        jobs={"fill": 16, "extend": 16} | dict.fromkeys(VALUES, 0),
        slider=(0, 32, 1),
        shown=(),
    )
    coarse_chance: int = searching(
        0,
        Whole(0, CHANCE),
        "Evaluate this many random candidates where sites are 4 pixels apart or more, if that is more than chance",
        more="More candidates keep shapes connected around data, and copy less of the sample. The finest two levels, "
        "which take most of the time, use ``chance``.",
        jobs={"simulate": 64, "simulate 3-D": 0},
        slider=(0, 128, 4),
        shown=(),
    )
    relaxation: str = sampling(
        "icm",
        Choice(("icm", "gibbs")),
        "Take the mode of the LCPDF (icm), or draw from it (gibbs); the coarsest level always draws",
        more="The mode carries no information while all sites are unknown.",
        symbol="Algorithm 1",
        paper="icm",
    )
    bandwidth: float = sampling(
        0.15,
        Number(0, above=True),
        "Set the width of the Parzen kernel: a wider kernel lets more candidates count",
        unit="units of h_opt",
        symbol="h / h_opt of equation (8)",
        paper=1.0,
        slider=(0.05, 2, 0.05),
    )
    xi: float = sampling(
        -1.0,
        Number(-1e6, 0, below=True),
        "Set the pace of cooling: further below 0 takes fewer sweeps",
        more="The paper gives no number.",
        symbol="xi of equation (13)",
        paper=-8.0,
        slider=(-8, -0.25, 0.25),
        label="Cooling (xi)",
    )
    free_sweeps: int = sampling(
        2,
        Whole(0),
        "Sweep this many times over all sites, including those of the coarser level, after the equilibrium of a level",
        paper=1,
        jobs={"simulate": 1, "simulate values": 3, "simulate 3-D": 2},
        slider=(0, 8, 1),
        shown=("fill", "extend", "simulate", "schedules"),
    )
    free_sites: str = sampling(
        "all",
        Choice(("all", "kept")),
        "Relax all sites of every level in free sweeps (all), or only, at the finest level, the sites kept from the "
        "level above, some of which stand out otherwise (kept)",
        paper="kept",
        shown=(),
    )
    pixel: str = sampling(
        "source",
        Choice(("source", "density")),
        "Take pixels of the sample (source), or grey levels of the Parzen density, whose kernel also spreads over the "
        "site itself (density)",
        more="``density`` is equations (6) and (7) to the letter, and adds noise of the bandwidth at every site: 0.66 "
        "standard deviations of the sample at order 8 with bandwidth 1, so that little of the texture is left. With "
        '``relaxation="icm"``, the mode, it requires the exact search; 16-bit samples take long.',
        symbol="equations (6) and (7)",
        paper="source",
    )
    schedule: str | schedules.Schedule = parallel(
        "coloring",
        Other(schedules.get, "str or simdtex.schedules.Schedule", valid=tuple(schedules.SCHEDULES)),
        "Relax sites by this schedule: coloring, coloring-fixed, luby, checkerboard, synchronous, "
        "random-subset[:P], raster, random-scan or block[:ROWSxCOLS]",
        more='Type checkers require ``simdtex.schedules.get("block:8x8")`` for a name with a parameter.',
        hint="Relax sites by this schedule",
        symbol="equation (14)",
    )
    array: str | None = parallel(
        None,
        Other(parse_array, "str", valid=tuple(ARRAYS)),
        "Count the work of the run on this processor array: ROWSxCOLS or maspar-mp1-1k to -16k, with :hierarchical for "
        "the hierarchical mapping",
        more="The result does not depend on it.",
        none="no array",
        jobs={"schedules": "maspar-mp1-16k"},
        shown=("synth", "schedules"),
    )
    categorical: bool | tuple[int, ...] = data(
        False,
        Other(check_categorical, "bool or tuple of int", flag=True),
        "Treat values as categories, which are equal or different and are never mixed",
        more="A tuple names the channels (variables) that are categories.",
    )
    weights: tuple[float, ...] | None = data(
        None,
        Numbers(),
        "Scale all channels (variables) to one spread, times these weights, one for each channel",
        none="channels that are not categories keep one scale, as colours do",
        shown=("fill", "extend", "simulate"),
    )
    scores: bool = data(
        False,
        Switch(),
        "Compare values that are no categories by their normal scores, the quantiles of a normal distribution that "
        "have their ranks",
        jobs={"simulate": True},
        paper=False,
        shown=(),
    )
    shares: tuple[float, ...] | None = data(
        None,
        Numbers(2.0**53),
        "Use several samples in these proportions, one number for each, by the penalty on use",
        none="every pixel of all samples counts equally",
        shown=("synth", "fill", "simulate"),
    )
    proportions: tuple[float, ...] | None = data(
        None,
        Numbers(2.0**53),
        "Give the categories, in ascending order, these shares of the output",
        more="Of values that are no categories they are the shares of `simdtex.model.pictures.Pictures.classes`.",
        none="shares drawn for each realisation of one variable without a guide, see share_spread",
        shown=("simulate",),
    )
    share_spread: float = data(
        1.0,
        Number(0, 100),
        "Vary the shares of categories between realisations by this factor of their deviation in nature",
        more="In nature, shares deviate as in windows of the training image; data narrow the deviation. With 0, all "
        "realisations have the shares of the training image, or of the probabilities, given the data.",
        shown=("simulate",),
    )
    data_weight: float = data(
        16.0,
        Number(0),
        "Count a known pixel that is not from a sample as this many neighbours",
        jobs={"fill": 4.0, "extend": 4.0, "simulate": 4.0, "simulate values": 16.0, "simulate 3-D": 16.0},
        shown=("fill", "extend", "simulate"),
    )
    soft_weight: float = data(
        1.0,
        Number(0),
        "Follow probabilities, and weights of training images, with this strength",
        more="Candidates of a category, or of a training image, with probability p and share q of the sample cost "
        "w N C sigma^2 / 16 (m - ln(p / q)): w is the soft weight, and m the greatest ln(p / q) of the cell. What a "
        "region of the map has too often costs more after every sweep. With 0, only probabilities of 0 count.",
        shown=("simulate",),
    )
    guide_weight: float = data(
        10.0,
        Number(0),
        "Set the variance of the guide, in units of the sample's: more follows the guide more closely",
        shown=("synth", "simulate"),
    )
    labels: bool | None = data(
        None,
        Switch(),
        "Treat the values of the guide as labels, or as numbers",
        none="labels if they are integers of at most 16 different values",
        shown=("synth", "simulate"),
    )

    def __post_init__(self) -> None:
        """Check every value, and what goes together."""
        check(self)
        if self.finish and self.finish < NARROWEST:
            raise ValueError(f"finish is {self.finish}; give 0, or a number of at least {NARROWEST}")
        if (self.search, self.relaxation, self.pixel) == ("coherent", "icm", "density"):
            raise ValueError('the mode of a density is of all candidates; give search="exact", or relaxation="gibbs"')
        if self.pixel == "density" and (self.categorical or self.weights):
            raise ValueError('categories and weights go with pixels of the sample; give pixel="source"')
        if self.scores and self.finish:
            raise ValueError(f"finish={self.finish:g} takes means, which the training image lacks; leave it out")
        if self.categorical and self.finish:
            raise ValueError(f"finish={self.finish:g} takes means, and of categories there are none; leave it out")

    @property
    def neighbourhood(self) -> int:
        """The order; while the sample is not known, by default that of a large picture."""
        return self.order or ORDERS[2]

    def chance_at(self, level: int) -> int:
        """Return how many candidates at random a coherent search weighs at a level."""
        return max(self.chance, self.coarse_chance) if level >= COARSE else self.chance

    def of(self, pictures: Pictures) -> Pictures:
        """Return the pictures of a sample with their kinds, weights and shares by these options."""
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
        scores = self.scores and not all(kinds or (False,))
        return replace(pictures, categorical=kinds, weights=self.weights, shares=self.shares, scores=scores)

    def resolved(self, pictures: Pictures) -> Options:
        """Return the options as they are executed: what ``auto`` and None mean for a sample.

        Grey levels of a density have no source: no structure channel and no lattice. A volume has neither, and no
        finish.
        """
        usual = "coherent" if (self.relaxation, self.pixel) == ("icm", "source") else "exact"
        search = usual if self.search == "auto" else self.search
        named = pictures.categorical and any(pictures.categorical)
        finish = self.finish
        if finish is None:
            finish = 0.0 if self.pixel == "density" or named or of_palette(pictures.pixels) else FINISH
        plain = self.pixel == "density" or pictures.deep
        finish, structure = 0.0 if pictures.deep else finish, 0.0 if plain else self.structure
        lattice = "none" if plain or named else self.lattice
        least = min(min(picture.shape[:-1]) for picture in pictures.pixels)
        order = self.order or min(ORDERS[3 if pictures.deep else 2], max(1, largest_order(least)))
        return replace(self, order=order, search=search, finish=finish, structure=structure, lattice=lattice)


def begins(before: Options, now: Options, levels: int) -> int:
    """Return the first level at which a run with other options differs from an earlier one with the same input.

    ``levels - 1``, the coarsest, if all levels may differ; the next finer one if only the search does, and the sample
    has no lattice; -1 if only the finish does.
    """
    old, new = vars(before), vars(now)
    different = {name for name in old if old[name] != new[name]}
    if different <= {"finish"}:
        return -1
    weighs_all = now.lattice == "none"  # at the coarsest level
    if different <= {"finish", *SEARCHED} and levels > 1 and weighs_all:
        return levels - 2
    return levels - 1


def largest_order(side: int) -> int:
    """Return the largest order whose neighbourhood fits a sample of this many pixels; 0 if there is none."""
    return ((side - 1) // 2 + 1) ** 2 - 1


def of_palette(pictures: Sequence[NDArray[Any]]) -> bool:
    """Return whether a sample, pictures (rows, cols, C), has so few different pixels that a mean is a new one."""
    pixels, channels = sum(picture[..., 0].size for picture in pictures), pictures[0].shape[-1]
    return few(pictures, max(CATEGORIES, min(COLOURS, pixels // 4)) if channels > 2 else CATEGORIES)

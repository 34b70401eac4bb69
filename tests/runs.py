"""Small whole runs over the public functions: one table, what a run gives, and where its result is kept.

``python tests/runs.py`` computes the digests of the code as it is, and writes them to tests/digests.json.
"""

import functools
import hashlib
import inspect
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from cases import REFERENCE, texture
from scipy.ndimage import gaussian_filter
from skimage import data

import simdtex
from simdtex import maspar

PINNED = Path(__file__).with_name("digests.json")
SEED = 2**40 + 3


class Run(NamedTuple):
    """A public function, and ``inputs()``, its arguments; tiles of side ``tiles`` give the same bytes, 0 for none."""

    function: Callable[..., Any]
    inputs: Callable[[], tuple[tuple[Any, ...], dict[str, Any]]]
    tiles: int = 0


class Given(NamedTuple):
    """What a run of ``mrf`` is given, made of random numbers.

    Shares of sites: ``known``, of these ``placed`` in the sample, ``outside`` of the region, ``silent`` in the guide.
    Shares of pixels: ``masked`` and ``gaps``. ``labels`` of the guide: 0 for grey levels, None for no guide; ``kinds``
    of categories; ``soft``: what there are probabilities of.
    """

    options: dict[str, Any]
    samples: tuple = ((12, 11),)
    channels: int | None = None
    dtype: type = np.uint8
    shape: tuple = (8, 9)
    known: float = 0.0
    placed: float = 0.0
    partly: bool = False
    labels: int | None = None
    silent: float = 0.0
    masked: float = 0.0
    gaps: float = 0.0
    kinds: int = 0
    outside: float = 0.0
    soft: tuple = ()

    @property
    def maps(self):
        """Of probabilities, a fifth of them 0 and a fifth of the sites unknown, and of the sites that take part."""
        rng, found = np.random.default_rng(11), {}
        for name in self.soft:
            kinds = {"categories": self.kinds, "images": len(self.samples)}[name]
            p = rng.random((kinds, *self.shape)) * (rng.random((kinds, *self.shape)) > 0.2) + 1e-9 * (kinds < 2)
            p[0, p.sum(0) == 0] = 1
            found[name] = np.where(rng.random(self.shape) < 0.2, np.nan, p / p.sum(0))
        if self.outside:
            found["region"] = rng.random(self.shape) >= self.outside
        return found

    def arrays(self):
        """Samples, masks, known values and their source, and the guide, all with channels."""
        rng = np.random.default_rng(7)
        samples = [texture(size, self.channels or 1, self.dtype, 5 + n) for n, size in enumerate(self.samples)]
        for one in samples if self.kinds else []:
            one[..., 0] = rng.integers(0, self.kinds, one.shape[:2]) ** 2 + 3
            one[: self.kinds, 0, 0] = np.arange(self.kinds) ** 2 + 3  # all of them
        masks = [rng.random(size) >= self.masked for size in self.samples] if self.masked else None
        for one in samples if self.gaps else []:
            one[rng.random(one.shape) < self.gaps / one.shape[2]] = np.nan
        number = rng.integers(0, len(samples), self.shape)
        place = np.stack(
            [rng.integers(0, [one.shape[axis] for one in samples], (*self.shape, len(samples))) for axis in (0, 1)]
        )
        row, col = (np.take_along_axis(one, number[..., None], -1)[..., 0] for one in place)
        values = np.empty((*self.shape, samples[0].shape[2]), self.dtype)
        for s in np.ndindex(*self.shape):
            one = samples[number[s]]
            here = one[row[s], col[s]]
            values[s] = np.where(np.isnan(here), np.nanmin(one), here) if self.gaps else here
        there = np.repeat(rng.random(self.shape)[..., None] < self.known, values.shape[-1], -1)
        if self.partly:
            there &= rng.random(there.shape) < 0.6
        if self.outside:
            there &= self.maps["region"][..., None]
        known = np.ma.masked_array(values, ~there) if self.known else None
        source = np.stack([row, col, number][: 2 + (len(samples) > 1)], -1)
        source[rng.random(self.shape) >= self.placed] = -1
        guide = None
        if self.labels is not None:
            guide = ([self.guiding(rng, size) for size in self.samples], self.guiding(rng, self.shape))
            guide[1][rng.random(self.shape) < self.silent] = np.nan
            guide = guide if self.silent else (guide[0], guide[1].astype(guide[0][0].dtype))
        return samples, masks, known, source.astype(np.int64) if self.placed else None, guide

    def guiding(self, rng, size):
        """A picture of a guide: floats for the output's sake."""
        if self.labels:
            found = rng.integers(0, self.labels, size)[..., None] * 3.0
            found[: self.labels, 0, 0] = np.arange(self.labels) * 3
            return found
        row, col = np.indices(size)
        return np.stack([np.sin(row / 3) + rng.random(size), row * col / 7], -1)

    def textures(self):
        """Arguments of `simdtex.synthesize`."""
        samples, masks, known, source, guide = self.arrays()
        several = len(samples) > 1

        def bare(array):
            return array if self.channels or array is None else array[..., 0]

        how = {"known": bare(known), "known_source": source}
        how["mask"] = masks if several or masks is None else masks[0]
        how["guide"] = guide if several or guide is None else (guide[0][0], guide[1])
        how |= {"labels": True if self.labels else None}
        how = {name: value for name, value in how.items() if value is not None} | self.options
        how["channel_axis"] = None if self.channels is None else -1
        return ([bare(one) for one in samples] if several else bare(samples[0]), self.shape), how

    def realisations(self):
        """Arguments of `simdtex.simulate`."""
        (training, shape), how = self.textures()
        names = {"categories": "probabilities", "images": "image_map"}
        how |= {names.get(name, name): one for name, one in self.maps.items()}
        return (training, 1), how | {"shape": shape, "jobs": 1, "source": True}


def textures(options=None, tiles=0, **given):
    """A run of the method ``mrf``."""
    return Run(simdtex.synthesize, Given(options or {}, **given).textures, tiles)


def realisations(options=None, **given):
    """The same with maps, which `simdtex.simulate` takes."""
    return Run(simdtex.simulate, Given(options or {}, **given).realisations)


def call(function, *shapes, channels=None, dtype=np.uint8, **options):
    """A run of any function on textures of these shapes, the last of which is that of the output."""

    def inputs():
        *samples, shape = shapes
        samples = [texture(size, channels, dtype, 5 + n) for n, size in enumerate(samples)]
        axis = None if channels is None else -1
        return (samples if function is simdtex.mix else samples[0], shape), {"channel_axis": axis, **options}

    return Run(function, inputs)


def multires(sample, shape, **options):
    return call(simdtex.synthesize, sample, shape, method="multires", **options)


def pyramid(sample, shape, iterations=2, **options):
    return call(simdtex.synthesize, sample, shape, method="pyramid", iterations=iterations, **options)


def facies(shape=(9, 20, 22), kinds=2, seed=0):
    """Blobs of so many categories, flat ones, in a volume."""
    field = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), (1, 2.5, 2.5), mode="wrap")
    return np.digitize(field, np.quantile(field, np.arange(1, kinds) / kinds)).astype(np.uint8)


def rising(shape):
    """From 0 in the first layer of a volume to 1 in the last."""
    return np.broadcast_to(np.linspace(0, 1, shape[0])[:, None, None], shape)


def wells(shape, share=0.03):
    """Known cells of a volume."""
    truth = facies(seed=5)[tuple(map(slice, shape))]
    return np.ma.MaskedArray(truth, np.random.default_rng(4).random(shape) >= share)


def volume(shape=(6, 12, 11), training=None, given=dict, **options):
    """A simulation of a volume; ``given()`` makes what else it is given."""

    def inputs():
        own = {"categorical": True, "order": 2, "shape": shape, "jobs": 1}
        return (facies() if training is None else training(), 1), own | given() | options

    return Run(simdtex.simulate, inputs)


def arguments(function, *make, **options):
    """A run of any function; ``make()`` returns an argument."""
    return Run(function, lambda: (tuple(one() for one in make), options))


def hole(shape=(14, 15)):
    """Where two spots of a picture are."""
    found = np.zeros(shape, bool)
    found[2:4, 3:6] = found[10:12, 9:12] = True
    return found


GREY = functools.partial(texture, (14, 15))
BARE = {"balance": 0.0, "structure": 0.0, "novelty": 0.0, "finish": 0.0, "overview": 64}
"""Nothing but the equations of the paper in distances and pictures."""
EXACT = BARE | {"search": "exact", "order": 2, "levels": 2, "coherence": 1.0}
FEW = BARE | {"search": "coherent", "order": 2, "levels": 2, "coherence": 0.2}
"""Coherent search that weighs a few candidates at every level but the coarsest."""
MORE = {"order": 2, "levels": 2}
"""The penalties, the structure channel and the finish of the defaults, all together."""
MORE_EXACT, MORE_FEW = MORE | {"search": "exact"}, MORE | {"search": "coherent"}
GIBBS, OPEN = {"relaxation": "gibbs", "bandwidth": 0.4}, {"boundary": "open"}
DRAWN = {"relaxation": "gibbs", "pixel": "density", "order": 1, "xi": -4.0, "free_sweeps": 1}
DENSITY = BARE | DRAWN | {"coherence": 1.0}
TWO = {"samples": ((9, 11), (8, 7))}
F4 = {"dtype": np.float32}

RUNS = {
    # levels, orders, types, borders
    "defaults": textures(samples=((9, 10),), shape=(2, 3)),
    "overview": textures({"order": 2, "overview": 20}, samples=((20, 19),), shape=(9, 10)),
    "levels-by-output": textures(BARE | {"order": 2}, samples=((32, 33),), shape=(10, 8)),
    "paper": textures({"preset": "paper", "order": 2}, shape=(6, 7)),
    "exact": textures(EXACT),
    "exact-colour": textures(EXACT | OPEN, channels=3),
    "exact-16-bit": textures(EXACT | {"order": 5, "coherence": 0.5}, dtype=np.uint16, shape=(6, 7)),
    "exact-of-many": textures(MORE_EXACT | {"levels": 1, "xi": -4.0}, samples=((36, 35),), shape=(3, 4)),
    "gibbs": textures(EXACT | {"relaxation": "gibbs", "bandwidth": 0.6, "xi": -4.0}, dtype=np.uint16, tiles=5),
    "density": textures(DENSITY | {"levels": 2, "bandwidth": 0.3}, samples=((9, 10),), shape=(6, 7), tiles=4),
    "density-colour": textures(DENSITY | OPEN, channels=3, samples=((9, 8),), shape=(1, 17), dtype=np.float64),
    "density-16-bit": textures(DENSITY | {"levels": 2}, channels=2, dtype=np.uint16, samples=((9, 10),), shape=(7, 6)),
    "paper-density": textures({"preset": "paper", "order": 1, "relaxation": "gibbs", "pixel": "density"}, shape=(5, 6)),
    "mode-colour": textures(
        MORE | OPEN | {"pixel": "density", "order": 1, "xi": -9.0, "free_sweeps": 1}, channels=2, shape=(4, 5)
    ),
    "few": textures(FEW),
    "few-16-bit": textures(FEW | {"order": 8, "xi": -4.0, "coherence": 1.5, "chance": 1}, dtype=np.uint16),
    "few-chance": textures(FEW | {"chance": 9, "coherence": 0, "free_sweeps": 0}),
    "few-coarse-chance": textures(
        FEW | {"order": 1, "levels": 4, "phases": 64, "coarse_chance": 7}, samples=((12, 13),), shape=(9, 10)
    ),
    "few-density": textures(FEW | {"relaxation": "gibbs", "pixel": "density", "chance": 6}, channels=2, shape=(7, 8)),
    "bool-larger": textures({"order": 1, "levels": 2}, samples=((9, 8),), shape=(17, 14), dtype=np.bool_),
    "few-whole": textures(
        FEW | {"order": 5, "edges": "whole", "phases": 64, "xi": -2.5, "free_sites": "kept"}, masked=0.2, **F4
    ),
    "all-of-many": textures(BARE | {"order": 2, "levels": 1}, samples=((35, 31),), shape=(2, 3), **F4),
    # schedules
    **{
        name: textures(FEW | {"schedule": name, "xi": -2.0}, samples=((9, 10),))
        for name in ("coloring-fixed", "synchronous", "random-subset:0.3")
    },
    "block-exact": textures(EXACT | OPEN | {"levels": 1, "xi": -2.0, "schedule": "block:3x4"}, shape=(7, 5)),
    "raster": textures(EXACT | {"levels": 1, "xi": -4.0, "schedule": "raster"}, samples=((9, 8),), shape=(6, 5)),
    "random-scan": textures(MORE_EXACT | {"schedule": "random-scan", "xi": -8.0}, shape=(9, 8)),
    "block": textures(BARE | {"schedule": "block", "order": 1, "levels": 1}, samples=((9, 8),), shape=(3, 17)),
    "array": textures(FEW | {"array": "4x4", "schedule": "luby"}),
    # penalties, structure, finish, a lattice
    "balance": textures(FEW | {"balance": 0.1, "order": 1}, samples=((12, 13),), shape=(11, 10), tiles=6),
    "structure-colour": textures(FEW | OPEN | {"structure": 0.7}, channels=3, shape=(8, 7)),
    "structure-beyond": textures(FEW | {"structure": 50.0}, **F4),
    "novelty-exact": textures(EXACT | OPEN | {"novelty": 0.05, "levels": 1}, channels=3, shape=(5, 6)),
    "finish-colour": textures(EXACT | OPEN | {"finish": 0.8}, channels=3, shape=(8, 7), tiles=5),
    "finish-16-bit": textures(FEW | {"finish": 2.2}, channels=2, dtype=np.uint16, shape=(8, 7)),
    "lattice-exact": textures(EXACT | {"lattice": ((4.4, 0.3), (-0.2, 5))}, shape=(9, 10)),
    "more": textures(MORE, samples=((14, 13),), shape=(9, 10)),
    "more-whole": textures(MORE | {"edges": "whole", "phases": 64, "balance": 2.0}, samples=((16, 15),)),
    "reduced": textures(MORE | {"levels": 3, "reduction": 2}, samples=((24, 25),), shape=(13, 11), tiles=6),
    "reduced-lattice": textures(
        MORE | {"levels": 3, "reduction": 2, "lattice": "5.2,0.3,-0.2,6", "free_sweeps": 1},
        samples=((21, 20),),
        shape=(11, 12),
    ),
    "reduced-everything": textures(
        MORE_FEW | OPEN | GIBBS | {"levels": 3, "reduction": 4, "shares": (2.0, 1.0), "schedule": "luby"},
        **F4 | {"samples": ((26, 28), (25, 23)), "shape": (13, 14), "channels": 2, "masked": 0.02, "gaps": 0.02},
        **{"known": 0.7, "placed": 0.8, "labels": 0, "silent": 0.1},
    ),
    "more-gibbs": textures(MORE_FEW | {"relaxation": "gibbs"}, channels=2, shape=(6, 7), **F4),
    "more-density": textures(MORE | DRAWN | {"novelty": 0.4, "finish": 1.5}, channels=2, samples=((10, 9),)),
    # what is given besides
    "known": textures(MORE_FEW | {"levels": 3, "schedule": "luby"}, known=0.06, shape=(11, 13)),
    "known-open": textures(
        MORE_EXACT | OPEN | {"levels": 3, "data_weight": 4.0, "xi": -4.0}, known=0.08, tiles=5, **F4
    ),
    "known-gibbs": textures(
        MORE_EXACT | GIBBS | {"order": 4, "data_weight": 1.7}, known=0.1, dtype=np.uint16, shape=(6, 7)
    ),
    "known-blocks": textures(MORE_FEW | {"schedule": "block:3x4", "structure": 0.0}, known=0.9, channels=2),
    "known-lattice": textures(
        MORE | {"lattice": "4.8,0.3,-0.2,5.8", "xi": -4.0}, known=0.2, channels=3, shape=(10, 12), tiles=6
    ),
    "placed": textures(MORE_EXACT | {"schedule": "checkerboard", "xi": -4.0}, known=0.3, placed=0.5, tiles=5),
    "partly": textures(MORE_FEW | {"xi": -4.0}, known=0.3, partly=True, channels=2, tiles=5),
    "labels": textures(MORE_EXACT | {"guide_weight": 0.4, "xi": -4.0, "schedule": "synchronous"}, labels=2, tiles=5),
    "labels-silent": textures(MORE_FEW | OPEN | {"levels": 3, "order": 1}, labels=3, silent=0.6),
    "grey-guide": textures(MORE_FEW | GIBBS | {"guide_weight": 2.5}, labels=0, silent=0.4, dtype=np.uint16),
    "several": textures(MORE_EXACT | {"shares": (3.0, 1.0), "balance": 2.0, "xi": -4.0}, **TWO, tiles=5),
    "several-gaps": textures(MORE_FEW | OPEN | {"lattice": "4,0,1,5"}, gaps=0.1, known=0.1, **F4, **TWO),
    "masked": textures(MORE_FEW | {"xi": -4.0}, masked=0.4, tiles=5),
    "gaps": textures(MORE_EXACT | {"edges": "reflect"}, gaps=0.1, dtype=np.float64),
    "categories": textures(
        MORE_EXACT | {"categorical": True, "xi": -4.0, "proportions": (1.0, 2.0, 0.0)},
        kinds=3,
        known=0.15,
        masked=0.2,
        tiles=5,
    ),
    "categories-mixed": textures(
        MORE_FEW | {"categorical": (0,), "weights": (1.0, 2.0)},
        **{"kinds": 3, "known": 0.3, "partly": True, "channels": 2, "labels": 2, **F4},
    ),
    "weights": textures(MORE_FEW | {"weights": (0.0, 1.0), "finish": 0.8}, channels=2, dtype=np.float64),
    "everything": textures(
        MORE_FEW | {"shares": (1.0, 2.0), "schedule": "luby"},
        **TWO | {"known": 0.15, "placed": 0.4, "labels": 0, "silent": 0.2, "masked": 0.2, "gaps": 0.05},
        **F4 | {"channels": 2, "partly": True},
    ),
    # windows that are smaller than the whole
    **{
        f"tiles-{name}": textures(given | {"order": 1, "xi": -8.0}, 18, samples=((22, 25),), shape=(37, 30), **more)
        for name, given, more in (
            ("known", {"levels": 3}, {"known": 0.02}),
            ("gibbs", OPEN | {"relaxation": "gibbs"}, {"labels": 0}),
            ("reduced", {"levels": 3, "reduction": 2}, {"known": 0.6, "placed": 0.6}),
            ("synchronous", {"schedule": "synchronous", "levels": 2}, {"channels": 3, "dtype": np.bool_}),
        )
    },
    # simulations
    "region": realisations(MORE_EXACT | {"finish": 1.0, "scores": False}, outside=0.3, known=0.2, shape=(6, 7), **F4),
    "soft": realisations(
        MORE_EXACT | {"categorical": True, "soft_weight": 0.5}, kinds=3, soft=("categories",), shape=(6, 7)
    ),
    "soft-gibbs": realisations(
        MORE_FEW | GIBBS | {"categorical": True, "proportions": (2.0, 1.0)},
        **{"kinds": 2, "known": 0.1, "soft": ("categories",), "masked": 0.2, "shape": (6, 7)},
    ),
    "soft-border": realisations(
        MORE_FEW | {"categorical": True, "proportions": (2.0, 1.0), "order": 20},
        samples=((20, 21),),
        shape=(10, 29),
        kinds=2,
    ),
    "soft-all": realisations(
        MORE_FEW | {"categorical": (0,), "levels": 3},
        **TWO | {"kinds": 3, "soft": ("categories", "images"), "channels": 2, "outside": 0.2, "labels": 2},
        shape=(6, 7),
    ),
    "shares": realisations(MORE_FEW | {"categorical": True, "share_spread": 0.5}, kinds=3, known=0.1, shape=(8, 9)),
    "volume": volume((6, 12, 13), order=3, levels=2),
    "volume-three": volume((5, 8, 9), training=lambda: facies(kinds=3), proportions=(0.2, 0.3, 0.5), schedule="luby"),
    "volume-grey": volume(
        (4, 8, 9), training=lambda: facies(kinds=200) * np.uint16(257), categorical=False, order=3, phases=64
    ),
    "volume-data": volume((8, 14, 15), given=lambda: {"known": wells((8, 14, 15))}, levels=3),
    "volume-guide": volume(
        given=lambda: {"guide": ((rising((9, 20, 22)) > 0.5) * 1, (rising((6, 12, 11)) > 0.6) * 1)},
    ),
    "volume-maps": volume(
        given=lambda: {
            "probabilities": np.stack([1 - rising((6, 12, 11)), rising((6, 12, 11))]),
            "region": np.indices((6, 12, 11)).sum(0) > 9,
        },
        training=lambda: np.ma.MaskedArray(facies(), np.indices((9, 20, 22))[2] < 3),
    ),
    # holes, sides and seams
    "fill": arguments(simdtex.fill, GREY, hole, order=1, levels=1),
    "fill-reduced": arguments(
        simdtex.fill, GREY, lambda: np.pad(np.ones((6, 7), bool), 4), order=1, levels=3, reduction=4
    ),
    "fill-colour": arguments(
        simdtex.fill, lambda: texture((14, 15), 3, np.float64), hole, channel_axis=-1, order=2, grow=1, feather=1
    ),
    "extend": arguments(simdtex.extend, GREY, right=3, seamless="y", band=2, order=2),
    "extend-light": arguments(simdtex.extend, GREY, right=3, seamless="y", band=2, order=2, light="even"),
    "tileset": arguments(
        simdtex.tileset, lambda: [texture((14, 15)), texture((15, 13), seed=1)], size=16, order=1, levels=2
    ),
    # the other methods
    "multires": multires((13, 11), (15, 18)),
    "multires-luminance": multires((9, 10), (13, 8), channels=3, alpha=3, beta=1, levels=4),
    "multires-open": multires((12, 9), (10, 13), dtype=np.uint16, boundary="open", parity="free", alpha=0.5),
    "multires-float": multires((10, 13), (14, 7), channels=2, dtype=np.float64, parity="free", beta=0.5),
    "multires-mended": multires((17, 20), (21, 23), channels=3, alpha=0.4),
    "multires-keep-cut": multires((17, 20), (21, 23), channels=3, edges="keep", seams="cut"),
    "multires-larger": multires((7, 6), (33, 29), dtype=np.bool_, alpha=1.5),
    "multires-row": multires((1, 17), (3, 40), alpha=1, boundary="open"),
    "multires-all": multires((8, 9), (10, 13), dtype=np.float32, alpha=np.inf),
    "pyramid": pyramid((34, 36), (32, 40), iterations=5),
    "pyramid-colour": pyramid((20, 17), (19, 23), channels=3),
    "pyramid-six": pyramid((17, 20), (18, 16), dtype=np.float64, orientations=6, edges="wrap", levels=2),
    "pyramid-laplacian": pyramid(
        (20, 17), (19, 23), channels=2, dtype=np.float32, pyramid="laplacian", color="channels", match="lookup"
    ),
    "pyramid-row": pyramid((9, 8), (1, 17), orientations=2, start=np.arange(17.0)[None]),
    "solid": call(simdtex.synthesize_solid, (17, 20), (10, 8, 9), iterations=2, levels=1, orientations=2),
    "solid-average": call(
        simdtex.synthesize_solid,
        *((17, 20), (8, 9, 7)),
        **{"channels": 3, "iterations": 1, "levels": 1, "solids": "average", "slices": "each", "orientations": 2},
    ),
    "solid-laplacian": call(
        simdtex.synthesize_solid, (13, 12), (12, 10, 9), iterations=1, pyramid="laplacian", match="lookup"
    ),
    "mix": call(simdtex.mix, (17, 20), (20, 17), (16, 18), channels=3, palette=0, average=[1, 2], iterations=1),
    "mix-bands": call(simdtex.mix, (17, 20), (20, 17), (16, 18), low=0, high=1, levels=2, iterations=1),
    # the array of 1998, classes, estimates
    "maspar": call(maspar.synthesize, (14, 13), (11, 9), array="4x5", order=2, levels=2),
    "maspar-mode": call(
        maspar.synthesize, (14, 13), (8, 8), channels=3, array="8x8", order=1, levels=2, relaxation="icm", bandwidth=0.3
    ),
    "classify": Run(
        simdtex.classify,
        lambda: (
            (
                np.hstack([texture((20, 15)), texture((20, 14), seed=3)[::-1]]),
                {"a": texture((20, 18)), "b": texture((16, 17), seed=3)[::-1]},
            ),
            {"exemplars": 40, "levels": 2},
        ),
    ),
    "estimate": Run(
        simdtex.estimate,
        lambda: ((facies()[0],), {"known": wells((1, 9, 11), 0.12)[0].astype(float), "categorical": True}),
    ),
}


def outcome(name, device=REFERENCE, **how):
    """All arrays that a run gives, and everything that it counts, as JSON."""
    run = RUNS[name]
    (given, options), known = run.inputs(), inspect.signature(run.function).parameters
    how |= {name: value for name, value in (("rng", SEED), ("full_output", True)) if name in known}
    if run.function in (simdtex.simulate, simdtex.estimate):  # which take no open machine
        device = "reference" if device is REFERENCE else str(device.info.index)
    made = run.function(*given, device=device, **options | how)
    if "full_output" not in known:
        arrays = [made[one].values for one in made.data_vars] if hasattr(made, "data_vars") else [made.values]
        told = {name: value for name, value in made.attrs.items() if name not in ("device", "version")}
        return arrays, json.dumps(told, default=str, sort_keys=True)
    image, output = made
    arrays = [image, output.source, output.temperature]
    for stage in output.stages:
        arrays += [stage.image, stage.source, stage.candidates]
    arrays = [one for one in arrays if one is not None]
    return arrays, json.dumps(counted(getattr(output, "statistics", {})), default=str, sort_keys=True)


def counted(told):
    """Statistics without the machine's name and clock, and without what its searches leave out."""
    if isinstance(told, dict):
        own = ("device", "seconds", "device_seconds", "launches", "skipped", "kernels")
        return {name: counted(value) for name, value in told.items() if name not in own}
    return [counted(value) for value in told] if isinstance(told, list) else told


def digest(arrays):
    """SHA-256 of some arrays: their types, shapes and bytes, the first half of the hexadecimal digits."""
    total = hashlib.sha256()
    for array in arrays:
        total.update(f"{array.dtype} {array.shape}".encode())
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()[:32]


@functools.cache
def sample(name):
    """A real sample by name, and its channel axis."""
    kind, _, how = name.partition("-")
    if kind == "coffee":
        return data.coffee()[266:362, 486:582], -1
    pixels = getattr(data, kind)()[:128, :128]
    if how == "16":
        return pixels.astype(np.uint16) * 257 + (np.indices(pixels.shape).sum(0) % 7).astype(np.uint16), None
    return (pixels[:64, :64] if how == "64" else pixels), None


LARGE = {
    "large brick": ("brick", (256, 256), {}),
    "large coffee": ("coffee", (160, 160), {}),
    "large coffee-exact": ("coffee", (48, 64), {"search": "exact", "order": 8}),
    "large brick-exact": ("brick", (128, 128), {"search": "exact"}),
    "large brick-paper": ("brick-64", (40, 40), {"preset": "paper", "order": 8}),
    "large grass-16-bit": ("grass-16", (120, 120), {}),
    "large gravel-phases": ("gravel-64", (96, 96), {"phases": 64, "edges": "reflect", "order": 8}),
    "large grass-draws": ("grass-64", (64, 64), {"relaxation": "gibbs", "search": "coherent", "order": 8}),
    "large luby": ("brick-64", (56, 56), {"schedule": "luby", "order": 8}),
    "large block-exact": ("brick-64", (56, 56), {"schedule": "block", "search": "exact", "order": 8}),
    "large raster": ("brick-64", (20, 24), {"schedule": "raster", "order": 5}),
    "large multires-coffee": ("coffee", (130, 96), {"method": "multires", "alpha": 0.33}),
    "large multires-paper": ("brick", (256, 200), {"method": "multires", "edges": "keep", "seams": "cut"}),
    "large pyramid-grass": ("grass", (128, 160), {"method": "pyramid"}),
    "large pyramid-coffee": ("coffee", (96, 96), {"method": "pyramid", "match": "lookup", "pyramid": "laplacian"}),
}
"""Sample, output's shape and options of larger runs, on the device that is preferred here."""


def large(name, device):
    """The arrays of a larger run."""
    kind, shape, options = LARGE[name]
    pixels, axis = sample(kind)
    image, output = simdtex.synthesize(
        pixels, shape, channel_axis=axis, rng=7, device=device, full_output=True, **options
    )
    return [one for one in (image, output.source, output.temperature) if one is not None]


if __name__ == "__main__":
    found = {name: digest(outcome(name)[0]) for name in RUNS} | {name: digest(large(name, None)) for name in LARGE}
    PINNED.write_text(json.dumps(found, indent=0, sort_keys=True) + "\n")

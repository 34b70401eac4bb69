"""Tiny runs of every job on any device: for a simulator of devices, and for arrays that refuse negative indices."""

import ast
import sys
import tempfile

import numpy as np
from cases import assert_same_bits, texture

import simdtex
from simdtex import maspar
from simdtex.machine import opencl

X, LAYERS = texture((16, 17)), texture((16, 17), 3)
SMALL, COLOUR, SHAPE = texture((9, 10)), texture((9, 10), 3), (5, 6)
CLASSES = (np.indices((9, 10)).sum(0) // 3 % 2).astype(np.uint8)
LABELS = CLASSES, CLASSES[:5, :6]
CUBE = np.stack([CLASSES, CLASSES[::-1], CLASSES, CLASSES[:, ::-1]])
LOOSE, GREYS = (np.ma.MaskedArray(one[:5, :6], np.indices(SHAPE).sum(0) % 4 > 0) for one in (CLASSES, SMALL))
WELLS = simdtex.place_hard_data([[0, 1, 1], [4, 3, 0], [5, 4, 1]], SHAPE, "uint8")
CORE = np.ma.MaskedArray(CUBE[:2, :3, :4], CUBE[:2, :3, :4] < 1)
SHARE = np.linspace(0, 1, 30).reshape(SHAPE)
PARTLY = np.where(SHARE > 0.9, np.nan, SHARE)
HOLE, SPOTS = np.zeros(X.shape, bool), np.zeros(X.shape, bool)
HOLE[4:12, 5:13] = SPOTS[2:4, 2:4] = SPOTS[12:14, 13:15] = True
BRIEF = {"order": 1, "levels": 1, "free_sweeps": 1, "xi": -8.0, "rng": 1}
TWO, REDUCED = BRIEF | {"levels": 2}, {"order": 1, "levels": 2, "reduction": 2, "rng": 1}
ONCE = BRIEF | {"chance": 0, "free_sweeps": 0, "xi": -99.0, "structure": 0.0, "finish": 0.0}
FACIES = BRIEF | {"categorical": True, "jobs": 1}
MIXED = {"iterations": 1, "levels": 1, "rng": 1}


def tiles(on):
    """A picture in tiles, with known pixels."""
    known = np.ma.MaskedArray(texture((12, 11)), np.indices((12, 11)).sum(0) % 3 > 0)
    with tempfile.TemporaryDirectory() as folder:
        store = simdtex.TileStore(f"{folder}/a.zarr", 6)
        return simdtex.synthesize(SMALL, (12, 11), known=known, store=store, **TWO, **on).compute()


JOBS = {
    "fill": lambda on: simdtex.fill(X, HOLE, **REDUCED, **on),
    "fill-colour": lambda on: simdtex.fill(
        texture((16, 17), 3), SPOTS, grow=1, feather=1, channel_axis=-1, **TWO, **on
    ),
    "fill-torus": lambda on: simdtex.fill(X, SPOTS, boundary="torus", schedule="luby", **TWO, **on),
    "fill-sample": lambda on: simdtex.fill(X, SPOTS, sample=[SMALL, SMALL[::-1]], **TWO, **on),
    "extend": lambda on: simdtex.extend(SMALL, right=3, top=2, **REDUCED, **on),
    "tile": lambda on: simdtex.extend(SMALL, seamless=True, band=3, light="even", **TWO, **on),
    "tileset": lambda on: simdtex.tileset(texture((8, 9)), 16, **ONCE, **on),
    "known": lambda on: simdtex.simulate(
        CLASSES, 1, known=LOOSE, guide=(CLASSES, CLASSES[:5, :6]), **FACIES | TWO, **on
    ),
    "table": lambda on: simdtex.simulate(CLASSES, 1, known=WELLS, proportions=(1, 2), schedule="luby", **FACIES, **on),
    "region": lambda on: simdtex.simulate(
        CLASSES, 1, region=SHARE > 0.2, probabilities=np.stack([PARTLY, 1 - PARTLY]), **FACIES, **on
    ),
    "maps": lambda on: simdtex.simulate(SMALL, 1, rotation=90 * SHARE, scale=1 + SHARE, jobs=1, **BRIEF, **on),
    "images": lambda on: simdtex.simulate([SMALL, SMALL[::-1]], 1, image_map=SHARE > 0.5, jobs=1, **BRIEF, **on),
    "volume": lambda on: simdtex.simulate(CUBE, 1, known=CORE, **FACIES, **on),
    "estimate": lambda on: simdtex.estimate(CLASSES, known=WELLS, categorical=True, **on).to_array(),
    "tiles": tiles,
    "replay": lambda on: simdtex.replay(SMALL, SHAPE, known=GREYS, **TWO, **on).at(-1).image,
    "explain": lambda on: (
        simdtex.explain(
            SMALL, SHAPE, (4, 5), known=GREYS, boundary="open", search="exact", **BRIEF, **on
        ).neighbours.pixels
    ),
    "classify": lambda on: simdtex.classify(X, {"a": X[:, :9], "b": X[:, 8:]}, exemplars=16, levels=1, rng=1, **on),
    "mix": lambda on: simdtex.mix([COLOUR, COLOUR[::-1]], (8, 7), palette=0, channel_axis=-1, **MIXED, **on),
    "mix-bands": lambda on: simdtex.mix([SMALL, SMALL[::-1]], (8, 7), low=0, high=1, **MIXED, **on),
    "solid": lambda on: simdtex.synthesize_solid(SMALL, (4, 4, 3), orientations=2, **MIXED, **on),
    "maspar": lambda on: maspar.synthesize(SMALL, SHAPE, array="2x3", order=1, levels=2, rng=1, **on),
    "multires": lambda on: simdtex.synthesize(SMALL, (11, 12), method="multires", alpha=0.4, rng=1, **on),
    "pyramid": lambda on: simdtex.synthesize(SMALL, (8, 9), method="pyramid", orientations=2, **MIXED, **on),
}
"""A function of the option ``device`` for each job, which returns an array."""


class Guarded(np.ndarray):
    """An array that refuses an array of indices with a negative one, which means an element from its end."""

    def __getitem__(self, index):
        for part in index if isinstance(index, tuple) else (index,):
            if isinstance(part, np.ndarray | np.integer | list) and np.asarray(part).dtype.kind == "i":
                assert np.min(part, initial=0) >= 0, "a negative index"
        return super().__getitem__(index)

    def __array_wrap__(self, out, context=None, return_scalar=False):
        return out[()] if out.ndim == 0 else super().__array_wrap__(out, context)


class Guarding:
    """NumPy, of which functions return guarded arrays; those of ufuncs and methods follow their operands."""

    def __getattr__(self, name):
        found = getattr(np, name)
        if not callable(found) or isinstance(found, type | np.ufunc):
            return found
        return lambda *args, **given: guarded(found(*args, **given))


def guarded(made):
    if isinstance(made, tuple | list):
        return type(made)(map(guarded, made))
    return made.view(Guarded) if type(made) is np.ndarray else made


def exact_sizes():
    """Let the buffers of devices have the sizes of their arrays, so that a read beyond the end of one is outside."""
    opencl.Pool.take = lambda pool, size: pool._use(pool._new(max(1, size)), [])


if __name__ == "__main__":  # tiny.py {"options": of the machine} JOB...
    exact_sizes()
    opencl.OpenCL.__init__.__kwdefaults__.update(ast.literal_eval(sys.argv[1]))
    for job in sys.argv[2:] or JOBS:
        assert_same_bits(*(np.asarray(JOBS[job]({"device": name})) for name in ("oclgrind", "reference")))
    print("same bits throughout")

"""Whole runs of all methods, pinned by digest: no change of the engine changes a byte unless the changelog says why.

``python tests/test_digests.py`` prints the digests of the code as it is, for tests/digests.json.
"""

import functools
import hashlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest
import test_algorithm_given
from skimage import data
from test_bits import RUNS, expected

import simdtex

PINNED = Path(__file__).with_name("digests.json")

PAPER = {"edges": "keep", "seams": "cut"}
"""What the paper says of ``multires``, with the bytes of the versions before these options."""

# sample, output shape, options: larger than the runs of test_bits, on the device that is preferred here.
LARGE = {
    "brick": ("brick", (256, 256), {}),
    "grass-odd": ("grass", (150, 131), {"order": 8}),
    "gravel-open": ("gravel", (96, 128), {"boundary": "open"}),
    "coffee": ("coffee", (160, 160), {}),
    "coffee-exact": ("coffee", (48, 64), {"search": "exact", "order": 8}),
    "brick-exact": ("brick", (128, 128), {"search": "exact"}),
    "brick-paper": ("brick-64", (40, 40), {"preset": "paper", "order": 8}),
    "grass-16-bit": ("grass-16", (120, 120), {}),
    "gravel-float-exact": ("gravel-float", (64, 64), {"search": "exact", "order": 8}),
    "gravel-phases": ("gravel-64", (96, 96), {"phases": "all", "edges": "reflect", "order": 8}),
    "grass-draws": ("grass-64", (64, 64), {"relaxation": "gibbs", "search": "coherent", "order": 8}),
    **{
        f"{schedule}-{search}": ("brick-64", (56, 56), {"schedule": schedule, "search": search, "order": 8})
        for schedule in ("coloring-fixed", "luby", "checkerboard", "synchronous", "random-subset", "block")
        for search in ("coherent", "exact")
    },
    **{
        f"{schedule}-{search}": ("brick-64", (20, 24), {"schedule": schedule, "search": search, "order": 5})
        for schedule in ("raster", "random-scan")
        for search in ("coherent", "exact")
    },
    "array": ("brick-64", (56, 56), {"array": "16x32", "order": 8}),
    "array-exact": ("brick-64", (40, 40), {"array": "16x32", "order": 5, "search": "exact"}),
    "array-luby": ("brick-64", (40, 40), {"array": "16x16:hierarchical", "order": 5, "schedule": "luby"}),
    "multires-brick": ("brick", (256, 200), {"method": "multires"}),
    "multires-coffee": ("coffee", (130, 96), {"method": "multires", "alpha": 0.33}),
    "multires-brick-paper": ("brick", (256, 200), {"method": "multires"} | PAPER),
    "multires-coffee-paper": ("coffee", (130, 96), {"method": "multires", "alpha": 0.93} | PAPER),
    "pyramid-grass": ("grass", (128, 160), {"method": "pyramid"}),
    "pyramid-coffee": ("coffee", (96, 96), {"method": "pyramid", "match": "lookup", "pyramid": "laplacian"}),
}


GIVEN = (
    *("known-three-levels-few", "placed-some-exact", "partly-few", "labels-silent-exact", "grey-guide-silent-few"),
    *("masked-exact", "mixed-few", "everything-exact", "everything-few"),
)
"""Runs of test_algorithm_given: with known values, guides, several samples, masks, gaps, and kinds of variables."""

QUICK = ("brick", "coffee", "grass-16-bit", "multires-coffee", "pyramid-coffee")
"""Those whose kernels other tests compile too."""


@functools.cache
def sample(name):
    """A sample by name, and its channel axis."""
    kind, _, how = name.partition("-")
    if kind == "coffee":
        return data.coffee()[266:362, 486:582], -1
    pixels = getattr(data, kind)()[:128, :128]
    if how == "16":
        return pixels.astype(np.uint16) * 257 + (np.indices(pixels.shape).sum(0) % 7).astype(np.uint16), None
    if how == "float":
        return pixels.astype(np.float32) / 255, None
    return (pixels[:64, :64] if how == "64" else pixels), None


def digest(arrays):
    """SHA-256 of some arrays: their types, shapes and bytes, the first half of the hexadecimal digits."""
    total = hashlib.sha256()
    for array in arrays:
        total.update(f"{array.dtype} {array.shape}".encode())
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()[:32]


def counts(levels):
    """What each level of a run of `mrf` took, as one array; of other methods, nothing."""
    wanted = [[level[k] for k in ("level", "rows", "cols", "candidates")] for level in levels if "sweeps" in level]
    taken = [[level[k] for k in ("sweeps", "steps", "relaxations")] for level in levels if "sweeps" in level]
    return np.array([[*w, *t] for w, t in zip(wanted, taken, strict=True)], np.int64)


def small(name):
    """The digest of a run of test_bits on the reference."""
    arrays, (levels, _) = expected(name)
    return digest([*arrays, counts(levels)])


def with_given(name):
    """The digest of a run of test_algorithm_given on the reference."""
    return digest(test_algorithm_given.run(test_algorithm_given.CASES[name]))


def large(name, device):
    """The digest of a larger run on a device."""
    kind, shape, options = LARGE[name]
    pixels, axis = sample(kind)
    image, output = simdtex.synthesize(
        pixels, shape, channel_axis=axis, rng=7, device=device, full_output=True, **options
    )
    arrays = [image, output.source, output.temperature]
    return digest([*(a for a in arrays if a is not None), counts(output.statistics.get("levels", []))])


def classified():
    """The digest of the labels and the unknown of a classification on the reference."""
    picture, textures = np.hstack([sample("brick-64")[0], sample("grass-64")[0][:, ::-1]]), {}
    for name in ("brick", "grass"):
        textures[name] = sample(name)[0][80:, 80:]
    options = {"exemplars": 100, "rng": 7, "device": "reference", "channel_axis": None}
    return digest([simdtex.classify(picture, textures, unknown=unknown, **options) for unknown in (0.0, 0.3)])


@functools.cache
def pinned():
    return json.loads(PINNED.read_text())


def test_every_run_is_pinned():
    names = {f"small {name}" for name in RUNS} | {f"given {name}" for name in GIVEN}
    assert set(pinned()) == names | {f"large {name}" for name in LARGE} | {"classify"}


@pytest.mark.parametrize("name", RUNS)
def test_the_references_bytes_are_those_pinned(name):
    assert small(name) == pinned()[f"small {name}"]


@pytest.mark.parametrize("name", GIVEN)
def test_the_bytes_of_a_run_with_what_is_given_are_those_pinned(name):
    assert with_given(name) == pinned()[f"given {name}"]


def test_the_labels_of_a_classification_are_those_pinned():
    assert classified() == pinned()["classify"]


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in QUICK)) for name in LARGE])
def test_the_devices_bytes_are_those_pinned(any_device, name):
    from cases import opencl

    assert large(name, opencl(any_device)) == pinned()[f"large {name}"]


if __name__ == "__main__":
    found = {f"small {name}": small(name) for name in RUNS}
    found |= {f"given {name}": with_given(name) for name in GIVEN}
    found |= {f"large {name}": large(name, None) for name in LARGE}
    found["classify"] = classified()
    json.dump(found, sys.stdout, indent=0, sort_keys=True)
    print()

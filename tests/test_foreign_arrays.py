# SPDX-License-Identifier: BSD-3-Clause
"""What goes into public functions and what comes out: arrays of other libraries, and generators."""

from pathlib import Path

import dask.array
import numpy as np
import pandas
import PIL.Image
import pytest
import xarray
from cases import assert_same_bits

import simdtex
import simdtex.distributed
from simdtex.model.source_map import apply_source_map

RNG = np.random.default_rng(1)
GREY = RNG.integers(0, 256, (12, 14), dtype=np.uint8)
RGB = RNG.integers(0, 256, (12, 14, 3), dtype=np.uint8)
HOLE = np.zeros((12, 14), bool)
HOLE[4:6, 4:7] = True
OPTIONS = {"order": 1, "device": "reference", "rng": 1}


class Tensor:
    """A tensor as torch has it: its own type, ``ndim``, ``__array__`` and ``__dlpack__``."""

    def __init__(self, values):
        self.values = values
        self.ndim, self.shape, self.dtype = values.ndim, values.shape, f"torch.{values.dtype}"

    def __len__(self):
        return len(self.values)

    def __getitem__(self, index):
        return type(self)(self.values[index])

    def __array__(self, dtype=None, copy=None):
        return self.values if dtype is None else self.values.astype(dtype)

    def __dlpack__(self, **given):
        return self.values.__dlpack__(**given)

    def __dlpack_device__(self):
        return self.values.__dlpack_device__()


class Exchanged:
    """An array that can be exchanged by ``__dlpack__`` alone."""

    def __init__(self, values):
        self.values, self.ndim = values, values.ndim

    def __dlpack__(self, **given):
        return self.values.__dlpack__(**given)

    def __dlpack_device__(self):
        return self.values.__dlpack_device__()


class OnGpu(Tensor):
    """A tensor that refuses as torch's of a GPU do."""

    def __array__(self, dtype=None, copy=None):
        raise TypeError("can't convert cuda:0 device type tensor to numpy. Use Tensor.cpu() first.")


class Tracked(Tensor):
    """A tensor that refuses as torch's do that have a gradient."""

    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy() instead.")


KINDS = {
    "tensor": Tensor,
    "dlpack": Exchanged,
    "Pillow": PIL.Image.fromarray,
    "xarray": xarray.DataArray,
    "dask": lambda values: dask.array.from_array(values, chunks=5),
    "pandas": pandas.DataFrame,
    "memoryview": memoryview,
    "Fortran order": np.asfortranarray,
}

JOBS = {
    "synthesize": lambda of: simdtex.synthesize(of(GREY), (6, 7), **OPTIONS),
    "several": lambda of: simdtex.synthesize([of(GREY), of(GREY[:9])], (6, 7), **OPTIONS),
    "mask": lambda of: simdtex.synthesize(GREY, (6, 7), mask=of(~HOLE), **OPTIONS),
    "guide": lambda of: simdtex.synthesize(GREY, (12, 14), guide=(of(GREY), of(GREY)), labels=False, **OPTIONS),
    "fill": lambda of: simdtex.fill(of(GREY), of(HOLE), **OPTIONS),
    "extend": lambda of: simdtex.extend(of(GREY), right=2, **OPTIONS),
    "solid": lambda of: simdtex.synthesize_solid(of(GREY), (8, 8, 8), iterations=1, device="reference", rng=1),
    "mix": lambda of: simdtex.mix([of(GREY), of(GREY)], (8, 8), iterations=1, device="reference", rng=1),
    "simulate": lambda of: simdtex.simulate(of(GREY), 1, **OPTIONS).values,
    "apply_source_map": lambda of: apply_source_map(np.zeros((3, 4, 2), int), of(GREY), GREY.shape),
}


@pytest.mark.parametrize("job", JOBS)
@pytest.mark.parametrize("kind", KINDS)
def test_arrays_of_other_libraries_are_taken_and_numpy_comes_out(kind, job):
    made = JOBS[job](KINDS[kind])
    assert type(made) is np.ndarray
    assert_same_bits(made, JOBS[job](np.asarray))


@pytest.mark.parametrize("kind", [Tensor, Exchanged, PIL.Image.fromarray, xarray.DataArray, KINDS["dask"]])
def test_colours_are_taken(kind):
    given = OPTIONS | {"channel_axis": -1}
    assert_same_bits(simdtex.synthesize(kind(RGB), (6, 7), **given), simdtex.synthesize(RGB, (6, 7), **given))
    several = simdtex.synthesize([kind(RGB), kind(RGB[:9])], (6, 7), **given)
    assert_same_bits(several, simdtex.synthesize([RGB, RGB[:9]], (6, 7), **given))


def test_known_values_with_nan_are_taken():
    known = np.where(np.pad(HOLE[:6, :7], 0), 9.0, np.nan)
    made = simdtex.synthesize(GREY.astype(float), (6, 7), known=known, **OPTIONS)
    for of in (Tensor, xarray.DataArray, KINDS["dask"], pandas.DataFrame):
        assert_same_bits(simdtex.synthesize(GREY.astype(float), (6, 7), known=of(known), **OPTIONS), made)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (OnGpu(GREY), r"the sample is no array that NumPy can take: can.t convert cuda:0 .*Use Tensor\.cpu\(\)"),
        (Tracked(GREY), r"the sample is no array that NumPy can take: .*Use tensor\.detach"),
        (PIL.Image.fromarray(RGB).quantize(4), r"palette indices, which are no colours; give image\.convert\('RGB'\)"),
        (pandas.DataFrame(GREY).astype("Int64"), "holds object values; convert it"),
        (xarray.DataArray(GREY).to_dataset(name="a"), "no array that NumPy can take: .*Dataset"),
    ],
    ids=["GPU", "gradient", "palette", "nullable", "dataset"],
)
def test_what_is_no_array_is_refused_in_one_sentence(given, words):
    with pytest.raises((TypeError, ValueError), match=words) as said:
        simdtex.synthesize(given, (6, 7), **OPTIONS)
    assert "\n" not in str(said.value)


READERS = {
    "synthesize": lambda one: simdtex.synthesize(one, (6, 7), **OPTIONS),
    "several": lambda one: simdtex.synthesize([one, one], (6, 7), **OPTIONS),
    "mask": lambda one: simdtex.synthesize(GREY, (6, 7), mask=one, **OPTIONS),
    "guide": lambda one: simdtex.synthesize(GREY, (6, 7), guide=(GREY, one), **OPTIONS),
    "tiles": lambda one: simdtex.distributed.synthesize(one, (6, 7), "no.zarr", **OPTIONS),
    "solid": lambda one: simdtex.synthesize_solid(one, (4, 4, 4), device="reference"),
    "fill": lambda one: simdtex.fill(one, HOLE, **OPTIONS),
    "hole": lambda one: simdtex.fill(GREY, one, **OPTIONS),
    "extend": lambda one: simdtex.extend(one, right=3, **OPTIONS),
    "simulate": lambda one: simdtex.simulate(one, 1, **OPTIONS),
    "estimate": lambda one: simdtex.estimate(one, known=np.ma.masked_array(GREY, HOLE), device="reference"),
    "classify": lambda one: simdtex.classify(one, {"a": GREY, "b": GREY}, **OPTIONS),
    "class": lambda one: simdtex.classify(GREY, {"a": one, "b": GREY}, **OPTIONS),
    "mix": lambda one: simdtex.mix([one, GREY], (32, 32), device="reference"),
    "live": simdtex.Live,
    "source map": lambda one: apply_source_map(np.zeros((2, 2, 2), int), one),
}


@pytest.mark.parametrize("path", ["a.png", Path("a.png")], ids=["str", "Path"])
@pytest.mark.parametrize("name", READERS)
def test_a_path_is_to_be_read_first(name, path):
    with pytest.raises(
        TypeError, match=r" is the path a\.png: read it first, by simdtex\.io\.image\.read\(path\)\.pix"
    ):
        READERS[name](path)


def test_a_generator_gives_the_seed():
    given = OPTIONS | {"full_output": True}
    seeds = []
    for _ in range(2):
        rng = np.random.default_rng(7)
        runs = [simdtex.synthesize(GREY, (6, 7), **(given | {"rng": rng})) for _ in range(2)]
        seeds.append([output.statistics["seed"] for _, output in runs])
        again = simdtex.synthesize(GREY, (6, 7), **(OPTIONS | {"rng": seeds[-1][0]}))
        assert_same_bits(again, runs[0][0])
    assert seeds[0] == seeds[1] and seeds[0][0] != seeds[0][1], "each call draws one"


@pytest.mark.parametrize("rng", [np.random.RandomState(1), np.random.SeedSequence(1), "1", True, 1.0], ids=str)
def test_what_is_no_seed_is_refused(rng):
    with pytest.raises(TypeError, match=r"rng must be None, an integer or a numpy\.random\.Generator, not "):
        simdtex.synthesize(GREY, (6, 7), order=1, device="reference", rng=rng)


def test_what_is_given_is_not_changed():
    for job in JOBS.values():
        before = GREY.copy(), HOLE.copy()
        GREY.flags.writeable = HOLE.flags.writeable = False
        try:
            made = job(np.asarray)
        finally:
            GREY.flags.writeable = HOLE.flags.writeable = True
        assert made.flags.writeable and not np.shares_memory(made, GREY)
        assert_same_bits((GREY, HOLE), before)

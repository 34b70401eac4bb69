"""What users give: the forms that are taken, arrays of other libraries, and a sentence for each that is not."""

from pathlib import Path

import dask.array
import numpy as np
import pandas
import PIL.Image
import pytest
import xarray
from cases import assert_same_bits, texture

import simdtex
from simdtex.inputs import check_inputs, check_samples, is_several
from simdtex.io import image, volume
from simdtex.io.hard_data import HardData
from simdtex.jobs.simulation.ensemble import ENSEMBLE, checked
from simdtex.model.source_map import apply_source_map, save_source_map
from simdtex.options import DataWarning

SHAPE = (6, 7)
GREY, COLOUR = texture((9, 10)), texture((9, 10), 3)
FLOAT = texture((9, 10), dtype=np.float64)
MASK = np.arange(10) < np.full((9, 1), 6)
SOME = np.full(SHAPE, np.nan)
SOME[1, 2], SOME[5, 6] = 7, 200
THERE = ~np.isnan(SOME)
NOWHERE = np.full((*SHAPE, 2), -1)


def at(array, place, value):
    found = np.array(array)
    found[place] = value
    return found


def check(sample=GREY, **rest):
    return check_inputs(sample, SHAPE, **rest)


def test_channels_come_last():
    for axis in (0, 1, 2, -2):
        known = np.moveaxis(np.repeat(SOME[..., None], 3, -1), -1, axis)
        found = check(np.moveaxis(COLOUR, -1, axis), channel_axis=axis, known=known)
        assert_same_bits(found.pictures.pixels[0], COLOUR)
        assert np.array_equal(found.given.known, np.repeat(THERE[..., None], 3, -1))


def test_a_list_of_samples_is_told_from_a_sample_written_as_lists():
    for sample, axis in (([GREY, GREY[:5]], None), ((GREY,), None), ([COLOUR, COLOUR[:4]], -1)):
        assert is_several(sample, axis)
    for sample in (GREY, np.stack([GREY, GREY]), GREY.tolist(), list(GREY), [], None, [GREY, GREY.tolist()]):
        assert not is_several(sample, None)
    assert not is_several(list(np.moveaxis(COLOUR, -1, 0)), 0)


def test_unknown_pixels_are_completed_and_said_to_be_unknown():
    found = check(at(FLOAT, np.s_[2:4, 3], np.nan)).pictures
    (pixels,), (known,) = found.pixels, found.known
    assert np.isfinite(pixels).all() and known.sum() == 88 and not known[2:4, 3].any()
    assert np.isin(pixels[2:4, 3], FLOAT).all()
    hidden = np.ma.masked_where(np.arange(90).reshape(9, 10) % 7 == 0, GREY)
    (expected,), (found,) = (check_samples(one, None).known for one in (hidden, KINDS["dask"](hidden)))
    assert np.array_equal(found, expected) and not found.all()


KNOWN = {
    "NaN": SOME,
    "lists": [[None if np.isnan(v) else v for v in row] for row in SOME.tolist()],
    "masked": np.ma.MaskedArray(np.where(THERE, SOME, 9).astype(np.uint8), ~THERE),
    "masked floats": np.ma.masked_invalid(SOME),
    "masked and NaN": np.ma.MaskedArray(SOME, np.zeros(SHAPE, bool)),
    "masked infinite": np.ma.MaskedArray(np.where(THERE, SOME, np.inf), ~THERE),
    "64 bits": np.ma.MaskedArray(np.where(THERE, SOME, -1).astype(np.int64), ~THERE),
    "half": SOME.astype(np.float16),
    "another byte order": SOME.astype(">f4"),
}


def test_forms_of_what_is_known():
    for case, known in KNOWN.items():
        found = check(known=np.array(known, float) if case == "lists" else known).given
        assert found.values.dtype == np.uint8 and found.place is None and np.array_equal(found.known[..., 0], THERE)
        assert_same_bits(found.values[..., 0], np.where(THERE, SOME, 0).astype(np.uint8))
    for dtype in (np.bool_, np.int8, np.uint16, np.float32):
        found = check(texture((9, 10), dtype=dtype), known=at(np.full(SHAPE, np.nan), (2, 3), 1)).given
        assert found.values.dtype == dtype and found.values[2, 3, 0] == 1


def test_a_table_of_known_values_or_its_path(tmp_path):
    (tmp_path / "wells.csv").write_text("x,y,value\n2,1,7\n6.3,4.8,200\n")
    for known in (tmp_path / "wells.csv", str(tmp_path / "wells.csv"), simdtex.read_hard_data(tmp_path / "wells.csv")):
        found = check(known=known).given
        assert np.array_equal(found.known[..., 0], THERE)
        assert_same_bits(found.values[..., 0], np.where(THERE, SOME, 0).astype(np.uint8))
    wells = HardData(np.array([[2.0, 1.0]]), np.array([[1.0, np.nan, 3.0]]), ("a", "b", "c"))
    both = check(COLOUR, channel_axis=-1, known=wells)
    assert both.given.known[1, 2].tolist() == [True, False, True] and both.given.known.sum() == 2


def test_a_source_map_is_of_whole_numbers():
    for dtype in (np.int8, np.uint64):
        place = np.zeros((*SHAPE, 2), dtype)
        place[1, 2] = 8, 9
        found = check(known=SOME, known_source=place).given.place
        assert found.dtype == np.int32 and (found[~THERE] == -1).all()
        assert found[1, 2].tolist() == [8, 9] and found[5, 6].tolist() == [0, 0]
    place = np.full((*SHAPE, 3), -1)
    place[1, 2] = 4, 3, 1
    found = check([GREY, GREY[:5, :4]], known=SOME, known_source=place).given.place
    assert found[1, 2].tolist() == [4, 3, 1] and found[5, 6].tolist() == [-1, -1, -1]


def test_forms_of_guides():
    (one,), output = check(guide=(GREY, GREY[:6, :7])).guide
    assert one.shape == (9, 10, 1) and output.shape == (6, 7, 1)
    (one,), output = check(guide=[COLOUR, COLOUR[:6, :7]]).guide
    assert one.shape == (9, 10, 3) and output.shape == (6, 7, 3)
    (one,), output = check(guide=(MASK, MASK[:6, :7])).guide
    assert one.dtype == output.dtype == np.uint8
    (one,), output = check(guide=(GREY.tolist(), SOME)).guide
    assert np.isnan(output).any()
    (one,), output = check(GREY, guide=(COLOUR, COLOUR[:6, :7])).guide  # not of the sample's channels
    assert one.shape[-1] == 3


INF = at(SOME, (2, 2), np.inf)
TWO = {"sample": [GREY, GREY[:5, :4]]}
THREE = np.full((*SHAPE, 3), -1)

BAD = {
    # samples
    "ragged": ({"sample": [[1, 2], [3]]}, ValueError, "the sample is ragged; give rows of equal length"),
    "text": ({"sample": GREY.astype(str)}, TypeError, "the sample holds <U.* values; convert it"),
    "one axis": ({"sample": GREY[0]}, ValueError, r"1-dimensional: give \(rows, cols\)"),
    "colour": ({"sample": COLOUR}, ValueError, "3-dimensional: give .* or channel_axis=-1"),
    "grey with an axis": ({"channel_axis": 0}, ValueError, "2-dimensional .grey.: give three axes"),
    "axis 3": ({"sample": COLOUR, "channel_axis": 3}, ValueError, "channel_axis is 3: give one of -3 to 2"),
    "axis True": ({"sample": COLOUR, "channel_axis": True}, TypeError, "channel_axis is True: give None or an"),
    "empty": ({"sample": GREY[:0]}, ValueError, "the sample is empty"),
    "infinite": ({"sample": at(FLOAT, (2, 3), -np.inf)}, ValueError, "infinite, the first at row 2, column 3"),
    "NaN": ({"sample": FLOAT * np.nan}, ValueError, "a sample has no known pixel; leave it out"),
    "grey and colour": ({"sample": [GREY, COLOUR], "channel_axis": -1}, ValueError, "the samples have 2 and 3 axes"),
    "two types": ({"sample": [GREY, FLOAT]}, ValueError,
                  "sample 1 has 1 channel of float64 and sample 0 1 channel of uint8; convert them to one type"),
    # masks
    "a mask of numbers": ({"mask": MASK.astype(int)}, TypeError, "mask holds int64 values; give True and False"),
    "a mask of another size": ({"mask": MASK.T}, ValueError, "mask is 10x9 and the picture 9x10 .*; give one size"),
    "a mask of nothing": ({"mask": MASK & False}, ValueError, "the mask leaves nothing of the sample"),
    "a mask for two": (TWO | {"mask": [MASK]}, ValueError, "2 samples and 1 masks; give one mask for each"),
    # known values
    "data of another number": ({"known": HardData(np.ones((1, 2)), np.ones((1, 2)), ("a", "b"))}, ValueError,
                               "a datum has 2 values, a, b, and a pixel of the sample 1; .* choose columns"),
    "known words": ({"known": SOME.astype(str)}, TypeError, "known holds <U.* convert it to integers or real floats"),
    "known in colour": ({"known": np.dstack([SOME] * 3)}, ValueError, r"known is 3-dimensional; give \(rows, cols\)"),
    "known grey": ({"sample": COLOUR, "channel_axis": -1, "known": SOME}, ValueError,
                   "known is 2-dimensional; give the channel axis too"),
    "known of other channels": ({"sample": COLOUR, "channel_axis": -1, "known": np.dstack([SOME] * 2)}, ValueError,
                                "known is 6x7x2 and the output 6x7x3 .*; give one size"),
    "known infinite": ({"known": INF}, ValueError, "known has infinite values; give numbers, or NaN"),
    "nothing known": ({"known": SOME * np.nan}, ValueError, "known has no value; leave it out"),
    "all known": ({"known": np.ones(SHAPE)}, ValueError, "known leaves nothing to do; give NaN or a masked array"),
    "no fraction": ({"known": at(SOME, (0, 0), 2.5)}, ValueError, "known holds 2.5, which the sample's type uint8"),
    "beyond 32 bits": ({"sample": FLOAT.astype(np.float32), "known": at(SOME, (0, 0), 1e300)}, ValueError,
                       "known holds 1e[+]300, which the sample's type float32"),
    # where known values are from
    "a source of floats": ({"known": SOME, "known_source": NOWHERE * 1.0}, ValueError,
                           r"known_source is no array of integers \(6, 7, 2\); give a source map"),
    "a source of one of two": (TWO | {"known": SOME, "known_source": NOWHERE}, ValueError, r"integers \(6, 7, 3\)"),
    "a ragged source": ({"known": SOME, "known_source": [[1], [1, 2]]}, ValueError, "known_source is ragged"),
    "a row too far": ({"known": SOME, "known_source": at(NOWHERE, (1, 2), (9, 0))}, ValueError,
                      "known_source points outside the sample; give -1 where a pixel is not from there"),
    "more than 32 bits": ({"known": SOME, "known_source": at(NOWHERE, (1, 2), (2**32, 0))}, ValueError, "points out"),
    "a third of two": (TWO | {"known": SOME, "known_source": at(THREE, (1, 2), (0, 0, 2))}, ValueError, "points out"),
    # guides
    "no pair": ({"guide": GREY}, TypeError, "guide is no pair; give .guide of the sample, guide of the output"),
    "an empty guide": ({"guide": (GREY, GREY[:0])}, ValueError, "the guide of the output has the shape .0, 10."),
    "an infinite guide": ({"guide": (FLOAT + np.inf, SOME)}, ValueError, "guide of the sample has infinite values"),
    "a guide with NaN": ({"guide": (at(FLOAT, (1, 1), np.nan), SOME)}, ValueError, "guide of the sample has NaN; give"),
    "a small guide": ({"guide": (GREY[:5], GREY[:6, :7])}, ValueError,
                      "guide of the sample is 5x10 and the sample 9x10 .*; give one size"),
    "a large output": ({"guide": (GREY, GREY)}, ValueError, "guide of the output is 9x10 and the output 6x7"),
    "guide channels": ({"guide": (COLOUR, GREY[:6, :7])}, ValueError, "has 3 channels and that of the output 1; give"),
    "a guide for two": (TWO | {"guide": (GREY, GREY[:6, :7])}, ValueError, "2 samples; give a list of a guide"),
}  # fmt: skip


def test_bad_input_is_refused_with_a_remedy():
    for change, error, words in BAD.values():
        with pytest.raises(error, match=words) as said:
            check(**change)
        assert "\n" not in str(said.value) and len(str(said.value)) < 300


def test_a_code_within_the_values_of_the_sample_is_a_datum(tmp_path):
    """A table in a file or a DataFrame; -99 is a temperature here, and -999 is unknown."""
    frame = pandas.DataFrame({"lat": [0, 1, 2], "lon": [2, 1, 0], "t": [-99.0, -999.0, 5.0]})
    frame.to_csv(tmp_path / "t.csv")
    sample = np.linspace(-120, 50, 64).reshape(8, 8)
    for known in (frame, tmp_path / "t.csv"):
        with pytest.warns(DataWarning, match="1 of 3 values are -999, and are taken as unknown"):
            given = check_inputs(sample, (3, 3), known=known).given
        assert given.values[0, 2, 0] == -99 and given.known.sum() == 2


def test_data_beyond_the_sample_are_warned_about():
    table = HardData(np.array([[0, 0], [1, 1], [2, 2.0]]), np.array([[5], [240], [2.0]]), ("v",))
    with pytest.warns(
        DataWarning, match=r"2 of 3 known values are beyond those of the sample, 5 to 219, the first 240;"
    ):
        check_inputs(np.array([[5, 219]], np.uint8), (3, 3), known=table)


# -- Masked arrays: where a mask would be lost, and with it which values are there, they are refused.

PLAIN = texture((20, 20))
LOW = PLAIN % 4


def masked(array, place=(0, 1)):
    found = np.ma.array(array, copy=True)
    found[place] = np.ma.masked
    return found


PLACES = np.zeros((4, 4, 2), np.int32)
ON = {"device": "reference", "rng": 1}
REFUSED = {
    "solid": lambda _: simdtex.synthesize_solid(masked(PLAIN), (4, 4, 4), **ON),
    "multires": lambda _: simdtex.synthesize(masked(PLAIN), (9, 9), method="multires", **ON),
    "pyramid": lambda _: simdtex.synthesize(masked(PLAIN), (9, 9), method="pyramid", **ON),
    "start": lambda _: simdtex.synthesize(PLAIN, (9, 9), method="pyramid", start=masked(np.ones((9, 9))), **ON),
    "mix": lambda _: simdtex.mix([PLAIN, masked(PLAIN)], (9, 9), **ON),
    "extend": lambda _: simdtex.extend(masked(PLAIN), left=3, **ON),
    "lcpdf image": lambda _: simdtex.lcpdf(masked(LOW), LOW, [[1, 1]], order=1, greys=4, device="reference"),
    "lcpdf sample": lambda _: simdtex.lcpdf(LOW, masked(LOW), [[1, 1]], order=1, greys=4, device="reference"),
    "lcpdf sites": lambda _: simdtex.lcpdf(LOW, LOW, masked([[1, 1]]), order=1, greys=4, device="reference"),
    "temperature": lambda _: simdtex.lcpdf(
        LOW, LOW, [[1, 1]], order=1, greys=4, temperature=masked(np.ones((20, 20))), device="reference"
    ),
    "mask": lambda _: simdtex.synthesize(PLAIN, (9, 9), mask=masked(PLAIN > 0), **ON),
    "guide": lambda _: simdtex.synthesize(PLAIN, (20, 20), guide=(masked(PLAIN), PLAIN), **ON),
    "quality": lambda _: simdtex.quality.coverage(masked(PLAIN), PLAIN),
    "ensemble": lambda _: checked(masked(np.ones((2, 3, 3))), "ensemble", ENSEMBLE),
    "map": lambda _: apply_source_map(PLACES, masked(PLAIN)),
    "source map": lambda folder: save_source_map(folder / "a.npz", masked(PLACES)),
    "picture": lambda folder: image.write(folder / "a.png", masked(PLAIN)),
    "volume": lambda folder: volume.write(folder / "a.npz", masked(np.ones((2, 3, 3)))),
    "alpha": lambda _: image.split_alpha(masked(PLAIN)),
}


def test_a_mask_that_would_be_lost_is_refused(tmp_path):
    for case, call in REFUSED.items():
        with pytest.raises(ValueError, match=r"masked|known everywhere") as said:
            call(tmp_path)
        assert any(remedy in str(said.value) for remedy in ("fill them first", 'method="mrf"')), case
    assert list(tmp_path.iterdir()) == []


def test_masked_arrays_without_a_masked_value_are_arrays(tmp_path):
    whole = np.ma.array(PLAIN, mask=np.zeros(PLAIN.shape, bool))
    image.write(tmp_path / "a.png", whole)
    assert np.array_equal(image.read(tmp_path / "a.png").pixels, PLAIN)
    made = [simdtex.synthesize(one, (9, 9), method="multires", **ON) for one in (PLAIN, whole)]
    assert np.array_equal(*made)
    simdtex.fill(masked(PLAIN), order=1, **ON)  # where a mask means unknown it is taken


# -- What goes into public functions and what comes out: arrays of other libraries, and generators.

RNG = np.random.default_rng(1)
PHOTO = RNG.integers(0, 256, (12, 14), dtype=np.uint8)
RGB = RNG.integers(0, 256, (12, 14, 3), dtype=np.uint8)
HOLE = np.zeros((12, 14), bool)
HOLE[4:6, 4:7] = True
OPTIONS = {"order": 1, "device": "reference", "rng": 1}


class Exchanged:
    """An array that can be exchanged by ``__dlpack__`` alone."""

    def __init__(self, values):
        self.values, self.ndim = values, values.ndim

    def __dlpack__(self, **how):
        return self.values.__dlpack__(**how)

    def __dlpack_device__(self):
        return self.values.__dlpack_device__()


class Tensor(Exchanged):
    """A tensor as torch has it: its own type, ``ndim``, ``__array__`` and ``__dlpack__``; it may refuse to be read."""

    def __init__(self, values, error=None):
        super().__init__(values)
        self.shape, self.dtype, self.error = values.shape, f"torch.{values.dtype}", error

    def __len__(self):
        return len(self.values)

    def __getitem__(self, index):
        return type(self)(self.values[index])

    def __array__(self, dtype=None, copy=None):
        if self.error:
            raise self.error
        return self.values if dtype is None else self.values.astype(dtype)


ON_GPU = TypeError("can't convert cuda:0 device type tensor to numpy. Use Tensor.cpu() first.")
TRACKED = RuntimeError("Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy() instead.")
KINDS = {
    "tensor": Tensor,
    "dlpack": Exchanged,
    "Pillow": PIL.Image.fromarray,
    "xarray": xarray.DataArray,
    "dask": lambda values: dask.array.from_array(values, chunks=5, asarray=False),
    "pandas": pandas.DataFrame,
    "memoryview": memoryview,
    "Fortran order": np.asfortranarray,
}

JOBS = {
    "synthesize": lambda of: simdtex.synthesize(of(PHOTO), (6, 7), **OPTIONS),
    "mask": lambda of: simdtex.synthesize(PHOTO, (6, 7), mask=of(~HOLE), **OPTIONS),
    "guide": lambda of: simdtex.synthesize(PHOTO, (12, 14), guide=(of(PHOTO), of(PHOTO)), labels=False, **OPTIONS),
    "fill": lambda of: simdtex.fill(of(PHOTO), of(HOLE), **OPTIONS),
    "extend": lambda of: simdtex.extend(of(PHOTO), right=2, **OPTIONS),
    "solid": lambda of: simdtex.synthesize_solid(of(PHOTO), (8, 8, 8), iterations=1, device="reference", rng=1),
    "mix": lambda of: simdtex.mix([of(PHOTO), of(PHOTO)], (8, 8), iterations=1, device="reference", rng=1),
    "simulate": lambda of: simdtex.simulate(of(PHOTO), 1, **OPTIONS).values,
    "apply_source_map": lambda of: apply_source_map(np.zeros((3, 4, 2), int), of(PHOTO), PHOTO.shape),
}


def test_arrays_of_other_libraries_are_taken_and_numpy_comes_out():
    for job in JOBS.values():
        made = job(Tensor)
        assert type(made) is np.ndarray
        assert_same_bits(made, job(np.asarray))
    known = np.where(np.pad(HOLE[:6, :7], 0), 9.0, np.nan)
    for kind, of in KINDS.items():
        found = check([of(PHOTO), of(PHOTO[:9])]).pictures.pixels
        assert_same_bits([pixels[..., 0] for pixels in found], [PHOTO, PHOTO[:9]])
        if kind not in ("pandas", "memoryview", "Fortran order"):
            assert_same_bits(check([of(RGB), of(RGB[:9])], channel_axis=-1).pictures.pixels, [RGB, RGB[:9]])
        if kind in ("tensor", "xarray", "dask", "pandas"):
            assert_same_bits(check(PHOTO, known=of(known)).given.values, check(PHOTO, known=known).given.values)


def test_what_is_no_array_is_refused_in_one_sentence():
    palette = PIL.Image.fromarray(RGB).quantize(4)
    for what, words in (
        (Tensor(PHOTO, ON_GPU), r"the sample is no array that NumPy can take: can.t convert .*Use Tensor\.cpu\(\)"),
        (Tensor(PHOTO, TRACKED), r"the sample is no array that NumPy can take: .*Use tensor\.detach"),
        (palette, r"palette indices, which are no colours; give image\.convert\('RGB'\)"),
        (pandas.DataFrame(PHOTO).astype("Int64"), "holds object values; convert it"),
        (xarray.DataArray(PHOTO).to_dataset(name="a"), "no array that NumPy can take: .*Dataset"),
    ):
        with pytest.raises((TypeError, ValueError), match=words) as said:
            check(what)
        assert "\n" not in str(said.value)


READERS = {
    "samples": lambda one: check([one, one]),
    "mask": lambda one: check(mask=one),
    "guide": lambda one: check(guide=(GREY, one)),
    "hole": lambda one: simdtex.fill(PHOTO, one, **OPTIONS),
    "classify": lambda one: simdtex.classify(one, {"a": PHOTO, "b": PHOTO}, **OPTIONS),
    "class": lambda one: simdtex.classify(PHOTO, {"a": one, "b": PHOTO}, **OPTIONS),
    "solid": lambda one: simdtex.synthesize_solid(one, (4, 4, 4), device="reference"),
    "mix": lambda one: simdtex.mix([one, PHOTO], (32, 32), device="reference"),
    "live": simdtex.Live,
    "source map": lambda one: apply_source_map(np.zeros((2, 2, 2), int), one),
}


def test_a_path_is_to_be_read_first():
    words = r" is the path a\.png: read it first, by simdtex\.io\.image\.read\(path\)\.pix"
    for read in READERS.values():
        with pytest.raises(TypeError, match=words):
            read("a.png")
    with pytest.raises(TypeError, match=words):
        check(Path("a.png"))


def test_a_generator_gives_the_seed_and_what_is_no_seed_is_refused():
    rng = np.random.default_rng(7)
    runs = [simdtex.synthesize(PHOTO, (6, 7), **(OPTIONS | {"full_output": True, "rng": rng})) for _ in range(2)]
    seeds = [output.statistics["seed"] for _, output in runs]
    assert seeds[0] != seeds[1], "each call draws one"
    assert_same_bits(simdtex.synthesize(PHOTO, (6, 7), **(OPTIONS | {"rng": seeds[1]})), runs[1][0])
    for rng in (np.random.RandomState(1), np.random.SeedSequence(1), "1", True, 1.0):
        with pytest.raises(TypeError, match=r"rng must be None, an integer or a numpy\.random\.Generator, not "):
            simdtex.synthesize(PHOTO, (6, 7), **(OPTIONS | {"rng": rng}))


def test_what_is_given_is_not_changed():
    for job in JOBS.values():
        before = PHOTO.copy(), HOLE.copy()
        PHOTO.flags.writeable = HOLE.flags.writeable = False
        try:
            made = job(np.asarray)
        finally:
            PHOTO.flags.writeable = HOLE.flags.writeable = True
        assert made.flags.writeable and not np.shares_memory(made, PHOTO)
        assert_same_bits((PHOTO, HOLE), before)

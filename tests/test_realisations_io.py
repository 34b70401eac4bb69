"""Realisations come back from every format as they were, and nothing is half written."""

import json
import os
import sys
import zipfile

import numpy as np
import pytest
import xarray

from simdtex.io import realisations as module
from simdtex.io.realisations import check_realisations_path, read_realisations, write_realisations

SUFFIXES = [".zarr", ".zarr.zip", ".nc", ".npz"]
TYPES = ["uint8", "int16", "uint64", "float32", "float64", "bool"]

ATTRIBUTES = {
    "text": "sand and clay",
    "empty": "",
    "accents": "Höhe ≥ 3",
    "end": "a\0b",
    "json": '{"a": 1}',
    "seed": 12,
    "large": 2**64 - 1,
    "largest": 2**63 - 1,
    "negative": -3,
    "share": 0.25,
    "whole": 2.0,
    "infinite": float("inf"),
    "nothing": None,
    "yes": True,
    "units": "days since 2000-01-01",
    "options": {"order": 8, "levels": None, "parts": [1, 2.5, "x", [True]], "inner": {"a": {}}},
    "list": [1, 2, 3],
    "none": [],
    "long": "é" * 70000,  # more than a header of HDF5 holds
}


def some(dtype="uint8", variables=None, attrs=ATTRIBUTES, name=None):
    rng = np.random.default_rng(3)
    shape = (3, 5, 4) if variables is None else (3, 5, 4, variables)
    values = (rng.random(shape) * 255 - (0 if np.dtype(dtype).kind in "bu" else 100)).astype(dtype)
    if np.dtype(dtype).kind == "f":
        values[0, 1, 2] = np.nan
    coords = {
        "realisation": ("realisation", [7, 9, 11], {"long_name": "seed", "odd": None}),
        "y": ("y", np.arange(5) * 0.5 + 0.25, {"units": "m"}),
        "x": np.arange(4, dtype=np.int32),
        "seconds": ("realisation", [0.5, 1.5, np.nan]),
        "site": "north",
    }
    if variables:
        coords["variable"] = ["porosity", "facies", "é"][:variables]
    return xarray.DataArray(values, coords, module.DIMENSIONS[: values.ndim], name=name, attrs=attrs)


def same(found, expected):
    xarray.testing.assert_identical(found, expected)
    assert found.dtype == expected.dtype
    assert {k: one.dtype for k, one in found.coords.items()} == {k: one.dtype for k, one in expected.coords.items()}
    for one, other in [(found, expected), *((found[name], expected[name]) for name in expected.coords)]:
        assert {k: (type(v), v) for k, v in one.attrs.items()} == {k: (type(v), v) for k, v in other.attrs.items()}


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("dtype", TYPES)
def test_values_and_types_survive_a_file(tmp_path, suffix, dtype):
    path = tmp_path / f"many{suffix}"
    array = some(dtype)
    write_realisations(path, array)
    same(read_realisations(path), array)
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(("variables", "name"), [(1, "rock"), (3, None), (3, "realisations")])
def test_variables_and_names_survive_a_file(tmp_path, suffix, variables, name):
    array = some("float32", variables, name=name)
    write_realisations(tmp_path / f"many{suffix}", array)
    same(read_realisations(tmp_path / f"many{suffix}"), array)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_has_neither_coordinates_nor_attributes(tmp_path, suffix):
    array = xarray.DataArray(np.arange(24, dtype=">i2").reshape(2, 3, 4), dims=("realisation", "y", "x"))
    write_realisations(tmp_path / f"BARE{suffix.upper()}", array)
    same(read_realisations(tmp_path / f"BARE{suffix.upper()}"), array.astype("int16"))


@pytest.mark.parametrize("suffix", [".zarr", ".npz"])
def test_half_floats(tmp_path, suffix):
    array = some("float16")
    write_realisations(tmp_path / f"many{suffix}", array)
    same(read_realisations(tmp_path / f"many{suffix}"), array)
    with pytest.raises(ValueError, match=r"\.nc cannot hold float16 values: end its name in \.npz instead"):
        write_realisations(tmp_path / "many.nc", array)


def test_types_are_checked_before_there_is_an_array(tmp_path):
    for suffix in SUFFIXES:
        check_realisations_path(tmp_path / f"many{suffix}", np.float32)
    for suffix in SUFFIXES[:3]:
        if np.dtype(np.longdouble).itemsize > 8:
            with pytest.raises(ValueError, match=r"cannot hold .* end its name in \.npz"):
                check_realisations_path(tmp_path / f"many{suffix}", np.longdouble)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_attributes_of_numpy_become_those_of_python(tmp_path, suffix):
    attrs = {
        "a": np.int16(3),
        "b": np.float32(0.5),
        "c": np.bool_(True),
        "d": np.arange(3),
        "e": (1, "x"),
        "f": np.str_("t"),
    }
    write_realisations(tmp_path / f"many{suffix}", some(attrs=attrs))
    found = read_realisations(tmp_path / f"many{suffix}")
    same(found, some(attrs={"a": 3, "b": 0.5, "c": True, "d": [0, 1, 2], "e": [1, "x"], "f": "t"}))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_is_replaced(tmp_path, suffix):
    path = tmp_path / f"many{suffix}"
    write_realisations(path, some("uint8", 3))
    array = some("float64", attrs={"seed": 2})
    check_realisations_path(path)
    write_realisations(path, array)
    same(read_realisations(path), array)
    assert os.listdir(tmp_path) == [path.name]


def test_texts_and_numbers_are_attributes_to_other_programs(tmp_path):
    write_realisations(tmp_path / "many.nc", some(name="rock", attrs={"seed": 3, "text": "a", "options": {"b": [1]}}))
    write_realisations(tmp_path / "many.zarr", some(name="rock", attrs={"seed": 3, "text": "a", "options": {"b": [1]}}))
    with (
        xarray.open_dataset(tmp_path / "many.nc", engine="h5netcdf") as netcdf,
        xarray.open_dataset(tmp_path / "many.zarr", engine="zarr", consolidated=False) as zarr,
    ):
        for dataset in (netcdf, zarr):
            attrs = dataset["rock"].attrs
            assert (attrs["seed"], attrs["text"], json.loads(attrs["options"])) == (3, "a", {"b": [1]})
            np.testing.assert_array_equal(dataset["rock"], some())


def test_numpy_alone_reads_npz(tmp_path):
    array = some("int16", 3, name="rock")
    write_realisations(tmp_path / "many.npz", array)
    with np.load(tmp_path / "many.npz", allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["values"], array)
        assert arrays["coordinate variable"].tolist() == ["porosity", "facies", "é"]
        description = json.loads(str(arrays["description"]))
    assert description["dimensions"] == ["realisation", "y", "x", "variable"]
    assert description["attributes"] == ATTRIBUTES


def test_a_zip_has_every_file_once(tmp_path):
    write_realisations(tmp_path / "many.zarr.zip", some())
    with zipfile.ZipFile(tmp_path / "many.zarr.zip") as archive:
        names = archive.namelist()
    assert "zarr.json" in names
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(("size", "expected"), [(179, (2, 5, 4)), (79, (1, 4, 4)), (1, (1, 1, 4))])
def test_chunks_are_of_whole_realisations_or_rows(tmp_path, size, expected, monkeypatch):
    monkeypatch.setattr(module, "_CHUNK", size)
    array = some("int32")
    write_realisations(tmp_path / "many.zarr", array)
    write_realisations(tmp_path / "many.nc", array)
    for path in (tmp_path / "many.zarr", tmp_path / "many.nc"):
        same(read_realisations(path), array)
    with xarray.open_dataset(tmp_path / "many.nc", engine="h5netcdf") as dataset:
        assert dataset["realisations"].encoding["chunksizes"] == expected
    with xarray.open_dataset(tmp_path / "many.zarr", engine="zarr", consolidated=False, chunks=None) as dataset:
        assert dataset["realisations"].encoding["chunks"] == expected


# ---------------------------------------------------------------- whole or not at all


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_failure_leaves_the_old_file_alone(tmp_path, suffix, monkeypatch):
    path = tmp_path / f"many{suffix}"
    write_realisations(path, some())
    writer = {".npz": "_write_npz"}.get(suffix)

    def failing(error):
        def write(temporary, *_):
            if temporary.is_dir():
                (temporary / "half").touch()
            else:
                temporary.write_bytes(b"half")
            raise error

        if writer:
            monkeypatch.setattr(module, writer, write)
        else:
            monkeypatch.setitem(module._WRITERS, suffix, write)

    for error in (KeyboardInterrupt, RuntimeError):
        failing(error)
        with pytest.raises(error):
            write_realisations(path, some("float32"))
    failing(OSError(28, "No space left on device"))
    with pytest.raises(ValueError, match=r"could not be written .No space left.*: free some space"):
        write_realisations(path, some("float32"))
    same(read_realisations(path), some())
    assert os.listdir(tmp_path) == [path.name]


def test_a_zip_that_fails_leaves_nothing(tmp_path, monkeypatch):
    def write(folder, *_):
        (folder / "zarr.json").touch()
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "_write_zarr", write)
    with pytest.raises(KeyboardInterrupt):
        write_realisations(tmp_path / "many.zarr.zip", some())
    assert os.listdir(tmp_path) == []


def test_a_folder_that_is_no_store_is_left_alone(tmp_path):
    for name in ("empty.zarr", "photos.zarr"):
        (tmp_path / name).mkdir()
    (tmp_path / "photos.zarr" / "a.png").touch()
    (tmp_path / "file.zarr").touch()
    for name, words in (
        ("empty.zarr", "is a folder and no Zarr store: give a new name"),
        ("photos.zarr", "is a folder and no Zarr store"),
        ("file.zarr", "is a file"),
    ):
        for attempt in (check_realisations_path, lambda path: write_realisations(path, some())):
            with pytest.raises(ValueError, match=words):
                attempt(tmp_path / name)
    assert os.listdir(tmp_path / "photos.zarr") == ["a.png"]
    assert sorted(os.listdir(tmp_path)) == ["empty.zarr", "file.zarr", "photos.zarr"]


# ---------------------------------------------------------------- what is wrong


def test_places_that_cannot_be_written(tmp_path):
    (tmp_path / "folder.nc").mkdir()
    (tmp_path / "folder.zarr.zip").mkdir()
    for name, words in (
        ("many.png", "names no format of realisations: end its name in one of .zarr, .zarr.zip, .nc, .npz"),
        ("many.zip", "names no format"),
        ("many", "names no format"),
        (".zarr", "names no format"),
        ("none/many.nc", "the folder .* does not exist"),
        ("none/many.zarr", "the folder .* does not exist"),
        ("folder.nc", "is a folder"),
        ("folder.zarr.zip", "is a folder"),
    ):
        with pytest.raises(ValueError, match=words):
            check_realisations_path(tmp_path / name)
        with pytest.raises(ValueError, match=words):
            write_realisations(tmp_path / name, some())
    for suffix in SUFFIXES:
        check_realisations_path(tmp_path / f"many{suffix}", np.uint8)
    assert sorted(os.listdir(tmp_path)) == ["folder.nc", "folder.zarr.zip"]


def test_folder_without_permission(tmp_path, monkeypatch):
    write_realisations(tmp_path / "old.zarr", some())
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write anywhere
    for name in ("a.nc", "a.zarr", "old.zarr", "a.zarr.zip", "a.npz"):
        with pytest.raises(ValueError, match="not writable"):
            check_realisations_path(tmp_path / name)


@pytest.mark.parametrize(
    ("missing", "suffixes"),
    [("xarray", SUFFIXES), ("zarr", [".zarr", ".zarr.zip"]), ("h5netcdf", [".nc"]), ("h5py", [".nc"])],
)
def test_libraries_that_are_not_installed(tmp_path, monkeypatch, missing, suffixes):
    array = some()
    for suffix in SUFFIXES:
        write_realisations(tmp_path / f"many{suffix}", array)
    monkeypatch.setitem(sys.modules, missing, None)
    for suffix in SUFFIXES:
        path = tmp_path / f"many{suffix}"
        for attempt in (check_realisations_path, read_realisations, lambda path: write_realisations(path, array)):
            if suffix in suffixes:
                with pytest.raises(
                    ValueError, match=rf"^{missing} is not installed; pip install 'simdtex\[simulate\]'$"
                ):
                    attempt(path)
            else:
                attempt(path)


@pytest.mark.parametrize(
    ("array", "error", "words"),
    [
        (np.zeros((2, 3, 4)), TypeError, "of type ndarray: give an xarray.DataArray"),
        (some().transpose("y", "x", "realisation"), ValueError, "the dimensions .'y', 'x', 'realisation'.: give"),
        (some()[0], ValueError, "the dimensions"),
        (some()[:0], ValueError, "one pixel at least"),
        (some().astype(complex), TypeError, "complex128 values"),
        (some().astype("U3"), TypeError, "<U3 values"),
        (some(name=3), ValueError, "the name of the realisations is 3"),
        (some(name="seconds"), ValueError, "'seconds' is the name of the realisations and of one of their coordinates"),
        (some().drop_vars("x").rename("x"), ValueError, "'x' is the name of the realisations and of one"),
        (some().assign_coords(realisations=1), ValueError, "'realisations' is the name of the realisations and of"),
        (some(attrs={"a": object()}), TypeError, "the attribute a is of type object: give"),
        (some(attrs={"a": {"b": [{1, 2}]}}), TypeError, "the attribute a is of type set"),
        (some(attrs={"a": {1: 2}}), TypeError, "the attribute a has a dictionary with keys that are no texts"),
        (some(attrs={"a": 1j}), TypeError, "the attribute a is of type complex"),
        (some(attrs={3: 1}), TypeError, "the attribute 3 has no text for a name"),
        (some(attrs={"": 1}), TypeError, "the attribute '' has no text for a name"),
        (some(attrs={"_FillValue": 0}), ValueError, "the attribute _FillValue has a name that the file formats use"),
        (some(attrs={"NAME": "a"}), ValueError, "the attribute NAME has a name that the file formats use"),
        (some().assign_coords(a=("y", [1j] * 5)), TypeError, "the coordinate 'a' holds complex128"),
        (some().assign_coords(a=("y", [None] * 5)), TypeError, "the coordinate 'a' holds object"),
        (some().assign_coords({"a/b": 1}), TypeError, "the coordinate 'a/b' .* without '/'"),
    ],
)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_arrays_that_are_wrong(tmp_path, array, error, words, suffix):
    with pytest.raises(error, match=words) as caught:
        write_realisations(tmp_path / f"many{suffix}", array)
    assert "\n" not in str(caught.value)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_files_that_are_no_realisations(tmp_path, suffix):
    path = tmp_path / f"many{suffix}"
    with pytest.raises(ValueError, match="does not exist: check"):
        read_realisations(path)
    folder = suffix == ".zarr"
    if folder:
        path.touch()
    else:
        path.mkdir()
    with pytest.raises(ValueError, match="should be a"):
        read_realisations(path)
    if folder:
        path.unlink()
        path.mkdir()
    else:
        path.rmdir()
        write_realisations(path, some())
        data = path.read_bytes()
        path.write_bytes(data[: len(data) // 2])
    with pytest.raises(ValueError, match=r"many.* cannot be read as realisations \(.*\): write them again") as caught:
        read_realisations(path)
    assert "\n" not in str(caught.value)


def test_other_arrays_are_no_realisations(tmp_path):
    one = xarray.Dataset({"a": (("y", "x"), np.zeros((2, 3)))})
    two = xarray.Dataset({name: (("realisation", "y", "x"), np.zeros((2, 3, 4))) for name in "ab"})
    for dataset, words in ((one, "the dimensions"), (two, "it has 2 arrays")):
        dataset.to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
        with pytest.raises(ValueError, match=words):
            read_realisations(tmp_path / "a.nc")
    np.savez(tmp_path / "a.npz", values=np.zeros((2, 3, 4)))
    with pytest.raises(ValueError, match="cannot be read as realisations"):
        read_realisations(tmp_path / "a.npz")

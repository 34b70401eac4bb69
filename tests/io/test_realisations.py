"""Realisations go to files by xarray's own writers, and are read by xarray and NumPy alone."""

import json
import os
import signal
import sys
import time
from types import SimpleNamespace

import click
import h5netcdf
import numpy as np
import pytest
import xarray

from simdtex.cli.command import catch_signals
from simdtex.io.grids import read_grid
from simdtex.io.volume import check_realisations_path, write_realisations
from simdtex.options import DataWarning

SUFFIXES = [".zarr", ".nc", ".npz"]
ATTRIBUTES = {"text": "Höhe ≥ 3", "seed": 2**64 - 1, "share": 0.25, "options": '{"order": 8, "levels": null}'}


def some(dtype="uint8", variables=None, name="rock"):
    rng = np.random.default_rng(3)
    shape = (3, 5, 4) if variables is None else (3, 5, 4, variables)
    values = (rng.random(shape) * 255).astype(dtype)
    if np.dtype(dtype).kind == "f":
        values[0, 1, 2] = np.nan
    coords = {
        "realisation": [7, 9, 11],
        "y": ("y", np.arange(5) * 0.5 + 0.25, {"units": "m"}),
        "x": np.arange(4, dtype=np.int32),
        "seed": ("realisation", np.array([1, 2**64 - 1, 0], np.uint64)),
    }
    dims = ("realisation", "y", "x", "variable")[: values.ndim]
    return xarray.DataArray(values, coords, dims, name=name, attrs=ATTRIBUTES)


@pytest.mark.parametrize(
    ("suffix", "dtype", "variables"),
    [(".zarr", "uint64", None), (".zarr", "bool", 3), (".nc", "float16", 3), (".nc", "bool", None)],
)
def test_xarray_reads_what_was_written(tmp_path, suffix, dtype, variables):
    path, array = tmp_path / f"many{suffix}", some(dtype, variables)
    write_realisations(path, array)
    with xarray.open_dataarray(path) as found:
        xarray.testing.assert_identical(found, array)
        assert found.dtype == array.dtype and found.seed.dtype == np.uint64
    assert os.listdir(tmp_path) == [path.name]


def test_files_are_compressed(tmp_path):
    array = xarray.DataArray(np.zeros((4, 200, 200)), dims=("realisation", "y", "x"))
    for suffix in SUFFIXES:
        write_realisations(tmp_path / f"a{suffix}", array)
    assert sum(file.stat().st_size for file in tmp_path.rglob("*") if file.is_file()) < array.nbytes / 10


def test_numpy_alone_writes_and_reads_npz(tmp_path, monkeypatch):
    array = some("int16", 3)
    write_realisations(tmp_path / "many.npz", array)
    with np.load(tmp_path / "many.npz") as arrays:
        assert np.array_equal(arrays["values"], array) and arrays["values"].dtype == np.int16
        assert set(arrays.files) == {"values", "attributes", *array.coords}
        assert all(np.array_equal(arrays[name], array[name]) for name in array.coords)
        assert json.loads(str(arrays["attributes"])) == ATTRIBUTES
    monkeypatch.setitem(sys.modules, "xarray", None)
    coords = {"x": SimpleNamespace(values=np.arange(3))}
    check_realisations_path(tmp_path / "a.npz")
    write_realisations(tmp_path / "a.npz", SimpleNamespace(values=np.ones((2, 3, 3)), coords=coords, attrs={}))
    with np.load(tmp_path / "a.npz") as arrays:
        assert arrays["values"].sum() == 18 and arrays["x"].tolist() == [0, 1, 2]


@pytest.mark.parametrize(("suffix", "variables"), [(".gslib", 2), (".sgems", None)])
def test_a_grid_keeps_values_origin_and_cells(tmp_path, suffix, variables):
    path, array = tmp_path / f"many{suffix}", some("float32", variables)
    write_realisations(path, array.assign_coords(z=3.5).assign_attrs(cell_x=1.0, cell_z=0.25))
    with pytest.warns(DataWarning):
        grid = read_grid(path)
    assert (grid.origin, grid.cell) == ((0, 0.25, 3.5), (1, 0.5, 0.25))
    parts = [""] if variables is None else ["_0", "_1"]
    assert list(grid.values) == [f"rock{part}__real{number}" for number in (7, 9, 11) for part in parts]
    planes = array.values if variables is None else np.moveaxis(array.values, -1, 1)
    found = np.stack(list(grid.values.values())).astype(np.float32)[:, 0]
    assert np.array_equal(found, planes.reshape(-1, 5, 4), equal_nan=True)
    values = np.arange(48, dtype=np.uint8).reshape(2, 3, 4, 2)
    layers = xarray.DataArray(values, dims=("realisation", "y", "x", "z"))
    for written, cell in (
        (layers, (1, 1, 1)),
        (layers.assign_attrs(cell_y=2.5), (1, 2.5, 1)),
        (layers[0, 0:1, 0:1].assign_coords(x=[7.0]).assign_attrs(cell_x=3.0), (3, 1, 1)),
    ):
        write_realisations(path, written)
        assert read_grid(path).cell == cell
    write_realisations(path, layers)
    assert np.array_equal(read_grid(path).values["realisations__real1"], values[1].transpose(2, 0, 1))


def test_coordinates_that_no_grid_has(tmp_path):
    for x in ([0, 1, 3, 4], [3, 2, 1, 0], [1, 1, 1, 1], [0, 1, np.nan, 3]):
        with pytest.raises(ValueError, match="the coordinate x is not evenly spaced in ascending order"):
            write_realisations(tmp_path / "a.gslib", some().assign_coords(x=x))
    with pytest.raises(ValueError, match="have the dimensions realisation, y, row: give"):
        write_realisations(tmp_path / "a.gslib", some().rename(x="row"))
    assert os.listdir(tmp_path) == []


def refused_realisations(path, words):
    for attempt in (check_realisations_path, lambda path: write_realisations(path, some())):
        with pytest.raises(ValueError, match=words) as said:
            attempt(path)
        assert "\n" not in str(said.value)


def test_places_that_cannot_be_written(tmp_path, monkeypatch):
    for name in ("folder.nc", "empty.zarr", "photos.zarr"):
        (tmp_path / name).mkdir()
    (tmp_path / "photos.zarr" / "a.png").touch()
    (tmp_path / "file.zarr").touch()
    for name, words in (
        ("many.png", "names no format of realisations: end its name in one of .zarr, .nc, .npz, .gsl"),
        ("many", "names no format"),
        (".zarr", "names no format"),
        ("none/many.nc", "the folder .* does not exist"),
        ("none/many.zarr", "the folder .* does not exist"),
        ("folder.nc", "is a folder"),
        *((name, "exists already: give a new name") for name in ("empty.zarr", "photos.zarr", "file.zarr")),
    ):
        refused_realisations(tmp_path / name, words)
    assert os.listdir(tmp_path / "photos.zarr") == ["a.png"]
    assert sorted(os.listdir(tmp_path)) == ["empty.zarr", "file.zarr", "folder.nc", "photos.zarr"]
    with pytest.raises(ValueError, match="is a grid, which holds no source map: end its name in"):
        check_realisations_path(tmp_path / "a.gslib", source=True)
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write anywhere
    refused_realisations(tmp_path / "a.nc", "not writable")


def test_libraries_that_are_not_installed(tmp_path, monkeypatch):
    for missing, suffix in (("xarray", ".zarr"), ("zarr", ".zarr"), ("h5py", ".nc")):
        with monkeypatch.context() as without:
            without.setitem(sys.modules, missing, None)
            words = rf"^{missing} is not installed; pip install 'simdtex\[simulate\]'$"
            refused_realisations(tmp_path / f"many{suffix}", words)
            assert check_realisations_path(tmp_path / "many.npz") == ".npz"


def test_what_is_no_data_array_is_refused(tmp_path):
    with pytest.raises(TypeError, match=r"of type ndarray: give an xarray\.DataArray"):
        write_realisations(tmp_path / "a.npz", np.zeros((2, 3, 4)))
    for suffix in SUFFIXES:
        with pytest.raises(TypeError):
            write_realisations(tmp_path / f"a{suffix}", some().assign_attrs(a=object()))
    assert os.listdir(tmp_path) == []


@pytest.mark.slow
def test_an_interrupt_waits_until_a_netcdf_file_is_closed(tmp_path, monkeypatch):
    """A file that is half open prints a traceback when it is collected."""
    interrupted, flush = [], h5netcdf.core.File.flush

    def interrupting(file):
        if not interrupted:
            interrupted.append(os.kill(os.getpid(), signal.SIGINT))
        flush(file)

    monkeypatch.setattr(h5netcdf.core.File, "flush", interrupting)
    with pytest.raises(KeyboardInterrupt) as said, catch_signals(click.Context(click.Command("simulate"))):
        write_realisations(tmp_path / "a.nc", some())
        time.sleep(10)
    assert interrupted and not any("h5netcdf" in str(entry.path) for entry in said.traceback)
    assert os.listdir(tmp_path) in ([], ["a.nc"])

"""Realisations go to files by xarray's own writers, and are read by xarray and NumPy alone; nothing is half written."""

import json
import os
import signal
import subprocess
import sys
import time

import click
import h5netcdf
import numpy as np
import pytest
import xarray
import zarr

from simdtex import distributed
from simdtex.cli.command import catch_signals
from simdtex.io.grids import read_grid
from simdtex.io.realisations import check_realisations_path, write_realisations
from simdtex.options import DataWarning

SUFFIXES = [".zarr", ".nc", ".npz"]
GRIDS = [".gslib", ".sgems"]
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


@pytest.mark.parametrize("suffix", [".zarr", ".nc", ".NC"])
@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint64", "float16", "float32", "float64", "bool"])
@pytest.mark.parametrize("variables", [None, 3])
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


@pytest.mark.parametrize("variables", [None, 3])
def test_numpy_alone_reads_npz(tmp_path, variables):
    array = some("int16", variables)
    write_realisations(tmp_path / "many.npz", array)
    with np.load(tmp_path / "many.npz") as arrays:
        assert np.array_equal(arrays["values"], array) and arrays["values"].dtype == np.int16
        assert set(arrays.files) == {"values", "attributes", *array.coords}
        assert all(np.array_equal(arrays[name], array[name]) for name in array.coords)
        assert json.loads(str(arrays["attributes"])) == ATTRIBUTES


def test_an_npz_is_written_without_xarray(tmp_path):
    code = """
import sys
sys.modules["xarray"] = None
from types import SimpleNamespace
import numpy as np
from simdtex.io.realisations import check_realisations_path, write_realisations
coords = {"x": SimpleNamespace(values=np.arange(3))}
check_realisations_path(sys.argv[1])
write_realisations(sys.argv[1], SimpleNamespace(values=np.ones((2, 3, 3)), coords=coords, attrs={"seed": 1}))
"""
    subprocess.run([sys.executable, "-c", code, tmp_path / "a.npz"], check=True)
    with np.load(tmp_path / "a.npz") as arrays:
        assert arrays["values"].sum() == 18 and arrays["x"].tolist() == [0, 1, 2]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_is_replaced(tmp_path, suffix):
    path = tmp_path / f"many{suffix}"
    write_realisations(path, some("uint8", 3))
    write_realisations(path, some("float64"))
    if suffix != ".npz":
        with xarray.open_dataarray(path) as found:
            xarray.testing.assert_identical(found, some("float64"))
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.parametrize("suffix", GRIDS)
@pytest.mark.parametrize("variables", [None, 2])
def test_a_grid_keeps_values_origin_and_cells(tmp_path, suffix, variables):
    array = some("float32", variables).assign_coords(z=3.5).assign_attrs(cell_x=1.0, cell_z=0.25)
    write_realisations(tmp_path / f"many{suffix}", array)
    with pytest.warns(DataWarning):
        grid = read_grid(tmp_path / f"many{suffix}")
    assert (grid.origin, grid.cell) == ((0, 0.25, 3.5), (1, 0.5, 0.25))
    parts = [""] if variables is None else ["_0", "_1"]
    assert list(grid.values) == [f"rock{part}__real{number}" for number in (7, 9, 11) for part in parts]
    planes = array.values if variables is None else np.moveaxis(array.values, -1, 1)
    found = np.stack(list(grid.values.values())).astype(np.float32)[:, 0]
    assert np.array_equal(found, planes.reshape(-1, 5, 4), equal_nan=True)


@pytest.mark.parametrize("suffix", GRIDS)
def test_layers_and_arrays_without_coordinates(tmp_path, suffix):
    values = np.arange(48, dtype=np.uint8).reshape(2, 3, 4, 2)
    array = xarray.DataArray(values, dims=("realisation", "y", "x", "z"))
    write_realisations(tmp_path / f"a{suffix}", array)
    grid = read_grid(tmp_path / f"a{suffix}")
    assert np.array_equal(grid.values["realisations__real1"], values[1].transpose(2, 0, 1))
    assert (grid.origin, grid.cell) == ((0, 0, 0), (1, 1, 1))
    write_realisations(tmp_path / f"a{suffix}", array.assign_attrs(cell_y=2.5))
    assert read_grid(tmp_path / f"a{suffix}").cell == (1, 2.5, 1)
    write_realisations(tmp_path / f"a{suffix}", array[0, 0:1, 0:1].assign_coords(x=[7.0]).assign_attrs(cell_x=3.0))
    assert read_grid(tmp_path / f"a{suffix}").cell == (3, 1, 1)


@pytest.mark.parametrize("x", [[0, 1, 3, 4], [3, 2, 1, 0], [1, 1, 1, 1], [0, 1, np.nan, 3]])
def test_coordinates_that_no_grid_has(tmp_path, x):
    with pytest.raises(ValueError, match="the coordinate x is not evenly spaced in ascending order"):
        write_realisations(tmp_path / "a.gslib", some().assign_coords(x=x))
    with pytest.raises(ValueError, match="have the dimensions realisation, y, row: give"):
        write_realisations(tmp_path / "a.gslib", some().rename(x="row"))
    assert os.listdir(tmp_path) == []


def refused(path, words):
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
        ("empty.zarr", "is a folder and not a store of realisations alone: remove it, or give a new name"),
        ("photos.zarr", "is a folder and not a store of realisations"),
        ("file.zarr", "is a file"),
    ):
        refused(tmp_path / name, words)
    assert os.listdir(tmp_path / "photos.zarr") == ["a.png"]
    assert sorted(os.listdir(tmp_path)) == ["empty.zarr", "file.zarr", "folder.nc", "photos.zarr"]
    write_realisations(tmp_path / "old.zarr", some())
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write anywhere
    for name in ("a.nc", "a.zarr", "old.zarr", "a.npz"):
        refused(tmp_path / name, "not writable")


@pytest.mark.parametrize(
    ("missing", "suffixes"),
    [("xarray", [".zarr", ".nc"]), ("zarr", [".zarr"]), ("h5netcdf", [".nc"]), ("h5py", [".nc"])],
)
def test_libraries_that_are_not_installed(tmp_path, monkeypatch, missing, suffixes):
    monkeypatch.setitem(sys.modules, missing, None)
    for suffix in suffixes:
        refused(tmp_path / f"many{suffix}", rf"^{missing} is not installed; pip install 'simdtex\[simulate\]'$")
    for suffix in set(SUFFIXES) - set(suffixes):
        assert check_realisations_path(tmp_path / f"many{suffix}") == suffix


def test_what_is_no_data_array_is_refused(tmp_path):
    with pytest.raises(TypeError, match=r"of type ndarray: give an xarray\.DataArray"):
        write_realisations(tmp_path / "a.npz", np.zeros((2, 3, 4)))
    for suffix in SUFFIXES:
        with pytest.raises(TypeError):
            write_realisations(tmp_path / f"a{suffix}", some().assign_attrs(a=object()))
    assert os.listdir(tmp_path) == []


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


@pytest.mark.parametrize("layers", [None, 3])
def test_a_grid_is_read_from_netcdf(tmp_path, layers):
    path, dims = tmp_path / "grid.nc", ("z", "y", "x")[layers is None :]
    shape = (3, 5, 4)[layers is None :]
    values = np.arange(np.prod(shape), dtype=np.int16).reshape(shape)
    coords = {"x": np.arange(4) * 10.0 + 105, "y": np.arange(5) * 20.0 + 7} | (
        {"z": np.arange(3) - 9.5} if layers else {}
    )
    grid = xarray.Dataset(
        {"rock": (dims, values), "other": ("x", np.zeros(4)), "b": (dims[::-1], values.T / 2)}, coords
    )
    grid.to_netcdf(path, engine="h5netcdf")
    found = read_grid(path)
    assert list(found.values) == ["rock", "b"] and found.values["rock"].dtype == np.int16
    for name, wanted in (("rock", values), ("b", values / 2)):
        assert (found.values[name] == wanted).all() and found.values[name].shape == (layers or 1, 5, 4)
    assert found.origin == (105, 7, -9.5 if layers else 0) and found.cell == (10, 20, 1)


def test_a_netcdf_that_is_no_grid_gets_one_sentence(tmp_path):
    path = tmp_path / "grid.nc"
    xarray.Dataset({"rock": ("t", np.zeros(4))}).to_netcdf(path, engine="h5netcdf")
    with pytest.raises(ValueError, match="has no variable with the axes y and x, or z, y and x"):
        read_grid(path)
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ValueError, match="cannot be read as a grid"):
        read_grid(path)
    some().isel(realisation=0, drop=True).to_netcdf(path, engine="h5netcdf")
    with pytest.raises(ValueError, match=r"grid\.nc "):
        read_grid(path, max_pixels=4)


def _group(path):
    zarr.open_group(path, mode="w").create_array("depths", data=np.arange(4))


def _tiles(path):
    distributed.synthesize(np.eye(9), (9, 9), path, order=1, rng=1, device="reference")


def _readme(path):
    write_realisations(path, some())
    (path / "README").write_text("kept")


def _more(path):
    write_realisations(path, some())
    zarr.open_group(path).create_array("depths", data=np.arange(4))


def _inside(path):
    write_realisations(path, some())
    (path / "rock" / "notes.txt").write_text("kept")


def _attribute(path):
    write_realisations(path, some())
    zarr.open_group(path)["rock"].attrs["checked_by"] = "me"


def _title(path):
    write_realisations(path, some())
    zarr.open_group(path).attrs["title"] = "mine"


def _edited(path):
    write_realisations(path, some())
    zarr.open_group(path)["rock"][0, 0, 0] = 77


@pytest.mark.parametrize("make", [_group, _tiles, _readme, _more, _inside, _attribute, _title, _edited])
def test_only_a_store_of_ones_own_is_replaced(tmp_path, make):
    path = tmp_path / "lab.zarr"
    make(path)
    before = {one: one.is_file() and one.read_bytes() for one in path.rglob("*")}
    with pytest.raises(ValueError, match=r"lab.zarr is a folder and not a store of realisations alone: remove it, or"):
        write_realisations(path, some())
    assert {one: one.is_file() and one.read_bytes() for one in path.rglob("*")} == before

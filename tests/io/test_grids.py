"""Grids of GSLIB and SGeMS, rasters of GDAL, NetCDF, and realisations in every format."""

import json
import os
import signal
import sys
import time
import warnings
from types import SimpleNamespace

import click
import h5netcdf
import numpy as np
import pytest
import rasterio
import xarray
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from rasterio.control import GroundControlPoint
from rasterio.enums import ColorInterp
from rasterio.rpc import RPC
from rasterio.transform import from_origin
from test_errors import by_hand, word

from simdtex import simulate
from simdtex.cli.command import catch_signals
from simdtex.commands import main
from simdtex.io import image
from simdtex.io.grids import MISSING, check_grid, is_grid, kind_of, read_grid, write_grid
from simdtex.io.volume import check_realisations_path, write_realisations
from simdtex.options import DataWarning

# -- Grids of GSLIB and SGeMS: values come to their cells whatever the header.

NAN = float("nan")


def saved(tmp_path, content, name="a.gslib"):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


CELLS = "".join(f"{k}.5 {k}\n" for k in range(12))
"""Two variables of 3 x 2 x 2 cells: the number of the cell plus a half, and the number."""

GEONE = """#
# # GRID - NUMBER OF CELLS
# NX 3
# NY 2
# NZ 2
# SX 10.0
# SY 20.0
# SZ 0.5
# OX 100.5
# OY -7
# OZ 0.3
# SORTING +X+Y+Z
#
a b
"""

HEADERS = [
    ("3 2 2\n2\na\nb\n", (0, 0, 0), (1, 1, 1)),
    ("3 2 2\n2 variables, of wells\na\nb\n", (0, 0, 0), (1, 1, 1)),
    ("3 2 2 10 20 0.5\n2\na\nb\n", (0, 0, 0), (10, 20, 0.5)),
    ("3 2 2   10 20 0.5   100.5 -7 0.3\n2\na\nb\n", (105.5, 3, 0.55), (10, 20, 0.5)),
    ("channels\n 2   3   2   2\na\nb\n", (0, 0, 0), (1, 1, 1)),
    ("a map\n2 3 2 2 105.5 3.0 .55 10. 20. 5E-1\na\nb\n", (105.5, 3, 0.55), (10, 20, 0.5)),
    ("a map\r\n2 3 2 2 105.5 3 .55 10 20 .5 1\r\na\r\nb\r\n", (105.5, 3, 0.55), (10, 20, 0.5)),
    ("my grid (3x2x2)\n2\na\nb\n", (0, 0, 0), (1, 1, 1)),
    (GEONE, (105.5, 3, 0.55), (10, 20, 0.5)),
]


@pytest.mark.parametrize(("header", "origin", "cell"), HEADERS)
def test_every_header_says_the_same_cells(tmp_path, header, origin, cell):
    path = saved(tmp_path, header + CELLS)
    grid = read_grid(path)
    assert (grid.origin, grid.cell, list(grid.values), kind_of(path)) == (origin, cell, ["a", "b"], "grid")
    assert grid.values["a"].dtype == np.float64 and grid.values["b"].dtype == np.uint8
    assert np.array_equal(grid.values["a"], np.arange(12).reshape(2, 2, 3) + 0.5), "x fastest, then y, then z"
    assert np.array_equal(grid.values["b"], np.arange(12).reshape(2, 2, 3))


def test_variables_are_chosen_and_a_text_of_geone_is_checked(tmp_path):
    path = saved(tmp_path, GEONE + CELLS)
    assert list(read_grid(path, variables=["b"]).values) == ["b"]
    small = "2 2 1\n1\nv\n1 2 3 4\n"
    assert read_grid(saved(tmp_path, small), max_pixels=4).values["v"].tolist() == [[[1, 2], [3, 4]]]
    for content, words, how in (
        (GEONE + CELLS, "has no variable 'c': give one of a, b", {"variables": ["c"]}),
        (small, "has 4 pixels and no more than 3", {"max_pixels": 3}),
        (GEONE.replace("+Y", "-Y") + CELLS, r"sorted as \+X-Y\+Z: save it with SORTING \+X\+Y\+Z", {}),
        (GEONE + CELLS + "\nsand\n", "has more values than its header says", {}),
        (GEONE + CELLS.replace("4.5 4", "4.5 x"), "line 19 has 'x', not a number", {}),
        (GEONE.replace("a b", ""), "line 14 has no names of variables", {}),
    ):
        with pytest.raises(ValueError, match=words):
            read_grid(saved(tmp_path, content), **how)


def test_realisations_follow_each_other_and_names_become_distinct(tmp_path):
    path = saved(tmp_path, "SGSIM\n2 2 1 1 0 0 0 1 1 1 3\na\nb\n" + "".join(f"{k} {k + 100}\n" for k in range(6)))
    found = {name: values.ravel().tolist() for name, values in read_grid(path).values.items()}
    assert found == {
        **{"a__real0": [0, 1], "b__real0": [100, 101], "a__real1": [2, 3], "b__real1": [102, 103]},
        **{"a__real2": [4, 5], "b__real2": [104, 105]},
    }
    assert list(read_grid(saved(tmp_path, "1 1 1\n3\nv\nv\nw\n1 2 3\n")).values) == ["v", "v_1", "w"]


@pytest.mark.parametrize("suffix", [".gslib", ".sgems"])
def test_codes_of_unknown_values(tmp_path, suffix):
    for code in (*MISSING, -1e21, 1e21):
        values = [1, 5, code, NAN]
        path = saved(tmp_path, "4 1 1\n1\nv\n" + "\n".join(map(repr, values)) + "\n")
        if suffix == ".sgems":
            path = saved(tmp_path, by_hand(values, sides=(4, 1, 1)))
        with pytest.warns(DataWarning, match=r"v: 1 of 4 values are .*, and are taken as unknown"):
            assert np.array_equal(read_grid(path).values["v"].ravel(), [1, 5, NAN, NAN], equal_nan=True)
        everything = read_grid(path, valid=(-np.inf, np.inf)).values["v"].ravel()
        assert everything[2] == (np.float32(code) if suffix == ".sgems" else code)
        with pytest.warns(DataWarning, match="2 of 4"):
            assert np.isnan(read_grid(path, missing=[5]).values["v"].ravel()).tolist() == [False, True, True, True]


@pytest.mark.parametrize(
    ("numbers", "unknown"),
    [
        ("-120 -99 50", []), ("-99 0 1", [0]), ("-99 -99 -99", [0, 1, 2]), ("3e307 -5e307 1e30", []),
        ("-999.25 -120 -99 50", [0]),
    ],
)  # fmt: skip
def test_a_code_within_the_range_of_the_other_values_is_a_number(tmp_path, numbers, unknown):
    path = saved(tmp_path, f"{len(numbers.split())} 1 1\n1\nv\n{numbers}\n")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert np.flatnonzero(np.isnan(read_grid(path).values["v"])).tolist() == unknown
    assert len(said) == bool(unknown)


def test_whole_numbers_are_integers_of_the_smallest_type(tmp_path):
    for numbers, dtype in {
        **{"0 255": "uint8", "0 256": "int16", "-1 255": "int16", "0 32768": "int32", "0 2147483648": "float64"},
        **{"0 0.5": "float64", "0 1e1": "uint8", "0 inf": "float64"},
    }.items():
        assert read_grid(saved(tmp_path, f"2 1 1\n1\nv\n{numbers}\n")).values["v"].dtype == dtype, numbers


def test_a_file_of_sgems_byte_by_byte(tmp_path):
    content = (
        b"\xb2\x11\x17\x5d\x00\x00\x00\x06Cgrid\x00\x00\x00\x00\x05grid\x00\x00\x00\x00\x64"
        b"\x00\x00\x00\x02\x00\x00\x00\x01\x00\x00\x00\x01"  # 2 x 1 x 1 cells
        b"\x41\x20\x00\x00\x3f\x80\x00\x00\x3f\x00\x00\x00"  # of 10 x 1 x 0.5
        b"\x40\xa0\x00\x00\x00\x00\x00\x00\xbf\x80\x00\x00"  # from 5, 0, -1
        b"\x00\x00\x00\x02\x00\x00\x00\x02a\x00\x00\x00\x00\x02b\x00"
        b"\x3f\xc0\x00\x00\xcb\x18\x14\x6b"  # a: 1.5, unknown
        b"\x40\x00\x00\x00\x40\x40\x00\x00"  # b: 2, 3
    )
    with pytest.warns(DataWarning):
        grid = read_grid(saved(tmp_path, content, "hand.sgems"))
    assert (grid.origin, grid.cell) == ((5, 0, -1), (10, 1, 0.5))
    assert np.array_equal(grid.values["a"], [[[1.5, NAN]]], equal_nan=True) and grid.values["a"].dtype == np.float32
    assert grid.values["b"].tolist() == [[[2, 3]]] and grid.values["b"].dtype == np.uint8
    made = tmp_path / "made.SGEMS"
    write_grid(made, grid.values, origin=grid.origin, cell=grid.cell)
    assert made.read_bytes() == content


def test_decimals_of_sgems_are_the_shortest_and_its_regions_are_passed_over(tmp_path):
    regions = word(b"RegionBlock") + b"\0\0\0\1" + word(b"r") + b"\1" * 6
    grid = read_grid(saved(tmp_path, by_hand(range(6)) + regions))
    assert (grid.origin, grid.cell, grid.values["v"].max()) == ((5, -7.5, 0.3), (10, 20, 0.1), 5)


def test_a_text_byte_by_byte(tmp_path):
    values = {"por": np.array([[0.1, NAN], [1e-9, 2.0]]), "facies": np.array([[1, 2], [3, 4]], np.int16)}
    write_grid(tmp_path / "a.gslib", values, origin=(0.1, 1000.7), cell=(0.1, 25))
    text = "2 2 1 0.1 25.0 1.0 0.05 988.2 -0.5\n2\npor\nfacies\n0.1 1\n-9966699 2\n1e-09 3\n2.0 4\n"
    assert (tmp_path / "a.gslib").read_text() == text
    with pytest.warns(DataWarning):
        assert read_grid(tmp_path / "a.gslib").origin == (0.1, 1000.7, 0)


@given(
    kind=st.sampled_from(["bool", "uint8", "int16", "int32", "float32", "float64"]),
    sides=st.tuples(*[st.integers(1, 3)] * 3),
    numbers=st.lists(st.floats(0, 1), min_size=27, max_size=27),
    origin=st.tuples(*[st.decimals(-9999, 9999, places=2).map(float)] * 3),
    cell=st.tuples(*[st.decimals(1, 99, places=2).map(float)] * 3),
    suffix=st.sampled_from([".gslib", ".sgems"]),
)
def test_what_is_written_is_read(tmp_path_factory, kind, sides, numbers, origin, cell, suffix):
    path = tmp_path_factory.getbasetemp() / f"any{suffix}"
    values = np.array(numbers[: np.prod(sides)]).reshape(sides[::-1])
    values = values.astype(kind) if kind[0] == "f" else (values * 100).astype(kind)
    hidden = values == values.flat[0]
    write_grid(path, {"v0": values, "v1": np.ma.MaskedArray(values, hidden)}, origin=origin, cell=cell)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        grid = read_grid(path)
    assert grid.cell == cell and np.allclose(grid.origin, origin, rtol=1e-6 * (suffix == ".sgems"), atol=0)
    exact = np.float32 if suffix == ".sgems" else values.dtype
    assert np.array_equal(grid.values["v0"].astype(exact), values.astype(exact))
    assert np.array_equal(np.isnan(grid.values["v1"]), hidden)


@pytest.mark.parametrize("suffix", [".gslib", ".sgems"])
def test_a_file_that_is_cut_short_at_any_byte_is_refused(tmp_path, suffix):
    path = tmp_path / f"whole{suffix}"
    write_grid(path, {"porosity": np.arange(6).reshape(2, 3) + 10.25, "facies": np.arange(6).reshape(2, 3) + 10})
    content = path.read_bytes()
    for length in range(len(content)):
        with pytest.raises(ValueError, match="cut"):
            read_grid(saved(tmp_path, content[:length], f"cut{suffix}"))


def test_a_file_is_told_by_its_first_lines(tmp_path):
    for text, kind in {
        **{"wells\n3\nX\nY\nv\n1 2 3\n": "points", "1 2 3\n4 5 6\n": None, "x y a b\n5 6 7 8\n1 2 3 4\n": None},
        **{"x,y,v\n1,2,3\n": None, "": None, "5 5 1\n1\nv\n": "grid", "t\n1 5 5 1\nv\n": "grid"},
        **{"t\n1 5 5 1\na name of four\n": "grid", "a (5x5x1)\n1\nv\n": "grid", "a\nfacies\n1\n": None},
        **{"wells\n3 columns\nX\n": "points", "id well x y\n1 A-1 5 6\n2 A-2 7 8\n": None},
        **{"# NX 5\n# NY 5\n": "grid", "# x y v\n1 2 3\n": None, "\x89PNG\n": None},
    }.items():
        assert kind_of(saved(tmp_path, text, "a.txt")) == kind, text
    assert kind_of(tmp_path) is None and kind_of(tmp_path / "none") is None
    assert kind_of(saved(tmp_path, by_hand(range(6)), "any")) == "grid"


GOOD = {"v": np.ones((2, 3))}
ARGUMENTS = [
    ("a.png", GOOD, {}, ValueError, "names no format of grids: end its name in one of .gslib, .sg"),
    ("none/a.gslib", GOOD, {}, ValueError, "does not exist: create it"),
    ("a.gslib", {}, {}, ValueError, "have the shapes"),
    ("a.gslib", GOOD | {"w": np.ones((3, 2))}, {}, ValueError, "have the shapes"),
    ("a.gslib", {"v": np.ones(3)}, {}, ValueError, r"give \(nz, ny, nx\) or \(ny, nx\)"),
    ("a.gslib", {"v": np.ones((2, 3), complex)}, {}, TypeError, "holds complex128 values"),
    ("a.gslib", {"v\nw": np.ones((2, 3))}, {}, ValueError, "has the name"),
    ("a.sgems", {" ": np.ones((2, 3))}, {}, ValueError, "has the name"),
    ("a.gslib", {"v": np.array([[-999, 0]])}, {}, ValueError, "cannot hold -999, which is a code"),
    ("a.sgems", {"v": np.full((2, 3), 2**24 + 1)}, {}, ValueError, "end its name in .gslib"),
    ("a.sgems", {"v": np.full((2, 3), 1e39)}, {}, ValueError, "cannot hold 1e.39, .* 32-bit floats"),
    ("a.sgems", GOOD, {"origin": (4.5e6 + 0.3, 0)}, ValueError, "x = 4500000.3 .* end its name in .gslib"),
    ("a.gslib", GOOD, {"origin": (1, 2, 3, 4)}, ValueError, "origin is .*; give"),
    ("a.gslib", GOOD, {"origin": (1, 2, 3), "cell": (1, 2)}, ValueError, "origin has 3 .* cell 2"),
    ("a.gslib", GOOD, {"cell": 5}, ValueError, "cell is 5; give"),
    ("a.gslib", GOOD, {"cell": "ab"}, ValueError, "cell is 'ab'; give"),
    ("a.gslib", GOOD, {"origin": (1e31, 0)}, ValueError, "numbers below 1e.30"),
    ("a.gslib", GOOD, {"cell": (1, 1e-31)}, ValueError, "above 0, from 1e-30 on"),
    ("a.tif", {"v": np.zeros((2, 3, 4))}, {}, ValueError, "is a GeoTIFF, which has no layers"),
]


def test_what_cannot_be_written_is_refused_and_nothing_is_left(tmp_path):
    for name, values, lies, error, words in ARGUMENTS:
        with pytest.raises(error, match=words) as said:
            write_grid(tmp_path / name, values, **lies)
        assert "\n" not in str(said.value) and list(tmp_path.iterdir()) == []
    assert check_grid(tmp_path / "a.sgems", [], None, (2, 3, 4)) == ((0, 0, 0), (2, 3, 4))
    assert check_grid(tmp_path / "a.gslib", [np.array([1e39, NAN])], (4.5e6 + 0.3, 0), None)


# -- Rasters of GDAL keep their no-data and georeference; NetCDF files are read by the names of their axes.

CRS = "EPSG:32633"
WHERE = from_origin(5000, 9000, 10, 20)
"""The north-western corner, and the sizes of a pixel."""

ROWS, COLS = 12, 16


def terrain(dtype="float32"):
    """A smooth surface of 200 to 250, unknown in a corner."""
    y, x = np.mgrid[:ROWS, :COLS]
    heights = (225 + 25 * np.sin(x / 3) * np.cos(y / 4)).astype(dtype)
    heights[:2, :3] = -9999
    return heights


def saved_rasters(path, bands, nodata=-9999, **more):
    bands = bands if bands.ndim == 3 else bands[None]
    about = {"count": len(bands), "height": bands.shape[1], "width": bands.shape[2], "dtype": bands.dtype}
    about |= {"crs": CRS, "transform": WHERE, "nodata": nodata} | more
    with rasterio.open(path, "w", driver="GTiff", **about) as raster:
        raster.write(bands)
    return path


def run(*words):
    words = *words, "--seed", "1", "--device", "reference", "--order", "2", "--levels", "1"
    return CliRunner().invoke(main, [*map(str, words)])


@pytest.mark.parametrize("dtype", ["float32", "int16"])
def test_the_no_data_of_a_raster_is_unknown(tmp_path, dtype):
    """The second row of each pair is that of the south, and an unknown value is none of the sample."""
    path, heights = saved_rasters(tmp_path / "dem.tif", terrain(dtype)), terrain(dtype)
    found = image.read(path)
    unknown = np.isnan(found.pixels) if dtype[0] == "f" else np.ma.getmaskarray(found.pixels)
    assert np.array_equal(unknown, heights == -9999) and found.pixels.dtype == dtype
    assert np.array_equal(found.pixels[~unknown], heights[~unknown])
    assert found.metadata.geo.transform == tuple(WHERE)[:6] and found.metadata.geo.nodata == -9999
    grid = read_grid(path)
    assert np.array_equal(grid.values["band 1"][0], np.where(heights == -9999, NAN, heights)[::-1], equal_nan=True)
    assert (grid.origin, grid.cell) == ((5005, 9000 - 20 * ROWS + 10, 0), (10, 20, 1)) and "UTM zone 33N" in grid.crs
    made = run("synth", path, "-o", tmp_path / "more.tif", "--size", "8x8")
    again = image.read(tmp_path / "more.tif")
    assert made.exit_code == 0 and again.pixels.min() >= 200 and again.metadata.geo is None, made.output


def test_other_rasters_of_gdal(tmp_path):
    heights = terrain()
    text = "ncols 16\nnrows 12\nxllcorner 5000\nyllcorner 8760\ndx 10\ndy 20\nNODATA_value -9999\n"
    text += "\n".join(" ".join(f"{h:.9g}" for h in row) for row in heights) + "\n"
    path = saved(tmp_path, text, "dem.asc")
    grid = read_grid(path)
    assert np.array_equal(grid.values["band 1"][0], np.where(heights < 0, NAN, heights)[::-1], equal_nan=True)
    assert grid.origin == (5005, 8770, 0) and is_grid(path) and not is_grid(path, rasters=False)
    assert np.array_equal(image.read(path).pixels, np.where(heights < 0, NAN, heights), equal_nan=True)
    turned = saved_rasters(tmp_path / "turned.tif", heights, transform=WHERE @ rasterio.Affine.rotation(30))
    vrt = saved(tmp_path, "<VRTDataset rasterXSize='4' rasterYSize='4'/>", "a.asc")
    for wrong, words in (
        (path, r"dem\.asc.* has 2.* bytes and no more than 792"),
        (turned, r"turned\.tif has rows that are not parallel to the x axis: warp it"),
        (vrt, r"a\.asc cannot be read as a grid"),
    ):
        with pytest.raises(ValueError, match=words):
            read_grid(wrong, max_pixels=99 if wrong == path else None)


@pytest.mark.parametrize(("output", "source"), [("many.nc", True), ("many.tif", False)])
def test_wells_and_realisations_lie_in_the_coordinates_of_a_raster(tmp_path, output, source):
    """The data are at rows counted from the south, where the file counts from the north; GDAL places the variable."""
    path, heights = saved_rasters(tmp_path / "dem.tif", terrain()), terrain()
    rows, cols = np.array([5, 10, 3]), np.array([14, 1, 7])
    wells = "".join(
        f"A{r},{9000 - 20 * (r + 0.5)},{5000 + 10 * (c + 0.5)},{float(heights[r, c])!r}\n"
        for r, c in zip(rows, cols, strict=True)
    )
    known = saved(tmp_path, f"well,Northing,Easting,height\n{wells}B,1,1,250\n", "wells.csv")
    words = ["simulate", path, "-o", tmp_path / output, "--known", known, "--outside", "skip"]
    made = run(*words, *(["--source"] * source))
    assert made.exit_code == 0, made.output
    assert "1 of 4 data are outside of the grid and are left out" in made.output
    assert "left out, because they hold text: the columns well" in made.output
    if output == "many.tif":
        with rasterio.open(tmp_path / output) as raster:
            found = raster.read(1)[rows, cols]
            assert raster.crs == CRS and raster.transform == WHERE and raster.descriptions == ("simulation__real0",)
    else:
        with xarray.open_dataset(tmp_path / output, decode_coords="all") as many:
            found = many.simulation[0].values[::-1][rows, cols]
            assert "UTM zone 33N" in many.spatial_ref.crs_wkt
            assert [many[axis].attrs["standard_name"] for axis in "xy"] == [f"projection_{a}_coordinate" for a in "xy"]
            assert many.x.attrs["units"] == "m" and many.y.values[[0, -1]].tolist() == [8770, 8990]
        with rasterio.open(f'NETCDF:"{tmp_path / output}":simulation') as raster:
            assert raster.crs == CRS and raster.transform.almost_equals(WHERE)
    assert np.array_equal(found, heights[rows, cols])
    refused = run(*words[:3], tmp_path / "other.nc", *words[4:6])
    assert refused.exit_code == 2 and "outside of a picture" in refused.output and "--outside skip" in refused.output


def test_a_grid_is_written_as_a_geotiff(tmp_path):
    values = np.ma.MaskedArray(np.arange(6, dtype=np.uint8).reshape(2, 3), [[0, 0, 0], [0, 1, 0]])
    write_grid(tmp_path / "a.tif", {"facies": values, "b": values}, origin=(10, 20), cell=(2, 4), crs=CRS)
    with rasterio.open(tmp_path / "a.tif") as raster:
        assert raster.read(1).tolist() == [[3, -9999, 5], [0, 1, 2]] and raster.nodata == -9999
        assert raster.transform == from_origin(9, 26, 2, 4) and raster.descriptions == ("facies", "b")
    grid = read_grid(tmp_path / "a.tif", variables=["b"])
    assert np.array_equal(grid.values["b"][0], values.astype(float).filled(NAN), equal_nan=True)
    assert (grid.origin, grid.cell) == ((10, 20, 0), (2, 4, 1))


@pytest.mark.parametrize("form", ["NETCDF4", "NETCDF3_64BIT"])
def test_netcdf_is_read_by_the_names_of_its_axes(tmp_path, form):
    """Temperatures from the north to the south, at two times, with an unknown one, and a field without time."""
    tas = np.random.default_rng(1).integers(250, 300, (2, 12, 10)).astype(np.float32)
    tas[0, 0, 1] = NAN
    coords = {"lat": ("lat", np.linspace(50, 39, 12), {"units": "degrees_north"}), "time": [0, 1]}
    coords["lon"] = ("lon", np.linspace(3, 12, 10), {"units": "degrees_east"})
    fields = {"tas": (("time", "lat", "lon"), tas), "oro": (("lon", "lat"), tas[1].T * 2), "n": ("time", [1, 2])}
    path, engine = tmp_path / "a.nc", "scipy" if "3" in form else "h5netcdf"
    xarray.Dataset(fields, coords).to_netcdf(path, engine=engine, format=form)
    grid = read_grid(path)
    assert sorted(grid.values) == ["oro", "tas[0]", "tas[1]"] and is_grid(path, rasters=False)
    for name, wanted in (("tas[0]", tas[0]), ("tas[1]", tas[1]), ("oro", 2 * tas[1])):
        assert np.array_equal(grid.values[name][0], wanted[::-1], equal_nan=True), "in ascending order of latitude"
    assert (grid.origin, grid.cell) == ((3, 39, 0), (1, 1, 1))
    made = run("simulate", path, "-o", tmp_path / "b.npz")
    assert made.exit_code == 2 and "steps of time or another axis: choose one, as --variables 'tas[0]'" in made.output
    made = run("simulate", path, "-o", tmp_path / "b.npz", "--variables", "tas[1]", "--finish", "0")
    assert made.exit_code == 0, made.output
    with np.load(tmp_path / "b.npz") as many:
        assert many["y"].tolist() == np.arange(39.0, 51).tolist() and set(many["values"].flat) <= set(tas[1].flat)


@pytest.mark.parametrize(("command", "suffix"), [("simulate", ".zarr"), ("estimate", ".nc")])
def test_names_and_units_of_netcdf_are_kept(tmp_path, command, suffix):
    """Of the variable and of each axis, by the command and in Python, for realisations and estimates."""
    depth = {"units": "m", "positive": "down", "long_name": "depth below sea level", "axis": "Z"}
    coords = {"depth": ("depth", [10.0, 12, 14, 16], depth)}
    for axis, n in (("northing", 9), ("easting", 10)):
        coords[axis] = (axis, 5.0 * np.arange(n), {"units": "km", "long_name": axis})
    values = np.random.default_rng(2).integers(0, 2, (4, 9, 10)).astype(np.float32)
    about = {"units": "1", "long_name": "porosity"}
    rock = xarray.DataArray(values, coords, ("depth", "northing", "easting"), "por", about)
    rock.to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    out, words = tmp_path / f"out{suffix}", [command, tmp_path / "a.nc", "-o", tmp_path / f"out{suffix}"]
    if command == "simulate":
        made = run(*words)
    else:
        words += ["--known", saved(tmp_path, "x,y,z,por\n5,5,12,1\n", "wells.csv"), "--device", "reference"]
        made = CliRunner().invoke(main, [*map(str, words)])
    assert made.exit_code == 0, made.output
    with xarray.open_dataset(out, engine="zarr" if suffix == ".zarr" else "h5netcdf") as found:
        assert found.z.attrs == {name: text for name, text in depth.items() if name != "axis"}
        assert found.x.attrs == {"units": "km", "long_name": "easting"} and found.y.units == "km"
        assert found.x.values.tolist() == rock.easting.values.tolist()
        told = found.simulation.attrs if command == "simulate" else found["mean"].attrs
        assert told["units"] == "1" and (command == "estimate" or told["long_name"] == "porosity")
    if command == "simulate":
        made = simulate(rock[0].rename(northing="lat"), 1, origin=(0, 0), cell=(5, 5), finish=0, order=1, levels=1)
        assert (made.x.attrs, made.y.units, made.units) == ({"units": "km", "long_name": "easting"}, "km", "1")


def test_hdf5_without_names_of_axes_is_read_by_position(tmp_path):
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["rock"] = np.arange(24).reshape(2, 3, 4)
    assert read_grid(tmp_path / "a.h5").values["rock"].tolist() == np.arange(24).reshape(2, 3, 4).tolist()


# -- Realisations go to files by xarray's own writers, and are read by xarray and NumPy alone; nothing is half written.

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


def test_a_grid_is_read_from_netcdf(tmp_path):
    path, dims = tmp_path / "grid.nc", ("z", "y", "x")
    values = np.arange(60, dtype=np.int16).reshape(3, 5, 4)
    coords = {"x": np.arange(4) * 10.0 + 105, "y": np.arange(5) * 20.0 + 7, "z": np.arange(3) - 9.5}
    variables = {"rock": (dims, values), "other": ("x", np.zeros(4)), "b": (dims[::-1], values.T / 2)}
    xarray.Dataset(variables, coords).to_netcdf(path, engine="h5netcdf")
    grid = read_grid(path)
    assert list(grid.values) == ["rock", "b"] and grid.values["rock"].dtype == np.int16
    assert np.array_equal(grid.values["rock"], values) and np.array_equal(grid.values["b"], values / 2)
    assert (grid.origin, grid.cell) == ((105, 7, -9.5), (10, 20, 1))
    with pytest.raises(ValueError, match=r"grid\.nc has 60 pixels|grid\.nc has .* bytes and no more"):
        read_grid(path, max_pixels=4)
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ValueError, match="cannot be read as a grid"):
        read_grid(path)
    for dims, words in (
        (("t",), "has no variable with the axes y and x, or z"),
        (("y", "x"), "has no even grid .*v is"),
    ):
        data = xarray.DataArray(np.zeros((3,) * len(dims)), dims=dims, name="v", coords={dims[-1]: [0, 1, 3]})
        data.to_netcdf(path, engine="h5netcdf")
        with pytest.raises(ValueError, match=words):
            read_grid(path)


POINTS = [GroundControlPoint(row, col, 10 + col / 1e3, 50 - row / 1e3) for row in (0, 9) for col in (0, 9)]
POLYNOMIALS = RPC(0, 1, 50, 0.1, [1.0] * 20, [0.5] * 20, 6, 6, 10, 0.1, [1.0] * 20, [0.5] * 20, 8, 8)
SAID = {
    "bands": ({}, {"scales": (0.1, 2.0), "offsets": (5.0, 0.0), "descriptions": ("a", "b"), "units": ("K", "m")}),
    "near infrared": ({"count": 4}, {"colorinterp": [ColorInterp[c] for c in ("red", "green", "blue", "undefined")]}),
    "points": ({"gcps": POINTS, "transform": None}, {}),
    "polynomials": ({"rpcs": POLYNOMIALS, "transform": None, "crs": None}, {}),
}


def said_of(path):
    with rasterio.open(path) as raster:
        names = ("count", "crs", "transform", "nodata", "scales", "offsets", "descriptions", "units", "colorinterp")
        points = [(point.row, point.col, point.x, point.y) for point in raster.gcps[0]]
        tags = [raster.tags(k) for k in (0, *raster.indexes)]
        rpcs = raster.rpcs and raster.rpcs.to_gdal()
        return {name: getattr(raster, name) for name in names} | {"points": points, "tags": tags, "rpcs": rpcs}


@pytest.mark.parametrize("kind", SAID)
@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_what_a_raster_says_of_itself_is_kept(tmp_path, kind):
    how, said = SAID[kind]
    values = np.random.default_rng(1).integers(1, 4000, (how.get("count", 2), ROWS, COLS)).astype(np.uint16)
    values[:, 4:6, 4:6] = 0
    path, filled, wide = (tmp_path / f"{name}.tif" for name in ("a", "b", "c"))
    about = {"count": len(values), "height": ROWS, "width": COLS, "dtype": "uint16", "nodata": 0}
    where = {name: value for name, value in ({"crs": CRS, "transform": WHERE} | how).items() if value is not None}
    with rasterio.open(path, "w", driver="GTiff", **about | where) as raster:
        for name, value in said.items():
            setattr(raster, name, value)
        raster.update_tags(sensor="S2")
        raster.update_tags(1, wavelength="490", STATISTICS_MEAN="7")
        raster.write(values)
    wanted = said_of(path)
    del wanted["tags"][1]["STATISTICS_MEAN"]  # of other values
    for words in (("fill", path, "-o", filled), ("extend", filled, "-o", wide, "--left", "3", "--top", "2")):
        made = run(*words)
        assert made.exit_code == 0, made.output
    pixels = np.moveaxis(image.read(filled).pixels, -1, 0)
    assert said_of(filled) == wanted and (pixels > 0).all() and np.array_equal(pixels[values > 0], values[values > 0])
    moved, a = said_of(wide), wanted["transform"]
    assert moved["transform"] == (a if a.is_identity else a * a.translation(-3, -2))
    assert moved["points"] == [(row + 2, col + 3, x, y) for row, col, x, y in wanted["points"]]
    if kind == "polynomials":
        assert (moved["rpcs"]["LINE_OFF"], moved["rpcs"]["SAMP_OFF"]) == ("8.0", "11.0")
    made = run("classify", filled, "--texture", f"a={filled}", "--texture", f"b={wide}", "-o", tmp_path / "labels.tif")
    assert made.exit_code == 0, made.output
    labels = said_of(tmp_path / "labels.tif")
    assert all(labels[name] == wanted[name] for name in ("crs", "transform", "points"))
    refused = run("fill", path, "-o", tmp_path / "b.png")
    assert refused.exit_code == 2 and "alpha: end its name in .tif" in refused.output
    if kind == "bands":
        grid = read_grid(path)
        known = np.where(values > 0, values, np.nan)[:, None, ::-1]
        assert np.array_equal(grid.values["a"], known[0] * 0.1 + 5, equal_nan=True)
        assert np.array_equal(grid.values["b"], known[1] * 2, equal_nan=True)
        made = run("fill", path, "-o", tmp_path / "out.npy")
        assert "out.npy holds no georeference; end its name in .tif to keep it" in made.output


FIELD = np.arange(20.0).reshape(4, 5)
NORTH, EAST = {"units": "degrees_north"}, {"units": "degrees_east"}
EACH = {"lat": (("y", "x"), FIELD, NORTH), "lon": (("y", "x"), FIELD, EAST)}
PACKED = {"dtype": "int16", "_FillValue": -99, "scale_factor": 0.5, "add_offset": 10.0}
LAMBERT = {"grid_mapping_name": "lambert_conformal_conic", "standard_parallel": 25.0}


@pytest.mark.parametrize(
    "dims, coordinates, attributes, encoding, cell, known, told",
    [
        (("y", "x"), {"y": 1e3 * np.arange(4), "x": 2e3 * np.arange(5)} | EACH, {}, {}, (2e3, 1e3), 20, None),
        (("lat", "lon"), {"lat": 60 + np.arange(4) / 2400, "lon": 170 + np.arange(5) / 2400}, {}, {}, None, 20, None),
        (("south_north", "west_east"), {}, {}, {}, (1, 1), 20, "counts cells"),
        (("j", "i"), {}, {"valid_range": np.array([5.0, 17.0])}, {}, (1, 1), 13, "counts cells"),
        (("y", "x"), {}, {"valid_range": np.array([-20, 0], "i2")}, PACKED, (1, 1), 11, None),
        (("y", "x"), {}, {"valid_max": np.float32(4)}, PACKED, (1, 1), 5, None),
        (("y", "x"), {"crs": ((), 0, LAMBERT)}, {"grid_mapping": "crs"}, {}, (1, 1), 20, None),
    ],
)
def test_netcdf_as_models_write_it(tmp_path, dims, coordinates, attributes, encoding, cell, known, told):
    single = {name: at.astype(np.float32) if isinstance(at, np.ndarray) else at for name, at in coordinates.items()}
    data = xarray.Dataset({"odd": (("northing", "easting"), FIELD), "v": (dims, FIELD, attributes)})
    single["easting"] = np.arange(5.0) ** 2
    data.assign_coords(single).to_netcdf(tmp_path / "a.nc", engine="h5netcdf", encoding={"v": encoding})
    with pytest.warns(DataWarning, match=told or "odd is left out, since the coordinate x is not evenly spaced"):
        grid = read_grid(tmp_path / "a.nc")
    assert grid.values["v"].shape == (1, 4, 5) and np.isfinite(grid.values["v"]).sum() == known
    assert grid.cell[:2] == (cell or pytest.approx((1 / 2400, 1 / 2400), rel=5e-2))
    assert ("Lambert" in grid.crs) == ("crs" in coordinates) and "units" not in grid.about.get("y", {})


@pytest.mark.parametrize("words", [("synth", "--size", "8x8"), ("tile", "--band", "2"), ("extend", "--left", "2")])
def test_labels_are_not_written_as_jpeg(tmp_path, words):
    labels = np.random.default_rng(0).integers(0, 3, (16, 16)).astype(np.uint8)
    image.write(tmp_path / "a.png", labels)
    made = run(words[0], tmp_path / "a.png", "-o", tmp_path / "b.jpg", *words[1:], "--categorical")
    assert made.exit_code == 2 and "JPEG changes labels and categories: end its name in .png" in made.output

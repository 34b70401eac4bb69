"""Rasters of GDAL keep their no-data and georeference; NetCDF files are read by the names of their axes."""

import os
import warnings

import numpy as np
import pytest
import rasterio
import xarray
from click.testing import CliRunner
from rasterio.transform import from_origin

from simdtex.cli import main
from simdtex.io import image
from simdtex.io.grids import is_grid, read_grid, write_grid

NAN = float("nan")
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


def saved(path, bands, nodata=-9999, **more):
    bands = bands if bands.ndim == 3 else bands[None]
    about = {"count": len(bands), "height": bands.shape[1], "width": bands.shape[2], "dtype": bands.dtype}
    about |= {"crs": CRS, "transform": WHERE, "nodata": nodata} | more
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(path, "w", driver="GTiff", **about) as raster:
            raster.write(bands)
    return path


def run(*words):
    return CliRunner().invoke(
        main, [*map(str, words), "--seed", "1", "--device", "reference", "--order", "2", "--levels", "1"]
    )


@pytest.mark.parametrize("dtype", ["float32", "int16", "float64"])
def test_the_no_data_of_a_raster_is_unknown(tmp_path, dtype):
    """The second row of each pair is that of the south, and an unknown value is none of the sample."""
    path, heights = saved(tmp_path / "dem.tif", terrain(dtype)), terrain(dtype)
    found = image.read(path)
    unknown = np.isnan(found.pixels) if dtype[0] == "f" else np.ma.getmaskarray(found.pixels)
    assert np.array_equal(unknown, heights == -9999) and found.pixels.dtype == dtype
    assert np.array_equal(found.pixels[~unknown], heights[~unknown])
    assert found.metadata.geo.transform == tuple(WHERE)[:6] and found.metadata.geo.nodata == -9999
    grid = read_grid(path)
    assert np.array_equal(grid.values["band 1"][0], np.where(heights == -9999, NAN, heights)[::-1], equal_nan=True)
    assert (grid.origin, grid.cell) == ((5005, 9000 - 20 * ROWS + 10, 0), (10, 20, 1)) and "UTM zone 33N" in grid.crs
    made = run("synth", path, "-o", tmp_path / "more.tif", "--size", "8x8")
    assert made.exit_code == 0, made.output
    again = image.read(tmp_path / "more.tif")
    assert again.pixels.min() >= 200 and again.metadata.geo is None


@pytest.mark.parametrize("dtype", ["float32", "int16"])
def test_filling_and_extending_keep_the_georeference(tmp_path, dtype):
    path, heights = saved(tmp_path / "dem.tif", terrain(dtype)), terrain(dtype)
    for words, moved in (
        (("fill", path, "-o", tmp_path / "out.tif"), (0, 0)),
        (("extend", tmp_path / "out.tif", "-o", tmp_path / "wide.tif", "--left", 3, "--top", 2, "--right", 1), (3, 2)),
    ):
        made = run(*words)
        assert made.exit_code == 0, made.output
        with rasterio.open(words[3]) as raster:
            found = raster.read(1)[moved[1] :, moved[0] :]
            assert raster.crs == CRS and raster.nodata == -9999 and raster.dtypes == (dtype,)
            assert raster.transform == from_origin(5000 - 10 * moved[0], 9000 + 20 * moved[1], 10, 20)
        found = found[:ROWS, :COLS]
        assert np.array_equal(found[heights != -9999], heights[heights != -9999]) and found.min() >= 200
    if dtype == "int16":
        made = run("fill", path, "-o", tmp_path / "out.npy")
        assert "out.npy holds no georeference; end its name in .tif to keep it" in made.output


def test_a_mask_inside_a_tiff_is_heeded(tmp_path):
    heights = np.abs(terrain()).clip(0, 255).astype(np.uint8)
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        about = {"count": 1, "height": ROWS, "width": COLS, "dtype": "uint8"}
        with rasterio.open(tmp_path / "a.tif", "w", driver="GTiff", **about) as raster:
            raster.write(heights[None])
            raster.write_mask(heights > 230)
    found = image.read(tmp_path / "a.tif").pixels
    assert np.array_equal(np.ma.getmaskarray(found), heights <= 230) and found.shape == heights.shape


def test_other_rasters_of_gdal(tmp_path):
    heights = terrain()
    text = "ncols 16\nnrows 12\nxllcorner 5000\nyllcorner 8760\ndx 10\ndy 20\nNODATA_value -9999\n"
    path = tmp_path / "dem.asc"
    path.write_text(text + "\n".join(" ".join(f"{h:.9g}" for h in row) for row in heights) + "\n")
    grid = read_grid(path)
    assert np.array_equal(grid.values["band 1"][0], np.where(heights < 0, NAN, heights)[::-1], equal_nan=True)
    assert grid.origin == (5005, 8770, 0) and is_grid(path) and not is_grid(path, rasters=False)
    assert np.array_equal(image.read(path).pixels, np.where(heights < 0, NAN, heights), equal_nan=True)
    with pytest.raises(ValueError, match=r"dem\.asc.* has 2.* bytes and no more than 792"):
        read_grid(path, max_pixels=99)
    turned = saved(tmp_path / "turned.tif", heights, transform=WHERE @ rasterio.Affine.rotation(30))
    with pytest.raises(ValueError, match=r"turned\.tif has rows that are not parallel to the x axis: warp it"):
        read_grid(turned)
    (tmp_path / "a.asc").write_text("<VRTDataset rasterXSize='4' rasterYSize='4'/>")
    with pytest.raises(ValueError, match=r"a\.asc cannot be read as a grid"):
        read_grid(tmp_path / "a.asc")


@pytest.mark.parametrize(("output", "source"), [("many.nc", False), ("many.tif", False), ("many.zarr", True)])
def test_wells_and_realisations_lie_in_the_coordinates_of_a_raster(tmp_path, output, source):
    """The data are at rows counted from the south, where the file counts from the north."""
    path, heights = saved(tmp_path / "dem.tif", terrain()), terrain()
    rows, cols = np.array([5, 10, 3]), np.array([14, 1, 7])
    (tmp_path / "wells.csv").write_text(
        "well,Northing,Easting,height\n"
        + "".join(
            f"A{r},{9000 - 20 * (r + 0.5)},{5000 + 10 * (c + 0.5)},{float(heights[r, c])!r}\n"
            for r, c in zip(rows, cols, strict=True)
        )
        + "B,1,1,250\n"
    )
    words = ["simulate", path, "-o", tmp_path / output, "--known", tmp_path / "wells.csv", "--outside", "skip"]
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
            assert many.y.values[[0, -1]].tolist() == [8770, 8990]
    assert np.array_equal(found, heights[rows, cols])
    refused = run(*words[:6])
    assert refused.exit_code == 2 and "outside of a picture" in refused.output and "--outside skip" in refused.output


def test_pictures_of_a_raster_that_is_counted_from_the_south_are_refused(tmp_path):
    path = saved(tmp_path / "dem.tif", terrain())
    image.write(tmp_path / "mask.png", np.full((ROWS, COLS), 255, np.uint8))
    for words in (("--sample-mask", tmp_path / "mask.png"), ("--guide", f"{path}={path}")):
        made = run("simulate", path, "-o", tmp_path / "a.npz", *words)
        assert made.exit_code == 2 and "is a raster, whose rows are counted from the south" in made.output
    assert sorted(os.listdir(tmp_path)) == ["dem.tif", "mask.png"]


def test_a_grid_is_written_as_a_geotiff(tmp_path):
    values = np.ma.MaskedArray(np.arange(6, dtype=np.uint8).reshape(2, 3), [[0, 0, 0], [0, 1, 0]])
    write_grid(tmp_path / "a.tif", {"facies": values, "b": values}, origin=(10, 20), cell=(2, 4), crs=CRS)
    with rasterio.open(tmp_path / "a.tif") as raster:
        assert raster.read(1).tolist() == [[3, -9999, 5], [0, 1, 2]] and raster.nodata == -9999
        assert raster.transform == from_origin(9, 26, 2, 4) and raster.descriptions == ("facies", "b")
    grid = read_grid(tmp_path / "a.tif", variables=["b"])
    assert np.array_equal(grid.values["b"][0], values.astype(float).filled(NAN), equal_nan=True)
    assert (grid.origin, grid.cell) == ((10, 20, 0), (2, 4, 1))
    with pytest.raises(ValueError, match="is a GeoTIFF, which has no layers"):
        write_grid(tmp_path / "b.tif", {"v": np.zeros((2, 3, 4))})
    assert os.listdir(tmp_path) == ["a.tif"]


def weather():
    """Temperatures from the north to the south, at two times, with an unknown one, and a field without time."""
    rng = np.random.default_rng(1)
    tas = rng.integers(250, 300, (2, 12, 10)).astype(np.float32)
    tas[0, 0, 1] = NAN
    coords = {"lat": ("lat", np.linspace(50, 39, 12), {"units": "degrees_north"}), "time": [0, 1]}
    coords["lon"] = ("lon", np.linspace(3, 12, 10), {"units": "degrees_east"})
    fields = {"tas": (("time", "lat", "lon"), tas), "oro": (("lon", "lat"), tas[1].T * 2), "n": ("time", [1, 2])}
    return xarray.Dataset(fields, coords), tas


@pytest.mark.parametrize("form", ["NETCDF4", "NETCDF3_64BIT"])
def test_netcdf_is_read_by_the_names_of_its_axes(tmp_path, form):
    data, tas = weather()
    data.to_netcdf(tmp_path / "a.nc", engine="scipy" if "3" in form else "h5netcdf", format=form)
    grid = read_grid(tmp_path / "a.nc")
    assert sorted(grid.values) == ["oro", "tas[0]", "tas[1]"] and is_grid(tmp_path / "a.nc", rasters=False)
    for name, wanted in (("tas[0]", tas[0]), ("tas[1]", tas[1]), ("oro", 2 * tas[1])):
        assert np.array_equal(grid.values[name][0], wanted[::-1], equal_nan=True), "in ascending order of latitude"
    assert (grid.origin, grid.cell) == ((3, 39, 0), (1, 1, 1))
    made = run("simulate", tmp_path / "a.nc", "-o", tmp_path / "b.npz")
    assert made.exit_code == 2 and "steps of time or another axis: choose one, as --variables 'tas[0]'" in made.output
    made = run("simulate", tmp_path / "a.nc", "-o", tmp_path / "b.npz", "--variables", "tas[1]", "--finish", "0")
    assert made.exit_code == 0, made.output
    with np.load(tmp_path / "b.npz") as many:
        assert many["y"].tolist() == np.arange(39.0, 51).tolist() and set(many["values"].flat) <= set(tas[1].flat)


def test_hdf5_without_names_of_axes_is_read_by_position(tmp_path):
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["rock"] = np.arange(24).reshape(2, 3, 4)
    grid = read_grid(tmp_path / "a.h5")
    assert grid.values["rock"].tolist() == np.arange(24).reshape(2, 3, 4).tolist()

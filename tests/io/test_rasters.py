"""Rasters of GDAL keep their no-data and georeference; NetCDF files are read by the names of their axes."""

import numpy as np
import pytest
import rasterio
import xarray
from click.testing import CliRunner
from rasterio.control import GroundControlPoint
from rasterio.enums import ColorInterp
from rasterio.rpc import RPC
from rasterio.transform import from_origin
from volumes import saved

from simdtex import simulate
from simdtex.commands import main
from simdtex.io import image
from simdtex.io.grids import is_grid, read_grid, write_grid
from simdtex.options import DataWarning

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

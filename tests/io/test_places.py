"""Where the cells of an output lie, and which way is up: each kind of file as each input and output."""

from pathlib import Path

import numpy as np
import pytest
from commands import run

import simdtex
from simdtex.io import image
from simdtex.io.grids import read_grid, write_grid
from simdtex.io.hard_data import HardData
from simdtex.io.places import ascending, located

xarray = pytest.importorskip("xarray")
rasterio = pytest.importorskip("rasterio")

PLACE = {"origin": (300000.0, 5000000.0), "cell": (8.0, 4.0)}
CRS = "EPSG:32632"
ROWS, COLS = 14, 18
TRUTH = ((np.arange(ROWS)[:, None] * 2 + np.arange(COLS)) // 4 % 3 == 0).astype(np.uint8)  # row 0 is the smallest y
KNOWN = np.where(np.random.default_rng(3).random(TRUTH.shape) < 0.8, TRUTH.astype(np.float32), np.nan)
SIMULATED = ("--order", 2, "--levels", 1, "--seed", 5, "--device", "reference", "--categorical")
OPTIONS = {"order": 2, "levels": 1, "rng": 5, "device": "reference", "categorical": True}


def raster(name, values, south=False):
    """Write a raster, with the southern edge in its first row if ``south``."""
    about = {"height": ROWS, "width": COLS, "count": 1, "dtype": values.dtype.name}
    north = rasterio.Affine(8, 0, 299996, 0, -4, 5000000 + 4 * ROWS - 2)
    about["transform"] = north if not south else rasterio.Affine(8, 0, 299996, 0, 4, 4999998)
    about["nodata"] = -9999 if values.dtype.kind == "f" else None
    with rasterio.open(name, "w", driver="GTiff", crs=CRS, **about) as file:
        file.write(values if south else values[::-1], 1)


def netcdf(name, values):
    """Write a NetCDF whose first row is the northern edge."""
    y = PLACE["origin"][1] + PLACE["cell"][1] * np.arange(ROWS)[::-1]
    x = PLACE["origin"][0] + PLACE["cell"][0] * np.arange(COLS)
    array = xarray.DataArray(values[::-1], {"y": ("y", y, {"units": "m"}), "x": ("x", x, {"units": "m"})}, ("y", "x"))
    array.to_dataset(name="v").to_netcdf(name, engine="h5netcdf")


def picture(name, values):
    """Write a picture, which is transparent where values are NaN."""
    known = ~np.isnan(values)
    alpha = [] if known.all() else [np.where(known, 255, 0)]
    image.write(name, np.stack([np.where(known, values, 0), *alpha], -1).astype(np.uint8)[::-1])


def plain(name, values):
    image.write(name, values[::-1])


def grid(name, values):
    write_grid(name, {"v": values}, **({} if name.startswith("bare") else PLACE))


def table(name, values):
    """Write a table of the known values."""
    rows, cols = np.nonzero(~np.isnan(values))
    if name == "rows.csv":
        points, head = [ROWS - 1 - rows, cols], "row,column,v"
    else:
        points, head = [PLACE["origin"][0] + 8 * cols, PLACE["origin"][1] + 4 * rows], "x,y,v"
    np.savetxt(name, np.stack([*points, values[rows, cols]], -1), "%.12g", ",", header=head, comments="")


PLACED = {
    "a.gslib": grid,
    "a.sgems": grid,
    "a.tif": raster,
    "south.tif": lambda name, v: raster(name, v, True),
    "a.nc": netcdf,
}
FILES = {"a.png": picture, "plain.tif": plain, "a.npy": np.save, "bare.gslib": grid} | PLACED


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("ti.npy", TRUTH)
    return tmp_path


@pytest.mark.parametrize("flag", ["", "--known", "--region", "--rotation", "--guide"])
def test_an_input_is_the_same_in_every_file(flag, monkeypatch):
    """The plan gets the same array, and the place of the file, from each."""
    plans = []
    monkeypatch.setattr("simdtex.jobs.simulation.job.plan_simulation", lambda cells, *_, **__: plans.append(cells))
    values = TRUTH * np.uint8(255 if flag == "--region" else 1) if flag != "--known" else KNOWN
    for name in [*FILES, *["wells.csv", "rows.csv"] * (flag == "--known")]:
        FILES.get(name, table)(name, values)
        words = [flag, f"ti.npy={name}" if flag == "--guide" else name, "--size", f"{COLS}x{ROWS}"]
        words += ["--origin", "300000,5000000", "--cell", "8,4"] * name.endswith(".csv")
        run("simulate", *(["ti.npy", *words] if flag else [name]), "-o", "out.npz", *SIMULATED)
        cells = plans.pop()
        found = cells.given[flag[2:]] if flag else cells.training.pixels[0][..., 0]
        if isinstance(found, HardData):
            found = cells.put(found, TRUTH.shape, np.float32).filled(np.nan)
        found = np.ma.asarray(found[1] if flag == "--guide" else found).astype(float).filled(np.nan)
        assert np.array_equal(found, KNOWN if flag == "--known" else TRUTH, equal_nan=True), name
        there = name in PLACED or name.endswith(".csv")
        assert (cells.place.frame.origin[:2] if cells.place else (0, 0)) == (PLACE["origin"] if there else (0, 0)), name


def test_a_mask_of_a_raster_is_a_picture():
    """Of a map of row and column, only values of the white rows are taken."""
    rows = np.arange(ROWS, dtype=np.uint8)[:, None] * np.ones((1, COLS), np.uint8)
    raster("ti.tif", rows)
    plain("mask.png", (rows > 4).astype(np.uint8) * np.uint8(255))
    assert run("simulate", "ti.tif", "--sample-mask", "mask.png", "-o", "o.npz", *SIMULATED).exit_code == 0
    with np.load("o.npz") as arrays:
        assert arrays["values"].min() == 5


def test_every_output_shows_the_same_map():
    raster("known.tif", KNOWN)
    made = simdtex.simulate(TRUTH, known=KNOWN, n=1, **OPTIONS).values[0]
    for out in ("o.gslib", "o.sgems", "o.nc", "o.zarr", "o.tif"):
        assert run("simulate", "ti.npy", "--known", "known.tif", "-o", out, *SIMULATED).exit_code == 0
        if out in ("o.nc", "o.zarr"):
            with xarray.open_dataset(out) as data:
                found, x, y = data.simulation.values[0], data.x.values, data.y.values
        else:
            read = read_grid(out)
            ((found,),) = read.values.values()
            x, y = (read.origin[k] + read.cell[k] * np.arange(2) for k in (0, 1))
        assert np.array_equal(found, made) and (x[0], y[1]) == (300000, 5000004), out
    with rasterio.open("o.tif") as file:
        assert np.array_equal(file.read(1), made[::-1]) and (file.crs, file.transform[4]) == (CRS, -4)


def test_a_picture_is_made_with_the_north_at_the_top():
    """`synth` with known values of kinds of files; its own samples may be grids, too."""
    image.write("ti.png", TRUTH[::-1])
    grid("ti.gslib", TRUTH)
    there = ~np.isnan(KNOWN)[::-1]
    for sample, name in (("ti.png", "a.png"), ("ti.png", "a.nc"), ("ti.gslib", "south.tif"), ("ti.gslib", "rows.csv")):
        FILES.get(name, table)(name, KNOWN)
        words = ("synth", sample, "--known", name, "--size", f"{COLS}x{ROWS}", "--boundary", "open")
        assert run(*words, "-o", "o.tif", *SIMULATED).exit_code == 0, name
        found = image.read("o.tif")
        assert np.array_equal(found.pixels[there], KNOWN[::-1][there]), (name, sample)
        assert bool(found.metadata.geo) == (name in PLACED)
        if name in PLACED:
            assert found.metadata.geo.transform == (8, 0, 299996, 0, -4, 5000000 + 4 * ROWS - 2)
    np.save("known.npy", KNOWN)  # an array beside a grid begins with the smallest y
    for out in ("o.npy", "o.png"):
        words = ("synth", "ti.gslib", "--known", "known.npy", "--boundary", "open")
        assert run(*words, "-o", out, *SIMULATED).exit_code == 0
    assert np.array_equal(np.load("o.npy")[there[::-1]], KNOWN[there[::-1]])
    assert np.array_equal(image.read("o.png").pixels[::-1], np.load("o.npy"))


@pytest.mark.parametrize("command", [("synth", "--boundary", "open"), ("simulate",), ("estimate",)])
def test_a_table_of_a_picture_is_counted_from_the_south(command):
    image.write("ti.png", TRUTH[::-1])
    options = SIMULATED if command[0] != "estimate" else ("--device", "reference", "--categorical")
    out = "o.png" if command[0] == "synth" else "o.npz"
    for name, text, said in [
        ("xy.csv", "x,y,v\n2,3,1\n", "y points north, and y = 0 is the bottom row"),
        ("rows.csv", f"column,row,v\n2,{ROWS - 4},1\n", "rows count from the top"),
    ]:
        Path(name).write_text(text)
        done = run(*command, "ti.png", "--size", f"{COLS}x{ROWS}", "--known", name, "-o", out, *options)
        assert done.exit_code == 0 and said in done.output.splitlines()[0], done.output
        if out == "o.png":
            assert image.read(out).pixels[ROWS - 4, 2] == 1
            continue
        with np.load(out) as arrays:
            assert (arrays["values"][0] if command[0] == "simulate" else arrays["probability"][1])[3, 2] == 1


def test_like_gives_place_and_size():
    raster("like.tif", np.zeros((ROWS, COLS), np.float32))
    assert run("simulate", "ti.npy", "--like", "like.tif", "-o", "o.npz", *SIMULATED).exit_code == 0
    with np.load("o.npz") as found:
        assert found["values"].shape == (1, ROWS, COLS) and (found["x"][0], found["y"][1]) == (300000, 5000004)
        assert "UTM zone 32N" in str(found["attributes"])
    image.write("like.png", TRUTH)
    write_grid("far.gslib", {"v": TRUTH}, origin=(0, 5000000), cell=(8, 4))
    other = "--like lies at 300000, 5000000, 0 with cells of 8, 4, 1, and that of"
    for words, sentence in [
        (["--like", "like.png"], "does not say where its cells lie"),
        (["--like", "like.tif", "--size", "4x4"], "leave shape (--size) out"),
        (["--like", "like.tif", "--origin", "5,5"], other),
        (["--like", "like.tif", "--region", "far.gslib"], "--region lies at 0, 5000000, 0"),
    ]:
        done = run("simulate", "ti.npy", *words, "-o", "new.npz", *SIMULATED)
        assert done.exit_code == 2 and sentence in done.output, done.output


def test_arrays_of_xarray():
    """The place of data counts, in any order of rows and axes, and that of the training image only without."""
    y, x = 500.0 + 5 * np.arange(ROWS), 90.0 + 5 * np.arange(COLS)
    known = xarray.DataArray(KNOWN, {"lat": y, "lon": x}, ("lat", "lon"))
    training = xarray.DataArray(TRUTH, {"y": y - 500, "x": 2 * x}, ("y", "x"))
    made = simdtex.simulate(TRUTH, 1, known=KNOWN, **OPTIONS)
    for array in (known, known[::-1, ::-1].T):
        found = simdtex.simulate(training[::-1], 1, known=array, **OPTIONS)
        assert np.array_equal(found, made) and np.array_equal(found.y, y) and np.array_equal(found.x, x)
    assert np.array_equal(simdtex.simulate(training, 1, **OPTIONS).x, 2 * x)
    assert located({"known": ascending(known)}, TRUTH, (90, 500), None).frame.cell[:2] == (5, 5)
    far = known.assign_coords(spatial_ref=((), 0, {"crs_wkt": "EPSG:32632"}))
    other = (known > 5).assign_coords(spatial_ref=((), 0, {"crs_wkt": "EPSG:32633"}))
    for data, region, words in (
        (known, training > 0, "region lies at 180, 0, 0 with cells of 10, 5, 1; give one place"),
        (far, other, "known and region have different coordinate reference systems"),
    ):
        with pytest.raises(ValueError, match=words):
            simdtex.simulate(TRUTH, 1, known=data, region=region, **OPTIONS)
    assert simdtex.simulate(TRUTH, 1, known=far, **OPTIONS).x.attrs["units"] == "m"

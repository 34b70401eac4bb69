"""Where the cells of an output lie, and which way is up: each kind of file as each input and output."""

from pathlib import Path

import numpy as np
import pytest
from commands import run

import simdtex
from simdtex.io import image
from simdtex.io.grids import read_grid, write_grid
from simdtex.io.places import ascending, located

xarray = pytest.importorskip("xarray")
rasterio = pytest.importorskip("rasterio")

PLACE = {"origin": (300000.0, 5000000.0), "cell": (8.0, 4.0)}
CRS = "EPSG:32632"
ROWS, COLS = 14, 18
TRUTH = ((np.arange(ROWS)[:, None] * 2 + np.arange(COLS)) // 4 % 3 == 0).astype(np.uint8)  # row 0 is the smallest y
KNOWN = np.where(np.random.default_rng(3).random(TRUTH.shape) < 0.8, TRUTH.astype(np.float32), np.nan)
SIMULATED = ("--order", 2, "--seed", 5, "--device", "reference", "--categorical")
OPTIONS = {"order": 2, "rng": 5, "device": "reference", "categorical": True}


def raster(name, values, south=False, place=True):
    """Write a raster, with the southern edge in its first row if ``south``."""
    about = {"height": ROWS, "width": COLS, "count": 1, "dtype": values.dtype.name}
    north = rasterio.Affine(8, 0, 299996, 0, -4, 5000000 + 4 * ROWS - 2)
    about["transform"] = north if not south else rasterio.Affine(8, 0, 299996, 0, 4, 4999998)
    with rasterio.open(
        name, "w", driver="GTiff", crs=CRS, nodata=-9999 if values.dtype.kind == "f" else None, **about
    ) as file:
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


def made(*words, out="out.npz"):
    done = run(*words, "-o", out, *SIMULATED)
    assert done.exit_code == 0, done.output
    with np.load("out.npz") as arrays:
        return dict(arrays)


def test_a_training_image_is_the_same_in_every_file():
    own = made("simulate", "ti.npy")["values"]
    for name, write in FILES.items():
        write(name, TRUTH)
        found = made("simulate", name)
        assert np.array_equal(found["values"], own), name
        assert (found["x"][0], found["y"][1]) == ((300000, 5000004) if name in PLACED else (0, 1)), name


def test_known_values_are_the_same_in_every_file():
    own = simdtex.simulate(TRUTH, known=KNOWN, n=1, **OPTIONS)
    for name in (*FILES, "wells.csv", "rows.csv"):
        FILES.get(name, table)(name, KNOWN)
        lies = ["--origin", "300000,5000000", "--cell", "8,4"] * (name.endswith(".csv"))
        found = made("simulate", "ti.npy", "--known", name, "--size", f"{COLS}x{ROWS}", *lies)
        assert np.array_equal(found["values"], own), name
        assert (found["x"][0], found["y"][1]) == ((300000, 5000004) if name in PLACED or lies else (0, 1)), name


@pytest.mark.parametrize("flag", ["--region", "--rotation", "--guide"])
def test_maps_are_the_same_in_every_file(flag, monkeypatch):
    """The plan gets the same array from each file."""
    called, own = {}, TRUTH * np.uint8(255 if flag == "--region" else 1)
    planner = "simdtex.jobs.simulation.job.plan_simulation"
    monkeypatch.setattr(planner, lambda cells, *_, **__: called.update(cells.given))
    for name, write in FILES.items():
        write(name, own)
        run("simulate", "ti.npy", flag, f"ti.npy={name}" if flag == "--guide" else name, "-o", "out.npz", *SIMULATED)
        found = called.pop(flag[2:])
        assert np.array_equal(found[1] if flag == "--guide" else found, TRUTH), name


def test_a_mask_of_a_raster_is_a_picture():
    """Of a map of row and column, only values of the white rows are taken."""
    rows = np.arange(ROWS, dtype=np.uint8)[:, None] * np.ones((1, COLS), np.uint8)
    raster("ti.tif", rows)
    plain("mask.png", (rows > 4).astype(np.uint8) * np.uint8(255))
    assert made("simulate", "ti.tif", "--sample-mask", "mask.png")["values"].min() == 5


def test_every_output_shows_the_same_map():
    raster("known.tif", KNOWN)
    words = ("simulate", "ti.npy", "--known", "known.tif")
    own = made(*words)["values"][0]
    for out in ("o.gslib", "o.sgems", "o.nc", "o.zarr", "o.tif"):
        assert run(*words, "-o", out, *SIMULATED).exit_code == 0
        if out in ("o.nc", "o.zarr"):
            with xarray.open_dataset(out) as data:
                found, x, y = data.simulation.values[0], data.x.values, data.y.values
        else:
            read = read_grid(out)
            (found,), x, y = (
                next(iter(read.values.values())),
                *(read.origin[k] + read.cell[k] * np.arange(2) for k in (0, 1)),
            )
        assert np.array_equal(found, own) and (x[0], y[1]) == (300000, 5000004), out
    with rasterio.open("o.tif") as file:
        assert np.array_equal(file.read(1), own[::-1]) and (file.crs, file.transform[4]) == (CRS, -4)


def test_a_picture_is_made_with_the_north_at_the_top():
    """`synth` with known values of every kind of file; its own samples may be grids, too."""
    image.write("ti.png", TRUTH[::-1])
    grid("ti.gslib", TRUTH)
    there = ~np.isnan(KNOWN)[::-1]
    for name in (*FILES, "wells.csv", "rows.csv"):
        if name in ("a.npy", "wells.csv"):  # see below
            continue
        FILES.get(name, table)(name, KNOWN)
        for sample in ("ti.png", "ti.gslib"):
            words = ("synth", sample, "--known", name, "--size", f"{COLS}x{ROWS}", "--boundary", "open")
            assert run(*words, "-o", "o.tif", *SIMULATED).exit_code == 0, name
            found = image.read("o.tif")
            assert np.array_equal(found.pixels[there], KNOWN[::-1][there]), (name, sample)
            assert bool(found.metadata.geo) == (name in PLACED)
            if name in PLACED:
                assert found.metadata.geo.transform == (8, 0, 299996, 0, -4, 5000000 + 4 * ROWS - 2)


def test_an_array_beside_a_grid_begins_with_the_smallest_y():
    grid("ti.gslib", TRUTH)
    np.save("known.npy", KNOWN)
    words = ("synth", "ti.gslib", "--known", "known.npy", "--boundary", "open")
    for out in ("o.npy", "o.png"):
        assert run(*words, "-o", out, *SIMULATED).exit_code == 0
    there = ~np.isnan(KNOWN)
    assert np.array_equal(np.load("o.npy")[there], KNOWN[there])
    assert np.array_equal(image.read("o.png").pixels[::-1], np.load("o.npy"))


def test_a_table_of_a_picture_is_counted_from_the_south():
    image.write("ti.png", TRUTH[::-1])
    for words in (["synth", "--boundary", "open"], ["simulate"], ["estimate"]):
        for name, text, said in [
            ("xy.csv", "x,y,v\n2,3,1\n", "y points north, and y = 0 is the bottom row"),
            ("rows.csv", f"column,row,v\n2,{ROWS - 4},1\n", "rows count from the top"),
        ]:
            Path(name).write_text(text)
            out = "o.png" if words[0] == "synth" else "o.npz"
            options = SIMULATED if words[0] != "estimate" else ("--device", "reference", "--categorical")
            done = run(words[0], "ti.png", *words[1:], "--size", f"{COLS}x{ROWS}", "--known", name, "-o", out, *options)
            assert done.exit_code == 0 and said in done.output.splitlines()[0], done.output
            if out == "o.png":
                assert image.read(out).pixels[ROWS - 4, 2] == 1
            else:
                with np.load(out) as arrays:
                    assert (
                        arrays["values"][0, 3, 2] == 1
                        if words[0] == "simulate"
                        else arrays["probability"][1, 3, 2] == 1
                    )


def test_like_gives_place_and_size():
    raster("like.tif", np.zeros((ROWS, COLS), np.float32))
    found = made("simulate", "ti.npy", "--like", "like.tif")
    assert found["values"].shape == (1, ROWS, COLS) and (found["x"][0], found["y"][1]) == (300000, 5000004)
    assert "UTM zone 32N" in str(found["attributes"])
    image.write("like.png", TRUTH)
    for words, sentence in [
        (["--like", "like.png"], "does not say where its cells lie"),
        (["--like", "like.tif", "--size", "4x4"], "leave shape out"),
        (
            ["--like", "like.tif", "--origin", "5,5"],
            "--like lies at 300000, 5000000, 0 with cells of 8, 4, 1, and that of",
        ),
        (["--like", "like.tif", "--region", "far.gslib"], "--region lies at 0, 5000000, 0"),
    ]:
        write_grid("far.gslib", {"v": TRUTH}, origin=(0, 5000000), cell=(8, 4))
        done = run("simulate", "ti.npy", *words, "-o", "new.npz", *SIMULATED)
        assert done.exit_code == 2 and sentence in done.output, done.output


def test_arrays_of_xarray():
    """The place of data counts, in any order of rows and axes, and that of the training image only without."""
    y, x = 500.0 + 5 * np.arange(ROWS), 90.0 + 5 * np.arange(COLS)
    known = xarray.DataArray(KNOWN, {"lat": y, "lon": x}, ("lat", "lon"))
    training = xarray.DataArray(TRUTH, {"y": y - 500, "x": 2 * x}, ("y", "x"))
    own = simdtex.simulate(TRUTH, 1, known=KNOWN, **OPTIONS)
    for one in (known, known[::-1], known.T, known[::-1, ::-1].T):
        found = simdtex.simulate(training[::-1], 1, known=one, **OPTIONS)
        assert np.array_equal(found, own) and np.array_equal(found.y, y) and np.array_equal(found.x, x)
    assert np.array_equal(simdtex.simulate(training, 1, **OPTIONS).x, 2 * x)
    assert located({"known": ascending(known)}, TRUTH, (90, 500), None).frame.cell[:2] == (5, 5)
    with pytest.raises(ValueError, match="region lies at 180, 0, 0 with cells of 10, 5, 1; give one place"):
        simdtex.simulate(TRUTH, 1, known=known, region=training > 0, **OPTIONS)
    far = known.assign_coords(spatial_ref=((), 0, {"crs_wkt": "EPSG:32632"}))
    other = (known > 5).assign_coords(spatial_ref=((), 0, {"crs_wkt": "EPSG:32633"}))
    with pytest.raises(ValueError, match="known and region have different coordinate reference systems"):
        simdtex.simulate(TRUTH, 1, known=far, region=other, **OPTIONS)
    assert simdtex.simulate(TRUTH, 1, known=far, **OPTIONS).x.attrs["units"] == "m"

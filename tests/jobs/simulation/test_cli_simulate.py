"""``simdtex simulate``, end to end."""

import numpy as np
import pytest
from commands import contents, run
from commands import pixels as picture

import simdtex
from simdtex.io import image
from simdtex.io.grids import read_grid, write_grid
from simdtex.io.hard_data import read_hard_data
from simdtex.model.display import write_labels
from simdtex.options import DataWarning

xarray = pytest.importorskip("xarray")
pytest.importorskip("zarr")
pytest.importorskip("h5netcdf")

OPTIONS = {"order": 2, "rng": 5, "device": "reference"}
QUICK = ["--order", 2, "--seed", 5, "--device", "reference"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Training images of three kinds, and tables of hard data."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(2)
    row, col = np.indices((16, 20))
    grey = np.rint(120 + 80 * np.sin(row * 0.9 + col * 0.5) + rng.uniform(-20, 20, (16, 20))).astype(np.uint8)
    facies = (grey > 120).astype(np.uint8) * np.uint8(3)
    holed = grey.astype(np.float32)
    holed[4:6, 7:9] = np.nan
    pictures = {
        "grey.png": grey,
        "second.png": grey[::-1, :15],
        "facies.png": facies,
        "colour.png": rng.integers(0, 256, (16, 20, 3), dtype=np.uint8),
        "holed.tif": holed,
    }
    for name, one in pictures.items():
        image.write(name, one)
    tables = {"wells.csv": "x,y,value\n3,4,200\n10.4,7,17\n"}
    np.save(tmp_path / "huge.npy", np.where(facies, 1e200, 3.0))
    lies = {"origin": (1005.0, 2002.5, 3), "cell": (10.0, 5.0, 2.0)}
    np.save(tmp_path / "ti.npy", np.zeros((2, 8, 9), np.uint8))
    for suffix in (".gslib", ".sgems"):
        write_grid(tmp_path / f"ti{suffix}", {"facies": facies[::-1]}, **lies)
    write_grid(tmp_path / "two.gslib", {"por": grey[::-1] / 8, "facies": facies[::-1]}, **lies)
    write_grid(tmp_path / "holed.gslib", {"por": holed[::-1]}, **lies)
    tables |= {
        "wells.eas": "wells\n4\nX\nY\nZ\nfacies\n1035 2022.5 3 3\n1104 2037 2.5 0\n1107 2036 2.5 0\n1108 2036 2.5 3\n",
        "ti.dat": "20 16 1\n1\nfacies\n" + "\n".join(map(str, facies[::-1].ravel())) + "\n",
    }
    for name, text in tables.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def pixels(name):
    """Return the pixels of a picture as cells: row 0 is the smallest y."""
    return picture(name)[::-1]


def simulate(*words):
    return run("simulate", *words, *QUICK)


def made(*words):
    result = simulate(*words, "-o", "out.nc")
    assert result.exit_code == 0, result.output
    with xarray.open_dataarray("out.nc") as found:
        return found.load()


def test_realisations_are_those_of_the_function_and_honour_a_table(folder):
    args = ("grey.png", "-n", 2, "--first", 2, "--size", "14x12", "--known", "wells.csv", "--jobs", 2)
    result = simulate(*args, "-o", "out.zarr")
    assert result.exit_code == 0, result.output
    assert "2 realisations of 14x12 in" in result.output and "on reference" in result.output
    assert "seed 5" in result.output
    with xarray.open_dataarray("out.zarr") as found:
        assert (found.values[:, 4, 3] == 200).all() and (found.values[:, 7, 10] == 17).all()
        table = read_hard_data(folder / "wells.csv")
        own = simdtex.simulate(pixels("grey.png"), 2, first=2, shape=(12, 14), known=table, **OPTIONS)
        assert found.identical(own) and found.dtype == own.dtype
    assert simulate("grey.png", "--size", "9x8", "-o", "out.npz", "-q").output == ""
    assert "1 realisation of 20x16" in simulate("grey.png", "-o", "out.npz").output


def test_values_at_points(folder):
    """In the order of the table, with its coordinates, of all realisations; empty outside of the region."""
    (folder / "points.csv").write_text("\ufeffname;row;column\nb;1;3,5\na;15;0\nb;1;3,5\n")
    (folder / "ground.csv").write_text("X,Y\n1044.5,2070.2\n1005,2002.5\n1044.5,2070.2\n")
    found = made("grey.png", "-n", 2, "--at", "points.csv=values.csv").values
    rows = [
        ",".join(map(str, (x, y, *found[:, int(y), int(x + 0.5)]))) for x, y in ((3.5, 14.0), (0.0, 0.0), (3.5, 14.0))
    ]
    assert (folder / "values.csv").read_text().splitlines() == ["x,y,simulation__real0,simulation__real1", *rows]
    inside = (np.indices((16, 20))[1] > 0).astype(np.uint8)
    write_grid(folder / "region.gslib", {"in": inside}, origin=(1005, 2002.5, 3), cell=(10, 5, 2))
    args = ("two.gslib", "--region", "region.gslib", "--first", 3, "--at", "ground.csv=values.csv")
    por = made(*args).values[0, 14, 4]
    names, first, second, _ = (folder / "values.csv").read_text().splitlines()
    assert names == "x,y,simulation_0__real3,simulation_1__real3" and second == "1005.0,2002.5,,"
    assert first == f"1044.5,2070.2,{por[0]},{por[1]}"


def test_from_a_grid_to_a_grid(folder):
    args = ["--known", "wells.eas", "--categorical", "--several", "most", "--size", "14x12", "-n", 2]
    result = simulate("ti.gslib", *args, "-o", "out.sgems")
    assert result.exit_code == 0, result.output
    grid = read_grid(folder / "out.sgems")
    assert (grid.origin, grid.cell) == ((1005, 2002.5, 3), (10, 5, 2))
    assert list(grid.values) == ["simulation__real0", "simulation__real1"]
    options = {"known": folder / "wells.eas", "several": "most", "origin": grid.origin, "cell": grid.cell} | OPTIONS
    own = simdtex.simulate(pixels("facies.png"), 2, shape=(12, 14), categorical=True, **options)
    assert np.array_equal(np.concatenate(list(grid.values.values())), own.values)
    assert (own.values[:, 4, 3] == 3).all() and (own.values[:, 7, 10] == 0).all()


def test_a_grid_is_a_picture_with_coordinates(folder):
    for name in ("ti.gslib", "ti.dat"):
        found = made(name, "--size", "14x12", "--categorical")
        own = simdtex.simulate(pixels("facies.png"), 1, shape=(12, 14), categorical=True, **OPTIONS)
        assert found.values.tobytes() == own.values.tobytes() and found.dtype == own.dtype
        ground = name == "ti.gslib"
        assert found.x[1] == (1015 if ground else 1) and found.y[1] == (2007.5 if ground else 1)
    found = made("two.gslib", "--size", "14x12")
    both = np.stack([pixels("grey.png") / 8, pixels("facies.png")], -1)
    own = simdtex.simulate(both, 1, shape=(12, 14), channel_axis=-1, **OPTIONS)
    assert found.values.tobytes() == own.values.tobytes() and found.dtype == own.dtype
    assert not np.isnan(made("holed.gslib", "--size", "14x12")).any()


def axes(*words):
    found = made(*words, "--size", "4x4")
    return [(float(found[axis].min()), found.attrs[f"cell_{axis}"]) for axis in "xyz" if axis in found.coords]


@pytest.mark.slow
def test_a_report_of_data_on_the_ground(folder):
    args = ("--known", "wells.eas", "--several", "most", "--size", "14x12", "--categorical", "--report", "report")
    assert (made("ti.gslib", *args).values[0, 4, 3] == 3).all()
    assert "wells.eas" in (folder / "report" / "index.html").read_text(encoding="utf-8")


def test_where_cells_lie(folder):
    """What is given on the command line counts more than the file of the training image."""
    assert axes("ti.sgems") == [(1005, 10), (2002.5, 5), (3, 2)]
    assert axes("ti.gslib", "--origin", "-7,0,0.5") == [(-7, 10), (0, 5), (0.5, 2)]
    assert axes("ti.gslib", "--cell", "2,3") == [(1005, 2), (2002.5, 3)]
    assert axes("grey.png", "--origin", "5,6", "--cell", "2,3") == [(5, 2), (6, 3)]


def test_a_grid_of_known_values(folder):
    known = np.full((16, 20), np.nan)
    known[3, 4] = 200
    write_grid(folder / "known.gslib", {"v": known, "w": known})
    refused(["grey.png", "-o", "out.npz", "--known", "known.gslib"], "known is")
    write_grid(folder / "known.gslib", {"v": known})
    own = simdtex.simulate(pixels("grey.png"), 1, known=known, **OPTIONS)
    assert made("grey.png", "--known", "known.gslib").identical(own)


def test_grids_as_guides(folder):
    write_grid(folder / "wanted.gslib", {"v": pixels("facies.png")[:12, :14]})
    found = made("grey.png", "--guide", "ti.gslib=wanted.gslib", "--size", "14x12")
    guide = pixels("facies.png"), pixels("facies.png")[:12, :14]
    own = simdtex.simulate(pixels("grey.png"), 1, guide=guide, labels=True, shape=(12, 14), **OPTIONS)
    assert found.values.tobytes() == own.values.tobytes()
    args = ["grey.png", "-o", "two.npz", "--guide", "ti.gslib=two.gslib"]
    refused(args, "has 1 channels and that of the output 2")


GREY = ["grey.png", "-o", "out.npz", "--size", "14x12"]
FACIES = ["facies.png", "-o", "out.npz", "--size", "14x12", "--categorical"]
BAD = {
    "an origin in words": ([*GREY, "--origin", "here"], "--origin here must be numbers separated by commas"),
    "a column without a name": ([*GREY, "--columns", "x="], "--columns x= must be AXIS=NAME,..."),
    "points outside": ([*GREY, "--at", "wells.csv=at.csv", "--origin", "5,0"], "line 2 of wells.csv is at x 3.0"),
    "points in a picture": ([*GREY, "--at", "grey.png=at.csv"], "grey.png: the table is no text"),
    "points in two tables": (
        [*GREY, "--at", "wells.csv,wells.eas=at.csv"],
        "2 tables and writes at.csv; give one of each",
    ),
    "values that are no .csv": (
        [*GREY, "--at", "wells.csv=at.gslib"],
        "writes at.gslib; give one of each, the new one a .csv",
    ),
    "values in no folder": ([*GREY, "--at", "wells.csv=no/at.csv"], "the folder no does not exist"),
    "points of a volume": (["ti.npy", "-o", "out.npz", "--at", "wells.csv=at.csv"], "wells.csv with a column z"),
    "coordinates on the ground": (
        [*FACIES, "--known", "wells.eas"],
        "the centre of the first cell, origin=(x, y) (--origin X,Y)",
    ),
    "a grid that holds no such number": (["huge.npy", "-o", "out.sgems"], "end its name in .gslib"),
    "a grid too far away": (["ti.gslib", "-o", "out.sgems", "--origin", "4500000.3,0"], "x = 4500000.3"),
    "a report of several": (["grey.png", "second.png", "-o", "out.npz", "--report", "report"], "leave it out"),
    "a report of next to nothing": (["grey.png", "-o", "out.npz", "--size", "9x3", "--report", "report"], "4x4 pixels"),
    "a report of colour": (["colour.png", "-o", "out.npz", "--report", "report"], "one variable"),
    "a report of vast values": (["huge.npy", "-o", "out.npz", "--report", "report"], "up to 1e+100; give them in"),
    "a report of gaps": (["holed.tif", "-o", "out.npz", "--report", "report"], "without unknown cells"),
}


def refused(args, words):
    before = contents()
    result = simulate(*args)
    assert result.exit_code == 2, result.output
    assert words in result.output
    notes = ("taken as unknown", "points north")
    assert len([one for one in result.output.strip().splitlines() if not any(note in one for note in notes)]) == 1
    assert contents() == before


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gets_one_sentence_before_the_run_and_writes_nothing(folder, case, monkeypatch):
    monkeypatch.setattr("simdtex.driver.run", lambda *_, **__: pytest.fail("this takes hours"))
    refused(*BAD[case])


@pytest.fixture
def maps(folder):
    """Maps of the size of the training image in several formats."""
    region = np.arange(20) < np.full((16, 1), 12)
    p = np.stack([np.where(region, 0.2, 0.9), np.where(region, 0.8, 0.1)], -1)
    image.write(folder / "region.png", region.astype(np.uint8) * np.uint8(255))
    write_grid(folder / "region.gslib", {"in": region.astype(np.uint8)})
    np.save(folder / "p.npy", p)
    write_grid(folder / "p.gslib", {"clay": p[..., 0], "sand": p[..., 1]})
    lines = [f"{j},{i},{p[i, j, 0]},{p[i, j, 1]}" for i, j in np.ndindex(16, 20)]
    (folder / "p.csv").write_text("x,y,clay,sand\n" + "\n".join(lines) + "\n")
    image.write(folder / "angles.tif", np.where(region, 0, 90).astype(np.float32))
    np.save(folder / "sizes.npy", np.where(region, 1.0, 0.5))
    np.save(folder / "numbers.npy", region.astype(np.uint8))
    return {"region": region, "probabilities": np.moveaxis(p, -1, 0)}


@pytest.mark.slow
def test_maps_are_those_of_the_function(folder, maps):
    facies = pixels("facies.png")
    expected = simdtex.simulate(facies, 1, **maps, categorical=True, **OPTIONS)
    for region in ("region.png", "region.gslib"):
        for p in ("p.npy", "p.gslib", "p.csv"):
            found = made("facies.png", "--region", region, "--probabilities", p, "--categorical")
            assert np.array_equal(found, expected), (region, p)
    rotation, scale = pixels("angles.tif"), np.load(folder / "sizes.npy")
    expected = simdtex.simulate(facies, 1, rotation=rotation, scale=scale, **OPTIONS)
    assert np.array_equal(made("facies.png", "--rotation", "angles.tif", "--scale", "sizes.npy"), expected)
    both, number = [pixels(name) for name in ("grey.png", "second.png")], np.load(folder / "numbers.npy")
    expected = simdtex.simulate(both, 1, image_map=number, **OPTIONS)
    write_labels(folder / "numbers.png", number)  # as indices of a palette
    for name in ("numbers.npy", "numbers.png"):
        assert np.array_equal(made("grey.png", "second.png", "--image-map", name), expected)


def test_a_source_map_is_in_the_file(folder):
    result = simulate("grey.png", "--source", "--finish", 0, "-o", "out.nc")
    assert result.exit_code == 0, result.output
    with xarray.open_dataset(folder / "out.nc") as found:
        grey = pixels("grey.png")
        assert np.array_equal(grey[found.source_row, found.source_column], found.simulation)


def test_a_region_is_the_white_parts_of_a_picture(folder, maps):
    """Grey below half is outside, as of masks, and so is black of three channels."""
    grey = np.where(maps["region"], 200, 100).astype(np.uint8)
    image.write(folder / "grey-region.png", grey)
    image.write(folder / "colour-region.png", np.stack([grey] * 3, -1))
    for name in ("grey-region.png", "colour-region.png"):
        assert np.array_equal(made("facies.png", "--region", name, "--categorical").region, maps["region"])


def test_cells_outside_of_the_region_are_unknown_in_a_grid(folder, maps):
    result = simulate("facies.png", "--region", "region.gslib", "--categorical", "-o", "out.gslib")
    assert result.exit_code == 0, result.output
    with pytest.warns(DataWarning, match="128 of 320 values are -9966699"):
        values = read_grid(folder / "out.gslib").values["simulation__real0"][0]
    assert np.array_equal(np.isnan(values), ~maps["region"])


def test_maps_that_do_not_fit_are_refused_before_the_run(folder, maps):
    for words, sentence in (
        (["--rotation", "angles.tif", "--size", "8x8"], "rotation is 16x20 and has to be 8x8"),
        (["--source", "-o", "out.gslib"], "is a grid, which holds no source map: end its name in .zarr, .nc or .npz"),
        (["--source", "--report", "report"], "--report cannot be used with --source or --region"),
    ):
        refused(["facies.png", "-o", "out.npz", *words], sentence)


def estimate(*words):
    return run("estimate", *words, "--device", "reference")


def test_an_estimate_is_that_of_the_function(folder):
    how = ["--several", "most", "--nearest", 3, "--size", "20x16"]
    result = estimate("ti.gslib", "--known", "wells.eas", "--categorical", *how, "-o", "out.nc")
    assert result.exit_code == 0 and "maps of 20x16" in result.output, result.output
    expected = simdtex.estimate(
        read_grid(folder / "ti.gslib").values["facies"][0], known=folder / "wells.eas", shape=(16, 20),
        origin=(1005, 2002.5, 3), cell=(10, 5, 2), several="most", nearest=3, categorical=True, device="reference",
    )  # fmt: skip
    with xarray.open_dataset(folder / "out.nc") as found:
        assert found.identical(expected)
    assert estimate("ti.gslib", "--known", "wells.eas", "--categorical", *how, "-o", "out.gslib").exit_code == 0
    grid = read_grid(folder / "out.gslib")
    assert (grid.origin, grid.cell) == ((1005, 2002.5, 3), (10, 5, 2))
    assert np.array_equal(grid.values["probability_3"][0], expected.probability.sel(category=3))
    assert np.array_equal(grid.values["entropy"][0], expected.entropy)


def test_an_estimate_at_points_with_names_that_have_commas(folder):
    (folder / "at.txt").write_text("id y x\nA 7 10\n")  # without the columns of the data
    (folder / "a.dat").write_text("mGstat\n3\ncol1, unknown\ncol2, unknown\ncol3, unknown\n3 4 0\n10 7 3\n")
    words = ["facies.png", "--categorical", "--known", "a.dat", "--columns", "x=col1, unknown, y=col2, unknown"]
    for points in ("a.dat", "at.txt"):
        assert (result := estimate(*words, "--at", f"{points}={points}.csv", "-o", "o.npz")).exit_code == 0, (
            result.output
        )
    with np.load("o.npz") as found:
        assert set(found["entropy"][[4, 7], [3, 10]]) == {0}
    rows = ["x,y,entropy,probability_0,probability_3", "3.0,4.0,0.0,1.0,0.0", "10.0,7.0,0.0,0.0,1.0"]
    assert (folder / "a.dat.csv").read_text().splitlines() == rows
    assert (folder / "at.txt.csv").read_text().splitlines() == [rows[0], rows[2]]


def test_an_estimate_of_nothing_is_refused(folder):
    for words, sentence in (
        (["grey.png"], "an estimate requires data; give --known"),
        (["colour.png", "--known", "wells.csv"], "has several channels; give a training image of one variable"),
    ):
        result = estimate(*words, "-o", "out.npz")
        assert result.exit_code != 0 and sentence in " ".join(result.output.split())
        assert not (folder / "out.npz").exists()

"""Hard data comes from a table to its sites, and what is wrong with it is named with its line."""

import doctest
import gzip
from importlib.util import find_spec

import numpy as np
import pandas
import pytest
from hypothesis import given
from hypothesis import strategies as st
from volumes import saved

from simdtex.io import hard_data
from simdtex.io.grids import MISSING
from simdtex.io.hard_data import HardData, place_hard_data, read_hard_data
from simdtex.options import DataWarning

NAN = float("nan")


def table(tmp_path, text, name="wells.csv"):
    return saved(tmp_path, text, name)


SAME = [
    "x,y,facies\n1,2,3\n4.5,-0.25,6e1\n",
    "X, Y, facies\n1, 2, 3\n4.5, -0.25, 60\n",
    "x;y;facies\r\n1;2;3\r\n4.5;-0.25;60\r\n",
    "x\ty\tfacies\n1\t2\t3\n4.5\t-0.25\t60",
    "# wells of 2019, in pixels\n\nx  y  facies # the last one is a guess\n  1 2  3\n\n 4.5   -.25 60 #\n",
    '"x","y","facies"\n"1","2","3"\n4.5,-0.25,"60"\n',
    "\ufeffx,y,facies\n1,2,3\n4.5,-0.25,60\n",
    # Excel, also of Germany, numpy.savetxt, and people
    "x;y;facies\n1;2;3\n4,5;-0,25;6,0e1\n",
    "sep=;\nx;y;facies\n1.0;2;3\n4.5;-0.25;60\n;;\n",
    'x,y,facies\n1,2,3\n"4,5","-0,25",60\n,,\n',
    "x , y , facies\n(m), m , -\n1 , 2 , 3\n4.5 , -0.25 , 60\n",
    "# y (m), x (m), facies\n2,1,3 # a, b\n-0.25,4.5,60\n",
    "wells\n3\nx    m\ny\tm\nfacies\n1, 2, 3\n4.5, -0.25, 60\n",
    ",,\nx,y,facies\n1,2,3\n4.5,-0.25,60\n",
    "#,x,y,facies\n7,1,2,3\n8,4.5,-0.25,60\n",
    # columns by their names in any order, as of pandas, ArcGIS and Petrel
    ",x,y,facies\n0,1,2,3\n1,4.5,-0.25,60\n",
    "Unnamed: 0,x,y,facies\n0,1,2,3\n1,4.5,-0.25,60\n",
    "Northing,Easting,facies\n2,1,3\n-.25,4.5,60\n",
    "Latitude;Longitude;facies\n2;1;3\n-.25;4.5;60\n",
    "well\tY_coord\tX_coord (m)\tfacies\nA-1\t2\t1\t3\nA-2\t-.25\t4.5\t60\n",
    "facies row column\n3 2 1\n60 -.25 4.5\n",
    "POINT_X,POINT_Y,facies,name\n1,2,3,NA\n4.5,-.25,60,A 2\n",
    "wells\n4 columns, of 2019\nfacies\nYlocation\nX\nZ\n3 2 1 7\n60 -.25 4.5 7\n",
]


@pytest.mark.filterwarnings("ignore:left out")
def test_a_table_is_the_same_however_it_is_written(tmp_path):
    for text in SAME:
        data = read_hard_data(table(tmp_path, text))
        assert data.points[:, :2].tolist() == [[1, 2], [4.5, -0.25]], text
        assert data.points[:, 2:].tolist() == ([[7], [7]] if "Z" in text else [[], []]), text
        assert (data.values.tolist(), data.names, len(data)) == ([[3], [60]], ("facies",), 2), text
    for text in ("1,2,3\n4,5,6\n", "#three nice wells\n1;2;3\n4;5;6\n"):
        data = read_hard_data(table(tmp_path, text))
        assert (data.points.tolist(), data.values.tolist(), data.names) == ([[1, 2], [4, 5]], [[3], [6]], ("value",))


def test_several_variables_and_unknown_values(tmp_path):
    data = read_hard_data(table(tmp_path, "x,y,porosity,,facies\n0,0,0.2,7,\n1,0,,NaN,3\n2,0,nan, ,4\n"))
    assert data.names == ("porosity", "value 2", "facies")
    np.testing.assert_array_equal(data.values, [[0.2, 7, NAN], [NAN, NAN, 3], [NAN, NAN, 4]])
    assert read_hard_data(table(tmp_path, "1 2 3 4")).names == ("value 1", "value 2")


@given(st.lists(st.tuples(*[st.floats(-1e20, 1e20).filter(lambda v: v not in MISSING)] * 4), min_size=1, max_size=5))
def test_numbers_are_read_to_the_last_digit(tmp_path_factory, rows):
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_text("\n".join(",".join(map(repr, row)) for row in rows))
    data = read_hard_data(path)
    assert np.column_stack([data.points, data.values]).tolist() == [list(row) for row in rows]


def test_columns_are_chosen_by_name(tmp_path):
    path = table(tmp_path, "depth,por,perm,facies\n1,0.2,5,sand\n2,0.3,6,Shale\n3,,7,\n")
    chosen = {"x": "depth", "y": "perm", "value": ["por", "facies"]}
    data = read_hard_data(path, columns=chosen, categories={"sand": 1, "shale": 0})
    assert data.points.tolist() == [[1, 5], [2, 6], [3, 7]] and data.names == ("por", "facies")
    np.testing.assert_array_equal(data.values, [[0.2, 1], [0.3, 0], [NAN, NAN]])
    plain = table(tmp_path, "7 1 2 3\n8 4 5 6\n", "plain.txt")
    data = read_hard_data(plain, columns={"x": "2", "y": "3", "value": "4"})
    assert data.points.tolist() == [[1, 2], [4, 5]] and data.values.tolist() == [[3], [6]]
    for columns, categories, words in (
        ({"x": "X"}, {"sand": 1}, "no column 'X' for 'x': name x, y, z, value of 'depth', 'por'"),
        ({"w": "por"}, {"sand": 1}, "for 'w'"),
        ({"x": 1}, {"sand": 1}, "no column 1 for 'x': .*'facies', or count them from '1' on"),
        (chosen, None, r"line 2 has 'sand' in column 4, .*--categories"),
    ):
        with pytest.raises(ValueError, match=words):
            read_hard_data(path, columns=columns, categories=categories)
    eas = "Data written by mGstat\n4\n" + "".join(f"col{n}, unknown\n" for n in (1, 2, 3, 4)) + "22 19 0 1\n51 9 0 1\n"
    names = {"x": "col1, unknown", "y": "col2, unknown", "value": "col4, unknown"}
    for columns in (names, {"x": "1", "y": "2", "z": "3", "value": "4"}):
        data = read_hard_data(table(tmp_path, eas, "eas.dat"), columns=columns)
        assert data.points[:, :2].tolist() == [[22, 19], [51, 9]] and data.names == ("col4, unknown",)
        assert data.points.shape[1] == (3 if "z" in columns else 2)
    points = read_hard_data(table(tmp_path, "x;y\n1;2\n"), columns={"value": []})
    assert points.points.tolist() == [[1, 2]] and points.names == ()
    with pytest.warns(DataWarning, match="left out, because they hold text: the columns well, rig"):
        data = read_hard_data(table(tmp_path, "well,x,y,por,rig\nA,1,2,.5,b\nB,3,4,,NA\n"))
    assert data.names == ("por",)


@pytest.mark.filterwarnings("ignore:left out")
def test_pandas_writes_the_same_table_in_every_format(tmp_path):
    rng, wells = np.random.default_rng(1), [f"A#{k}, of # {k}" for k in range(50)]
    frame = pandas.DataFrame({"well": wells, "y": rng.random(50, "f4"), "x": rng.random(50), "facies": range(50)})
    frame["facies"] = frame["facies"].astype("Int64").where(frame.index != 7)
    frame.to_csv(tmp_path / "a.csv", sep=";", decimal=",")
    frame.to_csv(tmp_path / "a.csv.gz")
    frame.to_excel(tmp_path / "a.xlsx")
    tables = [frame, frame.set_index("x"), tmp_path / "a.csv", tmp_path / "a.csv.gz", tmp_path / "a.xlsx"]
    if find_spec("pyarrow"):
        frame.set_index("y").to_parquet(tmp_path / "a.parquet")
        tables.append(tmp_path / "a.parquet")
    for data in map(read_hard_data, tables):
        np.testing.assert_allclose(data.points, frame[["x", "y"]], rtol=1e-7)
        assert data.names == ("facies",) and np.isnan(data.values[7]) and data.lines == tuple(range(2, 52))
    with pandas.ExcelWriter(tmp_path / "a.xlsx") as file:
        for sheet in ("north", "south"):
            frame.to_excel(file, sheet_name=sheet)
    with pytest.warns(DataWarning, match="only the first of its sheets, north, is read"):
        read_hard_data(tmp_path / "a.xlsx")


def test_tables_that_are_not_read_are_named(tmp_path, monkeypatch):
    for name, content, words in (
        ("a.las", "~V", r"ends in .las, which is not read: write .* \(\.csv\)$"),
        ("a.ods", "~V", "ends in .ods"),
        ("a.xlsx", b"PK", r"a\.xlsx.*damaged"),
        ("a.csv.gz", gzip.compress(b"x,y,v\n1,2,3")[:-9], r"a\.csv\.gz.*damaged"),
        ("b.csv.gz", gzip.compress(bytes(10**5)), "no more than 99 are read"),
    ):
        with pytest.raises(ValueError, match=words):
            read_hard_data(table(tmp_path, content, name), max_pixels=99)
    with pytest.warns(DataWarning, match="line 2 begins with #, and is left out"):
        assert len(read_hard_data(table(tmp_path, "x,y,v\n#1,2,3\n4,5,6\n"))) == 1
    monkeypatch.setattr("simdtex.io.files.find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"is a table in \.xlsx: pip install 'simdtex\[tables\]'"):
        read_hard_data(table(tmp_path, "", "a.xlsx"))


def test_codes_of_unknown_values(tmp_path):
    path = table(tmp_path, "x,y,v,w\n1,2,23,0\n3,4,-999.25,1\n5,6,219,2\n")
    with pytest.warns(DataWarning, match=r"wells\.csv, column v: 1 of 3 values are .*, and are taken as unknown"):
        np.testing.assert_array_equal(read_hard_data(path).values, [[23, 0], [NAN, 1], [219, 2]])
    assert read_hard_data(path, valid=(-np.inf, np.inf)).values[1, 0] == -999.25
    with pytest.warns(DataWarning):
        assert np.isnan(read_hard_data(path, missing=[23]).values[:2, 0]).all()
    np.save(tmp_path / "wells.npy", [[1, 2, 23], [3, 4, -999.25], [5, 6, 219]])
    with pytest.warns(DataWarning, match="1 of 3 values are"):
        np.testing.assert_array_equal(read_hard_data(tmp_path / "wells.npy").values.ravel(), [23, NAN, 219])


@pytest.mark.filterwarnings("ignore::simdtex.options.DataWarning")
def test_a_point_set_of_geo_eas(tmp_path):
    for names, points, values in (
        (("xcoord", "Ylocation", "z (m)", "Zn"), [[1, 2, 3], [4.5, 5, 6]], [[7], [NAN]]),
        (("X", "Y", "Zn", "Pb"), [[1, 2], [4.5, 5]], [[3, 7], [6, NAN]]),
    ):
        text = "wells\n4\n" + "\n".join(names) + "\n1 2 3 7\n\n 4.5\t5 6 -999\n"
        data = read_hard_data(table(tmp_path, text, "a.eas"))
        np.testing.assert_array_equal(data.values, values)
        assert (data.points.tolist(), data.names, data.lines) == (points, names[len(points[0]) :], (7, 9))


def test_z_is_a_coordinate_if_another_column_is_left(tmp_path):
    data = read_hard_data(table(tmp_path, "x,y,z,facies\n1,2,3,\n"))
    assert data.points.tolist() == [[1, 2, 3]] and data.names == ("facies",) and np.isnan(data.values).all()
    assert read_hard_data(table(tmp_path, "x,y,z\n1,2,3\n")).names == ("z",)
    data = read_hard_data(table(tmp_path, "x,y,a,z\n1,2,3,4\n"))
    assert data.points.tolist() == [[1, 2, 4]] and data.names == ("a",)


def plainly(rows, shape, variables):
    """Site by site: which datum is nearest to it, in exact halves."""
    found = np.full((*shape, variables), NAN)
    for x, y, *values in rows:
        for i, j in np.ndindex(shape):
            if j - 0.5 <= x < j + 0.5 and i - 0.5 <= y < i + 0.5:
                found[i, j] = np.where(np.isnan(values), found[i, j], values)
    return found


@given(
    st.lists(
        st.tuples(st.integers(-2, 13), st.integers(-2, 9), *[st.sampled_from([NAN, 1.0, 250.0])] * 2),
        min_size=1,
        max_size=12,
        unique_by=lambda row: ((row[0] + 2) // 4, (row[1] + 2) // 4),
    ),
    st.sampled_from(["uint8", "float32", "int64", None]),
    st.integers(1, 2),
)
def test_placing_against_a_loop(quarters, dtype, variables):
    rows = [(x / 4, y / 4, *values[:variables]) for x, y, *values in quarters]
    expected = plainly(rows, (3, 4), variables)
    if np.isnan(expected).all():
        return
    placed = place_hard_data(rows, (3, 4), dtype)
    assert placed.dtype == (dtype or "float64")
    assert placed.shape == placed.mask.shape == ((3, 4) if variables == 1 else (3, 4, 2))
    np.testing.assert_array_equal(placed.mask, np.isnan(expected).reshape(placed.shape))
    np.testing.assert_array_equal(placed.compressed(), expected[~np.isnan(expected)])


def test_data_that_agree_at_one_site_are_one():
    placed = place_hard_data([[1, 1, 5, NAN], [1.2, 0.9, 5, 8], [1, 1, NAN, 8]], (2, 2))
    assert placed[1, 1].tolist() == [5, 8] and placed.count() == 2
    assert place_hard_data([[0, 0, 0.1], [0, 0, 0.1 + 1e-12]], (1, 1), "float32").count() == 1, "the same in this type"
    rows = np.ma.MaskedArray([[0, 0, 5, 6], [1, 0, 7, 8]], [[0, 0, 1, 0], [0, 0, 0, 1]])
    assert place_hard_data(rows, (1, 2), "int16").filled().tolist() == [[[0, 6], [7, 0]]], "masked is unknown"


def test_coordinates_on_the_ground():
    ground = {"origin": (1005.0, 2002.5), "cell": (10.0, 5.0)}
    for x, y, site in ((1000, 2000, [0, 0]), (1009.9, 2004.9, [0, 0]), (1010, 2005, [1, 1]), (1039.9, 2014.9, [2, 3])):
        assert np.argwhere(~place_hard_data([[x, y, 7]], (3, 4), "uint8", **ground).mask).tolist() == [site]
    for x, y in ((999.9, 2000), (1040, 2000), (1000, 1999.9), (1000, 2015)):
        with pytest.raises(ValueError, match=rf"row 0 .* at x {x}.*, y {y}.*, outside .* of 4 x 3 pixels") as caught:
            place_hard_data([[x, y, 7]], (3, 4), "uint8", **ground)
        assert f", x 1000 to 1040 (all points {x} to {x}), y 2000 to 2015 (all points" in str(caught.value)
    assert place_hard_data([[12, 3, 7]], (3, 4), "uint8", cell=(10, 5))[1, 1] == 7
    with pytest.warns(DataWarning, match="1 of 2 data are outside of the grid and are left out"):
        assert place_hard_data([[12, 3, 7], [1, 1, 5]], (3, 4), outside="skip").compressed().tolist() == [5]


def test_data_in_layers():
    wells = HardData(np.array([[1, 2, 0.2], [3, 0, 1.4]]), np.array([[7.0], [8.0]]), ("v",))
    placed = place_hard_data(wells, (2, 3, 4), "uint8")
    assert placed.shape == (2, 3, 4) and placed.count() == 2 and placed[0, 2, 1] == 7 and placed[1, 0, 3] == 8
    placed = place_hard_data(wells, (2, 3, 4), origin=(-9, -8, 0.2), cell=(10, 10, 1.2))
    assert placed[0, 1, 1] == 7 and placed[1, 1, 1] == 8
    assert place_hard_data(wells, (3, 4), origin=(0, 0, 1), cell=(1, 1, 2)).shape == (3, 4)
    deep = r"z 1.4, outside of a picture of 4 x 3 x 1 pixels \(width x height x depth\), .*z -0.5 to 0.5 \("
    twice = HardData(np.array([[0, 2, 1.0]] * 2), np.array([[7.0], [8.0]]), ("v",))
    for data, shape, words in (
        (wells, (3, 4), deep),
        (twice, (2, 3, 4), r"row 0 and row 1 .* at layer 1, row 2, column 0 of"),
        ([[0, 0, 1]], (2, 3, 4), r"shape is \(2, 3, 4\): give \(rows, cols\), or the hard data with a column z"),
    ):
        with pytest.raises(ValueError, match=words):
            place_hard_data(data, shape)


SEVERAL = [[1, 1, 5, 5], [0, 1, 8, NAN], [1, 1, 2, 4], [0.9, 1.1, 2, NAN], [1.2, 1, 5, NAN]]


@pytest.mark.parametrize(
    ("several", "dtype", "means"),
    [("mean", "float64", [3.5, 4.5]), ("mean", "uint8", [4, 5]), ("most", "uint8", [5, 5])],
)
def test_several_data_of_one_cell(several, dtype, means):
    placed = place_hard_data(SEVERAL, (2, 2), dtype, several=several)
    assert placed[1, 1].tolist() == means
    assert placed[1, 0, 0] == 8 and placed.count() == 3 and placed.dtype == dtype


def test_of_equally_frequent_values_the_first_counts():
    for values, found in (((9, 3), 9), ((3, 9), 3), ((3, 9, 9), 9), ((4, 9, 3, 9, 3), 9), ((4, 3, 9, 9, 3), 3)):
        placed = place_hard_data([[0, 0, value] for value in values], (1, 1), several="most")
        assert placed.tolist() == [[found]]


def test_data_that_are_wrong(tmp_path):
    for row, words in (
        ("nan,0,1", "line 3 of .*wells.csv is at x nan, y 0.0, outside of a picture"),
        ("0,-inf,1", "line 3 of .*wells.csv is at x 0.0, y -inf, outside"),
        ("-0.6,0,1", r"line 3 .* at x -0\.6, y 0\.0, outside of a picture of 4 x 3 .*, x -0.5 to 3.5 "),
        ("0,0,0.5", "line 3 of .*wells.csv has 0.5 for facies, which uint8 cannot hold: give integers below 2"),
        ("0,0,256", "has 256.0 for facies, which uint8 cannot hold"),
        ("0,0,inf", "has inf for facies, which uint8 cannot hold"),
        (
            "2.2,1,9",
            "line 2 and line 3 .* are both at row 1, column 2 .* have 7 and 9 for facies: keep one of them, or",
        ),
    ):
        with pytest.raises(ValueError, match=words) as caught:
            place_hard_data(read_hard_data(table(tmp_path, f"x,y,facies\n2,1,7\n{row}\n0,1,3\n")), (3, 4), "uint8")
        assert "\n" not in str(caught.value)


def test_the_largest_values_that_a_type_can_hold():
    for value, dtype in ((255, "uint8"), (2**53 - 1, "int64"), (-(2**31), "int32"), (1, "bool"), (65504, "float16")):
        assert place_hard_data([[0, 0, value]], (1, 1), dtype)[0, 0] == value
    for value, dtype, remedy in (
        (1e39, "float32", "finite values"),
        (np.inf, "float64", "finite values"),
        (2, "bool", "0 and 1 within"),
        (2.0**53, "int64", r"integers below 2\*\*53"),
        (2.0**31, "int32", r"integers below 2\*\*53 within its range"),
    ):
        with pytest.raises(ValueError, match=rf"row 1 of the hard data .* {dtype} cannot hold: give {remedy}"):
            place_hard_data([[0, 0, 0], [1, 0, value]], (1, 2), dtype)


def test_arguments_that_are_wrong():
    good = [[0, 0, 1]]
    for shape in ((0, 4), (3,), 5, (3.0, 4), (3, 4, 1), None):
        with pytest.raises(ValueError, match=r"shape is .*: give \(rows, cols\)"):
            place_hard_data(good, shape)
    for dtype in (complex, "U3", object):
        with pytest.raises(TypeError, match="dtype is"):
            place_hard_data(good, (1, 1), dtype)
    nothing = HardData(np.zeros((0, 2)), np.zeros((0, 1)), ("a",))
    for rows, how, error, words in (
        ([], {}, ValueError, "has no rows"),
        (nothing, {}, ValueError, "has no rows"),
        ([[0, 0]], {}, ValueError, r"shape \(1, 2\)"),
        ([[0, 0, 1], [1, 1]], {}, ValueError, "unequal length"),
        ([[0, 0, NAN]], {}, ValueError, "no known value"),
        ([[0, 0, None]], {}, TypeError, "object values; convert it to integers or real floats"),
        ([[0, 0, 1], [0, 1, 1], [0, 0, 2]], {}, ValueError, "row 0 and row 2 of the hard data"),
        (good, {"cell": (10, 0)}, ValueError, "give sizes above 0"),
        (good, {"several": "median"}, ValueError, "unknown several 'median'; choose one of: refuse, mean, most"),
        (good, {"outside": "keep"}, ValueError, "unknown outside 'keep'; choose one of: refuse, skip"),
    ):
        with pytest.raises(error, match=words):
            place_hard_data(rows, (2, 2), **how)


def test_the_examples_run():
    result = doctest.testmod(hard_data)
    assert result.attempted and not result.failed

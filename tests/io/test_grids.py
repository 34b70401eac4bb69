"""Grids of GSLIB and SGeMS: values come to their cells whatever the header."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_errors import by_hand, word
from volumes import saved

from simdtex.io.grids import MISSING, check_grid, kind_of, read_grid, write_grid
from simdtex.options import DataWarning

NAN = float("nan")


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

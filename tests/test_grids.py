"""Grids of GSLIB and SGeMS: values come to their cells whatever the header, and a file that is wrong is refused."""

import doctest
import struct
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simdtex.io import grids
from simdtex.io.grids import MISSING, check_grid, kind_of, read_grid, write_grid
from simdtex.options import DataWarning

NAN = float("nan")


def saved(tmp_path, content, name="a.gslib"):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def refused(path, words, read=read_grid):
    with pytest.raises(ValueError, match=words) as said:
        read(path)
    assert "\n" not in str(said.value) and path.name in str(said.value)


CELLS = "".join(f"{k}.5 {k}\n" for k in range(12))
"""Two variables of 3 x 2 x 2 cells: the number of the cell plus a half, and the number."""

HEADERS = {
    "MPSlib": ("3 2 2\n2\na\nb\n", (0, 0, 0), (1, 1, 1)),
    "DeeSse without a corner": ("3 2 2 10 20 0.5\n2\na\nb\n", (0, 0, 0), (10, 20, 0.5)),
    "DeeSse": ("3 2 2   10 20 0.5   100.5 -7 0.3\n2\na\nb\n", (105.5, 3, 0.55), (10, 20, 0.5)),
    "GSLIB of 1992": ("channels\n 2   3   2   2\na\nb\n", (0, 0, 0), (1, 1, 1)),
    "GSLIB": ("a map\n2 3 2 2 105.5 3.0 .55 10. 20. 5E-1\na\nb\n", (105.5, 3, 0.55), (10, 20, 0.5)),
    "GSLIB of one realisation": (
        "a map\r\n2 3 2 2 105.5 3 .55 10 20 .5 1\r\na\r\nb\r\n",
        (105.5, 3, 0.55),
        (10, 20, 0.5),
    ),
    "SGeMS": ("my grid (3x2x2)\n2\na\nb\n", (0, 0, 0), (1, 1, 1)),
}


@pytest.mark.parametrize("case", HEADERS)
def test_every_header_says_the_same_cells(tmp_path, case):
    header, origin, cell = HEADERS[case]
    path = saved(tmp_path, header + CELLS)
    grid = read_grid(path)
    assert (grid.origin, grid.cell) == (origin, cell)
    assert list(grid.values) == ["a", "b"]
    assert grid.values["a"].dtype == np.float64 and grid.values["b"].dtype == np.uint8
    assert np.array_equal(grid.values["a"], np.arange(12).reshape(2, 2, 3) + 0.5), "x fastest, then y, then z"
    assert np.array_equal(grid.values["b"], np.arange(12).reshape(2, 2, 3))
    assert kind_of(path) == "grid"


def test_values_may_stand_in_one_line(tmp_path):
    """As MPSlib writes them."""
    grid = read_grid(saved(tmp_path, "3 2 1\n1\nv\n0 1 2 3 4 5 "))
    assert grid.values["v"].tolist() == [[[0, 1, 2], [3, 4, 5]]]


def test_realisations_follow_each_other(tmp_path):
    path = saved(tmp_path, "SGSIM\n2 2 1 1 0 0 0 1 1 1 3\na\nb\n" + "".join(f"{k} {k + 100}\n" for k in range(6)))
    found = {name: values.ravel().tolist() for name, values in read_grid(path).values.items()}
    assert found == {
        **{"a__real0": [0, 1], "b__real0": [100, 101], "a__real1": [2, 3], "b__real1": [102, 103]},
        **{"a__real2": [4, 5], "b__real2": [104, 105]},
    }


def test_a_name_that_comes_again_gets_a_number(tmp_path):
    assert list(read_grid(saved(tmp_path, "1 1 1\n3\nv\nv\nw\n1 2 3\n")).values) == ["v", "v_1", "w"]


@pytest.mark.parametrize("code", [*MISSING, -1e21, 1e21, 1.70141e38])
@pytest.mark.parametrize("suffix", [".gslib", ".sgems"])
def test_codes_of_unknown_values(tmp_path, code, suffix):
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


GEONE = """#
# # GRID - NUMBER OF CELLS
# NX 3
# NY 2
# NZ 2
# # GRID - CELL SIZE
# SX 10.0
# SY 20.0
# SZ 0.5
# # GRID - ORIGIN (bottom-lower-left corner)
# OX 100.5
# OY -7
# OZ 0.3
# # GRID - FILLING
# SORTING +X+Y+Z
#
a b
"""


def test_a_text_of_geone(tmp_path):
    path = saved(tmp_path, GEONE + CELLS, "ti.txt")
    grid = read_grid(path)
    assert kind_of(path) == "grid" and (grid.origin, grid.cell) == ((105.5, 3, 0.55), (10, 20, 0.5))
    assert np.array_equal(grid.values["b"], np.arange(12).reshape(2, 2, 3))
    assert list(read_grid(path, variables=["b"]).values) == ["b"]
    refused(path, "has no variable 'c': give one of a, b", lambda path: read_grid(path, variables=["c"]))
    refused(saved(tmp_path, GEONE.replace("+Y", "-Y") + CELLS), r"sorted as \+X-Y\+Z: save it with SORTING \+X\+Y\+Z")
    refused(saved(tmp_path, GEONE + CELLS + "\nsand\n"), "has more values than its header says")
    refused(saved(tmp_path, GEONE + CELLS.replace("4.5 4", "4.5 x")), "line 22 has 'x', not a number")


def test_words_may_follow_the_number_of_variables(tmp_path):
    grid = read_grid(saved(tmp_path, "3 2 2\n2 variables, of wells\na\nb\n" + CELLS))
    assert list(grid.values) == ["a", "b"] and grid.values["b"].shape == (2, 2, 3)


@pytest.mark.parametrize(
    ("numbers", "dtype"),
    [
        ("0 255", "uint8"), ("0 256", "int16"), ("-1 255", "int16"), ("0 32768", "int32"), ("0 2147483648", "float64"),
        ("0 0.5", "float64"), ("0 1e1", "uint8"), ("0 inf", "float64"),
    ],
)  # fmt: skip
def test_whole_numbers_are_integers_of_the_smallest_type(tmp_path, numbers, dtype):
    assert read_grid(saved(tmp_path, f"2 1 1\n1\nv\n{numbers}\n")).values["v"].dtype == dtype


def word(text):
    return struct.pack(">I", len(text) + 1) + text + b"\0"


def by_hand(values, sides=(3, 2, 1), name=b"v", cell=(10.0, 20.0, 0.1), origin=(5.0, -7.5, 0.3)):
    """A file of SGeMS from the description of the format."""
    head = b"\xb2\x11\x17\x5d" + word(b"Cgrid") + word(b"grid") + b"\0\0\0\x64"
    head += b"".join(side.to_bytes(4, "big") for side in sides)
    head += b"".join(struct.pack(">f", number) for number in (*cell, *origin))
    return head + b"\0\0\0\1" + word(name) + b"".join(struct.pack(">f", value) for value in values)


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


def test_decimals_of_sgems_are_the_shortest(tmp_path):
    grid = read_grid(saved(tmp_path, by_hand(range(6))))
    assert (grid.origin, grid.cell) == ((5, -7.5, 0.3), (10, 20, 0.1))


def test_a_name_of_sgems_that_comes_again_gets_a_number(tmp_path):
    content = by_hand([1, 2], (1, 1, 1)).replace(b"\0\0\0\1\0\0\0\2v\0", b"\0\0\0\2" + 2 * b"\0\0\0\2v\0")
    assert list(read_grid(saved(tmp_path, content)).values) == ["v", "v_1"]


def test_regions_of_sgems_are_passed_over(tmp_path):
    regions = word(b"RegionBlock") + b"\0\0\0\1" + word(b"r") + b"\1" * 6
    assert read_grid(saved(tmp_path, by_hand(range(6)) + regions)).values["v"].max() == 5
    refused(saved(tmp_path, by_hand(range(6)) + word(b"Region")), "longer than its header says")
    refused(saved(tmp_path, by_hand(range(6)) + b"\0" * 4), "longer than its header says")


def test_a_text_byte_by_byte(tmp_path):
    values = {"por": np.array([[0.1, NAN], [1e-9, 2.0]]), "facies": np.array([[1, 2], [3, 4]], np.int16)}
    write_grid(tmp_path / "a.gslib", values, origin=(0.1, 1000.7), cell=(0.1, 25))
    text = "2 2 1 0.1 25.0 1.0 0.05 988.2 -0.5\n2\npor\nfacies\n0.1 1\n-9966699 2\n1e-09 3\n2.0 4\n"
    assert (tmp_path / "a.gslib").read_text() == text
    with pytest.warns(DataWarning):
        assert read_grid(tmp_path / "a.gslib").origin == (0.1, 1000.7, 0)


KINDS = ["bool", "uint8", "int16", "int32", "float32", "float64"]


@given(
    kind=st.sampled_from(KINDS),
    sides=st.tuples(*[st.integers(1, 3)] * 3),
    numbers=st.lists(st.floats(0, 1), min_size=27, max_size=27),
    origin=st.tuples(*[st.decimals(-9999, 9999, places=2).map(float)] * 3),
    cell=st.tuples(*[st.decimals(1, 99, places=2).map(float)] * 3),
    suffix=st.sampled_from([".gslib", ".sgems"]),
    variables=st.integers(1, 2),
)
def test_what_is_written_is_read(tmp_path_factory, kind, sides, numbers, origin, cell, suffix, variables):
    path = tmp_path_factory.getbasetemp() / f"any{suffix}"
    values = np.array(numbers[: np.prod(sides)]).reshape(sides[::-1])
    values = values.astype(kind) if kind[0] == "f" else (values * 100).astype(kind)
    hidden = values == values.flat[0]
    arrays = {f"v{k}": np.ma.MaskedArray(values, hidden if k else False) for k in range(variables)}
    write_grid(path, arrays, origin=origin, cell=cell)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        grid = read_grid(path)
    if suffix == ".sgems":
        assert np.allclose(grid.origin, origin, rtol=1e-6, atol=0) and grid.cell == cell
    else:
        assert (grid.origin, grid.cell) == (origin, cell)
    exact = np.float32 if suffix == ".sgems" else values.dtype
    assert list(grid.values) == list(arrays)
    assert np.array_equal(grid.values["v0"].astype(exact), values.astype(exact))
    if variables == 2:
        assert np.array_equal(np.isnan(grid.values["v1"]), hidden)


@pytest.mark.parametrize("suffix", [".gslib", ".sgems"])
def test_a_file_that_is_cut_short_at_any_byte_is_refused(tmp_path, suffix):
    path = tmp_path / f"whole{suffix}"
    write_grid(path, {"porosity": np.arange(6).reshape(2, 3) + 10.25, "facies": np.arange(6).reshape(2, 3) + 10})
    content = path.read_bytes()
    assert len(content) > 100
    for length in range(len(content)):
        refused(saved(tmp_path, content[:length], f"cut{suffix}"), ".")


TEXTS = {
    "nothing": ("", "line 2 is '' and not the number of variables"),
    "no number of variables": ("title\nporosity\n1\n", "line 2 is 'porosity' and not the number of variables"),
    "no variables": ("3 2 1\n0\n1 2 3 4 5 6\n", "line 2 is '0' and not"),
    "no sizes": (
        "a title\n1\nv\n1\n2\n",
        "do not say how many cells .* write nx ny nz on the first line, as 250 250 1",
    ),
    "two sizes": ("3 2\n1\nv\n1\n2\n", "do not say how many cells"),
    "a size in words": ("a\n1 3 two 1\nv\n1\n2\n", "do not say how many cells"),
    "no cells": ("3 0 1\n1\nv\n1\n", "its header says 3 x 0 x 1 cells: give whole numbers"),
    "half a cell": ("3 2.5 1\n1\nv\n1\n", "its header says 3 x 2.5 x 1 cells: give whole numbers"),
    "half a realisation": ("a\n1 2 1 1 0 0 0 1 1 1 0.5\nv\n1 2\n", "cells: give whole numbers"),
    "cells of no size": ("2 1 1 1 0 1\n1\nv\n1 2\n", r"cell is \(1.0, 0.0, 1.0\); give sizes above 0"),
    "cells that are too small": ("a\n1 2 1 1 1e20 0 0 1 1 1\nv\n1 2\n", "cannot be told apart"),
    "names that are missing": ("3 2 1\n9\na\nb\n", "line 5 has no name of a variable"),
    "more variables than there are": (
        "2 1 1\n2\na\nb\n1\n2\n",
        "too short for what its header says, 2 x 1 x 1 cells of 2 v",
    ),
    "too few values": (
        "3 2 1\n1\nv\n1\n2\n3\n4\n10000\n",
        "has 5 values and its header says 3 x 2 x 1 cells of 1 variable, 6",
    ),
    "too many values": ("2 1 1\n1\nv\n1\n2\n3\n", "has more values than its header says, 2 x 1 x 1"),
    "no number": ("2 1 1\n1\nv\n1\nsand\n", "line 5 has 'sand', not a number: correct it"),
    "a decimal comma": ("2 1 1\n1\nv\n1\n0,5\n", "line 5 has '0,5', not a number"),
    "no end of the line": ("2 1 1\n1\nv\n1\n10", "ends without the end of a line, .* add the end of the line"),
    "no end of the last line": ("2 1 1\n1\nv\n1\n0", "ends without the end of a line"),
    "more than any memory": ("999999999 999999999 9\n1\nv\n1\n", "pixels and no more than"),
    "more than there is": ("1000 1000 1\n1\nv\n" + "1\n" * 99, "too short for what its header says, 1000 x 1000 x 1"),
}


@pytest.mark.parametrize("case", TEXTS)
def test_texts_that_are_wrong(tmp_path, case):
    text, words = TEXTS[case]
    refused(saved(tmp_path, text), rf"a\.gslib.*{words}")


BINARY = {
    "a point set": (
        by_hand(range(6)).replace(b"Cgrid", b"Point"),
        "holds the object 'Point' of SGeMS: save a Cartesian",
    ),
    "an old version": (by_hand(range(6)).replace(b"\0\0\0\x64", b"\0\0\0\x63"), "is of the version 99"),
    "no cells": (by_hand([], (3, 0, 1)), "3 x 0 x 1 cells and 1 properties"),
    "a cell of no size": (by_hand(range(6), cell=(1, 1, 0)), "give sizes above 0"),
    "an origin that is no number": (by_hand(range(6), origin=(NAN, 1, 0)), "origin is .*; give"),
    "a value too few": (by_hand(range(5)), "ends before the last of 6 values, 3 x 2 x 1 cells of 1 property"),
    "a value too many": (by_hand(range(7)), "longer than its header says"),
    "more than any memory": (by_hand(range(6), (2**32 - 1,) * 3), "pixels and no more than"),
    "more than there is": (by_hand(range(6), (1000, 1000, 1)), "ends before the last of 1000000 values"),
    "a long name": (by_hand(range(6)).replace(b"\0\0\0\2v", b"\xff\xff\xff\xffv"), "ends within its header"),
}


@pytest.mark.parametrize("case", BINARY)
def test_files_of_sgems_that_are_wrong(tmp_path, case):
    content, words = BINARY[case]
    refused(saved(tmp_path, content, "a.sgems"), rf"a\.sgems.*{words}")


def test_files_that_are_none(tmp_path):
    refused(tmp_path / "none.gslib", "does not exist: check the path of the grid")
    refused(tmp_path, "is a folder")
    path = saved(tmp_path, "2 2 1\n1\nv\n1 2 3 4\n")
    assert read_grid(path, max_pixels=4).values["v"].size == 4
    refused(path, "has 4 pixels and no more than 3", lambda path: read_grid(path, max_pixels=3))


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("wells\n3\nX\nY\nv\n1 2 3\n", "points"), ("1 2 3\n4 5 6\n", None), ("x y a b\n5 6 7 8\n1 2 3 4\n", None),
        ("x,y,v\n1,2,3\n", None), ("", None), ("5 5 1\n1\nv\n", "grid"), ("t\n1 5 5 1\nv\n", "grid"),
        ("t\n1 5 5 1\na name of four\n", "grid"),
        ("a (5x5x1)\n1\nv\n", "grid"), ("a\nfacies\n1\n", None), ("wells\n3 columns\nX\n", "points"), 
        ("id well x y\n1 A-1 5 6\n2 A-2 7 8\n", None),
        ("# NX 5\n# NY 5\n", "grid"), ("# x y v\n1 2 3\n", None), ("\x89PNG\n", None),
    ],
)  # fmt: skip
def test_a_file_is_told_by_its_first_lines(tmp_path, text, kind):
    assert kind_of(saved(tmp_path, text, "a.txt")) == kind


def test_what_is_no_file_is_no_grid(tmp_path):
    assert kind_of(tmp_path) is None and kind_of(tmp_path / "none") is None
    assert kind_of(saved(tmp_path, by_hand(range(6)), "any")) == "grid"


GOOD = {"v": np.ones((2, 3))}
ARGUMENTS = {
    "another suffix": ("a.png", GOOD, {}, ValueError, "names no format of grids: end its name in one of .gslib, .sg"),
    "no folder": ("none/a.gslib", GOOD, {}, ValueError, "does not exist: create it"),
    "nothing": ("a.gslib", {}, {}, ValueError, "have the shapes"),
    "two sizes": ("a.gslib", GOOD | {"w": np.ones((3, 2))}, {}, ValueError, "have the shapes"),
    "one axis": ("a.gslib", {"v": np.ones(3)}, {}, ValueError, r"give \(nz, ny, nx\) or \(ny, nx\)"),
    "complex": ("a.gslib", {"v": np.ones((2, 3), complex)}, {}, TypeError, "holds complex128 values"),
    "a name of two lines": ("a.gslib", {"v\nw": np.ones((2, 3))}, {}, ValueError, "has the name"),
    "an empty name": ("a.sgems", {" ": np.ones((2, 3))}, {}, ValueError, "has the name"),
    "a missing value": ("a.gslib", {"v": np.array([[-999, 0]])}, {}, ValueError, "cannot hold -999, which is a code"),
    "integers of 25 bits": ("a.sgems", {"v": np.full((2, 3), 2**24 + 1)}, {}, ValueError, "end its name in .gslib"),
    "vast floats": ("a.sgems", {"v": np.full((2, 3), 1e39)}, {}, ValueError, "cannot hold 1e.39, .* 32-bit floats"),
    "far away": ("a.sgems", GOOD, {"origin": (4.5e6 + 0.3, 0)}, ValueError, "x = 4500000.3 .* end its name in .gslib"),
    "four numbers": ("a.gslib", GOOD, {"origin": (1, 2, 3, 4)}, ValueError, "origin is .*; give"),
    "unequal numbers": ("a.gslib", GOOD, {"origin": (1, 2, 3), "cell": (1, 2)}, ValueError, "origin has 3 .* cell 2"),
    "one number": ("a.gslib", GOOD, {"cell": 5}, ValueError, "cell is 5; give"),
    "words": ("a.gslib", GOOD, {"cell": "ab"}, ValueError, "cell is 'ab'; give"),
    "numbers beyond 32-bit floats": ("a.gslib", GOOD, {"origin": (1e31, 0)}, ValueError, "numbers below 1e.30"),
    "a size of next to nothing": ("a.gslib", GOOD, {"cell": (1, 1e-31)}, ValueError, "above 0, from 1e-30 on"),
    "a negative size": ("a.gslib", GOOD, {"cell": (1, -1)}, ValueError, "give sizes above 0"),
}  # fmt: skip


@pytest.mark.parametrize("case", ARGUMENTS)
def test_what_cannot_be_written_is_refused_and_nothing_is_left(tmp_path, case):
    name, values, lies, error, words = ARGUMENTS[case]
    with pytest.raises(error, match=words) as said:
        write_grid(tmp_path / name, values, **lies)
    assert "\n" not in str(said.value) and list(tmp_path.iterdir()) == []


def test_the_check_before_a_run_is_that_of_the_writer(tmp_path):
    assert check_grid(tmp_path / "a.sgems", [np.ones((2, 2))], (5, 6), None) == ((5, 6), (1, 1))
    assert check_grid(tmp_path / "a.sgems", [], None, (2, 3, 4)) == ((0, 0, 0), (2, 3, 4))
    with pytest.raises(ValueError, match="32-bit floats"):
        check_grid(tmp_path / "a.sgems", [np.ones(2), np.array([1e39])], None, None)
    assert check_grid(tmp_path / "a.gslib", [np.array([1e39, NAN])], (4.5e6 + 0.3, 0), None)


def test_the_examples_run():
    assert not doctest.testmod(grids).failed

"""The table of error sentences: what is wrong with a file is said in one line that names the file."""

import struct

import numpy as np
import pytest
from volumes import saved

from simdtex.io.grids import read_grid
from simdtex.io.hard_data import read_hard_data
from simdtex.io.image import read

NAN = float("nan")


def word(text):
    return struct.pack(">I", len(text) + 1) + text + b"\0"


def by_hand(values, sides=(3, 2, 1), cell=(10.0, 20.0, 0.1), origin=(5.0, -7.5, 0.3)):
    """A file of SGeMS from the description of the format."""
    head = b"\xb2\x11\x17\x5d" + word(b"Cgrid") + word(b"grid") + b"\0\0\0\x64"
    head += b"".join(side.to_bytes(4, "big") for side in sides)
    head += b"".join(struct.pack(">f", number) for number in (*cell, *origin))
    return head + b"\0\0\0\1" + word(b"v") + b"".join(struct.pack(">f", value) for value in values)


PICTURES = [
    (b"", "is empty"),
    (b"8BPS\0\1" + bytes(20), r"is a Photoshop document \(PSD\): export it as PNG or TIFF"),
    (b"DDS |" + bytes(120), r"is a texture of DirectX \(DDS\): export it"),
    (b"\0\0\1\0\1\0\x10\x10" + bytes(30), r"is an icon \(ICO\): export it"),
    (b"\xff\x0a" + bytes(30), "is a JPEG XL picture: save it"),
    (b"#?RADIANCE\n", r"is a Radiance picture \(HDR\): save it as OpenEXR"),
    (b"<?xml version='1.0'?>\n<svg xmlns='http://www.w3.org/2000/svg'/>", "is a drawing .*SVG.: export it"),
    (b"%PDF-1.7\n", r"is a drawing \(PDF"),
    (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 20 20\n", "is a drawing"),
    (b"II*\0\x10\0\0\0CR\2\0" + bytes(40), "is a camera's raw file: develop it"),
    (b"\0\0\0\x18ftypcrx " + bytes(40), "is a camera's raw file: develop it"),
    (bytes(128) + b"DICM" + bytes(40), "is a DICOM picture: convert it to NRRD"),
    (b"II*\0\x54\x18\x08\0" + bytes(120) + b"DICM" + bytes(40), "is a DICOM picture: convert it to NRRD"),
    (b"NRRD0004\n", "is a volume .*: simdtex simulate reads it"),
    (b'<?xml version="1.0"?>\n<VTKFile type="ImageData">', "is a volume .*: simdtex simulate reads it"),
    (b"PK\3\4" + bytes(40), "is an archive .*: unpack it"),
    (b"hello, world", "is not an image: give a PNG, JPEG, TIFF"),
    (bytes(range(256)) * 9, "is not an image: give a PNG, JPEG, TIFF"),
    (b"P5 2 2 255 \0\0\0", "cannot be read as an image"),
    (b"P2 2 2 255 1 2 3", "cannot be read as an image"),
    (b"P2 2 2 255 1 2 x 4", "cannot be read as an image"),
    (b"P2 2 2 3 1 2 3 4", "value that is not 0 to 3"),
    (b"P2 2 2 3 1 2 3 -1", "value that is not 0 to 3"),
    (b"P5 2 2 0 \0\0\0\0", "largest value is 0, not 1 to 65535"),
    (b"P5 2 2 65536 " + bytes(8), "largest value is 65536"),
    (b"P5 0 2 255 ", "shape"),
    (b"P5 999999999 999999999 255 ", "no more than"),
    (b"P5 2 two", "cannot be read as an image"),
]

TEXTS = [
    ("", "line 2 is '' and not the number of variables"),
    ("title\nporosity\n1\n", "line 2 is 'porosity' and not the number of variables"),
    ("3 2 1\n0\n1 2 3 4 5 6\n", "line 2 is '0' and not"),
    ("a title\n1\nv\n1\n2\n", "do not say how many cells .* begin with nx ny nz, as 250 250 1"),
    ("3 2\n1\nv\n1\n2\n", "do not say how many cells"),
    ("a\n1 3 two 1\nv\n1\n2\n", "do not say how many cells"),
    ("3 0 1\n1\nv\n1\n", "its header says 3 x 0 x 1 cells: give whole numbers"),
    ("3 2.5 1\n1\nv\n1\n", "its header says 3 x 2.5 x 1 cells: give whole numbers"),
    ("a\n1 2 1 1 0 0 0 1 1 1 0.5\nv\n1 2\n", "cells: give whole numbers"),
    ("2 1 1 1 0 1\n1\nv\n1 2\n", r"cell is \(1.0, 0.0, 1.0\); give sizes above 0"),
    ("a\n1 2 1 1 1e20 0 0 1 1 1\nv\n1 2\n", "cannot be told apart"),
    ("3 2 1\n9\na\nb\n", "line 5 has no name of a variable"),
    ("2 1 1\n2\na\nb\n1\n2\n", "too short for what its header says, 2 x 1 x 1 cells of 2 v"),
    ("3 2 1\n1\nv\n1\n2\n3\n4\n10000\n", "has 5 values and its header says 3 x 2 x 1 cells of 1 variable, 6"),
    ("2 1 1\n1\nv\n1\n2\n3\n", "has more values than its header says, 2 x 1 x 1"),
    ("2 1 1\n1\nv\n1\nsand\n", "line 5 has 'sand', not a number: correct it"),
    ("2 1 1\n1\nv\n1\n10", "ends without the end of a line, .* add the end of the line"),
    ("999999999 999999999 9\n1\nv\n1\n", "pixels and no more than"),
    ("1000 1000 1\n1\nv\n" + "1\n" * 99, "too short for what its header says, 1000 x 1000 x 1"),
]

BINARY = [
    (by_hand(range(6)).replace(b"Cgrid", b"Point"), "holds the object 'Point' of SGeMS: save a Cartesian"),
    (by_hand(range(6)).replace(b"\0\0\0\x64", b"\0\0\0\x63"), "is of the version 99"),
    (by_hand([], (3, 0, 1)), "3 x 0 x 1 cells and 1 properties"),
    (by_hand(range(6), cell=(1, 1, 0)), "give sizes above 0"),
    (by_hand(range(6), origin=(NAN, 1, 0)), "origin is .*; give"),
    (by_hand(range(5)), "ends before the last of 6 values, 3 x 2 x 1 cells of 1 property"),
    (by_hand(range(7)), "longer than its header says"),
    (by_hand(range(6)) + word(b"Region"), "longer than its header says"),
    (by_hand(range(6), (2**32 - 1,) * 3), "pixels and no more than"),
    (by_hand(range(6), (1000, 1000, 1)), "ends before the last of 1000000 values"),
    (by_hand(range(6)).replace(b"\0\0\0\2v", b"\xff\xff\xff\xffv"), "ends within its header"),
]

TABLES = [
    ("", "the table is empty: give a line"),
    ("x,y,value\n", "a header and no rows"),
    ("1,2\n3,4\n", "line 1 has 2 cells: give x, y and one value or more"),
    ("x,y,value\n\n1,2,3\n4,5\n", "line 4 has 2 cells and those before it 3"),
    ("x,y,value\n1,2,sand\n", r"line 2 has 'sand' in column 3, .* leave the cell .* empty, or .*of categories \(--cat"),
    ("1,2,3\n1,,3\n", "line 2 has '' in column 2, which is no number: write numbers with a decimal point$"),
    ("1,5;2,5;3.5\n", "the comma of '1,5' may be one of thousands: write .* decimal point$"),
    ('x,y,v\n"1,500","2,500",3\n', "the comma of '1,500' may be one of thousands"),
    ("# northing foo v\n1 2 3\n", "no column of 'northing', 'foo', 'v' is called x"),
    ("depth,por,facies\n1,2,3\n", "no column of 'depth', 'por', 'facies' is called x, .* --columns x=1"),
    ("x,lon,y,v\n1,2,3,4\n", "the columns 'x' and 'lon' mean x: choose one, as .* --columns x=1"),
    ("x,y,v,v\n1,2,3,4\n", "two columns are called v: rename one"),
    ('x,y,value\n1,2,"3\n', "cannot be split into cells .* quotation marks"),
    ("1,2,3\n4,5,6,7\n", "line 2 has 4 cells and those before it 3"),
    (b"x,y,value\n1,2,\xff\n", "is no text in UTF-8"),
    ("1,2," + "9" * 200_000, "cannot be split into cells"),
]

POINTS = [
    ("a\n2\nX\nY\n1 2\n", "line 5 has 2 cells: give x, y and one value"),
    ("a\n3\nX\nY\n", ".* no line after the names of 3 columns"),
    ("a\n3\nwell\nX\nv\n1 2 3\n", "no column of 'well', 'X', 'v' is called y, .* y=1"),
    ("a\n3\nX\nY\nv\n1 2 3\n1 2\n", "line 7 has 2 cells and those before it 3"),
    ("a\n3\nX\nY\nv\n1 2 3\n1 2 sand\n", "line 7 has 'sand' in column 3, which is no number"),
]

TABLE = [
    *(("a.pgm", read, *row) for row in PICTURES),
    *(("a.gslib", read_grid, *row) for row in TEXTS),
    *(("a.sgems", read_grid, *row) for row in BINARY),
    *(("a.csv", read_hard_data, *row) for row in TABLES),
    *(("a.eas", read_hard_data, *row) for row in POINTS),
]


@pytest.mark.parametrize(("name", "reader", "content", "words"), TABLE, ids=range(len(TABLE)))
def test_a_wrong_file_gets_one_sentence(tmp_path, name, reader, content, words):
    path = saved(tmp_path, content, name)
    with pytest.raises(ValueError, match=words) as said:
        reader(path)
    assert str(path) in str(said.value) and "\n" not in str(said.value) and len(str(said.value)) < 400


@pytest.mark.parametrize("reader", [read, read_grid, read_hard_data])
def test_what_is_no_file_gets_one_sentence(tmp_path, reader):
    for path, words in ((tmp_path / "none.csv", "does not exist: check"), (tmp_path, "is a folder"), ("a\0b", "null")):
        with pytest.raises(ValueError, match=words):
            reader(path)


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (np.zeros((0, 3)), "has no rows"),
        (np.zeros((4, 2)), r"shape \(4, 2\): give"),
        (np.zeros(3), r"shape \(3,\): give"),
        (np.array([["1", "2", "3"]]), "<U1 values; convert it to integers or real floats"),
        (np.zeros((2, 3), complex), "complex128 values"),
    ],
)
def test_arrays_that_are_no_tables(tmp_path, array, words):
    path = tmp_path / "a.npy"
    np.save(path, array)
    data = path.read_bytes()
    with pytest.raises(ValueError, match=rf"a\.npy: .*{words}"):
        read_hard_data(path)
    for damaged in (b"", b"1,2,3\n", data[:90], data.replace(b"}", b"("), data.replace(b"(", b"((")):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match=r"^\S*a\.npy: [^\n]*$"):
            read_hard_data(path)

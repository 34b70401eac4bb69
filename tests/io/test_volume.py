"""Solid textures go to a file and back without a value changed; what a format cannot hold is said before the work."""

import bz2
import gzip
import os
import re
import struct
import tracemalloc
import zlib

import nrrd
import numpy as np
import PIL.Image
import pytest
import tifffile
from volumes import loaded, noise

from simdtex.cli.inputs import Reading, read_pixels
from simdtex.io import files, image, volume

WHOLE = ("uint8", "uint16", "uint32", "uint64", "int8", "int16", "int32", "int64")
FORMATS = {
    ".npz": (("bool", "float16", "uint64", ">i4"), (None, 1, 5)),
    ".NPY": (("bool", "float64", ">f8"), (None, 1, 3)),
    ".tif": ((*WHOLE, "float16", "float32", "float64", ">u2"), (None, 1, 2, 3, 4, 5)),
    ".nrrd": ((*WHOLE, "float32", "float64", ">f4"), (None, 1, 3, 11)),
    "": (("uint8", "uint16", ">u2"), (None, 1, 2, 3, 4)),
}
"""The table of formats: the types and the numbers of channels that each holds."""


@pytest.mark.parametrize("suffix", FORMATS)
def test_what_is_written_is_read_as_what_it_was(tmp_path, suffix):
    """By the libraries of the formats and by `read`, also an alpha that is opaque."""
    path, (types, numbers) = tmp_path / f"block{suffix}", FORMATS[suffix]
    for dtype, channels in [*((dtype, None) for dtype in types), *((types[-1], channels) for channels in numbers)]:
        values = noise((4, 3, 5) if channels is None else (4, 3, 5, channels), dtype)
        if channels in (2, 4):
            values[..., -1] = np.iinfo(dtype).max if values.dtype.kind in "iu" else 1
        volume.check_writable(path, values.dtype, channels or 1)
        volume.write(path, values)
        grid = volume.read(path)
        assert volume.is_volume(path) and (grid.origin, grid.cell) == ((0, 0, 0), (1, 1, 1))
        for back in (loaded(path), stacked(grid)):
            assert back.dtype.newbyteorder("=") == values.dtype.newbyteorder("=")
            np.testing.assert_array_equal(back.reshape(4, 3, 5, -1), values.reshape(4, 3, 5, -1))
        assert loaded(path).ndim == (3 if channels is None or (channels == 1 and suffix not in (".npz", ".NPY")) else 4)
    for shape in ((1, 1, 1), (1, 4, 3), (3, 1, 4), (2, 5, 1), (1, 2, 2, 3)):
        volume.write(path, noise(shape))
        np.testing.assert_array_equal(loaded(path), noise(shape), strict=True)
    assert os.listdir(tmp_path) == [path.name]


def test_in_an_nrrd_x_runs_fastest_after_the_channels(tmp_path):
    values = noise((2, 3, 4, 3), "uint16")
    volume.write(tmp_path / "a.nrrd", values)
    header, data = (tmp_path / "a.nrrd").read_bytes().split(b"\n\n", 1)
    assert data == values.tobytes()
    fields = dict(line.split(": ", 1) for line in header.decode().splitlines()[1:] if not line.startswith("#"))
    assert (fields["type"], fields["encoding"], fields["sizes"]) == ("uint16", "raw", "3 4 3 2")
    assert fields["kinds"] == "vector domain domain domain" and b"space" not in header.replace(b"sourceforge", b"")
    np.testing.assert_array_equal(nrrd.read(str(tmp_path / "a.nrrd"))[0], values.T)


def test_slices_are_pictures_and_pages(tmp_path):
    """Of which a folder is replaced as a whole, and whose numbers have as many digits as they need."""
    (tmp_path / "many").mkdir()
    volume._encode(tmp_path / "many", "", noise((1001, 1, 1)))
    assert {"slice-0000.png", "slice-1000.png"} <= {*os.listdir(tmp_path / "many")}
    volume.write(tmp_path / "a", noise((5, 2, 2)))
    values = noise((3, 4, 5, 3))
    volume.write(tmp_path / "a.tif", values)
    volume.write(tmp_path / "a", values)
    assert sorted(os.listdir(tmp_path / "a")) == ["slice-000.png", "slice-001.png", "slice-002.png"]
    with PIL.Image.open(tmp_path / "a.tif") as stack:
        assert stack.n_frames == 3
        for z in range(3):
            stack.seek(z)
            np.testing.assert_array_equal(np.asarray(stack), values[z])
            with PIL.Image.open(tmp_path / "a" / f"slice-{z:03}.png") as picture:
                np.testing.assert_array_equal(np.asarray(picture), values[z])


def test_formats_that_cannot_hold_the_values(tmp_path):
    for name, dtype, channels, remedy in (
        ("a.tif", "bool", 1, ".npz"),
        ("a.nrrd", "bool", 3, ".npz"),
        ("a.nrrd", "float16", 1, ".tif"),
        ("a.tiff", "longdouble", 1, ".npz"),
        ("a", "float32", 3, ".nrrd"),
        ("a", "uint8", 5, ".nrrd"),
        ("a", "int16", None, ".nrrd"),
    ):
        sentence = rf"cannot hold {dtype.replace('longdouble', 'float128')} .*: end its name in \{remedy} instead$"
        with pytest.raises(ValueError, match=sentence):
            volume.check_writable(tmp_path / name, dtype, channels)
        with pytest.raises(ValueError, match=sentence):
            volume.write(tmp_path / name, np.zeros((2, 2, 2, channels or 1), dtype))
        volume.check_writable(tmp_path / f"a{remedy}", dtype, channels)
    with pytest.raises(TypeError, match="real"):
        volume.write(tmp_path / "a.npy", np.zeros((2, 2, 2), complex))
    for shape in [(4, 4), (2, 2, 2, 2, 2), (0, 2, 2)]:
        with pytest.raises(ValueError, match=re.escape(str(shape))):
            volume.write(tmp_path / "a.npy", np.zeros(shape))
    assert os.listdir(tmp_path) == []


def test_places_that_cannot_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes.txt").touch()
    for name, words in [
        ("none/a.tif", "the folder .* does not exist"),
        ("a.vti", r"ends in \.vti: .* \.tiff, or give a name without suffix"),
        ("file", "is a file"),
        ("full", "holds other files"),
        ("file/a", "the folder .* does not exist"),
        ("a" * 300, "cannot be written"),
    ]:
        with pytest.raises(ValueError, match=words):
            volume.check_writable(tmp_path / name, np.uint8, 3)
    (tmp_path / "slices").mkdir()
    volume.check_writable(tmp_path / "slices")
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write anywhere
    for name in ("a.npz", "a", "slices"):
        with pytest.raises(ValueError, match="not writable"):
            volume.check_writable(tmp_path / name)


def stacked(grid):
    """The volume of a grid, (layers, rows, cols, variables)."""
    return np.stack(list(grid.values.values()), -1)


def test_what_may_be_a_picture_is_no_volume(tmp_path):
    for shape, picture, with_channels in [((5, 6), True, True), ((3, 5, 6), False, True), ((2, 3, 5, 6), False, False)]:
        np.save(tmp_path / "a.npy", np.ones(shape))
        assert volume.is_volume(tmp_path / "a.npy") != picture
        assert volume.is_volume(tmp_path / "a.npy", channels=True) != with_channels
    volume.write(tmp_path / "a.tif", np.ones((1, 5, 6)))
    assert not volume.is_volume(tmp_path / "a.tif")


@pytest.mark.parametrize("suffix", [".nrrd", ".tif", ".npy", ".npz", ".mha", ".vti"])
def test_a_damaged_or_large_volume_gets_one_sentence(tmp_path, suffix):
    path, values = tmp_path / f"block{suffix}", noise((4, 30, 50, 1), "uint16")
    if suffix == ".mha":
        metaimage(path, values[..., 0])
    elif suffix == ".vti":
        vti(path, values)
    else:
        volume.write(path, values)
    with pytest.raises(ValueError, match=re.escape(str(path))) as said:
        volume.read(path, max_pixels=100)
    assert "no more than" in str(said.value)
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(ValueError, match=re.escape(str(path))) as said:
        volume.read(path)
    assert "\n" not in str(said.value)
    with pytest.raises(ValueError, match="does not exist"):
        volume.read(tmp_path / f"none{suffix}")


def test_only_regular_files_are_read(tmp_path):
    """None of the readers waits for a FIFO, or reads a device; a folder is slices or nothing."""
    (tmp_path / "empty").mkdir()
    for suffix in (".nrrd", ".mhd", ".vti", ".raw", ".tif", ".npy", ".npz", ".png", ".gslib"):
        path = tmp_path / f"pipe{suffix}"
        os.mkfifo(path)
        with pytest.raises(ValueError, match="is not a regular file"):
            read_pixels(path, Reading(deep=True))
    with pytest.raises(ValueError, match="is a folder: keep only slices in it"):
        read_pixels(tmp_path / "empty", Reading(deep=True))
    with pytest.raises(ValueError, match="is a folder: give the path of the image"):
        read_pixels(tmp_path / "empty")


# NRRD and MetaImage

NRRD = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 5 3 4\nencoding: {}\n{}\n"
BLOCK = noise((4, 3, 5))


def metaimage(path, values, *more, data="LOCAL"):
    """Write a MetaImage of little-endian values, (layers, rows, cols) or with channels."""
    kind = {"uint8": "UCHAR", "uint16": "USHORT", "int16": "SHORT", "float32": "FLOAT", "int64": "LONG_LONG"}
    sides, parts = values.shape[2::-1], values.shape[3:] or (1,)
    lines = ["ObjectType = Image", "NDims = 3", "BinaryData = True", *more, f"DimSize = {' '.join(map(str, sides))}"]
    lines += [f"ElementNumberOfChannels = {parts[0]}", f"ElementType = MET_{kind[values.dtype.name]}"]
    path.write_bytes("\n".join([*lines, f"ElementDataFile = {data}\n"]).encode() + values.tobytes() * (data == "LOCAL"))


HEADERS = {
    "a.nhdr": lambda path, data: path.write_bytes(NRRD.format("raw", f"datafile: {data}").encode()),
    "a.mhd": lambda path, data: metaimage(path, BLOCK, data=data),
}


@pytest.mark.parametrize("name", ["a.nhdr", "a.mhd"])
def test_a_header_names_a_file_in_its_folder_alone(tmp_path, name):
    (tmp_path / "own" / "sub").mkdir(parents=True)
    path = tmp_path / "own" / name
    for place in ("secret.raw", "own/block.raw", "own/sub/block.raw"):
        (tmp_path / place).write_bytes(BLOCK.tobytes())
    HEADERS[name](path, "block.raw")
    np.testing.assert_array_equal(stacked(volume.read(path))[..., 0], BLOCK)
    (path.parent / "link.raw").symlink_to(tmp_path / "secret.raw")
    os.mkfifo(path.parent / "pipe.raw")
    for data in ("../secret.raw", "sub/block.raw", "LIST", "block%d.raw 1 4 1"):
        HEADERS[name](path, data)
        with pytest.raises(ValueError, match=r"names the data file .*: put the data into one file in the folder"):
            volume.read(path)
    HEADERS[name](path, "link.raw")
    with pytest.raises(ValueError, match=r"refers to .*secret\.raw in another folder: save all values in one file"):
        volume.read(path)
    HEADERS[name](path, "pipe.raw")
    with pytest.raises(ValueError, match="not a regular file"):
        volume.read(path)


@pytest.mark.parametrize("kind", ["gzip", "bzip2", "mhd"])
def test_data_unpack_to_what_the_header_states_and_no_further(tmp_path, kind):
    pack = {"gzip": gzip.compress, "bzip2": bz2.compress, "mhd": zlib.compress}[kind]

    def write(path, data):
        if kind == "mhd":
            metaimage(path, BLOCK, "CompressedData = True", data="a.zraw")
            path.with_name("a.zraw").write_bytes(pack(data))
        else:
            path.write_bytes(NRRD.format(kind, "").encode() + pack(data))

    path = tmp_path / ("a.mhd" if kind == "mhd" else "a.nrrd")
    write(path, BLOCK.tobytes())
    np.testing.assert_array_equal(stacked(volume.read(path))[..., 0], BLOCK)
    write(path, BLOCK.tobytes() + bytes(2**24))
    tracemalloc.start()
    try:
        np.testing.assert_array_equal(stacked(volume.read(path, max_pixels=100_000))[..., 0], BLOCK)
        assert tracemalloc.get_traced_memory()[1] < 2**22
    finally:
        tracemalloc.stop()
    write(path, BLOCK.tobytes()[:-1])
    with pytest.raises(ValueError, match="cannot be read as a volume"):
        volume.read(path)


@pytest.mark.parametrize(
    ("fields", "origin", "cell", "turned"),
    [
        ("spacings: 2 3 0.5\n", (0, 0, 0), (2, 3, 0.5), ()),
        (
            "space: LPS\nspace directions: (-2,0,0) (0,3,0) (0,0,-4)\nspace origin: (1,2,3)\n",
            (-7, 2, -9),
            (2, 3, 4),
            (0, 2),
        ),
        ("space: LPS\nspace directions: (0,3,4) (1,0,0) (0,-4,3)\nspace origin: (1,2,3)\n", (0, 0, 0), (5, 1, 5), ()),
    ],
)
def test_an_nrrd_keeps_the_place_of_its_cells(tmp_path, fields, origin, cell, turned):
    (tmp_path / "a.nrrd").write_bytes(NRRD.format("raw", fields).encode() + BLOCK.tobytes())
    grid = volume.read(tmp_path / "a.nrrd")
    assert (grid.origin, grid.cell) == (origin, cell)
    np.testing.assert_array_equal(stacked(grid)[..., 0], np.flip(BLOCK, turned))


def test_the_kinds_of_an_nrrd_say_which_axis_has_variables(tmp_path):
    values = noise((2, 4, 3, 5))
    head = NRRD.format("raw", "kinds: {}\n").replace("dimension: 3\nsizes: 5 3 4", "dimension: 4\nsizes: 5 3 4 2")
    (tmp_path / "a.nrrd").write_bytes(head.format("domain domain domain list").encode() + values.tobytes())
    np.testing.assert_array_equal(stacked(volume.read(tmp_path / "a.nrrd")), np.moveaxis(values, 0, -1))
    for kinds in ("domain domain domain time", "domain domain domain domain", "vector domain domain list"):
        (tmp_path / "a.nrrd").write_bytes(head.format(kinds).encode() + values.tobytes())
        with pytest.raises(ValueError, match=r"has the axes .*: give three of space"):
            volume.read(tmp_path / "a.nrrd")


@pytest.mark.parametrize(("dtype", "channels"), [("int16", 3), ("float32", None), ("int64", 2)])
def test_a_metaimage_is_read_with_its_place(tmp_path, dtype, channels):
    values = noise((4, 3, 5) if channels is None else (4, 3, 5, channels), dtype)
    metaimage(
        tmp_path / "a.mha", values, "ElementSpacing = 2 3 4", "Offset = 1 2 3", "TransformMatrix = 1 0 0 0 1 0 0 0 -1"
    )
    grid = volume.read(tmp_path / "a.mha")
    assert (grid.origin, grid.cell) == ((1, 2, -9), (2, 3, 4))
    np.testing.assert_array_equal(stacked(grid), values.reshape(4, 3, 5, -1)[::-1])
    metaimage(tmp_path / "b.mha", values.astype(values.dtype.newbyteorder(">")), "BinaryDataByteOrderMSB = True")
    np.testing.assert_array_equal(stacked(volume.read(tmp_path / "b.mha")), values.reshape(4, 3, 5, -1))


# VTK


def vti(path, values, cells=False, origin=(10, 20, 30)):
    """Write an image of VTK, compressed, with values (layers, rows, cols, variables) of points or of cells."""
    import pyvista

    sides = values.shape[2::-1]
    found = pyvista.ImageData(dimensions=[side + cells for side in sides], spacing=(2, 4, 6), origin=origin)
    (found.cell_data if cells else found.point_data)["phase"] = values.reshape(-1, values.shape[3])
    found.save(path)


@pytest.mark.parametrize(("suffix", "dtype", "variables"), [(".vti", "uint8", 1), (".vtk", "int16", 3)])
def test_points_and_cells_of_vtk(tmp_path, suffix, dtype, variables):
    pytest.importorskip("pyvista")
    values = noise((4, 3, 5, variables), dtype)
    for cells, origin in ((False, (10, 20, 30)), (True, (11, 22, 33))):
        vti(tmp_path / f"a{suffix}", values, cells)
        grid = volume.read(tmp_path / f"a{suffix}")
        assert (grid.origin, grid.cell) == (origin, (2, 4, 6))
        assert list(grid.values) == (["phase"] if variables == 1 else [f"phase_{k}" for k in range(variables)])
        np.testing.assert_array_equal(stacked(grid), values, strict=True)


def test_what_vtk_would_take_memory_for_is_refused_before(tmp_path, capfd):
    pyvista = pytest.importorskip("pyvista")
    vti(tmp_path / "a.vti", noise((4, 3, 5, 1)))
    text = (tmp_path / "a.vti").read_text()
    legacy = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 2 1\nORIGIN 0 0 0\n"
    legacy += "SPACING 1 1 1\nPOINT_DATA 6\nFIELD f 1\na 1 999999999 double\n1 2 3 4 5 6\n"
    for name, data, words in (
        ("a.vti", text.replace('"0 4 0 2 0 3"', '"0 40000 0 20000 0 3"'), "no more than"),
        ("a.vti", text.replace('Name="phase"', 'Name="phase" NumberOfComponents="999999999"'), "no more than"),
        ("a.vti", text[:400], "cannot be read as a volume"),
        ("a.vti", "hello", "cannot be read as a volume"),
        ("a.vtk", legacy, "no more than"),
    ):
        (tmp_path / name).write_text(data)
        with pytest.raises(ValueError, match=words) as said:
            volume.read(tmp_path / name)
        assert "\n" not in str(said.value) and not "".join(capfd.readouterr())
    pyvista.RectilinearGrid([0.0, 1.0, 3.0]).save(tmp_path / "b.vtk")
    with pytest.raises(ValueError, match="holds RectilinearGrid of VTK: resample it"):
        volume.read(tmp_path / "b.vtk")


@pytest.mark.parametrize(("name", "library"), [("a.vti", "pyvista"), ("a.exr", "OpenEXR"), ("a.heic", "pillow_heif")])
def test_a_sentence_names_the_extra(tmp_path, monkeypatch, name, library):
    monkeypatch.setattr(files, "find_spec", lambda wanted: None if wanted == library else True)
    start = {"a.exr": b"\x76\x2f\x31\x01", "a.heic": b"\0\0\0\x1cftypheic"}
    (tmp_path / name).write_bytes(start.get(name, b"") + bytes(50))
    with pytest.raises(ValueError, match=r"a\.\w+ is .*: pip install 'simdtex\[(volumes|pictures)\]' to read it$"):
        read_pixels(tmp_path / name, Reading(deep=True))


# raw values and slices


def test_a_raw_volume_says_its_shape_in_its_name(tmp_path):
    values = noise((4, 3, 5), "<f4")
    path = tmp_path / "bonsai_5x3x4_float32.raw"
    path.write_bytes(values.tobytes())
    np.testing.assert_array_equal(stacked(volume.read(path))[..., 0], values)
    for name, words in [
        ("bonsai.raw", "name it with columns x rows x layers and type, as"),
        ("bonsai_5x3x5_float32.raw", r"has \d+ bytes, not \d+ as its name says"),
        ("bonsai_99999x99999x99999_uint8.raw", "no more than"),
    ]:
        path = path.rename(tmp_path / name)
        with pytest.raises(ValueError, match=words):
            volume.read(path)


def test_slices_are_ordered_by_their_number(tmp_path):
    values = noise((11, 3, 5), "uint16")
    for number, layer in enumerate(values, 95):
        image.write(tmp_path / f"scan{number}.tif", layer)
    np.testing.assert_array_equal(stacked(volume.read(tmp_path))[..., 0], values)
    with pytest.raises(ValueError, match="no more than"):
        volume.read(tmp_path, max_pixels=100)
    (tmp_path / "scan97.tif").rename(tmp_path / "scan106.tif")
    with pytest.raises(ValueError, match="has no slice of number 97"):
        volume.read(tmp_path)
    image.write(tmp_path / "scan97.tif", values[0, :2])
    with pytest.raises(ValueError, match="size or type is not that of the first"):
        volume.read(tmp_path)
    (tmp_path / "other9.tif").touch()
    with pytest.raises(ValueError, match="keep only slices in it"):
        volume.read(tmp_path)


# pages of a TIFF


def stack(path, *pages, **options):
    with tifffile.TiffWriter(path) as file:
        for page in pages:
            page, more = page if isinstance(page, tuple) else (page, {})
            file.write(page, metadata=None, **{"photometric": "minisblack"} | options | more)
    return path


def test_a_terrain_with_a_mask_and_overviews_is_one_picture(tmp_path):
    terrain, mask = noise((32, 48), "float32"), noise((32, 48), bool)
    reduced = {"subfiletype": 1}
    inner = {"subfiletype": 4, "photometric": "mask"}
    for masked, pages in ((True, [(mask, inner)]), (False, [(terrain[::2, ::2], reduced)])):
        path = stack(tmp_path / "a.tif", terrain, *pages)
        found = image.read(path)
        assert not volume.is_volume(path) and not found.metadata.more
        np.testing.assert_array_equal(found.pixels, np.where(mask, terrain, np.nan) if masked else terrain)
    for kind in (None, "palette"):  # a preview before the picture
        more = {"photometric": "palette", "colormap": noise((3, 256), "uint16")} if kind else {}
        whole = noise((32, 48))
        path = stack(tmp_path / "b.tif", (whole[::2, ::2], reduced | more), (whole, more))
        assert image.read(path).pixels.shape[:2] == (32, 48) and not volume.is_volume(path)


def test_an_imagej_stack_is_the_whole_stack(tmp_path):
    path, values = tmp_path / "a.tif", noise((20, 2, 6, 7), "uint16")
    about = {"axes": "ZYX", "spacing": 3.0, "unit": "um"}
    tifffile.imwrite(path, values[:, 0], imagej=True, metadata=about, resolution=(2, 4))
    data = bytearray(path.read_bytes())
    with tifffile.TiffFile(path) as file:
        page = file.pages.first
        link = page.offset + 2 + 12 * len(page.tags)
        data[link : link + 4] = bytes(4)  # one header, which all planes follow, as of ImageJ's large stacks
    path.write_bytes(data)
    with tifffile.TiffFile(path) as file:
        assert len(file.pages) == 1
    grid = volume.read(path)
    assert (grid.origin, grid.cell) == ((0, 0, 0), (0.5, 0.25, 3))
    np.testing.assert_array_equal(stacked(grid)[..., 0], values[:, 0])
    assert image.read(path).metadata.more
    tifffile.imwrite(path, values, imagej=True, metadata={"axes": "ZCYX"})
    np.testing.assert_array_equal(stacked(volume.read(path)), np.moveaxis(values, 1, -1))
    assert volume.read(path).cell == (1, 1, 1)
    path.write_bytes(path.read_bytes()[:-50])
    assert volume.is_volume(path)
    with pytest.raises(ValueError, match="cannot be read as a volume"):
        volume.read(path)


def test_axes_of_a_tiff(tmp_path):
    path, values = tmp_path / "a.tif", noise((2, 20, 6, 7), "uint16")
    tifffile.imwrite(path, values, photometric="minisblack", metadata={"axes": "CZYX"})
    np.testing.assert_array_equal(stacked(volume.read(path)), np.moveaxis(values, 0, -1))
    tifffile.imwrite(path, values, photometric="minisblack", ome=True, metadata={"axes": "CZYX"})
    np.testing.assert_array_equal(stacked(volume.read(path)), np.moveaxis(values, 0, -1))
    tifffile.imwrite(path, noise((16, 32, 48)), photometric="minisblack", volumetric=True, tile=(16, 16, 16))
    assert volume.is_volume(path) and stacked(volume.read(path)).shape == (16, 32, 48, 1)
    tifffile.imwrite(path, values[0], photometric="minisblack", compression="jpeg2000")
    with pytest.raises(ValueError, match="is compressed by the method 34712: save it with Deflate"):
        volume.read(path)
    tifffile.imwrite(path, noise((20, 6, 7, 3)), photometric="rgb", metadata={"axes": "ZYXS"})
    assert stacked(volume.read(path)).shape == (20, 6, 7, 3)
    for axes in ("TZYX", "ATYX"):
        tifffile.imwrite(path, values, photometric="minisblack", metadata={"axes": axes})
        with pytest.raises(ValueError, match=f"has the axes {axes}: save a stack of layers"):
            volume.read(path)


def test_the_limit_holds_for_each_page_and_for_all(tmp_path, monkeypatch):
    """A page too large among small ones is another picture; many small ones are too many."""
    path = stack(tmp_path / "a.tif", *noise((9, 30, 40)))
    with pytest.raises(ValueError, match="has 10800 pixels and no more than 10000"):
        volume.read(path, max_pixels=10_000)
    large = 2**13
    for number in (3, 8):  # the third is one that tifffile takes to be like the others
        pages = list(noise((9, 30, 40)))
        pages[number] = np.zeros((large, large), np.uint8)
        stack(path, *pages, compression="zlib")
        tracemalloc.start()
        try:
            with pytest.raises(
                ValueError, match=r"pages of several sizes or types|page is damaged, or of another size"
            ):
                read_pixels(path, Reading(deep=True))
            assert tracemalloc.get_traced_memory()[1] < 2**23
        finally:
            tracemalloc.stop()


@pytest.mark.parametrize("photometric", ["minisblack", "miniswhite"])
def test_few_bits_and_white_is_zero(tmp_path, photometric):
    """Stacks and pictures have the same values, at full scale; a mask of them has white."""
    path = tmp_path / "a.tif"
    for bits in (1, 2, 4, 8, 10, 12, 14, 16):
        top, full = 2**bits - 1, 255 if bits <= 8 else 65535
        values = np.stack([np.arange(32, dtype=np.uint16).reshape(4, 8) * top // 31] * 3)
        if bits in (8, 16, 1):
            written = values.astype(bool if bits == 1 else np.uint8 if bits == 8 else np.uint16)
            stack(path, *written, photometric=photometric)
        else:
            packed_tiff(path, values, bits, photometric == "miniswhite")
        expected = np.rint(values * (full / top))
        expected = full - expected if photometric == "miniswhite" else expected
        found = image.read(path).pixels
        assert found.dtype == (np.uint8 if bits <= 8 else np.uint16)
        np.testing.assert_array_equal(found, expected[0])
        np.testing.assert_array_equal(stacked(volume.read(path))[..., 0], expected)
        np.testing.assert_array_equal(image.read_mask(path, (4, 8)), expected[0] > full / 2)


def packed_tiff(path, pages, bits, white_is_zero):
    """Write a TIFF of pages of packed bits, which tifffile does not write."""
    data, link, (rows, cols) = b"II*\0\0\0\0\0", 4, pages[0].shape
    for page in pages:
        packed = ["".join(f"{value:0{bits}b}" for value in row) for row in page]
        packed = b"".join(int(row, 2).to_bytes(len(row) // 8, "big") for row in packed)
        begin, data = len(data), data + packed + bytes(len(packed) % 2)
        entries = [(256, 4, cols), (257, 4, rows), (258, 3, bits), (259, 3, 1), (262, 3, int(not white_is_zero))]
        entries += [(273, 4, begin), (277, 3, 1), (278, 4, rows), (279, 4, len(packed))]
        data = data[:link] + struct.pack("<I", len(data)) + data[link + 4 :]
        table = b"".join(struct.pack("<HHII", tag, kind, 1, n) for tag, kind, n in entries)
        data += struct.pack("<H", len(entries)) + table
        link, data = len(data), data + bytes(4)
    path.write_bytes(data)

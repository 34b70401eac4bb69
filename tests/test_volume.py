"""Solid textures go to a file and back without a value changed; what a format cannot hold is said before the work."""

import os
import re

import nrrd
import numpy as np
import PIL.Image
import pytest
from volumes import loaded, noise

from simdtex.io import volume

WHOLE = ["uint8", "uint16", "uint32", "uint64", "int8", "int16", "int32", "int64"]
HOLDS = {
    ".npz": ([*WHOLE, "bool", "float16", "float32", "float64", ">i4"], [None, 1, 3, 5]),
    ".NPY": ([*WHOLE, "bool", "float16", "float32", "float64", ">f8"], [None, 1, 3, 5]),
    ".tif": ([*WHOLE, "float16", "float32", "float64", ">u2"], [None, 1, 2, 3, 4, 5]),
    ".nrrd": ([*WHOLE, "float32", "float64", ">f4"], [None, 1, 2, 3, 4, 11]),
    "": (["uint8", "uint16", ">u2"], [None, 1, 2, 3, 4]),
}
ROUND_TRIPS = [(s, dtype, c) for s, (types, channels) in HOLDS.items() for dtype in types for c in channels]


@pytest.mark.parametrize(("suffix", "dtype", "channels"), ROUND_TRIPS)
def test_values_and_types_survive_a_file(tmp_path, suffix, dtype, channels):
    values = noise((4, 3, 5) if channels is None else (4, 3, 5, channels), dtype)
    path = tmp_path / f"block{suffix}"
    volume.check_writable(path, values.dtype, channels or 1)
    volume.write(path, values)
    back = loaded(path)
    if channels == 1 and suffix not in (".npz", ".NPY"):
        values = values[..., 0]
    assert back.dtype.newbyteorder("=") == values.dtype.newbyteorder("=")
    np.testing.assert_array_equal(back, values)
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.parametrize("suffix", [".npz", ".npy", ".tiff", ".nrrd", ""])
@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 4, 3), (3, 1, 4), (2, 5, 1), (1, 2, 2, 3), (1001, 1, 1)])
def test_every_shape_survives(tmp_path, suffix, shape):
    values = noise(shape)
    volume.write(tmp_path / f"block{suffix}", values)
    np.testing.assert_array_equal(loaded(tmp_path / f"block{suffix}"), values, strict=True)


@pytest.mark.parametrize("channels", [None, 3])
def test_in_an_nrrd_x_runs_fastest_after_the_channels(tmp_path, channels):
    values = noise((2, 3, 4) if channels is None else (2, 3, 4, 3), "uint16")
    volume.write(tmp_path / "a.nrrd", values)
    header, data = (tmp_path / "a.nrrd").read_bytes().split(b"\n\n", 1)
    assert data == values.tobytes()
    text = header.decode()
    fields = dict(line.split(": ", 1) for line in text.splitlines()[1:] if not line.startswith("#"))
    assert fields["sizes"] == ("4 3 2" if channels is None else "3 4 3 2")
    assert fields["kinds"] == ("" if channels is None else "vector ") + "domain domain domain"
    assert (fields["type"], fields["encoding"]) == ("uint16", "raw")
    assert "space" not in text.replace("sourceforge", "")
    in_fortran_order, _ = nrrd.read(str(tmp_path / "a.nrrd"))
    np.testing.assert_array_equal(in_fortran_order, values.T)


def test_slices_are_pictures_and_pages(tmp_path):
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


@pytest.mark.parametrize(
    ("name", "dtype", "channels", "remedy"),
    [
        ("a.tif", "bool", 1, ".npz"),
        ("a.nrrd", "bool", 3, ".npz"),
        ("a.nrrd", "float16", 1, ".tif"),
        ("a.tiff", "longdouble", 1, ".npz"),
        ("a", "bool", 1, ".npz"),
        ("a", "float32", 3, ".nrrd"),
        ("a", "uint8", 5, ".nrrd"),
        ("a", "int16", None, ".nrrd"),
    ],
)
def test_formats_that_cannot_hold_the_values(tmp_path, name, dtype, channels, remedy):
    sentence = rf"cannot hold .*: end its name in \{remedy} instead$"
    with pytest.raises(ValueError, match=sentence) as said:
        volume.check_writable(tmp_path / name, dtype, channels)
    assert np.dtype(dtype).name in str(said.value)
    with pytest.raises(ValueError, match=sentence):
        volume.write(tmp_path / name, np.zeros((2, 2, 2, channels or 1), dtype))
    volume.check_writable(tmp_path / f"a{remedy}", dtype, channels)
    assert os.listdir(tmp_path) == []


def test_places_that_cannot_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes.txt").touch()
    for path, words in [
        (tmp_path / "none" / "a.tif", "the folder .* does not exist"),
        (tmp_path / "a.vti", r"ends in \.vti: .* \.tiff, or give a name without suffix"),
        (tmp_path / "file", "is a file"),
        (tmp_path / "full", "holds other files"),
        (tmp_path / "file" / "a", "the folder .* does not exist"),
        (tmp_path / ("a" * 300), "cannot be written"),
    ]:
        with pytest.raises(ValueError, match=words):
            volume.check_writable(path, np.uint8, 3)
        with pytest.raises(ValueError, match=words):
            volume.write(path, noise((1, 2, 2)))
    (tmp_path / "slices").mkdir()
    volume.check_writable(tmp_path / "slices")
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write anywhere
    for name in ("a.npz", "a", "slices"):
        with pytest.raises(ValueError, match="not writable"):
            volume.check_writable(tmp_path / name)


def test_a_folder_of_slices_is_replaced_as_a_whole(tmp_path):
    volume.write(tmp_path / "a", noise((5, 2, 2)))
    values = noise((3, 2, 2), seed=1)
    volume.write(tmp_path / "a", values)
    np.testing.assert_array_equal(loaded(tmp_path / "a"), values, strict=True)
    assert os.listdir(tmp_path) == ["a"]


def test_write_checks_its_array(tmp_path):
    with pytest.raises(TypeError, match="real"):
        volume.write(tmp_path / "a.npy", np.zeros((2, 2, 2), complex))
    for shape in [(4, 4), (2, 2, 2, 2, 2), (0, 2, 2)]:
        with pytest.raises(ValueError, match=re.escape(str(shape))):
            volume.write(tmp_path / "a.npy", np.zeros(shape))
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("suffix", [".nrrd", ".tif", ".npy"])
@pytest.mark.parametrize("dtype", ["uint8", "int16", "float32"])
def test_a_volume_is_read_as_it_was_written(tmp_path, suffix, dtype):
    path, values = tmp_path / f"block{suffix}", noise((4, 3, 5, 1), dtype)
    volume.write(path, values)
    assert volume.is_volume(path)
    back = volume.read(path)
    assert back.dtype == values.dtype
    np.testing.assert_array_equal(back, values)


@pytest.mark.parametrize(
    ("suffix", "values"), [(".tif", np.ones((1, 5, 6))), (".npy", np.ones((3, 5, 6))), (".npy", np.ones((5, 6)))]
)
def test_what_may_be_a_picture_is_no_volume(tmp_path, suffix, values):
    path = tmp_path / f"picture{suffix}"
    np.save(path, values) if suffix == ".npy" else volume.write(path, values)
    assert not volume.is_volume(path)


@pytest.mark.parametrize("suffix", [".nrrd", ".tif", ".npy"])
def test_a_damaged_or_large_volume_gets_one_sentence(tmp_path, suffix):
    path = tmp_path / f"block{suffix}"
    volume.write(path, noise((4, 30, 50, 1), "uint16"))
    with pytest.raises(ValueError, match=re.escape(str(path))):
        volume.read(path, max_pixels=10)
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(ValueError, match=re.escape(str(path))):
        volume.read(path)
    with pytest.raises(ValueError, match="does not exist"):
        volume.read(tmp_path / f"none{suffix}")

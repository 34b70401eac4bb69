# SPDX-License-Identifier: BSD-3-Clause
"""Source maps survive their files and carry an arrangement over pixel for pixel."""

import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simdtex.io.image import read, write
from simdtex.model.source_map import apply_source_map, load_source_map, save_source_map


def some_map(seed, shape=(7, 9), sample=(5, 6)):
    rng = np.random.default_rng(seed)
    return np.stack([rng.integers(0, side, shape) for side in sample], axis=-1)


SAMPLES = [(5, 6), (8, 3), (4, 4)]


def several(seed, shape=(7, 9), none=0.2):
    """A source map of three samples, and where its pixels have no source."""
    rng = np.random.default_rng(seed)
    of = rng.integers(0, 3, shape)
    source = np.stack([rng.integers(0, np.array([s[axis] for s in SAMPLES])[of]) for axis in (0, 1)] + [of], axis=-1)
    bare = rng.random(shape) < none
    source[bare, :2] = -1
    return source, bare


@given(st.integers(0, 2**32 - 1), st.sampled_from(["uint8", "uint16", "float32", "bool"]),
       st.sampled_from([(), (1,), (3,), (6,)]))  # fmt: skip
def test_apply_against_a_loop(seed, dtype, channels):
    source = some_map(seed)
    other = (np.random.default_rng(seed).random((5, 6, *channels)) * 200).astype(dtype)
    carried = apply_source_map(source, other, (5, 6))
    assert carried.dtype == other.dtype
    for i, j in np.ndindex(7, 9):
        np.testing.assert_array_equal(carried[i, j], other[tuple(source[i, j])])


def test_apply_errors():
    source = some_map(0)
    source[0, 0] = (4, 5)
    with pytest.raises(ValueError, match=r"is 8 x 8 pixels .* sample 6 x 5: bring"):
        apply_source_map(source, np.zeros((8, 8, 3)), (5, 6))
    with pytest.raises(ValueError, match="at least 6 x 5"):
        apply_source_map(source, np.zeros((4, 6)))
    with pytest.raises(ValueError, match="1-dimensional"):
        apply_source_map(source, np.zeros(6))
    for bad in (source[..., :1], source.astype(float), source[:0]):
        with pytest.raises(ValueError, match="rows, cols, 2"):
            apply_source_map(bad, np.zeros((5, 6)))
    for value in (-2, 2**31):
        wild = source.copy()
        wild[1, 1, 1] = value
        with pytest.raises(ValueError, match=f"the position {value}:"):
            apply_source_map(wild, np.zeros((5, 6)))
    with pytest.raises(ValueError, match="position -1"):
        apply_source_map(source - source.min() - 1, np.zeros((5, 6)))


@given(st.integers(0, 2**32 - 1), st.sampled_from(["uint8", "float32"]), st.sampled_from([(), (1,), (3,)]))
def test_several_samples_against_a_loop(seed, dtype, channels):
    rng = np.random.default_rng(seed)
    source, _ = several(seed, none=0)
    others = [(rng.random((*shape, *channels)) * 200).astype(dtype) for shape in SAMPLES]
    carried = apply_source_map(source, others, SAMPLES)
    assert carried.dtype == dtype
    for i, j in np.ndindex(7, 9):
        row, col, sample = source[i, j]
        np.testing.assert_array_equal(carried[i, j], others[sample][row, col])


def test_pixels_without_a_source_are_refused():
    source = some_map(5)
    source[1, 4] = -1
    with pytest.raises(ValueError, match="1 pixel has no source, the first at row 1, column 4: carry over"):
        apply_source_map(source, np.zeros((5, 6)))
    source[3, 3] = -1
    with pytest.raises(ValueError, match="2 pixels have no source"):
        apply_source_map(source, np.zeros((5, 6)))


def test_errors_of_several_samples():
    source, _ = several(6, none=0)
    others = [np.zeros(shape) for shape in SAMPLES]
    with pytest.raises(ValueError, match="pixels of sample 2, counted from 0, and the number of other maps is 2"):
        apply_source_map(source, others[:2])
    with pytest.raises(ValueError, match="number of other maps is 1"):
        apply_source_map(source, others[0])
    with pytest.raises(ValueError, match=r"other map of sample 1 is 6 x 5 pixels .* sample 3 x 8: bring"):
        apply_source_map(source, [others[0], others[0], others[2]], SAMPLES)
    with pytest.raises(ValueError, match=r"other map of sample 2 is 4 x 1 pixels .* at least 4 x 4: bring"):
        apply_source_map(source, [*others[:2], np.zeros((1, 4))])
    for sizes in (SAMPLES[:2], (5, 6, 3), (5, 6)):
        with pytest.raises(ValueError, match="for each of 3 maps"):
            apply_source_map(source, others, sizes)
    with pytest.raises(ValueError, match="float64 with no channels and uint8 with no channels: bring"):
        apply_source_map(source, [*others[:2], others[2].astype(np.uint8)])
    with pytest.raises(ValueError, match="float64 with 3 channels and float64 with no channels: bring"):
        apply_source_map(source, [*others[:2], np.zeros((4, 4, 3))])
    with pytest.raises(ValueError, match="1-dimensional"):
        apply_source_map(source, [*others[:2], np.zeros(4)])
    for axis in range(3):
        bad = source.copy()
        bad[3, 3, axis] = -1
        with pytest.raises(ValueError, match="position -1 in a row, column or sample alone"):
            apply_source_map(bad, others)


def test_a_sample_that_no_pixel_is_of():
    source = np.dstack([some_map(7), np.zeros((7, 9), int)])
    other = np.random.default_rng(7).random((5, 6))
    for others in (other, [other], [other, np.zeros((2, 2))]):
        np.testing.assert_array_equal(apply_source_map(source, others), apply_source_map(source[..., :2], other))


@pytest.mark.parametrize("suffix", [".npz", ".npy"])
@pytest.mark.parametrize("columns", [2, 3])
def test_files_of_maps_with_pixels_that_have_no_source(tmp_path, suffix, columns):
    source, _ = several(8)
    source[0, 0] = -1
    source = source[..., :columns]
    save_source_map(tmp_path / f"map{suffix}", source)
    loaded = load_source_map(tmp_path / f"map{suffix}")
    assert loaded.dtype == np.int32
    np.testing.assert_array_equal(loaded, source)


def test_a_png_has_the_sample_in_blue(tmp_path):
    source, _ = several(9, none=0)
    save_source_map(tmp_path / "map.png", source)
    np.testing.assert_array_equal(load_source_map(tmp_path / "map.png"), source)
    np.testing.assert_array_equal(read(tmp_path / "map.png").pixels, source)
    source[..., 2] = 0
    save_source_map(tmp_path / "one.png", source)
    np.testing.assert_array_equal(load_source_map(tmp_path / "one.png"), source[..., :2])
    save_source_map(tmp_path / "one.npy", source)
    np.testing.assert_array_equal(load_source_map(tmp_path / "one.npy"), source)
    source[2, 2, :2] = -1
    with pytest.raises(ValueError, match=r"bare\.png cannot hold pixels without a source: use \.npz"):
        save_source_map(tmp_path / "bare.png", source)
    assert not (tmp_path / "bare.png").exists()


def test_a_colour_picture_is_no_source_map(tmp_path):
    write(tmp_path / "colour.png", np.full((4, 4, 3), 7, np.uint8))
    with pytest.raises(ValueError, match=r"colour\.png is a picture of 8 bits and holds no source map"):
        load_source_map(tmp_path / "colour.png")


@pytest.mark.parametrize("suffix", [".npz", ".npy", ".png", ".NPZ"])
@pytest.mark.parametrize("sample", [(5, 6), (300, 65536), (1, 1)])
def test_files(tmp_path, suffix, sample):
    source = some_map(1, sample=sample)
    path = tmp_path / f"map{suffix}"
    save_source_map(path, source)
    loaded = load_source_map(path)
    assert loaded.dtype == np.int32
    np.testing.assert_array_equal(loaded, source)
    assert os.listdir(tmp_path) == [path.name]


def test_file_errors(tmp_path):
    source = some_map(2)
    with pytest.raises(ValueError, match="over 65535"):
        save_source_map(tmp_path / "a.png", source + 70000)
    with pytest.raises(ValueError, match=r"\.npz"):
        save_source_map(tmp_path / "a.tif", source)
    assert os.listdir(tmp_path) == []
    for name in ("none.npz", "none.npy"):
        with pytest.raises(ValueError, match="does not exist"):
            load_source_map(tmp_path / name)
    save_source_map(tmp_path / "a.npz", source)
    data = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "part.npz").write_bytes(data[: len(data) // 2])
    np.savez(tmp_path / "other.npz", something=source)
    for name in ("part.npz", "other.npz"):
        with pytest.raises(ValueError, match="cannot be read as a source map of simdtex"):
            load_source_map(tmp_path / name)
    np.save(tmp_path / "grey.npy", np.zeros((3, 3)))
    with pytest.raises(ValueError, match=r"grey\.npy: a source map is"):
        load_source_map(tmp_path / "grey.npy")

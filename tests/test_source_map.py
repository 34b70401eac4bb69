# SPDX-License-Identifier: BSD-3-Clause
"""Source maps survive their files and carry an arrangement over pixel for pixel."""

import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simdtex.model.source_map import apply_source_map, load_source_map, save_source_map


def some_map(seed, shape=(7, 9), sample=(5, 6)):
    rng = np.random.default_rng(seed)
    return np.stack([rng.integers(0, side, shape) for side in sample], axis=-1)


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
    with pytest.raises(ValueError, match="position -1"):
        apply_source_map(source - source.min() - 1, np.zeros((5, 6)))


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
        with pytest.raises(ValueError, match="holds no source map"):
            load_source_map(tmp_path / name)
    np.save(tmp_path / "grey.npy", np.zeros((3, 3)))
    with pytest.raises(ValueError, match=r"grey\.npy: a source map is"):
        load_source_map(tmp_path / "grey.npy")

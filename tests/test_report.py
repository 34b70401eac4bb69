# SPDX-License-Identifier: BSD-3-Clause
"""Sheets, false colours and stages are whole files of the right pictures."""

import io
import os

import numpy as np
import PIL.Image
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simdtex.io import image
from simdtex.model import display
from simdtex.report import sheet
from simdtex.report.sheet import StageWriter
from simdtex.run import Relaxing, Sampling


def contains(picture, part):
    rows, cols = part.shape[:2]
    corners = np.argwhere((picture == part[0, 0]).all(axis=-1))
    return any(np.array_equal(picture[i : i + rows, j : j + cols], part) for i, j in corners)


def test_contact_sheet_shows_every_picture_at_its_own_size(tmp_path):
    rng = np.random.default_rng(0)
    grey = rng.integers(0, 256, (100, 120), dtype=np.uint8)
    colour = rng.integers(0, 256, (130, 96, 3), dtype=np.uint8)
    tiny = rng.integers(0, 256, (20, 30, 4), dtype=np.uint8)
    deep = rng.integers(0, 65536, (110, 110), dtype=np.uint16)
    pictures = [("grey", grey), ("a long label, longer than the picture", colour), ("tiny", tiny),
                ("deep", deep)]  # fmt: skip
    laid = sheet.contact_sheet(pictures, tmp_path / "sheet.png", columns=3)
    np.testing.assert_array_equal(image.read(tmp_path / "sheet.png").pixels, laid)
    assert contains(laid, np.stack([grey] * 3, axis=-1))
    assert contains(laid, colour)
    assert contains(laid, tiny[..., :3].repeat(4, axis=0).repeat(4, axis=1))
    assert contains(laid, np.stack([image.to_display(deep)] * 3, axis=-1))
    assert sheet.contact_sheet(pictures, columns=1).shape[0] > laid.shape[0]
    assert os.listdir(tmp_path) == ["sheet.png"]


def test_a_row_of_a_sheet_is_as_high_as_its_pictures():
    low, high = (np.full((rows, 200), rows, np.uint8) for rows in (100, 150))
    laid = sheet.contact_sheet([("a", low), ("b", high), ("c", low)], columns=1)
    assert len(laid) == sheet.GAP + 3 * (sheet.STRIP + sheet.GAP) + 350
    assert contains(laid, sheet.rgb(high))
    assert len(sheet.contact_sheet([("a", low), ("b", high)], columns=2)) == 2 * sheet.GAP + sheet.STRIP + 150


def test_a_scale_neither_fits_nor_smooths():
    rng = np.random.default_rng(1)
    small, large = (rng.integers(0, 256, (3, side, 3), dtype=np.uint8) for side in (20, 1100))
    pictures = [("small", small), ("large", large)]
    as_they_are = sheet.contact_sheet(pictures, columns=1, scale=1)
    assert contains(as_they_are, small) and contains(as_they_are, large)
    fitting = sheet.contact_sheet(pictures, columns=1)
    assert not contains(fitting, small) and not contains(fitting, large)
    assert contains(sheet.contact_sheet(pictures, scale=2), sheet.magnified(small, 2))


def test_encoded_is_a_png_of_the_picture():
    picture = np.random.default_rng(2).integers(0, 256, (5, 7, 3), dtype=np.uint8)
    with PIL.Image.open(io.BytesIO(sheet.encoded(picture))) as read:
        np.testing.assert_array_equal(np.asarray(read), picture)


def test_contact_sheet_errors(tmp_path):
    picture = np.zeros((4, 4), np.uint8)
    with pytest.raises(ValueError, match="no pictures"):
        sheet.contact_sheet([])
    with pytest.raises(ValueError, match="does not exist"):
        sheet.contact_sheet([("a", picture)], tmp_path / "none" / "a.png")


@given(st.integers(1, 60), st.integers(1, 60), st.integers(1, 20))
def test_fitted_keeps_the_bound_and_the_flat(rows, cols, side):
    flat = np.full((rows, cols, 3), 77, np.uint8)
    reduced = sheet.fitted(flat, side)
    assert max(reduced.shape[:2]) <= side
    assert (reduced == 77).all()


def test_heat_grows_in_lightness():
    found = display.temperature_colours(np.linspace(0, 1, 256)).astype(float)
    assert found.shape == (256, 3)
    grey = found @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(grey) > -1.0).all()  # rounding to 8 bits
    assert grey[0] < 30
    assert grey[-1] > 220
    np.testing.assert_array_equal(display.temperature_colours([-1.0, 2.0]), display.temperature_colours([0.0, 1.0]))


def test_source_colours_tell_positions_apart():
    source = np.stack(np.indices((16, 24)), axis=-1)
    found = display.source_colours(source, (16, 24))
    assert len(np.unique(found.reshape(-1, 3), axis=0)) == 16 * 24
    steps = np.abs(np.diff(found.astype(int), axis=1))
    assert steps.max() < 40
    source[3, 4] = -1
    assert (display.source_colours(source, (16, 24))[3, 4] == 0).all()


def moment(level, sweep, full, end_of_sweep=True):
    """What a run of mrf would tell its callback."""
    picture = full[:: 2**level, :: 2**level]
    return Relaxing(
        level=level,
        levels=3,
        fraction=0.5,
        image=lambda: picture,
        sweep=sweep,
        step=sweep,
        phase="relax",
        temperature_left=0.5,
        end_of_sweep=end_of_sweep,
        temperature=lambda: np.full(picture.shape[:2], 0.5),
        source=lambda: np.zeros((*picture.shape[:2], 2), np.int32),
        explain=lambda row, col: None,
    )


def level_of(level, full, counts, end_of_level=True):
    """What a run of multires would tell its callback."""
    picture = full[:: 2**level, :: 2**level]
    where = {"level": level, "levels": 2, "fraction": 0.5, "end_of_level": end_of_level}
    return Sampling(image=lambda: picture, candidates=lambda: counts, **where)


@pytest.mark.parametrize(("dtype", "channels"), [("uint8", (3,)), ("uint16", ()), ("float32", (5,))])
def test_stages(tmp_path, dtype, channels):
    folder = tmp_path / "stages"
    full = (np.random.default_rng(0).random((101, 130, *channels)) * 255).astype(dtype)
    writer = StageWriter(folder, limits=(0.0, 255.0))
    assert not folder.exists()
    for level in (2, 1, 0):
        for sweep in (1, 2):
            writer(moment(level, sweep, full, end_of_sweep=False))
            writer(moment(level, sweep, full))
    names = {f"{kind}level{level}-sweep{sweep:02d}.png" for kind in ("", "temperature-")
             for level in range(3) for sweep in (1, 2)}  # fmt: skip
    assert set(os.listdir(folder)) == names
    shown = image.read(folder / "level1-sweep02.png").pixels
    np.testing.assert_array_equal(shown[..., :3] if channels else shown,
                                  image.to_display(full, (0, 255))[::2, ::2][..., :3] if channels
                                  else image.to_display(full, (0, 255))[::2, ::2])  # fmt: skip
    assert image.read(folder / "temperature-level2-sweep01.png").pixels.shape == (26, 33, 3)


def test_stages_of_levels_without_sweeps(tmp_path):
    folder = tmp_path / "stages"
    full = np.random.default_rng(0).integers(0, 256, (20, 24), dtype=np.uint8)
    writer = StageWriter(folder)
    for level in (1, 0):
        counts = np.ones((20 >> level, 24 >> level), np.int32)
        counts[0, :3] = 1, 10, 100
        writer(level_of(level, full, counts, end_of_level=False))
        writer(level_of(level, full, counts))
    names = {f"{kind}level{level}.png" for kind in ("", "candidates-") for level in (0, 1)}
    assert set(os.listdir(folder)) == names
    np.testing.assert_array_equal(image.read(folder / "level1.png").pixels, full[::2, ::2])
    few, some, most = image.read(folder / "candidates-level0.png").pixels[0, :3]
    np.testing.assert_array_equal([few, some, most], display.temperature_colours([0, 0.5, 1]))
    StageWriter(folder)  # an earlier run's files may be replaced


def test_a_resumed_run_keeps_the_stages_before(tmp_path):
    full = np.random.default_rng(0).integers(0, 256, (20, 24), dtype=np.uint8)
    for resumed, sweep in ((False, 1), (True, 2), (False, 3)):
        writer = StageWriter(tmp_path / "a", resumed=lambda resumed=resumed: resumed)
        writer(moment(0, sweep, full))
        left = sorted(path.name for path in (tmp_path / "a").glob("level*"))
        assert left == [f"level0-sweep{number:02d}.png" for number in {1: (1,), 2: (1, 2), 3: (3,)}[sweep]]


def test_stage_folder_is_checked_and_cleared(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match="is a file"):
        StageWriter(tmp_path / "file")
    with pytest.raises(ValueError, match="does not exist"):
        StageWriter(tmp_path / "none" / "stages")
    with pytest.raises(ValueError, match="holds other files"):
        StageWriter(tmp_path)
    folder = tmp_path / "stages"
    folder.mkdir()
    for name in ("level3-sweep01.png", "temperature-level3-sweep120.png", "iteration02.png"):
        (folder / name).touch()
    writer = StageWriter(folder)
    assert len(os.listdir(folder)) == 3
    writer(moment(0, 1, np.zeros((4, 4), bool)))
    assert sorted(os.listdir(folder)) == ["level0-sweep01.png", "temperature-level0-sweep01.png"]
    (folder / "notes.txt").touch()
    with pytest.raises(ValueError, match=r"notes\.txt"):
        StageWriter(folder)

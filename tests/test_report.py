# SPDX-License-Identifier: BSD-3-Clause
"""Sheets, animations, false colours and stages are whole files of the right pictures."""

import io
import os

import numpy as np
import PIL.Image
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simdtex.io import image
from simdtex.model import colours
from simdtex.report import sheet, stages
from simdtex.report.stages import StageWriter
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
    with pytest.raises(ValueError, match="columns is 0"):
        sheet.contact_sheet([("a", picture)], columns=0)
    with pytest.raises(ValueError, match="does not exist"):
        sheet.contact_sheet([("a", picture)], tmp_path / "none" / "a.png")


@given(st.integers(1, 60), st.integers(1, 60), st.integers(1, 20))
def test_fitted_keeps_the_bound_and_the_flat(rows, cols, side):
    flat = np.full((rows, cols, 3), 77, np.uint8)
    reduced = sheet.fitted(flat, side)
    assert max(reduced.shape[:2]) <= side
    assert (reduced == 77).all()


@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 4))
def test_enlarged_puts_decimated_pixels_back(rows, cols, level):
    full = np.arange(rows * cols, dtype=np.uint8).reshape(rows, cols)
    step = 2**level
    shown = sheet.enlarged(full[::step, ::step], (rows, cols), step)
    assert shown.shape == full.shape
    i, j = np.indices(full.shape)
    np.testing.assert_array_equal(shown, full[i // step * step, j // step * step])


def test_animation(tmp_path):
    frames = [np.full((6, 8), shade, np.uint8) for shade in (0, 80, 160, 240)]
    path = tmp_path / "a.gif"
    sheet.animation(iter(frames), path)
    with PIL.Image.open(path) as film:
        assert film.n_frames == 4
        assert film.size == (8, 6)
        film.seek(2)
        assert abs(np.asarray(film.convert("L"))[0, 0] - 160.0) <= 2
    assert os.listdir(tmp_path) == [path.name]


def test_an_animation_is_bounded_and_checked(tmp_path):
    sheet.animation([np.zeros((1030, 600), np.uint8)] * 2, tmp_path / "a.gif")
    with PIL.Image.open(tmp_path / "a.gif") as film:
        assert max(film.size) <= 512
    frame = np.zeros((4, 4), np.uint8)
    for frames, name, words in [([], "b.gif", "no frames"), ([frame], "b.jpg", r"\.gif")]:
        with pytest.raises(ValueError, match=words):
            sheet.animation(frames, tmp_path / name)
    assert os.listdir(tmp_path) == ["a.gif"]


def test_heat_grows_in_lightness():
    found = colours.temperature_colours(np.linspace(0, 1, 256)).astype(float)
    assert found.shape == (256, 3)
    grey = found @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(grey) > -1.0).all()  # rounding to 8 bits
    assert grey[0] < 30
    assert grey[-1] > 220
    np.testing.assert_array_equal(colours.temperature_colours([-1.0, 2.0]), colours.temperature_colours([0.0, 1.0]))


def test_source_colours_tell_positions_apart():
    source = np.stack(np.indices((16, 24)), axis=-1)
    found = colours.source_colours(source, (16, 24))
    assert len(np.unique(found.reshape(-1, 3), axis=0)) == 16 * 24
    steps = np.abs(np.diff(found.astype(int), axis=1))
    assert steps.max() < 40
    source[3, 4] = -1
    assert (colours.source_colours(source, (16, 24))[3, 4] == 0).all()


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
    writer.finish()
    names = {f"{kind}level{level}-sweep{sweep:02d}.png" for kind in ("", "temperature-")
             for level in range(3) for sweep in (1, 2)}  # fmt: skip
    assert set(os.listdir(folder)) == names | {"sheet.png", "animation.gif"}
    shown = image.read(folder / "level1-sweep02.png").pixels
    np.testing.assert_array_equal(shown[..., :3] if channels else shown,
                                  image.to_display(full, (0, 255))[::2, ::2][..., :3] if channels
                                  else image.to_display(full, (0, 255))[::2, ::2])  # fmt: skip
    assert image.read(folder / "temperature-level2-sweep01.png").pixels.shape == (26, 33, 3)
    finest = image.to_display(full, (0, 255))
    finest = finest[..., :3] if channels else np.stack([finest] * 3, axis=-1)
    laid = image.read(folder / "sheet.png").pixels
    i, j = np.indices((101, 130))
    for step in (1, 2, 4):
        assert contains(laid, finest[i // step * step, j // step * step])
    with PIL.Image.open(folder / "animation.gif") as film:
        assert film.size == (130, 101)


def test_stages_of_levels_without_sweeps(tmp_path):
    folder = tmp_path / "stages"
    full = np.random.default_rng(0).integers(0, 256, (20, 24), dtype=np.uint8)
    writer = StageWriter(folder)
    for level in (1, 0):
        counts = np.ones((20 >> level, 24 >> level), np.int32)
        counts[0, :3] = 1, 10, 100
        writer(level_of(level, full, counts, end_of_level=False))
        writer(level_of(level, full, counts))
    writer.finish()
    names = {f"{kind}level{level}.png" for kind in ("", "candidates-") for level in (0, 1)}
    assert set(os.listdir(folder)) == names | {"sheet.png", "animation.gif"}
    np.testing.assert_array_equal(image.read(folder / "level1.png").pixels, full[::2, ::2])
    few, some, most = image.read(folder / "candidates-level0.png").pixels[0, :3]
    np.testing.assert_array_equal([few, some, most], colours.temperature_colours([0, 0.5, 1]))
    StageWriter(folder)  # an earlier run's files may be replaced


def test_stages_of_a_large_or_interrupted_run(tmp_path):
    writer = StageWriter(tmp_path / "a")
    writer.finish()
    assert not (tmp_path / "a").exists()
    full = np.add.outer(np.arange(1101), np.arange(700)).astype(np.uint16)
    for level in (2, 1):
        writer(moment(level, 1, full))
    writer.finish()
    with PIL.Image.open(tmp_path / "a" / "animation.gif") as film:
        assert max(film.size) <= 512


def test_long_runs_have_a_short_animation_with_the_last_stage(tmp_path, monkeypatch):
    monkeypatch.setattr(stages, "FRAMES", 5)
    writer = StageWriter(tmp_path / "a")
    for sweep in range(1, 13):
        writer(moment(0, sweep, np.full((6, 8), 20 * sweep, np.uint8)))
    writer.finish()
    with PIL.Image.open(tmp_path / "a" / "animation.gif") as film:
        assert film.n_frames == 4
        film.seek(3)
        assert np.asarray(film.convert("L"))[0, 0] == 240


def test_a_resumed_run_keeps_the_stages_before(tmp_path):
    full = np.random.default_rng(0).integers(0, 256, (20, 24), dtype=np.uint8)
    writer = StageWriter(tmp_path / "a")
    for level, sweep in ((1, 1), (1, 2), (0, 1), (0, 2)):
        writer(moment(level, sweep, full // sweep))
    writer.finish()
    resumed = StageWriter(tmp_path / "a", resumed=lambda: True)
    resumed(moment(0, 1, full))
    names = {path.name for path in (tmp_path / "a").iterdir()}
    stems = ("level1-sweep01", "level1-sweep02", "level0-sweep01")
    assert names == {f"{kind}{stem}.png" for kind in ("", "temperature-") for stem in stems}
    resumed.finish()
    with PIL.Image.open(tmp_path / "a" / "animation.gif") as film:
        assert film.n_frames == 3


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
    for name in ("level3-sweep01.png", "temperature-level3-sweep120.png", "sheet.png"):
        (folder / name).touch()
    writer = StageWriter(folder)
    assert len(os.listdir(folder)) == 3
    writer(moment(0, 1, np.zeros((4, 4), bool)))
    assert sorted(os.listdir(folder)) == ["level0-sweep01.png", "temperature-level0-sweep01.png"]
    (folder / "notes.txt").touch()
    with pytest.raises(ValueError, match=r"notes\.txt"):
        StageWriter(folder)

"""Strokes become labels, and windows of layers become frames; labels lie over a picture."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simdtex.live import frames
from simdtex.live.frames import Layer, Window, parse_window, render
from simdtex.live.job import paint


def stroke(label, width, *points):
    return {"label": label, "width": width, "points": [list(point) for point in points]}


def test_a_stroke_is_round_and_the_last_one_counts():
    label = paint([stroke(1, 9, (10, 10))], (21, 21))
    i, j = np.indices((21, 21))
    distance = np.hypot(i - 10, j - 10)
    assert (label[distance <= 3.5] == 1).all() and not label[distance > 5.5].any()
    label = paint([stroke(1, 8, (2, 10), (18, 10)), stroke(2, 4, (10, 0), (10, 20))], (21, 21))
    assert (label[10, 4], label[10, 10], label[0, 10], label[0, 0]) == (1, 2, 2, 0)
    assert paint([stroke(1, 8, (5, 5)), stroke(0, 30, (5, 5))], (12, 12)).sum() == 0
    assert paint([stroke(1, 4, (-50, 5), (500, 5))], (12, 12))[5].all(), "it goes on beyond the edges"


@pytest.mark.parametrize("channels", [(), (1,), (2,), (4,)], ids=str)
@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_labels_lie_over_a_picture(channels, dtype):
    pixels = np.random.default_rng(0).integers(0, 256, (4, 6, *channels)).astype(dtype)
    pixels[:2, 0] = np.array([0, 255]).reshape(2, *[1] * len(channels))  # black and white
    labels = np.arange(24, dtype=np.uint8).reshape(4, 6) % 3
    colours = np.array([[0, 0, 0], [200, 100, 0], [255, 255, 255]], np.uint8)
    own = pixels.reshape(4, 6, -1)
    own = (own[..., :3] if own.shape[2] > 2 else own[..., :1]).astype(int) * np.ones(3, int)
    for shares in ([0.5, 0.5, 0.5], [0, 0.25, 1]):
        found = render(frames.overlay(pixels, labels, colours, shares), Window(width=6, height=4))
        shown = np.frombuffer(found.pixels, np.uint8).reshape(4, 6, 4)[..., :3]
        share = np.array(shares)[labels][..., None]
        np.testing.assert_array_equal(shown, np.floor(own * (1 - share) + colours[labels] * share))


@given(
    *(st.integers(-40, 40), st.integers(-40, 40), st.integers(1, 30), st.integers(1, 30), st.integers(1, 7)),
    st.booleans(),
)
def test_a_window_of_a_layer(left, top, width, height, step, tiled):
    values = np.random.default_rng(0).integers(0, 256, (20, 24, 3), np.uint8)
    found = render(Layer((20, 24), values, np.asarray), Window("picture", left, top, width, height, step, tiled))
    shown = np.frombuffer(found.pixels, np.uint8).reshape(found.height, found.width, 4)
    padded = np.pad(values.astype(float), ((200, 200), (200, 200), (0, 0)), "wrap" if tiled else "edge")
    for row in range(found.height):
        for col in range(found.width):
            y, x = found.top + row * step + 200, found.left + col * step + 200
            mean = padded[y : y + step, x : x + step].mean((0, 1))
            assert np.abs(shown[row, col, :3] - mean).max() <= 0.5 + 1e-3
    beside = 20 if tiled else 0  # three times the layer, itself in the middle
    inside = [one for one in range(top, top + step * height, step) if -beside - step < one < 20 + beside]
    assert found.height == len(inside) and (not inside or found.top == inside[0])


def test_a_coarse_level_stands_for_the_whole():
    values = np.arange(9, dtype=np.uint8).reshape(3, 3)
    found = render(Layer((6, 6), values, np.asarray), Window(width=6, height=6))
    shown = np.frombuffer(found.pixels, np.uint8).reshape(6, 6, 4)[..., 0]
    np.testing.assert_array_equal(shown, values.repeat(2, 0).repeat(2, 1))


def test_parts_of_a_large_window_are_the_same(monkeypatch):
    values = np.random.default_rng(0).integers(0, 256, (40, 40), np.uint8)
    layer, window = Layer((40, 40), values, np.asarray), Window(width=14, height=14, step=3)
    whole = render(layer, window)
    monkeypatch.setattr(frames, "CHUNK", 3 * 3 * 14 * 2)
    assert render(layer, window) == whole


def test_a_coarse_window_of_a_tiled_layer_takes_little_memory():
    window = parse_window({"width": 4096, "height": 1024, "step": frames.MAX_STEP, "tiled": True, "left": -(2**14)})
    layer = Layer((512, 2**14), np.zeros((512, 2**14, 3), np.uint8), np.asarray)
    tracemalloc.start()
    found = render(layer, window)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (found.width, found.height) == (96, 2)
    assert most < 50 * 2**20

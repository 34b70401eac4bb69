"""Strokes become labels, views of layers become frames, and the controls of the live page are the declared options."""

import json
from math import inf

import click
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simdtex import commands as cli
from simdtex.live import frames
from simdtex.live.frames import Layer, View, render
from simdtex.live.job import LIGHT, TABLES, controls, paint
from simdtex.options import table


def stroke(label, width, *points):
    return {"label": label, "width": width, "points": [list(point) for point in points]}


def seen(layer, *view, **sides):
    frame = render(layer, View(*view, **sides))
    return frame, np.frombuffer(frame.pixels, np.uint8).reshape(frame.height, frame.width, 4)[..., :3]


def test_a_stroke_is_round_and_the_last_one_counts():
    label = paint([stroke(1, 9, (10, 10))], (21, 21))
    i, j = np.indices((21, 21))
    distance = np.hypot(i - 10, j - 10)
    assert (label[distance <= 3.5] == 1).all() and not label[distance > 5.5].any()
    label = paint([stroke(1, 8, (2, 10), (18, 10)), stroke(2, 4, (10, 0), (10, 20))], (21, 21))
    assert (label[10, 4], label[10, 10], label[0, 10], label[0, 0]) == (1, 2, 2, 0)
    assert 7 <= (label[:, 5] == 1).sum() <= 9, "as wide as its stroke"
    assert paint([stroke(1, 8, (5, 5)), stroke(0, 30, (5, 5))], (12, 12)).sum() == 0
    assert paint([stroke(1, 4, (-50, 5), (500, 5))], (12, 12))[5].all(), "it goes on beyond the edges"


@pytest.mark.parametrize(("channels", "dtype"), [((), np.uint8), ((2,), np.float32), ((4,), np.uint8)], ids=str)
def test_labels_lie_over_a_picture(channels, dtype):
    pixels = np.random.default_rng(0).integers(0, 256, (4, 6, *channels)).astype(dtype)
    pixels[:2, 0] = np.array([0, 255]).reshape(2, *[1] * len(channels))  # black and white
    labels = np.arange(24, dtype=np.uint8).reshape(4, 6) % 3
    colours = np.array([[0, 0, 0], [200, 100, 0], [255, 255, 255]], np.uint8)
    below = pixels.reshape(4, 6, -1)
    below = (below[..., :3] if below.shape[2] > 2 else below[..., :1]).astype(int) * np.ones(3, int)
    for shares in ([0.5, 0.5, 0.5], [0, 0.25, 1]):
        _, shown = seen(frames.overlay(pixels, labels, colours, shares), width=6, height=4)
        share = np.array(shares)[labels][..., None]
        np.testing.assert_array_equal(shown, np.floor(below * (1 - share) + colours[labels] * share))


@given(
    *(st.integers(-40, 40), st.integers(-40, 40), st.integers(1, 30), st.integers(1, 30), st.integers(1, 7)),
    st.booleans(),
)
def test_a_view_of_a_layer(left, top, width, height, step, tiled):
    values = np.random.default_rng(0).integers(0, 256, (20, 24, 3), np.uint8)
    frame, shown = seen(Layer((20, 24), values, np.asarray), "picture", left, top, width, height, step, tiled)
    padded = np.pad(values.astype(float), ((200, 200), (200, 200), (0, 0)), "wrap" if tiled else "edge")
    for row in range(frame.height):
        for col in range(frame.width):
            y, x = frame.top + row * step + 200, frame.left + col * step + 200
            mean = padded[y : y + step, x : x + step].mean((0, 1))
            assert np.abs(shown[row, col] - mean).max() <= 0.5 + 1e-3
    beside = 20 if tiled else 0  # three times the layer, itself in the middle
    inside = [row for row in range(top, top + step * height, step) if -beside - step < row < 20 + beside]
    assert frame.height == len(inside) and (not inside or frame.top == inside[0])


def test_a_coarse_level_stands_for_the_whole_and_parts_of_a_large_view_are_the_same(monkeypatch):
    values = np.arange(9, dtype=np.uint8).reshape(3, 3)
    _, shown = seen(Layer((6, 6), values, np.asarray), width=6, height=6)
    np.testing.assert_array_equal(shown[..., 0], values.repeat(2, 0).repeat(2, 1))
    layer = Layer((40, 40), np.random.default_rng(0).integers(0, 256, (40, 40), np.uint8), np.asarray)
    whole, _ = seen(layer, width=14, height=14, step=3)
    monkeypatch.setattr(frames, "CHUNK", 3 * 3 * 14 * 2)
    assert seen(layer, width=14, height=14, step=3)[0] == whole


def test_controls_are_what_options_may_be_and_the_command_line_has_them():
    for name, (options, command) in TABLES.items():
        flags = {flag for one in cli.load(command).params if isinstance(one, click.Option) for flag in one.opts}
        declared = {key: one for key, one in table(options).items() if command in one.shown} | {"light": LIGHT}
        for control in json.loads(json.dumps(controls(name), allow_nan=False)):  # as the page gets them
            option = declared[control["name"]]
            assert f"--{control['name'].replace('_', '-')}" in flags
            assert control["hint"].startswith(option.hint or option.help)
            assert control["group"] == option.group and control["label"]
            assert control["default"] == option.default_of(command)
            if control["kind"] == "words":
                assert [word for word, _ in control["valid"]] == list(option.kind.valid)
                assert "[" not in control["hint"] and "DY" not in control["hint"], "a choice takes no text"
            elif control["kind"] != "switch":
                least, most, step = control["span"]
                assert control["least"] == (option.kind.least if option.kind.least > -inf else None)
                assert option.kind.least <= least < most <= option.kind.most and step > 0
                default = control["default"]
                assert control["empty"] if default is None else least <= default <= most
    assert {one["name"]: one["default"] for one in controls("fill")}["balance"] == 0
    assert "boundary" not in {one["name"] for one in controls("extend")}

"""The controls of the page are the options as they are declared, in words; windows and strokes are what is meant."""

import click
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simdtex import cli
from simdtex.live.looking import Look, Plane, seen
from simdtex.live.strokes import Stroke, painted
from simdtex.live.words import TABLES, controls
from simdtex.options import table


@pytest.mark.parametrize("name", TABLES)
def test_controls_are_what_options_may_be_and_the_command_line_has_them(name):
    options, command = TABLES[name]
    flags = {flag for one in cli.load(command).params if isinstance(one, click.Option) for flag in one.opts}
    own = table(options)
    found = controls(name)
    assert {one["name"] for one in found} <= {other for other, one in own.items() if command in one.shown}
    for control in found:
        one = own[control["name"]]
        assert f"--{control['name'].replace('_', '-')}" in flags
        assert control["hint"].startswith(one.help) and control["group"] == one.group and control["label"]
        assert control["default"] == one.default_of(command)
        if control["kind"] == "words":
            assert [word for word, _ in control["valid"]] == list(one.kind.valid)
        elif control["kind"] != "switch":
            least, most, step = control["span"]
            assert (control["least"], control["most"]) == (one.kind.least, one.kind.most)
            assert one.kind.least <= least < most <= one.kind.most and step > 0
            if control["default"] is None:
                assert control["empty"], "it says what an empty field means"
            else:
                assert least <= control["default"] <= most


def test_the_controls_of_a_texture():
    assert {one["name"] for one in controls("mrf")} >= {"order", "finish", "boundary", "categorical", "levels"}
    assert {one["blank"] for one in controls("multires") if one["name"] == "alpha"} == {"auto"}
    assert not {"schedule", "array", "weights", "labels"} & {one["name"] for one in controls("mrf")}
    assert controls("mrf")[0]["group"] == "Appearance"


def test_jobs_have_their_own_defaults():
    assert {one["name"]: one["default"] for one in controls("fill")}["balance"] == 0
    assert "boundary" not in {one["name"] for one in controls("tile")}


# -- strokes ----------------------------------------------------------------------------------------------------------


def test_a_stroke_is_round_and_the_last_one_counts():
    label = painted([Stroke(1, 9, ((10.0, 10.0),))], (21, 21))
    i, j = np.indices((21, 21))
    distance = np.hypot(i - 10, j - 10)
    assert (label[distance <= 3.5] == 1).all() and not label[distance > 5.5].any()
    label = painted([Stroke(1, 8, ((2.0, 10.0), (18.0, 10.0))), Stroke(2, 4, ((10.0, 0.0), (10.0, 20.0)))], (21, 21))
    assert (label[10, 4], label[10, 10], label[0, 10], label[0, 0]) == (1, 2, 2, 0)
    assert painted([Stroke(1, 8, ((5.0, 5.0),)), Stroke(0, 30, ((5.0, 5.0),))], (12, 12)).sum() == 0
    assert painted([Stroke(1, 4, ((-50.0, 5.0), (500.0, 5.0)))], (12, 12))[5].all(), "it goes on beyond the edges"


# -- windows ----------------------------------------------------------------------------------------------------------


@given(
    *(st.integers(-40, 40), st.integers(-40, 40), st.integers(1, 30), st.integers(1, 30), st.integers(1, 7)),
    st.booleans(),
)
def test_a_window_of_a_plane(left, top, width, height, step, tiled):
    values = np.random.default_rng(0).integers(0, 256, (20, 24, 3), np.uint8)
    found = seen(Plane((20, 24), values, np.asarray), Look("picture", left, top, width, height, step, tiled))
    shown = np.frombuffer(found.pixels, np.uint8).reshape(found.height, found.width, 4)
    padded = np.pad(values.astype(float), ((200, 200), (200, 200), (0, 0)), "wrap" if tiled else "edge")
    for row in range(found.height):
        for col in range(found.width):
            y, x = found.top + row * step + 200, found.left + col * step + 200
            mean = padded[y : y + step, x : x + step].mean((0, 1))
            assert np.abs(shown[row, col, :3] - mean).max() <= 0.5 + 1e-3
    if tiled:
        assert (found.left, found.top, found.width, found.height) == (left, top, width, height)
    else:
        inside = [one for one in range(top, top + step * height, step) if -step < one < 20]
        assert found.height == len(inside) and (not inside or found.top == inside[0])


def test_a_coarse_level_stands_for_the_whole():
    values = np.arange(9, dtype=np.uint8).reshape(3, 3)
    found = seen(Plane((6, 6), values, np.asarray), Look(width=6, height=6))
    shown = np.frombuffer(found.pixels, np.uint8).reshape(6, 6, 4)[..., 0]
    np.testing.assert_array_equal(shown, values.repeat(2, 0).repeat(2, 1))


def test_parts_of_a_large_window_are_the_same(monkeypatch):
    from simdtex.live import looking

    values = np.random.default_rng(0).integers(0, 256, (40, 40), np.uint8)
    plane, look = Plane((40, 40), values, np.asarray), Look(width=14, height=14, step=3)
    whole = seen(plane, look)
    monkeypatch.setattr(looking, "PART", 3 * 3 * 14 * 2)
    assert seen(plane, look) == whole

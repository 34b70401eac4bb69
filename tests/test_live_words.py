"""The controls of the live page are the declared options."""

import json
from math import inf

import click
import pytest

from simdtex import cli
from simdtex.live.job import TABLES, controls
from simdtex.options import table


@pytest.mark.parametrize("name", TABLES)
def test_controls_are_what_options_may_be_and_the_command_line_has_them(name):
    options, command = TABLES[name]
    flags = {flag for one in cli.load(command).params if isinstance(one, click.Option) for flag in one.opts}
    own = table(options)
    found = json.loads(json.dumps(controls(name), allow_nan=False))  # as the page gets them
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
            assert control["least"] == (one.kind.least if one.kind.least > -inf else None)
            assert one.kind.least <= least < most <= one.kind.most and step > 0
            if control["default"] is None:
                assert control["empty"], "it says what an empty field means"
            else:
                assert least <= control["default"] <= most


def test_the_controls_of_a_texture():
    assert {one["name"] for one in controls("mrf")} >= {
        "order",
        "finish",
        "boundary",
        "categorical",
        "levels",
        "lattice",
        "schedule",
    }
    assert not {"array", "weights", "labels"} & {one["name"] for one in controls("mrf")}
    assert controls("mrf")[0]["group"] == "Appearance"


def test_jobs_have_their_own_defaults():
    assert {one["name"]: one["default"] for one in controls("fill")}["balance"] == 0
    assert "boundary" not in {one["name"] for one in controls("extend")}


def test_an_empty_field_says_what_it_stands_for():
    finish = {one["name"]: one for one in controls("mrf")}["finish"]
    assert (finish["default"], finish["usual"], finish["empty"]) == (None, 1.5, "automatic: 1.5")
    levels = {one["name"]: one for one in controls("mrf")}["levels"]
    assert (levels["usual"], levels["empty"]) == (None, "automatic")

"""Whole syntheses under every schedule: which must agree to the bit, on what machine, and what the statistics count."""

import functools
import re
import textwrap
from pathlib import Path

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, setting, texture
from test_schedules import Told

import simdtex
from simdtex import schedules
from simdtex.machine.reference import Reference
from simdtex.model.lattice import Grid
from simdtex.schedules import SCHEDULES, Info, Masked, get

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "schedules.rst"
FORMS = {
    "icm": {},
    "gibbs": {"relaxation": "gibbs"},
    "colour": {"channel_axis": -1, "relaxation": "gibbs", "pixel": "density", "xi": -3.0},
}


def run(schedule, form="icm", shape=(5, 6), device=REFERENCE, **options):
    """Everything that a run gives but its times and steps: the image, source map, temperatures, stages."""
    given = {"order": 2, "levels": 2, "free_sweeps": 1, "rng": 2**33 + 1, "search": "exact"} | FORMS[form] | options
    sample = texture((10, 9), 3 if "channel_axis" in given else None)
    image, output = simdtex.synthesize(sample, shape, schedule=schedule, device=device, full_output=True, **given)
    return [image, output.source, output.temperature, *(stage.image for stage in output.stages)]


@functools.cache
def expected(name, form):
    return run(name, form)


class Apart:
    """Another schedule's steps, each cut into its sites, the last of them first, one a step under the same turn."""

    def __init__(self, schedule):
        self.schedule, self.name = schedule, f"apart {schedule.name}"
        self.tile, self.windows = schedule.tile, False

    def independent(self, grid, offsets):
        return True

    def init(self, setting):
        return self.schedule.init(setting)

    def step(self, setting, state, active):
        state, info = self.schedule.step(setting, state, active)
        sites = np.concatenate([step.sites[::-1] for step in info.apart(setting.machine)])
        single = np.arange(sites.size)[:, None] + np.array([0, 1])
        return state, info._replace(sites=sites, steps=single if sites.size else None)


@pytest.mark.parametrize(("name", "form"), [("coloring", "colour"), ("coloring-fixed", "icm"), ("luby", "icm")])
def test_independent_sites_may_as_well_be_relaxed_one_by_one(name, form):
    assert_same_bits(run(Apart(get(name)), form), expected(name, form))


@pytest.mark.parametrize("name", ["synchronous", "random-subset", "checkerboard"])
def test_sites_that_are_not_independent_may_not(name):
    assert (run(Apart(get(name)), "gibbs")[0] != expected(name, "gibbs")[0]).any()


def test_any_size_ends_with_nothing_hot():
    for name in SCHEDULES:
        image, _, temperature, *_ = run(name, "colour", (1, 1), levels=1)
        assert image.shape[:2] == (1, 1) and not temperature.any()


def test_a_schedule_that_lies_is_stopped(machine):
    with pytest.raises(RuntimeError, match=r"the schedule told .*claims independent sites"):
        run(schedules.Checked(Told([0, 1])), levels=1, device=machine)


def test_the_schedule_of_the_page_works(machine):
    code = re.search(r"This example is .*::\n\n((?:(?:   .*)?\n)+)", PAGE.read_text(encoding="utf-8"))[1]
    names = {}
    exec(textwrap.dedent(code), names)
    wavefront = names["Wavefront"]()
    ours = run(schedules.Checked(wavefront), "gibbs", (6, 8), machine, boundary="open")
    assert_same_bits(ours, run("raster", "gibbs", (6, 8), boundary="open"))
    grid = Grid.of((6, 8), 1, False)
    state = wavefront.init(setting(grid))
    _, info = wavefront.step(setting(grid), state, Masked(grid))
    assert len(info.ranges) == 5 * 2 + 8


class Late:
    """Another schedule, whose sweeps end with a step of no site."""

    def __init__(self, schedule):
        self.schedule, self.name, self.independent = schedule, "late", schedule.independent
        self.tile, self.windows = schedule.tile, False

    def init(self, setting):
        return self.schedule.init(setting), False

    def step(self, setting, state, active):
        inner, ended = state
        if ended:
            return (inner, False), Info(np.zeros(0, np.int32), 0, True)
        inner, info = self.schedule.step(setting, inner, active)
        return (inner, info.last), info._replace(last=False)


def test_a_sweep_may_end_with_a_step_of_no_site(machine):
    seen = []
    assert_same_bits(run(Late(get("coloring")), device=machine, callback=seen.append), expected("coloring", "icm"))
    for level in (1, 0):
        here = [progress for progress in seen if progress.level == level]
        assert [progress.sweep for progress in here if progress.stage] == list(range(1, here[-1].sweep + 1))


def test_the_pieces_of_a_step_share_its_number():
    seen, small = [], Reference(5_000)
    run("synchronous", "gibbs", device=small, callback=seen.append)
    steps = [progress.step for progress in seen if progress.level == 0]
    assert steps == sorted(steps)
    assert set(steps) == set(range(1, max(steps) + 1))
    assert len(steps) > len(set(steps)), "some step has pieces"
    ends = [progress.sweep for progress in seen if progress.level == 0 and progress.stage]
    assert ends == list(range(1, len(ends) + 1))

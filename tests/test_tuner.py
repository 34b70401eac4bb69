"""The tuner: what it remembers and where, that it needs neither folder nor file, and that it changes no bit."""

import json
import os

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, host, problem, texture

import simdtex
from simdtex.machine import tuner
from simdtex.machine.opencl import OpenCL
from simdtex.machine.tuner import Form
from simdtex.ops.nearest import nearest

FORM = Form(4, 2, 16)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(tuner.FOLDER, str(tmp_path / "cache"))
    monkeypatch.delenv(tuner.SWITCH)
    return tmp_path / "cache"


@pytest.fixture
def measured(monkeypatch):
    """What would be measured, without measuring."""
    found = []
    monkeypatch.setattr(tuner, "choose", lambda machine: found.append(machine) or FORM)
    return found


def form_of(machine):
    return Form(machine.vector, machine.step, machine.group)


def test_a_choice_is_made_once_and_remembered(any_device, folder, measured):
    for _ in range(2):
        machine = simdtex.open_machine(str(any_device.index))
        assert form_of(machine) == FORM
    assert len(measured) == 1
    (key,) = json.loads((folder / tuner.FILE).read_text())
    assert any_device.name in key
    assert any_device.driver in key
    assert os.listdir(folder) == [tuner.FILE], "nothing is left beside it"


def test_another_driver_is_another_device(any_device, folder, measured):
    import dataclasses

    for driver in ("1", "2"):
        tuner.tune(OpenCL(dataclasses.replace(any_device, driver=driver)))
    assert len(measured) == 2
    assert len(json.loads((folder / tuner.FILE).read_text())) == 2


BROKEN = ["", "{", "[]", "7", '{"KEY": 3}', '{"KEY": {"vector": 5, "step": 4, "group": 16}}', '{"KEY": {"vector": 4}}',
          '{"KEY": {"vector": [4], "step": 4, "group": 16}}', "\x00",
          "[" * 100_000, '{"KEY": []}']  # fmt: skip


@pytest.mark.parametrize("content", BROKEN, ids=range(len(BROKEN)))
def test_a_broken_file_is_written_anew(any_device, folder, measured, content):
    machine = OpenCL(any_device)
    tuner.tune(machine)
    (key,) = json.loads((folder / tuner.FILE).read_text())
    (folder / tuner.FILE).write_text(content.replace("KEY", key.replace("\\", "")))
    tuner.tune(machine)
    assert len(measured) == 2
    assert form_of(machine) == FORM
    assert json.loads((folder / tuner.FILE).read_text())[key] == FORM._asdict()


def test_it_works_without_a_folder(any_device, folder, measured):
    folder.write_text("a file stands where the folder should")
    machine = OpenCL(any_device)
    tuner.tune(machine)
    assert form_of(machine) == FORM


def test_it_can_be_switched_off(any_device, folder, measured, monkeypatch):
    monkeypatch.setenv(tuner.SWITCH, "0")
    machine = simdtex.open_machine(str(any_device.index))
    assert form_of(machine) == tuner.default(any_device)
    assert not measured
    assert not folder.exists()


def test_the_default_is_kept_where_nothing_is_clearly_faster(any_device, monkeypatch):
    machine = OpenCL(any_device)
    default, other = tuner.default(any_device), tuner.others(any_device)[1]
    for gain, expected in [(1.05, default), (1.3, other)]:
        monkeypatch.setattr(tuner, "probe", lambda machine, form, gain=gain: lambda: gain if form == other else 1.0)
        assert tuner.choose(machine) == expected


def test_measuring_stops_when_its_time_is_up(any_device, monkeypatch):
    machine, seen = OpenCL(any_device), []
    monkeypatch.setattr(tuner, "BUDGET", -1)
    monkeypatch.setattr(tuner, "probe", lambda machine, form: seen.append(form))
    assert tuner.choose(machine) == tuner.default(any_device)
    assert seen == [tuner.default(any_device)]


def test_a_rate_is_measured(any_device):
    assert 1e6 < tuner.probe(OpenCL(any_device), tuner.default(any_device))() < 1e15


def test_every_form_has_the_references_bits(any_device):
    p = problem(5, order=4, shape=(8, 9), sample_shape=(18, 19))

    def run(m):
        sites, field, offsets = p.on(m)
        terms = (np.float32(0.5), m.put(p.price(0.1)))
        return host(m, nearest(m, sites, field, offsets, p.grid, p.candidates(m), p.strip(m), *terms))

    for form in tuner.others(any_device):
        machine = OpenCL(any_device)
        machine.take(form)
        assert_same_bits(run(machine), run(REFERENCE))


def test_a_tuned_synthesis_has_the_references_bits(any_device, folder, measured):
    machine = simdtex.open_machine(str(any_device.index))
    assert form_of(machine) == FORM
    options = {"order": 2, "rng": 3, "levels": 1}
    ours = simdtex.synthesize(texture((12, 11)), (9, 8), device=machine, **options)
    assert_same_bits(ours, simdtex.synthesize(texture((12, 11)), (9, 8), device=REFERENCE, **options))

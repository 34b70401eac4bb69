"""The core: what kernels are told of a level, the state between sweeps, and the algorithm's steps in a default run."""

import pickle
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, laid_out, opencl, sweeps, texture

import simdtex
from simdtex.machine import devices
from simdtex.machine.opencl import kernel_folder, kernel_source
from simdtex.methods import mrf
from simdtex.methods.mrf.algorithm import first_state, sweep
from simdtex.methods.mrf.level import ActiveSites
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.methods.mrf.relax import LEVEL
from simdtex.model.lattice import LATTICE

FOLDER = Path(simdtex.__file__).parent / "methods" / "mrf"


def fields(dtype, prefix=""):
    """Dotted name -> offset of every number in a struct."""
    found = {}
    for name, (kind, offset, *_) in dtype.fields.items():
        inner = fields(kind, f"{prefix}{name}.") if kind.fields else {f"{prefix}{name}": 0}
        found |= {key: offset + inside for key, inside in inner.items()}
    return found


@pytest.mark.parametrize(("kind", "dtype"), [("Lattice", LATTICE), ("Level", LEVEL)])
def test_a_struct_is_the_same_on_the_host_and_on_a_device(machine, kind, dtype):
    """Each number stands at the same offset, and nothing else stands there."""
    lines = "".join(
        f"out[{n}] = (int)((__private char *)&v.{name} - (__private char *)&v);"
        for n, name in enumerate(fields(dtype), 1)
    )
    source = f"__kernel void look({kind} v, __global int *out) {{ out[0] = sizeof v; {lines} }}"
    kernel = devices.build(machine.context, kernel_source("mrf/level.h") + source, [])["look"]
    out = machine.put(np.zeros(1 + len(fields(dtype)), np.int32))
    machine.enqueue(kernel, (1,), np.zeros((), dtype)[()], out)
    told = machine.get(out).tolist()
    assert told == [dtype.itemsize, *fields(dtype).values()]


def test_a_struct_names_its_numbers_as_the_header_does():
    for file, kind, dtype in (("common/lattice.h", "Lattice", LATTICE), ("mrf/level.h", "Level", LEVEL)):
        text = (kernel_folder() / file).read_text()
        body = re.search(rf"typedef struct {{(.*?)}} {kind};", text, re.DOTALL)[1]
        body = re.sub(r"//.*", "", body)
        names = [n.strip() for line in body.split(";") for n in re.sub(r"^\s*\w+\s", "", line).split(",") if n.strip()]
        assert tuple(names) == dtype.names


def prepared(machine, shape=(12, 14), sample_shape=(16, 17), **options):
    given = {"order": 2, "levels": 3} | options
    return laid_out(machine, texture(sample_shape, seed=3)[..., None], shape, mrf.Options(**given), 5)


def plain(value):
    """Whether a value is made of arrays of NumPy and numbers alone."""
    if isinstance(value, (tuple, dict)):
        return all(map(plain, value.values() if isinstance(value, dict) else value))
    return value is None or isinstance(value, (np.ndarray, int))


@pytest.mark.parametrize(("schedule", "search"), [("luby", "exact"), ("block:3x4", "coherent")])
def test_a_run_goes_on_from_any_state_on_another_machine(cl_device, schedule, search):
    run, again = (prepared(m, schedule=schedule, search=search) for m in (opencl(cl_device), REFERENCE))
    whole = [run.save(state) for _, state, _ in sweeps(run)]
    assert len({(state["level"], state["cooling"], state["free"]) for state in whole}) == len(whole) > 10
    for number in (3, len(whole) - 2):
        assert plain(whole[number])
        kept = pickle.loads(pickle.dumps(whole[number]))
        after = [again.save(state) for _, state, _ in sweeps(again, again.load(kept))]
        for mine, theirs in zip(after, whole[number + 1 :], strict=True):
            assert list(mine.values())[5:] == list(theirs.values())[5:]
            assert_same_bits(mine["penalty"], theirs["penalty"])
        for name in ("values", "source", "temperature"):
            assert_same_bits(after[-1][name], whole[-1][name])


@pytest.mark.parametrize("schedule", ["coloring", "block:3x5"])
def test_the_list_of_sites_is_made_on_the_device_and_stays_there(cl_device, monkeypatch, schedule):
    machine, copied = opencl(cl_device), []
    run = prepared(machine, (60, 61), schedule=schedule, levels=1)
    level, state, copies = run.level(0), run.begin(), (machine.put, machine.get)
    for name, copy in zip(("put", "get"), copies, strict=True):
        monkeypatch.setattr(machine, name, lambda array, copy=copy: (copied.append(array.size), copy(array))[1])
    memory, first = level.schedule.step(level.setting, state.schedule, ActiveSites(level, state.temperature, False))
    assert 0 < sum(copied) < level.grid.size / 4  # the counts of its groups, which say where each begins
    copied.clear()
    _, second = level.schedule.step(level.setting, memory, ActiveSites(level, state.temperature, True))
    assert not copied and (memory, plain(memory)) == ((1,), True)
    assert_same_bits(*(copies[1](info.sites) for info in (first, second)))


def test_a_state_tells_what_is_left():
    run = prepared(REFERENCE)
    for level, state, info in sweeps(run):
        t = level.grid.latest(state.temperature)
        assert (state.active, state.temperature_sum) == ((t > 0).sum(), t.sum(dtype=int))
        assert info.sweep == state.cooling + state.free
        assert info.ended == (not state.active and state.free == run.options.free_sweeps)


def test_sites_that_may_not_relax_keep_their_values(any_device):
    for machine, schedule in ((REFERENCE, "random-scan"), (opencl(any_device), "coloring")):
        run = prepared(machine, schedule=schedule)
        given = np.random.default_rng(2).random(run.plan.shape) < 0.3
        before = Field(*(np.array(machine.get(plane)) for plane in run.enter(0, None).field))
        before = before._replace(temperature=np.where(given, 0, before.temperature).astype(np.uint16))
        level = replace(run.level(0), movable=machine.put((~given).astype(np.uint16)))
        state = first_state(level, Field(*map(machine.put, before)))
        while state.active:
            state, _ = sweep(level, state)
        state, free = sweep(level, state)
        after = Field(*(machine.get(plane) for plane in state.field))
        for mine, theirs in zip(after, before, strict=True):
            assert_same_bits(mine[..., given], theirs[..., given])
        assert (after.source != before.source).mean() > 0.5
        relaxed = np.concatenate([step.sites for chosen in free for step in chosen.apart(machine)])
        assert not given.ravel()[relaxed].any()


STEPS = ("1", "2", "3", "4", "5", "6", "6.1", "6.2", "6.2.1", "6.2.2", "6.2.2.1", "6.2.2.2", "6.2.2.3")
MARK = re.compile(r"#\s+((?:\d(?:\.\d)*)(?:, \d(?:\.\d)*)*)(?=\s|$)")


def marked():
    """Step of Algorithm 1 -> the lines, (file, number), that bear its number in a comment."""
    found = {}
    for path in sorted(FOLDER.glob("*.py")):
        for number, line in enumerate(path.read_text().splitlines(), 1):
            mark = MARK.search(line)
            for step in mark[1].split(", ") if mark else ():
                found.setdefault(step, []).append((str(path), number))
    return found


def test_every_step_of_algorithm_1_stands_on_a_line_that_a_default_run_executes():
    executed = set()

    def look(frame, event, argument):
        if not frame.f_code.co_filename.startswith(str(FOLDER)):
            return None
        executed.add((frame.f_code.co_filename, frame.f_lineno))
        return look

    before = sys.gettrace()
    sys.settrace(look)
    try:
        simdtex.synthesize(texture((10, 11)), (4, 5), rng=1, device=REFERENCE)
    finally:
        sys.settrace(before)
    lines = marked()
    assert set(lines) == set(STEPS)
    missed = {step: where for step, where in lines.items() if not set(where) <= executed}
    assert not missed

"""The core: what kernels are told of a level, the state between sweeps, and the algorithm's steps in a default run."""

import pickle

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, laid_out, opencl, sweeps, texture

from simdtex.machine import devices
from simdtex.machine.opencl import kernel_source
from simdtex.methods import mrf
from simdtex.methods.mrf.level import ActiveSites
from simdtex.methods.mrf.relax import LEVEL
from simdtex.model.lattice import LATTICE


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

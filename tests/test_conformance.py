"""Every run of the table has its pinned bytes, on every device, in every form of launch, resumed and in tiles."""

import contextlib
import functools
import importlib
import inspect
import json
import pkgutil
from dataclasses import fields

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, opencl, slow_but
from runs import LARGE, PINNED, RUNS, SEED, digest, large, outcome
from tiny import JOBS, Guarding

import simdtex
from simdtex.checkpoint import Checkpoint
from simdtex.machine.reference import Reference
from simdtex.methods.mrf import Options


def check(name, device, reference, **how):
    """Assert that a run on a device has the bytes and the counts of the reference."""
    (ours, counts), (theirs, known) = outcome(name, device, **how), reference(name)
    assert_same_bits(ours, theirs)
    assert json.loads(counts) == json.loads(known)


ON_DEVICES = ("everything", "density-colour", "volume-data", "multires-luminance", "pyramid", "maspar")


@pytest.mark.parametrize("name", slow_but(ON_DEVICES, RUNS))
def test_a_device_has_the_references_bits(machine, reference, name):
    check(name, machine, reference)


@functools.cache
def pinned():
    return json.loads(PINNED.read_text())


@pytest.mark.parametrize("name", RUNS)
def test_the_bytes_are_those_pinned(reference, name):
    """``python tests/runs.py`` writes new digests."""
    assert digest(reference(name)[0]) == pinned()[name]


@pytest.mark.parametrize("name", slow_but(("large grass-16-bit", "large pyramid-coffee"), LARGE))
def test_the_bytes_of_larger_runs_are_those_pinned(any_device, name):
    assert digest(large(name, opencl(any_device))) == pinned()[name]


@pytest.fixture
def guarding(monkeypatch):
    """Let all arrays of the package refuse negative indices in an array."""
    for found in pkgutil.walk_packages(simdtex.__path__, "simdtex."):
        with contextlib.suppress(ImportError):  # of an optional library
            module = importlib.import_module(found.name)
            if getattr(module, "np", None) is np:
                monkeypatch.setattr(module, "np", Guarding())


@pytest.mark.parametrize("name", slow_but([name for name in JOBS if name not in ("tileset", "tiles")], JOBS))
def test_no_gather_of_the_reference_is_at_minus_one(guarding, name):
    """-1 is no source, no neighbour, no candidate: NumPy would read the last element."""
    JOBS[name]({"device": REFERENCE})


def test_every_run_is_pinned_and_no_other():
    assert pinned().keys() == {*RUNS, *LARGE}


class Stopping(Checkpoint):
    """A checkpoint whose run stops after so many steps."""

    def __init__(self, path, steps):
        super().__init__(path, every=1e6)
        self.left = steps

    def offer(self, info, tree, *, now=False):
        self.left -= 1
        if not self.left:
            self.stop()
        return super().offer(info, tree, now=now)


KEPT = [name for name, run in RUNS.items() if "checkpoint" in inspect.signature(run.function).parameters]


def stopped_and_resumed(name, path, device):
    """What a run gives that is stopped after 1, 2, 4, 8 ... more steps, and how often it was stopped."""
    stops = 0
    while True:
        try:
            return outcome(name, device, checkpoint=Stopping(path, 2**stops)), stops
        except KeyboardInterrupt:
            stops += 1


RESUMED = ("array", "known", "volume", "fill", "multires", "pyramid", "mix", "classify", "tileset")


@pytest.mark.parametrize("name", slow_but(RESUMED, KEPT))
def test_a_run_that_is_stopped_has_the_same_end(reference, tmp_path, name):
    expected = reference(name)
    found, stops = stopped_and_resumed(name, tmp_path / "run", REFERENCE)
    assert stops
    assert_same_bits(found[0], expected[0])
    assert json.loads(found[1]) == json.loads(expected[1])


@pytest.mark.parametrize("name", slow_but(("array",), ["array", "multires", "more", "pyramid-colour", "classify"]))
def test_a_run_that_is_stopped_on_a_device_has_the_same_end(machine, reference, tmp_path, name):
    found, stops = stopped_and_resumed(name, tmp_path / "run", machine)
    assert stops
    assert_same_bits(found[0], reference(name)[0])


@pytest.mark.parametrize(
    "name",
    slow_but(("finish-colour", "categories"), [name for name, run in RUNS.items() if run.tiles]),
)
def test_tiles_have_the_bytes_of_the_whole(reference, tmp_path, name):
    zarr = pytest.importorskip("zarr")
    from simdtex.jobs.tiles.tasks import context

    (image, source, *_), _ = reference(name)
    given, options = RUNS[name].inputs()
    store = simdtex.TileStore(tmp_path / "out.zarr", RUNS[name].tiles, source_map=True)
    ours = simdtex.synthesize(*given, store=store, **options, rng=SEED, device=REFERENCE)
    assert_same_bits(ours.compute(), image)
    assert_same_bits(zarr.open_group(store.path)["source"][...], source)
    context.cache_clear()


# Work-items that relax a site together, work-group size, vector width, candidates in registers, scratch memory.
FORMS = [
    {"items": 32},
    {"vector": 1, "work_group": 16, "step": 8},
    {"vector": 8, "work_group": 1, "step": 1, "scratch": 500},
    {"vector": 4, "work_group": 3, "step": 2, "scratch": 5_000},
    {"vector": 16},
]
FORMED = ("exact-of-many", "more", "synchronous", "density-colour", "multires-luminance", "pyramid-colour")


@pytest.mark.parametrize("form", slow_but(FORMS[:1], FORMS), ids=str)
def test_the_form_of_a_launch_changes_no_bit(cl_device, reference, form):
    """Runs one after another on one machine, whose memory pool keeps nothing of the run before."""
    machine = opencl(cl_device, **form)
    for name in FORMED[:3] if "items" in form else FORMED:  # the others have the programs of the next form
        check(name, machine, reference)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*ON_DEVICES[:3], "mode-colour", "block", "volume-three"])
def test_a_gpus_form_has_the_references_bits(any_device, reference, name):
    check(name, opencl(any_device, items=64), reference)


def test_small_scratch_memory_makes_many_pieces(cl_device):
    """Else the test above would show nothing."""
    small, large = opencl(cl_device, scratch=5_000, vector=4), opencl(cl_device)
    assert small.chunk(150, 24, 1) < 20 < large.chunk(150, 24, 1)


@pytest.mark.parametrize(("name", "scratch"), [("exact-of-many", 20_000), ("synchronous", 5_000)])
def test_the_references_pieces_change_no_bit(reference, name, scratch):
    check(name, Reference(scratch), reference)


@pytest.mark.parametrize("seed", [0, 2**64 - 1])
def test_any_seed_has_the_references_bits(machine, seed):
    assert_same_bits(*(outcome("gibbs", device, rng=seed)[0] for device in (machine, REFERENCE)))


def test_every_option_is_tried_by_a_run():
    tried = {name for run in RUNS.values() for name, value in run.inputs()[1].items() if value is not None}
    assert {f.name for f in fields(Options)} <= tried

"""Every run of the table is Algorithm 1, the same on every device and in every form of launch, resumed and in tiles."""

import contextlib
import functools
import importlib
import inspect
import json
import pkgutil
from dataclasses import fields

import numpy as np
import plain_mrf
import pytest
from cases import REFERENCE, assert_same_bits, opencl, slow_but
from kept import HERE, PACKAGE, Kept, key, sources
from runs import LARGE, PINNED, RUNS, SEED, digest, large, outcome
from tiny import JOBS, Guarding

import simdtex
from simdtex.checkpoint import Checkpoint
from simdtex.machine.reference import Reference
from simdtex.methods.mrf import Options
from simdtex.options import PRESETS, preset_values


def check(name, device, reference, **how):
    """Assert that a run on a device has the bytes and the counts of the reference."""
    (ours, counts), (theirs, known) = outcome(name, device, **how), reference(name)
    assert_same_bits(ours, theirs)
    assert json.loads(counts) == json.loads(known)


PLAIN = [name for name, run in RUNS.items() if run.plain]
LONG = ("defaults", "overview", "levels-by-output", "overview-whole", "paper", "exact-order-8", "exact-three-levels")
LONG += ("exact-colour", "exact-16-bit", "exact-of-many", "gibbs", "density-16-bit", "mode-colour", "few-colour")
LONG += ("few-order-18", "few-16-bit", "few-chance", "few-levels", "few-gibbs", "few-density", "bool-larger")
LONG += ("few-whole", "all-of-many", "random-subset:0.3", "block-exact", "raster", "random-scan", "balance-order-9")
LONG += ("structure-colour", "structure-beyond", "novelty-exact", "finish-16-bit", "lattice-exact", "more-levels")
LONG += ("reduced-lattice", "reduced-everything", "several-gaps", "categories-mixed")
"""Runs that take the plain loops more than a second; `make test` has their digests, `make slow` their loops."""


@pytest.mark.parametrize("name", slow_but([name for name in PLAIN if name not in LONG], PLAIN))
def test_a_run_is_that_of_the_plain_loops(reference, results, name):
    expected, _ = results(f"plain {name}", lambda: (RUNS[name].plain(), ""))
    assert_same_bits(reference(name)[0][: len(expected)], expected)


ON_DEVICES = ("density-colour", "mode-colour", "few", "block", "synchronous", "array", "known-lattice", "known-blocks")
ON_DEVICES += ("everything", "soft-all", "volume-three", "volume-data", "fill", "mix-bands", "multires-luminance")
ON_DEVICES += ("multires-open", "pyramid", "pyramid-laplacian", "solid-average", "maspar-mode", "maspar", "classify")
ON_DEVICES += ("estimate",)
"""Runs that launch every kernel, and with every constant of the others; what takes long is compiling."""


@pytest.mark.parametrize("name", slow_but(ON_DEVICES, RUNS))
def test_a_device_has_the_references_bits(machine, reference, name):
    check(name, machine, reference)


@functools.cache
def pinned():
    return json.loads(PINNED.read_text())


@pytest.mark.parametrize("name", RUNS)
def test_the_bytes_are_those_pinned(reference, name):
    """``python tests/runs.py`` writes new digests, where the changelog says why the bytes are others."""
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


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_nor_is_one_of_any_run(guarding, name):
    assert digest(map(np.asarray, outcome(name)[0])) == pinned()[name]


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


RESUMED = ("array", "known", "soft-all", "volume", "fill", "extend", "multires", "pyramid", "solid", "mix", "classify")
RESUMED += ("tileset",)


@pytest.mark.parametrize("name", slow_but(RESUMED, KEPT))
def test_a_run_that_is_stopped_has_the_same_end(reference, tmp_path, name):
    expected = reference(name)
    found, stops = stopped_and_resumed(name, tmp_path / "run", REFERENCE)
    assert stops
    assert_same_bits(found[0], expected[0])
    assert json.loads(found[1]) == json.loads(expected[1])


@pytest.mark.parametrize(
    "name", slow_but(("array", "multires"), ["array", "multires", "more", "pyramid-colour", "classify"])
)
def test_a_run_that_is_stopped_on_a_device_has_the_same_end(machine, reference, tmp_path, name):
    found, stops = stopped_and_resumed(name, tmp_path / "run", machine)
    assert stops
    assert_same_bits(found[0], reference(name)[0])


@pytest.mark.parametrize(
    "name",
    slow_but(("density", "finish-colour", "several", "categories"), [name for name, run in RUNS.items() if run.tiles]),
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
@pytest.mark.parametrize("name", ON_DEVICES[: ON_DEVICES.index("mix-bands")])
def test_a_gpus_form_has_the_references_bits(any_device, reference, name):
    check(name, opencl(any_device, items=64), reference)


def test_small_scratch_memory_makes_many_pieces(cl_device):
    """Else the test above would show nothing."""
    small, large = opencl(cl_device, scratch=5_000, vector=4), opencl(cl_device)
    assert small.chunk(150, 24, 1) < 20 < large.chunk(150, 24, 1)


@pytest.mark.parametrize(
    ("name", "scratch"), [("exact-of-many", 20_000), ("synchronous", 5_000), ("density-colour", 1)]
)
def test_the_references_pieces_change_no_bit(reference, name, scratch):
    check(name, Reference(scratch), reference)


@pytest.mark.parametrize("seed", [0, 2**32, 2**64 - 1])
def test_any_seed_has_the_references_bits(machine, seed):
    assert_same_bits(*(outcome("gibbs", device, rng=seed)[0] for device in (machine, REFERENCE)))


# Candidates that differ by the same few amounts differ in the rounding alone; so narrow a Gaussian tells.
CLOSE = {"order": 8, "relaxation": "gibbs", "bandwidth": 0.0005, "coherence": 0.0, "xi": -8.0, "overview": 64}
CLOSE |= {"balance": 0.0, "structure": 0.0, "novelty": 0.0, "finish": 0.0}
SUMS = {
    "exact": (3, 1, {"search": "exact", "levels": 1}),
    "all": (2, 3, {"search": "coherent", "levels": 1}),
    "few": (3, 1, {"search": "coherent", "levels": 2, "chance": 60, "order": 18}),
}
"""Grey levels and channels of a sample, and options."""


@pytest.mark.parametrize("how", SUMS)
def test_sums_have_their_order(monkeypatch, how):
    greys, channels, given = SUMS[how]
    sample = np.random.default_rng(5).integers(0, greys, (12, 11, channels)).astype(np.float32)
    image, output = simdtex.synthesize(
        sample, (7, 8), channel_axis=-1, rng=SEED, device=REFERENCE, full_output=True, **CLOSE | given
    )
    plainly = plain_mrf.synthesize(sample, (7, 8), SEED, **CLOSE | given)
    assert_same_bits([image, output.source, output.temperature], plainly)
    if how != "all":  # else the equality shows nothing of the order
        monkeypatch.setattr(plain_mrf, "LANES", 1)
        assert (plain_mrf.synthesize(sample, (7, 8), SEED, **CLOSE | given)[1] != output.source).any()


NO_BYTE = {"array": None}
"""Options that change no byte, with their defaults."""


def test_the_plain_loops_have_the_engines_defaults_and_presets():
    assert {f.name: f.default for f in fields(Options)} == plain_mrf.DEFAULTS | NO_BYTE
    assert {name: plain_mrf.DEFAULTS | preset_values(Options, name) for name in PRESETS} == {
        "default": plain_mrf.DEFAULTS,
        "paper": plain_mrf.DEFAULTS | plain_mrf.PAPER,
    }


@pytest.mark.parametrize("option", plain_mrf.DEFAULTS)
def test_every_option_changes_a_run_of_the_plain_loops(reference, option):
    """Else their equality would show nothing of it; a new option wants a run in the table."""
    default, tried = plain_mrf.DEFAULTS[option], 0
    for name in sorted(PLAIN, key=lambda name: (option not in name, reference(name)[0][0].size)):
        if RUNS[name].inputs()[1].get(option, default) == default:
            continue
        tried += 1
        try:
            other = outcome(name, **{option: default})[0]
        except (ValueError, TypeError):
            continue  # the other options of this run need it
        if any(one.tobytes() != two.tobytes() for one, two in zip(reference(name)[0], other, strict=False)):
            return
    pytest.fail(f"{tried} runs give {option}, and the default changes none")


def test_the_key_of_kept_results_is_of_every_byte_and_name(tmp_path):
    files = [tmp_path / "a.py", tmp_path / "b.cl"]
    seen = set()
    for texts in (("1", "2"), ("1", "3"), ("12", ""), ("", "12")):
        for file, text in zip(files, texts, strict=True):
            file.write_text(text)
        seen.add(key(files))
    seen |= {key(files[:1]), key([files[1].rename(tmp_path / "c.cl")]), key([tmp_path / "c.cl", files[0]])}
    assert len(seen) == 7
    package, tests = (
        {PACKAGE / "methods" / "mrf" / "relax.py", PACKAGE / "options.py"},
        {HERE / "runs.py", HERE / "plain_mrf.py"},
    )
    assert {*package, *tests} <= set(sources())
    assert {path.suffix for path in sources()} >= {".py", ".cl", ".h"}


def test_a_kept_result_is_of_this_source_or_is_made_again(tmp_path):
    arrays, made = [np.arange(3), np.array([[0.5, np.nan]], np.float32)], []

    def result(kept, name="run"):
        found = kept(name, lambda: made.append(name) or (arrays, "text"))
        assert_same_bits(found[0], arrays)
        assert found[1] == "text"
        return len(made)

    def session(now="one", later=None):
        return Kept(tmp_path, now, lambda: later or now)

    first = session()
    assert [result(first), result(first), result(session()), result(session(), "other")] == [1, 1, 1, 2]
    assert result(session("two")) == 3, "another source"
    assert [result(session("three", "four")), result(session("three"))] == [4, 5], "edited while the session ran"
    for file in tmp_path.rglob("*.npz"):
        file.write_bytes(file.read_bytes()[:-30])
    assert result(session()) == 6, "damaged"
    assert [result(Kept(None, "one", str)), result(Kept(None, "one", str))] == [7, 8], "nothing is kept"
    for number in range(9):
        session(str(number))
    assert len(list(tmp_path.iterdir())) == 4

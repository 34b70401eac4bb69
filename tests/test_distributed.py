"""An output in tiles has the bytes of one that is made at once, whatever the tiles, the workers and their order."""

import json
import os
import shutil
import sys
from contextvars import ContextVar
from pathlib import Path

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, opencl, texture

import simdtex
from simdtex import distributed
from simdtex.distributed import store as store_module
from simdtex.distributed.layout import planned
from simdtex.distributed.store import Store, cut
from simdtex.distributed.tasks import context, do
from simdtex.distributed.tiling import Tiles
from simdtex.driver import drive
from simdtex.methods.mrf import Options
from simdtex.methods.mrf.algorithm import Run
from simdtex.methods.mrf.plan import plan as planned_run
from simdtex.methods.mrf.tiles import Tile, framed
from simdtex.model.lattice import Grid
from simdtex.model.pictures import Pictures
from simdtex.model.source_map import apply_source_map
from simdtex.ops.neighbourhood import Field
from simdtex.ops.sites import lattice_plan

zarr = pytest.importorskip("zarr")

SAMPLE = texture((22, 25), seed=2)
COLOUR = np.stack([texture((22, 25), seed=k) for k in (1, 2, 3)], -1)


def assert_same(tmp_path, sample, shape, tiles, device=REFERENCE, **options):
    """Assert that the output in tiles and its source map are those of one that is made at once."""
    path = tmp_path / "out.zarr"
    options = {"xi": -8.0, "rng": 11, "device": device} | options  # few sweeps
    ours = distributed.synthesize(sample, shape, path, tiles=tiles, source_map=True, **options)
    theirs, output = simdtex.synthesize(sample, shape, full_output=True, **options)
    assert_same_bits(ours.compute(), theirs)
    assert_same_bits(zarr.open_group(path)["source"][...], output.source)
    context.cache_clear()


slow = pytest.mark.slow
# Rows of 37: uneven tiles, a last one a single site wide (36 + 1), and one that is more than all.
TILINGS = [12, pytest.param(16, marks=slow), 36, pytest.param(1000, marks=slow)]


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize("tiles", TILINGS)
def test_any_tiling(tmp_path, tiles, boundary):
    assert_same(tmp_path, SAMPLE, (37, 30), tiles, order=1, boundary=boundary)


VARIANTS = {
    "coherent": {"order": 2},
    "exact": {"order": 2, "search": "exact"},
    "draws": {"order": 2, "search": "exact", "relaxation": "gibbs"},
    "density": {"order": 2, "search": "exact", "relaxation": "gibbs", "pixel": "density"},
    "mode": {"order": 2, "pixel": "density"},
    "fixed": {"order": 1, "schedule": "coloring-fixed"},
    "checkerboard": {"order": 2, "schedule": "checkerboard"},
    "synchronous": {"order": 2, "schedule": "synchronous"},
    "one level, no penalty": {"order": 2, "levels": 1, "balance": 0.0},
    "no free sweep, no finish": {"order": 2, "free_sweeps": 0, "finish": 0.0},
    "all phases": {"order": 1, "phases": "all", "levels": 2},
    "wide finish": {"order": 1, "finish": 3.0},
    "lattice": {"order": 2, "lattice": "4.8,0,1,5.5"},
}


QUICK = ("coherent", "draws", "checkerboard", "one level, no penalty", "lattice")


@pytest.mark.parametrize("name", [name if name in QUICK else pytest.param(name, marks=slow) for name in VARIANTS])
def test_any_options(tmp_path, name):
    assert_same(tmp_path, SAMPLE, (29, 33), 16, **VARIANTS[name])


@pytest.mark.parametrize("dtype", [pytest.param("bool", marks=slow), "uint16", pytest.param("float32", marks=slow)])
def test_any_type_and_channels(tmp_path, dtype):
    assert_same(tmp_path, COLOUR.astype(dtype), (26, 25), 13, order=1, channel_axis=-1)


def test_channels_stay_where_they_are(tmp_path):
    assert_same(tmp_path, np.moveaxis(COLOUR, -1, 0), (26, 25), 13, order=1, channel_axis=0)
    assert_same(tmp_path / "..", COLOUR[..., :1], (20, 20), 13, order=1, channel_axis=-1)


def test_on_devices(tmp_path, any_device):
    assert_same(tmp_path, COLOUR, (61, 70), 33, opencl(any_device), order=2, channel_axis=-1)


REST = [(0.3, "torus"), (0.02, "open")]


def known_values(shape, share, seed):
    rng = np.random.default_rng(seed)
    return np.ma.masked_array(rng.choice(SAMPLE.ravel(), shape), rng.random(shape) > share)


@pytest.mark.parametrize(
    ("share", "boundary"), [(0.02, "torus"), (0.3, "open"), *(pytest.param(*one, marks=slow) for one in REST)]
)
def test_known_sites(tmp_path, share, boundary):
    """Also data between the sites of coarse levels, whose stand-ins lie in other tiles."""
    shape = (39, 34)
    given = {"known": known_values(shape, share, 5), "boundary": boundary}
    assert_same(tmp_path, SAMPLE, shape, 14, order=1, levels=3, **given)


def test_known_sources_and_a_known_side(tmp_path):
    shape = (24, 31)
    known = np.ma.masked_array(np.zeros(shape, np.uint8), True)
    place = np.full((*shape, 2), -1)
    known[:, :9], place[:22, :9] = SAMPLE[[*range(22), 0, 1], :9], np.moveaxis(np.mgrid[:22, :9], 0, -1)
    assert_same(tmp_path, SAMPLE, shape, 11, order=2, known=known, known_source=place)


def test_variables_known_in_part(tmp_path):
    shape, rng = (25, 26), np.random.default_rng(3)
    two = COLOUR[..., :2]
    known = np.ma.masked_array(rng.choice(two.ravel(), (*shape, 2)), rng.random((*shape, 2)) > 0.2)
    assert_same(tmp_path, two, shape, 13, order=1, channel_axis=-1, known=known)


@pytest.mark.parametrize("gaps", [False, True])
def test_guides(tmp_path, gaps):
    shape, rng = (27, 30), np.random.default_rng(4)
    guide = rng.random(shape).astype(np.float32)
    guide[rng.random(shape) < 0.6 * gaps] = np.nan
    both = {"guide": (SAMPLE.astype(np.float32) / 255, guide), "lattice": "4.5,0,0,5"}
    assert_same(tmp_path, SAMPLE, shape, 14, order=1, **both)


def test_several_samples_with_masks_and_gaps(tmp_path):
    first, second = SAMPLE.astype(np.float32), texture((19, 30), seed=8).astype(np.float32)
    first[3:6, 4:9] = np.nan
    masks = [np.ones(one.shape, bool) for one in (first, second)]
    masks[1][:, :7] = False
    assert_same(tmp_path, [first, second], (28, 31), 15, order=1, mask=masks, shares=(2.0, 1.0))
    assert zarr.open_group(tmp_path / "out.zarr")["source"].shape == (28, 31, 3)


def test_categories(tmp_path):
    kinds = (SAMPLE // 64).astype(np.uint8)
    options = {"categorical": True, "proportions": (1.0, 2.0, 1.0, 1.0)[: np.unique(kinds).size]}
    assert_same(tmp_path, kinds, (28, 31), 15, order=1, **options)


def test_a_sample_and_options_of_every_kind_come_back_from_a_store(tmp_path):
    """What a worker lays out is what was laid out: see also that all options survive JSON."""
    options = Options(order=2, weights=(1.0, 0.5, 0.1 + 0.2), xi=-1.7)
    plan, seed = planned_run(Pictures((COLOUR,)), (30, 31), options), 2**40 + 1
    layout = planned(plan, seed, 10)
    store = Store.create(str(tmp_path / "s.zarr"), plan, seed, layout, channels=True, source=False, maps={})
    work = store.work
    assert (work.plan.options, work.seed, work.layout) == (plan.options, seed, layout)
    assert (work.plan.levels, work.plan.shape) == (plan.levels, (30, 31))
    assert_same_bits(work.plan.sample.working, plan.sample.working)
    assert json.dumps(store.about)


class Stop(Exception):
    pass


def shuffled(store, seed, stop=None):
    """Tiles in any order; an exception after so many of them, over all turns."""
    order, done, work = np.random.default_rng(seed), [0], store.work

    def execute(turn, tasks):
        for number in order.permutation(tasks).tolist():
            if stop is not None and done[0] == stop:
                raise Stop
            done[0] += not store.done(turn, work, number)
            yield do(store.where, store.about["name"], REFERENCE, turn, number)

    return execute


def created(tmp_path, name="s.zarr", **options):
    options = Options(order=1, levels=2, xi=-8.0, **options)
    plan, where = planned_run(Pictures((SAMPLE[..., None],)), (26, 31), options), str(tmp_path / name)
    return Store.create(where, plan, 11, planned(plan, 11, 12), channels=False, source=False, maps={}), where


def go_on(store, execute):
    """Do all turns that are left."""
    drive(Tiles(store, execute), REFERENCE, 0)
    store.clean()


@pytest.fixture(scope="module")
def whole():
    """The picture of the store that `created` makes."""
    return simdtex.synthesize(SAMPLE, (26, 31), rng=11, order=1, levels=2, xi=-8.0, device=REFERENCE)


def test_a_run_that_is_stopped_after_any_tile_goes_on_to_the_same_bytes(tmp_path, whole):
    store, where = created(tmp_path)
    stops = 0
    while True:
        try:
            go_on(Store(where), shuffled(store, stops, stop=5))
            break
        except Stop:
            stops += 1
    assert stops > 10
    assert_same_bits(store.root["image"][...], whole)


@pytest.mark.parametrize("after", [False, True])
@pytest.mark.parametrize("moment", ["replace", "rmtree"])
def test_a_store_survives_a_stop_between_any_two_of_its_writes(tmp_path, monkeypatch, moment, after, whole):
    """Stopped before or after any file is in its place, or before a folder is removed or when half of it is."""
    _, where = created(tmp_path)
    module = {"replace": os, "rmtree": shutil}[moment]
    real, left, n, attempt = getattr(module, moment), 0, 0, ContextVar("attempt")

    def stopping(path, *args, **options):
        nonlocal left
        if attempt.get(n) < n:  # a thread that an earlier attempt has left behind: a stopped process writes no more
            raise Stop
        left -= 1
        if left == 0:
            if after and moment == "replace":
                real(path, *args)
            elif after:
                inside = sorted(Path(path).rglob("*"))
                [one.unlink() for one in inside[: len(inside) // 2] if one.is_file()]
            raise Stop
        return real(path, *args, **options)

    monkeypatch.setattr(module, moment, stopping)
    for n in range(1, 1000):  # each time a little later
        left = n
        attempt.set(n)
        try:
            image = distributed.resume(where, device=REFERENCE)
            break
        except Stop:
            pass
    assert n > 2
    assert_same_bits(image.compute(), whole)
    assert not (Path(where) / "work").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps nobody off a folder")
def test_one_process_at_a_time_leads(tmp_path):
    path, said = tmp_path / "out.zarr", []

    def another(_):
        with pytest.raises(ValueError, match=r"another run is at work in .*out.zarr now; wait for it, or stop it"):
            distributed.resume(path, device=REFERENCE)
        said.append(True)

    distributed.synthesize(SAMPLE, (20, 20), path, tiles=16, rng=1, device=REFERENCE, order=1, callback=another)
    assert said
    before = zarr.open_group(path)["image"][...]  # the lock is released, and a finished run has nothing to do
    assert_same_bits(distributed.resume(path, device=REFERENCE).compute(), before)


@pytest.mark.parametrize(("most", "side"), [(1024, (30, 31)), (8, (8, 8))])
def test_progress_tells_every_tile(tmp_path, monkeypatch, most, side):
    """The picture of a large level is every n-th site."""
    monkeypatch.setattr("simdtex.distributed.tiling.SHOWN", most)
    seen = []

    def callback(progress):
        seen.append((progress.fraction, progress.doing, progress.image()))

    options = {"order": 1, "xi": -8.0, "rng": 1, "device": REFERENCE}
    distributed.synthesize(SAMPLE, (30, 31), tmp_path / "o.zarr", tiles=16, callback=callback, **options)
    fractions = [fraction for fraction, *_ in seen]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert seen[-1][1] == "writing the picture, tile 4 of 4"
    assert any("sweep 2, tile 3 of 4" in doing for _, doing, _ in seen)
    assert seen[-1][2].shape[:2] == side


def test_the_plan_says_what_is_needed():
    plan = distributed.plan(SAMPLE, (4096, 4096), tiles=1024, order=18)
    finest = plan.levels[0]
    assert (finest.count, finest.side, finest.rows, finest.chunk) == (16, 1024, 4096, 512)
    assert finest.halo == 4 * lattice_plan(4096, 4096, True, 18, 0).colors
    assert 0.3 < finest.redundant < 0.4
    lines = plan.lines()
    assert lines[-2].startswith("level 0: 4096x4096 sites in 16 tiles of 1024x1024, halo 116, 3")
    assert f"{plan.memory / 2**20:.0f} MiB" in lines[-1]


def test_memory_of_a_worker_does_not_grow_with_the_output():
    plans = [distributed.plan(SAMPLE, (side, side), tiles=512, order=2) for side in (4000, 40_000, 1_000_000)]
    assert len({plan.memory for plan in plans}) == 1
    assert plans[-1].disk > 10**13


def test_redundant_work_is_what_the_schedule_does(tmp_path):
    """Counted: the sites of all steps of a free sweep, over those of the lattice."""
    from simdtex.methods.mrf.level import Active
    from simdtex.schedules.schedule import Trimmed

    plan = planned_run(Pictures((SAMPLE[..., None],)), (120, 120), Options(order=2, levels=1))
    level = planned(plan, 1, 40).levels[0]
    run = Run(plan, REFERENCE, 1)
    sites = 0
    for tile in map(level.tile, range(level.count)):
        frame = framed(level.lattice, tile, level.halo)
        window = run.level(0, frame.window)
        schedule = Trimmed(window.schedule, frame.rows.start, frame.rows.stop)
        active = Active(window, np.zeros((1, 1)), True)
        _, info = schedule.step(window.setting, schedule.init(window.setting), active)
        sites += int((info.ranges[:, 1] - info.ranges[:, 0]).sum())
    assert sites / (120 * 120) - 1 == pytest.approx(level.redundant, rel=0.1)


@pytest.mark.parametrize(
    ("tile", "halo", "torus", "window", "where"),
    [
        (Tile(0, 10, 10, 10), 3, True, (37, 7, 16, 16), (3, 3)),
        (Tile(0, 10, 10, 10), 3, False, (0, 7, 13, 16), (0, 3)),
        (Tile(30, 40, 10, 10), 3, False, (27, 37, 13, 13), (3, 3)),
        (Tile(10, 0, 10, 50), 20, True, (0, 0, 40, 50), (10, 0)),
        (Tile(10, 0, 10, 50), 20, False, (0, 0, 40, 50), (10, 0)),
        (Tile(39, 0, 1, 10), 0, True, (39, 0, 1, 10), (0, 0)),
    ],
    ids=str,
)
def test_a_tile_lies_in_its_window(tile, halo, torus, window, where):
    frame = framed(Grid(40, 50, 1, torus), tile, halo)
    assert tuple(frame.window) == window
    assert (frame.rows.start, frame.cols.start) == where
    assert frame.cut(np.zeros((2, *window[2:]))).shape == (2, tile.rows, tile.cols)


def test_windows_go_on_across_the_seam():
    level = distributed.plan(SAMPLE, (20, 30), tiles=8, order=1).levels[0]
    whole = np.arange(2 * 600).reshape(2, 20, 30)
    for window in (Tile(15, 25, 9, 12), Tile(0, 0, 20, 30), Tile(3, 4, 5, 6)):
        rows, cols = (np.arange(a, a + n) % m for a, n, m in zip(window[:2], window[2:], (20, 30), strict=True))
        assert_same_bits(cut(whole, level, window), whole[:, rows[:, None], cols])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"schedule": "luby"}, "schedule luby needs the whole output at once; give the schedule coloring"),
        ({"schedule": "block"}, "schedule block needs the whole"),
        ({"array": "16x16"}, "array 16x16 needs the whole"),
        ({"tiles": 0}, "tiles is 0; give 1 or more"),
        ({"tiles": 1, "shape": (4000, 4000)}, "tiles of 1x1 pixels are 16000000, more than 4194304; give larger ones"),
        ({"tiles": 2**20, "shape": (2**20, 2**20), "workers": 2}, "is available; give smaller tiles or fewer workers"),
        ({"workers": 10**6}, "workers is 1000000; give .* or fewer"),
        ({"workers": 0}, "workers is 0; give 1 or more"),
        ({"shape": (0, 3)}, "rows of the output is 0"),
        ({"order": 200}, "does not fit the sample"),
    ],
)
def test_bad_input_is_said_before_anything_is_made(tmp_path, options, words):
    path = tmp_path / "out.zarr"
    with pytest.raises(ValueError, match=words):
        distributed.synthesize(SAMPLE, options.pop("shape", (20, 20)), path, **options)
    assert list(tmp_path.iterdir()) == []


def test_only_stores_of_ones_own_are_gone_on_with(tmp_path, monkeypatch):
    for make in (lambda path: None, lambda path: path.mkdir(), lambda path: path.write_text("no")):
        make(tmp_path / "a.zarr")
        with pytest.raises(ValueError, match="is no Zarr store"):
            distributed.resume(tmp_path / "a.zarr")
        if (tmp_path / "a.zarr").is_dir():
            (tmp_path / "a.zarr").rmdir()
    zarr.open_group(tmp_path / "b.zarr", mode="w")
    with pytest.raises(ValueError, match="is no output in tiles"):
        distributed.resume(tmp_path / "b.zarr")
    for name, other, words in (
        ("version", lambda name: "v", "is of simdtex v and this is .*; go on with the code of simdtex v that wrote"),
        ("FORMAT", 0, "is of format 0 and this simdtex reads .; go on with the code of simdtex .* that wrote it, or"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(store_module, name, other)
            store, where = created(tmp_path, f"{name}.zarr")
        with pytest.raises(ValueError, match=words):
            distributed.resume(where)
        assert store.turn.number == 1


def test_a_schedule_of_ones_own_is_not_known_to_workers(tmp_path):
    with pytest.raises(TypeError, match="workers know schedules by their names"):
        distributed.synthesize(SAMPLE, (20, 20), tmp_path / "o.zarr", schedule=simdtex.schedules.get("coloring"))


def test_the_store_is_an_array_that_others_read(tmp_path):
    path = tmp_path / "out.zarr"
    picture = distributed.synthesize(
        COLOUR, (20, 21), path, tiles=9, order=1, xi=-8.0, rng=1, device=REFERENCE, channel_axis=-1
    )
    assert picture.chunksize == (9, 9, 3)
    image = zarr.open_group(path, mode="r")["image"]
    assert image.metadata.dimension_names == ("y", "x", "channel")
    assert zarr.open_group(path).attrs["simdtex"]["seed"] == 1
    assert sorted(zarr.open_group(path).keys()) == ["checksums", "image"]
    assert Field._fields == store_module.PLANES


@pytest.mark.parametrize("several", [False, True])
def test_further_maps_are_carried_along(tmp_path, several):
    samples = [SAMPLE, texture((19, 30), seed=8)] if several else SAMPLE
    normal = [np.stack([one + k for k in (1, 2, 3)], -1) for one in ([SAMPLE, samples[1]] if several else [SAMPLE])]
    height = [one.astype(np.float32) / 7 for one in ([SAMPLE, samples[1]] if several else [SAMPLE])]
    maps = {"normal": normal, "height": height} if several else {"normal": normal[0], "height": height[0]}
    path, options = tmp_path / "o.zarr", {"order": 1, "xi": -8.0, "rng": 2, "device": REFERENCE}
    distributed.synthesize(samples, (26, 25), path, tiles=13, maps=maps, **options)
    _, output = simdtex.synthesize(samples, (26, 25), full_output=True, **options)
    store = zarr.open_group(path)
    assert sorted(store.keys()) == ["checksums", "height", "image", "normal"]
    for name, one in maps.items():
        assert_same_bits(store[name][...], apply_source_map(output.source, one))


@pytest.mark.parametrize(
    ("maps", "options", "words"),
    [
        ({"image": SAMPLE}, {}, "'image' is no name of a map; give a word other than image, source, checksums, work"),
        ({"../a": SAMPLE}, {}, "'../a' is no name of a map"),
        ({"n": SAMPLE[1:]}, {}, "the other map is 25 x 21 pixels .* and the sample 25 x 22: bring it to the"),
        (
            {"n": SAMPLE},
            {"known": np.ma.masked_array(np.ones((20, 20)), np.eye(20) < 1)},
            "the maps have no values for known pixels",
        ),
    ],
)
def test_maps_that_do_not_fit_are_said(tmp_path, maps, options, words):
    with pytest.raises(ValueError, match=words):
        distributed.synthesize(SAMPLE, (20, 20), tmp_path / "o.zarr", maps=maps, order=1, **options)
    assert list(tmp_path.iterdir()) == []

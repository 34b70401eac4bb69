"""An output in tiles has the bytes of one that is made at once, whatever the tiles, the workers and their order."""

import json
import os
import shutil
import sys
from contextvars import ContextVar
from pathlib import Path

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, texture

import simdtex
from simdtex import TileStore
from simdtex.driver import drive
from simdtex.jobs.synthesis.job import plan_synthesis
from simdtex.jobs.tiles import store as store_module
from simdtex.jobs.tiles.layout import Outputs, planned
from simdtex.jobs.tiles.store import Store
from simdtex.jobs.tiles.tasks import do
from simdtex.jobs.tiles.turns import Turns
from simdtex.methods.mrf import Options
from simdtex.methods.mrf.algorithm import MrfRun
from simdtex.methods.mrf.plan import plan as planned_run
from simdtex.model.pictures import Pictures
from simdtex.model.source_map import apply_source_map
from simdtex.schedules.sites import lattice_plan

zarr = pytest.importorskip("zarr")

SAMPLE = texture((22, 25), seed=2)
COLOUR = np.stack([texture((22, 25), seed=k) for k in (1, 2, 3)], -1)


def test_a_sample_and_options_of_every_kind_come_back_from_a_store(tmp_path):
    """What a worker lays out is what was laid out: see also that all options survive JSON."""
    options = Options(order=2, weights=(1.0, 0.5, 0.1 + 0.2), xi=-1.7)
    plan, seed = planned_run(Pictures((COLOUR,)), (30, 31), options), 2**40 + 1
    outputs = Outputs(True, False, {})
    tiles = planned(plan, seed, 10, outputs)
    store = Store.create(str(tmp_path / "s.zarr"), tiles, light={"light": "keep"})
    work = store.work
    assert (work.plan.options, work.seed, work.outputs, work.layout) == (plan.options, seed, outputs, tiles.layout)
    assert (work.plan.levels, work.plan.shape) == (plan.levels, (30, 31))
    assert_same_bits(work.plan.sample.working, plan.sample.working)
    assert json.dumps(store.about)


class Stop(Exception):
    pass


def created(tmp_path, name="s.zarr", **options):
    options, outputs = Options(order=1, levels=2, xi=-8.0, **options), Outputs(False, False, {})
    plan, where = planned_run(Pictures((SAMPLE[..., None],)), (14, 15), options), str(tmp_path / name)
    tiles = planned(plan, 11, 8, outputs)
    return Store.create(where, tiles, command=None, light={"light": "keep"}), where


@pytest.fixture(scope="module")
def whole():
    """The picture of the store that `created` makes."""
    return simdtex.synthesize(SAMPLE, (14, 15), rng=11, order=1, levels=2, xi=-8.0, device=REFERENCE)


def test_the_tiles_of_a_turn_are_done_in_any_order(tmp_path, whole):
    store, order = created(tmp_path)[0], np.random.default_rng(3)

    def execute(turn, tasks):
        for number in order.permutation(tasks).tolist():
            yield do(store.where, store.about["name"], REFERENCE, turn, number)

    drive(Turns(store, execute), REFERENCE, 0)
    store.clean()
    assert_same_bits(store.root["image"][...], whole)


@pytest.mark.slow
@pytest.mark.parametrize(("moment", "after"), [("replace", False), ("replace", True), ("rmtree", True)])
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
            image = TileStore(where).resume(REFERENCE)
            break
        except Stop:
            pass
    assert n > 2
    assert_same_bits(image.compute(), whole)
    assert not (Path(where) / "work").exists()


def test_progress_tells_every_tile_of_the_one_process_that_leads(tmp_path, monkeypatch):
    """The picture of a large level is every n-th site."""
    monkeypatch.setattr("simdtex.jobs.tiles.turns.SHOWN", 8)
    store, seen = TileStore(tmp_path / "out.zarr", 8), []

    def callback(progress):
        if not seen and sys.platform != "win32":  # Windows has no lock on a folder
            with pytest.raises(ValueError, match=r"another run is at work in .*out.zarr now; wait for it, or stop it"):
                store.resume(REFERENCE)
        seen.append((progress.fraction, progress.doing, progress.image()))

    options = {"order": 1, "xi": -8.0, "levels": 2, "rng": 1, "device": REFERENCE}
    simdtex.synthesize(SAMPLE, (14, 15), store=store, callback=callback, **options)
    fractions = [fraction for fraction, *_ in seen]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert seen[-1][1] == "writing the picture, tile 4 of 4"
    assert any("sweep 2, tile 3 of 4" in doing for _, doing, _ in seen)
    assert seen[-1][2].shape[:2] == (7, 8)
    before = zarr.open_group(store.path)["image"][...]  # the lock is released, and a finished run has nothing to do
    assert_same_bits(store.resume(REFERENCE).compute(), before)


def test_the_plan_says_what_is_needed():
    plan = TileStore("", 1024).layout(plan_synthesis(SAMPLE, (4096, 4096), order=18))
    finest = plan.levels[0]
    assert (finest.count, finest.side, finest.rows, finest.chunk) == (16, 1024, 4096, 512)
    assert finest.halo == 4 * lattice_plan(4096, 4096, True, 18, 0).colors
    assert 0.3 < finest.redundant < 0.4
    lines = plan.lines()
    assert lines[-2].startswith("level 0: 4096x4096 sites in 16 tiles of 1024x1024, halo 116, 3")
    assert f"{plan.memory / 2**20:.0f} MiB" in lines[-1]


def test_memory_of_a_worker_does_not_grow_with_the_output():
    jobs = [plan_synthesis(SAMPLE, (side, side), order=2) for side in (4000, 40_000, 1_000_000)]
    plans = [*map(TileStore("", 512).layout, jobs)]
    assert len({plan.memory for plan in plans}) == 1
    assert plans[-1].disk > 10**13
    more = TileStore("", 512, source_map=True, maps={"colour": np.stack([SAMPLE] * 3, -1)}).layout(jobs[0])
    assert more.disk - plans[0].disk == 4000**2 * (2 * 4 + 3)


def test_redundant_work_is_what_the_schedule_does(tmp_path):
    """Counted: the sites of all steps of a free sweep, over those of the lattice."""
    from simdtex.methods.mrf.level import ActiveSites
    from simdtex.schedules.schedule import Trimmed

    plan = planned_run(Pictures((SAMPLE[..., None],)), (120, 120), Options(order=2, levels=1))
    level = planned(plan, 1, 40, Outputs(False, False, {})).layout.levels[0]
    run = MrfRun(plan, REFERENCE, 1)
    sites = 0
    for tile in map(level.tile, range(level.count)):
        where, rows, _ = level.frame(tile, level.halo)
        window = run.level(0, where)
        schedule = Trimmed(window.schedule, rows.start, rows.stop)
        active = ActiveSites(window, np.zeros((1, 1)), True)
        _, info = schedule.step(window.setting, schedule.init(window.setting), active)
        sites += int((info.ranges[:, 1] - info.ranges[:, 0]).sum())
    assert sites / (120 * 120) - 1 == pytest.approx(level.redundant, rel=0.1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"schedule": "luby"}, "schedule luby needs the whole output at once; give the schedule coloring"),
        ({"array": "16x16"}, "array 16x16 needs the whole"),
        ({"side": 0}, "side of tiles is 0; give 1 or more"),
        ({"side": 1, "shape": (4000, 4000)}, "tiles of 1x1 pixels are 16000000, more than 4194304; give larger ones"),
        ({"side": 2**20, "shape": (2**20, 2**20), "workers": 2}, "is available; give smaller tiles or fewer workers"),
        ({"workers": 10**6}, "workers is 1000000; give .* or fewer"),
        ({"workers": 0}, "workers is 0; give 1 or more"),
        ({"method": "pyramid"}, "the method pyramid needs the whole output at once; give mrf, or make no tiles"),
        ({"checkpoint": "state"}, "a store keeps the state and the source map of its run; leave checkpoint"),
        ({"full_output": True}, "a store keeps the state and the source map of its run; leave checkpoint"),
    ],
)
def test_bad_input_is_said_before_anything_is_made(tmp_path, options, words):
    own = {name: options.pop(name) for name in ("side", "workers") if name in options}
    store = TileStore(tmp_path / "out.zarr", **own)
    with pytest.raises(ValueError, match=words):
        simdtex.synthesize(SAMPLE, options.pop("shape", (20, 20)), store=store, **options)
    assert list(tmp_path.iterdir()) == []


def test_only_stores_of_ones_own_are_gone_on_with(tmp_path, monkeypatch):
    for make in (lambda path: None, lambda path: path.mkdir(), lambda path: path.write_text("no")):
        make(tmp_path / "a.zarr")
        with pytest.raises(ValueError, match="is no Zarr store"):
            TileStore(tmp_path / "a.zarr").resume()
        if (tmp_path / "a.zarr").is_dir():
            (tmp_path / "a.zarr").rmdir()
    zarr.open_group(tmp_path / "b.zarr", mode="w")
    with pytest.raises(ValueError, match="is no output in tiles"):
        TileStore(tmp_path / "b.zarr").resume()
    for name, other, words in (
        ("version", lambda name: "v", "is of simdtex v and this is .*; go on with the code of simdtex v that wrote"),
        ("FORMAT", 0, "is of format 0 and this simdtex reads \\d+; go on with the code of simdtex .* that wrote it"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(store_module, name, other)
            store, where = created(tmp_path, f"{name}.zarr")
        with pytest.raises(ValueError, match=words):
            TileStore(where).resume()
        assert store.turn.number == 1


def test_a_path_is_no_store_and_a_schedule_of_ones_own_is_not_known_to_workers(tmp_path):
    with pytest.raises(TypeError, match=r"store is a str; give simdtex.TileStore\(path\)"):
        simdtex.synthesize(SAMPLE, (20, 20), store="o.zarr")
    with pytest.raises(TypeError, match="workers know schedules by their names"):
        store, schedule = TileStore(tmp_path / "o.zarr"), simdtex.schedules.get("coloring")
        simdtex.synthesize(SAMPLE, (20, 20), store=store, schedule=schedule)


def test_the_store_is_an_array_that_others_read(tmp_path):
    """Its channels are last, and those of what is returned where they are in the sample."""
    path, sample = tmp_path / "out.zarr", np.ascontiguousarray(np.moveaxis(COLOUR, -1, 0))
    how = {"order": 1, "xi": -8.0, "rng": 1, "levels": 2, "device": REFERENCE, "channel_axis": 0}
    picture = simdtex.synthesize(sample, (14, 15), store=TileStore(path, 9), **how)
    assert picture.chunksize == (3, 9, 9)
    assert_same_bits(picture.compute(), simdtex.synthesize(sample, (14, 15), **how))
    image = zarr.open_group(path, mode="r")["image"]
    assert image.metadata.dimension_names == ("y", "x", "channel")
    assert zarr.open_group(path).attrs["simdtex"]["seed"] == 1
    assert sorted(zarr.open_group(path).keys()) == ["checksums", "image"]


def test_further_maps_are_carried_along(tmp_path):
    samples = [SAMPLE, texture((19, 30), seed=8)]
    normal = [np.stack([one + k for k in (1, 2, 3)], -1) for one in samples]
    maps = {"normal": normal, "height": [one.astype(np.float32) / 7 for one in samples]}
    path, options = tmp_path / "o.zarr", {"order": 1, "xi": -8.0, "levels": 2, "rng": 2, "device": REFERENCE}
    simdtex.synthesize(samples, (14, 15), store=TileStore(path, 8, maps=maps), **options)
    _, output = simdtex.synthesize(samples, (14, 15), full_output=True, **options)
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
        store = TileStore(tmp_path / "o.zarr", maps=maps)
        simdtex.synthesize(SAMPLE, (20, 20), store=store, order=1, **options)
    assert list(tmp_path.iterdir()) == []

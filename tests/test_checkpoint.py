"""`simdtex.checkpoint`: a run that was stopped goes on to the same bytes, and refuses what it cannot go on with."""

import json
import os
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest
from cases import assert_same_bits, texture

import simdtex
from simdtex import schedules
from simdtex.checkpoints import folder as files
from simdtex.checkpoints import keep as keeps
from simdtex.checkpoints import keeper as keepers
from simdtex.checkpoints.folder import JOB, Folder
from simdtex.checkpoints.tree import identity, like, packed, unpacked
from simdtex.methods.mrf import make_options

GREY, COLOUR = texture((14, 15)), texture((16, 18), 3)
HOLE = np.zeros((14, 15), bool)
HOLE[2:4, 3:6] = HOLE[10:12, 9:12] = True
KNOWN = np.ma.masked_array(np.full((12, 13), GREY[5, 5]), np.ones((12, 13), bool))
KNOWN.mask[3:5, 4] = KNOWN.mask[8, 9] = False
MRF = {"order": 2, "finish": 1.0}


class Stop(Exception):
    """What stops a run."""


def simulated(**how):
    how.pop("full_output")
    found = simdtex.simulate(GREY, 3, shape=(8, 9), order=2, jobs=1, **how)
    return found.values, simdtex.Output(None)


JOBS = {
    "mrf": lambda **how: simdtex.synthesize(GREY, (12, 13), **MRF, **how),
    "mrf-exact-colour": lambda **how: simdtex.synthesize(
        COLOUR, (10, 8), order=1, search="exact", relaxation="gibbs", array="4x4", channel_axis=-1, **how
    ),
    "mrf-similar": lambda **how: simdtex.synthesize(GREY, (12, 13), order=2, similar=2, exhaustive=8, **how),
    "mrf-known-guide": lambda **how: simdtex.synthesize(
        GREY, (12, 13), known=KNOWN, guide=(GREY // 90, texture((12, 13), seed=4) // 90), **MRF, **how
    ),
    "multires": lambda **how: simdtex.synthesize(
        COLOUR, (12, 21), method="multires", alpha="auto", channel_axis=-1, **how
    ),
    "pyramid": lambda **how: simdtex.synthesize(
        COLOUR, (17, 16), method="pyramid", iterations=2, channel_axis=-1, **how
    ),
    "solid": lambda **how: simdtex.synthesize_solid(COLOUR, (8, 9, 8), iterations=2, channel_axis=-1, **how),
    "mix": lambda **how: simdtex.mix([GREY, GREY[::-1]], (16, 16), iterations=2, **how),
    "fill": lambda **how: simdtex.fill(GREY, HOLE, order=1, levels=1, **how),
    "extend": lambda **how: simdtex.extend(GREY, right=3, seamless="y", band=2, order=2, **how),
    "simulate": simulated,
}
QUICK = JOBS["mrf"]


def run(job, **how):
    return job(**({"rng": 5, "device": "reference", "full_output": True} | how))


def plainly(found):
    """Statistics without what depends on the clock and on how often the run was begun."""
    if isinstance(found, dict):
        clock = ("seconds", "device_seconds", "launches")
        return {name: plainly(value) for name, value in found.items() if name not in clock}
    return [plainly(value) for value in found] if isinstance(found, list) else found


def assert_same_run(one, other):
    (image, output), (image2, output2) = one, other
    assert_same_bits(image, image2)
    for name in ("source", "temperature"):
        assert_same_bits(getattr(output, name), getattr(output2, name)) if getattr(output, name) is not None else None
    assert len(output.stages) == len(output2.stages)
    for stage, stage2 in zip(output.stages, output2.stages, strict=True):
        assert stage.level == stage2.level
        assert_same_bits(stage.image, stage2.image)
        assert (stage.source is None) == (stage2.source is None)
        if stage.source is not None:
            assert_same_bits(stage.source, stage2.source)
            assert_same_bits(stage.candidates, stage2.candidates)
    assert plainly(output.statistics) == plainly(output2.statistics)


@pytest.fixture(scope="module")
def whole():
    """Every job as it is without a stop, made once."""
    made = {}

    def of(name, device="reference"):
        if (name, device) not in made:
            made[name, device] = run(JOBS[name], device=device)
        return made[name, device]

    return of


def stopping_after(monkeypatch, writes):
    """Raise Stop after every so many writes of states."""
    left = [writes]
    write = keeps.Kept._write

    def stopped(self, *args, **kwargs):
        wrote = write(self, *args, **kwargs)
        left[0] -= 1
        if not left[0]:
            left[0] = writes
            raise Stop
        return wrote

    monkeypatch.setattr(keeps.Kept, "_write", stopped)


def gone_on(job, folder, every=0, **how):
    """Call again until it is done: what came, and how often it was stopped."""
    stops = 0
    while True:
        try:
            with simdtex.checkpoint(folder, every=every):
                return run(job, **how), stops
        except Stop:
            stops += 1


# -- the same bytes -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", JOBS)
def test_stopped_after_every_checkpoint(name, whole, tmp_path, monkeypatch):
    stopping_after(monkeypatch, 1)
    found, stops = gone_on(JOBS[name], tmp_path)
    assert stops >= (2 if name in ("mix", "extend") else 3)
    assert_same_run(found, whole(name))


@pytest.mark.parametrize("name", ["mrf", "multires", "pyramid"])
def test_stopped_on_a_device(name, whole, any_device, tmp_path, monkeypatch):
    stopping_after(monkeypatch, 2)
    device = str(any_device.index)
    found, stops = gone_on(JOBS[name], tmp_path, device=device)
    assert stops
    assert_same_bits(found[0], whole(name)[0])
    statistics = [plainly(one[1].statistics) for one in (found, whole(name, device))]
    assert statistics[0] == statistics[1]


@pytest.mark.parametrize("schedule", ["luby", "random-scan", "block:4x4", "synchronous", "random-subset:0.5"])
def test_what_a_schedule_keeps(schedule, tmp_path, monkeypatch):
    def job(**how):
        return simdtex.synthesize(GREY, (6, 7), order=1, schedule=schedule, check_schedule=True, **how)

    expected = run(job)
    stopping_after(monkeypatch, 3)
    found, stops = gone_on(job, tmp_path)
    assert stops
    assert_same_run(found, expected)


@pytest.mark.parametrize("call", [1, 2, 5, 7])
@pytest.mark.parametrize("name", ["mrf", "multires", "pyramid", "fill"])
def test_stopped_by_a_callback(name, call, whole, tmp_path):
    left = [call if name in ("mrf", "fill") else min(call, 4)]

    def callback(progress):
        left[0] -= 1
        if not left[0]:
            raise Stop

    found, stops = gone_on(JOBS[name], tmp_path, callback=callback)
    assert stops == 1
    assert_same_run(found, whole(name))


def test_a_callback_sees_the_share_go_on(tmp_path):
    seen = []

    def callback(progress):
        seen.append(progress.fraction)
        if len(seen) == 5:
            raise Stop

    gone_on(QUICK, tmp_path, callback=callback)
    assert seen[5] == seen[4] > seen[3]  # the sweep that was interrupted begins anew
    assert seen[5:] == sorted(seen[5:])


def test_a_drawn_seed_is_gone_on_with(tmp_path, monkeypatch):
    stopping_after(monkeypatch, 3)
    (image, output), stops = gone_on(QUICK, tmp_path, rng=None)
    assert stops
    monkeypatch.undo()
    assert_same_bits(run(QUICK, rng=output.statistics["seed"])[0], image)


def test_a_generator_is_a_seed_too(tmp_path, monkeypatch):
    stopping_after(monkeypatch, 3)
    seeds = iter(np.random.default_rng(8) for _ in range(99))
    with pytest.raises(Stop), simdtex.checkpoint(tmp_path, every=0):
        run(QUICK, rng=next(seeds))
    monkeypatch.undo()
    with simdtex.checkpoint(tmp_path):
        image, _ = run(QUICK, rng=next(seeds))
    assert_same_bits(run(QUICK, rng=next(seeds))[0], image)


def test_stop_writes_the_state_and_interrupts(whole, tmp_path):
    with pytest.raises(KeyboardInterrupt), simdtex.checkpoint(tmp_path, every=1e6) as keeper:
        run(QUICK, callback=lambda progress: keeper.stop())
    assert [path.name for path in sorted(tmp_path.glob("state*"))] == ["state-000001.json", "state-000001.npz"]
    with simdtex.checkpoint(tmp_path):
        assert_same_run(run(QUICK), whole("mrf"))


def test_finished_realisations_are_kept(tmp_path):
    whole = simulated(rng=5, device="reference", full_output=True)[0]
    made = []

    def callback(progress):
        made.append(progress.realisation)
        if progress.finished == 2:
            raise Stop

    with pytest.raises(Stop), simdtex.checkpoint(tmp_path, every=1e6):  # what waits is written in the end
        run(simulated, callback=callback)
    with simdtex.checkpoint(tmp_path):
        found, _ = run(simulated, callback=callback)
    assert made == [0, 1, 2]
    assert_same_bits(found, whole)


# -- what is refused ------------------------------------------------------------------------------------------


def stopped(folder, job=QUICK, **how):
    """A folder with the states of a run that was stopped."""
    with pytest.raises(KeyboardInterrupt), simdtex.checkpoint(folder, every=0) as keeper:
        run(job, callback=lambda progress: keeper.stop(), **how)
    return folder


def contents(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def refused(folder, words, job=QUICK, **how):
    before = contents(folder)
    with pytest.raises(ValueError, match=words) as caught, simdtex.checkpoint(folder):
        run(job, **how)
    assert contents(folder) == before
    assert "\n" not in str(caught.value)


def edited(folder, **changes):
    """Change what the folder says of its run, checksum included."""
    job = files._read_json(folder / JOB) | changes
    files._write(folder / JOB, files._json_of(job))


def test_another_run_is_refused(tmp_path):
    stopped(tmp_path)
    again = "give the same, or an empty folder"
    refused(tmp_path, rf"another seed \(5, not 6\); {again}", rng=6)
    other = GREY.copy()
    other[0, 0] ^= 1
    refused(tmp_path, f"another sample; {again}", lambda **how: simdtex.synthesize(other, (12, 13), **MRF, **how))
    refused(tmp_path, "another sample", lambda **how: simdtex.synthesize(GREY.astype("f4"), (12, 13), **MRF, **how))
    refused(
        tmp_path, r"shape of the output \(12x13, not 12x14\)", lambda **how: simdtex.synthesize(GREY, (12, 14), **how)
    )
    refused(tmp_path, r"option order \(2, not 3\)", lambda **how: simdtex.synthesize(GREY, (12, 13), order=3, **how))
    refused(tmp_path, r"another call \(synthesize, not fill\)", JOBS["fill"])
    refused(
        tmp_path,
        r"another method \(mrf, not pyramid\)",
        lambda **how: simdtex.synthesize(GREY, (12, 13), method="pyramid", **how),
    )
    mask = np.ones(GREY.shape, bool)
    refused(tmp_path, "another mask", lambda **how: simdtex.synthesize(GREY, (12, 13), mask=mask, **MRF, **how))
    with simdtex.checkpoint(tmp_path):
        run(QUICK)


def test_another_version_is_refused(tmp_path):
    stopped(tmp_path)
    edited(tmp_path, version="0.0.1")
    refused(tmp_path, r"is of simdtex 0\.0\.1 and this is .*, whose results may differ; go on with 0\.0\.1, or give")


def test_another_format_is_refused(tmp_path):
    stopped(tmp_path)
    edited(tmp_path, format=files.FORMAT + 1)
    refused(tmp_path, "is of format 2 and this simdtex reads 1; go on with simdtex")


def test_another_device_is_told(whole, tmp_path):
    stopped(tmp_path)
    edited(tmp_path, device="Abacus")
    with (
        pytest.warns(UserWarning, match=r"begun on Abacus and goes on on reference \(NumPy\); the bytes are the same"),
        simdtex.checkpoint(tmp_path),
    ):
        found = run(QUICK)
    assert_same_run(found, whole("mrf"))


def test_from_a_device_to_the_reference(whole, any_device, tmp_path):
    stopped(tmp_path, device=str(any_device.index))
    with pytest.warns(UserWarning, match="the bytes are the same on every device"), simdtex.checkpoint(tmp_path):
        image, _ = run(QUICK)
    assert_same_bits(image, whole("mrf")[0])


def test_other_folders_are_refused(tmp_path):
    (tmp_path / "photo.png").write_bytes(b"mine")
    refused(tmp_path, r"holds other files \(photo.png\) and no checkpoint; give an empty or a new one")
    with pytest.raises(ValueError, match="is a file; give a folder"), simdtex.checkpoint(tmp_path / "photo.png"):
        pass
    with pytest.raises(ValueError, match="does not exist; create it first"), simdtex.checkpoint(tmp_path / "a" / "b"):
        pass
    with pytest.raises(ValueError, match="every is -1"), simdtex.checkpoint(tmp_path / "new", every=-1):
        pass
    assert not (tmp_path / "new").exists()


def test_states_of_nobody_knows_what_are_refused(tmp_path):
    stopped(tmp_path)
    (tmp_path / JOB).unlink()
    refused(tmp_path, r"holds other files \(state-000001.json\) and no checkpoint")


def test_a_run_that_was_killed_at_its_very_beginning(whole, tmp_path):
    (tmp_path / "lock").touch()
    (tmp_path / f"{JOB}.new").write_text("half")
    with simdtex.checkpoint(tmp_path):
        assert_same_run(run(QUICK), whole("mrf"))
    assert sorted(contents(tmp_path)) == [JOB, "lock"]


def test_a_finished_run_says_so(tmp_path):
    folder = tmp_path / "new"
    with simdtex.checkpoint(folder, every=0):
        run(QUICK)
    assert sorted(contents(folder)) == [JOB, "lock"]
    refused(folder, "is finished; give an empty folder to begin another")


def test_one_run_to_a_block(tmp_path):
    with (
        pytest.raises(
            ValueError, match=r"a checkpoint keeps one run; give the next one a simdtex.checkpoint of its own"
        ),
        simdtex.checkpoint(tmp_path),
    ):
        run(QUICK)
        run(QUICK)


def test_one_process_at_a_time(tmp_path):
    pytest.importorskip("fcntl")
    with simdtex.checkpoint(tmp_path) as outer:
        outer._folder.take()
        outer._taken = True
        with (
            pytest.raises(ValueError, match=r"another run keeps its state in .*; wait for it"),
            simdtex.checkpoint(tmp_path),
        ):
            run(QUICK)


def test_bad_input_leaves_nothing(tmp_path):
    folder = tmp_path / "new"
    with pytest.raises(ValueError, match="rows of the output is 0"), simdtex.checkpoint(folder):
        simdtex.synthesize(GREY, (0, 3))
    assert not folder.exists()


# -- damage ---------------------------------------------------------------------------------------------------


def cut(path):
    path.write_bytes(path.read_bytes()[:-7])


def flipped(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(bytes(data))


def nested(path):
    path.write_text("[" * 100_000)


def several(folder):
    """Two states of a run."""
    count = [0]

    def callback(progress):
        count[0] += progress.end_of_sweep
        if count[0] == 4:
            raise Stop

    with pytest.raises(Stop), simdtex.checkpoint(folder, every=0):
        run(QUICK, callback=callback)
    stems = sorted({path.stem for path in folder.glob("state*")})
    assert len(stems) == 2
    return stems


@pytest.mark.parametrize("damage", [cut, flipped, nested, Path.unlink])
@pytest.mark.parametrize("suffix", [".npz", ".json"])
def test_a_damaged_state_falls_back_to_the_one_before(suffix, damage, whole, tmp_path):
    _, latest = several(tmp_path)
    damage(tmp_path / f"{latest}{suffix}")
    if (suffix, damage) == (".json", Path.unlink):  # as if it had not been written
        with simdtex.checkpoint(tmp_path):
            assert_same_run(run(QUICK), whole("mrf"))
        return
    words = f"the state {latest} in .* is damaged; an earlier one is gone on from"
    with pytest.warns(UserWarning, match=words), simdtex.checkpoint(tmp_path):
        assert_same_run(run(QUICK), whole("mrf"))


def test_damaged_states_alone_say_so(tmp_path):
    for stem in several(tmp_path):
        flipped(tmp_path / f"{stem}.npz")
    refused(tmp_path, "is damaged and there is no earlier one; remove the folder, and run the command again")
    flipped(tmp_path / JOB)
    refused(tmp_path, r"checkpoint\.json is damaged, so nothing says what run this is; remove the folder")


def test_damaged_realisations_are_made_anew(tmp_path):
    def callback(progress):
        raise Stop

    whole = run(simulated)[0]
    with pytest.raises(Stop), simdtex.checkpoint(tmp_path, every=0):
        run(simulated, callback=callback)
    flipped(tmp_path / "results-000001.npz")
    with pytest.warns(UserWarning, match="results-000001 in .* is damaged; what was in it is made anew"):  # noqa: SIM117
        with simdtex.checkpoint(tmp_path):
            assert_same_bits(run(simulated)[0], whole)


# -- faults while it writes -----------------------------------------------------------------------------------

FAULTS = {
    "replace": (os, "replace"),
    "fsync": (os, "fsync"),
    "write": (np, "savez"),
    "open": (files, "_write"),
}


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()], ids=["full", "killed"])
@pytest.mark.parametrize(
    ("where", "at"),
    [
        *(("replace", at) for at in (2, 3, 4, 5)),
        *(("fsync", at) for at in (2, 3, 4, 5, 6, 8)),
        ("write", 2),
        ("open", 3),
    ],
)
def test_a_fault_in_a_write_loses_nothing(where, at, error, whole, tmp_path, monkeypatch):
    module, name = FAULTS[where]
    works, calls = getattr(module, name), [0]

    def faulty(*args, **kwargs):
        calls[0] += 1
        if calls[0] == at:
            if name == "savez":
                args[0].write(b"half of it")
            raise error
        return works(*args, **kwargs)

    monkeypatch.setattr(module, name, faulty)
    if isinstance(error, OSError) and (where, at) != ("fsync", 2):  # that one is of the job's own file
        with (
            pytest.warns(UserWarning, match=r"could not be written \(No space left on device\); the run goes on"),
            pytest.raises(Stop),
            simdtex.checkpoint(tmp_path, every=0),
        ):
            run(QUICK, callback=lambda progress: sweeps_end(calls, at, Stop))
    else:
        with pytest.raises((KeyboardInterrupt, ValueError)), simdtex.checkpoint(tmp_path, every=0):
            run(QUICK)
    monkeypatch.undo()
    assert not list(tmp_path.glob("*.new"))
    with simdtex.checkpoint(tmp_path):
        assert_same_run(run(QUICK), whole("mrf"))


def sweeps_end(calls, at, error):
    if calls[0] >= at:
        raise error


def test_a_run_whose_checkpoint_cannot_be_written_ends_all_the_same(whole, tmp_path, monkeypatch):
    def full(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Folder, "keep", lambda *args, **kwargs: full())
    with pytest.warns(UserWarning, match="could not be written") as told, simdtex.checkpoint(tmp_path, every=0):
        assert_same_run(run(QUICK), whole("mrf"))
    assert len(told) == 1  # once, and not at every sweep


def test_a_folder_that_cannot_be_written_is_refused_before_the_work(tmp_path, monkeypatch):
    def full(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with (
        pytest.raises(ValueError, match=r"cannot be written \(No space left on device\)"),
        simdtex.checkpoint(tmp_path),
    ):
        run(QUICK, callback=lambda progress: pytest.fail("the work has begun"))


# -- how often, and what --------------------------------------------------------------------------------------


def test_a_write_waits_75_times_what_the_last_one_took(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(keeps.time, "perf_counter", lambda: now[0])
    pace = keeps.Pace(None)
    assert not pace.due
    now[0] += 0.99
    assert not pace.due
    now[0] += 0.02
    assert pace.due
    assert pace.early(now[0], 2**27 // 10)  # a tenth of a second, so 7.5 from the beginning
    assert not pace.due
    now[0] += 6.4
    assert not pace.due
    now[0] += 0.2
    assert pace.due and not pace.early(now[0], 2**27 // 10)
    began, now[0] = now[0], now[0] + 0.2
    pace.wrote(began, 2**20)
    assert not pace.early(now[0], 2**21)  # what is measured counts
    now[0] += 14.9
    assert not pace.due
    now[0] += 0.2
    assert pace.due
    assert pace.early(now[0], 2**40) and not pace.due  # but for far more bytes
    pace.wrote(now[0] - 10, 2**40, keeps.LONGEST)
    now[0] += 60.1
    assert pace.due
    pace.wrote(now[0], 2**40)
    now[0] += 0.9  # a write that took nothing
    assert not pace.due
    assert keeps.SHARE == 75 and keeps.FIRST == 1


def test_a_short_run_writes_no_state(tmp_path, monkeypatch):
    monkeypatch.setattr(Folder, "keep", lambda *args, **kwargs: pytest.fail("a state was written"))
    monkeypatch.setattr(keeps, "FIRST", 1e6)
    with simdtex.checkpoint(tmp_path):
        run(QUICK)


def test_two_states_are_kept(tmp_path):
    folder = Folder(tmp_path)
    for number in range(5):
        folder.keep("state", {"number": number})
    assert sorted(contents(tmp_path)) == [f"state-00000{n}.{kind}" for n in (4, 5) for kind in ("json", "npz")]
    assert folder.latest("state") == {"number": 4}


Named = namedtuple("Named", "first second")


def test_a_tree_comes_back_as_it_was():
    arrays = [np.arange(2).astype(kind) for kind in ("u1", ">u2", "<i8", "f2", "f4", ">f8", "c8", "?")]
    arrays += [np.zeros((0, 3), np.int16), np.array(7.5, np.float32), np.asfortranarray(np.eye(3)), np.float32(0.1)]
    numbers = [
        0,
        -1,
        2**70,
        0.1,
        -0.0,
        float("inf"),
        float("-inf"),
        5e-324,
        True,
        None,
        "text \ud800",
        np.uint64(2**63),
    ]
    tree = {"a": arrays, "b": (numbers, [[], (), {}]), "c": Named(1, Named(np.arange(2), "x"))}
    told, kept = packed(tree)
    found = unpacked(json.loads(json.dumps(told)), kept)
    for one, other in zip(arrays, found["a"], strict=True):
        assert type(one) is type(other)
        assert_same_bits(np.asarray(one), np.asarray(other))
    assert repr(found["b"]) == repr(tree["b"])
    assert type(found["c"]) is tuple
    again = like(Named(0, Named(0, 0)), found["c"])
    assert isinstance(again, Named) and isinstance(again.second, Named) and again.second.second == "x"


@pytest.mark.parametrize("thing", [object(), {1: 2}, np.array([None]), {1, 2}, 1j])
def test_what_is_not_plain_is_refused(thing):
    with pytest.raises(TypeError, match=r"a checkpoint cannot keep|cannot be kept in a checkpoint"):
        packed({"x": [thing]})


def test_nothing_is_unpickled(tmp_path):
    folder = Folder(tmp_path)
    folder.keep("state", {"x": np.arange(3)})
    check = files._write(tmp_path / "state-000001.npz", lambda file: np.savez(file, **{"0": np.array([print])}))
    told = files._read_json(tmp_path / "state-000001.json") | {"arrays": check}
    files._write(tmp_path / "state-000001.json", files._json_of(told))
    with pytest.raises(ValueError, match="is damaged"):
        folder.latest("state")


def test_identities_tell_inputs_apart():
    assert identity(1) == identity(1.0) == identity(np.float32(1))
    assert identity(2**60) != identity(2**60 + 1)
    assert identity(np.arange(4)) != identity(np.arange(4).reshape(2, 2)) != identity(np.arange(4, dtype=float))
    assert identity((1, None, "a", True)) == [1.0, None, "a", True]
    assert identity(schedules.get("block:3x4")) == "Block block:3x4"
    assert identity(make_options(xi=-2))["xi"] == -2 and json.dumps(identity(make_options()))


def test_the_context_ends_with_its_block(tmp_path):
    with simdtex.checkpoint(tmp_path):
        assert keepers.CURRENT.get() is not None
    assert keepers.CURRENT.get() is None
    assert not tmp_path.joinpath(JOB).exists()  # no run, no checkpoint
    run(QUICK)
    assert not contents(tmp_path)


# -- killed ---------------------------------------------------------------------------------------------------


def killed(*words):
    environment = os.environ | {"PYTHONPATH": str(Path(simdtex.__file__).parent.parent), "SIMDTEX_TUNE": "0"}
    script = Path(__file__).with_name("killed.py")
    done = subprocess.run(
        [sys.executable, script, *map(str, words)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked")
def test_a_few_kills_change_nothing():
    told = killed(6, 1, "mrf", "simulate")
    assert told["kills"] == 6
    assert told["wrong"] == []


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked")
def test_a_hundred_kills_change_nothing():
    told = killed(100, 2)
    assert told["kills"] == 100
    assert told["inside"] > 0  # some came while a file was being written
    assert told["wrong"] == []

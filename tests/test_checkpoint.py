"""Checkpoints: a run that was stopped goes on to the same bytes, and a checkpoint of another run is refused."""

import json
import os
import subprocess
import sys
from collections import namedtuple
from functools import partial
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest
from cases import assert_same_bits, texture
from runs import hole

import simdtex
from simdtex import checkpoint as checkpoints
from simdtex.checkpoint import Checkpoint, like, pack, read, unpack
from simdtex.io.files import exclusive, write_checked

GREY = texture((14, 15))
SMALL = {"order": 1, "levels": 1}


class Stop(Exception):
    """Stops a run."""


def quick(**how):
    return simdtex.synthesize(GREY, (6, 7), **SMALL, **how)


def fill(**how):
    return simdtex.fill(GREY, hole(), **SMALL, **how)


def simulated(**how):
    how.pop("full_output")
    found = simdtex.simulate(GREY, 3, shape=(6, 7), jobs=1, **SMALL, **how)
    return found.values, simdtex.Output(None)


def run(job, **how):
    return job(**({"rng": 5, "device": "reference", "full_output": True} | how))


@pytest.fixture(scope="module")
def whole():
    """The picture of the run without a stop."""
    return run(quick)[0]


@pytest.fixture
def file(tmp_path):
    return tmp_path / "run.checkpoint"


def test_the_fraction_goes_on(file):
    seen = []

    def callback(progress):
        seen.append(progress.fraction)
        if len(seen) == 5:
            raise Stop

    with pytest.raises(Stop):
        run(quick, checkpoint=Checkpoint(file, every=0), callback=callback)
    run(quick, checkpoint=file, callback=callback)
    assert seen[5] == seen[4] > seen[3]  # the interrupted sweep begins anew
    assert seen[5:] == sorted(seen[5:])


def test_a_drawn_seed_is_kept(file):
    image, output = run(quick, checkpoint=stopped(file, rng=None), rng=None)
    assert_same_bits(run(quick, rng=output.statistics["seed"])[0], image)


def test_stop_writes_the_state_and_interrupts(whole, file):
    checkpoint = Checkpoint(file, every=1e6)
    with pytest.raises(KeyboardInterrupt):
        run(quick, callback=lambda progress: checkpoint.stop(), checkpoint=checkpoint)
    assert read(file)[1] is not None
    assert_same_bits(run(quick, checkpoint=file)[0], whole)
    assert not list(file.parent.iterdir())  # a path is removed by the function


def test_finished_realisations_are_kept(file):
    whole = simulated(rng=5, device="reference", full_output=True)[0]
    made = []

    def callback(progress):
        made.extend([progress.realisation] * bool(progress.stage))
        if len(made) == 2:
            raise Stop

    with pytest.raises(Stop):  # those that wait are written at the end
        run(simulated, callback=callback, checkpoint=Checkpoint(file, every=1e6))
    tree = read(file)[1]
    assert tree["numbers"] == made and len(made) >= 2
    assert_same_bits(tree["pictures"][..., 0], whole[made])
    for numbers in ([0, 1], [2, 0]):  # several machines end in any order
        sources = np.zeros((2, *whole.shape[1:], 0), np.int32)  # that are not asked for
        edited(file, {"numbers": numbers, "pictures": whole[numbers][..., None], "sources": sources})
        kept, made[:] = file.read_bytes(), []
        found, _ = run(simulated, callback=callback, checkpoint=file)
        assert made == [number for number in range(3) if number not in numbers]
        assert_same_bits(found, whole)
        file.write_bytes(kept)


def stopped(file, job=quick, **how):
    """The checkpoint of a run that was stopped."""
    file.unlink(missing_ok=True)
    checkpoint = Checkpoint(file, every=0)
    with pytest.raises(KeyboardInterrupt):
        run(job, callback=lambda progress: checkpoint.stop(), checkpoint=checkpoint, **how)
    return file


def refused(file, words, job=quick, **how):
    before = file.read_bytes() if file.is_file() else None
    with pytest.raises(ValueError, match=words) as caught:
        run(job, checkpoint=file, **how)
    assert (file.read_bytes() if file.is_file() else None) == before
    assert "\n" not in str(caught.value)


def edited(file, state=None, **changes):
    """Change the description in a checkpoint, or its state, checksum included."""
    about, tree = read(file)
    text, arrays = pack(tree if state is None else state)
    about |= {"tree": text} | changes
    named = {str(k): array for k, array in enumerate(arrays)}
    named["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    write_checked(file, lambda out: np.savez(out, **named))


def test_another_run_is_refused(file):
    def synthesize(sample=GREY, shape=(6, 7), **options):
        return lambda **how: simdtex.synthesize(sample, shape, **(options or SMALL), **how)

    stopped(file)
    refused(file, r"another seed \(5, not 6\); give the same, or a new file", rng=6)
    other = GREY.copy()
    other[0, 0] ^= 1
    refused(file, "another sample; give the same", synthesize(other))
    refused(file, "another sample", synthesize(GREY.astype("f4")))
    refused(file, r"shape of the output \(6x7, not 6x8\)", synthesize(shape=(6, 8)))
    refused(file, r"option order \(1, not 3\)", synthesize(order=3, levels=1))
    refused(file, r"another call \(synthesize, not fill\)", fill)
    refused(file, r"another method \(mrf, not pyramid\)", synthesize(method="pyramid"))
    refused(file, "another mask", synthesize(mask=np.ones(GREY.shape, bool), **SMALL))
    run(quick, checkpoint=file)


def test_another_version_or_format_is_refused_and_another_device_noted(whole, file):
    edited(stopped(file), format=checkpoints.FORMAT, version="0.0.1")
    refused(file, r"is of simdtex 0\.0\.1 and this is .*, whose results may differ; go on with")
    edited(stopped(file), format=4)
    refused(file, r"is of format 4 and this simdtex reads 10; go on with the code of simdtex .* that wrote it,")
    edited(stopped(file), format=checkpoints.FORMAT, device="Abacus")
    with pytest.warns(UserWarning, match=r"begun on Abacus and goes on on reference \(NumPy\); the bytes are the same"):
        assert_same_bits(run(quick, checkpoint=file)[0], whole)


def test_other_paths_are_refused(tmp_path):
    photo = tmp_path / "photo.png"
    photo.write_bytes(b"mine")
    refused(photo, r"photo.png is no checkpoint, or is damaged; give another file")
    refused(tmp_path, "is a folder: add a file name")
    refused(tmp_path / "a" / "b", "does not exist: create it first")
    with pytest.raises(ValueError, match="every is -1"):
        Checkpoint(tmp_path / "new", every=-1)
    assert [path.name for path in tmp_path.iterdir()] == ["photo.png"]


def test_one_run_to_a_checkpoint(file, monkeypatch):
    monkeypatch.setattr(checkpoints, "FIRST", 1e6)
    checkpoint = Checkpoint(file)
    run(quick, checkpoint=checkpoint)
    assert read(file)[1] is None, "a short run writes no state"
    assert file.is_file()  # its owner removes it, once the result is written
    with pytest.raises(ValueError, match="a checkpoint keeps one run; give each call a checkpoint of its own"):
        run(quick, checkpoint=checkpoint)
    checkpoint.remove()
    assert not list(file.parent.iterdir())


def test_one_process_at_a_time(file):
    pytest.importorskip("fcntl")
    with exclusive(file), pytest.raises(ValueError, match=r"another run is at work in .*; wait for it"):
        run(quick, checkpoint=file)


def test_bad_input_leaves_nothing(file):
    for call in (simdtex.synthesize, lambda image, shape, **how: simdtex.fill(image, hole(), **how)):
        job = partial(call, GREY, (6, 7), order=1, levels=9)
        with pytest.raises(ValueError):
            run(job, checkpoint=file)
        assert not list(file.parent.iterdir())


def test_a_damaged_checkpoint_says_so_and_nothing_is_unpickled(file):
    data = stopped(file).read_bytes()
    middle = len(data) // 2
    for damaged in (data[:-7], data[:middle] + bytes([data[middle] ^ 4]) + data[middle + 1 :], b""):
        file.write_bytes(damaged)
        refused(file, "is no checkpoint, or is damaged; give another file, or begin anew")
    write_checked(file, lambda out: np.savez(out, about=np.array([print])))
    refused(file, "is no checkpoint, or is damaged")


FULL = OSError(28, "No space left on device")


@pytest.mark.parametrize(("module", "name"), [(os, "replace"), (os, "fsync"), (np, "savez")])
@pytest.mark.parametrize(("at", "error"), [(2, FULL), (3, KeyboardInterrupt()), (5, FULL)])
def test_a_fault_in_a_write_loses_nothing(module, name, at, error, whole, file, monkeypatch):
    works, calls = getattr(module, name), [0]

    def faulty(*args, **kwargs):
        calls[0] += 1
        if calls[0] == at:
            if name == "savez":
                args[0].write(b"half of it")
            raise error
        return works(*args, **kwargs)

    def callback(progress):
        if calls[0] >= at:
            raise Stop

    monkeypatch.setattr(module, name, faulty)
    first = Checkpoint(file, every=0, note=lambda sentence: None)
    with pytest.raises((KeyboardInterrupt, Stop, ValueError)):
        run(quick, callback=callback, checkpoint=first)
    monkeypatch.undo()
    assert len(list(file.parent.iterdir())) == file.is_file()  # nothing is half written
    assert_same_bits(run(quick, checkpoint=file)[0], whole)


def test_a_run_whose_checkpoint_cannot_be_written_ends_all_the_same(whole, file, monkeypatch):
    write = Checkpoint._write

    def full(self, tree):
        if tree is not None:
            raise ValueError("x could not be written (No space left on device)")
        write(self, tree)

    monkeypatch.setattr(Checkpoint, "_write", full)
    with pytest.warns(UserWarning, match="could not be written .*; the run goes on, and will try again") as noted:
        assert_same_bits(run(quick, checkpoint=Checkpoint(file, every=0))[0], whole)
    assert len(noted) == 1  # once, and not at every sweep


def test_a_path_that_cannot_be_written_is_refused_before_the_work(file, monkeypatch):
    monkeypatch.setattr(os, "replace", MagicMock(side_effect=FULL))
    with pytest.raises(ValueError, match=r"could not be written \(No space left on device\)"):
        run(quick, callback=lambda progress: pytest.fail("the work has begun"), checkpoint=file)


def test_a_write_waits_75_times_what_the_last_one_took(file, monkeypatch):
    now, writes = [100.0], []
    monkeypatch.setattr(checkpoints.time, "perf_counter", lambda: now[0])
    checkpoint = Checkpoint(file)

    def write(tree):
        writes.append(tree)
        now[0] += tree

    monkeypatch.setattr(checkpoint, "_write", write)
    waits = [(0.99, 0, False), (0.02, 0.2, True), (14.9, 0, False), (0.2, 30, True), (299, 0, False), (2, 0, True)]
    for wait, seconds, wrote in [*waits, (0.9, 0, False)]:
        now[0] += wait
        assert checkpoint.offer(None, lambda seconds=seconds: seconds) == wrote
    assert writes == [0.2, 30, 0]
    assert (checkpoints.SHARE, checkpoints.FIRST, checkpoints.LOST) == (75, 1, 300)


Named = namedtuple("Named", "first second")


def test_a_tree_comes_back_as_it_was():
    arrays = [np.arange(2).astype(kind) for kind in ("u1", ">u2", "<i8", "f2", "f4", ">f8", "c8", "?")]
    arrays += [np.zeros((0, 3), np.int16), np.array(7.5, np.float32), np.asfortranarray(np.eye(3)), np.float32(0.1)]
    numbers = [0, 2**70, 0.1, -0.0, float("inf"), 5e-324, True, None, "text \ud800", np.uint64(2**63)]
    tree = {"a": arrays, "b": (numbers, [[], (), {}]), "c": Named(1, Named(np.arange(2), "x"))}
    told, kept = pack(tree)
    found = unpack(told, kept)
    for one, other in zip(arrays, found["a"], strict=True):
        assert type(one) is type(other)
        assert_same_bits(np.asarray(one), np.asarray(other))
    assert repr(found["b"]) == repr([numbers, [[], [], {}]])  # tuples are lists in JSON
    again = like(Named(0, Named(0, 0)), found["c"])
    assert isinstance(again, Named) and isinstance(again.second, Named) and again.second.second == "x"

    for thing in (object(), np.array([None]), {1, 2}, 1j):
        with pytest.raises(TypeError, match="a checkpoint cannot keep"):
            pack({"x": [thing]})


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked")
def test_a_few_kills_change_nothing():
    environment = os.environ | {"PYTHONPATH": str(Path(simdtex.__file__).parent.parent)}
    command = [sys.executable, Path(__file__).with_name("killed.py"), "8", "1", "more", "soft"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["kills"] == 8 and found["wrong"] == []

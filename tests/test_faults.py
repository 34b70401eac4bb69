"""The atomic writer: each write fails in turn and leaves the old file and nothing else; checksums; killed processes."""

import errno
import os
import re
import resource
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest
from volumes import loaded

from simdtex.io import files, image, volume
from simdtex.io.files import Damaged, atomic_folder, atomic_path, exclusive, read_checked, write_checked
from simdtex.model.source_map import save_source_map
from simdtex.report.page import Section, write_report
from simdtex.report.sheet import StageWriter


def picture(seed, dtype=np.uint8):
    return np.random.default_rng(seed).integers(0, 256, (40, 40)).astype(dtype)


def block(seed):
    return np.random.default_rng(seed).integers(0, 256, (4, 40, 40), dtype=np.uint8)


def many(seed):
    xarray = pytest.importorskip("xarray")
    return xarray.DataArray(block(seed), dims=("realisation", "y", "x"))


def page(path, seed):
    write_report(path, f"Report {seed}", "What it is.", [Section("One", ["words " * 2000])], {"seed": seed})


WRITERS = {
    **{
        f"a{suffix}": lambda path, seed: image.write(path, picture(seed))
        for suffix in (".png", ".tif", ".jpg", ".webp", ".bmp", ".npy")
    },
    "deep.png": lambda path, seed: image.write(path, picture(seed, np.uint16)),
    "a.exr": lambda path, seed: image.write(path, picture(seed, np.uint16).astype(np.float32)),
    **{
        f"v{suffix}": lambda path, seed: volume.write(path, block(seed)) for suffix in (".npz", ".npy", ".nrrd", ".tif")
    },
    "slices": lambda path, seed: volume.write(path, block(seed)),
    **{
        f"r{suffix}": lambda path, seed: volume.write_realisations(path, many(seed))
        for suffix in (".zarr", ".nc", ".npz", ".gslib", ".sgems")
    },
    "map.npz": lambda path, seed: save_source_map(path, np.random.default_rng(seed).integers(0, 99, (40, 40, 2))),
    "report": page,
}


def everything(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@contextmanager
def full_after(size):
    """No file may grow beyond a size: what a full disk is to every library, whatever it writes with."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def refused(name, path):
    """The write fails, with one sentence that names what was to be written and nothing hidden."""
    with pytest.raises(ValueError, match=r"could not be written \(.+\): (choose another|free some)") as said:
        WRITERS[name](path, 2)
    text = str(said.value)
    assert text.startswith(str(path)) and ".simdtex-" not in text and "[Errno" not in text and "\n" not in text


@pytest.mark.parametrize("name", WRITERS)
def test_no_more_space_at_any_byte(tmp_path, name):
    path = tmp_path / name
    WRITERS[name](path, 1)
    before = everything(tmp_path)
    largest = max(len(data) for data in before.values())
    for size in (0, 1, 7, largest // 2, largest - 40):
        with full_after(size):
            refused(name, path)
        assert everything(tmp_path) == before
    WRITERS[name](path, 2)
    assert everything(tmp_path).keys() == before.keys() and everything(tmp_path) != before


def test_files_hold_no_time(tmp_path):
    written = []
    for number in range(2):
        folder = tmp_path / str(number)
        folder.mkdir()
        for name, write in WRITERS.items():
            write(folder / name, 1)
        written.append(everything(folder))
        time.sleep(2.1 * (number == 0))  # the times in a ZIP archive are even
    assert [name for name in written[0] if written[0][name] != written[1][name]] == []


FAULTS = ["open", "fsync", "replace", "rename", "mkdir"]


@pytest.mark.parametrize("name", ["a.png", "v.nrrd", "slices", "r.zarr", "report"])
@pytest.mark.parametrize("fault", FAULTS)
def test_every_call_of_the_system_fails_in_turn(tmp_path, monkeypatch, name, fault):
    path = tmp_path / name
    WRITERS[name](path, 1)
    before = everything(tmp_path)
    real = getattr(os, fault)
    calls = failing = 0

    def faulty(*args, **kwargs):
        nonlocal calls
        if fault == "open" and not args[1] & (os.O_WRONLY | os.O_RDWR):
            return real(*args, **kwargs)  # of a folder that is being removed
        calls += 1
        if calls == failing:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), args[0])
        return real(*args, **kwargs)

    monkeypatch.setattr(files.os, fault, faulty)
    WRITERS[name](path, 1)
    once, failed = calls, 0
    for turn in range(1, min(once, 6) + 1):
        calls, failing = 0, turn
        try:
            WRITERS[name](path, 2)
        except ValueError as error:
            failed += 1
            assert "could not be written (No space left on device): free some space" in str(error)
            assert str(error).startswith(str(path)) and ".simdtex-" not in str(error)
            assert everything(tmp_path) == before
        else:
            assert fault == "mkdir"  # of a folder that is there
            failing = 0
            WRITERS[name](path, 1)
            assert everything(tmp_path).keys() == before.keys()
    assert failed or not once or fault == "mkdir"


@pytest.fixture
def tiny(tmp_path):
    """A disk of 64 KiB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", disk], capture_output=True, check=False)
    if mounted.returncode:
        pytest.skip("no disk may be mounted here")
    yield disk
    subprocess.run(["umount", "-l", disk], check=True)


def test_a_disk_that_is_full(tiny):
    with pytest.raises(OSError, match="No space left"), (tiny / "ballast").open("wb", buffering=0) as ballast:
        for _ in range(10_000):
            ballast.write(b"x" * 8)
    for name, write in WRITERS.items():
        with pytest.raises(ValueError, match=re.escape("No space left on device): free some space")) as said:
            write(tiny / name, 1)
        assert str(said.value).startswith(str(tiny / name))
        assert os.listdir(tiny) == ["ballast"]


def leftover(name, days):
    """Make a hidden file that a process left so many days ago."""
    name.touch()
    os.utime(name, (time.time() - days * 86400,) * 2)


def test_old_leftovers_are_removed_and_recent_ones_are_not(tmp_path):
    for name, days in (("0" * 16, 2), ("1" * 16, 0.5), ("notes", 2)):
        leftover(tmp_path / f".simdtex-{name}", days)
    (tmp_path / f".simdtex-{'2' * 16}.zarr" / "part").mkdir(parents=True)
    os.utime(tmp_path / f".simdtex-{'2' * 16}.zarr", (0, 0))
    image.write(tmp_path / "b.npy", picture(1))
    assert sorted(os.listdir(tmp_path)) == [f".simdtex-{'1' * 16}", ".simdtex-notes", "b.npy"]


@pytest.mark.parametrize("writer", [atomic_path, atomic_folder])
def test_an_unfinished_output_that_looks_old_is_kept_while_its_writer_lives(tmp_path, writer):
    pytest.importorskip("fcntl")
    with writer(tmp_path / "a.zarr") as temporary:
        os.utime(temporary, (0, 0))
        image.write(tmp_path / "b.npy", picture(1))
        assert temporary.exists()
    assert sorted(os.listdir(tmp_path)) == ["a.zarr", "b.npy"]


def test_a_lock_has_one_holder_at_a_time(tmp_path):
    pytest.importorskip("fcntl")
    inside, counts, end = [], [], time.monotonic() + 2

    def take():
        while time.monotonic() < end:
            try:
                with exclusive(tmp_path / "state"):
                    inside.append(1)
                    time.sleep(0.0002)
                    counts.append(len(inside))
                    inside.pop()
            except ValueError as error:
                assert "another run is at work in" in str(error)
                time.sleep(0)

    threads = [threading.Thread(target=take) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(counts) > 20 and set(counts) == {1}
    assert os.listdir(tmp_path) == []


def test_a_lock_that_was_replaced_is_left_to_its_holder(tmp_path):
    pytest.importorskip("fcntl")
    (tmp_path / ".state.lock").touch()  # of a process that was killed
    with exclusive(tmp_path / "state"):
        (tmp_path / ".state.lock").unlink()
        with exclusive(tmp_path / "other"), open(tmp_path / ".state.lock", "w"):
            pass
    assert os.listdir(tmp_path) == [".state.lock"]


def test_a_failed_write_into_a_folder_names_the_folder(tmp_path, monkeypatch):
    """Whatever writes into it, such as the atomic writer of one of its files, and whichever way the path was given."""
    monkeypatch.chdir(tmp_path)
    for path in ("out", tmp_path / "out"):
        words = rf"^{re.escape(str(path))}/a\.npy could not be written \(.+\): (free some|choose another) .*$"
        with full_after(100), pytest.raises(ValueError, match=words), atomic_folder(path) as temporary:
            image.write(temporary / "a.npy", picture(1))
    assert os.listdir(tmp_path) == []


def test_a_folder_in_which_a_thread_still_writes_is_removed(tmp_path):
    def write(folder):
        for number in range(12):
            (folder / str(number)).mkdir(parents=True, exist_ok=True)
            time.sleep(0.02)

    with pytest.raises(KeyboardInterrupt), atomic_folder(tmp_path / "out.zarr") as temporary:
        thread = threading.Thread(target=write, args=(temporary,))
        thread.start()
        time.sleep(0.05)
        raise KeyboardInterrupt
    thread.join()
    assert list(tmp_path.iterdir()) == []


def test_a_folder_of_stages_with_leftovers_is_used_again(tmp_path):
    StageWriter(tmp_path)
    for days, usable in ((0, False), (2, True)):
        leftover(tmp_path / f".simdtex-{'0' * 16}.png", days)
        if usable:
            StageWriter(tmp_path)
        else:
            with pytest.raises(ValueError, match="holds other files"):
                StageWriter(tmp_path)
    write_report(tmp_path, "Title", "Lead", [], {})
    assert sorted(os.listdir(tmp_path)) == ["index.html", "results.json"]


def test_a_folder_that_was_taken_away_comes_back(tmp_path):
    """A process is killed between taking the old folder away and putting the new one there."""
    volume.write(tmp_path / "a", block(1))
    kill = "import os, sys; from pathlib import Path; from simdtex.io import volume; import numpy as np\n"
    kill += "rename = Path.rename\n"
    kill += "Path.rename = lambda self, to: rename(self, to) if 'old' in to.name else os.kill(os.getpid(), 9)\n"
    kill += "volume.write(sys.argv[1], np.ones((2, 3, 4), np.uint8))\n"
    done = subprocess.run([sys.executable, "-c", kill, tmp_path / "a"], check=False)
    assert done.returncode == -9 and "a" not in os.listdir(tmp_path)
    with pytest.raises(KeyboardInterrupt), atomic_folder(tmp_path / "a"):
        raise KeyboardInterrupt
    assert np.array_equal(loaded(tmp_path / "a"), block(1))


def test_a_hidden_name_is_not_too_long(tmp_path):
    image.write(tmp_path / f"{'a' * 251}.png", picture(1))
    with atomic_path(tmp_path / "a.png") as temporary:
        assert temporary.suffix == ".png" and len(temporary.name) < 60
        temporary.write_bytes(b"1")


def keep(path, array):
    write_checked(path, lambda file: np.savez(file, array=array))


def test_a_checked_file_gives_back_what_was_written_or_says_that_it_is_damaged(tmp_path):
    path = tmp_path / "state.npz"
    keep(path, block(1))
    with read_checked(path) as file, np.load(file) as arrays:
        assert np.array_equal(arrays["array"], block(1))
    whole = path.read_bytes()
    for at in (0, 20, 78, 79, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        with pytest.raises(Damaged, match=r"state\.npz is damaged: its checksum does not match"):
            read_checked(path)
    for short in (b"", whole[:50], whole[:79], whole[:-1], whole + b"0"):
        path.write_bytes(short)
        with pytest.raises(Damaged):
            read_checked(path)
    with pytest.raises(FileNotFoundError):
        read_checked(tmp_path / "none")


def command(folder, *words):
    return [sys.executable, "-m", "simdtex", "synth", "sample.png", "-o", "out.png", "--device", "reference", *words]


def test_a_finished_picture_does_not_wait_for_its_stages(tmp_path, tiny):
    image.write(tmp_path / "sample.png", np.random.default_rng(1).integers(0, 256, (24, 20), dtype=np.uint8))
    (tiny / "ballast").write_bytes(bytes(56 * 1024))
    words = ["--method", "multires", "--size", "64x64", "--stages", tiny / "st", "--source-map", tiny / "map.npz"]
    done = subprocess.run(
        command(tmp_path, *words), cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 2, done.stderr
    assert image.read(tmp_path / "out.png").pixels.shape == (64, 64)
    said = [line for line in done.stderr.splitlines() if line.startswith("simdtex: ")]
    assert len(said) == 1, "one sentence, of all that could not be written"
    each = said[0].split("; ")
    assert len(each) > 1 and all(
        "could not be written (No space left on device): free some space" in one for one in each
    )
    assert any("/st/" in one for one in each)
    assert not [path for path in tmp_path.rglob("*") if path.name.startswith(".")]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_process_that_is_asked_to_end_cleans_up(tmp_path, number):
    image.write(tmp_path / "sample.png", np.random.default_rng(2).integers(0, 256, (64, 64), dtype=np.uint8))
    words = command(tmp_path, "--size", "200x200", "--stages", "st", "--order", "8")
    running = subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60
    while not any((tmp_path / "st").glob("level*.png")):
        assert running.poll() is None and time.monotonic() < deadline, running.communicate()
        time.sleep(0.02)
    running.send_signal(number)
    running.send_signal(number)  # as timeout does
    _, errors = running.communicate(timeout=120)
    assert running.returncode == 128 + number, errors
    assert "Traceback" not in errors and "stopped" in errors and not (tmp_path / "out.png").exists()
    assert not [path for path in tmp_path.rglob("*") if path.name.startswith(".")]

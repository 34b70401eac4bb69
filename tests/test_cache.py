# SPDX-License-Identifier: BSD-3-Clause
"""Folders in which something is remembered: those that cannot be written, are full, or hold rubbish."""

import errno
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from simdtex.machine import cache, programs, runtimes

OPEN = """
import sys
import numpy as np
import simdtex
try:
    machine = simdtex.open_machine(sys.argv[1])
    print(machine.get(machine.put(np.arange(3))).sum() == 3)
except simdtex.DeviceError as error:
    print(error)
"""
posix = pytest.mark.skipif(sys.platform == "win32", reason="the folders of Windows are others")


def opened(device, tmp_path, **environment):
    """What a process says that opens a device, with all folders of caches below `tmp_path` but those given."""
    places = {"HOME": str(tmp_path / "home"), "TMPDIR": str(tmp_path / "tmp"), "SIMDTEX_TUNE": "1"} | environment
    (tmp_path / "home").mkdir(exist_ok=True)
    (tmp_path / "tmp").mkdir(exist_ok=True)
    left_out = ("XDG_CACHE_HOME", "POCL_CACHE_DIR", cache.FOLDER)
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", OPEN, str(device)],
        env={key: value for key, value in os.environ.items() if key not in left_out}
        | {key: value for key, value in places.items() if value is not None},
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert result.returncode == 0, result.stderr[-2000:]
    assert result.stderr == ""
    return result.stdout.strip()


@posix
@pytest.mark.parametrize("environment", [{"HOME": "FILE"}, {"XDG_CACHE_HOME": "/proc/nowhere"}], ids=str)
def test_a_device_opens_where_the_usual_folders_cannot_be_written(cl_device, tmp_path, environment):
    (tmp_path / "FILE").touch()
    environment = {key: value.replace("FILE", str(tmp_path / "FILE")) for key, value in environment.items()}
    assert opened(cl_device.index, tmp_path, **environment) == "True"
    (spare,) = (tmp_path / "tmp").glob("simdtex-*")
    assert spare.stat().st_mode & 0o777 == 0o700
    assert (spare / "simdtex" / "tuning.json").exists(), "what is measured is remembered there"
    if cl_device.platform == programs.POCL:
        assert list((spare / "pocl").rglob("*.so"))


@pytest.fixture
def pocl(cl_device):
    if cl_device.platform != programs.POCL:
        pytest.skip("it is about PoCL")
    return cl_device


@posix
def test_a_folder_of_the_users_own_for_pocl_is_let_be_and_named(pocl, tmp_path):
    said = opened(pocl.platform, tmp_path, POCL_CACHE_DIR="/proc/nowhere", SIMDTEX_TUNE="0")
    assert said.startswith('The device "Portable Computing Language" cannot be used')
    assert "nothing can be written in /proc/nowhere" in said
    assert "POCL_CACHE_DIR" in said
    assert "\n" not in said


@posix
def test_a_corrupt_cache_of_pocl_is_named(pocl, tmp_path):
    place = tmp_path / "kernels"

    def said():
        return opened(pocl.index, tmp_path, POCL_CACHE_DIR=str(place), SIMDTEX_TUNE="0")

    assert said() == "True"
    assert runtimes.broken_file(place, 60) is None
    whole = {path: path.read_bytes() for path in place.rglob("*") if path.suffix in (".so", ".bc")}
    assert whole
    for spoil in (lambda data: b"", lambda data: b"rubbish" * 500, lambda data: data[: len(data) // 2 + 1]):
        for path, data in whole.items():
            path.write_bytes(spoil(data))
        assert "its cache of kernels is corrupt" in said()
        assert f"delete the folder {place}" in said()
    shutil.rmtree(place)
    assert said() == "True"


@pytest.mark.parametrize("name", ["kernel.so", "program.bc"])
def test_one_broken_file_among_others_is_found(tmp_path, name):
    for number in range(5):
        folder = tmp_path / f"A{number}" / "B"
        folder.mkdir(parents=True)
        (folder / "program.bc").write_bytes(b"BC\xc0\xde" + bytes(60))
        (folder / "kernel.so").write_bytes(b"\x7fELF\x02\x01" + bytes(200))
        (folder / "last_accessed").touch()
    assert runtimes.broken_file(tmp_path, 60) is None
    (tmp_path / "A3" / "B" / name).write_bytes(b"")
    assert runtimes.broken_file(tmp_path, 60) == tmp_path / "A3" / "B" / name
    assert runtimes.broken_file(tmp_path, 0) is None, "when its time is up it looks no further"


@pytest.mark.parametrize("name", ["tempfile_CdHn9i.so", "tempfile_CdHn9i.bc", "tempfile_CdHn9i"])
def test_a_file_that_another_process_writes_just_now_is_not_broken(tmp_path, name):
    (tmp_path / name).write_bytes(b"\x7fEL")
    assert runtimes.broken_file(tmp_path, 60) is None


def test_a_file_that_is_whole_a_moment_later_is_not_broken(tmp_path, monkeypatch):
    file = tmp_path / "program.bc"
    file.write_bytes(b"BC")
    monkeypatch.setattr(runtimes.time, "sleep", lambda seconds: file.write_bytes(b"BC\xc0\xde" + bytes(60)))
    assert runtimes.broken_file(tmp_path, 60) is None
    monkeypatch.setattr(runtimes.time, "sleep", lambda seconds: file.unlink())
    file.write_bytes(b"BC")
    assert runtimes.broken_file(tmp_path, 60) is None, "somebody has removed it"


def test_where_pocl_keeps_kernels(monkeypatch):
    monkeypatch.setenv("HOME", "/h")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("POCL_CACHE_DIR", raising=False)
    assert runtimes.pocl_cache() == Path("/h/.cache/pocl/kcache")
    monkeypatch.setenv("XDG_CACHE_HOME", "/x")
    assert runtimes.pocl_cache() == Path("/x/pocl/kcache")
    monkeypatch.setenv("POCL_CACHE_DIR", "/p")
    assert runtimes.pocl_cache() == Path("/p")


# Folders


def full(*args, **kwargs):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_what_can_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    assert cache.writable(tmp_path / "not" / "yet" / "there")
    assert not cache.writable(tmp_path / "file")
    assert not cache.writable(tmp_path / "file" / "below")
    if sys.platform != "win32":
        (tmp_path / "link").symlink_to(tmp_path / "gone")
        assert not cache.writable(tmp_path / "link" / "below")
        (tmp_path / "link").unlink()
    assert os.listdir(tmp_path) == ["file"], "nothing is left behind"
    monkeypatch.setattr(cache.tempfile, "TemporaryFile", full)
    assert not cache.writable(tmp_path)


@posix
def test_a_spare_folder_is_nobody_elses(tmp_path, monkeypatch):
    monkeypatch.setattr(cache.tempfile, "gettempdir", lambda: str(tmp_path))
    place = cache.spare("pocl")
    assert place == tmp_path / f"simdtex-{os.getuid()}" / "pocl"
    assert cache.spare("pocl") == place, "the same for the next process"
    place.parent.chmod(0o777)
    assert cache.spare("pocl") is None, "others could put programs there"
    shutil.rmtree(place.parent)
    place.parent.symlink_to(tmp_path)
    assert cache.spare("pocl") is None
    monkeypatch.setattr(cache.tempfile, "gettempdir", full)
    assert cache.spare("pocl") is None


@pytest.mark.parametrize("fault", ["write", "replace"])
@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "full"), KeyboardInterrupt()], ids=repr)
def test_nothing_half_written_stays(tmp_path, monkeypatch, fault, error):
    (tmp_path / "kept").write_bytes(b"old")

    def fail(*args):
        raise error

    class File:
        def __init__(self, handle, mode):
            self.handle = handle

        def __enter__(self):
            return self

        def __exit__(self, *args):
            os.close(self.handle)

        write = fail

    monkeypatch.setattr(cache.os, "replace", fail)
    if fault == "write":
        monkeypatch.setattr(cache, "open", File, raising=False)
    if isinstance(error, OSError):
        cache.keep(tmp_path / "kept", b"new")
    else:
        with pytest.raises(KeyboardInterrupt):
            cache.keep(tmp_path / "kept", b"new")
    assert os.listdir(tmp_path) == ["kept"]
    assert (tmp_path / "kept").read_bytes() == b"old"


@pytest.mark.parametrize("ours", [True, False])
def test_what_killed_processes_left_is_removed_after_a_day(tmp_path, ours):
    (tmp_path / "programs").mkdir()
    old = ["simdtex-a.tmp", "programs/simdtex-b.tmp", "tmpabcdefgh.tmp"]
    for name in [*old, "simdtex-young.tmp", "tuning.json", "mine.tmp"]:
        (tmp_path / name).touch()
        age = 0 if "young" in name else 2 * cache.STALE
        os.utime(tmp_path / name, (time.time() - age,) * 2)
    cache._tidy(tmp_path, ours)
    left = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    chosen = set() if ours else {"tmpabcdefgh.tmp"}  # in a folder of the user's choice it may be anybody's
    assert left == {"simdtex-young.tmp", "tuning.json", "mine.tmp"} | chosen

# SPDX-License-Identifier: BSD-3-Clause
"""Runs command lines in this process, each in an empty folder, and checks the result of each.

The process has a home, a folder for temporary files and a limit to its address space; every file that Python opens,
moves or removes is noted.
"""

import os
import re
import resource
import shutil
import sys
import time
import traceback
from pathlib import Path

from fuzz import corpus
from fuzz.lines import PLAIN, RUNS, Maker, Try

MEMORY = 2**30
"""Bytes that a try may take beyond what its process has."""

SECONDS = 10.0
"""Seconds that a try may take."""

LOOKING = ("uname", "fc-list", sys.executable)
"""Programs that may be started: libraries identify the machine with them, and simdtex probes devices."""

PROGRAMS = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.fork", "os.startfile")
SYSTEM = ("/dev/", "/proc/")
CACHES = ("/matplotlib", "/mpl", "/fontconfig", "/pocl", "/pyopencl", "/pytools", "__pycache__", "/.cache")
HIDDEN = r"/\.[A-Za-z0-9_]|(?:^|[\s'])\.[a-z0-9_]{8,}|\.tmp\b|<[a-z_.]+ object at 0x"
"""Names that no message may contain: of temporary files and objects."""

NETWORK = ("socket.connect", "socket.getaddrinfo", "urllib.Request")
CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate", "os.chmod")


class Worker:
    """Runs tries in a folder: ``try`` for a try, a home, temporary files, and files that must not be read."""

    def __init__(self, root, device):
        self.root, self.folder, self.on, self.seen = Path(root), Path(root, "try"), False, []
        for name in ("home", "tmp", "beside"):
            (self.root / name).mkdir()
        (self.root / "beside" / "secret.raw").write_bytes(bytes(range(216)))  # which a damaged header names
        environment = {"HOME": "home", "TMPDIR": "tmp", "XDG_CACHE_HOME": "home/.cache", "MPLCONFIGDIR": "home/mpl"}
        os.environ.update({name: str(self.root / value) for name, value in environment.items()})
        os.environ.update(SIMDTEX_DEVICE=device, COLUMNS="100", OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
        self.streams = [os.memfd_create(name) for name in ("out", "err")]
        for stream, number in zip(self.streams, (1, 2), strict=True):
            os.dup2(stream, number)
        import h5netcdf  # noqa: F401
        import matplotlib.font_manager  # noqa: F401 - asks the system for its fonts, once
        import zarr  # noqa: F401

        from simdtex.commands import main

        self.main = main
        sys.addaudithook(self.hook)
        for words in list(RUNS.values())[:9] if device == "reference" else ():  # what they import is no memory of a try
            self.run(Try(words, corpus.named(PLAIN.values())))
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + MEMORY * 3 // 2  # half as much again as a try may take
        resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))

    def hook(self, event, args):
        if not self.on:
            return
        what, paths = "write", ()
        if event == "open":
            paths, mode, flags = args[:1], args[1], args[2] or 0
            writes = flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) or (
                isinstance(mode, str) and set(mode) & set("wax+")
            )
            what = "write" if writes else "read"
        elif event in CHANGES:
            paths = args[: 2 if event == "os.rename" else 1]
        elif event in PROGRAMS and args[0] not in LOOKING:
            self.seen.append(("program", f"{event} {args[0]!r}"))
        elif event in NETWORK:
            self.seen.append(("network", event))
        for path in paths:
            if isinstance(path, (str, bytes, os.PathLike)):
                self.seen.append((what, os.path.abspath(os.fsdecode(path))))

    def run(self, one):
        """Run a try; return its exit code and its faults."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir()
        for name, data in one.files.items():
            (self.folder / name).write_bytes(data)
        os.chdir(self.folder)
        for stream in self.streams:
            os.ftruncate(stream, 0)
            os.lseek(stream, 0, os.SEEK_SET)
        with open("/proc/self/clear_refs", "w") as file:
            file.write("5")  # forget the peak
        before, began, code, faults = _kibibytes("VmRSS"), time.perf_counter(), 0, []
        self.seen, self.on = [], True
        try:
            self.main(args=list(one.args), prog_name="simdtex", standalone_mode=True)
        except SystemExit as error:
            code = error.code if isinstance(error.code, int) else 0 if error.code is None else 1
        except BaseException as error:  # what else comes out is what this is looking for
            code = 1
            faults.append(("traceback", _where(error)))
        finally:
            self.on = False
            os.chdir(self.root)
        seconds = time.perf_counter() - began
        sys.stdout.flush()
        sys.stderr.flush()
        said = os.pread(self.streams[1], 2**16, 0).decode(errors="replace")
        size = 1024 * (_kibibytes("VmHWM") - before)
        faults += [*([] if faults else said_wrong(one, code, said)), *self.left_wrong(one, code)]
        if seconds > SECONDS:
            faults.append(("time", one.args[0]))
        if size > MEMORY or "the memory does not suffice" in said:
            faults.append(("memory", one.args[0]))
        return code, faults

    def left_wrong(self, one, code):
        """Yield the faults of the files that are there now, and of those that were opened."""
        folder = self.folder
        there = {str(path.relative_to(folder)): path for path in folder.rglob("*")}
        named = {word for arg in one.args for word in re.split(r"[=,]", arg)}
        if "--preview" in one.args:
            named |= {f"{Path(word).stem}-3x3.png" for word in named if word}
        for name, data in one.files.items():
            path = folder / name
            if not path.is_file():
                yield "input gone", f"{one.args[0]} {_plain(name)}"
            elif path.read_bytes() != data and (code or name not in one.old):
                yield "old output changed" if name in one.old else "input changed", f"{one.args[0]} {path.suffix}"
        for name in there:
            if name in one.files:
                continue
            first = Path(name).parts[0]
            if any(part.startswith(".") or part.endswith((".tmp", ".part")) for part in Path(name).parts):
                yield "left behind", f"{one.args[0]}: {_plain(re.sub(r'[a-z0-9_]{8}', '*', Path(name).name))}"
            elif not any(first == Path(word).parts[0] for word in named if word and Path(word).parts):
                if first != "schedules-report":
                    yield "file nobody named", f"{one.args[0]} {_plain(name)}"
            elif code and name == first and there[name].is_file():
                yield "written on failure", f"{one.args[0]} {_plain(name)}"
        for what, path in self.seen:
            if what in ("program", "network"):
                yield f"uses a {what}", path[:160]
            elif what == "write" and not path.startswith((str(folder), str(self.root / "tmp"), *SYSTEM)):
                if not any(word in path for word in CACHES):
                    yield "written elsewhere", _plain(path)
            elif what == "read" and path.startswith(str(self.root / "beside")):
                yield "read elsewhere", f"{one.args[0]} {Path(path).name}"


def said_wrong(one, code, said):
    """Yield the faults of the exit code and the message."""
    if "Traceback (most recent call last)" in said:
        yield "traceback", said.strip().splitlines()[-1][:200]
        return
    if code not in (0, 2):
        yield "exit code", str(code)
    if warned := re.search(r"\w*Warning: .*", said):
        yield "warning", warned[0][:160]
    if not code:
        return
    sentence, lines = said.strip(), said.strip().splitlines()
    if usage := re.fullmatch(r"(?:Usage: [^\n]*\nTry [^\n]*\n\n)?Error: (.+)", sentence, re.DOTALL):
        sentence = usage[1]
    elif not one.args and sentence.startswith("Usage: "):
        return
    elif not any("\n" in word for word in one.args):  # which is in the message as it is
        plain = [line for line in lines if line.startswith("simdtex: ")]
        if not plain:
            yield "sentence", _plain(sentence[-200:])
        elif len(lines) > 1 and {"-q", "--quiet"} & set(one.args):
            yield "more than a sentence", _plain(lines[0][:160])
        sentence = (plain or [""])[-1]
    if "[Errno" in sentence:
        yield "raw error", _plain(sentence)
    if re.search(HIDDEN, sentence):
        yield "hidden name", _plain(sentence)


def _plain(text):
    """Return a message without the numbers and names of one try, so that equal faults count as one."""
    text = re.sub(r"/dev/shm/fuzz[^ ]*/try/", "", text)
    text = re.sub(r"(^|/|[\s'])\.[a-z0-9_]{8,}", r"\1.*", text)
    text = re.sub(r"\d+", "N", text)
    text = re.sub(r"(N-)+", "", text)
    return re.sub(r"'[^']{0,300}'", "'...'", text)[:240]


def _where(error):
    """Return the kind of an error, and where in the package it was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    last = ([frame for frame in frames if "/simdtex/" in frame.filename] or frames)[-1]
    name = last.filename.rpartition("/simdtex/")[2]
    return f"{type(error).__name__} at {name}:{last.name}: {_plain(str(error))[:120]}"


def _kibibytes(name):
    with open("/proc/self/status") as file:
        return int(next(line for line in file if line.startswith(name)).split()[1])


_worker = None


def begin(place, device):
    """Prepare a process for tries in a folder."""
    global _worker
    _worker = Worker(place, device)


def one_try(rng):
    """Run a random command line; return what is unusual about it, its exit code, and the faults."""
    one = Maker(rng).make()
    code, faults = _worker.run(one)
    return one.kind, f"exit code {code}", faults

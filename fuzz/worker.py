# SPDX-License-Identifier: BSD-3-Clause
"""A process that runs command lines, one after another, in folders of their own, and says what was wrong with each.

It reads a line of JSON for each try and answers with one. What it runs has a home, a folder for temporary files and a
limit to its address space; every file that Python opens, moves or removes is noted.
"""

import contextlib
import json
import os
import re
import resource
import shutil
import signal
import sys
import time
import traceback
from dataclasses import dataclass, field, replace
from pathlib import Path

MEMORY = 2**30
"""Bytes that a try may take beyond what its process has."""

SECONDS = 10.0
"""Seconds that a try may take."""

DEMO = 60.0
"""Seconds that `simdtex demo` may take, whose samples are those of the package."""

LIFE = 3000
"""Tries of a process: what libraries keep would count for the memory of later ones."""

LOOKING = ("uname", "fc-list", sys.executable)
"""Programs that libraries ask what machine this is, and ourselves what devices work."""

PROGRAMS = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.fork", "os.startfile")
SYSTEM = ("/dev/", "/proc/")
CACHES = ("/matplotlib", "/mpl", "/fontconfig", "/pocl", "/pyopencl", "/pytools", "__pycache__", "/.cache")
HIDDEN = r"/\.[A-Za-z0-9_]|(?:^|[\s'])\.[a-z0-9_]{8,}|\.tmp\b|<[a-z_.]+ object at 0x"
"""What no user has named: a temporary file, an object."""

NETWORK = ("socket.connect", "socket.getaddrinfo", "urllib.Request")
CHANGES = (
    "os.rename",
    "os.remove",
    "os.mkdir",
    "os.rmdir",
    "os.link",
    "os.symlink",
    "os.truncate",
    "os.chmod",
    "os.utime",
)


@dataclass
class Result:
    """What came of a try: its exit ``code``, what it said, ``seconds``, ``bytes`` beyond those before, ``faults``."""

    code: int | None
    said: str
    seconds: float
    bytes: int
    faults: list[tuple[str, str]] = field(default_factory=list)
    fired: bool = False


class Watch:
    """Notes what is opened, moved and started."""

    def __init__(self):
        self.on, self.seen = False, []
        sys.addaudithook(self.hook)

    def hook(self, event, args):
        if not self.on:
            return
        if event == "open":
            path, mode, flags = args
            writes = flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) if flags else False
            writes = writes or (isinstance(mode, str) and set(mode) & set("wax+"))
            if isinstance(path, (str, bytes, os.PathLike)):
                self.seen.append(("write" if writes else "read", os.path.abspath(os.fsdecode(path))))
        elif event in CHANGES:
            for path in args[: 2 if event == "os.rename" else 1]:
                if isinstance(path, (str, bytes, os.PathLike)):
                    self.seen.append(("write", os.path.abspath(os.fsdecode(path))))
        elif event in PROGRAMS:
            if args[0] not in LOOKING:
                self.seen.append(("program", f"{event} {args[0]!r}"))
        elif event in NETWORK:
            self.seen.append(("network", event))


class Sandbox:
    """The folder of a worker: ``try`` for a try, and beside it a home, temporary files, and what is not to be read."""

    def __init__(self, root):
        self.root = Path(root)
        self.folder = self.root / "try"
        for name in ("home", "tmp", "beside"):
            (self.root / name).mkdir(parents=True, exist_ok=True)
        from fuzz.corpus import beside

        beside(self.root / "beside")
        self.around = self.listing(("home", "tmp", "beside"))

    def listing(self, names):
        """Path -> size and time of everything within some folders."""
        found = {}
        for name in names:
            for folder, _, files in os.walk(self.root / name):
                found[folder] = None
                found |= {os.path.join(folder, file): _stamp(os.path.join(folder, file)) for file in files}
        return found

    def fresh(self, files):
        """An empty folder of a try but for its files."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir()
        for name, data in files.items():
            (self.folder / name).write_bytes(data)


def seconds_for(one):
    """Seconds that a try may take."""
    return DEMO if "demo" in one.args[:1] else SECONDS


def _stamp(path):
    try:
        found = os.lstat(path)
    except OSError:
        return None
    return found.st_size, found.st_mtime_ns


class Worker:
    """Runs tries in a folder."""

    def __init__(self, root):
        self.sandbox = Sandbox(root)
        self.streams = [os.memfd_create(name) for name in ("out", "err")]
        for stream, number in zip(self.streams, (1, 2), strict=True):
            os.dup2(stream, number)
        self.watch = Watch()
        from simdtex.cli import main

        self.main = main

    def limit(self):
        """Bound the address space to what there is and half as much again as a try may take."""
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + MEMORY * 3 // 2
        resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))

    def run(self, one):
        """Run a try, and look at what it left."""
        from fuzz.faults import failing

        self.sandbox.fresh(one.files)
        os.chdir(self.sandbox.folder)
        for stream in self.streams:
            os.ftruncate(stream, 0)
            os.lseek(stream, 0, os.SEEK_SET)
        with open("/proc/self/clear_refs", "w") as file:
            file.write("5")  # forget the peak
        before, began = _kibibytes("VmRSS"), time.perf_counter()
        self.watch.seen, self.watch.on = [], True
        code, wrong, fired = 0, [], False
        try:
            with failing(one.fault, self.sandbox.folder) as calls, _interrupted(one.interrupt):
                self.main(args=list(one.args), prog_name="simdtex", standalone_mode=True)
        except SystemExit as error:
            code = error.code if isinstance(error.code, int) else 0 if error.code is None else 1
        except BaseException as error:  # what else comes out is what this is looking for
            code = 1
            wrong.append(("traceback", _where(error)))
        finally:
            self.watch.on = False
            os.chdir(self.sandbox.root)
        seconds = time.perf_counter() - began
        fired = bool(one.fault) and calls.fired
        sys.stdout.flush()
        sys.stderr.flush()
        said = os.pread(self.streams[1], 2**16, 0).decode(errors="replace")
        size = 1024 * (_kibibytes("VmHWM") - before)
        result = Result(code, said, seconds, size, wrong, fired)
        result.faults += self.said_wrong(one, result)
        result.faults += self.left_wrong(one, result)
        if (one.fault or one.interrupt) and any(what == "old output changed" for what, _ in result.faults):
            result.faults = self.without_whole(one, result.faults)
        if seconds > seconds_for(one):
            result.faults.append(("time", one.args[0]))
        if size > MEMORY or "the memory does not suffice" in said:
            result.faults.append(("memory", one.args[0]))
        return result

    def without_whole(self, one, faults):
        """The faults but for outputs that are what they are where nothing fails.

        The first of several may be new, and all of them where a Ctrl-C comes after the last.
        """
        left = {
            name: (self.sandbox.folder / name).read_bytes()
            for name in one.old
            if (self.sandbox.folder / name).is_file()
        }
        self.run(replace(one, fault=None, interrupt=None))
        for name, data in left.items():
            path = self.sandbox.folder / name
            if data != one.files[name] and not (path.is_file() and path.read_bytes() == data):
                return faults
        return [fault for fault in faults if fault[0] != "old output changed"]

    def said_wrong(self, one, result):
        """What is wrong with the exit code and the sentence."""
        code, said = result.code, result.said
        if any(kind == "traceback" for kind, _ in result.faults):
            return
        if "Traceback (most recent call last)" in said:
            yield "traceback", said.strip().splitlines()[-1][:200]
            return
        allowed = (0, 2, 130) if one.interrupt else (0, 2)
        if code not in allowed:
            yield "exit code", str(code)
        warned = re.findall(r"\w*Warning: .*", said)
        if warned:
            yield "warning", warned[0][:160]
        if not code:
            return
        sentence = said.strip()
        if one.interrupt:  # told at once, and what came of it later
            sentence = sentence.removeprefix("simdtex: stopping where the state is at hand; once more stops at once\n")
            if sentence.endswith("\nsimdtex: stopped"):  # after the sentence of a command that failed, or within it
                return
        usage = re.fullmatch(r"(?:Usage: [^\n]*\nTry [^\n]*\n\n)?Error: (.+)", sentence, re.DOTALL)
        lines = sentence.splitlines()
        quiet = "-q" in one.args or "--quiet" in one.args
        if usage or (not one.args and sentence.startswith("Usage: ")):
            sentence = usage[1] if usage else ""
        elif not lines or not lines[-1].startswith("simdtex: ") or (quiet and len(lines) > 1):
            plain = [line for line in lines if line.startswith("simdtex: ")]
            if not plain or any("\n" in word for word in one.args):
                if not any("\n" in word for word in one.args):
                    yield "sentence", _plain(sentence[-200:])
            elif quiet:
                yield "more than a sentence", _plain(lines[0][:160])
        else:
            sentence = lines[-1]
        if "[Errno" in sentence:
            yield "raw error", _plain(sentence)
        if len(sentence) > 6000:
            yield "long sentence", _plain(sentence[:100])
        if re.search(HIDDEN, sentence):
            yield "hidden name", _plain(sentence)

    def left_wrong(self, one, result):
        """What is wrong with the files that are there now, and those that were opened."""
        folder = self.sandbox.folder
        there = {}
        for top, folders, files in os.walk(folder):
            for name in (*files, *folders):
                path = Path(top, name)
                there[str(path.relative_to(folder))] = path
        named = {word for arg in one.args for word in re.split(r"[=,]", arg)}
        failed = bool(result.code) or any(kind == "traceback" for kind, _ in result.faults)
        for name, data in one.files.items():
            path = folder / name
            if not path.is_file():
                yield "input gone", f"{one.args[0]} {_plain(name)}"
            elif path.read_bytes() != data:
                if name in one.old and not result.code:
                    continue
                what = "old output changed" if name in one.old else "input changed"
                yield what, f"{one.args[0]} {Path(name).suffix}"
        stopped = one.interrupt or one.fault
        for name in there:
            if name in one.files:
                continue
            first = Path(name).parts[0]
            if any(part.startswith(".") or part.endswith((".tmp", ".part")) for part in Path(name).parts):
                yield "left behind", f"{one.args[0]}: {_plain(re.sub(r'[a-z0-9_]{8}', '*', Path(name).name))}"
            elif not any(first == Path(word).parts[0] for word in named if word and Path(word).parts):
                if first != "schedules-report" and one.args[0] != "demo":
                    yield "file nobody named", f"{one.args[0]} {_plain(name)}"
            elif failed and not stopped and name == first and there[name].is_file():
                yield "written on failure", f"{one.args[0]} {_plain(name)}"
        now = self.sandbox.listing(("home", "tmp", "beside"))
        for path in now.keys() ^ self.sandbox.around.keys():
            if not _of_libraries(path):
                yield "left elsewhere", _plain(os.path.relpath(path, self.sandbox.root))
        if now != self.sandbox.around:
            self.sandbox.around = now
        for what, path in self.watch.seen:
            if what in ("program", "network"):
                yield f"uses a {what}", path[:160]
            elif what == "write" and not path.startswith((str(folder), str(self.sandbox.root / "tmp"), *SYSTEM)):
                if not _of_libraries(path):
                    yield "written elsewhere", _plain(path)
            elif what == "read" and path.startswith(str(self.sandbox.root / "beside")):
                yield "read elsewhere", f"{one.args[0]} {Path(path).name}"


def _of_libraries(path):
    """Whether a path is of caches that libraries keep in a home: of fonts, of compiled kernels."""
    return any(word in path for word in CACHES)


def _plain(text):
    """A sentence without the numbers and names of one try, so that the same faults count as one."""
    text = re.sub(r"/dev/shm/fuzz[^ ]*/try/", "", text)
    text = re.sub(r"(^|/|[\s'])\.[a-z0-9_]{8,}", r"\1.*", text)
    text = re.sub(r"\d+", "N", text)
    text = re.sub(r"(N-)+", "", text)
    return re.sub(r"'[^']{0,300}'", "'...'", text)[:240]


def _where(error):
    """What an error is, and where in the package it came about."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "/simdtex/" in frame.filename] or list(frames[-1:])
    last = ours[-1]
    name = last.filename[last.filename.find("simdtex/") :] if ours else "?"
    return f"{type(error).__name__} at {name}:{last.name}: {_plain(str(error))[:120]}"


def _kibibytes(name):
    with open("/proc/self/status") as file:
        return int(next(line for line in file if line.startswith(name)).split()[1])


@contextlib.contextmanager
def _interrupted(seconds):
    """A Ctrl-C after some seconds, unless all is over before."""
    if not seconds:
        yield
        return
    signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    before = signal.signal(signal.SIGINT, _leave)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGINT, lambda *_: None)
        time.sleep(0.05)  # a Ctrl-C in an import comes again a little later
        signal.signal(signal.SIGINT, before)


def _leave(_, frame):
    """Before a command begins: as `simdtex.__main__` does, but for this process, which goes on."""
    from simdtex.cli.common import postponed

    if postponed(frame):
        return
    os.write(2, b"simdtex: stopped\n")
    raise SystemExit(130)


def serve(root):
    """Answer tries from standard input until it ends; an answer is a line on what was standard output."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    questions = os.fdopen(os.dup(0), "rb", buffering=0)  # so that nothing asked is lost with a process
    environment = {"HOME": "home", "TMPDIR": "tmp", "XDG_CACHE_HOME": "home/.cache", "MPLCONFIGDIR": "home/mpl"}
    os.environ.update({name: str(Path(root, value)) for name, value in environment.items()})
    os.environ.update(SIMDTEX_DEVICE=os.environ.get("FUZZ_DEVICE", "reference"), COLUMNS="100")
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    reference = os.environ["SIMDTEX_DEVICE"] == "reference"
    worker = Worker(root)
    _load(worker, reference)
    while True:  # a child serves until it ends: what it has loaded need not be loaded again
        child = os.fork() if reference else 0
        if not child:
            _answer(worker, questions, answers)
            return
        _, status = os.waitpid(child, 0)
        if not status:
            return
        answers.write(f"ended {os.waitstatus_to_exitcode(status)}\n")


LOADING = (
    "synth L.png -o out.png --size 8x8 --order 1",
    "synth RGB.png -o out.tif --size 8x8 --method multires",
    "synth L.png -o out.npy --size 8x8 --method pyramid --iterations 1",
    "fill L.png --mask hole.png -o out.webp --order 1",
    "extend L.png -o out.jpg --left 1 --order 1",
    "solid L.png -o out.nrrd --size 4 --iterations 1",
    "mix L.png L.png -o out.gif --size 6x6 --iterations 1",
    "ising --size 4x4 --sweeps 2 --burn-in 1 --seeds 2 --schedules coloring",
    "simulate L.png -o out.npz --size 6x6 --order 1 --number 1",
)
"""Commands that load what others need."""


def _load(worker, reference):
    """Run something of everything, but for what starts threads: a child would not have them."""
    import matplotlib.font_manager  # noqa: F401 - which asks the system for its fonts, once

    from fuzz.lines import Try, seeds

    files = {name: data for role in seeds().values() for name, data in role.items()}
    for line in LOADING if reference else LOADING[:3]:
        words = line.split()
        worker.run(Try(words, {name: files[name] for name in words if name in files}))
    if reference:
        import h5netcdf  # noqa: F401
        import zarr  # noqa: F401


def _answer(worker, questions, answers):
    """Answer until there are no more questions, or life ends."""
    from fuzz.lines import Try, made

    worker.limit()
    answers.write(f"ready {os.getpid()}\n")
    for _ in range(LIFE):
        line = questions.readline()
        if not line:
            os._exit(0)
        asked = json.loads(line)
        asked.pop("job", None)
        one = made(asked["seed"], asked["number"]) if "seed" in asked else Try.from_json(asked)
        answers.write(json.dumps([one.kind, one.args[:1], vars(worker.run(one))]) + "\n")
    os._exit(1)

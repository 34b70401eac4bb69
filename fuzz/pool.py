# SPDX-License-Identifier: BSD-3-Clause
"""Workers in processes of their own, begun anew when one dies or takes too long."""

import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

from fuzz.worker import DEMO, SECONDS

GRACE = 3.0
"""Seconds that a process may take beyond its limit until it is killed."""

ROOT = Path(__file__).resolve().parent.parent


class Process:
    """A worker: a process that has loaded all, and a child of it that answers until it dies."""

    def __init__(self, folder, device="reference"):
        self.folder, self.device, self.process, self.child = Path(folder), device, None, 0

    def start(self):
        """A fresh process."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        environment = os.environ | {"PYTHONPATH": str(ROOT), "FUZZ_DEVICE": self.device}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "fuzz", "--work", str(self.folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            cwd=ROOT,
            bufsize=0,
        )
        self.wait()

    def wait(self):
        """Wait for a child that answers."""
        ended = 0
        for _ in range(100):
            line = self.line(120)
            if line.startswith(b"ready "):
                self.child = int(line.split()[1])
                return ended
            if line.startswith(b"ended "):
                ended = int(line.split()[1])
            if not line:
                break
        raise RuntimeError("a worker did not start; run `python -m fuzz --work FOLDER` to see why")

    def line(self, seconds):
        """A line of the worker's; None after so many seconds, and nothing where it has ended."""
        ready, _, _ = select.select([self.process.stdout], [], [], seconds)
        if not ready:
            return None
        line = b""
        while not line.endswith(b"\n"):
            more = self.process.stdout.read(2**16)
            if not more:
                return b""
            line += more
        return line

    def ask(self, question):
        """What came of a try: its kind, its command and its result."""
        if self.process is None:
            self.start()
        self.process.stdin.write(json.dumps(question).encode() + b"\n")
        line = self.line(DEMO + GRACE)
        if line and line.startswith(b"ended 1\n"):  # its life was over, and nobody has read the question
            self.child = int(line.split()[3]) if b"ready" in line else self.wait() or self.child
            line = self.line(DEMO + GRACE)
        if line and not line.startswith(b"ended"):
            return json.loads(line)
        what, code = "time", 0
        if line is None:
            os.kill(self.child, signal.SIGKILL)
            self.wait()
        else:
            what, code = "died", int(line.split()[1]) if line else 0
            if b"ready" in line:
                self.child = int(line.split()[3])
            elif line:
                self.wait()
            else:
                self.stop()
        from fuzz.lines import Try, made

        question = {name: value for name, value in question.items() if name != "job"}
        one = made(question["seed"], question["number"]) if "seed" in question else Try.from_json(question)
        text = one.args[0] if what == "time" else f"{one.args[0]}: exit code {code}"
        result = {
            "code": None,
            "said": "",
            "seconds": DEMO + GRACE,
            "bytes": 0,
            "faults": [[what, text]],
            "fired": True,
        }
        return [one.kind, one.args[:1], result]

    def stop(self):
        """End the process and its child."""
        if self.process is not None:
            self.process.stdin.close()
            try:
                self.process.wait(SECONDS)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
            self.process.stdout.close()
            self.process = None


def run(questions, workers, took, device="reference"):
    """Ask every question; ``took(question, answer)`` is called with each answer, by one thread at a time.

    Parameters
    ----------
    questions : iterator
        Of dictionaries that a worker understands.
    workers : int
    took : callable
    device : str
        That tries run on unless they name one.
    """
    lock, errors = threading.Lock(), []

    def work(folder):
        process = Process(folder, device)
        try:
            while True:
                with lock:
                    question = next(questions, None)
                if question is None or errors:
                    return
                answer = process.ask(question)
                with lock:
                    took(question, answer)
        except BaseException as error:
            errors.append(error)
        finally:
            process.stop()

    with tempfile.TemporaryDirectory(prefix="fuzz-", dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as root:
        threads = [threading.Thread(target=work, args=(Path(root) / str(n),)) for n in range(workers)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    if errors:
        raise errors[0]

# SPDX-License-Identifier: BSD-3-Clause
"""Workers in processes of their own, begun anew when one dies or takes too long."""

import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

from fuzz.worker import SECONDS

GRACE = 3.0
"""Seconds that a process may take beyond its limit until it is killed."""

LIFE = 4000
"""Tries of a process: what libraries keep would count for the memory of later ones."""

ROOT = Path(__file__).resolve().parent.parent


class Process:
    """A worker, and the process that it runs in."""

    def __init__(self, folder, device="reference"):
        self.folder, self.device, self.process, self.tries = Path(folder), device, None, 0

    def start(self):
        """A fresh process."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        environment = os.environ | {"PYTHONPATH": str(ROOT), "FUZZ_DEVICE": self.device, "PYTHONFAULTHANDLER": "1"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "fuzz", "--work", str(self.folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            cwd=ROOT,
        )
        self.tries = 0
        if self.answer(120) != b"ready\n":
            raise RuntimeError("a worker did not start; run `python -m fuzz --work FOLDER` to see why")

    def answer(self, seconds):
        """A line of the worker's; nothing after so many seconds, or where it is dead."""
        ready, _, _ = select.select([self.process.stdout], [], [], seconds)
        return self.process.stdout.readline() if ready else None

    def ask(self, question):
        """What came of a try: its kind, its command and its result."""
        if self.process is None or self.process.poll() is not None or self.tries >= LIFE:
            self.stop()
            self.start()
        self.tries += 1
        try:
            self.process.stdin.write(json.dumps(question).encode() + b"\n")
            self.process.stdin.flush()
            line = self.answer(SECONDS + GRACE)
        except BrokenPipeError:
            line = b""
        if line:
            return json.loads(line)
        what = "time" if line is None else "died"
        self.stop()
        from fuzz.lines import Try, made

        question = {name: value for name, value in question.items() if name != "job"}
        one = made(question["seed"], question["number"]) if "seed" in question else Try.from_json(question)
        text = one.args[0] if what == "time" else f"{one.args[0]}: signal {-(self.code or 0)}"
        result = {"code": None, "said": "", "seconds": SECONDS + GRACE, "bytes": 0, "faults": [[what, text]], "fired": True}
        return [one.kind, one.args[:1], result]

    def stop(self):
        """End the process."""
        self.code = None
        if self.process is not None:
            self.code = self.process.poll()
            self.process.kill()
            self.process.wait()
            if self.code is None and self.process.returncode != -9:
                self.code = self.process.returncode
            self.process.stdin.close()
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

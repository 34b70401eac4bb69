# SPDX-License-Identifier: BSD-3-Clause
"""Runs tries in processes of their own, which are replaced if they die or take too long."""

import multiprocessing
import os
import tempfile
from concurrent.futures import FIRST_COMPLETED, TimeoutError, wait
from itertools import islice
from pathlib import Path

from pebble import ProcessExpired, ProcessPool

from fuzz.lines import Try, made
from fuzz.worker import DEMO, Worker

GRACE = 3.0
"""Seconds that a try may take beyond its limit until its process is killed."""

LIFE = 3000
"""Tries of a process: what libraries keep would count as memory of later tries."""

_worker = None


def _start(root, device):
    global _worker
    _worker = Worker(Path(root) / str(os.getpid()), device)


def asked(question):
    """Return the try of a question."""
    return made(question["seed"], question["number"]) if "seed" in question else Try.from_json(question)


def _answer(question):
    return vars(_worker.run(asked(question)))


def _result(question, future):
    """Return the result of a try, also if its process was killed or died."""
    command = "".join(asked(question).args[:1])
    try:
        return future.result()
    except TimeoutError:
        fault = "time", command
    except ProcessExpired as error:
        fault = "died", f"{command}: exit code {error.exitcode}"
    return {"code": None, "said": "", "seconds": DEMO + GRACE, "bytes": 0, "faults": [fault]}


def run(questions, workers, took, device="reference"):
    """Ask every question, and call ``took(question, result)`` with each result.

    A question is a try as a dictionary, or the ``seed`` and ``number`` of one; the device is that of tries that name
    none.
    """
    shared = "/dev/shm" if os.path.isdir("/dev/shm") else None
    with (
        tempfile.TemporaryDirectory(prefix="fuzz-", dir=shared) as root,
        ProcessPool(workers, LIFE, _start, [root, device], multiprocessing.get_context("spawn")) as pool,
    ):
        running = {}
        while True:
            for question in islice(questions, 2 * workers - len(running)):
                running[pool.schedule(_answer, [question], timeout=DEMO + GRACE)] = question
            if not running:
                break
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                question = running.pop(future)
                took(question, _result(question, future))

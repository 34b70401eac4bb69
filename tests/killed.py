"""Runs that are killed again and again: `python killed.py KILLS SEED [JOB...]` prints what came of them as JSON.

Forked children go on with a job from its checkpoint, and are killed with SIGKILL at random moments until it is done.
"""

import json
import os
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path

import numpy as np
from cases import REFERENCE
from runs import digest, outcome

from simdtex.checkpoint import Checkpoint

JOBS = ("more", "known", "multires", "pyramid", "solid", "fill", "extend", "mix", "classify", "soft", "volume")


def child(job, folder):
    """What a forked child does; it never comes back."""
    code = 1
    try:
        found = digest(outcome(job, REFERENCE, checkpoint=Checkpoint(folder / "state", every=0))[0])
        (folder / "new").write_text(found)
        os.replace(folder / "new", folder / "result")
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def finished(job, folder, longest, rng, left):
    """Go on with a job until it is done; return its digest and how often it was killed."""
    kills = 0
    while not (folder / "result").exists():
        number = os.fork()
        if not number:
            child(job, folder)
        if kills < left:
            time.sleep(rng.uniform(0, longest))
            os.kill(number, signal.SIGKILL)
        _, status = os.waitpid(number, 0)
        kills += os.WIFSIGNALED(status)
        assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0, "a child failed; its traceback is above"
    return (folder / "result").read_text(), kills


def main(wanted, seed, names):
    rng, kills, wrong = np.random.default_rng(seed), 0, []
    share = -(-wanted // len(names))
    while kills < wanted:
        for name in names:
            began = time.perf_counter()
            expected = digest(outcome(name, REFERENCE)[0])
            longest = 0.8 * (time.perf_counter() - began)
            with tempfile.TemporaryDirectory() as folder:
                found, more = finished(name, Path(folder), longest, rng, min(share, wanted - kills))
            kills += more
            wrong += [name] * (found != expected)
    print(json.dumps({"kills": kills, "wrong": wrong}))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:] or JOBS)

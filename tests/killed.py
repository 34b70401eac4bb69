"""Runs that are killed again and again: `python killed.py KILLS SEED [JOB...]` prints what came of them as JSON.

A process that has nothing but NumPy forks children, each of which goes on with a job from its checkpoint, writes its
result and ends; the parent kills them with SIGKILL at random moments, and starts the next until the job is done.
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
from runs import RUNS, SEED, digest, outcome

import simdtex
from simdtex.checkpoint import Checkpoint

JOBS = ("more", "known", "multires", "pyramid", "solid", "fill", "extend", "mix", "classify", "soft", "volume", "tiles")
"""Runs of the table, and tiles in a store beside the checkpoint's file."""
SLOWER = {"tiles": 10}
"""How many times as long a job takes with a checkpoint, if much longer."""


def made(job, checkpoint=None):
    """The digest of a job."""
    if job != "tiles":
        return digest(outcome(job, REFERENCE, checkpoint=checkpoint)[0])
    if checkpoint is None:
        return digest(outcome("more", REFERENCE)[0][:1])
    given, options = RUNS["more"].inputs()
    store = simdtex.TileStore(checkpoint.path.with_name("o.zarr"), 6)
    if store.path.exists():
        return digest([store.resume(REFERENCE).compute()])
    return digest([simdtex.synthesize(*given, store=store, rng=SEED, device=REFERENCE, **options).compute()])


def child(job, folder, result):
    """What a forked child does; it never comes back."""
    code = 1
    try:
        found = made(job, Checkpoint(folder / "state", every=0))
        result.with_suffix(".new").write_text(found)
        os.replace(result.with_suffix(".new"), result)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def finished(job, longest, rng, left):
    """Go on with a job until it is done, and return its digest and how often it was killed."""
    kills = 0
    with tempfile.TemporaryDirectory() as place:
        folder, result = Path(place, "kept"), Path(place, "result")
        folder.mkdir()
        while True:
            number = os.fork()
            if not number:
                child(job, folder, result)
            if kills < left:
                time.sleep(rng.uniform(0, longest))
                os.kill(number, signal.SIGKILL)
            _, status = os.waitpid(number, 0)
            if os.WIFSIGNALED(status):
                kills += 1
                if not result.exists():
                    continue
                return result.read_text(), kills  # killed when all was done
            assert os.WEXITSTATUS(status) == 0, "a child failed; its traceback is above"
            return result.read_text(), kills


def main(wanted, seed, names):
    if "tiles" in names:  # loaded once, and not by each child
        from simdtex.jobs.tiles import cluster, turns  # noqa: F401
    rng = np.random.default_rng(seed)
    counts = {"kills": 0, "runs": 0, "wrong": []}
    expected, took = {}, {}
    while counts["kills"] < wanted:
        name = names[counts["runs"] % len(names)]
        if name not in expected:
            began = time.perf_counter()
            expected[name] = made(name)
            took[name] = (time.perf_counter() - began) * SLOWER.get(name, 1)
        share = max(1, -(-wanted // len(names)))
        found, kills = finished(name, took[name] * 0.8, rng, min(share, wanted - counts["kills"]))
        counts["kills"] += kills
        counts["runs"] += 1
        if found != expected[name]:
            counts["wrong"].append(name)
    print(json.dumps(counts))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:] or JOBS)

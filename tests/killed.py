"""Runs that are killed again and again: `python killed.py KILLS SEED [JOB...]` prints what came of them as JSON.

A process that has nothing but NumPy forks children, each of which goes on with a job from its checkpoint, writes its
result and ends; the parent kills them with SIGKILL at random moments, and starts the next until the job is done.
"""

import hashlib
import json
import os
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path

import numpy as np

import simdtex
from simdtex import distributed
from simdtex.checkpoint import Checkpoint


def texture(*shape):
    row, col = np.indices(shape[:2])
    grey = 128 + 60 * np.sin(row / 3) + 50 * np.sin(col / 2 + row / 5)
    grey = grey if len(shape) == 2 else grey[..., None] + np.arange(shape[2]) * 9 * np.cos(col / 4)[..., None]
    return np.clip(grey, 0, 255).astype(np.uint8)


GREY, COLOUR = texture(20, 22), texture(20, 22, 3)
HOLE = np.zeros((20, 22), bool)
HOLE[3:6, 4:7] = HOLE[14:18, 13:17] = True


def in_tiles(rng, device, checkpoint, **_):
    """The picture by tiles in a store beside the checkpoint's file; without one at once."""
    if checkpoint is None:
        return simdtex.synthesize(GREY, (20, 18), order=2, rng=rng, device=device), None
    store = checkpoint.path.with_name("o.zarr")
    if store.exists():
        return distributed.resume(store, device=device).compute(), None
    return distributed.synthesize(GREY, (20, 18), store, tiles=8, order=2, rng=rng, device=device).compute(), None


SLOWER = {"tiles": 10}
"""How many times as long a job takes with a checkpoint, if much longer."""

JOBS = {
    "tiles": in_tiles,
    "mrf": lambda **how: simdtex.synthesize(GREY, (20, 18), order=2, **how),
    "multires": lambda **how: simdtex.synthesize(COLOUR, (96, 80), method="multires", channel_axis=-1, **how),
    "pyramid": lambda **how: simdtex.synthesize(COLOUR, (64, 64), method="pyramid", channel_axis=-1, **how),
    "solid": lambda **how: simdtex.synthesize_solid(GREY, (16, 16, 16), **how),
    "fill": lambda **how: simdtex.fill(GREY, HOLE, order=2, levels=1, **how),
    "extend": lambda **how: simdtex.extend(GREY, right=5, seamless="y", band=3, order=2, **how),
    "mix": lambda **how: simdtex.mix([GREY, GREY[::-1]], (48, 48), iterations=3, **how),
    "classify": lambda **how: simdtex.classify(GREY, {"a": GREY[:12], "b": GREY[8:]}, exemplars=40, **how),
    "simulate": lambda **how: (
        simdtex.simulate(
            GREY, 4, shape=(12, 14), order=2, jobs=2, **{k: how[k] for k in how if k != "full_output"}
        ).values,
        None,
    ),
}


def digest(job, checkpoint=None):
    image, output = job(rng=5, device="reference", full_output=True, checkpoint=checkpoint)
    found = hashlib.sha256(image.tobytes())
    if output is not None:
        if output.source is not None:
            found.update(output.source.tobytes())
        for stage in output.stages:
            found.update(stage.image.tobytes())
    return found.hexdigest()


def child(job, folder, result):
    """What a forked child does; it never comes back."""
    code = 1
    try:
        found = digest(job, Checkpoint(folder / "state", every=0))
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
        from simdtex.distributed import cluster, tiling  # noqa: F401
    rng = np.random.default_rng(seed)
    counts = {"kills": 0, "runs": 0, "wrong": []}
    expected, took = {}, {}
    while counts["kills"] < wanted:
        name = names[counts["runs"] % len(names)]
        if name not in expected:
            began = time.perf_counter()
            expected[name] = digest(JOBS[name])
            took[name] = (time.perf_counter() - began) * SLOWER.get(name, 1)
        share = max(1, -(-wanted // len(names)))
        found, kills = finished(JOBS[name], took[name] * 0.8, rng, min(share, wanted - counts["kills"]))
        counts["kills"] += kills
        counts["runs"] += 1
        if found != expected[name]:
            counts["wrong"].append(name)
    print(json.dumps(counts))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:] or list(JOBS))

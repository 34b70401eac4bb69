# SPDX-License-Identifier: BSD-3-Clause
"""Cases on the host, in a process of its own: with as many threads as are asked for, and none left spinning after.

    python -m simdtex.bench.elsewhere < job.json

reads ``{"machine": "reference" or "library", "threads": n, "cases": [...]}`` and prints a list of results.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from simdtex.bench.cases import Case, case_of, measure
from simdtex.machine.reference import Reference

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Variables that BLAS libraries read when they are loaded."""


def measure_elsewhere(machine: str, threads: int, cases: Sequence[Case]) -> list[dict[str, Any]]:
    """Time cases on the NumPy reference or on the machine of library code, in another process.

    Parameters
    ----------
    machine : {"reference", "library"}
    threads : int
        Of BLAS, FFTs and k-d trees.
    cases : sequence of Case

    Returns
    -------
    list of dict
        As `simdtex.bench.cases.measure` returns, with ``machine`` and ``threads``.

    Raises
    ------
    ChildProcessError
        The process failed; with what it said last.
    """
    if not cases:
        return []
    job = {"machine": machine, "threads": threads, "cases": [case.as_dict() for case in cases]}
    folder = str(Path(__file__).resolve().parent.parent.parent)  # the same simdtex, wherever that process begins
    path = os.pathsep.join([folder, *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = os.environ | dict.fromkeys(THREADS, str(threads)) | {"PYTHONPATH": path}
    done = subprocess.run(
        [sys.executable, "-m", "simdtex.bench.elsewhere"],
        input=json.dumps(job),
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        said = done.stderr.strip().splitlines() or ["nothing"]
        raise ChildProcessError(f"the process of the {machine} ended with code {done.returncode}; it said: {said[-1]}")
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found


def main() -> None:
    """Read a job, do it, print its results."""
    job = json.load(sys.stdin)
    threads = int(job["threads"])
    machine: Reference = Reference()
    if job["machine"] == "library":
        from simdtex.bench.library import Library

        machine = Library(threads)
    measure(machine, Case("mrf", 16, 16, 1))  # load and start everything before the clock does
    made = [measure(machine, case_of(entry)) for entry in job["cases"]]
    json.dump([one | {"machine": job["machine"], "threads": threads} for one in made], sys.stdout)


if __name__ == "__main__":
    main()

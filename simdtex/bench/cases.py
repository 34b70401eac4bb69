# SPDX-License-Identifier: BSD-3-Clause
"""The jobs of a benchmark, and how they are timed."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import Any

import numpy as np

from simdtex.machine import Machine
from simdtex.methods import mrf
from simdtex.model.lattice import neighbourhood_offsets
from simdtex.synthesis import synthesize, synthesize_solid


@dataclass(frozen=True)
class Case:
    """A synthesis from gravel, a grey picture of scikit-image.

    Parameters
    ----------
    method : {"mrf", "multires", "pyramid", "solid"}
    sample, output : int
        Pixels a side; of a solid, voxels.
    order : int
        Of the neighbourhood, for ``mrf``; 0 otherwise.
    search : str
        For ``mrf``; empty otherwise.
    """

    method: str
    sample: int
    output: int
    order: int = 0
    search: str = ""

    @property
    def name(self) -> str:
        """A unique name."""
        order = f" {self.search}, order {self.order}" if self.order else ""
        return f"{self.method}{order}, {self.sample} -> {self.output}{'^3' if self.method == 'solid' else ''}"

    @property
    def size(self) -> dict[str, int]:
        """Quantities that the time may grow with."""
        return {
            "output pixels": self.output**2,
            "voxels": self.output**3,
            "sample pixels": self.sample**2,
            "neighbours": len(neighbourhood_offsets(max(1, self.order))),
        }


@dataclass(frozen=True)
class Sizes:
    """The cases of a benchmark.

    Parameters
    ----------
    name : str
    repeats : int
        Timed runs of each case; the fastest counts.
    budget : float
        Seconds of a case after which no other run begins.
    seconds : float
        Time to measure each limit, at each vector width.
    jobs : tuple of Case
        Jobs that are reported one by one.
    reference : tuple of Case
        Those of them that the NumPy reference does too.
    growth : dict
        What grows, a key of `Case.size` -> cases that differ in nothing else, one sequence for each method and search.
    """

    name: str
    repeats: int
    budget: float
    seconds: float
    jobs: tuple[Case, ...]
    reference: tuple[Case, ...]
    growth: dict[str, Sequence[Sequence[Case]]]

    @property
    def cases(self) -> list[Case]:
        """Every case once."""
        return list(
            dict.fromkeys([*self.jobs, *(case for rows in self.growth.values() for row in rows for case in row)])
        )


def _both(sample: int, output: int, *orders: int) -> tuple[Case, ...]:
    return tuple(Case("mrf", sample, output, order, search) for order in orders for search in ("exact", "coherent"))


def _growth(
    sample: int, outputs: Sequence[int], samples: Sequence[int], orders: Sequence[int], large: int
) -> dict[str, Sequence[Sequence[Case]]]:
    """Return growth of ``mrf`` with output, sample and order, and of others with outputs `large` times as large."""
    least, searches = outputs[0], ("exact", "coherent")
    return {
        "output pixels": [
            *([Case("mrf", sample, n, 8, search) for n in outputs] for search in searches),
            *([Case(method, sample, large * n) for n in outputs] for method in ("multires", "pyramid")),
        ],
        "sample pixels": [[Case("mrf", n, least, 8, search) for n in samples] for search in searches],
        "neighbours": [[Case("mrf", sample, least, n, search) for n in orders] for search in searches],
        "voxels": [[Case("solid", sample, n // 2) for n in outputs]],
    }


_QUICK = Case("mrf", 32, 32, 8, "exact"), Case("multires", 32, 64), Case("pyramid", 64, 64), Case("solid", 32, 16)
_FULL = (
    *(Case("mrf", 32, 32, 8, "exact"), Case("mrf", 32, 32, 18, "exact")),
    *(Case("multires", 64, 128), Case("pyramid", 128, 256), Case("solid", 64, 32)),
)

SIZES = {
    "quick": Sizes(
        "quick",
        repeats=2,
        budget=0.5,
        seconds=0.15,
        jobs=(
            *_both(64, 64, 8, 18, 32),
            *(Case("multires", 64, 128), Case("pyramid", 64, 128), Case("solid", 64, 32)),
            *_QUICK,
        ),
        reference=_QUICK,
        growth=_growth(64, (32, 48, 64), (32, 48, 64), (2, 4, 8), 2),
    ),
    "full": Sizes(
        "full",
        repeats=3,
        budget=2.0,
        seconds=0.5,
        jobs=(
            *_both(128, 256, 8, 18, 32),
            *(Case("multires", 128, 256), Case("multires", 256, 1024)),
            *(Case("pyramid", 256, 1024), Case("solid", 128, 64)),
            *_FULL,
        ),
        reference=_FULL,
        growth=_growth(128, (64, 128, 256), (48, 64, 96, 128), (2, 8, 18, 32), 4),
    ),
}


class Sweeps:
    """A callback that sums the times of the sweeps of the finest level of ``mrf``, by phase: [seconds, in kernels]."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self.times = {"relax": np.zeros(2), "free": np.zeros(2)}
        self._last = self._now()

    def _now(self) -> Any:
        self._machine.sync()
        return np.array([perf_counter(), self._machine.seconds or 0.0])

    def __call__(self, progress: Any) -> None:
        """See the progress of a run, `simdtex.run.Relaxing`."""
        if progress.end_of_sweep:
            before, self._last = self._last, self._now()
            if progress.level == 0:
                self.times[progress.phase] += self._last - before


def once(machine: Machine, case: Case) -> dict[str, Any]:
    """Run a case and return its statistics, of ``mrf`` with ``brute_force`` and ``phases``, see `measure`."""
    from skimage import data

    gravel: Any = data.gravel
    sample = np.ascontiguousarray(gravel()[: case.sample, : case.sample])
    given: dict[str, Any] = {"rng": 1, "device": machine, "full_output": True}
    if case.method == "solid":
        return dict(synthesize_solid(sample, (case.output,) * 3, **given)[1].statistics)
    given |= {"method": case.method}
    sweeps = Sweeps(machine)
    if case.method == "mrf":
        given |= {"order": case.order, "search": case.search, "callback": sweeps}
    began = perf_counter()
    statistics = dict(synthesize(sample, (case.output, case.output), **given)[1].statistics)
    statistics["seconds"] = perf_counter() - began
    if case.method == "mrf":
        levels = statistics["levels"]
        each = 2.0 * case.size["neighbours"] * (1 + bool(mrf.Options().structure))  # multiply-adds for a candidate
        statistics["brute_force"] = sum(each * level["candidates"] * level["relaxations"] for level in levels)
        warm = levels[-1]["equilibrium"]["relaxations"]
        counts = {"relax": warm, "free": levels[-1]["relaxations"] - warm}
        statistics["phases"] = [
            {
                "phase": {"relax": "warm", "free": "cold"}[phase],
                "relaxations": count,
                "seconds": float(sweeps.times[phase][0]),
                "busy": float(sweeps.times[phase][1]),
                "brute_force": each * levels[-1]["candidates"] * count,
            }
            for phase, count in counts.items()
        ]
    return statistics


def measure(machine: Machine, case: Case, repeats: int = 1, budget: float = 3.0) -> dict[str, Any]:
    """Time a case.

    Parameters
    ----------
    machine : Machine
    case : Case
    repeats : int
        Timed runs at most, after a profiled one if the machine times kernels.
    budget : float
        Seconds after which no other run begins. A profiled run that took longer is the only one: what profiling costs,
        some microseconds a launch, is then too little to matter.

    Returns
    -------
    dict
        The `Case` and its ``name``; ``seconds``, of the fastest run; ``busy``, seconds in kernels, and ``kernels`` of
        `simdtex.machine.log.Log.take`, of the profiled run (None if not measured). Of ``mrf``, else None: ``fma``, the
        multiply-adds that the run says it did; ``brute_force``, those of weighing every candidate; and ``phases`` of
        the finest level, ``"warm"``, the sweeps of its cooling with its setting up, and ``"cold"``, its free sweeps at
        temperature 0: dicts with ``phase``, ``seconds``, ``busy``, ``relaxations`` and ``brute_force``.
    """
    profiled = once(machine, case) if machine.seconds is not None else None
    runs = [profiled] if profiled and profiled["seconds"] > budget else []
    began, log = perf_counter(), getattr(machine, "log", None)
    with log.paused() if log else nullcontext():
        while not runs or (len(runs) < repeats and perf_counter() - began < budget and runs[0] is not profiled):
            runs.append(once(machine, case))
    best = min(runs, key=lambda run: float(run["seconds"]))
    own = profiled.get("phases", []) if profiled else []
    busy = {phase["phase"]: phase["busy"] for phase in own}
    phases = [phase | {"busy": busy.get(phase["phase"])} for phase in best.get("phases", [])]
    skipped = {"fma": sum(level["fma"] - level["skipped"] for level in best["levels"])} if phases else {"fma": None}
    return {
        **asdict(case),
        "name": case.name,
        "seconds": best["seconds"],
        "busy": profiled and profiled["device_seconds"],
        "kernels": profiled and profiled["kernels"],
        **skipped,
        "brute_force": best.get("brute_force"),
        "phases": phases or None,
    }

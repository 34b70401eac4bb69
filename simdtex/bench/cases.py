# SPDX-License-Identifier: BSD-3-Clause
"""The jobs that a benchmark runs, and how they are timed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.machine import Machine
from simdtex.methods import mrf
from simdtex.model.lattice import neighbourhood_offsets
from simdtex.model.sample import Sample
from simdtex.synthesis import synthesize, synthesize_solid

METHODS = ("mrf", "multires", "pyramid", "solid")


@dataclass(frozen=True)
class Case:
    """One job: more of gravel, a grey picture that scikit-image carries.

    Parameters
    ----------
    method : {"mrf", "multires", "pyramid", "solid"}
    sample, output : int
        Pixels a side; of a solid, voxels.
    order : int
        Of the neighbourhood, of ``mrf``; 0 otherwise.
    search : str
        Of ``mrf``, where it has this option; else empty.
    """

    method: str
    sample: int
    output: int
    order: int = 0
    search: str = ""

    @property
    def name(self) -> str:
        """What it is called in tables; unique."""
        kind = " ".join([self.method, *([self.search] if self.search else [])])
        order = f", order {self.order}" if self.order else ""
        return f"{kind}{order}, {self.sample} -> {self.output}{'^3' if self.method == 'solid' else ''}"

    @property
    def cost(self) -> float:
        """Roughly how much there is to do, to put the small before the large."""
        return float(self.sample**2 * self.output**2 * max(1, self.order))

    @property
    def options(self) -> dict[str, Any]:
        """What the method is given."""
        chosen: dict[str, Any] = {"order": self.order} if self.order else {}
        return chosen | ({"search": self.search} if self.search else {})

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self) | {"name": self.name}


def case_of(entry: dict[str, Any]) -> Case:
    """The case that `Case.as_dict` made a dict of."""
    return Case(**{f.name: entry[f.name] for f in fields(Case)})


def searches() -> tuple[str, ...]:
    """The searches of ``mrf`` that are measured."""
    return ("exact", "coherent")


def picture(side: int) -> NDArray[np.uint8]:
    """The sample."""
    from skimage import data

    read: Any = data.gravel
    return np.ascontiguousarray(read()[:side, :side])


def brute_force(case: Case, relaxations: list[int]) -> list[float]:
    """Multiply-adds that weighing every candidate takes, 2 for each neighbour and channel.

    ``relaxations`` are those of the levels of a run, the coarsest first.
    """
    offsets, options = neighbourhood_offsets(case.order), mrf.Options()
    sample = Sample(picture(case.sample)[..., None], len(offsets))
    counts = [
        sample.positions(offsets, 2**level, options.phases, options.edges).size
        for level in reversed(range(len(relaxations)))
    ]
    channels = 1 + bool(options.structure)
    return [2.0 * count * len(offsets) * channels * many for count, many in zip(counts, relaxations, strict=True)]


@contextmanager
def untimed(machine: Machine) -> Iterator[None]:
    """No kernel is timed in here, on a machine that could."""
    log = getattr(machine, "log", None)
    if log is None:
        yield
        return
    with log.paused():
        yield


class Sweeps:
    """A callback that notes when the sweeps of the finest level of ``mrf`` end."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self.seconds = {"relax": 0.0, "free": 0.0}
        self.busy = {"relax": 0.0, "free": 0.0}
        self._last = self._now()

    def _now(self) -> tuple[float, float]:
        self._machine.sync()
        return perf_counter(), self._machine.seconds or 0.0

    def __call__(self, progress: Any) -> None:
        """Take what `simdtex.run.Relaxing` tells."""
        if not progress.end_of_sweep:
            return
        now = self._now()
        if progress.level == 0:
            self.seconds[progress.phase] += now[0] - self._last[0]
            self.busy[progress.phase] += now[1] - self._last[1]
        self._last = now


def once(machine: Machine, case: Case) -> dict[str, Any]:
    """Run a case: its statistics, and of ``mrf`` the phases of its finest level.

    ``phases`` are ``"warm"``, the sweeps of its cooling, its setting up included, and ``"cold"``, its free sweeps, when
    all temperatures are 0: dicts with ``seconds``, ``busy`` (of kernels, 0 where not measured), ``relaxations`` and
    ``brute_force``, the multiply-adds that weighing every candidate takes.
    """
    sample = picture(case.sample)
    given: dict[str, Any] = {"rng": 1, "device": machine, "full_output": True}
    if case.method == "solid":
        return dict(synthesize_solid(sample, (case.output,) * 3, **given)[1].statistics)
    sweeps = Sweeps(machine) if case.method == "mrf" else None
    options = case.options | given | {"method": case.method, "callback": sweeps}
    began = perf_counter()
    statistics = dict(synthesize(sample, (case.output, case.output), **options)[1].statistics)
    statistics["seconds"] = perf_counter() - began
    if sweeps:
        levels = statistics["levels"]
        statistics["brute_force"] = sum(brute_force(case, [level["relaxations"] for level in levels]))
        warm = levels[-1]["equilibrium"]["relaxations"]
        statistics["phases"] = {
            name: {
                "seconds": sweeps.seconds[phase],
                "busy": sweeps.busy[phase],
                "relaxations": many,
                "brute_force": brute_force(case, [0] * (len(levels) - 1) + [many])[-1],
            }
            for name, phase, many in (
                ("warm", "relax", warm),
                ("cold", "free", levels[-1]["relaxations"] - warm),
            )
        }
    return statistics


def _done(levels: list[dict[str, Any]]) -> float:
    """Multiply-adds of the distances that were done in a run; ``skipped`` ones were proved to be needless."""
    return float(sum(level["fma"] - level.get("skipped", 0) for level in levels))


def measure(machine: Machine, case: Case, repeats: int = 1, budget: float = 3.0) -> dict[str, Any]:
    """Time a case.

    Parameters
    ----------
    machine : Machine
    case : Case
    repeats : int
        Timed runs at most, beside a profiled one before them where the machine times kernels.
    budget : float
        Seconds after which no other run begins. A profiled run that took longer is the only one: what profiling costs,
        some microseconds a launch, is then too little to matter.

    Returns
    -------
    dict
        The `Case`, and ``seconds``, of the fastest run; ``busy``, seconds in kernels, and ``kernels`` of
        `simdtex.machine.log.Log.take`, of the profiled one (None where not measured); ``fma``, what the run says it
        did, of ``mrf``; ``brute_force`` and ``phases``, see `once`.
    """
    profiled = once(machine, case) if machine.seconds is not None else {}
    runs = [profiled] if profiled and profiled["seconds"] > budget else []
    began = perf_counter() - sum(run["seconds"] for run in runs)
    with untimed(machine):
        while len(runs) < max(1, repeats) and (not runs or perf_counter() - began < budget):
            runs.append(once(machine, case))
    best = min(runs, key=lambda run: float(run["seconds"]))
    phases = best.get("phases")
    for name, phase in (phases or {}).items():
        phase["busy"] = profiled["phases"][name]["busy"] if profiled else None
    return case.as_dict() | {
        "seconds": best["seconds"],
        "busy": profiled.get("device_seconds"),
        "kernels": profiled.get("kernels"),
        "fma": _done(best["levels"]) if case.method == "mrf" else None,
        "brute_force": best.get("brute_force"),
        "phases": phases,
    }

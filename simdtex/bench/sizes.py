# SPDX-License-Identifier: BSD-3-Clause
"""Which jobs a benchmark runs, and how large they are."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from simdtex.bench.cases import Case, searches


@dataclass(frozen=True)
class Sizes:
    """The cases of a benchmark; the option ``search`` of ``mrf`` is filled in where the method has it.

    Parameters
    ----------
    name : str
    repeats : int
        Timed runs of each case, the fastest of which counts.
    budget : float
        Seconds of a case after which no other run begins.
    seconds : float
        How long about each limit is measured, at each vector width.
    jobs : tuple of Case
        Whole jobs, on the devices; of ``mrf`` their steps too.
    library : tuple of Case
        Those of them that the machine of library code does.
    reference : tuple of Case
        Jobs of sizes that the NumPy reference can do; the devices do them too.
    growth : dict
        Method and what grows, ``"mrf: output pixels"`` -> cases in which nothing else does.
    """

    name: str
    repeats: int
    budget: float
    seconds: float
    jobs: tuple[Case, ...]
    library: tuple[Case, ...]
    reference: tuple[Case, ...]
    growth: dict[str, tuple[Case, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that what the library does is among the jobs."""
        if not set(self.library) <= {*self.jobs, *self.reference}:
            raise ValueError("a case of the library is no job of the devices")

    @property
    def cases(self) -> list[Case]:
        """Every case that a device does, once, for every search; the small ones first."""
        every = [*self.jobs, *self.reference, *(case for cases in self.growth.values() for case in cases)]
        return sorted(dict.fromkeys(with_searches(every)), key=lambda case: case.cost)

    @property
    def tiny(self) -> list[Case]:
        """The smallest job of every method, search and order: it builds the programs, which is not to be timed."""
        kinds = dict.fromkeys((case.method, case.order, case.search) for case in self.cases)
        return [Case(method, 16, 8 if method == "solid" else 16, order, search) for method, order, search in kinds]


def with_searches(cases: list[Case] | tuple[Case, ...]) -> list[Case]:
    """The same cases, those of ``mrf`` once for every value of the option ``search``."""
    return [
        replace(case, search=search) if case.method == "mrf" else case
        for case in cases
        for search in (searches() if case.method == "mrf" else ("",))
    ]


def _growth(
    order: int, sample: int, outputs: tuple[int, ...], samples: tuple[int, ...], orders: tuple[int, ...], large: int
) -> dict[str, tuple[Case, ...]]:
    """Growth of ``mrf`` with output, sample and order, and of the others with the output, `large` times as large."""
    return {
        "mrf: output pixels": tuple(Case("mrf", sample, n, order) for n in outputs),
        "mrf: sample pixels": tuple(Case("mrf", n, outputs[0], order) for n in samples),
        "mrf: neighbours": tuple(Case("mrf", sample, outputs[0], n) for n in orders),
        "multires: output pixels": tuple(Case("multires", sample, large * n) for n in outputs),
        "pyramid: output pixels": tuple(Case("pyramid", sample, large * n) for n in outputs),
        "solid: voxels": tuple(Case("solid", sample, n // 2) for n in outputs),
    }


_QUICK_JOBS = (
    *(Case("mrf", 64, 64, order) for order in (8, 18, 32)),
    Case("multires", 64, 128),
    Case("pyramid", 64, 128),
    Case("solid", 64, 32),
)

QUICK = Sizes(
    "quick",
    repeats=2,
    budget=0.5,
    seconds=0.15,
    jobs=_QUICK_JOBS,
    library=_QUICK_JOBS,
    reference=(Case("mrf", 32, 32, 8), Case("multires", 32, 64), Case("pyramid", 64, 64), Case("solid", 32, 16)),
    growth=_growth(8, 64, (32, 48, 64), (32, 48, 64), (2, 4, 8), 2),
)

_FULL_LIBRARY = (  # which takes minutes for the others
    Case("mrf", 128, 64, 8),
    Case("mrf", 128, 64, 32),
    Case("mrf", 128, 256, 18),
    Case("multires", 128, 256),
    Case("pyramid", 256, 1024),
    Case("solid", 128, 64),
)
_FULL_JOBS = (
    *(Case("mrf", 128, 256, order) for order in (8, 32)),
    *_FULL_LIBRARY,
    Case("multires", 256, 1024),
)

FULL = Sizes(
    "full",
    repeats=3,
    budget=2.0,
    seconds=0.5,
    jobs=_FULL_JOBS,
    library=_FULL_LIBRARY,
    reference=(
        *(Case("mrf", 32, 32, order) for order in (8, 18)),
        Case("multires", 64, 128),
        Case("pyramid", 128, 256),
        Case("solid", 64, 32),
    ),
    growth=_growth(8, 128, (64, 128, 256), (48, 64, 96, 128), (2, 8, 18, 32), 4),
)

# SPDX-License-Identifier: BSD-3-Clause
"""Parallel schedules: which sites relax together.

A schedule is a pair of pure functions. ``init`` takes the `Setting` of a level and returns a state; ``step`` takes a
state and the `Active` sites, and returns the next state and an `Info` with the sites to relax now, in one step or
several. The counters in the state key every random choice, so a schedule never depends on the device.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from simdtex.schedules.partition import (
    Block,
    Checkerboard,
    Coloring,
    FixedColoring,
    Partition,
    Raster,
    Synchronous,
)
from simdtex.schedules.scattered import Luby, RandomScan, RandomSubset, Scattered
from simdtex.schedules.schedule import (
    Active,
    Checked,
    Info,
    Masked,
    Schedule,
    Setting,
    Watched,
    decisions,
    neighbours_in,
)

__all__ = [
    "SCHEDULES",
    "Active",
    "Block",
    "Checked",
    "Checkerboard",
    "Coloring",
    "FixedColoring",
    "Info",
    "Luby",
    "Masked",
    "Partition",
    "RandomScan",
    "RandomSubset",
    "Raster",
    "Scattered",
    "Schedule",
    "Setting",
    "Synchronous",
    "Watched",
    "decisions",
    "get",
    "neighbours_in",
]

SCHEDULES: dict[str, Callable[[], Schedule]] = {
    "coloring": Coloring,
    "coloring-fixed": FixedColoring,
    "luby": Luby,
    "checkerboard": Checkerboard,
    "synchronous": Synchronous,
    "random-subset": RandomSubset,
    "raster": Raster,
    "random-scan": RandomScan,
    "block": Block,
}
"""The schedules by name."""

PARALLEL = ("coloring", "coloring-fixed", "luby", "checkerboard", "synchronous", "random-subset", "block")
"""The schedules that relax many sites in a step."""

GROUP = "simdtex.schedules"
"""The group of entry points with which other packages provide schedules."""


def get(schedule: str | Schedule) -> Schedule:
    """Return a schedule by its name.

    Parameters
    ----------
    schedule : str or Schedule
        A key of `SCHEDULES`; ``"random-subset:P"`` or ``"block:ROWSxCOLS"``; the name of an entry point of the group
        ``simdtex.schedules``; or a schedule, which is returned unchanged.

    Raises
    ------
    ValueError
        There is no such schedule; the message lists the valid names.
    """
    if not isinstance(schedule, str):
        if isinstance(schedule, type) or not isinstance(schedule, Schedule) or not isinstance(schedule.name, str):
            raise TypeError(
                "a schedule must be a name, or an object with name, tile, windows, independent, init and step "
                f"(not its class; deriving from Partition or Scattered brings most of it), not {schedule!r}"
            )
        return schedule
    name, colon, parameter = schedule.partition(":")
    if colon and name in _WITH_PARAMETER:
        return _WITH_PARAMETER[name](parameter)
    if schedule in SCHEDULES:
        return SCHEDULES[schedule]()
    from importlib.metadata import entry_points  # slow to load

    brought = {entry.name: entry for entry in entry_points(group=GROUP)}
    if schedule in brought:
        return get(brought[schedule].load()())
    raise ValueError(f"unknown schedule {schedule!r}; choose one of: {', '.join([*SCHEDULES, *brought])}")


def _random_subset(text: str) -> Schedule:
    try:
        return RandomSubset(float(text))
    except ValueError:
        raise ValueError(f"{text!r} is no share of sites; give one from 0.001 to 1: random-subset:0.5") from None


def _block(text: str) -> Schedule:
    sides = re.fullmatch(r"([1-9]\d{0,8})x([1-9]\d{0,8})", text)
    if not sides:
        raise ValueError(f"{text!r} is no size of a tile; give rows x columns from 1x1 up: block:16x16")
    return Block(int(sides[1]), int(sides[2]))


_WITH_PARAMETER = {"random-subset": _random_subset, "block": _block}

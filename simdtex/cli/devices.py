# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex devices``: the OpenCL devices of this computer."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from simdtex.cli.command import command

if TYPE_CHECKING:
    from rich.console import Console

    from simdtex.machine.devices import DeviceInfo

COLUMNS = ("", "index", "platform", "device", "kind", "OpenCL", "units", "memory", "usable")


@command()
def devices() -> None:
    """List all OpenCL devices, whether they work, and the default device."""
    from rich.console import Console

    from simdtex.machine.devices import devices

    render(Console(width=None if sys.stdout.isatty() else 200), devices())


def render(console: Console, listing: Sequence[DeviceInfo]) -> None:
    """Print a listing of probed devices as a table, and the default device, which is marked with "*"."""
    from rich.table import Table
    from rich.text import Text

    from simdtex.machine.devices import VARIABLE, DeviceError, choose

    wanted, default = os.environ.get(VARIABLE) or None, None
    try:
        default = choose(wanted, listing)
        sentence = f"Chosen by {VARIABLE if wanted else 'default'}: {default}"
    except DeviceError as error:
        sentence = str(error)
    sheet = Table(box=None, pad_edge=False)
    for name in COLUMNS:
        sheet.add_column(name, justify="right" if name in ("units", "memory") else "left")
    for info in listing:
        cells = (
            "*" if info is default else "",
            str(info.index),
            info.platform,
            info.name or "-",
            info.kind if info.name else "-",
            info.version.removeprefix("OpenCL ").partition(" ")[0] or "-",
            str(info.compute_units or "-"),
            f"{info.memory / 2**30:.1f} GiB" if info.memory else "-",
            ("yes (simulator)" if info.simulated else "yes") if info.usable else f"no: {info.reason}",
        )
        sheet.add_row(*(Text(cell) for cell in cells))  # as Text, since names may contain [brackets]
    console.print(sheet)
    console.print(Text(sentence))

# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex devices``: the OpenCL devices of this computer."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from simdtex.cli.command import command

if TYPE_CHECKING:
    from simdtex.machine.devices import DeviceInfo


@command()
def devices() -> None:
    """List all OpenCL devices, whether they work, and the default device."""
    from simdtex.machine.devices import devices

    render(devices())


def render(listing: Sequence[DeviceInfo]) -> None:
    """Print a listing of probed devices as a table, and the default device, which is marked with "*"."""
    from simdtex.machine.devices import VARIABLE, DeviceError, choose
    from simdtex.report.tables import Table, print_table

    wanted, default = os.environ.get(VARIABLE) or None, None
    try:
        default = choose(wanted, listing)
        sentence = f"Chosen by {VARIABLE if wanted else 'default'}: {default}"
    except DeviceError as error:
        sentence = str(error)
    rows = [
        {
            "": "*" if info is default else "",
            "index": str(info.index),
            "platform": info.platform,
            "device": info.name or "-",
            "kind": info.kind if info.name else "-",
            "OpenCL": info.version.removeprefix("OpenCL ").partition(" ")[0] or "-",
            "units": str(info.compute_units or "-"),
            "memory": f"{info.memory / 2**30:.1f} GiB" if info.memory else "-",
            "usable": ("yes (simulator)" if info.simulated else "yes") if info.usable else f"no: {info.reason}",
        }
        for info in listing
    ]
    print_table(Table("", rows))
    click.echo(sentence)

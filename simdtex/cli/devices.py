# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex devices``: what there is to compute on."""

from __future__ import annotations

import sys

from simdtex.cli.common import plainly
from simdtex.cli.helping import command


@command()
@plainly
def devices() -> None:
    """List every OpenCL device, whether it works, and which one would be chosen."""
    from rich.console import Console

    from simdtex.machine.devices import render

    render(Console(width=None if sys.stdout.isatty() else 200))

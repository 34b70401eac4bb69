# SPDX-License-Identifier: BSD-3-Clause
"""The command line: ``simdtex synth``, ``solid``, ``mix``, ``sheet``, ``schedules``, ``bench`` and the rest."""

from __future__ import annotations

import click

from simdtex import __version__
from simdtex.cli.bench import bench
from simdtex.cli.demo import demo
from simdtex.cli.devices import devices
from simdtex.cli.ising import ising
from simdtex.cli.mix import mix
from simdtex.cli.schedules import schedules
from simdtex.cli.sheet import sheet
from simdtex.cli.solid import solid
from simdtex.cli.synth import synth


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="simdtex")
def main() -> None:
    """More of a texture from a sample of it, by parallel relaxation on any OpenCL device."""


for command in (synth, solid, mix, sheet, schedules, ising, bench, devices, demo):
    main.add_command(command)

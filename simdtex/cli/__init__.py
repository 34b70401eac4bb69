# SPDX-License-Identifier: BSD-3-Clause
"""The command line: ``simdtex synth``, ``fill``, ``extend``, ``solid``, ``mix``, ``sheet`` and the rest."""

from __future__ import annotations

import atexit
import gc
from importlib import import_module

import click

COMMANDS = {
    "bench": "Measure what devices can do at most, and what the methods take.",
    "demo": "Synthesise brick, grass and gravel from scikit-image's own pictures.",
    "devices": "List every OpenCL device, whether it works, and which one would be chosen.",
    "extend": "Continue PICTURE beyond its edges, or make it seamless.",
    "fill": "Fill the holes of PICTURE with more of what is around them.",
    "ising": "Relax Ising spins by each schedule and compare with the exact energy and magnetisation.",
    "mix": "Mix the textures SAMPLE...: a picture that looks a bit like each of them.",
    "resume": "Go on with the run whose state is in DIR, and write what its command writes.",
    "schedules": "Run the same job under several schedules and compare them in a report.",
    "sheet": "Show what thresholds alpha / k^beta make of SAMPLE: Figures 11 and 12 of De Bonet (1997) on one sheet.",
    "simulate": "Simulate what TRAINING_IMAGE shows: realisations that look like it and honour data.",
    "solid": "Make a solid of the texture SAMPLE: a block whose slices look like it.",
    "synth": "Make more of the texture SAMPLE.",
}
"""The commands, each in the module of its name, and their first sentences."""


def load(name: str) -> click.Command:
    """The command of a name."""
    command: click.Command = getattr(import_module(f"simdtex.cli.{name}"), name)
    return command


class Commands(click.Group):
    """A group that lists stand-ins, and loads a command when it is run or asked for its help."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The name of a command, the command itself and its arguments."""
        name, _, rest = super().resolve_command(ctx, args)
        return name, load(str(name)), rest


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="simdtex", prog_name="simdtex")
def main() -> None:
    """More of a texture from a sample of it, by parallel relaxation on any OpenCL device."""
    atexit.register(gc.freeze)  # the process ends: what it holds need not be looked through for cycles


for _name, _sentence in COMMANDS.items():
    main.add_command(click.Command(_name, help=_sentence))

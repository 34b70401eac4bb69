# SPDX-License-Identifier: BSD-3-Clause
"""The command line: ``simdtex synth``, ``fill``, ``extend``, ``solid``, ``mix`` and the rest."""

from __future__ import annotations

import atexit
import gc
from importlib import import_module

import click

from simdtex.cli.command import write_examples

GROUPS = {
    "More of a texture": {
        "live": "Watch a texture take shape in the browser, and steer it.",
        "synth": "Make more of the texture SAMPLE.",
        "fill": "Fill the holes of PICTURE with more of what is around them.",
        "extend": "Continue PICTURE beyond its edges, or make it seamless.",
        "mix": "Mix the textures SAMPLE...: a picture that looks a bit like each of them.",
        "solid": "Make a solid of the texture SAMPLE: a block whose slices look like it.",
    },
    "Realisations of a training image": {
        "simulate": "Simulate what TRAINING_IMAGE shows: realisations that look like it and honour data.",
        "estimate": "Estimate what data say of each cell: probabilities of categories, or mean and variance, from "
        "TRAINING_IMAGE.",
    },
    "What is where": {
        "classify": "Label each pixel of PICTURE with the texture around it, or as unknown.",
    },
    "Runs that were stopped": {
        "resume": "Go on with the run whose state is in FILE, and write what its command writes.",
    },
    "Studies": {
        "schedules": "Run the same job under several schedules and compare them in a report.",
        "ising": "Relax Ising spins by each schedule and compare with the exact energy.",
    },
    "This machine": {
        "demo": "Synthesise brick, grass and gravel from scikit-image's own pictures.",
        "devices": "List every OpenCL device, whether it works, and which one would be chosen.",
        "bench": "Measure how long the methods take on devices, and how many times longer in NumPy.",
    },
}
"""The commands by what they are for, each in the module of its name, and their first sentences."""

COMMANDS = {name: sentence for group in GROUPS.values() for name, sentence in group.items()}

WHAT = "More of a texture from a sample of it, by parallel relaxation on any OpenCL device."

EXAMPLES = (
    ("synth gravel.png -o more.png", "More of a texture; it tiles."),
    ("extend photo.png -o tile.png --seamless", "A photo that tiles."),
    ("extend brick -o tiled --seamless", "All maps of a material, from a folder to another."),
    ("fill photo.png -o whole.png --mask hole.png", "A hole that is filled."),
)


def load(name: str) -> click.Command:
    """Return the command of a name."""
    command: click.Command = getattr(import_module(f"simdtex.cli.{name}"), name)
    command.help = command.help or COMMANDS[name]  # python -OO takes docstrings away
    return command


class Commands(click.Group):
    """A group that lists stand-ins by what they are for, and loads a command when it is run or asked for its help."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the name of a command, the command itself and its arguments."""
        name, _, rest = super().resolve_command(ctx, args)
        return name, load(str(name)), rest

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write what the program does, and the examples."""
        super().format_help_text(ctx, formatter)
        write_examples(EXAMPLES, formatter)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands, in groups of one width."""
        width = max(map(len, COMMANDS))
        for title, group in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(f"{name:{width}}", sentence) for name, sentence in group.items()])


def _versions(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Print the versions that a result may depend on, and the device that would be chosen."""
    if not wanted or ctx.resilient_parsing:
        return
    from simdtex.report.terminal import version_lines

    for line in version_lines():
        click.echo(line)
    ctx.exit()


@click.group(
    cls=Commands, help=WHAT, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_versions,
    help="Show what runs here, and on which device.",
)
def main() -> None:
    """Run a command."""
    atexit.register(gc.freeze)  # the process ends: what it holds need not be looked through for cycles


for _name, _sentence in COMMANDS.items():
    main.add_command(click.Command(_name, help=_sentence))

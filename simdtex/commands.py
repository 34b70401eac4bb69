# SPDX-License-Identifier: BSD-3-Clause
"""The command line: ``simdtex synth``, ``fill``, ``extend``, ``solid``, ``mix`` and the rest."""

from __future__ import annotations

import atexit
import gc
from importlib import import_module

import click

from simdtex.cli.command import write_examples

GROUPS = {
    "Textures": {
        "live": "Synthesise, fill, extend and classify on a page in the browser.",
        "synth": "Synthesise a picture of any size with the texture of SAMPLE.",
        "fill": "Fill the holes of PICTURE with the texture around them.",
        "tile": "Make PICTURE tile, or all maps of a material.",
        "tileset": "Make a set of corner tiles with the texture of SAMPLE, for a game.",
        "extend": "Continue PICTURE beyond its edges, or make it seamless.",
        "mix": "Mix the textures SAMPLE... into one picture.",
        "solid": "Make a solid block whose slices have the texture of SAMPLE.",
    },
    "Realisations of a training image": {
        "simulate": "Simulate realisations that look like TRAINING_IMAGE and honour data.",
        "estimate": "Estimate each cell from data and TRAINING_IMAGE: category probabilities, or mean and variance.",
    },
    "Classification": {
        "classify": "Label each pixel of PICTURE with the texture around it, or as unknown.",
    },
    "Interrupted runs": {
        "resume": "Continue the run whose state is in FILE, and write the outputs of its command.",
    },
    "Studies": {
        "schedules": "Run the same job under several schedules and compare them in a report.",
        "maspar": "Synthesise a picture by Algorithm 1 on an emulated MasPar MP-1, and print its times of 1998.",
    },
    "This machine": {
        "demo": "Synthesise brick, grass and gravel from pictures of scikit-image.",
        "devices": "List all OpenCL devices, whether they work, and the default device.",
        "bench": "Measure the time of each method on each device, and compare with NumPy.",
    },
}
"""The commands by what they are for, and their first sentences."""

COMMANDS = {name: sentence for group in GROUPS.values() for name, sentence in group.items()}

MODULES = {
    **dict.fromkeys(("devices", "demo", "resume"), "general"),
    **dict.fromkeys(("bench", "schedules"), "jobs.studies.command"),
    **dict.fromkeys(("extend", "fill", "tile"), "jobs.filling.command"),
    **dict.fromkeys(("estimate", "simulate"), "jobs.simulation.command"),
    **dict.fromkeys(("mix", "solid"), "jobs.mixes.command"),
    "classify": "jobs.classification.command",
    "live": "live.command",
    "maspar": "maspar.command",
    "synth": "jobs.synthesis.command",
    "tileset": "jobs.tilesets.command",
}
"""The modules of the commands."""

WHAT = "Texture synthesis from samples, by parallel relaxation on any OpenCL device."

COMMAND_WORDS = {
    "fill": ("inpaint", "heal", "remove", "erase", "patch", "repair"),
    "tile": ("seamless", "loop", "wrap", "tileable", "make-seamless"),
    "tileset": ("tiles", "wang", "autotile", "terrain"),
    "synth": ("synthesize", "synthesise", "generate", "texture", "variations", "make", "grow"),
    "extend": ("expand", "outpaint", "uncrop", "continue"),
    "solid": ("volume", "3d", "block"),
    "mix": ("blend", "merge"),
    "simulate": ("simulation", "realisations", "realizations", "mps"),
    "estimate": ("krige", "kriging", "probabilities"),
    "classify": ("segment", "label"),
    "schedules": ("ising",),
    "live": ("gui", "ui", "web", "serve", "app"),
    "devices": ("device", "gpus", "info", "list"),
    "bench": ("benchmark", "time", "speed"),
}
"""Words of other programs for commands, by ours."""

EXAMPLES = (
    ("synth gravel.png -o more.png", "Make a larger texture that tiles."),
    ("tile photo.png -o tile.png", "Make a photo tile."),
    ("tile brick -o tiled", "Make all maps of a material tile, from one folder to another."),
    ("fill photo.png -o whole.png --mask hole.png", "Fill a hole."),
)


def load(name: str) -> click.Command:
    """Return the command of a name."""
    command: click.Command = getattr(import_module(f"simdtex.{MODULES[name]}"), name)
    command.help = command.help or COMMANDS[name]  # python -OO takes docstrings away
    return command


class Commands(click.Group):
    """A group that lists stand-ins by what they are for, and loads a command when it is run or asked for its help."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the name of a command, the command itself and its arguments; a word of another program names ours."""
        for ours, theirs in COMMAND_WORDS.items():
            if args[0] in theirs:
                ctx.fail(f"No such command '{args[0]}': use `simdtex {ours}`.")
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
    from simdtex.figures.tables import version_lines

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
    help="Print the versions and the default device.",
)
def main() -> None:
    """Run a command."""
    atexit.register(gc.freeze)  # the process ends: what it holds need not be looked through for cycles


for _name, _sentence in COMMANDS.items():
    main.add_command(click.Command(_name, help=_sentence))

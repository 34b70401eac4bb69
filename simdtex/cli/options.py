# SPDX-License-Identifier: BSD-3-Clause
"""The options that commands share, and those of each method."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import click
from click.shell_completion import CompletionItem
from click.types import StringParamType

from simdtex.cli.places import ENTER, FOLDER, READ, WRITE

Command = Callable[..., None]


@functools.cache
def _defaults() -> dict[str, Any]:
    """Each method's options as they are by default, by the method's name."""
    from simdtex.methods import mrf, multires, pyramid

    return {"mrf": mrf.Options(), "multires": multires.Options(), "pyramid": pyramid.Options()}


def _words(name: str) -> list[tuple[str, ...]]:
    """What an option of this name may be, for each method in which it is one of some words."""
    from simdtex import schedules
    from simdtex.methods.pyramid import solid
    from simdtex.options import PRESETS, Choice, table

    others = {"method": tuple(_defaults()), "preset": PRESETS, "schedule": tuple(schedules.SCHEDULES)}
    declared = (table(one).get(name) for one in (*_defaults().values(), solid.Options))
    found = [one.kind.valid for one in declared if one and isinstance(one.kind, Choice)]
    return [others[name]] if name in others else list(dict.fromkeys(found))


class Option(click.Option):
    """An option whose help names defaults, as ``{mrf.order}``, and which the shell completes.

    The methods load only where it is shown or completed.
    """

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """The words that it may be; else what its type says."""
        found = [word for valid in _words(str(self.name)) for word in valid if word.startswith(incomplete)]
        return [CompletionItem(word) for word in dict.fromkeys(found)] or super().shell_complete(ctx, incomplete)

    def make_metavar(self, ctx: click.Context) -> str:
        """The words that it may be, where they are the same for all methods and few."""
        found = _words(str(self.name)) if self.metavar is None and isinstance(self.type, StringParamType) else []
        short = len(found) == 1 and len("|".join(found[0])) < 30
        return "|".join(found[0]) if short else super().make_metavar(ctx)

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """The names of the option, and its help."""
        self.help = self.help and self.help.format(**_defaults())
        return super().get_help_record(ctx)


option = functools.partial(click.option, cls=Option)

DEVICE = option(
    "--device",
    metavar="TEXT",
    help="Run on the device whose name or platform has this in it, on that of a number of `simdtex devices`, or on "
    "`reference`.  [SIMDTEX_DEVICE, else a GPU, else a CPU]",
)

SEED = option(
    "--seed", type=int, help="Make the same picture from the same seed, on every device.  [a fresh one, printed]"
)
PROFILE = option("--profile", is_flag=True, help="Print what each kernel takes, and what is left to the host.")
CHECKPOINT = option(
    "--checkpoint",
    type=WRITE,
    metavar="FILE",
    help="Keep the state of the run in this file; `simdtex resume FILE` goes on with it.",
)
QUIET = option("-q", "--quiet", is_flag=True, help="Show no progress bar and no summary.")


def levels_option(default: str) -> Callable[[Command], Command]:
    """``--levels``, which is this by default."""
    return option("--levels", type=int, help=f"Go through this many levels, from coarse to fine.  [{default}]")


LEVELS = levels_option("as many as the sample feeds")
BOUNDARY = option(
    "--boundary",
    help="mrf, multires: let the output wrap around, so that it tiles (torus), or not (open).  [{mrf.boundary}]",
)

_EDGES = {
    "multires": "mend the sample's edges, so that it wraps around, or keep them.  [{multires.edges}]",
    "mrf": "let the sample go on as in a mirror (reflect), take nothing near its edge (whole), or do as it suits "
    "(auto).  [{mrf.edges}]",
    "pyramid": "let the sample go on as in a mirror (reflect), or wrap around (wrap).  [{pyramid.edges}]",
}
_ORIENTATIONS = {
    "multires": "look for edges and lines in this many directions.  [{multires.orientations}]",
    "pyramid": "split pictures into 1, 2, 4 or 6 directions.  [{pyramid.orientations}]",
}


def stages_option(what: str) -> Callable[[Command], Command]:
    """``--stages``, which writes these pictures."""
    return option("--stages", type=FOLDER, metavar="DIR", help=f"Write {what} as pictures.")


def _shared(name: str, texts: dict[str, str], *methods: str, **kinds: Any) -> Callable[[Command], Command]:
    """An option that means something to each of these methods."""
    return option(name, help=" ".join(f"{method}: {texts[method]}" for method in methods), **kinds)


def _alone(name: str, text: str, **kinds: Any) -> Callable[[Command], Command]:
    """An option of several methods in a command that has but one of them."""
    return option(name, help=text[0].upper() + text[1:], **kinds)


def _after(prefix: str, text: str) -> str:
    """A help behind the name of its method, or without one."""
    return prefix + text[0].lower() + text[1:] if prefix else text


_MRF: dict[str, tuple[Any, str]] = {
    "--preset": (str, "Begin with the method's own defaults, or with the 1998 rules to the letter (paper).  [default]"),
    "--order": (
        int,
        "Compare neighbours within sqrt(order) pixels: 8 has 24 of them, 18 has 60. More keep larger shapes, and are "
        "slower.  [{mrf.order}]",
    ),
    "--relaxation": (str, "Take the most likely pixel (icm), or draw one (gibbs).  [{mrf.relaxation}]"),
    "--bandwidth": (float, "Give the Parzen kernel this width, in units of h_opt; wider is freer.  [{mrf.bandwidth}]"),
    "--coherence": (float, "Prefer to continue a neighbour's source: more keeps pieces together.  [{mrf.coherence}]"),
    "--balance": (float, "Use the sample evenly: more repeats its pieces less.  [{mrf.balance}]"),
    "--structure": (float, "Follow the sample's outlines: more keeps joints and contours whole.  [{mrf.structure}]"),
    "--novelty": (float, "Break up the sample's layout: more keeps less of it.  [{mrf.novelty}]"),
    "--overview": (int, "Keep this many candidates at the coarsest level; fewer keep more layout.  [{mrf.overview}]"),
    "--finish": (float, "Melt seams over this many pixels; 0 leaves them as they are.  [1.5; of categories 0]"),
    "--xi": (float, "Cool by xi of equation (13), below 0; further down is faster.  [{mrf.xi}]"),
    "--free-sweeps": (int, "Sweep over all sites this many times after a level's equilibrium.  [{mrf.free_sweeps}]"),
    "--pixel": (str, "Take pixels of the sample (source), or grey levels of the density (density).  [{mrf.pixel}]"),
    "--phases": (
        str,
        "Take candidates at coarse levels from the decimated sample, or from all of its positions.  [{mrf.phases}]",
    ),
    "--coarsest": (str, "Let the coarsest level draw (gibbs), or relax as the others (same).  [{mrf.coarsest}]"),
    "--search": (
        str,
        "Weigh a few candidates, which is much faster (coherent), or all (exact), or as it suits (auto).  "
        "[{mrf.search}]",
    ),
    "--suggesting": (
        int,
        "In a coherent search, let this many nearest neighbours suggest a candidate.  [{mrf.suggesting}]",
    ),
    "--similar": (
        int,
        "In a coherent search, weigh this many more candidates that are like each of these.  [{mrf.similar}]",
    ),
    "--chance": (int, "In a coherent search, weigh this many more candidates at random.  [{mrf.chance}]"),
    "--exhaustive": (int, "In a coherent search, weigh all candidates at levels with this few.  [{mrf.exhaustive}]"),
}
"""Those of ``mrf`` that no other method has."""

_KINDS: dict[str, tuple[Any, str]] = {
    "--categorical": (None, "Take values for names of categories, which differ or not, and are never mixed."),
    "--categorical-channels": ("N,N,...", "Take these channels alone for categories; the first is 0."),
    "--weights": ("W,W,...", "Bring all channels to one spread, times these weights.  [one scale, as of colours]"),
    "--shares": ("S,S,...", "Use each of several samples this much.  [all pixels count alike]"),
    "--unsure": (float, "Let this share of a pixel's neighbours in the sample be unknown.  [{mrf.unsure}]"),
    "--data-weight": (
        float,
        "Let a known pixel that is from no sample count for this many neighbours.  [{mrf.data_weight:g}]",
    ),
}
"""What the values of a sample are and count for."""

_WANTED: dict[str, tuple[Any, str]] = {
    "--proportions": ("P,P,...", "Make this much of the output of each category, in ascending order."),
    "--guide-weight": (
        float,
        "Give the guide this variance, in units of the sample's; more follows it more closely.  [{mrf.guide_weight:g}]",
    ),
    "--labels/--no-labels": (
        None,
        "Take the guides' values for names, or for numbers.  [names, of 16 whole numbers or colours or fewer]",
    ),
}
"""What is wanted of an output as a whole."""


def _worded(
    table: dict[str, tuple[Any, str]],
    prefix: str = "",
    without: tuple[str, ...] = (),
    defaults: dict[str, str] | None = None,
) -> list[Callable[[Command], Command]]:
    """The options of a table, with a type, a metavar, or None for a flag; `prefix` stands before their help.

    ``defaults`` those of a command, where they are not the method's.
    """
    made: list[Callable[[Command], Command]] = []
    for name, (kind, text) in table.items():
        text = f"{text.partition('  [')[0]}  [{defaults[name]}]" if defaults and name in defaults else text
        how: dict[str, Any] = {"is_flag": True, "default": None} if kind is None else {"type": kind}
        how = {"metavar": kind} if isinstance(kind, str) else how
        if name not in without:
            made.append(option(name, help=_after(prefix, text), **how))
    return made


_MULTIRES_OPTIONS = (
    option("--sigma", type=float, help="multires: make the filters this wide, in pixels.  [{multires.sigma}]"),
    option(
        "--filter-size",
        type=int,
        help="multires: give filters this many rows, an odd number.  [{multires.filter_size}]",
    ),
    option("--features", help="multires: compare the luminance, or all channels.  [{multires.features}]"),
    option(
        "--parity",
        help="multires: take a candidate from even or odd places, as the pixel's is (match), or from any (free).  "
        "[{multires.parity}]",
    ),
    option("--seams", help="multires: blend pieces where they meet, or cut them there.  [{multires.seams}]"),
)


_THRESHOLD_OPTIONS = (
    option(
        "--alpha",
        metavar="FLOAT|auto",
        help="multires: exchange places that differ by no more than this: 0 tiles the sample, more is freer, auto "
        "finds one.  [{multires.alpha}]",
    ),
    option(
        "--beta",
        type=float,
        help="multires: be stricter at high frequencies, by alpha / k^beta.  [{multires.beta:g}]",
    ),
    option(
        "--strain", type=float, help="multires: let --alpha auto strain seams no more than this.  [{multires.strain}]"
    ),
    option("--target", type=float, help="multires: let --alpha auto find this many candidates a pixel instead."),
    option(
        "--thresholds",
        type=READ,
        metavar="FILE",
        help="multires: read a table of thresholds, a line of numbers for each level.",
    ),
)


def _pyramid_options(start: str, prefix: str = "") -> list[Callable[[Command], Command]]:
    """Those of ``pyramid`` that no other method has; `start` is ``"METAVAR: what to begin with"``."""
    metavar, begin = start.split(": ")

    def named(name: str, text: str, **kinds: Any) -> Callable[[Command], Command]:
        return option(name, help=_after(prefix, text), **kinds)

    return [
        named(
            "--pyramid", "Match every scale and direction (steerable), or every scale (laplacian).  [{pyramid.pyramid}]"
        ),
        named("--iterations", "Match all histograms this many times.  [{pyramid.iterations}]", type=int),
        named("--match", "Match histograms exactly (rank), or by the paper's tables (lookup).  [{pyramid.match}]"),
        named("--bins", "Give these tables this many bins, 2 to 4096.  [{pyramid.bins}]", type=int),
        named("--color", "Match colours that are decorrelated first, or the channels.  [{pyramid.color}]"),
        named(
            "--start", f"Begin with this {begin}.  [noise]", type=ENTER if metavar == "BLOCK" else READ, metavar=metavar
        ),
    ]


def _with(*options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    def decorate(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


mrf_options = _with(
    *_worded(_MRF),
    _alone("--edges", _EDGES["mrf"]),
    LEVELS,
    option("--boundary", help="Let the output wrap around, so that it tiles (torus), or not (open).  [{mrf.boundary}]"),
)
"""The options of the method ``mrf`` that any command takes which makes a whole picture with it."""

_HOLES = {"--balance": "0", "--novelty": "0", "--chance": "16", "--data-weight": "4"}
_EDGE = {"--chance": "16", "--data-weight": "4"}

fill_options = _with(
    *_worded(_KINDS, defaults=_HOLES),
    *_worded(_MRF, without=("--overview",), defaults=_HOLES),
    _alone("--edges", _EDGES["mrf"]),
    levels_option("as many as see across the hole"),
    option("--boundary", help="Take the picture for one that tiles (torus), or not (open).  [open]"),
)
"""Those of ``simdtex fill``."""

simulate_options = _with(
    *_worded(_KINDS),
    *_worded(_WANTED),
    *_worded(_MRF, defaults={"--novelty": "0.25"}),
    _alone("--edges", _EDGES["mrf"]),
    LEVELS,
    option("--boundary", help="Let realisations wrap around, so that they tile (torus), or not (open).  [open]"),
)
"""Those of ``simdtex simulate``."""

extend_options = _with(
    *_worded(_KINDS, without=("--shares", "--unsure"), defaults=_EDGE),
    *_worded(_MRF, defaults=_EDGE),
    _alone("--edges", _EDGES["mrf"]),
    LEVELS,
)
"""Those of ``simdtex extend``."""

multires_options = _with(
    _shared("--orientations", _ORIENTATIONS, "multires", type=int),
    *_MULTIRES_OPTIONS,
    _shared("--edges", _EDGES, "multires"),
    LEVELS,
    BOUNDARY,
)
"""Those of ``multires``, but for its thresholds."""

method_options = _with(
    LEVELS,
    BOUNDARY,
    _shared("--edges", _EDGES, "mrf", "multires", "pyramid"),
    _shared("--orientations", _ORIENTATIONS, "multires", "pyramid", type=int),
    *_worded(_MRF, "mrf: "),
    *_worded(_KINDS, "mrf: "),
    *_worded(_WANTED, "mrf: "),
    *_THRESHOLD_OPTIONS,
    *_MULTIRES_OPTIONS,
    *_pyramid_options("PICTURE: picture", "pyramid: "),
)
"""Those of every method."""


def pyramid_options(start: str) -> Callable[[Command], Command]:
    """Those of a command that runs nothing but ``pyramid``; `start` is ``"METAVAR: what to begin with"``."""
    return _with(
        *_pyramid_options(start),
        levels_option("as many as leave 8 pixels a side"),
        _alone("--orientations", _ORIENTATIONS["pyramid"], type=int),
        _alone("--edges", _EDGES["pyramid"]),
    )

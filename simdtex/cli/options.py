# SPDX-License-Identifier: BSD-3-Clause
"""The options that commands share, and those of each method."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import click
from click.shell_completion import CompletionItem
from click.types import StringParamType

from simdtex.cli.places import ENTER, FOLDER, READ

Command = Callable[..., None]


@functools.cache
def _defaults() -> dict[str, Any]:
    """Each method's options as they are by default, by the method's name."""
    from simdtex.methods import mrf, multires, pyramid

    return {"mrf": mrf.Options(), "multires": multires.Options(), "pyramid": pyramid.Options()}


def _words(name: str) -> list[tuple[str, ...]]:
    """What an option of this name may be, for each method in which it is one of some words."""
    from simdtex import schedules
    from simdtex.methods.mrf.options import PRESETS
    from simdtex.methods.pyramid import solid
    from simdtex.options import Words, kinds

    others = {"method": tuple(_defaults()), "preset": tuple(PRESETS), "schedule": tuple(schedules.SCHEDULES)}
    declared = (kinds(one).get(name) for one in (*_defaults().values(), solid.Options))
    found = [one.valid for one in declared if isinstance(one, Words)]
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
    help="Part of a device's name or platform, an index of `simdtex devices`, or `reference`. "
    "Default: SIMDTEX_DEVICE, else a GPU, else a CPU.",
)

SEED = option("--seed", type=int, help="Same seed, same picture on every device.  [a fresh one, printed]")
PROFILE = option("--profile", is_flag=True, help="Print what each kernel took, and what was left to the host.")
CHECKPOINT = option(
    "--checkpoint",
    type=FOLDER,
    metavar="DIR",
    help="Keep the state of the run there; `simdtex resume DIR` goes on with it.",
)
QUIET = option("-q", "--quiet", is_flag=True, help="No progress bar and no summary.")
LEVELS = option("--levels", type=int, help="Of the multigrid, or of the pyramid.  [as many as the sample feeds]")
BOUNDARY = option("--boundary", help="mrf, multires: torus (the result tiles) or open.  [{mrf.boundary}]")

_EDGES = {
    "multires": "mend (make the sample wrap around) or keep.  [{multires.edges}]",
    "mrf": "auto, reflect or whole: candidates at the sample's edge.  [{mrf.edges}]",
    "pyramid": "reflect or wrap: how the sample goes on beyond its edge.  [{pyramid.edges}]",
}
_ORIENTATIONS = {
    "multires": "of edge and line filters.  [{multires.orientations}]",
    "pyramid": "1, 2, 4 or 6, of the steerable pyramid.  [{pyramid.orientations}]",
}


def stages_option(what: str) -> Callable[[Command], Command]:
    """``--stages``, which writes these pictures."""
    return option("--stages", type=FOLDER, metavar="DIR", help=f"Write {what} as pictures.")


def _shared(name: str, texts: dict[str, str], *methods: str, **kinds: Any) -> Callable[[Command], Command]:
    """An option that means something to each of these methods."""
    return option(name, help=" ".join(f"{method}: {texts[method]}" for method in methods), **kinds)


_MRF: dict[str, tuple[Any, str]] = {
    "--preset": (str, "default, or paper: the 1998 rules to the letter."),
    "--order": (int, "Neighbours within sqrt(order): 8 has 24, 18 has 60.  [{mrf.order}]"),
    "--relaxation": (str, "icm (the mode) or gibbs (a draw).  [{mrf.relaxation}]"),
    "--bandwidth": (float, "Of the Parzen kernel, in units of h_opt.  [{mrf.bandwidth}]"),
    "--coherence": (float, "Preference for continuing a neighbour's source.  [{mrf.coherence}]"),
    "--balance": (float, "The higher, the more evenly the sample is used.  [{mrf.balance}]"),
    "--structure": (float, "Weight of the distance to the sample's edges.  [{mrf.structure}]"),
    "--novelty": (float, "The higher, the less of the sample's layout is kept.  [{mrf.novelty}]"),
    "--overview": (int, "Candidates at the coarsest level, at least.  [{mrf.overview}]"),
    "--finish": (float, "Pixels over which seams melt; 0: none.  [1.5; of categories 0]"),
    "--xi": (float, "Cooling, below 0; further down is faster.  [{mrf.xi}]"),
    "--free-sweeps": (int, "Sweeps over all sites after a level's equilibrium.  [{mrf.free_sweeps}]"),
    "--pixel": (str, "source (pixels of the sample) or density (grey levels).  [{mrf.pixel}]"),
    "--phases": (str, "decimated or all: candidates at coarse levels.  [{mrf.phases}]"),
    "--coarsest": (str, "gibbs or same: how the coarsest level relaxes.  [{mrf.coarsest}]"),
    "--search": (str, "exact (all candidates), coherent (a few, much faster) or auto.  [{mrf.search}]"),
    "--suggesting": (int, "coherent: nearest neighbours that suggest one.  [{mrf.suggesting}]"),
    "--similar": (int, "coherent: candidates like each of these.  [{mrf.similar}]"),
    "--chance": (int, "coherent: candidates at random.  [{mrf.chance}]"),
    "--exhaustive": (int, "coherent: levels of so few candidates weigh all.  [{mrf.exhaustive}]"),
}
"""Those of ``mrf`` that no other method has."""

_KINDS: dict[str, tuple[Any, str]] = {
    "--categorical": (None, "Values name categories: they differ or not, and are never mixed."),
    "--categorical-channels": ("N,N,...", "The only channels that are categorical, counted from 0."),
    "--weights": ("W,W,...", "One for each channel, all brought to one spread.  [one scale, as of colours]"),
    "--shares": ("S,S,...", "One for each of several samples: how much it is used.  [all pixels count alike]"),
    "--unsure": (float, "Share of a pixel's neighbours in the sample that may be unknown.  [{mrf.unsure}]"),
    "--data-weight": (
        float,
        "Neighbours that a known pixel counts for if it is from no sample.  [{mrf.data_weight:g}]",
    ),
}
"""What the values of a sample are and count for."""

_WANTED: dict[str, tuple[Any, str]] = {
    "--proportions": ("P,P,...", "How much of the output each category is to be, in ascending order."),
    "--guide-weight": (float, "Variance of the guide, in units of the sample's.  [{mrf.guide_weight:g}]"),
    "--labels/--no-labels": (None, "What guides hold.  [labels, if they have 16 whole numbers or colours or fewer]"),
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
            made.append(option(name, help=prefix + text[0].lower() + text[1:] if prefix else text, **how))
    return made


_MULTIRES_OPTIONS = (
    option("--sigma", type=float, help="multires: of the filters, in pixels.  [{multires.sigma}]"),
    option("--filter-size", type=int, help="multires: rows of a filter, odd.  [{multires.filter_size}]"),
    option("--features", help="multires: of the luminance or of all channels.  [{multires.features}]"),
    option("--phase", help="multires: match or free: candidates among siblings.  [{multires.phase}]"),
    option("--joins", help="multires: blend or cut: where pieces meet.  [{multires.joins}]"),
)


_THRESHOLD_OPTIONS = (
    option(
        "--alpha", metavar="FLOAT|auto", help="multires: threshold; more is freer, auto finds one.  [{multires.alpha}]"
    ),
    option("--beta", type=float, help="multires: stricter at high frequencies, alpha / k^beta.  [{multires.beta:g}]"),
    option("--strain", type=float, help="multires: of joins, at most, for --alpha auto.  [{multires.strain}]"),
    option("--target", type=float, help="multires: mean candidates for --alpha auto, in place of --strain."),
    option(
        "--thresholds",
        type=READ,
        metavar="FILE",
        help="multires: a table of thresholds, a line of numbers for each level.",
    ),
)


def _pyramid_options(start: str, prefix: str = "") -> list[Callable[[Command], Command]]:
    """Those of ``pyramid`` that no other method has; `start` is ``"METAVAR: What to begin with"``."""
    metavar, begin = start.split(": ")

    def named(name: str, text: str, **kinds: Any) -> Callable[[Command], Command]:
        return option(name, help=prefix + text[0].lower() + text[1:] if prefix else text, **kinds)

    return [
        named("--pyramid", "steerable or laplacian: whose histograms are matched.  [{pyramid.pyramid}]"),
        named("--iterations", "Times that all are matched, 0 or more.  [{pyramid.iterations}]", type=int),
        named("--match", "rank (exact) or lookup (the paper's tables).  [{pyramid.match}]"),
        named("--bins", "Of these tables, 2 to 4096.  [{pyramid.bins}]", type=int),
        named("--color", "decorrelate or channels: the colours that are matched.  [{pyramid.color}]"),
        named(
            "--start", f"{begin} to begin with.  [noise]", type=ENTER if metavar == "VOLUME" else READ, metavar=metavar
        ),
    ]


def _with(*options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    def decorate(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


_DEPTH = "Of the multigrid.  [as many as the sample feeds]"

mrf_options = _with(
    *_worded(_MRF),
    option("--edges", help=_EDGES["mrf"]),
    option("--levels", type=int, help=_DEPTH),
    option("--boundary", help="torus (the result tiles) or open.  [{mrf.boundary}]"),
)
"""The options of the method ``mrf`` that any command takes which makes a whole picture with it."""

_HOLES = {"--balance": "0", "--novelty": "0", "--chance": "16", "--data-weight": "4"}
_EDGE = {"--chance": "16", "--data-weight": "4"}

fill_options = _with(
    *_worded(_KINDS, defaults=_HOLES),
    *_worded(_MRF, without=("--overview",), defaults=_HOLES),
    option("--edges", help=_EDGES["mrf"]),
    option("--levels", type=int, help="Of the multigrid.  [as many as it takes to see across the hole]"),
    option("--boundary", help="open, or torus: the picture tiles, and its holes go on beyond its edges.  [open]"),
)
"""Those of ``simdtex fill``."""

simulate_options = _with(
    *_worded(_KINDS),
    *_worded(_WANTED),
    *_worded(_MRF, defaults={"--novelty": "0.25"}),
    option("--edges", help=_EDGES["mrf"]),
    option("--levels", type=int, help=_DEPTH),
    option("--boundary", help="open, or torus: realisations tile.  [open]"),
)
"""Those of ``simdtex simulate``."""

extend_options = _with(
    *_worded(_KINDS, without=("--shares", "--unsure"), defaults=_EDGE),
    *_worded(_MRF, defaults=_EDGE),
    option("--edges", help=_EDGES["mrf"]),
    option("--levels", type=int, help=_DEPTH),
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
    *_pyramid_options("IMAGE: A picture", "pyramid: "),
)
"""Those of every method."""


def pyramid_options(start: str) -> Callable[[Command], Command]:
    """Those of a command that runs nothing but ``pyramid``; `start` is ``"METAVAR: What to begin with"``."""
    return _with(
        *_pyramid_options(start),
        option("--levels", type=int, help="Of the pyramids.  [as many as leave 8 pixels a side]"),
        option("--orientations", type=int, help=_ORIENTATIONS["pyramid"]),
        option("--edges", help=_EDGES["pyramid"]),
    )

# SPDX-License-Identifier: BSD-3-Clause
"""What the page asks for: the methods' options in plain words, with the ranges that one slides over.

What an option may be, and what it is by default, comes from where it is declared (`simdtex.options.kinds`); here is
what it is called. An option of the methods that has no words here has no control on the page.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any, NamedTuple

from simdtex.jobs.filling import OF_EDGES, OF_HOLES
from simdtex.methods import mrf, multires, pyramid
from simdtex.options import Kind, Number, Switch, Whole, Words, kinds

METHODS: dict[str, tuple[str, Any]] = {
    "mrf": ("Markov random field: any texture", mrf.Options),
    "multires": ("Multiresolution sampling: very quick, loose order", multires.Options),
    "pyramid": ("Pyramid matching: stone, bark, cloth", pyramid.Options),
}
"""The methods, what the page calls them, and their options."""

LOOKS, SEARCH, SAMPLING, LEVELS = "How it looks", "How it is searched", "How it is sampled", "Levels and edges"
GROUPS = (LOOKS, LEVELS, SEARCH, SAMPLING)
"""The groups of controls, in their order; the first is open."""

BOUNDARY = {"torus": "tiles without a seam", "open": "does not tile"}


class Worded(NamedTuple):
    """An option in plain words.

    ``span`` is the least and the largest that a slider gives, and its step; ``says`` what the words of an option mean;
    ``empty`` what it means to leave a number out.
    """

    group: str
    label: str
    hint: str
    span: tuple[float, float, float] | None = None
    says: dict[str, str] | None = None
    empty: str = ""


MRF = {
    "order": Worded(
        LOOKS, "Reach", "How far a pixel looks around: more keeps larger shapes, and is slower.", (2, 40, 1)
    ),
    "structure": Worded(
        LOOKS, "Follow outlines", "More, where joints break or stones lose their outline.", (0, 6, 0.25)
    ),
    "coherence": Worded(LOOKS, "Keep pieces together", "More, where shapes do not fit together.", (0, 4, 0.1)),
    "balance": Worded(LOOKS, "Use all of the sample", "More, where a piece comes back again and again.", (0, 4, 0.1)),
    "novelty": Worded(LOOKS, "Break up the layout", "More, where the sample comes out as it is.", (0, 4, 0.25)),
    "finish": Worded(
        LOOKS, "Melt seams", "Pixels over which pieces fade into each other.", (0, 4, 0.25), empty="1.5, or 0"
    ),
    "boundary": Worded(LOOKS, "Edges of the result", "", says=BOUNDARY),
    "categorical": Worded(LOOKS, "Values are categories", "They differ or not, and are never mixed."),
    "overview": Worded(
        LEVELS, "Choice at the coarsest level", "More, where the sample's layout returns.", (16, 1024, 16)
    ),
    "levels": Worded(LEVELS, "Levels", "From coarse to fine.", (1, 8, 1), empty="as many as the sample feeds"),
    "edges": Worded(
        LEVELS,
        "Edges of the sample",
        "",
        says={"auto": "as it suits", "reflect": "go on as in a mirror", "whole": "are not taken from"},
    ),
    "phases": Worded(
        LEVELS, "Coarse levels take from", "", says={"decimated": "the decimated sample", "all": "every place"}
    ),
    "search": Worded(
        SEARCH,
        "Search",
        "A few candidates are much faster; all of them are the paper's.",
        says={"auto": "as it suits", "coherent": "a few candidates", "exact": "all candidates"},
    ),
    "suggesting": Worded(SEARCH, "Neighbours that suggest", "How many nearest neighbours suggest a pixel.", (1, 24, 1)),
    "similar": Worded(SEARCH, "Alike for each", "Candidates more that are like each of these.", (0, 8, 1)),
    "chance": Worded(SEARCH, "By chance", "Candidates more that are drawn.", (0, 32, 1)),
    "exhaustive": Worded(SEARCH, "Weigh all up to", "Levels with so few candidates weigh all of them.", (0, 1024, 16)),
    "relaxation": Worded(
        SAMPLING, "A pixel takes", "", says={"icm": "what is most likely", "gibbs": "a draw of what is likely"}
    ),
    "bandwidth": Worded(
        SAMPLING, "Bandwidth", "Of the Parzen kernel, in units of h_opt; more is freer.", (0.05, 2, 0.05)
    ),
    "xi": Worded(SAMPLING, "Cooling", "Equation (13): further below 0 is faster.", (-4, -0.25, 0.25)),
    "free_sweeps": Worded(SAMPLING, "Free sweeps", "Over all sites, after a level's equilibrium.", (0, 8, 1)),
    "pixel": Worded(
        SAMPLING, "Values come from", "", says={"source": "pixels of the sample", "density": "the Parzen density"}
    ),
    "coarsest": Worded(SAMPLING, "The coarsest level", "", says={"gibbs": "draws", "same": "does as the others do"}),
}
MULTIRES = {
    "alpha": Worded(LOOKS, "Freedom", "0 tiles the sample, more leads to rubble.", (0, 1, 0.01), empty="found for you"),
    "beta": Worded(LOOKS, "Stricter in detail", "alpha / k^beta.", (0, 3, 0.1)),
    "strain": Worded(LOOKS, "Strain of seams", "At most, where the freedom is found for you.", (0, 0.5, 0.01)),
    "seams": Worded(LOOKS, "Pieces that meet", "", says={"blend": "fade into each other", "cut": "end there"}),
    "boundary": Worded(LOOKS, "Edges of the result", "", says=BOUNDARY),
    "features": Worded(SEARCH, "Features of", "", says={"luminance": "the luminance", "channels": "every channel"}),
    "parity": Worded(SEARCH, "Candidates", "", says={"match": "of even and odd places alike", "free": "of any place"}),
    "orientations": Worded(SEARCH, "Directions of the filters", "0 leaves the bands alone.", (0, 12, 1)),
    "sigma": Worded(SEARCH, "Width of the filters", "Pixels.", (0.3, 3, 0.1)),
    "filter_size": Worded(SEARCH, "Size of the filters", "Pixels, odd.", (3, 15, 2)),
    "levels": Worded(LEVELS, "Levels", "From coarse to fine.", (1, 10, 1), empty="down to a pixel"),
    "edges": Worded(
        LEVELS, "Edges of the sample", "", says={"mend": "are mended, so that it wraps", "keep": "stay as they are"}
    ),
}
PYRAMID = {
    "iterations": Worded(LOOKS, "Iterations", "Times that all histograms are matched.", (0, 20, 1)),
    "pyramid": Worded(
        LOOKS,
        "Histograms of",
        "",
        says={"steerable": "every direction and scale", "laplacian": "every scale"},
    ),
    "orientations": Worded(LOOKS, "Directions", "1, 2, 4 or 6.", (1, 6, 1)),
    "color": Worded(LOOKS, "Colours", "", says={"decorrelate": "are taken apart first", "channels": "as they are"}),
    "match": Worded(SEARCH, "Matched", "", says={"rank": "exactly, by rank", "lookup": "by tables, as in the paper"}),
    "bins": Worded(SEARCH, "Bins of the tables", "", (2, 1024, 2)),
    "levels": Worded(LEVELS, "Levels", "From coarse to fine.", (0, 8, 1), empty="as many as leave 8 pixels"),
    "edges": Worded(LEVELS, "Edges of the sample", "", says={"reflect": "go on as in a mirror", "wrap": "wrap around"}),
}
WORDS = {"mrf": MRF, "multires": MULTIRES, "pyramid": PYRAMID}
"""The options of each method that have controls."""

UNDECLARED: dict[str, dict[str, Kind]] = {
    "mrf": {"order": Whole(1, 4096), "categorical": Switch()},
    "multires": {"alpha": Number(0)},
}
"""What options may be that are checked by more than a kind."""


OF_JOBS: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "fill": (OF_HOLES, ("overview", "categorical")),
    "tile": (OF_EDGES, ("boundary", "categorical")),
}
"""Of the jobs that ``mrf`` does besides: what is by default otherwise, and which controls they lack."""


def controls(table: str) -> list[dict[str, Any]]:
    """The controls of a method, or of a job of `OF_JOBS`, in the order of the groups.

    Returns
    -------
    list of dict
        ``name``, ``group``, ``label``, ``hint``, ``kind`` (``"words"``, ``"whole"``, ``"number"`` or ``"switch"``),
        ``default``, None where it is left to the method; of words ``valid``, pairs of a word and what it says; of
        numbers ``least`` and ``most``, what they may be, ``span``, ``empty``, and ``blank``, what one that is left out
        stands for.
    """
    method = "mrf" if table in OF_JOBS else table
    options = METHODS[method][1]
    other, without = OF_JOBS.get(table, ({}, ()))
    found = kinds(options) | UNDECLARED.get(method, {})
    defaults = {one.name: one.default for one in fields(options)} | other
    words = {name: worded for name, worded in WORDS[method].items() if name not in without}
    made = [_control(name, worded, found[name], defaults[name]) for name, worded in words.items()]
    return sorted(made, key=lambda one: GROUPS.index(one["group"]))


BLANK = {"alpha": "auto"}
"""What a number that is left out means, where that is more than its default."""


def _control(name: str, worded: Worded, kind: Kind, default: Any) -> dict[str, Any]:
    control: dict[str, Any] = {
        "name": name,
        "group": worded.group,
        "label": worded.label,
        "hint": worded.hint,
        "default": default,
    }
    if isinstance(kind, Words):
        return control | {
            "kind": "words",
            "valid": [[word, (worded.says or {}).get(word, word)] for word in kind.valid],
        }
    if isinstance(kind, Switch):
        return control | {"kind": "switch"}
    whole = "whole" if isinstance(kind, Whole) else "number"
    return control | {
        "kind": whole,
        "least": kind.least,
        "most": kind.most,
        "span": worded.span,
        "empty": worded.empty,
        "blank": BLANK.get(name),
    }

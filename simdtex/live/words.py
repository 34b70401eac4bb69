# SPDX-License-Identifier: BSD-3-Clause
"""The controls of the live page, made from the tables of options."""

from __future__ import annotations

import re
from math import isfinite
from typing import Any

from simdtex.methods import classifier, mrf, multires, pyramid
from simdtex.options import Choice, Number, Option, Other, Whole, is_flag, table

METHODS = {
    "mrf": "Markov random field: any texture",
    "multires": "Multiresolution sampling: very quick, loose order",
    "pyramid": "Pyramid matching: stone, bark, cloth",
}
"""The names of the methods on the page."""

TABLES: dict[str, tuple[Any, str]] = {
    "mrf": (mrf.Options, "synth"),
    "multires": (multires.Options, "synth"),
    "pyramid": (pyramid.Options, "synth"),
    "fill": (mrf.Options, "fill"),
    "extend": (mrf.Options, "extend"),
    "classify": (classifier.Options, "classify"),
}
"""The options and the command of each set of controls: for the methods, and for the jobs with a single method."""


def controls(name: str) -> list[dict[str, Any]]:
    """Return the controls of one of `TABLES`: each option of the command that is a word, a switch, or has a slider.

    A control has ``name``, ``group``, ``label``, ``hint``, ``kind`` (``"words"``, ``"whole"``, ``"number"`` or
    ``"switch"``) and ``default``, None if the method decides. Words have ``valid``, pairs of a value and its label.
    Numbers have ``least``, None if there is none; ``span``, the least, the largest and the step of the slider;
    ``empty``, the text of an empty field; and ``usual``, its number, None if that is not fixed.
    """
    options, job = TABLES[name]
    made = [_control(name, one, one.default_of(job)) for name, one in table(options).items() if job in one.shown]
    return [control for control in made if "kind" in control]


def _control(name: str, one: Option, default: Any) -> dict[str, Any]:
    """Return the control of an option; without ``kind`` if it has none."""
    hint = f"{one.help}. Empty: {one.none}." if one.none else f"{one.help}."
    label = one.label or name.replace("_", " ").capitalize()
    control = {"name": name, "group": one.group, "label": label, "hint": hint, "default": default}
    kind = one.kind
    if isinstance(kind, Choice) or (isinstance(kind, Other) and default in kind.valid):
        return control | {"kind": "words", "valid": [[word, word] for word in kind.valid]}
    if is_flag(kind) and default is not None:
        return control | {"kind": "switch"}
    if isinstance(kind, (Whole, Number)) and one.slider:
        control |= {"least": kind.least if isfinite(kind.least) else None, "span": one.slider}
        found = re.match(r"[\d.]+(?=;|$)", one.none)
        control["usual"] = float(found[0]) if found else default
        control["empty"] = "" if default is not None else f"automatic: {found[0]}" if found else "automatic"
        return control | {"kind": "whole" if isinstance(kind, Whole) else "number"}
    return control

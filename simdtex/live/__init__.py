# SPDX-License-Identifier: BSD-3-Clause
"""The live page, which shows and controls a run while it executes, in a browser or in a notebook.

``page/`` has its style sheet and the parts of its ES module, which `script` joins, because a notebook takes one text.
"""

from importlib.resources import files

PAGE = files("simdtex.live") / "page"
"""The folder with the files of the page."""

PARTS = ("signals", "connections", "elements", "view", "painting", "why", "inside", "page")
"""The parts of the page's module, in order."""


def script() -> str:
    """Return the page's ES module."""
    return "".join((PAGE / f"{part}.js").read_text(encoding="utf-8") for part in PARTS)


def style() -> str:
    """Return the page's style sheet."""
    return (PAGE / "live.css").read_text(encoding="utf-8")

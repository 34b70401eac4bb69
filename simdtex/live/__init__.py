# SPDX-License-Identifier: BSD-3-Clause
"""The live page: a run is watched and steered while it goes on, in a browser or in a notebook.

`Session` is what a page talks to, whatever carries the messages: `simdtex.live.server` a WebSocket, and
`simdtex.live.widget` the connection of a notebook. The page itself is in ``page/``: a style sheet, and the parts of an
ES module, which `script` puts together, because a notebook takes one text.
"""

from importlib.resources import files

PAGE = files("simdtex.live") / "page"
"""The folder with the files of the page."""

PARTS = ("connections", "elements", "view", "inside", "page")
"""The parts of the page's module, in order."""


def script() -> str:
    """Return the page's ES module."""
    return "".join((PAGE / f"{part}.js").read_text(encoding="utf-8") for part in PARTS)


def style() -> str:
    """Return the page's style sheet."""
    return (PAGE / "live.css").read_text(encoding="utf-8")

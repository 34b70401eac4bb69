# SPDX-License-Identifier: BSD-3-Clause
"""The options of the method ``pyramid``, and their defaults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from simdtex.methods.pyramid.pyramids import KINDS, check_kind
from simdtex.options import build, check, integer, real_array, words


@dataclass(frozen=True)
class Options:
    """The options of the method ``pyramid``. Its outputs always tile.

    Parameters
    ----------
    pyramid : {"steerable", "laplacian"}
        Whose histograms are matched. A solid texture matches a Laplacian pyramid in any case, and with
        ``"steerable"`` the steerable pyramids of all its slices as well.
    levels : int, optional
        Of the pyramids, 0 or more. None: as many as leave a low-pass residue of 8 pixels a side, of the sample and of
        the output.
    orientations : int
        Of the steerable pyramid: 1, 2, 4 or 6.
    iterations : int
        Times that subbands and pixels are matched, 0 or more.
    match : {"rank", "lookup"}
        Histograms by rank, exactly; or by the paper's tables.
    bins : int
        Of these tables, 2 to 4096.
    edges : {"reflect", "wrap"}
        How the sample continues beyond its border when it is analysed.
    color : {"decorrelate", "channels"}
        Match the decorrelated channels, or the channels as they are.
    start : array, optional
        What to begin with in place of noise, of the output's shape, with the sample's channels.
    """

    pyramid: str = words("steerable", *KINDS)
    levels: int | None = integer(None, 0)
    orientations: int = integer(4, 1)
    iterations: int = integer(5, 0)
    match: str = words("rank", "rank", "lookup")
    bins: int = integer(256, 2, 4096)
    edges: str = words("reflect", "reflect", "wrap")
    color: str = words("decorrelate", "decorrelate", "channels")
    start: ArrayLike | None = None

    def __post_init__(self) -> None:
        """Check every value."""
        check(self)
        check_kind(self.pyramid, self.levels, self.orientations)
        if self.start is not None:
            real_array("start", self.start)


def make_options(**given: Any) -> Options:
    """Options from what the user gave; unknown names are a TypeError that lists the valid ones."""
    return build(Options, "pyramid", given)

# SPDX-License-Identifier: BSD-3-Clause
"""The stages of a run as pictures: every level, every sweep, and what each has beside its picture."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from simdtex.io.image import read, to_display, write
from simdtex.model.colours import heat
from simdtex.report.folder import earlier_files
from simdtex.report.sheet import (
    FRAME_SIDE,
    FRAMES,
    animation,
    contact_sheet,
    enlarged,
    fitted,
    reduction,
)
from simdtex.run import Progress

__all__ = ["StageWriter"]

Picture = NDArray[np.uint8]

_STAGE = re.compile(
    r"((temperature|candidates)-)?level\d+(-sweep\d+)?\.png|iteration\d+\.png|sheet\.png|animation\.gif"
)

_NUMBERS = re.compile(r"level(?P<level>\d+)(-sweep(?P<sweep>\d+))?|iteration(?P<iteration>\d+)")


class StageWriter:
    """A callback that writes the pictures of a run into a folder as they are completed.

    Of ``mrf`` it writes ``level{l}-sweep{k}.png`` and ``temperature-level{l}-sweep{k}.png`` at the
    end of each sweep; of ``multires``, ``level{l}.png`` and ``candidates-level{l}.png`` at the end
    of each level, brighter where a pixel had more candidates, on a logarithmic scale from 1; of
    ``pyramid``, ``iteration{k}.png``, of a block its middle slice. On `finish` it writes
    ``sheet.png``, the last picture of each level or iteration at one size, and ``animation.gif``.
    Pictures are 8-bit previews; each file is written whole or not at all.

    Parameters
    ----------
    folder : path
        Made at the first picture. It may exist if it is empty or holds only the stages of an
        earlier run; those are removed at the first picture, but for what `onward` keeps.
    limits : (low, high), optional
        The values shown as black and white where pixels are not uint8: the sample's smallest and
        largest. By default those of the first picture.
    onward : callable, optional
        Says, at the first picture, whether the run goes on from a checkpoint: the stages before that picture then stay
        and have their places on the sheet and in the animation.

    Raises
    ------
    ValueError
        `folder` is a file, holds other files, or its parent is missing or not writable.

    Notes
    -----
    Holds at most 200 frames of at most 512 pixels a side for the animation, 160 MB in colour.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        *,
        limits: tuple[float, float] | None = None,
        onward: Callable[[], bool] | None = None,
    ) -> None:
        self.folder = Path(folder)
        self._onward = onward
        self._limits = limits
        self._earlier = earlier_files(self.folder, "the stages", _stages_in)
        self._started = False
        self._frames: list[tuple[int, Picture]] = []
        self._every = 1
        self._seen = 0
        self._last: dict[str, tuple[int, Picture]] = {}
        self._shapes: dict[int, tuple[int, ...]] = {}

    def __call__(self, progress: Progress) -> None:
        """Write one stage if it is complete; else do nothing."""
        name = progress.stage
        if name is None:
            return
        self._start(name)
        values = progress.picture()
        if self._limits is None and values.dtype.kind != "b":
            self._limits = float(values.min()), float(values.max())
        picture = to_display(values, self._limits)
        write(self.folder / f"{name}.png", _savable(picture))
        for kind, values in progress.maps().items():
            write(self.folder / f"{kind}-{name}.png", heat(values))
        self._keep(progress.level, progress.caption, picture)

    def finish(self) -> None:
        """Write the sheet and the animation of what was seen; nothing if nothing was."""
        if not self._last:
            return
        finest, reference = list(self._last.values())[-1]

        def shown(level: int, picture: Picture) -> Picture:
            # a frame's pixel stands for a block of its own level's sites, 2^level pixels apart
            step = 2.0 ** (level - finest) * self._reduction(level) / self._reduction(finest)
            return enlarged(picture, (reference.shape[0], reference.shape[1]), step)

        sheet = [
            ("{}: {} x {}".format(caption, *self._shapes[level]), shown(level, picture))
            for caption, (level, picture) in self._last.items()
        ]
        contact_sheet(sheet, self.folder / "sheet.png")
        frames = [shown(level, frame) for level, frame in self._frames]
        animation([*frames, reference], self.folder / "animation.gif")

    def _reduction(self, level: int) -> int:
        return reduction(self._shapes[level], FRAME_SIDE)

    def _start(self, name: str) -> None:
        if self._started:
            return
        self._started = True
        onward = self._onward is not None and self._onward()
        before = [path for path in self._earlier if onward and _precedes(path.stem, name)]
        try:
            self.folder.mkdir(exist_ok=True)
            for path in self._earlier:
                if path not in before:
                    path.unlink(missing_ok=True)
            for path in sorted(before, key=lambda path: _turn(path.stem)):
                if found := _NUMBERS.fullmatch(path.stem):
                    level = int(found["level"] or 0)
                    caption = f"iteration {int(found['iteration'])}" if found["iteration"] else f"level {level}"
                    self._keep(level, caption, read(path).pixels)
        except OSError as error:
            raise ValueError(f"the folder {self.folder} cannot be written ({error.strerror}): choose another") from None

    def _keep(self, level: int, caption: str, picture: Picture) -> None:
        small = fitted(picture, FRAME_SIDE)
        self._last[caption] = level, small
        self._shapes[level] = picture.shape[:2]
        if self._seen % self._every == 0:
            self._frames.append((level, small))
        if len(self._frames) == FRAMES:  # every other one from here on
            self._frames, self._every = self._frames[::2], self._every * 2
        self._seen += 1


def _turn(stem: str) -> tuple[int, int]:
    """Where a stage of this name comes among the others: coarse levels first."""
    found = _NUMBERS.search(stem)
    if found is None:
        return 1, 0
    return -int(found["level"] or 0), int(found["sweep"] or found["iteration"] or 0)


def _precedes(stem: str, name: str) -> bool:
    """Whether a file is of a stage before another."""
    return _NUMBERS.search(stem) is not None and _turn(stem) < _turn(name)


def _stages_in(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if _STAGE.fullmatch(path.name)]


def _savable(picture: Picture) -> Picture:
    # a PNG has at most four channels
    return picture if picture.ndim == 2 or picture.shape[2] <= 4 else picture[..., :3]

# SPDX-License-Identifier: BSD-3-Clause
"""The stages of a run as pictures: every level, sweep or iteration."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import PIL.Image

from simdtex.io.image import to_display, write
from simdtex.model.colours import temperature_colours
from simdtex.report.folder import earlier_files
from simdtex.report.sheet import FRAME_SIDE, Picture, animation, contact_sheet, enlarged, fitted, reduction
from simdtex.run import Progress

__all__ = ["StageWriter"]

FRAMES = 200  # most frames of the animation

_STAGE = re.compile(r"level(?P<level>\d+)(-sweep(?P<sweep>\d+))?|iteration(?P<iteration>\d+)")
_FILE = re.compile(rf"((temperature|candidates)-)?({_STAGE.pattern})\.png|sheet\.png|animation\.gif")


class StageWriter:
    """A callback that writes the pictures of a run into a folder as they are completed.

    Of ``mrf`` it writes ``level{l}-sweep{k}.png`` and ``temperature-level{l}-sweep{k}.png`` at the
    end of each sweep; of ``multires``, ``level{l}.png`` and ``candidates-level{l}.png`` at the end
    of each level, brighter where a pixel had more candidates, on a logarithmic scale from 1; of
    ``pyramid``, ``iteration{k}.png``, of a block its middle slice. `finish` writes ``sheet.png``,
    the last picture of each level or iteration at one size, and ``animation.gif``. Pictures are
    8-bit previews; each file is written whole or not at all.

    Parameters
    ----------
    folder : path
        Made at the first picture. It may exist if it is empty or holds only the stages of an
        earlier run; those are removed at the first picture unless `resumed` keeps them.
    limits : (low, high), optional
        The values shown as black and white if pixels are not uint8: the sample's smallest and
        largest. By default those of the first picture.
    resumed : callable, optional
        Returns, at the first picture, whether the run continues from a checkpoint. If so, the stages before that
        picture stay, and are shown on the sheet and in the animation.

    Raises
    ------
    ValueError
        `folder` is a file, holds other files, or its parent is missing or not writable.

    Notes
    -----
    `finish` holds at most 200 frames of at most 512 pixels a side, 160 MB.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        *,
        limits: tuple[float, float] | None = None,
        resumed: Callable[[], bool] = lambda: False,
    ) -> None:
        self.folder = Path(folder)
        self._limits, self._resumed = limits, resumed
        self._earlier = earlier_files(self.folder, "the stages", lambda name: bool(_FILE.fullmatch(name)))
        self._started = False

    def __call__(self, progress: Progress) -> None:
        """Write one stage if it is complete; else do nothing."""
        name = progress.stage
        if name is None:
            return
        if not self._started:
            self._start(name)
        values = progress.picture()
        if self._limits is None and values.dtype.kind != "b":
            self._limits = float(values.min()), float(values.max())
        picture = to_display(values, self._limits)
        write(self.folder / f"{name}.png", picture if picture.ndim == 2 else picture[..., :4])
        for kind, values in progress.maps().items():
            write(self.folder / f"{kind}-{name}.png", temperature_colours(values))

    def _start(self, name: str) -> None:
        """Make the folder, and remove the files of an earlier run."""
        resumed, self._started = self._resumed(), True
        try:
            self.folder.mkdir(exist_ok=True)
            for path in self._earlier:
                if not (resumed and _STAGE.search(path.stem) and _order(path.stem) < _order(name)):
                    path.unlink(missing_ok=True)
        except OSError as error:
            raise ValueError(f"the folder {self.folder} cannot be written ({error.strerror}): choose another") from None

    def finish(self) -> None:
        """Write the sheet and the animation of the pictures in the folder; nothing if there was no stage."""
        found = [path for path in self.folder.glob("*.png") if _STAGE.fullmatch(path.stem)] if self._started else []
        if not found:
            return
        paths = sorted(found, key=lambda path: _order(path.stem))
        finest, shape = _level(paths[-1]), _read(paths[-1]).shape[:2]
        reference = fitted(_read(paths[-1]), FRAME_SIDE).shape[:2]

        def shown(path: Path) -> Picture:
            # a pixel stands for 2^(level - finest) pixels each way, less the reductions of both pictures
            picture = _read(path)
            step = 2.0 ** (_level(path) - finest) * reduction(picture.shape, FRAME_SIDE) / reduction(shape, FRAME_SIDE)
            return enlarged(fitted(picture, FRAME_SIDE), reference, step)

        last = {_caption(path): path for path in paths}
        sheet = [("{}: {} x {}".format(caption, *_read(path).shape), shown(path)) for caption, path in last.items()]
        contact_sheet(sheet, self.folder / "sheet.png")
        every = -(-len(paths) // FRAMES)
        animation(map(shown, paths[::-every][::-1]), self.folder / "animation.gif")


def _order(stem: str) -> tuple[int, int]:
    """Return the place of a stage among the others, coarse levels first."""
    found = _STAGE.search(stem)
    assert found
    return -int(found["level"] or 0), int(found["sweep"] or found["iteration"] or 0)


def _level(path: Path) -> int:
    return -_order(path.stem)[0]


def _caption(path: Path) -> str:
    """Return the name of the level or iteration of a stage."""
    level, number = _order(path.stem)
    return f"iteration {number}" if path.stem.startswith("iteration") else f"level {-level}"


def _read(path: Path) -> Picture:
    with PIL.Image.open(path) as picture:
        return np.array(picture.convert("RGB"))

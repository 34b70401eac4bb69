# SPDX-License-Identifier: BSD-3-Clause
"""The stages of a run as pictures: every level, sweep or iteration."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

from simdtex.io.atomic import earlier_files
from simdtex.io.image import to_display, write
from simdtex.model.colours import temperature_colours
from simdtex.run import Progress

_FILE = re.compile(r"((temperature|candidates)-)?(level\d+(-sweep\d+)?|iteration\d+)\.png")


class StageWriter:
    """A callback that writes the pictures of a run into a folder as they are completed.

    With ``mrf`` it writes ``level{l}-sweep{k}.png`` and ``temperature-level{l}-sweep{k}.png`` at the end of each sweep;
    with ``multires``, ``level{l}.png`` and ``candidates-level{l}.png`` at the end of each level, brighter where a pixel
    had more candidates, on a logarithmic scale from 1; with ``pyramid``, ``iteration{k}.png``, for a block its middle
    slice. Pictures are 8-bit previews; each file is written completely or not at all.

    The folder is made at the first picture. It may exist if it is empty or holds only the stages of an earlier run,
    which are removed at the first picture unless ``resumed()``: the run continues from a checkpoint. ``limits`` are the
    values shown as black and white if pixels are not uint8, by default those of the first picture. Raises ValueError if
    the folder cannot be used.
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
            self._start()
        values = progress.picture()
        if self._limits is None and values.dtype.kind != "b":
            self._limits = float(values.min()), float(values.max())
        picture = to_display(values, self._limits)
        write(self.folder / f"{name}.png", picture if picture.ndim == 2 else picture[..., :4])
        for kind, values in progress.maps().items():
            write(self.folder / f"{kind}-{name}.png", temperature_colours(values))

    def _start(self) -> None:
        """Make the folder, and remove the files of an earlier run."""
        self._started = True
        try:
            self.folder.mkdir(exist_ok=True)
            for path in [] if self._resumed() else self._earlier:
                path.unlink(missing_ok=True)
        except OSError as error:
            raise ValueError(f"the folder {self.folder} cannot be written ({error.strerror}): choose another") from None

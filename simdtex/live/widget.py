# SPDX-License-Identifier: BSD-3-Clause
"""`Live`: the live page in a notebook, over the connection to its kernel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.io.image import check_sample
from simdtex.live import script, style
from simdtex.live.job import Picture
from simdtex.live.results import Result
from simdtex.live.session import Session
from simdtex.machine import Machine, open_machine

try:
    from anywidget import AnyWidget
except ModuleNotFoundError:

    class AnyWidget:  # type: ignore[no-redef]
        """A placeholder for the missing package, so that the name can be imported."""

        def __init__(self) -> None:
            raise ValueError(
                "simdtex.Live needs a package of its own; install it with: pip install 'simdtex[notebook]'"
            )


class Live(AnyWidget):
    """The live page in a notebook: synthesise, fill, extend and classify interactively.

    It is the page of ``simdtex live``, in Jupyter, JupyterLab, marimo and VS Code; the kernel's process runs the jobs.
    It needs the extra ``notebook``: ``pip install 'simdtex[notebook]'``.

    Parameters
    ----------
    sample : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array, optional
        The first picture; None starts without one.
    channel_axis : int, optional
        The axis of the sample that holds channels; None for a grey sample.
    name : str
        Name of its file in the command line that repeats a result.
    device : str, optional
        As in `simdtex.synthesize`.

    Attributes
    ----------
    image : array or None
        The latest result, in the sample's type, channels last; for a classification its labels.
    source : (rows, cols, 2) int32 array or None
        The source map of the latest result.
    maps : dict
        Further maps in its arrangement, by name.
    command : str
        The command line that makes the same bytes.

    Raises
    ------
    ValueError, TypeError
        The sample is invalid.
    simdtex.DeviceError
        No device matches, or none is usable.

    Notes
    -----
    Cost: a frame takes 4 bytes for each pixel of the view. At most 30 per second are sent, no faster than the page can
    show them, and making them takes at most a quarter of a run.

    Examples
    --------
    >>> from skimage import data
    >>> import simdtex
    >>> live = simdtex.Live(data.gravel()[:128, :128])
    >>> live.image is None
    True
    >>> live.wait().shape
    (256, 256)
    """

    _esm = script()
    _css = style()

    _session: Session | None = None  # None if the sample is invalid

    def __init__(
        self,
        sample: ArrayLike | None = None,
        *,
        channel_axis: int | None = None,
        name: str = "sample.png",
        device: str | Machine | None = None,
    ) -> None:
        picture = None
        if sample is not None:
            pixels = check_sample(sample, channel_axis)
            grey = channel_axis is None
            picture = Picture(name, np.array(pixels[..., 0] if grey else pixels), None if grey else -1)
        super().__init__()
        session = self._session = Session(self.send, open_machine(device), picture)
        self.on_msg(lambda _, message, buffers: session.receive(message, buffers))

    def wait(self, timeout: float | None = None) -> NDArray[Any]:
        """Return the latest result when no run is left; start a first run if there is no result.

        Raises ValueError if there is no sample or the job was refused, and TimeoutError after ``timeout`` seconds.
        """
        if self._session is None:
            raise ValueError("there is no picture yet; give one first")
        return self._session.wait(timeout).image

    @property
    def _latest(self) -> Result | None:
        results = self._session.results if self._session else {}
        return results[max(results)] if results else None

    @property
    def image(self) -> NDArray[Any] | None:  # noqa: D102
        return self._latest.image if self._latest else None

    @property
    def source(self) -> NDArray[np.int32] | None:  # noqa: D102
        return self._latest.source if self._latest else None

    @property
    def maps(self) -> dict[str, NDArray[Any]]:  # noqa: D102
        return dict(self._latest.maps) if self._latest else {}

    @property
    def command(self) -> str:  # noqa: D102
        return self._latest.job.command if self._latest else ""

    def close(self) -> None:
        """End the run, and remove the widget."""
        if self._session:
            self._session.close()
        super().close()

# SPDX-License-Identifier: BSD-3-Clause
"""How a notebook shows a result: its picture, and its arrangement."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from typing import Any

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from simdtex.io.image import pillow_bytes, to_display
from simdtex.model.colours import source_colours

SIDE = 512
"""The longest side of a picture that is shown, pixels; of larger ones every n-th row and column is."""


def as_html(made: NDArray[Any] | None, source: NDArray[np.int32] | None, statistics: dict[str, Any]) -> str:
    """Return HTML with a picture and its source map side by side, and the statistics below them.

    ``made`` is (rows, cols, channels) or (depth, rows, cols, channels); of a solid the middle slice is shown. The
    source map of several samples is not shown.
    """
    figures = []
    if made is not None:
        picture = _thinned(made[len(made) // 2] if made.ndim == 4 else made)
        figures.append(_figure(to_display(picture), "the middle slice" if made.ndim == 4 else "the picture"))
    if source is not None and source.shape[-1] == 2:
        sample = [int(last) + 1 for last in source.reshape(-1, 2).max(axis=0)]
        figures.append(_figure(source_colours(_thinned(source), (sample[0], sample[1])), "where from in the sample"))
    facts = [f"{statistics['seconds']:.2f} s"] if "seconds" in statistics else []
    facts += [f"on {statistics['device']}"] if "device" in statistics else []
    facts += [f"seed {statistics['seed']}"] if "seed" in statistics else []
    row = f'<div style="display:flex;flex-wrap:wrap;gap:1em">{"".join(figures)}</div>'
    return f"<div>{row}<p>{escape(', '.join(facts))}</p></div>"


def _thinned(array: NDArray[Any]) -> NDArray[Any]:
    step = -(-max(array.shape[:2]) // SIDE)
    return array[::step, ::step]


def _figure(picture: NDArray[np.uint8], caption: str) -> str:
    flat = picture[..., 0] if picture.shape[2] < 3 else picture[..., :3]
    data = b64encode(pillow_bytes(PIL.Image.fromarray(np.ascontiguousarray(flat)), "PNG")).decode()
    image = f'<img src="data:image/png;base64,{data}" alt="{caption}">'
    return f'<figure style="margin:0">{image}<figcaption>{caption}</figcaption></figure>'

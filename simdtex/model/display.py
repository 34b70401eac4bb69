# SPDX-License-Identifier: BSD-3-Clause
"""HTML of results for notebooks: the picture and its source map, and the choice at a site."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from simdtex.io.image import pillow_bytes, to_display
from simdtex.model.colours import source_colours

SIDE = 512
"""The longest side of a displayed picture, pixels; larger pictures are displayed by every n-th row and column."""

CELL = 12
"""Side of a neighbour in the picture of a neighbourhood, pixels."""


def as_html(made: NDArray[Any] | None, source: NDArray[np.int32] | None, statistics: dict[str, Any]) -> str:
    """Return HTML with a picture and its source map side by side, and the statistics below them.

    ``made`` is (rows, cols, channels) or (depth, rows, cols, channels); a solid is shown by its middle slice. A source
    map with several samples is not shown.
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


def choice_html(
    offsets: NDArray[np.int32],
    near: NDArray[Any],
    certain: NDArray[np.float32],
    candidates: NDArray[Any],
    probability: NDArray[np.float64],
    captions: Sequence[str],
    text: str,
) -> str:
    """Return HTML with a neighbourhood, candidates with bars of their probabilities, and a text below them.

    ``offsets`` (N, 2 or 3) of the neighbours, of which those in the site's layer are shown; ``near`` (N, channels)
    pixels, the whiter the less ``certain`` (N,), 0 to 1; ``candidates`` (n, 1 + N, channels) pixels of each candidate
    and of its neighbours; ``probability`` and ``captions`` (n,).
    """
    layer = np.flatnonzero((offsets[:, :-2] == 0).all(1) & offsets.any(1))
    radius = int(np.abs(offsets[:, -1]).max())
    row, col = (offsets[layer, -2:] + radius).T
    limits = (min(near.min(), candidates.min()), max(near.max(), candidates.max()))
    shown, own = to_display(near[layer], limits), to_display(candidates, limits)

    def square(pixels: NDArray[np.uint8], centre: NDArray[np.uint8]) -> NDArray[np.uint8]:
        cells = np.full((2 * radius + 1, 2 * radius + 1, pixels.shape[-1]), 255, np.uint8)
        cells[row, col], cells[radius, radius] = pixels, centre
        return cells.repeat(CELL, 0).repeat(CELL, 1)

    known = np.clip(certain[layer, None], 0, 1)
    faded = np.rint(shown * known + 255 * (1 - known)).astype(np.uint8)
    figures = [
        _figure(square(faded, np.full(faded.shape[-1], 255, np.uint8)), "the neighbourhood; white is not certain")
    ]
    for one, share, caption in zip(own, probability, captions, strict=True):
        bar = f'<div style="height:6px;background:#36c;width:{100 * share:.3g}%"></div>'
        figure = _figure(square(one[1 + layer], one[0]), escape(caption))
        figures.append(f'<div style="max-width:14em">{figure}{bar}</div>')
    row_of = f'<div style="display:flex;flex-wrap:wrap;gap:1em">{"".join(figures)}</div>'
    return f"<div>{row_of}<pre>{escape(text)}</pre></div>"


def _thinned(array: NDArray[Any]) -> NDArray[Any]:
    step = -(-max(array.shape[:2]) // SIDE)
    return array[::step, ::step]


def _figure(picture: NDArray[np.uint8], caption: str) -> str:
    flat = picture[..., 0] if picture.shape[2] < 3 else picture[..., :3]
    data = b64encode(pillow_bytes(PIL.Image.fromarray(np.ascontiguousarray(flat)), "PNG")).decode()
    image = f'<img src="data:image/png;base64,{data}" alt="{caption}">'
    return f'<figure style="margin:0">{image}<figcaption>{caption}</figcaption></figure>'

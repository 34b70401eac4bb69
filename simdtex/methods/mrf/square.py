# SPDX-License-Identifier: BSD-3-Clause
"""The sample in the layout for reading the square around a neighbourhood: kernels/mrf/square.h."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Machine
from simdtex.model.lattice import in_three_axes
from simdtex.model.sample import Places, Sample

LANES = 16
"""Number of partial sums of a distance: one for each column, modulo 16, of the square around a neighbourhood."""

TAIL = 64
"""Values after the last one that vectors may read, without an effect."""


class Square(NamedTuple):
    """A level's candidates and their neighbours, side by side.

    ``at`` (n,) int32 are the candidates' places in ``levels`` (C, plane) float32, the sample's working levels with the
    columns that are a level's step apart side by side, and one plane more if the first ``hot`` channels are the
    categories of a variable, their number from 1; ``order`` of the neighbourhood; ``row_stride`` is the distance there
    from one row of the lattice to the next, ``layer_stride`` from one layer to the next; ``disc`` (side, columns)
    float32, or (side, side, columns) of a volume, is 1 on the neighbourhood. ``looks`` (N + 1, 2) int32 are the lane of
    each neighbour in ``disc`` and its offset in ``levels``, in an order in which each is far from earlier ones, since
    close ones differ alike; the site itself is the last. If ``at`` has all places of a level, they have ``cols``
    columns, and every ``runs``-th of a row is side by side in ``levels``.
    """

    at: Array
    levels: Array
    row_stride: int
    layer_stride: int
    disc: Array
    looks: Array
    cols: int
    runs: int
    order: int = 0
    hot: int = 0

    def distance(
        self,
        numbers: NDArray[np.integer],
        x: NDArray[np.number[Any]],
        u: NDArray[np.float32],
        offsets: NDArray[np.int32],
    ) -> NDArray[np.float32]:
        """Return equation (12) for each candidate, (slots, S), infinity in empty slots, summed as on a device.

        ``numbers`` (slots, S or 1) are -1 in empty slots; ``x`` (N, C, S) are grey levels of the neighbours, and ``u``
        (N, C or 1, S) their confidences; both have one more, the site itself, if there are guides.
        """
        if len(x) > len(offsets):
            offsets = np.pad(offsets, ((0, 1), (0, 0)))
        layer, row, col = in_three_axes(offsets).T
        there, columns = self.at[np.maximum(numbers, 0)], (col + col.max()) % LANES
        apart = layer * self.layer_stride + row * self.row_stride + col
        lanes = []
        for lane in range(LANES):
            d = np.zeros((len(numbers), x.shape[-1]), np.float32)
            inside = np.flatnonzero(columns == lane)
            for k in inside[np.lexsort((col[inside], row[inside], layer[inside]))]:
                for c, y in enumerate(self.levels[: x.shape[1]]):
                    e = ((x[k, c] - y[there + apart[k]]) * u[k, c if u.shape[1] > 1 else 0]).astype(np.float64)
                    d = (e * e + d).astype(np.float32)  # fits 53 bits, so it equals the device's fma: see Sample
            lanes.append(d)
        while len(lanes) > 1:
            half = len(lanes) // 2
            lanes = [a + b for a, b in zip(lanes[:half], lanes[half:], strict=True)]
        return np.where(numbers < 0, np.float32(np.inf), lanes[0])


def square_of(machine: Machine, sample: Sample, places: Places, every: bool = False) -> Square:
    """Return the candidates of a level in this layout, or with ``every`` all its places."""
    offsets, step = places.offsets, places.spacing
    radius, rows, cols = int(offsets.max()), sample.rows, sample.cols
    side, columns = 2 * radius + 1, -(-(2 * radius + 1) // LANES) * LANES
    disc = np.zeros((side,) * (offsets.shape[1] - 1) + (columns,), np.float32)
    disc[tuple(offsets.T + radius)] = 1
    wide = -(-cols // step)
    around = ((0, 0), (0, 0), (0, wide * step - cols))
    working = np.pad(sample.working.reshape(-1, rows, cols), around, mode="edge").reshape(-1, rows, wide, step)
    levels = working.swapaxes(2, 3).reshape(len(working), -1).astype(np.float32)
    if hot := sample.hot:
        levels = np.concatenate([levels, 1 + (levels[:hot] > 0).argmax(0)[None]], dtype=np.float32)
    positions = places.everywhere if every else places.positions
    row, at = np.divmod(positions, np.int32(cols))
    at = (row * np.int32(step) + at % np.int32(step)) * np.int32(wide) + at // np.int32(step)
    strides = np.array([sample.layer * step * step * wide, step * step * wide, 1])
    itself = np.zeros((1, offsets.shape[1]), np.int32)
    far = np.concatenate([offsets[_far_apart(offsets.tobytes(), offsets.shape[1])], itself])
    looks = np.stack([np.ravel_multi_index(tuple(far.T + radius), disc.shape), in_three_axes(far) @ strides], 1)
    across = places.col.size if every else positions.size
    return Square(
        machine.put(at),
        machine.put(np.pad(levels, ((0, 0), (0, columns + TAIL)))),
        int(strides[1]),
        int(strides[0]),
        machine.put(disc),
        machine.put(looks.astype(np.int32)),
        across,
        min(step // places.step, across) if every else 1,
        int((offsets**2).sum(1).max()),
        hot,
    )


@lru_cache(maxsize=16)
def _far_apart(offsets: bytes, axes: int) -> NDArray[np.int32]:
    """Return an order of neighbours in which each is far from earlier ones."""
    place = np.frombuffer(offsets, np.int32).reshape(-1, axes).astype(np.int64)
    gap = np.full(len(place), np.iinfo(np.int64).max)
    order = []
    for _ in place:
        order.append(int(gap.argmax()))
        gap = np.minimum(gap, ((place - place[order[-1]]) ** 2).sum(1))
        gap[order] = -1
    return np.array(order, np.int32)

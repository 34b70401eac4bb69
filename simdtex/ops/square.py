# SPDX-License-Identifier: BSD-3-Clause
"""The sample in the layout for reading the square around a neighbourhood: kernels/common/square.h."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Machine
from simdtex.model.lattice import parts_of
from simdtex.model.sample import Places, Sample
from simdtex.ops.arithmetic import fma32

LANES = 16
"""Number of partial sums of a distance: one for each column, modulo 16, of the square around a neighbourhood."""


class Square(NamedTuple):
    """A level's candidates and their neighbours, side by side.

    ``at`` (n,) int32 are the candidates' places in ``levels`` (C, plane) uint16, the sample's working levels with the
    columns that are a level's step apart side by side; ``down`` is the distance there from one row of the lattice to
    the next, ``deep`` from one layer to the next; ``disc`` (side, columns) float32, for a volume (side, side, columns),
    is 1 on the neighbourhood.
    """

    at: Array
    levels: Array
    down: int
    deep: int
    disc: Array

    def distance(
        self,
        numbers: NDArray[np.integer],
        x: NDArray[np.number[Any]],
        u: NDArray[np.float32],
        offsets: NDArray[np.int32],
    ) -> NDArray[np.float32]:
        """Return equation (12) for each candidate, (slots, S), infinity in empty slots, summed as on a device.

        ``numbers`` (slots, S) are -1 in empty slots; ``x`` (N, C, S) are grey levels of the neighbours, and ``u`` (N, C
        or 1, S) their confidences; both have one more if the site itself is among ``offsets``.
        """
        radius = int(offsets[:, 1].max())
        layer, line, _ = parts_of(offsets)
        d = np.zeros((LANES, *numbers.shape), np.float32)
        for k in np.lexsort((offsets[:, 1], offsets[:, 0])):
            col = offsets[k, 1]
            apart = layer[k] * self.deep + line[k] * self.down + col
            for c, y in enumerate(self.levels):
                certain = u[k, c if u.shape[1] > 1 else 0]
                e = (x[k, c] - y[self.at[np.maximum(numbers, 0)] + apart].astype(np.float32)) * certain
                lane = (col + radius) % LANES
                d[lane] = fma32(e, e, d[lane])
        while len(d) > 1:
            d = d[: len(d) // 2] + d[len(d) // 2 :]
        return np.where(numbers < 0, np.float32(np.inf), d[0])


def square_of(machine: Machine, sample: Sample, places: Places) -> Square:
    """Return the candidates of a level in this layout."""
    offsets, step = places.offsets, places.spacing
    radius, rows, cols = int(offsets[:, 1].max()), sample.rows, sample.cols
    side, columns = 2 * radius + 1, -(-(2 * radius + 1) // LANES) * LANES
    disc = np.zeros((side, side, columns), np.float32)
    disc[tuple(part + radius for part in parts_of(offsets))] = 1
    disc = disc if sample.layer else disc[radius]
    wide = -(-cols // step)
    around = ((0, 0), (0, 0), (0, wide * step - cols))
    working = np.pad(sample.working.reshape(-1, rows, cols), around, mode="edge").reshape(-1, rows, wide, step)
    levels = working.swapaxes(2, 3).reshape(len(working), -1)
    row, col = np.divmod(places.positions, np.int32(cols))
    at = (row * np.int32(step) + col % np.int32(step)) * np.int32(wide) + col // np.int32(step)
    return Square(
        machine.put(at),
        machine.put(np.pad(levels, ((0, 0), (0, columns)))),  # whole vectors are read, even at the end
        step * step * wide,
        sample.layer * step * step * wide,
        machine.put(disc),
    )

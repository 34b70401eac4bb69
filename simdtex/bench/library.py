# SPDX-License-Identifier: BSD-3-Clause
"""A machine of library code: what a good NumPy and SciPy program takes for the same jobs.

The methods are the same programs. The operations that cost most are handed to libraries: distances to one matrix
product (BLAS), filters to FFTs, the candidates of ``multires`` to a k-d tree, sorting to NumPy's fastest sort; all
others are those of the reference. Results are as good, but not the same bits.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from simdtex.machine.interface import Operation, P, R
from simdtex.machine.reference import Reference
from simdtex.model.lattice import Grid
from simdtex.model.sample import Candidates
from simdtex.ops import lcpdf
from simdtex.ops.candidates import Sampled, Structure, candidates
from simdtex.ops.charge import charge
from simdtex.ops.coherence import coherence, continuing, sources
from simdtex.ops.commit import commit
from simdtex.ops.filters import filters
from simdtex.ops.neighbourhood import Field, Neighbourhoods, neighbourhood
from simdtex.ops.relax import Everything, Relaxation, copied, relax, relax_apart
from simdtex.ops.sort import sort
from simdtex.ops.steerable import steerable_join, steerable_split
from simdtex.ops.temperature import temperature

TABLE = 2**26
"""Values of the right factor of a matrix product that are made at a time."""

QUERIES = 4096
"""Parent structures that the k-d tree is asked for at a time: their candidates are lists."""


class Library(Reference):
    """Runs operations by NumPy and SciPy.

    Parameters
    ----------
    threads : int
        Of FFTs and k-d trees. Those of BLAS are set where its process begins, see `simdtex.bench.elsewhere`.
    scratch : int
        Bytes that distances may take at a time.

    Attributes
    ----------
    used : collections.Counter
        Name of an operation that a library did -> how often.
    """

    name = "library code (NumPy, SciPy)"

    def __init__(self, threads: int = 1, scratch: int = 2**27) -> None:
        super().__init__(scratch)
        self.threads = threads
        self.used: Counter[str] = Counter()
        self._factor: tuple[Any, bool, NDArray[np.float32]] | None = None
        self._tree: tuple[Any, int, cKDTree] | None = None
        self._responses: dict[tuple[bytes, tuple[int, ...]], NDArray[np.complex64]] = {}
        self._by: dict[Any, Any] = {
            lcpdf.distance: self.distance,
            coherence: self.coherence,
            relax: self.relax,
            relax_apart: self.relax_apart,
            candidates: self.candidates,
            filters: self.filters,
            steerable_split: self.split,
            steerable_join: self.join,
            sort: self.sort,
        }

    def run(self, operation: Operation[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the library's way of it, or the twin."""
        own = self._by.get(operation)
        if own is None:
            result: R = super().run(operation, *args, **kwargs)
            return result
        self.launches += 1
        self.used[own.__name__] += 1
        result = own(*args, **kwargs)
        return result

    def chunk(self, candidates: int, neighbours: int, channels: int, stored: bool = True) -> int:
        """Sites whose distances and neighbourhoods fit the scratch memory."""
        return max(1, self.scratch // (4 * (candidates + 3 * neighbours * (1 + channels))))

    # -- mrf ------------------------------------------------------------------------------------------------

    def distance(self, near: Neighbourhoods, candidates: Candidates, *_: Any) -> lcpdf.Distances:
        """Equation (12) as one matrix product, (S, K) x (K, candidates).

        sum (x u - y u)^2 = sum (x u)^2 - 2 sum (u^2 x) y + sum u^2 y^2, grey levels less their middle for the sake of
        rounding. K is N C + N + 1; where all confidences are 1, the last sum is made once and K is N C + 2.
        """
        confidence, weighted, sites = near
        middle = np.float32(np.ptp(candidates.pixels) / 2)
        u = confidence[:, :sites]
        xu = weighted[:, :, :sites] - middle * u[:, None]
        cold = bool((u == 1).all())
        own: NDArray[np.float32] = (xu * xu).sum((0, 1))
        squares = np.ones((1, sites), np.float32) if cold else u * u
        left = np.concatenate([(xu * u[:, None] * np.float32(-2)).reshape(-1, sites), squares, own[None]])
        left = np.ascontiguousarray(left.T)
        distance = np.empty((sites, candidates.size), np.float32)
        step = max(1, TABLE // left.shape[1])
        for first in range(0, candidates.size, step):
            right = self._right(candidates, middle, cold, first, min(step, candidates.size - first))
            np.matmul(left, right, out=distance[:, first : first + step])
        return lcpdf.Distances(distance.T, None, sites)

    def _right(
        self, candidates: Candidates, middle: np.float32, cold: bool, first: int, count: int
    ) -> NDArray[np.float32]:
        """The right factor; kept where it is made as a whole."""
        if self._factor and self._factor[0] is candidates and self._factor[1] == cold:
            return self._factor[2]
        at = candidates.positions[first : first + count] + candidates.reach[:, None]
        y = np.stack([plane[at] - middle for plane in candidates.pixels], 1)  # (N, C, count)
        squares = (y * y).sum(1)
        squares = squares.sum(0, keepdims=True) if cold else squares
        factor = np.concatenate([y.reshape(-1, count), squares, np.ones((1, count), np.float32)])
        if count == candidates.size:
            self._factor = candidates, cold, factor
        return factor

    def coherence(
        self,
        distances: lcpdf.Distances,
        candidates: Candidates,
        sites: NDArray[np.int32],
        field: Field,
        offsets: NDArray[np.int32],
        grid: Grid,
        favour: np.float32,
        *_: Any,
    ) -> lcpdf.Distances:
        """As the twin does it, but only the favoured distances are touched."""
        p = continuing(candidates, sources(grid.neighbours(sites, offsets), field))
        k, s = np.nonzero(p >= 0)
        distances.distance[p[k, s], s] *= favour  # one that is proposed twice is written twice, with the same value
        return distances

    def relax_apart(
        self, sites: NDArray[np.int32], field: Field, weighed: NDArray[np.int32], relaxation: Relaxation, turn: int
    ) -> tuple[lcpdf.Relaxed, NDArray[np.uint16]]:
        """The relaxation of the twin, but for the distances of the exact search."""
        if not isinstance(relaxation.proposal, Everything):
            return relax_apart.reference(sites, field, weighed, relaxation, turn)
        grid, offsets, candidates = relaxation.grid, relaxation.offsets, relaxation.proposal.candidates
        found = self.distance(neighbourhood.reference(sites, field, offsets, grid), candidates)
        found = self.coherence(found, candidates, sites, field, offsets, grid, relaxation.favour)
        found = charge.reference(found, candidates, relaxation.price)
        if relaxation.novelty > 0:
            copied(found.distance, candidates, sites, field, offsets, grid, relaxation.novelty)
        numbers = np.arange(candidates.size)[:, None]
        relaxed = relaxation.choice.taken(numbers, found, sites, relaxation, turn)
        return relaxed, temperature.reference(sites, field, offsets, grid, relaxation.xi)

    def relax(
        self,
        sites: NDArray[np.int32],
        steps: NDArray[np.int64],
        field: Field,
        weighed: NDArray[np.int32],
        relaxation: Relaxation,
        turn: int,
    ) -> Field:
        """Step after step."""
        for begin, end in steps.tolist():
            here = sites[begin:end]
            field = commit.reference(field, here, *self.relax_apart(here, field, weighed, relaxation, turn))
        return field

    # -- multires -------------------------------------------------------------------------------------------

    def candidates(
        self, structure: Structure, sampled: Sampled, level: int, first: int, end: int, match: bool, seed: int
    ) -> Sampled:
        """A ball of a k-d tree over parent structures, each feature in units of its threshold, in the maximum norm.

        Where a node lacks the child that is wanted, at the ragged edge of a sample, its nearest child stands in.
        """
        (rows, cols), above = structure.lattice[level, :2], structure.lattice[level + 1]
        site = np.arange(first, end)
        i, j = np.divmod(site, sampled.lattice[level, 1])
        p, q = i % rows, j % cols
        number = (i // rows * above[0] + p // 2) * sampled.lattice[level + 1, 1] + j // cols * above[1] + q // 2
        _, which, inverse = np.unique(number, return_index=True, return_inverse=True)
        tree, own = self._parents(structure, level), self._own(structure, sampled, level, i[which], j[which])
        rng = np.random.default_rng([seed, level, first])
        node, count = np.empty(site.size, np.intp), np.empty(site.size, np.intp)
        order = np.argsort(inverse, kind="stable")
        bounds = np.searchsorted(inverse[order], np.arange(len(own) + 1))
        for query in range(0, len(own), QUERIES):
            last = min(len(own), query + QUERIES)
            found = tree.query_ball_point(own[query:last], 1.0, np.inf, workers=self.threads, return_sorted=False)
            lengths = np.array([len(one) for one in found])
            begin = np.cumsum(lengths) - lengths
            flat = np.concatenate([np.asarray(one, np.intp) for one in found])
            here = order[bounds[query] : bounds[last]]
            mine = inverse[here] - query
            node[here] = flat[begin[mine] + (rng.random(here.size) * lengths[mine]).astype(np.intp)]
            count[here] = lengths[mine]
        row, col = np.divmod(node, above[1])
        child = (p % 2, q % 2) if match else rng.integers(0, 2, (2, site.size))
        row, col = np.minimum(2 * row + child[0], rows - 1), np.minimum(2 * col + child[1], cols - 1)
        at = sampled.lattice[level, 2] + site
        sampled.source[at] = row * cols + col
        sampled.counts[at] = np.stack([count if match else 4 * count, np.zeros_like(count)], -1)
        return sampled

    def _parents(self, structure: Structure, level: int) -> cKDTree:
        """The tree of the sample's parent structures from a level up; the last one made is kept."""
        if not self._tree or self._tree[0] is not structure or self._tree[1] != level:
            rows, cols = structure.lattice[level + 1, :2]
            row, col = np.divmod(np.arange(rows * cols), cols)
            parts = []
            for k in range(level + 1, len(structure.lattice)):
                up, (_, wide, start, _ragged) = k - level - 1, structure.lattice[k]
                node = start + (row >> up) * wide + (col >> up)
                parts.append(structure.features[node] / (structure.threshold[k] + 0.5))
            self._tree = structure, level, cKDTree(np.concatenate(parts, 1))
        return self._tree[2]

    def _own(
        self, structure: Structure, sampled: Sampled, level: int, i: NDArray[Any], j: NDArray[Any]
    ) -> NDArray[np.float64]:
        """The output's parent structures at pixels (i, j) of a level."""
        tile, parts = structure.lattice[level, :2], []
        for k in range(level + 1, len(structure.lattice)):
            rows, cols, start, _ragged = structure.lattice[k]
            row, col = (
                i // tile[0] * rows + (i % tile[0] >> k - level),
                j // tile[1] * cols + (j % tile[1] >> k - level),
            )
            node = start + sampled.source[sampled.lattice[k, 2] + row * sampled.lattice[k, 1] + col]
            parts.append(structure.features[node] / (structure.threshold[k] + 0.5))
        return np.concatenate(parts, 1)

    # -- filters and sorting ----------------------------------------------------------------------------------

    def filters(
        self, picture: NDArray[np.int32], band: NDArray[np.int32], taps: NDArray[np.int32], torus: bool
    ) -> NDArray[np.int32]:
        """Equation (7) by FFT."""
        found = self._correlated(picture, taps * np.float32(2.0**-14), torus)  # (count, planes, rows, cols)
        every = np.concatenate([band[None], np.rint(found).astype(np.int32)])
        return np.ascontiguousarray(every.transpose(2, 3, 1, 0).reshape(band[0].size, -1))

    def split(self, picture: NDArray[np.int32], taps: NDArray[np.float32], torus: bool, step: int) -> NDArray[np.int32]:
        """The bands of a steerable pyramid by FFT."""
        found = self._correlated(picture, taps, torus)[..., ::step, ::step]
        return np.asarray(np.rint(found), np.int32)

    def join(self, terms: Any, shape: tuple[int, int], torus: bool) -> NDArray[np.int32]:
        """Their sum by FFT; of mirrored pictures, which no synthesis joins, by the twin."""
        if not torus:
            whole: NDArray[np.int32] = steerable_join.reference(terms, shape, torus)
            return whole
        total: Any = np.complex64(0)
        for bands, taps, step in terms:
            responses = self._response(taps, shape)
            for band, response in zip(bands, responses, strict=True):
                spread = np.zeros((len(band), *shape), np.float32)
                spread[:, ::step, ::step] = band
                total = total + scipy.fft.rfft2(spread, workers=self.threads) * np.conj(response)
        return np.asarray(np.rint(scipy.fft.irfft2(total, s=shape, workers=self.threads)), np.int32)

    def _correlated(self, picture: NDArray[Any], taps: NDArray[Any], torus: bool) -> NDArray[np.float32]:
        """A picture (planes, rows, cols) correlated with each of the taps, (count, planes, rows, cols)."""
        (_, rows, cols), reach = picture.shape, taps.shape[1] // 2
        values = picture.astype(np.float32)
        margin = 0 if torus else reach
        if margin:
            values = np.pad(values, ((0, 0), (margin, margin), (margin, margin)), mode="reflect")
        shape = values.shape[1:]
        spectrum = scipy.fft.rfft2(values, workers=self.threads)
        made = [
            scipy.fft.irfft2(spectrum * response, s=shape, workers=self.threads)
            for response in self._response(taps, shape)
        ]
        return np.stack(made)[..., margin : margin + rows, margin : margin + cols]

    def _response(self, taps: NDArray[Any], shape: tuple[int, ...]) -> NDArray[np.complex64]:
        """What a correlation with each of the taps multiplies a spectrum by."""
        key = taps.tobytes(), shape
        if key not in self._responses:
            reach = taps.shape[-1] // 2
            spread = np.zeros((len(taps), *shape))
            for (f, a, b), tap in np.ndenumerate(taps):
                spread[f, (a - reach) % shape[0], (b - reach) % shape[1]] += tap
            self._responses[key] = np.conj(np.fft.rfft2(spread)).astype(np.complex64)
        return self._responses[key]

    def sort(self, values: NDArray[np.int32], first: NDArray[np.int32]) -> NDArray[np.int32]:
        """NumPy's fastest sort; equal values come in any order."""
        return np.asarray(np.argsort(values, axis=1), np.int32)

"""The candidates whose neighbourhoods are most like that of each."""

import numpy as np
import plain
from cases import REFERENCE, assert_same_bits, problem

from simdtex.ops import lcpdf
from simdtex.ops.neighbourhood import Field, neighbourhood
from simdtex.ops.similar import most_similar, similar


def found_by(machine, p, k):
    """(n, k), by a machine."""
    positions = p.sample.positions(p.offsets, p.grid.spacing, p.phases, p.edges)
    reach = p.sample.reach(p.offsets, p.grid.spacing)
    return np.asarray(machine.get(most_similar(machine, p.sample, positions, reach, p.candidates(machine), k)))


def test_none_are_wanted():
    assert found_by(REFERENCE, problem(9, order=2), 0).shape == (1, 1)


def test_similar_candidates_are_the_nearest_neighbourhoods(machine):
    p = problem(9, order=5, channels=2, edges="reflect", sample_shape=(8, 7))
    reach = plain.offsets(p.order)
    positions, (a, b) = p.positions(), p.padded()
    patches = np.array([[plane[i + di, j + dj] for di, dj in reach for plane in (a, b)] for i, j in positions], float)
    d = ((patches[:, None] - patches[None]) ** 2).sum(-1)
    np.fill_diagonal(d, np.inf)
    expected = np.argsort(d, 1, kind="stable")[:, :3]
    for m in (REFERENCE, machine):
        assert_same_bits(found_by(m, p, 3), expected.astype(np.int32))


def test_similar_candidates_come_in_pieces(machine):
    p = problem(10, order=2, edges="reflect", sample_shape=(11, 12))
    candidates, (_, _, offsets) = p.candidates(machine), p.on(machine)
    found = machine.put(np.full((candidates.size, 2), -1, np.int32))
    field = Field(*(machine.put(a) for a in p.field))
    near = neighbourhood(machine, machine.put(p.sites), field, offsets, p.grid)
    some = lcpdf.distance(machine, near, candidates)._replace(sites=5)
    filled = np.asarray(machine.get(similar(machine, some, candidates, 40, found)))
    assert (filled[40:45] >= 0).all()
    assert (np.delete(filled, range(40, 45), 0) == -1).all()

"""The candidates of a pixel and the draw of one of them, against De Bonet's pseudo-code as plain loops."""

from typing import NamedTuple

import numpy as np
import pytest
from cases import REFERENCE, analyse, assert_same_bits, host, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_multires import as_large

import simdtex
from simdtex import random
from simdtex.methods.multires.analysis import lattice, structure_of
from simdtex.methods.multires.candidates import Sampled, Structure, candidates
from simdtex.methods.multires.options import Options

ALL = 2**32 - 1
SMALL = (-1, 0, 1, 2), (0, 1, 2, ALL)  # what features and thresholds are drawn from
EXTREME = (-(2**31), 1 - 2**31, -1, 0, 2**31 - 1), (0, 1, 2**31 - 1, 2**31, ALL - 2, ALL - 1, ALL)


class Problem(NamedTuple):
    """Two pyramids of which only the output's top level has been sampled: everything in NumPy arrays."""

    tiles: list  # rows and columns of the sample's levels, the finest first
    shapes: list  # of the output's
    structure: Structure
    sampled: Sampled

    @property
    def top(self):
        return len(self.tiles) - 1

    def on(self, machine):
        """Structure and Sampled as arrays of a machine."""
        return Structure(*map(machine.put, self.structure)), Sampled(*map(machine.put, self.sampled))

    def pixels(self, level):
        return self.shapes[level][0] * self.shapes[level][1]

    def own(self, level):
        """Where a level is in ``source`` and ``counts``."""
        begin = sum(self.pixels(below) for below in range(level))
        return slice(begin, begin + self.pixels(level))


def problem(seed=0, *, tile=(7, 6), shape=(17, 13), levels=4, features=3, kinds=4, of=SMALL):
    """A problem from a seed: nodes of a few kinds, some with a feature of their own; any sources at the top."""
    rng = np.random.default_rng(seed)
    tiles = [tile]
    while len(tiles) < levels:
        tiles.append(((tiles[-1][0] + 1) // 2, (tiles[-1][1] + 1) // 2))
    shapes = [
        tuple(n // m * k + -(-(n % m) // 2**level) for n, m, k in zip(shape, tile, own, strict=True))
        for level, own in enumerate(tiles)
    ]
    nodes = sum(r * c for r, c in tiles[1:])
    measured = rng.choice(of[0], (kinds, features))[rng.integers(0, kinds, nodes)]
    measured = np.where(rng.random(measured.shape) < 0.2 / features, rng.choice(of[0], measured.shape), measured)
    threshold = rng.choice(of[1], (levels, features))
    structure = Structure(measured.astype(np.int32), threshold.astype(np.uint32), lattice(tiles, 1))
    total = sum(r * c for r, c in shapes)
    source, counts = np.full(total, -1, np.int32), np.tile(np.array([1, 0], np.int32), (total, 1))
    row, col = (  # of any place at the top, if as many pixels are below it as below the pixel
        np.where(i % n < n - 1, rng.integers(0, max(1, n - 1), shapes[-1]), rng.integers(0, n, shapes[-1]))
        for i, n in zip(np.indices(shapes[-1]), tiles[-1], strict=True)
    )
    source[-row.size :] = (row * tiles[-1][1] + col).ravel()
    return Problem(tiles, shapes, structure, Sampled(source, counts, lattice(shapes, 0)))


def any_problem(seed, features):
    """A problem of any small shape, with one to five levels above the finest."""
    rng = np.random.default_rng(seed)
    return problem(
        seed,
        tile=tuple(rng.integers(1, 10, 2).tolist()),
        shape=tuple(rng.integers(1, 15, 2).tolist()),
        levels=int(rng.integers(2, 7)),
        features=int(rng.choice(features)),
        kinds=int(rng.integers(1, 6)),
        of=(SMALL, EXTREME)[rng.integers(2)],
    )


def problems(features=(1, 2, 3)):
    return st.builds(any_problem, st.integers(0, 2**32 - 1), st.just(features))


seeds = st.integers(0, 2**64 - 1)
phases = pytest.mark.parametrize("match", [True, False], ids=["match", "free"])


def sampled_on(machine, p, match, seed, ends=lambda pixels: [pixels]):
    """Source and counts of all levels, each sampled by the operation after the ones above it."""
    structure, sampled = p.on(machine)
    for level in reversed(range(p.top)):
        first = 0
        for end in ends(p.pixels(level)):
            sampled = candidates(machine, structure, sampled, level, range(first, end), match, seed)
            first = end
    return host(machine, sampled[:2])


def one_level(p, source, level, match, seed=0, machine=REFERENCE):
    """Source and counts of one level, given the sources of those above."""
    p = p._replace(sampled=p.sampled._replace(source=source))
    structure, sampled = p.on(machine)
    found = candidates(machine, structure, sampled, level, range(p.pixels(level)), match, seed)
    return [a[p.own(level)] for a in host(machine, found[:2])]


class Plain:
    """The pseudo-code SynthesizePyramid, for one pixel, in Python numbers."""

    def __init__(self, p, source):
        self.p, self.threshold = p, p.structure.threshold.tolist()
        self.source = [source[p.own(level)].reshape(shape).tolist() for level, shape in enumerate(p.shapes)]
        rows, self.features = iter(p.structure.features.tolist()), [None]
        for shape in p.tiles[1:]:
            self.features.append([[next(rows) for _ in range(shape[1])] for _ in range(shape[0])])

    def parents(self, level, i, j):
        """(row, column) in the sample's levels above that the nodes above pixel (i, j) were copied from."""
        rows, cols = self.p.tiles[level]
        found = {}
        for v in range(level + 1, len(self.p.tiles)):
            r = i // rows * self.p.tiles[v][0] + i % rows // 2 ** (v - level)
            c = j // cols * self.p.tiles[v][1] + j % cols // 2 ** (v - level)
            found[v] = divmod(self.source[v][r][c], self.p.tiles[v][1])
        return found

    def similar(self, v, a, b):
        u, w = self.features[v][a[0]][a[1]], self.features[v][b[0]][b[1]]
        # Loop j for each feature
        return all(abs(x - y) <= threshold for x, y, threshold in zip(u, w, self.threshold[v], strict=True))

    def passes(self, level, own, x, y):
        """Whether all that is above (x, y) of a level is similar to `own`."""
        for v in range(self.p.top, level, -1):  # Loop v from top level downto i+1
            if not self.similar(v, (x // 2 ** (v - level), y // 2 ** (v - level)), own[v]):
                return False
        return True

    def candidates(self, level, i, j, match):
        """C, in the order of the scan."""
        own, found, (rows, cols) = self.parents(level, i, j), [], self.p.tiles[level]
        for x in range(rows):  # Loop (x, y) over the analysis level
            for y in range(cols):
                if match and not (self.in_place(level, 0, x, i % rows) and self.in_place(level, 1, y, j % cols)):
                    continue
                if self.passes(level, own, x, y):
                    found.append((x, y))
        path = range(self.p.top - level, -1, -1)  # parents before children, row by row
        return sorted(found, key=lambda q: [(q[0] >> up, q[1] >> up) for up in path])

    def in_place(self, level, axis, x, place):
        """Whether x stands as `place` does among its siblings, below a parent as large in the sample as its own."""
        return x % 2 == place % 2 and as_large(self.p.tiles[0][axis], level, place)[x // 2]

    def compared(self, level, i, j):
        """Nodes above the level whose own ancestors all pass."""
        own, count = self.parents(level, i, j), 0
        for v in range(level + 1, len(self.p.tiles)):
            count += sum(self.passes(v, own, r, c) for r, c in np.ndindex(*self.p.tiles[v]))
        return count


def check_against_loops(p, match, seed):
    """Every level, with any candidates, not only those that the operation draws, as the sources of those above."""
    rng = np.random.default_rng(seed % 2**32)
    source = p.sampled.source.copy()
    for level in reversed(range(p.top)):
        choice, counts = one_level(p, source, level, match, seed)
        loops, taken = Plain(p, source), []
        lo, hi, *_ = (bits.tolist() for bits in random.draw4(seed, level, 0, np.arange(p.pixels(level)), random.DRAW))
        for s, (i, j) in enumerate(np.ndindex(*p.shapes[level])):
            found = [x * p.tiles[level][1] + y for x, y in loops.candidates(level, i, j, match)]
            assert counts[s].tolist() == [len(found), loops.compared(level, i, j)]
            assert choice[s] == found[(hi[s] << 32 | lo[s]) * len(found) >> 64]
            taken.append(rng.choice(found))
        source[p.own(level)] = taken


@phases
@given(p=problems(), seed=seeds)
@settings(max_examples=40)
def test_the_reference_is_the_papers_loops(match, p, seed):
    check_against_loops(p, match, seed)


@phases
def test_the_reference_is_the_papers_loops_on_lattices_of_every_kind(match):
    for tile, shape, levels in (
        ((7, 5), (14, 10), 4),
        ((1, 9), (1, 20), 5),
        ((17, 3), (5, 8), 6),
        ((6, 7), (9, 16), 2),
    ):
        check_against_loops(problem(1, tile=tile, shape=shape, levels=levels, of=EXTREME), match, 2**40 + 5)


@given(
    *(st.tuples(st.integers(1, most), st.integers(1, most)) for most in (9, 12)),
    *(st.sampled_from(values) for values in ([None, 2], ["match", "free"], ["torus", "open"])),
    st.sampled_from([0.3, 0.77, 3.0]),
)
@settings(max_examples=15)
def test_a_run_draws_from_the_candidates_of_the_papers_loops(size, shape, channels, parity, boundary, alpha):
    options = {"parity": parity, "boundary": boundary, "alpha": alpha, "orientations": 1}
    sample, axis = texture(size, channels), None if channels is None else -1
    given = {"channel_axis": axis, "device": REFERENCE, "rng": 1, "method": "multires", "full_output": True}
    _, output = simdtex.synthesize(sample, shape, **given, **options)
    found = analyse(REFERENCE, sample.reshape(*size, -1), **options)
    stages = output.stages[::-1]
    own = [stage.source @ [cols, 1] for stage, (_, cols) in zip(stages, found.shapes, strict=True)]
    source, shapes = np.concatenate([level.ravel() for level in own]), [stage.candidates.shape for stage in stages]
    structure = structure_of(REFERENCE, found, Options(**options))
    loops = Plain(Problem(found.shapes, shapes, structure, Sampled(source, None, None)), source)
    for level, stage in enumerate(stages[:-1]):
        for i, j in np.ndindex(*shapes[level]):
            taken = loops.candidates(level, i, j, parity == "match")
            assert len(taken) == stage.candidates[i, j]
            assert tuple(stage.source[i, j]) in taken


@phases
@given(p=problems(features=(1, 9)), seed=seeds)
@settings(max_examples=40)
def test_a_device_has_the_references_bits(machine, match, p, seed):
    assert_same_bits(sampled_on(machine, p, match, seed), sampled_on(REFERENCE, p, match, seed))


@given(p=problems(), cuts=st.lists(st.floats(0, 1), max_size=4), match=st.booleans())
@settings(max_examples=20)
def test_any_division_into_ranges_changes_no_bit(machine, p, cuts, match):
    def ends(pixels):
        return [*sorted({int(cut * pixels) for cut in cuts} - {0, pixels}), pixels]

    whole = sampled_on(REFERENCE, p, match, 11)
    for m in (REFERENCE, machine):
        assert_same_bits(sampled_on(m, p, match, 11, ends), whole)


@phases
@pytest.mark.parametrize("closed", [1, 2])
def test_levels_that_are_not_compared_are_counted_all_the_same(machine, closed, match):
    """Every difference passes below a level; more candidates than places of the scan that are noted."""
    p = problem(9, tile=(37, 26), shape=(40, 31), levels=3, features=9, kinds=1)
    threshold = np.broadcast_to(np.where(np.arange(3)[:, None] < closed, ALL, 1), (3, 9)).astype(np.uint32)
    p = p._replace(structure=p.structure._replace(threshold=threshold))
    theirs = sampled_on(REFERENCE, p, match, 7)
    assert theirs[1][p.own(0)][:, 0].max() > 64
    assert_same_bits(sampled_on(machine, p, match, 7), theirs)

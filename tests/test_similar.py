"""The candidates whose neighbourhoods are most like that of each."""

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits, opencl, problem, texture
from simdtex.methods.mrf.synthesis import laid_out

import simdtex
from simdtex.methods.mrf.options import Options
from simdtex.ops import similar as module
from simdtex.ops.similar import most_similar


def found_by(machine, p, k, above=None):
    return most_similar(machine, p.offsets, p.candidates(machine), p.square(machine), p.lattice(), k, above)


def numbers(machine, p, k, above=None):
    """(n, k), by a machine."""
    return np.asarray(machine.get(found_by(machine, p, k, above).numbers))


def plainly(p):
    """Squared distances (n, n) of all candidates' neighbourhoods; infinity where two are too close."""
    reach, positions, planes = plain.offsets(p.order), p.positions(), p.padded()
    spread = p.grid.spacing
    patches = [[y[i + a * spread, j + b * spread] for a, b in reach for y in planes] for i, j in positions]
    patches = np.array(patches, float)
    d = ((patches[:, None] - patches[None]) ** 2).sum(-1)
    apart = np.abs(np.array(positions)[:, None] - np.array(positions)[None]).max(-1)
    step = spread if p.phases == "decimated" else 1
    return np.where(apart <= step, np.inf, d)


@pytest.mark.parametrize("how", [{"channels": 2}, {"spacing": 2, "phases": "decimated"}, {"edges": "whole"}], ids=str)
def test_similar_candidates_are_the_nearest_neighbourhoods(machine, how):
    p = problem(9, order=5, sample_shape=(12, 13), **{"edges": "reflect"} | how)
    expected = np.argsort(plainly(p), 1, kind="stable")[:, :3]
    for m in (REFERENCE, machine):
        assert_same_bits(numbers(m, p, 3), expected.astype(np.int32))


def test_where_there_are_too_few_it_is_the_candidate_itself(machine):
    p = problem(9, order=2, sample_shape=(3, 2), edges="reflect")
    d = plainly(p)
    for m in (REFERENCE, machine):
        found = numbers(m, p, 4)
        for n, row in enumerate(found):
            others = int(np.isfinite(d[n]).sum())
            assert row[others:].tolist() == [n] * (4 - others)


LARGE = {"order": 8, "sample_shape": (40, 36), "edges": "reflect", "phases": "decimated"}


def excess(p, found):
    """By how much the mean distance of what was found exceeds that of the nearest."""
    d = plainly(p)
    least = np.partition(d, found.shape[1], 1)[:, : found.shape[1]]
    return np.take_along_axis(d, found, 1).mean() / least.mean() - 1


@pytest.mark.parametrize("phases", ["decimated", "all"])
def test_a_fine_level_looks_where_the_one_above_found_some(machine, monkeypatch, phases):
    monkeypatch.setattr(module, "FEW", 600)
    coarse = problem(3, **LARGE | {"phases": phases}, spacing=2)
    fine = problem(3, **LARGE | {"phases": phases})._replace(sample=coarse.sample)
    tables = {m.name: numbers(m, fine, 3, found_by(m, coarse, 3)) for m in (REFERENCE, machine)}
    first, second = tables.values()
    assert_same_bits(first, second)
    rng = np.random.default_rng(1)
    at_random = rng.integers(0, len(first), first.shape)
    at_random = np.where(np.isfinite(np.take_along_axis(plainly(fine), at_random, 1)), at_random, first)
    assert excess(fine, first) < 0.6
    assert excess(fine, at_random) > 1


def test_the_coarsest_level_may_have_many(machine, monkeypatch):
    monkeypatch.setattr(module, "FEW", 100)
    p = problem(3, **LARGE)
    tables = [numbers(m, p, 2) for m in (REFERENCE, machine)]
    assert_same_bits(*tables)
    assert excess(p, tables[0]) < 0.7
    assert (tables[0] != np.arange(len(tables[0]))[:, None]).all(), "all have found some"


def test_a_runs_tables_are_made_once():
    """And a level has the same from whichever level a run begins."""
    pixels = texture((40, 44), 1, seed=2)
    options = Options(similar=2, order=2, levels=3)
    run, again = (laid_out(REFERENCE, pixels, (50, 48), options, 1) for _ in range(2))
    for number in (2, 1, 0):
        run.similar(number)
    assert run.similar(0) is run.similar(0)
    assert_same_bits(again.similar(0).numbers, run.similar(0).numbers)


def test_similar_candidates_change_a_run(cl_device):
    sample = texture((40, 44), seed=2)
    pictures = [
        simdtex.synthesize(sample, (50, 48), rng=1, device=opencl(cl_device), order=2, similar=k) for k in (0, 3)
    ]
    assert (pictures[0] != pictures[1]).any()

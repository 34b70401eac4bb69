"""Candidates by their features: every one is in a leaf, and no feature promises more distance than there is."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, opencl, problem
from test_nearest import flat, run

from simdtex.ops import leaves


def grown(p):
    candidates = p.candidates(REFERENCE)
    found = leaves.grow(REFERENCE, p.sample.working, candidates.positions[: candidates.size], candidates.reach, 255)
    return found, candidates


def around(p, candidates):
    where = candidates.positions[: candidates.size, None] + candidates.reach
    return np.concatenate([plane[where][..., None] for plane in p.sample.working.astype(float)], 2).reshape(
        len(where), -1
    )


@pytest.mark.parametrize(("order", "channels"), [(8, 1), (5, 3), (18, 1)])
def test_every_candidate_is_in_one_leaf_with_its_features(order, channels):
    p = problem(1, order=order, channels=channels, sample_shape=(41, 37))
    found, candidates = grown(p)
    n = candidates.size
    assert found.number % leaves.LANES == 0
    assert sorted(found.order[:n]) == list(range(n))
    features = (around(p, candidates) - found.middle) @ found.axes.astype(float)
    np.testing.assert_allclose(found.rows[:, :n].T, features[found.order[:n]], rtol=1e-6, atol=1e-3)
    assert (found.rows[:, n:] == leaves.FAR).all(), "what fills the last leaf is never near"
    here = found.rows[: leaves.FEW, :n]
    low, high = (np.repeat(found.box[:, side], leaves.LEAF, 1)[:, :n] for side in (0, 1))
    assert (low <= here).all()
    assert (here <= high).all()


def test_features_promise_no_more_than_the_distance():
    p = problem(2, order=18, sample_shape=(41, 37))
    found, candidates = grown(p)
    y = around(p, candidates)
    for s in (0, 100, 500):
        x = (y[s] + np.random.default_rng(s).integers(-20, 21, y.shape[1])).clip(0, 255)
        exact = ((x - y) ** 2).sum(1)
        mine = ((x - found.middle).astype(np.float32) @ found.axes).astype(np.float32)
        bound = ((found.rows[:, : candidates.size].T - mine) ** 2).sum(1)
        radius = (np.sqrt(exact) + found.blur)[found.order[: candidates.size]] ** 2 * 1.0001
        assert (bound <= radius).all()
        assert np.median(bound / np.maximum(1, exact[found.order[: candidates.size]])) > 0.3, (
            "and they promise something"
        )


def test_features_of_a_machine_err_less_than_the_blur():
    """Float32 sums in another order, of the largest values there are."""
    p = problem(3, order=18, sample_shape=(41, 37))
    found, _ = grown(p)
    x = np.random.default_rng(1).integers(0, 2, (500, 60)) * 255 - found.middle
    exact = x @ found.axes.astype(float)
    total = np.zeros((500, leaves.FEATURES), np.float32)
    for value, axis in zip(x.T.astype(np.float32), found.axes, strict=True):
        total += value[:, None] * axis
    error = np.sqrt(((total - exact) ** 2).sum(1))
    assert error.max() < found.blur / 4
    assert found.blur < 0.2


def test_few_candidates_and_small_or_huge_neighbourhoods_have_none():
    assert grown(problem(1, order=8, sample_shape=(24, 24)))[0] is None
    assert grown(problem(1, order=4, sample_shape=(40, 40)))[0] is None


FORMS = [{}, {"vector": 1, "step": 1, "split": 64}]


def warmed(p, most):
    """The problem with temperatures up to `most` / 1024, so that leaves serve its sites."""
    return p._replace(field=p.field._replace(temperature=(p.field.temperature * most // 1024).astype(np.uint16)))


@pytest.mark.parametrize("options", FORMS, ids=str)
@pytest.mark.parametrize("most", [100, 500])
def test_warm_sites_have_the_references_bits(cl_device, options, most):
    p = warmed(problem(4, order=8, channels=2, sample_shape=(31, 34), shape=(11, 13)), most)
    assert_same_bits(run(opencl(cl_device, **options), p), run(REFERENCE, p))


@pytest.mark.parametrize("options", FORMS, ids=str)
@pytest.mark.parametrize("levels", [1, 2, 4])
def test_many_equals_have_the_references_bits(cl_device, options, levels):
    """So many survive that the scan takes over, and at distance 0 the first must be found."""
    for seed, temperatures in enumerate(("zero", "mixed")):
        p = problem(seed, order=8, sample_shape=(44, 40), shape=(12, 12), temperatures=temperatures, count=37)
        p = flat(warmed(p, 300), levels)
        for strength in (0.0, 1.0):
            assert_same_bits(run(opencl(cl_device, **options), p, strength), run(REFERENCE, p, strength))


def test_leaves_spare_more_than_a_scan(cl_device, monkeypatch):
    p = problem(5, order=18, sample_shape=(60, 64), shape=(12, 12), temperatures="zero")
    machine, spared = opencl(cl_device), []
    for least in (leaves.LEAST, 2**30):
        monkeypatch.setattr(leaves, "LEAST", least)
        before = machine.spared
        assert_same_bits(run(machine, p), run(REFERENCE, p))
        spared.append(machine.spared - before)
    assert spared[0] > spared[1]

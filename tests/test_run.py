"""Progress, and the pace of launches."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import simdtex.run
from simdtex.run import Iterating, Progress, Relaxing, Sampling, paced


@pytest.fixture
def clock(monkeypatch):
    """A clock that stands still until it is moved on."""
    now = [0.0]
    monkeypatch.setattr(simdtex.run.time, "perf_counter", lambda: now[0])
    return now


@given(count=st.integers(0, 500), least=st.integers(1, 60))
def test_ranges_make_up_the_whole(count, least):
    ranges = list(paced(count, least))
    assert [first for first, _ in ranges] == [0, *(end for _, end in ranges)][: len(ranges)]
    assert (ranges[-1][1] if ranges else 0) == count
    assert all(end - first >= least for first, end in ranges[:-1])


def test_ranges_grow_to_a_tenth_of_a_second_and_shrink_again(clock):
    sizes = []
    for first, end in paced(100_000, 10):
        sizes.append(end - first)
        clock[0] += (end - first) * (1e-4 if first < 10_000 else 1e-3)
    assert sizes[:6] == [10, 40, 160, 640, 1000, 1000], "at most four times the last"
    assert sizes[-2] == 100


def test_a_first_range_that_takes_long_is_not_undercut(clock):
    sizes = []
    for first, end in paced(60, 20):
        sizes.append(end - first)
        clock[0] += 10
    assert sizes == [20, 20, 20]


def test_what_progress_says_of_itself():
    where = {"level": 2, "levels": 4, "fraction": 0.25, "image": lambda: np.zeros((3, 3))}
    plain = Progress(**where)
    assert (plain.doing, plain.stage, plain.maps()) == ("level 2", None, {})

    left = {"temperature_left": 0.125, "temperature": lambda: np.ones((3, 3)), "source": lambda: np.zeros((3, 3, 2))}
    left["explain"] = lambda row, col: None
    relaxing = [Relaxing(sweep=7, step=9, phase="relax", end_of_sweep=end, **left, **where) for end in (False, True)]
    assert relaxing[0].doing == "level 2, sweep 7, temperature 0.125"
    assert [one.stage for one in relaxing] == [None, "level2-sweep07"]
    assert list(relaxing[0].maps()) == ["temperature"]

    sampling = [
        Sampling(end_of_level=end, candidates=lambda: np.array([[1, 10, 100]]), **where) for end in (False, True)
    ]
    assert [one.stage for one in sampling] == [None, "level2"]
    np.testing.assert_array_equal(sampling[0].maps()["candidates"], [[0, 0.5, 1]])
    alone = Sampling(end_of_level=True, candidates=lambda: np.ones((2, 2), np.int32), **where)
    assert not alone.maps()["candidates"].any()

    iterating = [Iterating(iteration=3, iterations=5, end_of_iteration=end, **where) for end in (False, True)]
    assert iterating[0].doing == "iteration 3 of 5"
    assert [one.stage for one in iterating] == [None, "iteration03"]
    assert iterating[1].maps() == {}

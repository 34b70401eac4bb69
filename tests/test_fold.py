"""Every second pixel of a torus of any size, and back."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits

from simdtex.ops.pyramids import fold, unfold

SHAPES = [(1, 1), (1, 2), (2, 1), (3, 3), (4, 6), (5, 4), (4, 5), (7, 9), (8, 1)]


def picture(shape, planes=2):
    return np.random.default_rng(3).integers(-(2**20), 2**20, (planes, *shape)).astype(np.int32)


def folded(machine, x):
    return np.asarray(machine.get(fold(machine, machine.put(x))))


def unfolded(machine, x, shape):
    return np.asarray(machine.get(unfold(machine, machine.put(x), shape)))


@pytest.mark.parametrize("shape", SHAPES)
def test_every_second_pixel_around_the_torus(shape):
    x = picture(shape)
    rows, cols = (n if n % 2 else n // 2 for n in shape)
    expected = [[[x[p, 2 * i % shape[0], 2 * j % shape[1]] for j in range(cols)] for i in range(rows)] for p in (0, 1)]
    assert_same_bits(folded(REFERENCE, x), np.array(expected, np.int32))


@pytest.mark.parametrize("shape", SHAPES)
def test_back_is_the_transpose(shape):
    """<fold x, y> = <x, unfold y>, and folding what was unfolded gives it back."""
    x = picture(shape)
    y = folded(REFERENCE, x)
    back = unfolded(REFERENCE, y, shape)
    assert_same_bits(folded(REFERENCE, back), y)
    other = picture(y.shape[1:])
    left = (y.astype(np.int64) * other).sum()
    assert left == (x.astype(np.int64) * unfolded(REFERENCE, other, shape)).sum()


@pytest.mark.parametrize("shape", [(n, m) for n, m in SHAPES if n % 2 and m % 2])
def test_an_odd_torus_loses_no_pixel(shape):
    x = picture(shape)
    assert_same_bits(unfolded(REFERENCE, folded(REFERENCE, x), shape), x)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_device_has_the_references_bits(machine, shape):
    x = picture(shape)
    y = folded(REFERENCE, x)
    assert_same_bits(folded(machine, x), y)
    assert_same_bits(unfolded(machine, y, shape), unfolded(REFERENCE, y, shape))

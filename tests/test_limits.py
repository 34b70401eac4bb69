"""What a device can do at most: the kernels that are timed do what they say, so nothing of them can be left out."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, opencl

from simdtex.ops.limits import CHAINS, WIDTHS, copy, peak

VALUES = np.random.default_rng(1).random(16 * 13).astype(np.float32)


def run(machine, operation, *args):
    return np.asarray(machine.get(operation(machine, machine.put(VALUES), *args)))


def test_the_reference_makes_the_chains():
    expected = np.zeros(VALUES.size)
    for i in range(CHAINS):
        chain = VALUES + np.float64(i)
        for _ in range(3):
            chain = chain / 2 + np.float32(0.1)
        expected += chain
    found = run(REFERENCE, peak, 3, 1)
    assert found.dtype == np.float32
    assert abs(found - expected).max() < CHAINS * 4 * expected.max() * 2.0**-24


@pytest.mark.parametrize("width", WIDTHS)
def test_a_device_has_the_references_bits(machine, width):
    assert_same_bits(run(machine, peak, 7, width), run(REFERENCE, peak, 7, width))
    assert_same_bits(run(machine, copy, width), VALUES)


def test_the_shape_of_a_launch_changes_no_bit(cl_device):
    machine = opencl(cl_device, work_group=3)
    assert_same_bits(run(machine, peak, 7, 4), run(REFERENCE, peak, 7, 4))
    assert_same_bits(run(machine, copy, 4), VALUES)

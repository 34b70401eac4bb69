# SPDX-License-Identifier: BSD-3-Clause
"""The machines: bounds on memory, and what is said when a device has too little."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import simdtex
from simdtex.machine.devices import DeviceError
from simdtex.machine.interface import Operation
from simdtex.machine.opencl import OpenCL
from simdtex.machine.reference import Reference
from simdtex.model.sample import BLOCK


def test_a_machine_is_its_own_device():
    machine = Reference()
    assert simdtex.open_machine(machine) is machine


@given(st.integers(1, 200_000), st.integers(1, 300), st.integers(1, 4))
def test_a_piece_of_a_step_keeps_to_the_scratch_memory(candidates, neighbours, channels):
    machine = OpenCL.__new__(OpenCL)
    machine.scratch, machine.vector = 2**24, 16
    sites = machine.chunk(candidates, neighbours, channels)
    padded = -(-candidates // BLOCK) * BLOCK
    per_site = 4 * (padded + padded // BLOCK + neighbours * (1 + channels))
    assert sites % 16 == 0
    assert sites == 16 or (sites * per_site <= 2**24 and sites * padded * neighbours * channels <= 2e9)


def test_too_little_memory_is_said_before_the_work(any_device):
    machine = OpenCL(dataclasses.replace(any_device, memory=10_000))
    with pytest.raises(DeviceError, match=r"needs about \d+ MiB.*smaller size"):
        simdtex.synthesize(np.eye(16), (64, 64), order=1, device=machine)


def test_memory_that_runs_out_is_said_in_one_sentence(any_device):
    machine = OpenCL(any_device)
    greedy = Operation("greedy", lambda: None, lambda machine: machine.empty((2**46,), np.uint8))
    with pytest.raises(DeviceError, match="ran out of memory; give a smaller size"):
        greedy(machine)


def test_a_device_cannot_be_two_things():
    with pytest.raises(DeviceError):
        simdtex.open_machine("no such device")

"""The processor array: where pixels live, how neighbours get there, what is counted, and the same bits."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, opencl, texture

import simdtex
from simdtex.maspar.accounting import Account
from simdtex.maspar.array import ProcessorArray
from simdtex.maspar.machine import COSTS
from simdtex.methods.mrf.lcpdf import SiteChoice, window
from simdtex.model.array import parse_array
from simdtex.model.lattice import Grid, neighbourhood_offsets


def test_places_by_hand():
    """5 x 6 pixels on 2 x 4 PEs: three layers down, two across; or blocks of 3 x 2, the last column of PEs empty."""
    for mapping, sites, layers, pes in (
        ("cut-and-stack", [0, 3, 4, 5, 6, 12, 29], [0, 0, 1, 1, 0, 2, 5], [0, 3, 0, 1, 4, 0, 1]),
        ("hierarchical", [0, 1, 2, 5, 6, 18, 29], [0, 1, 0, 1, 2, 0, 3], [0, 0, 1, 2, 0, 4, 6]),
    ):
        array, grid = ProcessorArray(2, 4, mapping), Grid((5, 6))
        assert array.layers(grid) == (3, 2)
        assert [place.tolist() for place in array.place(np.array(sites, np.int32), grid)] == [layers, pes]


def test_shifts():
    """The walk brings all sites a neighbour with each move, which is longer at a coarser level."""
    array, offsets = ProcessorArray(16, 16), neighbourhood_offsets(1)
    assert [array.shifts(Grid.of((16, 16), 2**n), offsets) for n in range(4)] == [4, 8, 16, 32]
    offsets = np.array([[0, -1], [0, 1]], np.int32)  # left, and two moves to the right
    assert ProcessorArray(4, 4).shifts(Grid((8, 8)), offsets) == 3 * 4
    assert ProcessorArray(4, 4, "hierarchical").shifts(Grid((8, 8)), offsets) == 3 * 2  # half of them stay on their PE


def test_texts_that_name_an_array_and_those_that_name_none():
    for texts, message in (
        ("|128|0x4|4x0|4x4x4|-4x4|4.0x4|maspar|128X128| 4x4", "give rows x columns such as 128x128, or one of: maspar"),
        ("2048x2049", "is beyond 4194304; give a smaller one, say 128x128"),
        ("4x4:round-robin|4x4:", "choose one of: cut-and-stack, hierarchical"),
    ):
        for text in texts.split("|"):
            with pytest.raises(ValueError, match=message):
                parse_array(text)
    assert parse_array("2048x2048") == (2048, 2048, "cut-and-stack")
    assert parse_array("1k:hierarchical") == parse_array("maspar-mp1-1k:hierarchical") == (32, 32, "hierarchical")


def account(array, grid, steps, order=1, candidates=10):
    counted = Account(array, neighbourhood_offsets(order), 1)
    counted.begin(grid, candidates, SiteChoice(True, False, window(1.0, 255)))
    for sites in steps:
        counted.step(np.array(sites, np.int32))
    return counted.report()


def test_utilisation_by_hand():
    """A checkerboard of 4 x 4 pixels on 4 x 4 PEs: two steps of eight."""
    row, col = np.indices((4, 4))
    colors = [np.flatnonzero((row + col) % 2 == c) for c in (0, 1)]
    told = account(ProcessorArray(4, 4), Grid((4, 4)), colors)
    assert (told["steps"], told["passes"], told["layers"], told["sites"]) == (2, 2, 1, 16)
    assert (told["active"], told["utilisation"]) == (8, 0.5)
    assert told["moved"] == 2 * 4 * 2  # passes, shifts, words
    assert told["flop"] == 16 * 10 * 4 * 4  # sites, candidates, neighbours, operations
    assert told["instructions"]["float"] > 2 * 10 * 4 * 4  # of distances; and weights
    expected = sum(told["instructions"][kind] * cost.seconds for kind, cost in COSTS.items())
    assert told["model_seconds"] == pytest.approx(expected, rel=1e-12)


def test_a_layer_without_an_active_site_costs_nothing():
    """8 x 8 pixels on 4 x 4 PEs: a step in one quarter is one pass cut and stacked, four in blocks."""
    quarter = (np.arange(4)[:, None] * 8 + np.arange(4)).ravel()
    for mapping, passes, utilisation in [("cut-and-stack", 1, 1.0), ("hierarchical", 4, 0.25)]:
        told = account(ProcessorArray(4, 4, mapping), Grid((8, 8)), [quarter])
        assert (told["layers"], told["passes"], told["utilisation"]) == (4, passes, utilisation)


def run(device, **options):
    given = {"order": 2, "levels": 2, "rng": 3, "full_output": True, "search": "exact"} | options
    return simdtex.synthesize(texture((14, 13)), (11, 12), device=device, **given)


@pytest.mark.parametrize("search", ["exact", "coherent"])
def test_an_array_changes_no_byte_and_is_counted_alike_on_every_machine(machine, search):
    plain, output = run(REFERENCE, search=search)
    assert "accounting" not in output.statistics
    seen = []
    for device in (REFERENCE, machine):
        image, output = run(device, search=search, array="4x8:hierarchical")
        assert_same_bits(image, plain)
        seen.append(output.statistics["accounting"])
        assert seen[-1].pop("launches") > 0
    assert seen[0] == seen[1]
    assert seen[0]["array"] == "4x8" and seen[0]["mapping"] == "hierarchical"
    levels = output.statistics["levels"]
    assert seen[0]["steps"] == sum(level["steps"] for level in levels)
    assert seen[0]["sites"] == sum(level["relaxations"] for level in levels)
    if search == "exact":
        assert seen[0]["flop"] == 2 * sum(level["fma"] for level in levels)


def test_parts_of_a_step_that_scratch_memory_divides_are_one_simd_step(any_device):
    plain, _ = run(REFERENCE, schedule="synchronous")
    image, output = run(opencl(any_device, scratch=2**14), schedule="synchronous", array="16x16")
    assert_same_bits(image, plain)
    counted = output.statistics["accounting"]
    assert counted["passes"] == counted["steps"]


def test_device_seconds_are_measured_on_request(any_device):
    _, output = run(opencl(any_device))
    assert output.statistics["device_seconds"] is None
    _, output = run(opencl(any_device, profile=True))
    assert 0 < output.statistics["device_seconds"] < output.statistics["seconds"] * any_device.compute_units

"""Algorithm 1 on the processor array: the bytes of the engine, its steps, and the account of the same run."""

from collections import Counter

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, slow_but, texture

import simdtex
from simdtex import maspar
from simdtex.maspar.algorithm import ArrayLevel, Pass, Problem, Program, by_lane
from simdtex.maspar.array import MAPPINGS, ProcessorArray
from simdtex.maspar.machine import MP1
from simdtex.maspar.sites import Walk
from simdtex.methods.mrf.arithmetic import fma32
from simdtex.methods.mrf.lcpdf import SiteChoice, window
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.schedules.schedule import neighbours_in

DRAWN = {"relaxation": "gibbs", "pixel": "density", "free_sweeps": 0}
MODE = {"pixel": "density", "levels": 2}  # the coarsest level draws

CASES = {
    "of the array's size": ((12, 16), "12x16", {"order": 4}),
    "smaller": ((7, 6), "16x16", {"order": 5, "levels": 2, **DRAWN}),
    "larger, sides no multiple": ((11, 13), "4x5", {"order": 2, "free_sites": "all", "free_sweeps": 2}),
    "open, smaller": ((9, 10), "16x12", {"order": 4, "boundary": "open", "relaxation": "gibbs"}),
    "colour": ((7, 12), "4x4", {"order": 2, "channels": 3, **DRAWN}),
    "colours of the sample": ((8, 8), "8x8", {"order": 1, "channels": 3, "relaxation": "gibbs", "xi": -0.5}),
    "real numbers": ((8, 7), "8x4", {"order": 2, "dtype": np.float32, "bandwidth": 0.3, **DRAWN}),
    "nearest of ties": ((11, 9), "4x8", {"order": 2, "dtype": bool, "levels": 2}),
    "mode": ((11, 9), "4x8", {"order": 2, "dtype": bool, **MODE}),
    "mode of colours": ((8, 8), "8x8", {"order": 1, "channels": 3, "bandwidth": 0.3, **MODE}),
    "rows of several units of noise": ((5, 6), "4x4", {"order": 2, "levels": 2, "size": (9, 44), "phases": 64} | DRAWN),
    "one pixel": ((1, 1), "2x2", {"order": 1}),
}

LARGER = ("larger, sides no multiple", "colour", "mode", "nearest of ties")
"""Those of several pixels an element, which a mapping lays out in its way."""


def both(shape, array, device, mapping="cut-and-stack", channels=None, dtype=np.uint8, size=(14, 13), **options):
    """Image and output of the array, and of the engine with the same array to account for."""
    sample = texture(size, channels, dtype)
    given = {"channel_axis": channels and -1, "rng": 3, "device": device, "full_output": True}
    memory = {"memory": options.pop("memory", "64K")}
    ours = maspar.synthesize(sample, shape, array=array, mapping=mapping, **memory, **given, **options)
    theirs = simdtex.synthesize(sample, shape, array=f"{array}:{mapping}", preset="paper", **given, **options)
    return *ours, *theirs


@pytest.mark.parametrize(
    ("name", "mapping"), [*((name, MAPPINGS[0]) for name in CASES), *((name, MAPPINGS[1]) for name in LARGER[:3])]
)
def test_the_program_has_the_bytes_and_the_account_of_the_engine(name, mapping):
    shape, array, options = CASES[name]
    image, output, wanted, engine = both(shape, array, REFERENCE, mapping, **options)
    assert_same_bits(image, wanted)
    assert_same_bits(output.source, engine.source)
    assert not output.temperature.any()
    assert len(output.steps) == sum(level["steps"] for level in engine.statistics["levels"])
    for one, other in zip(output.stages, engine.stages, strict=True):
        assert_same_bits(one.image, other.image)
    if name in ("smaller", *LARGER):
        check_account(output, engine, options, name == "mode")


def check_account(output, engine, options, mode):
    """Assert that the engine's account is the execution's; the mode computes all distances again."""
    told, counted, seconds = engine.statistics["accounting"], Counter(), 0.0
    for section in output.counts.keys() - {"start", "colouring", "schedule"}:
        counted.update({kind: count.instructions for kind, count in output.counts[section].items()})
        seconds += sum(output.seconds[section].values())
    assert {kind: n for kind, n in told["instructions"].items() if n} == {kind: n for kind, n in counted.items() if n}
    assert told["model_seconds"] == pytest.approx(seconds, rel=1e-12)
    assert told["moved"] == counted["x-net"] and told["routed"] == counted["router"]
    if not mode:
        each = 4 * len(neighbourhood_offsets(options["order"])) * options.get("channels", 1)  # and 15 to add the lanes
        assert output.counts["distance"]["float"].active * each == told["flop"] * (each + 15)
    assert told["passes"] == sum(bool(layer.any()) for step in output.steps for layer in step.active)


@pytest.mark.parametrize(
    "name", slow_but(["mode of colours"], ["larger, sides no multiple", "colour", "mode of colours"])
)
def test_the_program_has_the_same_bytes_on_devices(machine, name):
    shape, array, options = CASES[name]
    image, output, wanted, engine = both(shape, array, machine, "hierarchical", **options)
    assert_same_bits(image, wanted)
    assert_same_bits(output.source, engine.source)


def test_distances_are_summed_lane_by_lane_and_row_by_row(machine):
    """Of one candidate, whose distance is the least: the order of the sum is seen in its bits, seldom in a picture."""
    rng, grid, offsets = np.random.default_rng(1), Grid((8, 8)), neighbourhood_offsets(18)
    offsets = offsets[by_lane(offsets)]
    sample, x, t = rng.integers(0, 256, len(offsets)), rng.integers(0, 256, (8, 8)), rng.integers(0, 1024, (8, 8))
    lanes = np.zeros((16, 8, 8), np.float32)
    for (i, j), y in sorted(zip(offsets.tolist(), sample, strict=True)):
        e = (np.roll(x, (-i, -j), (0, 1)) - y) * (1 - np.roll(t, (-i, -j), (0, 1)) / 1024)
        lanes[j + 4] = fma32(e, e, lanes[j + 4])
    while len(lanes) > 1:
        lanes = lanes[: len(lanes) // 2] + lanes[len(lanes) // 2 :]
    icm, number, own = SiteChoice(False, False, window(1.0, 255)), np.zeros(1, np.int32), np.zeros((1, 1), np.float32)
    level = ArrayLevel(0, grid, icm, number, own, sample[:, None, None].astype(np.float32), number)
    for device in (REFERENCE, machine):
        mp1 = MP1(device, ProcessorArray(8, 8), (8, 8))
        program = Program(mp1, Problem(np.zeros((2, 1), np.int32), offsets, 18, -1, 0))
        program.state.data = device.put(np.stack([x, t], -1).reshape(1, 64, 2).astype(np.int32))
        program.temperature = program.state[1]
        relaxation = Pass(program, level, Walk(mp1, grid, offsets))
        relaxation.relax(mp1.everywhere, 1)
        assert_same_bits(device.get(relaxation.least.data).reshape(8, 8), lanes[0])


@pytest.mark.parametrize("make", [simdtex.synthesize, maspar.synthesize])
def test_of_tied_modes_the_lowest_is_taken(machine, make):
    """The first step of level 0 relaxes sites without a certain neighbour: all candidates weigh alike."""
    sample = np.arange(64).reshape(8, 8) % 2 * 255  # as many of the one grey level as of the other
    chosen = {"preset": "paper"} if make is simdtex.synthesize else {"array": "8x8"}
    chosen |= {"order": 1, "xi": -4.0, "bandwidth": 1e-3, "rng": 1, **MODE}
    for device in (REFERENCE, machine):
        assert not make(sample.astype(np.uint8), (8, 8), device=device, **chosen)[1::2, 1::2].any()


@pytest.mark.parametrize(("draws", "density"), [(True, True), (False, True), (False, False)])
def test_a_pass_takes_the_memory_that_it_uses(draws, density):
    """A mode has a sum of 64 bits for each grey level; nothing grows with the number of candidates."""
    grid, choice = Grid((4, 4)), SiteChoice(draws, density, window(1.0, 255))
    mp1 = MP1(REFERENCE, ProcessorArray(4, 4), (4, 4), 2**20)
    program = Program(mp1, Problem(np.zeros((2, 1), np.int32), neighbourhood_offsets(1), 1, -1, 0))
    walk = Walk(mp1, grid, neighbourhood_offsets(1))
    words = 4 * 2 + 3 + 2 + 2 * 256 * (density and not draws)  # neighbours, heat, least, chosen, a walk, sums
    mp1.memory = need = mp1.used + 4 * words
    for n in (1, 5000):
        tables = [np.zeros(shape, np.float32) for shape in ((1, n), (4, 1, n))]
        level = ArrayLevel(0, grid, choice, np.zeros(n, np.int32), *tables, np.zeros(n, np.int32))
        with mp1.frame():
            Pass(program, level, walk)
            assert mp1.used == need
    mp1.memory = need - 1
    with pytest.raises(ValueError, match=f"needs {need} bytes of each PE, which holds 1 pixels, and a PE has"):
        Pass(program, level, walk)


def test_the_steps_show_which_elements_relax():
    _, output, _, engine = both((11, 13), "4x5", REFERENCE, order=2, levels=2)
    active = [step.active for step in output.steps]
    assert active[0].shape == (9, 4, 5)
    assert sum(one.sum() for one in active) == sum(level["relaxations"] for level in engine.statistics["levels"])
    padded = np.array([one.reshape(3, 3, 4, 5).swapaxes(1, 2).reshape(12, 15)[:11, :13] for one in active])
    for step, one in zip(output.steps, padded, strict=True):
        grid = Grid.of((11, 13), 2**step.level)
        sites = np.flatnonzero(grid.decimated(one)).astype(np.int32)
        assert sites.size == one.sum()
        assert neighbours_in(grid, neighbourhood_offsets(2), sites) is None


def test_progress_is_told_step_by_step():
    told, options = [], {"array": "8x8", "order": 2, "levels": 2, "rng": 1, "device": REFERENCE}
    maspar.synthesize(
        texture((14, 13)), (8, 8), callback=lambda p: told.append((p.fraction, p.image().shape)), **options
    )
    fractions = [fraction for fraction, _ in told]
    assert fractions == sorted(fractions) and 0 < fractions[0] < 0.5 < fractions[-1] <= 1
    assert [shape for _, shape in told][:: len(told) - 1] == [(4, 4), (8, 8)]


def test_what_the_program_cannot_do_is_refused():
    for options, message in (
        ({"coherence": 1.0}, "does not execute coherence=1.0; leave it out, or use simdtex.synthesize"),
        ({**MODE, "dtype": np.uint16, "memory": "16K"}, r"\d+ bytes of each PE for \d+ grey levels, and a PE has 163"),
        ({"memory": "32K"}, "unknown memory '32K'; choose one of: 16K, 64K"),
        ({"mapping": "round"}, "choose one of: cut-and-stack, hierarchical"),
        ({"array": "1x1", "memory": "16K"}, r"needs \d+ bytes of each PE, which holds 1600 pixels, and a PE has 16384"),
    ):
        with pytest.raises(ValueError, match=message):
            both((40, 40), **{"array": "128x128", "device": REFERENCE, "order": 2} | options)
    with pytest.raises(ValueError, match="takes one sample without unknown pixels"):
        maspar.synthesize([texture((14, 13))] * 2, (8, 8), device=REFERENCE)
    with pytest.raises(AttributeError, match="no attribute 'synthesise'"):
        maspar.synthesise  # noqa: B018

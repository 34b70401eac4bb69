"""Whole runs of the method ``mrf`` are Algorithm 1 in plain loops, to the byte; and every option matters."""

import functools
from dataclasses import fields

import numpy as np
import plain_mrf
import pytest
from cases import REFERENCE, assert_same_bits, texture

import simdtex
from simdtex import schedules
from simdtex.methods.mrf import Options
from simdtex.options import PRESETS, preset_values

SEED = 2**40 + 3

BARE = {"balance": 0.0, "structure": 0.0, "novelty": 0.0, "finish": 0.0, "overview": 64}
"""Nothing but the equations of the paper in distances and pictures."""
EXACT = BARE | {"search": "exact", "order": 2, "levels": 2, "coherence": 1.0}
FEW = BARE | {"search": "coherent", "order": 2, "levels": 2, "coherence": 0.2}
"""Coherent search that weighs a few candidates at every level but the coarsest."""
DRAWN = {"relaxation": "gibbs", "pixel": "density"}
DENSITY = BARE | DRAWN | {"order": 1, "xi": -4.0, "free_sweeps": 1, "coherence": 1.0}
MODE = {"pixel": "density", "relaxation": "icm", "order": 1, "levels": 2, "free_sweeps": 1, "xi": -4.0}
MORE = {"order": 2, "levels": 2}
"""The penalties, the structure channel and the finish of the defaults, all together."""
MORE_OF_A_DENSITY = {"balance": 0.5, "structure": 2.0, "novelty": 1.0, "finish": 1.5}
PAPER_ICM = {"preset": "paper", "order": 1, "relaxation": "icm", "pixel": "source"}

# sample shape, channels, type, output shape, options
CASES = {
    "defaults": ((9, 10), None, np.uint8, (3, 4), {}),
    "default-levels-by-candidates": ((16, 17), None, np.uint8, (18, 17), BARE | {"order": 1}),
    "default-levels-by-output": ((32, 33), None, np.uint8, (10, 8), BARE | {"order": 2}),
    "default-levels-whole": ((20, 19), None, np.uint8, (11, 9), BARE | {"order": 2, "edges": "whole", "phases": "all"}),
    "default-overview": ((32, 33), None, np.uint8, (9, 8), {"order": 1}),
    "default-overview-whole": ((20, 19), None, np.uint8, (9, 8), {"order": 1, "edges": "whole", "phases": "all"}),
    "paper": ((12, 11), None, np.uint8, (8, 9), {"preset": "paper", "order": 2}),
    "paper-icm": ((12, 11), None, np.uint8, (5, 6), PAPER_ICM),
    "exact": ((12, 11), None, np.uint8, (8, 9), EXACT),
    "exact-order-8": ((14, 12), None, np.uint8, (9, 8), EXACT | {"order": 8, "xi": -4.0}),
    "exact-three-levels": ((13, 14), None, np.uint8, (11, 10), EXACT | {"levels": 3, "phases": "all"}),
    "exact-colour": ((10, 11), 3, np.uint8, (8, 7), EXACT | {"boundary": "open"}),
    "exact-16-bit": ((10, 11), None, np.uint16, (8, 9), EXACT | {"order": 5, "coherence": 0.5}),
    "exact-float32": ((10, 11), None, np.float32, (9, 8), EXACT | {"edges": "whole"}),
    "exact-reflect": ((20, 20), None, np.uint8, (8, 8), EXACT | {"order": 1, "edges": "reflect", "coherence": 0}),
    "exact-auto-whole": ((20, 20), None, np.uint8, (8, 8), EXACT | {"order": 1, "levels": 1, "free_sweeps": 3}),
    "gibbs": ((12, 11), None, np.uint8, (8, 9), EXACT | {"relaxation": "gibbs"}),
    "gibbs-wide": ((12, 11), None, np.uint16, (8, 9), EXACT | {"relaxation": "gibbs", "bandwidth": 0.6}),
    "gibbs-density-colour": ((9, 8), 3, np.uint8, (6, 7), DENSITY | {"boundary": "open"}),
    "gibbs-density-16-bit": ((9, 10), 2, np.uint16, (7, 6), DENSITY | {"levels": 2}),
    "gibbs-density-float32": ((10, 9), None, np.float32, (7, 8), DENSITY | {"bandwidth": 0.4}),
    "density": ((9, 10), None, np.uint8, (6, 7), DENSITY | {"levels": 2, "bandwidth": 0.3}),
    "density-16-bit": ((8, 9), None, np.uint16, (5, 6), DENSITY | {"levels": 2, "bandwidth": 0.5}),
    "mode": ((12, 11), None, np.uint8, (8, 9), MODE | {"preset": "paper"}),
    "mode-colour": ((9, 8), 3, np.uint8, (6, 7), MODE | {"boundary": "open", "bandwidth": 0.8}),
    "mode-16-bit": ((8, 9), None, np.uint16, (4, 5), MODE | {"bandwidth": 0.3, "balance": 0.5, "coherence": 1.0}),
    "few": ((12, 11), None, np.uint8, (8, 9), FEW),
    "few-colour": ((10, 11), 3, np.uint8, (8, 7), FEW | {"order": 5, "boundary": "open"}),
    "few-order-18": ((11, 10), None, np.uint8, (6, 7), FEW | {"order": 18, "xi": -16.0}),
    "few-16-bit": ((12, 11), None, np.uint16, (9, 8), FEW | {"order": 8, "xi": -4.0, "coherence": 1.5}),
    "few-float32": ((12, 11), None, np.float32, (8, 9), FEW | {"order": 5, "edges": "whole", "xi": -2.5}),
    "few-suggest": ((12, 13), None, np.uint8, (8, 9), FEW | {"order": 8, "chance": 1, "xi": -4.0}),
    "few-chance": ((12, 11), None, np.uint8, (8, 9), FEW | {"chance": 9, "coherence": 0, "free_sweeps": 0}),
    "few-three-levels": ((13, 14), None, np.uint8, (11, 10), FEW | {"levels": 3, "edges": "reflect"}),
    "few-exhaustive": ((13, 14), None, np.float32, (9, 10), FEW | {"levels": 3}),
    "few-gibbs": ((12, 11), None, np.uint16, (8, 9), FEW | {"relaxation": "gibbs", "bandwidth": 0.5}),
    "few-coarse-chance": (
        (12, 13),
        None,
        np.uint8,
        (9, 10),
        FEW | {"order": 1, "levels": 4, "phases": "all", "coarse_chance": 7},
    ),
    "few-gibbs-density": ((10, 9), 2, np.uint8, (7, 8), FEW | {"relaxation": "gibbs", "pixel": "density", "chance": 6}),
    "all-of-many": ((35, 31), None, np.float32, (5, 6), BARE | {"order": 2, "levels": 1}),
    "seam": ((9, 9), None, np.uint8, (7, 11), BARE | {"search": "exact", "order": 5, "levels": 1, "xi": -8.0}),
    "a-row": ((9, 8), None, np.uint8, (1, 13), BARE | {"order": 2}),
    **{
        f"{schedule}-{how}": ((9, 10), None, np.uint8, (8, 9), options | {"schedule": schedule})
        for schedule in ("coloring-fixed", "synchronous", "checkerboard", "block:3x4", "luby", "random-subset:0.3")
        for how, options in (("exact", EXACT | {"levels": 1, "xi": -2.0}), ("few", FEW))
    },
    **{
        f"{schedule}-{how}": ((9, 8), None, np.uint8, (6, 5), options | {"schedule": schedule})
        for schedule in ("raster", "random-scan")
        for how, options in (("exact", EXACT | {"levels": 1, "xi": -4.0}), ("few", FEW))
    },
    "block": ((9, 8), None, np.uint8, (3, 17), BARE | {"schedule": "block", "order": 1, "levels": 1}),
    "random-subset": ((9, 10), None, np.uint8, (8, 9), FEW | {"schedule": "random-subset", "boundary": "open"}),
    **{
        f"{option}-{how}": ((12, 11), None, np.uint8, (9, 10), options | {option: value})
        for option, value in (("balance", 0.5), ("structure", 2.0), ("novelty", 1.0), ("finish", 1.5))
        for how, options in (("exact", EXACT), ("few", FEW))
    },
    "balance-cap": ((12, 13), None, np.uint8, (11, 10), FEW | {"balance": 0.1, "order": 1}),
    "balance-order-9": ((13, 14), None, np.uint8, (9, 8), FEW | {"balance": 1.0, "order": 9, "schedule": "block:3x4"}),
    "balance-all-phases": ((14, 13), None, np.uint8, (8, 9), EXACT | {"balance": 1.0, "phases": "all"}),
    "balance-gibbs": ((12, 11), 2, np.uint16, (8, 9), FEW | {"balance": 0.3, "relaxation": "gibbs", "bandwidth": 0.5}),
    "balance-density": ((9, 10), None, np.uint8, (6, 7), DENSITY | {"balance": 0.5, "levels": 2, "bandwidth": 0.3}),
    "structure-colour": ((12, 11), 3, np.uint8, (8, 7), FEW | {"structure": 0.7, "boundary": "open"}),
    "structure-beyond-top": ((13, 12), None, np.float32, (8, 9), FEW | {"structure": 50.0}),
    "structure-beyond-8-bit": ((13, 12), None, np.uint8, (8, 9), FEW | {"structure": 50.0}),
    "structure-density": ((10, 11), None, np.uint8, (6, 7), DENSITY | {"structure": 3.0, "levels": 2}),
    "novelty-colour": ((12, 11), 3, np.uint8, (8, 9), EXACT | {"novelty": 0.05, "levels": 1, "boundary": "open"}),
    "novelty-density": ((9, 10), None, np.uint8, (6, 7), DENSITY | {"novelty": 0.4}),
    "finish-colour": ((12, 11), 3, np.uint8, (8, 7), EXACT | {"finish": 0.8, "boundary": "open"}),
    "finish-16-bit": ((12, 11), 2, np.uint16, (8, 7), FEW | {"finish": 2.2}),
    "finish-float32": ((12, 11), None, np.float32, (3, 7), FEW | {"finish": 1.1, "levels": 1, "edges": "reflect"}),
    "finish-nobody-else": ((12, 11), None, np.uint8, (8, 7), FEW | {"finish": 0.3}),
    "finish-density": ((9, 10), None, np.uint8, (6, 7), DENSITY | {"finish": 1.0}),
    "lattice-exact": ((12, 11), None, np.uint8, (9, 10), EXACT | {"lattice": ((4.4, 0.3), (-0.2, 5))}),
    "lattice-colour": ((12, 11), 3, np.uint8, (8, 7), FEW | {"lattice": ((3, 0), (1, 4)), "boundary": "open"}),
    "lattice-structure": ((12, 11), None, np.uint16, (9, 8), MORE | {"lattice": "4,0,0,3.9"}),
    "more": ((14, 13), None, np.uint8, (9, 10), MORE),
    "more-three-levels": ((24, 25), None, np.uint8, (12, 11), MORE | {"levels": 3}),
    "more-colour": ((13, 14), 3, np.uint8, (9, 8), MORE | {"boundary": "open"}),
    "more-16-bit": ((14, 13), None, np.uint16, (8, 9), MORE | {"order": 5}),
    "more-float32": ((13, 12), 2, np.float32, (9, 8), MORE | {"schedule": "block:3x4", "phases": "all"}),
    "more-whole": ((16, 15), None, np.uint8, (9, 8), MORE | {"edges": "whole", "phases": "all", "balance": 2.0}),
    "more-exact": ((12, 11), None, np.uint8, (9, 8), MORE | {"search": "exact", "schedule": "random-scan", "xi": -8.0}),
    "more-gibbs": ((12, 11), None, np.uint16, (8, 9), MORE | {"relaxation": "gibbs", "bandwidth": 0.5}),
    "more-gibbs-few": ((12, 11), 2, np.float32, (8, 9), MORE | {"relaxation": "gibbs", "search": "coherent"}),
    "more-density": ((10, 9), 2, np.uint8, (6, 7), MORE | DRAWN | {"xi": -4.0, "bandwidth": 0.4}),
    "more-gibbs-density": ((10, 9), None, np.uint8, (7, 6), DENSITY | MORE_OF_A_DENSITY),
    "exact-of-many": ((36, 35), None, np.uint8, (6, 5), MORE | {"levels": 1, "search": "exact", "xi": -4.0}),
}

ON_A_DEVICE = (
    *("exact-colour", "paper", "few-suggest", "few-gibbs-density"),
    *("more-colour", "more-density", "exact-of-many", "lattice-colour"),
)


def run(sample_shape, channels, dtype, shape, options, device=REFERENCE):
    """Image, sources, temperatures and statistics of a run of the engine."""
    sample, axis = texture(sample_shape, channels, dtype, 5), None if channels is None else -1
    image, output = simdtex.synthesize(
        sample, shape, channel_axis=axis, rng=SEED, device=device, full_output=True, **options
    )
    return [image, output.source, output.temperature], output.statistics


@functools.cache
def plainly(name):
    """The same of the plain loops for one of the cases, but the statistics."""
    sample_shape, channels, dtype, shape, options = CASES[name]
    sample = texture(sample_shape, channels or 1, dtype, 5)
    image, source, temperature = plain_mrf.synthesize(sample, shape, SEED, **options)
    return [image if channels else image[..., 0], source, temperature]


@pytest.mark.parametrize("name", CASES)
def test_a_run_is_algorithm_1(name):
    assert_same_bits(run(*CASES[name])[0], plainly(name))


@pytest.mark.parametrize("name", ON_A_DEVICE)
def test_a_run_on_a_device_is_algorithm_1(machine, name):
    assert_same_bits(run(*CASES[name], machine)[0], plainly(name))


@pytest.mark.parametrize("given", [{}, {"finish": 1.5}], ids=["default", "given"])
@pytest.mark.parametrize("colours", [16, 17])
def test_a_map_of_categories_keeps_its_own(colours, given):
    """Sixteen different pixels or fewer are one: unless it is asked for, no finish makes a new one of them."""
    numbers = np.random.default_rng(3).integers(0, colours, (9, 10))
    numbers.ravel()[:colours] = np.arange(colours)
    sample = np.stack([numbers % 4 * 60, numbers // 4 * 50], -1).astype(np.uint8)
    options = MORE | {"levels": 1} | given
    image, output = simdtex.synthesize(
        sample, (8, 7), channel_axis=-1, rng=SEED, device=REFERENCE, full_output=True, **options
    )
    assert_same_bits([image, output.source, output.temperature], plain_mrf.synthesize(sample, (8, 7), SEED, **options))
    own = {tuple(pixel) for pixel in sample.reshape(-1, 2).tolist()}
    assert (own >= {tuple(pixel) for pixel in image.reshape(-1, 2).tolist()}) == (colours == 16 and not given)


CLOSE = BARE | {"order": 8, "relaxation": "gibbs", "bandwidth": 0.0005, "coherence": 0.0, "xi": -8.0}
"""Candidates that differ by the same few amounts differ in the rounding alone; so narrow a Gaussian tells."""
# The sample's grey levels and channels, and options.
SUMS = {
    "exact": (3, 1, {"search": "exact", "levels": 1}),
    "all": (2, 3, {"search": "coherent", "levels": 1}),
    "few": (3, 1, {"search": "coherent", "levels": 2, "chance": 60, "order": 18}),
}


@pytest.mark.parametrize("how", SUMS)
def test_sums_have_their_order(monkeypatch, how):
    greys, channels, given = SUMS[how]
    sample = np.random.default_rng(5).integers(0, greys, (12, 11, channels)).astype(np.float32)
    image, output = simdtex.synthesize(
        sample, (7, 8), channel_axis=-1, rng=SEED, device=REFERENCE, full_output=True, **CLOSE | given
    )
    plainly = plain_mrf.synthesize(sample, (7, 8), SEED, **CLOSE | given)
    assert_same_bits([image, output.source, output.temperature], plainly)
    if how != "all":  # else the equality shows nothing of the order
        monkeypatch.setattr(plain_mrf, "LANES", 1)
        assert (plain_mrf.synthesize(sample, (7, 8), SEED, **CLOSE | given)[1] != output.source).any()


def test_the_plain_loops_have_the_engines_defaults_and_presets():
    assert {f.name: f.default for f in fields(Options)} == plain_mrf.DEFAULTS | NO_BYTE
    assert {name: plain_mrf.DEFAULTS | preset_values(Options, name) for name in PRESETS} == {
        "default": plain_mrf.DEFAULTS,
        "paper": plain_mrf.DEFAULTS | plain_mrf.PAPER,
    }


def test_the_cases_give_every_option():
    given = {option for *_, options in CASES.values() for option in options}
    assert given == {"preset", *plain_mrf.DEFAULTS} - ELSEWHERE


NO_BYTE = {"array": None}
"""Options that change no byte, with their defaults: where a run is accounted for, and what is checked."""

ELSEWHERE = {"categorical", "weights", "shares", "proportions", "data_weight", "guide_weight", "labels", "soft_weight"}
"""Options that want more than one grey sample: test_algorithm_given.py."""

# For each option: what else is given, and two values of which each gives another output.
CHANGES = {
    "order": [(EXACT, 2, 5), (FEW, 2, 4)],
    "levels": [({"order": 2}, 1, 2), ({"order": 2, "search": "exact"}, 2, 3)],
    "relaxation": [(EXACT, "icm", "gibbs"), (FEW, "icm", "gibbs")],
    "bandwidth": [
        (FEW, 0.15, 1.0),
        (EXACT, 0.15, 1.0),
        (EXACT | {"relaxation": "gibbs"}, 0.5, 1.0),
        (FEW | {"relaxation": "gibbs"}, 0.5, 1.0),
        (DENSITY, 0.15, 1.0),
    ],
    "coherence": [(EXACT, 1.0, 0.0), (FEW, 0.2, 1.0), (FEW, 0.2, 0.0), (FEW | {"relaxation": "gibbs"}, 0.2, 3.0)],
    "overview": [({"order": 2}, 32, 20), ({"order": 2, "search": "exact"}, 21, 20)],
    "balance": [(EXACT, 0.0, 0.5), (FEW, 0.0, 0.5), (MORE, 0.5, 0.6), (DENSITY, 0.0, 0.5)],
    "structure": [(EXACT, 0.0, 0.5), (FEW, 0.0, 2.0), (MORE, 2.0, 1.5)],
    "lattice": [(EXACT, "auto", "3,0,0,3"), (FEW, ((3, 0), (0, 3)), ((3, 0), (1, 3))), (MORE, "none", "3,0,0,5")],
    "novelty": [(EXACT, 0.0, 1.0), (FEW, 0.0, 1.0), (MORE, 1.0, 0.5), (DENSITY, 0.0, 1.0)],
    "finish": [(EXACT, 0.0, None), (FEW, 0.0, 0.8), (MORE, None, 1.4), (DENSITY, None, 1.5)],
    "xi": [(EXACT, -1.0, -4.0), (FEW, -1.0, -4.0), (FEW, -1.0, -1.1)],
    "free_sweeps": [(EXACT, 2, 0), (FEW, 2, 0), (FEW | {"relaxation": "gibbs"}, 2, 1)],
    "pixel": [(others | {"relaxation": "gibbs"}, "source", "density") for others in (EXACT, FEW)],
    "phases": [(EXACT, "decimated", "all"), (FEW, "decimated", "all")],
    "edges": [
        (EXACT, "auto", "whole"),
        (FEW, "auto", "whole"),
        (EXACT | {"order": 1, "levels": 1}, "auto", "reflect"),
        (FEW | {"order": 1}, "auto", "reflect"),
    ],
    "schedule": [(EXACT, "coloring", "luby"), (FEW, "coloring", "luby")],  # the others differ: test_schedule_runs.py
    "boundary": [(EXACT, "torus", "open"), (FEW, "torus", "open")],
    "search": [
        ({"order": 2, "levels": 2}, "auto", "exact"),
        ({"order": 2, "levels": 2, "relaxation": "gibbs"}, "auto", "coherent"),
        ({"order": 2, "levels": 2, "coherence": 1.0}, "coherent", "exact"),
    ],
    "coarse_chance": [(FEW | {"order": 1, "levels": 4, "phases": "all", "chance": 2}, 0, 9)],
    "chance": [(FEW, 4, 0), (FEW, 4, 5), (FEW | {"relaxation": "gibbs"}, 4, 0)],
}


@functools.cache
def _outcome(options):
    return run((20, 19), None, np.uint8, (9, 10), dict(options))


def outcome(**options):
    """Image, sources and temperatures, and statistics, of a run with these options."""
    return _outcome(tuple(sorted(options.items())))


@pytest.mark.parametrize("name", [f.name for f in fields(Options)])
def test_every_option_changes_the_output(name):
    """A new option wants an entry in `CHANGES`, here or elsewhere, or in `NO_BYTE` and a test of what it does."""
    assert [name in those for those in (CHANGES, NO_BYTE, ELSEWHERE)].count(True) == 1
    for others, one, other in CHANGES.get(name, []):
        (image, source, _), _ = outcome(**others | {name: one})
        (changed, elsewhere, _), _ = outcome(**others | {name: other})
        assert not (np.array_equal(image, changed) and np.array_equal(source, elsewhere)), (others, one, other)


class Liar(schedules.Synchronous):
    """Says that no two neighbours relax together, where all do."""

    def independent(self, grid, offsets):
        """Whatever the lattice."""
        return True


def test_a_checked_schedule_finds_neighbours_that_relax_together():
    given = {**EXACT, "schedule": Liar()}
    run((9, 8), None, np.uint8, (6, 5), given)
    with pytest.raises(RuntimeError, match="equation \\(14\\)"):
        run((9, 8), None, np.uint8, (6, 5), given | {"schedule": schedules.Checked(Liar())})
    assert_same_bits(outcome(**EXACT)[0], outcome(**EXACT | {"schedule": schedules.Checked(schedules.Coloring())})[0])


def account(others, **options):
    """What a run costs on an array; its bytes are those of a run on none."""
    arrays, statistics = outcome(**others, **options)
    assert_same_bits(arrays, outcome(**others)[0])
    assert statistics["options"].items() >= options.items()
    return statistics["accounting"]


@pytest.mark.parametrize("others", [EXACT, FEW], ids=["exact", "few"])
def test_an_array_and_its_mapping_change_the_account_alone(others):
    tiled, layered = (account(others, array=f"4x4{how}") for how in (":hierarchical", ""))
    assert tiled["sites"] == layered["sites"]
    for each, how in ((tiled, "hierarchical"), (layered, "cut-and-stack")):
        assert (each["array"], each["mapping"], each["layers"]) == ("4x4", how, 9)
        assert each["moved"] > 0
    assert tiled["moved"] != layered["moved"]
    assert tiled["passes"] != layered["passes"]

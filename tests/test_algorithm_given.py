"""Whole runs with several samples, masks, gaps, known values and guides are Algorithm 1 in plain loops, to the byte."""

import functools
from typing import NamedTuple

import numpy as np
import plain_mrf
import pytest
from cases import REFERENCE, assert_same_bits, texture
from test_algorithm import ELSEWHERE

import simdtex
from simdtex.driver import drive
from simdtex.jobs.inputs import check_inputs, check_region
from simdtex.machine import open_machine
from simdtex.methods import mrf
from simdtex.model.given import Soft
from simdtex.options import resolve

SEED = 2**40 + 3

EXACT = {"search": "exact", "order": 2, "levels": 2}
FEW = {"search": "coherent", "order": 2, "levels": 2}
OPEN = {"boundary": "open"}
GIBBS = {"relaxation": "gibbs", "bandwidth": 0.4}


class Case(NamedTuple):
    """What a run is given: sizes of its samples, and how everything else is made of random numbers.

    ``known`` share of the sites; ``placed`` share of those that are from somewhere in the sample; ``partly`` whether
    variables are known on their own; ``labels`` of the guide, 0 for grey levels and None for no guide; ``silent`` share
    of the sites where it says nothing; ``masked`` and ``gaps`` shares of the samples' pixels; ``kinds`` how many
    categories, of the first variable where there are several; ``outside`` share of the sites that take no part;
    ``soft`` what there are probabilities of.
    """

    samples: tuple = ((9, 11),)
    channels: int | None = None
    dtype: type = np.uint8
    shape: tuple = (10, 12)
    known: float = 0.0
    placed: float = 0.0
    partly: bool = False
    labels: int | None = None
    silent: float = 0.0
    masked: float = 0.0
    gaps: float = 0.0
    kinds: int = 0
    outside: float = 0.0
    soft: tuple = ()
    options: tuple = ()

    @property
    def maps(self):
        """Of probabilities, a fifth of them 0 and a fifth of the sites unknown, and of the sites that take part."""
        rng, found = np.random.default_rng(11), {}
        for name in self.soft:
            kinds = {"categories": self.kinds, "images": len(self.samples)}[name]
            p = rng.random((kinds, *self.shape)) * (rng.random((kinds, *self.shape)) > 0.2) + 1e-9 * (kinds < 2)
            p[0, p.sum(0) == 0] = 1
            found[name] = np.where(rng.random(self.shape) < 0.2, np.nan, p / p.sum(0))
        if self.outside:
            found["region"] = rng.random(self.shape) >= self.outside
        return found

    def arrays(self):
        """Samples, masks, known values and their source, and the guide, all with channels."""
        rng = np.random.default_rng(7)
        samples = [texture(size, self.channels or 1, self.dtype, 5 + n) for n, size in enumerate(self.samples)]
        for one in samples if self.kinds else []:
            one[..., 0] = rng.integers(0, self.kinds, one.shape[:2]) ** 2 + 3
            one[: self.kinds, 0, 0] = np.arange(self.kinds) ** 2 + 3  # all of them
        masks = [rng.random(size) >= self.masked for size in self.samples] if self.masked else None
        for one in samples if self.gaps else []:
            one[rng.random(one.shape) < self.gaps / one.shape[2]] = np.nan
        channels = samples[0].shape[2]

        number = rng.integers(0, len(samples), self.shape)
        place = np.stack(
            [rng.integers(0, [one.shape[axis] for one in samples], (*self.shape, len(samples))) for axis in (0, 1)]
        )
        row, col = (np.take_along_axis(one, number[..., None], -1)[..., 0] for one in place)
        values = np.empty((*self.shape, channels), self.dtype)
        for s in np.ndindex(*self.shape):
            one = samples[number[s]]
            here = one[row[s], col[s]]
            values[s] = np.where(np.isnan(here), np.nanmin(one), here) if self.gaps else here
        there = np.repeat(rng.random(self.shape)[..., None] < self.known, channels, -1)
        if self.partly:
            there &= rng.random(there.shape) < 0.6
        if self.outside:
            there &= self.maps["region"][..., None]
        known = np.ma.masked_array(values, ~there) if self.known else None
        source = np.stack([row, col, number][: 2 + (len(samples) > 1)], -1)
        source[rng.random(self.shape) >= self.placed] = -1
        guide = None
        if self.labels is not None:
            guide = ([self.guiding(rng, size) for size in self.samples], self.guiding(rng, self.shape))
            guide[1][rng.random(self.shape) < self.silent] = np.nan
            guide = guide if self.silent else (guide[0], guide[1].astype(guide[0][0].dtype))
        return samples, masks, known, source.astype(np.int64) if self.placed else None, guide

    def guiding(self, rng, size):
        """A picture of a guide: floats for the output's sake."""
        if self.labels:
            found = rng.integers(0, self.labels, size)[..., None] * 3.0
            found[: self.labels, 0, 0] = np.arange(self.labels) * 3
            return found
        row, col = np.indices(size)
        return np.stack([np.sin(row / 3) + rng.random(size), row * col / 7], -1)


def case(options, **how):
    return Case(**how, options=tuple(sorted(options.items())))


def run(case, device=REFERENCE):
    """Image, sources and temperatures of a run of the engine."""
    samples, masks, known, source, guide = case.arrays()
    axis, several = None if case.channels is None else -1, len(samples) > 1

    def bare(array):
        return array if case.channels else array[..., 0]

    options = dict(case.options)
    if case.maps:
        return mapped(case, device)
    image, output = simdtex.synthesize(
        [bare(one) for one in samples] if several else bare(samples[0]),
        case.shape,
        channel_axis=axis,
        mask=masks if several or masks is None else masks[0],
        known=None if known is None else bare(known),
        known_source=source,
        guide=guide if several or guide is None else (guide[0][0], guide[1]),
        rng=SEED,
        device=device,
        full_output=True,
        **options | ({"labels": True} if case.labels and "labels" not in options else {}),
    )
    return [image, output.source, output.temperature]


def mapped(case, device):
    """The same with maps, which no public function takes as they are."""
    samples, masks, known, source, guide = case.arrays()
    inputs = check_inputs(samples, case.shape, -1, masks, known, source, guide)
    inputs = check_region(case.maps["region"], case.shape, inputs) if case.outside else inputs
    soft = Soft(case.maps.get("categories"), case.maps.get("images")) if case.soft else None
    chosen = resolve(mrf.Options, "synth", dict(case.options))
    plan = mrf.plan(inputs.pictures, case.shape, chosen, inputs.given, inputs.guide, soft=soft)
    image, output = drive(plan, open_machine(device), SEED)
    if case.outside:
        image[~case.maps["region"]] = 0
    return [image if case.channels else image[..., 0], output.source, output.temperature]


def plainly(case):
    """The same of the plain loops."""
    samples, masks, known, source, guide = case.arrays()
    options = dict(case.options) | ({"labels": True} if case.labels and "labels" not in dict(case.options) else {})
    given = {"mask": masks, "known": known, "known_source": source, "guide": guide, "maps": case.maps}
    pictures = samples if len(samples) > 1 else samples[0]
    image, source, temperature = plain_mrf.synthesize(pictures, case.shape, SEED, **given, **options)
    return [image if case.channels else image[..., 0], source, temperature]


BOTH = {"exact": EXACT, "few": FEW}
TWO = {"samples": ((9, 11), (8, 7))}
# What else is given, and of whom; each goes with one of the searches, or with both.
KINDS = {
    "known": ({}, {"known": 0.15}),
    "known-three-levels": ({"levels": 3, "schedule": "luby"}, {"known": 0.06, "shape": (11, 13)}),
    "known-open": (OPEN | {"levels": 3, "data_weight": 4.0}, {"known": 0.08, "dtype": np.float32}),
    "known-colour": ({"schedule": "random-subset"}, {"known": 0.1, "channels": 3}),
    "known-gibbs": (GIBBS | {"order": 4, "data_weight": 1.7}, {"known": 0.1, "dtype": np.uint16}),
    "known-blocks": ({"schedule": "block:3x4"}, {"known": 0.1}),
    "known-raster": ({"schedule": "raster", "xi": -4.0}, {"known": 0.2, "shape": (7, 8)}),
    "known-no-structure": ({"structure": 0.0, "novelty": 0.0}, {"known": 0.1}),
    "placed": ({}, {"known": 0.3, "placed": 1.0}),
    "placed-some": ({"schedule": "checkerboard"}, {"known": 0.3, "placed": 0.5}),
    "placed-colour": (OPEN | {"order": 4}, {"known": 0.2, "placed": 0.7, "channels": 2}),
    "partly": ({}, {"known": 0.3, "partly": True, "channels": 2}),
    "partly-open": (OPEN, {"known": 0.2, "partly": True, "channels": 3, "dtype": np.float32}),
    "two-labels": ({}, {"labels": 2}),
    "labels": ({"guide_weight": 0.4, "schedule": "synchronous"}, {"labels": 4}),
    "labels-silent": (OPEN | {"levels": 3, "order": 1}, {"labels": 3, "silent": 0.6}),
    "grey-guide": ({}, {"labels": 0}),
    "grey-guide-silent": (GIBBS | {"guide_weight": 2.5}, {"labels": 0, "silent": 0.4, "dtype": np.uint16}),
    "grey-guide-open": (OPEN | {"order": 4, "schedule": "random-scan"}, {"labels": 0, "shape": (7, 8)}),
    "two": ({}, TWO),
    "two-smooth": ({"levels": 1, "order": 1, "finish": 2.0}, TWO),
    "two-shares": ({"shares": (3.0, 1.0), "balance": 2.0}, TWO),
    "two-whole": ({"edges": "whole", "phases": "all", "order": 1}, TWO | {"dtype": np.float32}),
    "three-colour": (OPEN | GIBBS, {"samples": ((9, 8), (7, 9), (8, 8)), "channels": 2}),
    "masked": ({}, {"masked": 0.4}),
    "masked-open": (
        OPEN | {"phases": "all", "edges": "whole", "order": 1},
        {"masked": 0.2, "dtype": np.uint16},
    ),
    "gaps": ({}, {"gaps": 0.1, "dtype": np.float32}),
    "gaps-reflect": ({"levels": 1, "edges": "reflect"}, {"gaps": 0.1, "dtype": np.float64}),
    "gaps-colour": (GIBBS, {"gaps": 0.1, "dtype": np.float32, "channels": 2}),
    "categories": ({"categorical": True}, {"kinds": 4}),
    "two-categories": ({"categorical": True, "order": 4}, {"kinds": 2, "dtype": np.uint16}),
    "one-category": ({"categorical": True}, {"kinds": 1}),
    "mixed": ({"categorical": (0,), "weights": (1.0, 2.0)}, {"kinds": 3, "channels": 2, "dtype": np.float32}),
    "weights": ({"weights": (0.5, 1.5, 1.0)}, {"channels": 3}),
    "weights-none": ({"weights": (0.0, 1.0), "finish": 0.8}, {"channels": 2, "dtype": np.uint16}),
    "weights-of-floats": ({"weights": (3.0, 1.0), "finish": 2.0}, {"channels": 2, "dtype": np.float64}),
    "proportions": ({"categorical": True, "proportions": (1.0, 2.0, 0.0)}, {"kinds": 3}),
    "proportions-alone": ({"categorical": True, "proportions": (3.0, 1.0), "balance": 0.0}, {"kinds": 2}),
    "data-and-guide": ({"data_weight": 40.0}, {"known": 0.1, "labels": 3, "silent": 0.3, "placed": 0.4}),
    "data-of-categories": (
        {"categorical": True, "proportions": (1.0, 1.0, 2.0)},
        {"kinds": 3, "known": 0.15, "masked": 0.2},
    ),
    "data-partly-categories": (
        {"categorical": (0,)},
        {"kinds": 3, "known": 0.3, "partly": True, "channels": 2, "labels": 2},
    ),
    "lattice-known": ({"lattice": ((4.8, 0.3), (-0.2, 5.8))}, {"known": 0.2, "channels": 3}),
    "lattice-placed": (
        OPEN | {"lattice": "4,0,1,5", "structure": 1.0},
        TWO | {"known": 0.2, "placed": 0.5, "labels": 2},
    ),
    "lattice-two": ({"lattice": "4,0,1,5"} | OPEN, TWO | {"gaps": 0.1, "dtype": np.float32, "known": 0.1}),
    "outside": (OPEN | {"levels": 3}, {"outside": 0.4}),
    "outside-known": ({"finish": 1.0}, {"outside": 0.3, "known": 0.2, "placed": 0.5, "dtype": np.float32}),
    "soft": ({"categorical": True, "soft_weight": 0.5}, {"kinds": 3, "soft": ("categories",)}),
    "soft-gibbs": (
        OPEN | GIBBS | {"categorical": True, "proportions": (2.0, 1.0)},
        {"kinds": 2, "known": 0.1, "soft": ("categories",), "masked": 0.2},
    ),
    "soft-images": (OPEN | {"soft_weight": 8.0}, TWO | {"soft": ("images",)}),
    "soft-all": (
        {"categorical": (0,), "levels": 3},
        TWO | {"kinds": 3, "soft": ("categories", "images"), "channels": 2, "outside": 0.2, "labels": 2},
    ),
    "everything": (
        {"shares": (1.0, 2.0), "schedule": "luby"},
        TWO
        | {"known": 0.15, "placed": 0.4, "labels": 0, "silent": 0.2, "masked": 0.2, "gaps": 0.05}
        | {"dtype": np.float32, "channels": 2, "partly": True},
    ),
}
TWICE = (
    *("known-three-levels", "placed-some", "partly", "labels-silent", "two-shares", "masked", "mixed", "soft-all"),
    "everything",
)
CASES = {
    **{
        f"{name}-{how}": case(BOTH[how] | more, **inputs)
        for k, (name, (more, inputs)) in enumerate(KINDS.items())
        for how in (BOTH if name in TWICE else [[*BOTH][k % 2]])
    },
    "nearly-all-known": case(FEW | {"order": 1}, known=0.9, shape=(9, 5)),  # at the coarse level all
    "density-known": case({"pixel": "density", "order": 1, "xi": -4.0, **GIBBS}, known=0.15, shape=(6, 7)),
    "density-two": case({"pixel": "density", "order": 1, **GIBBS}, **TWO, known=0.1, shape=(6, 7)),
    "a-density-of-gaps": case({"pixel": "density", "order": 1, **GIBBS}, gaps=0.1, dtype=np.float32, shape=(6, 7)),
    "many": case({"levels": 1, "search": "exact", "order": 2, "xi": -8.0}, samples=((25, 24), (20, 26)), shape=(5, 6)),
    "many-known": case({"levels": 1, "order": 2}, samples=((34, 33),), known=0.2, shape=(5, 6)),
    "many-few": case(FEW, samples=((25, 24), (24, 26)), masked=0.1, shape=(5, 6)),
    "default": case({}, known=0.1, labels=2, shape=(5, 6)),
}

ON_A_DEVICE = (
    *("known-three-levels-few", "labels-silent-exact", "partly-few", "masked-exact", "many-known"),
    *("soft-all-exact", "soft-all-few", "outside-known-few", "soft-gibbs-few"),
    *(
        pytest.param(name, marks=pytest.mark.slow)  # a runtime that has not seen their kernels compiles for minutes
        for name in (
            "known-three-levels-exact",
            "labels-silent-few",
            "everything-exact",
            "everything-few",
            "many-few",
        )
    ),
)


@pytest.mark.parametrize("name", CASES)
def test_a_run_is_algorithm_1(name):
    assert_same_bits(run(CASES[name]), plainly(CASES[name]))


@pytest.mark.parametrize("name", ON_A_DEVICE)
def test_a_run_on_a_device_is_that_of_the_reference(machine, name):
    assert_same_bits(run(CASES[name], machine), run(CASES[name]))


def test_the_cases_give_every_option():
    assert {option for each in CASES.values() for option, _ in each.options} >= ELSEWHERE - {"labels"}


# For each option: what else is given, and two values of which each gives another output.
CHANGES = {
    "categorical": [(EXACT, {"kinds": 3}, False, True), (FEW, {"kinds": 3, "channels": 2}, (0,), False)],
    "weights": [
        (EXACT | {"finish": 0.0}, {"channels": 2}, None, (1.0, 1.0)),
        (FEW, {"channels": 2}, (1.0, 1.0), (1.0, 0.3)),
    ],
    "shares": [(EXACT, TWO, None, (1.0, 4.0)), (FEW, TWO, (1.0, 3.0), (3.0, 1.0))],
    "proportions": [
        (EXACT | {"categorical": True}, {"kinds": 2}, None, (1.0, 1.0)),
        (FEW | {"categorical": True}, {"kinds": 2}, (1.0, 9.0), (9.0, 1.0)),
    ],
    "data_weight": [(EXACT, {"known": 0.2}, 16.0, 0.0), (FEW, {"known": 0.2}, 16.0, 1.0)],
    "guide_weight": [(EXACT, {"labels": 3}, 1.0, 0.0), (FEW, {"labels": 0}, 1.0, 0.1)],
    "soft_weight": [
        (EXACT | {"categorical": True}, {"kinds": 3, "soft": ("categories",)}, 1.0, 0.0),
        (FEW, TWO | {"soft": ("images",)}, 1.0, 4.0),
    ],
    "labels": [(EXACT | {"labels": True}, {"labels": 3}, True, False), (FEW, {"labels": 4}, True, False)],
}


@functools.cache
def outcome(case):
    """Image and sources of a run."""
    return run(case)[:2]


@pytest.mark.parametrize("name", sorted(ELSEWHERE))
def test_every_option_changes_the_output(name):
    for options, inputs, one, other in CHANGES[name]:
        (image, source), (changed, elsewhere) = (outcome(case(options | {name: v}, **inputs)) for v in (one, other))
        assert not (np.array_equal(image, changed) and np.array_equal(source, elsewhere)), (options, one, other)

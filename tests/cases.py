"""Small problems for the operations, the machines that run them, and the comparison of their bytes."""

import functools
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import strategies as st
from scipy.stats import chisquare
from tolerances import SIGNIFICANCE

from simdtex.machine.reference import Reference
from simdtex.methods import mrf
from simdtex.methods.mrf import lcpdf
from simdtex.methods.mrf.algorithm import ignore
from simdtex.methods.mrf.costs import Costs, Kinds, Phased, ScatteredData
from simdtex.methods.mrf.neighbourhood import Confidences, Field
from simdtex.methods.mrf.relax import AllCandidates, CandidateList, InPhase, Relaxation, in_phase
from simdtex.methods.mrf.square import TAIL, square_of
from simdtex.model.given import EXCLUDED
from simdtex.model.guide import UNKNOWN, Guide
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.model.pictures import Pictures
from simdtex.model.regularity import Lattice
from simdtex.model.sample import Sample
from simdtex.schedules import Coloring, Setting

REFERENCE = Reference()


@functools.cache
def opencl(info, **options):
    """One OpenCL machine for each device and set of machine options, so that a program is built once."""
    from simdtex.machine.opencl import OpenCL

    return OpenCL(info, **options)


def colors_of(grid, order, seed=0, machine=REFERENCE):
    """The colours of a lattice or a window of it, read back from a machine."""
    return np.array(machine.get(Coloring().groups(machine, grid, None, order, seed)))


def slow_but(quick, every):
    """Parameters of a test, of which all but the quick ones are slow; a tuple is of several parameters."""
    return [
        pytest.param(*(one if isinstance(one, tuple) else (one,)), marks=[pytest.mark.slow] * (one not in quick))
        for one in every
    ]


def texture(shape, channels=None, dtype=np.uint8, seed=0):
    """A striped picture with noise that uses most of a type's range; the same for the same arguments."""
    rng = np.random.default_rng(seed)
    row, col = np.indices(shape)
    planes = [
        0.5 + 0.3 * np.sin(row * (1.1 + 0.2 * c) + col * 0.7) + 0.2 * rng.uniform(-1, 1, shape)
        for c in range(channels or 1)
    ]
    picture = np.stack(planes, -1) if channels else planes[0]
    if dtype == np.bool_:
        return picture > 0.5
    if np.issubdtype(dtype, np.integer):
        return np.rint(picture * np.iinfo(dtype).max).astype(dtype)
    return (picture * 3 - 1).astype(dtype)


def setting(grid, order=2, seed=1, level=0, machine=REFERENCE):
    """What a schedule is told of a level."""
    return Setting(machine, grid, neighbourhood_offsets(order), order, seed, level)


class Problem(NamedTuple):
    """A field half-way through a relaxation: everything in NumPy arrays."""

    sample: Sample
    order: int
    grid: Grid
    field: Field
    sites: np.ndarray
    edges: str
    phases: int
    nowhere: float = 0.0
    regular: bool = False
    between: bool = False
    soft: int = 0

    @property
    def confidences(self):
        """Guides, and hard data, which count more."""
        guides = len(self.sample.guides)
        return Confidences(guides, guides > 0 or self.nowhere > 0, np.float32(2), np.float32(3.625))

    @property
    def offsets(self):
        return neighbourhood_offsets(self.order)

    def places(self):
        return self.sample.places(self.offsets, self.grid.step, self.phases, self.edges)

    def candidates(self, machine, every=False):
        return self.sample.candidates(machine, self.places(), every=every)

    def square(self, machine, every=False):
        return square_of(machine, self.sample, self.places(), every)

    def penalty(self, dear=1.0, every=False):
        """Of each candidate, or with ``every`` place: some cost nothing, some much in terms of a distance."""
        candidates = self.candidates(REFERENCE, every)
        scale = dear * self.sample.variance * len(self.offsets) * self.sample.channels
        penalty = scale * np.random.default_rng(candidates.size).choice([0, 0, 0.1, 1, 2], candidates.size + TAIL)
        allowed = self.places().allowed
        if every and allowed is not None:
            penalty[: candidates.size][~allowed] = np.inf
        return penalty.astype(np.float32)

    def phased(self, machine, every=False):
        """Phases of each candidate, or place, and of each site, a quarter of them equal; None without."""
        if not self.regular:
            return None
        rng, candidates = np.random.default_rng(7), self.candidates(REFERENCE, every).size
        waves = rng.choice([0, 0, 40, 97], (4, candidates + TAIL)).astype(np.float32)
        here = rng.choice([0, 40], (4, *self.field.source.shape)).astype(np.uint16)
        return Phased(machine.put(waves), machine.put(here), np.float32(3), np.float32(15000))

    def in_phase(self, machine):
        """Candidates of 12 phases, of which one has none of its own, and the phase of each site; None without."""
        if not self.regular:
            return None
        rng = np.random.default_rng(11)
        of = rng.integers(1, 12, self.candidates(REFERENCE).size).astype(np.int32)
        here = rng.integers(0, 12, self.field.source.shape).astype(np.int32)
        return InPhase(*map(machine.put, (*in_phase(of, (3, 4)), here)))

    def scattered(self, machine):
        """Up to 3 data around each site, some unknown in some channels; None without."""
        if not self.between:
            return None
        rng, channels = np.random.default_rng(8), self.sample.channels
        begin = np.zeros(self.field.source.size + 1, np.int32)
        begin[self.sites + 1] = rng.integers(0, 4, self.sites.size)
        begin, reach = np.cumsum(begin, dtype=np.int32), int(self.offsets.max()) * self.grid.step
        apart = rng.integers(-reach, reach + 1, (begin[-1] + 1, 2))
        values = rng.integers(0, self.sample.top + 1, (begin[-1] + 1, channels)).astype(np.uint16)
        values[rng.random(values.shape) < 0.2] = UNKNOWN
        put = (begin, (apart @ [self.sample.cols, 1]).astype(np.int32), values)
        return ScatteredData(*map(machine.put, put), np.float32(1.5))

    def kinds(self, machine, every=False):
        """So many kinds of each candidate, or place, of four that there are, some excluded here and there; or None."""
        if not self.soft:
            return None
        rng, candidates = np.random.default_rng(9), self.candidates(REFERENCE, every).size
        of = rng.integers(0, 4, (self.soft, candidates + TAIL)).astype(np.uint16)
        dear = rng.choice([0, 0, 700.5, 90000.25, EXCLUDED], (4, *self.field.source.shape)).astype(np.float32)
        return Kinds(machine.put(of), machine.put(dear))

    def costs(self, machine, dear=1.0, every=False, coherence=0.0, novelty=0.0):
        """The penalties of the candidates, or places, their phases, data between the sites, and kinds."""
        penalty, phased = machine.put(self.penalty(dear, every)), self.phased(machine, every)
        factors = np.float32(1 / (1 + coherence)), np.float32(novelty * self.sample.variance)
        return Costs(penalty, *factors, phased, self.scattered(machine), self.kinds(machine, every))

    def relaxation(
        self,
        machine,
        exact=False,
        chance=4,
        gibbs=False,
        density=False,
        bandwidth=0.5,
        seed=2**33 + 5,
        level=0,
        **costs,
    ):
        """The relaxation of the sites by the coherent search, or the exact one; it costs nothing unless told."""
        candidates, square = self.candidates(machine, exact), self.square(machine, exact)
        proposal = AllCandidates(candidates, square)
        if not exact:
            proposal = CandidateList(candidates, square, len(self.offsets), chance, self.in_phase(machine))
        terms = self.costs(machine, every=exact, **{"dear": 0.0} | costs)
        choice = lcpdf.SiteChoice(gibbs, density, self.window(bandwidth)[0])
        offsets = machine.put(self.offsets)
        return Relaxation(self.grid, offsets, proposal, terms, choice, -1024, seed, level, self.confidences)

    def cost(self, **how):
        """The costs (places, sites) of all candidates by the reference."""
        return self.relaxation(REFERENCE, exact=True, **how).evaluate(self.sites, self.field, 3).cost

    def on(self, machine):
        """Sites, field and offsets as arrays of a machine."""
        field = Field(*(machine.put(a) for a in self.field))
        return machine.put(self.sites), field, machine.put(self.offsets)

    def window(self, bandwidth=1.0):
        n = len(self.offsets)
        count = self.candidates(REFERENCE).size
        h = bandwidth * lcpdf.optimal_bandwidth(self.sample.variance, count, self.sample.channels * (n + 1))
        return lcpdf.window(h, self.sample.top), h

    # For plain loops: whole pictures, and (row, column) in pixels instead of numbers of sites.

    def in_picture(self, array):
        """An array over sites, in pictures that are 0 between the sites."""
        picture = np.zeros((*array.shape[: -len(self.grid.shape)], *self.grid.pixels), array.dtype)
        self.grid.decimated(picture)[...] = array
        return picture

    def image(self):
        return list(self.in_picture(self.field.values))

    def temperature(self):
        return self.in_picture(self.field.temperature) / 1024

    def where(self):
        return [tuple(n * self.grid.step for n in divmod(int(site), self.grid.cols)) for site in self.sites]

    def source(self):
        """(row, column) in the padded sample of each site's source."""
        return np.stack(np.divmod(self.in_picture(self.field.source), self.sample.cols), -1)

    def padded(self):
        return [channel.reshape(self.sample.rows, self.sample.cols) for channel in self.sample.working]

    def positions(self):
        """(row, column) in the padded sample of each candidate."""
        found = self.candidates(REFERENCE)
        return [divmod(int(p), self.sample.cols) for p in found.positions[: found.size]]


def problem(
    seed=0,
    *,
    order=2,
    channels=1,
    sample_shape=(12, 11),
    shape=(9, 8),
    spacing=1,
    torus=True,
    dtype=np.uint8,
    temperatures="mixed",
    edges="whole",
    phases=64,
    count=None,
    weight=0.0,
    guides=0,
    nowhere=0.0,
    masked=0.0,
    regular=False,
    between=False,
    soft=0,
):
    """A problem from a seed. A third of its sites stand beside what their neighbours were taken from.

    ``guides`` channels of a guide, unknown at a quarter of the sites; ``nowhere`` share of the sites that are hard
    data, whose structure is unknown; ``masked`` share of the sample's pixels that may not be used;
    ``regular`` whether candidates and sites have phases; ``between`` whether data lie between the sites; ``soft`` kinds
    of a candidate.
    """
    rng = np.random.default_rng(seed)
    offsets = neighbourhood_offsets(order)
    pixels = texture(sample_shape, channels, dtype, seed)
    margin = int(offsets.max()) * spacing
    guide = None
    if guides:
        silent = rng.random((*shape, 1)) < 0.25
        told = np.where(silent, np.nan, rng.random((*shape, guides)))
        guide = Guide((rng.random((*sample_shape, guides)),), told, False, 1.0)
    if masked:
        usable = (rng.random(sample_shape) >= masked,)
        pixels = Pictures((pixels,), usable=usable)
    heavy = 16 if guides or nowhere else 1
    values = heavy * ((channels + bool(weight) + guides) * len(offsets) + bool(guides))
    sample = Sample(pixels, values, margin, weight, guides=[guide] if guide else [])
    grid = Grid.of(shape, spacing, torus)
    row, col = np.indices(shape)
    scattered = rng.integers(0, sample_shape, (*shape, 2))
    shifted = np.stack([row % sample_shape[0], col % sample_shape[1]], -1)
    place = np.where(rng.random(shape)[..., None] < 0.4, shifted, scattered) + margin
    source = (place[..., 0] * sample.cols + place[..., 1]).astype(np.int32)
    values = sample.working[:, source]
    t = {
        "mixed": rng.choice([0, 1024, *rng.integers(0, 1025, 6)], shape),
        "zero": np.zeros(shape, int),
        "one": np.full(shape, 1024),
    }[temperatures]
    sites = np.arange(grid.size, dtype=np.int32)
    sites = rng.permutation(sites)[: count or sites.size].astype(np.int32)
    if guides:
        values[-guides:] = sample.guides
    if nowhere:
        hard = rng.random(shape) < nowhere
        source, t = np.where(hard, np.int32(-1), source), np.where(hard, 0, t)
        if weight:
            values[channels, hard] = UNKNOWN
    field = Field(*(grid.decimated(plane).copy() for plane in (values, source, t.astype(np.uint16))))
    return Problem(sample, order, grid, field, sites, edges, phases, nowhere, regular, between, soft)


@st.composite
def problems(draw, max_order=9, channels=(1, 2, 3)):
    """Problems of any small shape, order, spacing and boundary."""
    order = draw(st.integers(1, max_order))
    spacing = draw(st.sampled_from([1, 2, 4]))
    reach = int(neighbourhood_offsets(order).max())
    edges = draw(st.sampled_from(["whole", "reflect"]))
    least = 2 * reach * spacing + 1 if edges == "whole" else 2
    side = st.integers(least, least + 6)
    return problem(
        draw(st.integers(0, 2**16)),
        order=order,
        channels=draw(st.sampled_from(channels)),
        sample_shape=(draw(side), draw(side)),
        shape=(draw(st.integers(1, 12)), draw(st.integers(1, 12))),
        spacing=spacing,
        torus=draw(st.booleans()),
        dtype=draw(st.sampled_from([np.uint8, np.uint16, np.float32])),
        temperatures=draw(st.sampled_from(["mixed", "zero", "one"])),
        edges=edges,
        phases=64,
        count=draw(st.sampled_from([1, 7, 24, 37])),  # PoCL compiles anew for each
        regular=draw(st.booleans()),
        between=draw(st.booleans()),
        soft=draw(st.sampled_from([0, 0, 1, 2])),
    )


def host(machine, arrays):
    """NumPy arrays of what an operation returned."""
    return [np.asarray(machine.get(a)) for a in arrays]


def assert_same_bits(ours, theirs):
    """Two arrays, or two sequences of them, have the same type, shape and bytes."""
    if not isinstance(ours, np.ndarray):
        assert len(ours) == len(theirs)
        for a, b in zip(ours, theirs, strict=True):
            assert_same_bits(a, b)
        return
    assert (ours.dtype, ours.shape) == (theirs.dtype, theirs.shape)
    different = np.argwhere((ours != theirs) & ((ours == ours) | (theirs == theirs)))  # NaN is NaN
    assert not len(different), (
        f"{len(different)} of {ours.size} differ, first at {different[0]}: "
        f"{ours[tuple(different[0])]} and {theirs[tuple(different[0])]}"
    )
    assert ours.tobytes() == theirs.tobytes()


def check_chi_square(counts, probabilities):
    """Pearson's test; outcomes expected less than 5 times are taken together."""
    expected = probabilities / probabilities.sum() * counts.sum()
    rare = expected < 5
    if rare.any():
        counts = np.append(counts[~rare], counts[rare].sum())
        expected = np.append(expected[~rare], expected[rare].sum())
        if expected[-1] < 5:  # all the rare ones are rare together
            least = expected[:-1].argmin()
            counts[least] += counts[-1]
            expected[least] += expected[-1]
            counts, expected = counts[:-1], expected[:-1]
    assert expected.size >= 3, "there is something to draw from"
    assert chisquare(counts, expected).pvalue > SIGNIFICANCE


def laid_out(machine, pixels, shape, options, seed):
    """A run of the method mrf on a machine."""
    return mrf.plan(Pictures((pixels,)), shape, options).on(machine, seed)


def sweeps(run, state=None, watch=ignore):
    """The level, the state and the info after every sweep of a run, to its end."""
    state = run.begin() if state is None else state
    while not run.ended(state):
        state, info = run.step(state, watch)
        if info.sweep:
            yield run.level(info.level), state, info


def analyse(machine, pixels, **options):
    """The analysis of a sample by options of ``multires``."""
    from simdtex.methods.multires import analysis
    from simdtex.methods.multires.options import Options

    return analysis.analyse(machine, pixels, Options(**options))


def ising(machine, size, temperatures, schedule, seed=1, callback=None, **settings):
    """Chains of the Ising model."""
    from simdtex.jobs.studies.ising import Experiment, ising

    return ising(machine, Experiment(size, temperatures, **settings), schedule, seed=seed, callback=callback)


BASES = {
    "square": ((12, 0), (0, 12)),
    "tall": ((17, 0), (0, 7)),
    "brick": ((11.5, -16), (11.5, 16)),
    "hexagons": ((16.7, 34.2), (36.2, -0.8)),
    "oblique": ((9.3, 4.1), (-3.2, 11.9)),
    "weave": ((6.5, 6.2), (6.4, -6.1)),
}


def spots(basis, shape=(96, 110), origin=(0.0, 0.0), noise=20, channels=1, seed=1):
    """A picture of a bright spot and a dark one in every cell of a lattice."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    at = Lattice(*basis, origin).phases(y, x)
    near = [
        np.exp(-40 * ((np.mod(at + 0.5 - np.reshape(c, (2, 1, 1)), 1) - 0.5) ** 2).sum(0)) for c in ((0, 0), (0.3, 0.4))
    ]
    picture = 120 + 100 * near[0] - 60 * near[1]
    rng = np.random.default_rng(seed)
    grey = np.clip(picture[..., None] + rng.normal(0, noise, (*shape, channels)), 0, 255)
    return grey.astype(np.uint8)

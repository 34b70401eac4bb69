"""The machine of library code that devices are compared with does the same jobs, to the accuracy of its arithmetic."""

import numpy as np
import pytest
from cases import REFERENCE, problem, texture
from scipy.stats import chisquare
from test_relax import relaxation
from tolerances import FFT, MATRIX_PRODUCT, SIGNIFICANCE

import simdtex
from simdtex.bench import library as module
from simdtex.bench.cases import Case, searches
from simdtex.bench.library import Library
from simdtex.driver import drive
from simdtex.methods import multires
from simdtex.methods.pyramid.pyramids import Transform
from simdtex.ops import lcpdf
from simdtex.ops.candidates import candidates
from simdtex.ops.filters import bank, filters
from simdtex.ops.neighbourhood import neighbourhood
from simdtex.ops.sort import sort

LIBRARY = Library()


@pytest.mark.parametrize("temperatures", ["mixed", "zero", "one"])
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("table", [module.TABLE, 600])
def test_distances_are_those_of_equation_12(temperatures, channels, table, monkeypatch):
    monkeypatch.setattr(module, "TABLE", table)  # the whole right factor, or some candidates at a time
    given = problem(3, order=8, channels=channels, sample_shape=(16, 15), temperatures=temperatures)
    exact, _ = given.distances(REFERENCE)
    machine = Library()
    found, _ = given.distances(machine)
    largest = channels * len(given.offsets) * 255**2
    assert found.distance.shape == exact.distance.shape
    assert abs(found.distance - exact.distance).max() < MATRIX_PRODUCT * largest
    assert machine.used["distance"] == 1


def test_a_right_factor_is_made_anew_for_other_candidates_and_temperatures():
    machine = Library()
    for seed, temperatures in ((1, "zero"), (1, "mixed"), (2, "mixed"), (2, "zero")):
        given = problem(seed, temperatures=temperatures)
        exact, found = given.distances(REFERENCE)[0], given.distances(machine)[0]
        assert abs(found.distance - exact.distance).max() < MATRIX_PRODUCT * len(given.offsets) * 255**2


def test_coherence_favours_the_same_candidates_once():
    given = problem(5, order=8, sample_shape=(16, 15))
    exact, found = given.distances(REFERENCE, 1.0)[0], given.distances(Library(), 1.0)[0]
    assert (exact.distance != given.distances(REFERENCE)[0].distance).any()
    assert abs(found.distance - exact.distance).max() < MATRIX_PRODUCT * len(given.offsets) * 255**2


def test_a_step_as_one_operation_takes_the_nearest():
    given = problem(5, order=8, sample_shape=(16, 15))
    exact, candidates = given.distances(REFERENCE, 1.0)
    sites, field, _ = given.on(LIBRARY)
    rule = relaxation(LIBRARY, given, exhaustive=True)
    relaxed, _ = LIBRARY.relax_apart(sites, field, np.zeros(0, np.int32), rule, 1)
    chosen = candidates.index_of[relaxed.choice]
    distance = exact.distance[chosen, np.arange(sites.size)]
    assert (distance - exact.distance.min(0) < MATRIX_PRODUCT * len(given.offsets) * 255**2).all()
    assert (relaxed.values == candidates.pixels[:, relaxed.choice]).all()


@pytest.mark.parametrize("torus", [False, True])
def test_filters_are_those_of_the_bank(torus):
    rng = np.random.default_rng(1)
    picture = rng.integers(-(2**20), 2**20, (2, 17, 24), dtype=np.int32)
    args = picture, picture // 3, bank(4, 1.0, 7), torus
    exact, found = REFERENCE.run(filters, *args), LIBRARY.run(filters, *args)
    assert found.dtype == exact.dtype
    assert found.shape == exact.shape
    assert abs(found - exact).max() <= 1 + FFT * 2**20
    assert abs(exact).max() > 1000 * FFT * 2**20


@pytest.mark.parametrize("torus", [False, True])
@pytest.mark.parametrize("shape", [(32, 48), (33, 20)])
def test_pyramids_are_those_of_the_reference(torus, shape):
    picture = np.random.default_rng(2).integers(-(2**20), 2**20, (2, *shape), dtype=np.int32)
    ours, theirs = (Transform(machine, "steerable", 2, 4, torus) for machine in (LIBRARY, REFERENCE))
    exact = theirs.make(picture)
    for one, other in zip(ours.make(picture), exact, strict=True):
        assert abs(one - other).max() <= 8 + FFT * 2**20
    assert abs(ours.collapse(exact) - theirs.collapse(exact)).max() <= 8 + FFT * 2**20


def test_sorting_sorts():
    values = np.random.default_rng(3).integers(-50, 50, (3, 1000), dtype=np.int32)
    order = LIBRARY.run(sort, values, np.arange(1000, dtype=np.int32))
    assert (np.take_along_axis(values, order, 1) == np.sort(values, 1)).all()
    assert (np.sort(order, 1) == np.arange(1000)).all()


class Beside(Library):
    """Looks up every pixel's candidates by the twin, too; with so few values that many lie on a threshold."""

    def candidates(self, structure, sampled, level, first, end, match, seed):
        coarse = int(structure.features.max()) // 8 + 1
        structure = structure._replace(features=structure.features // coarse, threshold=structure.threshold // coarse)
        twin = sampled._replace(source=sampled.source.copy(), counts=sampled.counts.copy())
        twin = candidates.reference(structure, twin, level, first, end, match, seed)
        found = super().candidates(structure, sampled, level, first, end, match, seed)
        here = slice(sampled.lattice[level, 2] + first, sampled.lattice[level, 2] + end)
        assert (found.counts[here, 0] == twin.counts[here, 0]).all()
        self.chosen = getattr(self, "chosen", 0) + (found.source[here] == twin.source[here]).mean()
        return found


@pytest.mark.parametrize("parity", ["match", "free"])
@pytest.mark.parametrize("shape", [(32, 32), (24, 40)])
def test_pixels_have_as_many_candidates(parity, shape):
    machine, pixels = Beside(), texture((32, 32))[..., None]
    options = multires.Options(parity=parity, alpha=0.6, edges="keep")
    _, run = drive(multires.Plan(pixels, shape, options), machine, 1)
    assert machine.used["candidates"] >= 4
    assert run.stages[-1].candidates.max() > 1
    assert machine.chosen > 0  # where there is one candidate, both choose it


def test_candidates_are_drawn_one_like_the_other(monkeypatch):
    monkeypatch.setattr(module, "QUERIES", 100)  # in several turns
    machine, pixels = Library(), texture((32, 32))[..., None]
    options = multires.Options(alpha=np.inf, edges="keep")  # all are candidates of all
    _, run = drive(multires.Plan(pixels, (64, 64), options), machine, 1)
    source = run.stages[-1].source
    row, col = np.indices((64, 64))
    assert (source[..., 0] % 2 == row % 2).all() and (source[..., 1] % 2 == col % 2).all()
    node = source[..., 0] // 2 * 16 + source[..., 1] // 2
    assert chisquare(np.bincount(node.ravel(), minlength=256)).pvalue > SIGNIFICANCE


@pytest.mark.parametrize(
    ("method", "needs"),
    [
        ("mrf", {"relax"}),
        ("multires", {"filters", "candidates"}),
        ("pyramid", {"split", "join", "sort"}),
    ],
)
def test_jobs_use_the_libraries(method, needs):
    machine, sample = Library(), texture((24, 24))
    options = Case("mrf", 24, 20, 2, searches()[0]).options | {"finish": 0.0} if method == "mrf" else {}
    made = simdtex.synthesize(sample, (20, 28), method=method, rng=1, device=machine, **options)
    assert made.shape == (20, 28)
    assert method == "multires" or np.isin(made, sample).all()
    assert needs <= set(machine.used)


def test_distances_choose_as_the_reference_does_where_nothing_is_near_a_tie():
    given = problem(7, order=8, sample_shape=(16, 15), temperatures="mixed")
    sites, field, offsets = given.on(REFERENCE)
    near = neighbourhood(REFERENCE, sites, field, offsets, given.grid)
    candidates = given.candidates(REFERENCE)
    exact, found = lcpdf.distance(REFERENCE, near, candidates), LIBRARY.distance(near, candidates)
    two = np.sort(exact.distance, 0)[:2]
    clear = two[1] - two[0] > 2 * MATRIX_PRODUCT * len(given.offsets) * 255**2
    assert clear.mean() > 0.5
    assert (exact.distance.argmin(0) == found.distance.argmin(0))[clear].all()

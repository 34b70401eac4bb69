"""The LCPDF: distances, densities and draws against equations (6) to (8) and (12) in plain float64."""

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits, check_chi_square, opencl, problem, problems
from hypothesis import given, settings
from hypothesis import strategies as st
from test_relax import apart
from tolerances import LCPDF

import simdtex
from simdtex.methods.mrf import lcpdf


def plain_distances(p):
    x, t, y = p.image(), p.temperature(), p.padded()
    return np.array(
        [
            [plain.distance(x, t, site, y, position, p.order, p.grid.step, p.grid.torus) for site in p.where()]
            for position in p.positions()
        ]
    )


@given(problems(max_order=5))
@settings(max_examples=20)
def test_the_distance_is_equation_12(p):
    p = p._replace(regular=False, between=False, soft=0)
    ours = p.cost()
    # float32 holds 24 bits; the rounding of each of at most 60 terms adds half a unit in the last place.
    np.testing.assert_allclose(ours, plain_distances(p), rtol=60 * 2.0**-24, atol=0)


@given(st.integers(0, 100), st.sampled_from([1, 2, 8]), st.sampled_from([1, 3]))
@settings(max_examples=20)
def test_the_optimal_bandwidth_is_equation_8(seed, order, channels):
    p = problem(seed, order=order, channels=channels)
    _, h = p.window()
    formula = plain.optimal_bandwidth(p.sample.levels[0], len(p.positions()), len(p.offsets))
    assert h == pytest.approx(formula, rel=1e-12)


@pytest.mark.parametrize("h", [0.05, 0.4, 7.3, 5000.0])
def test_the_tables_of_a_bandwidth(h):
    win = lcpdf.window(h, 255)
    k = np.arange(win.radius + 1)
    gauss = np.exp(-(k**2) / (2 * h * h))
    np.testing.assert_allclose(win.gauss, gauss, rtol=2.0**-23)
    assert win.gauss.min() >= 2.0**-126, "no subnormal, which a device may take for 0"
    assert win.scale == np.float32(1 / (2 * h * h))
    assert win.radius == 255 or np.exp(-((win.radius + 1) ** 2) / (2 * h * h)) < 2.0**-33
    steps = np.concatenate([gauss[:0:-1], gauss])
    cumulative = np.cumsum(steps) / steps.sum()
    np.testing.assert_allclose(win.noise / 2.0**32, cumulative, atol=2.0**-32 * win.noise.size)
    assert (np.diff(win.noise.astype(np.int64)) >= 0).all()


def formula(image, sample, sites, order, bandwidth=1.0, temperature=None, greys=256, boundary="torus"):
    t = np.zeros(image.shape) if temperature is None else np.rint(temperature * 1024) / 1024
    positions = plain.whole_positions(sample.shape, order)
    h = bandwidth * plain.optimal_bandwidth([sample], len(positions), len(plain.offsets(order)))
    rows = []
    for site in sites:
        d = [plain.distance([image], t, site, [sample], p, order, 1, boundary == "torus") for p in positions]
        rows.append(plain.mixture(d, [sample[p] for p in positions], h, greys))
    return np.array(rows)


def check_lcpdf(machine, image, sample, sites, **options):
    ours = simdtex.lcpdf(image, sample, sites, device=machine, **options)
    exact = formula(image, sample, sites, **options)
    assert ours.dtype == np.float64
    assert ours.shape == exact.shape
    assert abs(ours - exact).max() < LCPDF
    assert abs(ours.sum(1) - 1).max() < LCPDF
    return ours


@given(
    st.integers(1, 5),
    st.tuples(st.integers(1, 6), st.integers(1, 6)),
    st.tuples(st.integers(5, 9), st.integers(5, 9)),
    st.sampled_from([2, 3, 16, 100]),
    st.sampled_from(["torus", "open"]),
    st.integers(0, 1000),
)
@settings(max_examples=25)
def test_lcpdf_is_the_formula_for_any_shape_and_levels(order, shape, sample_shape, levels, boundary, seed):
    rng = np.random.default_rng(seed)
    image, sample = rng.integers(0, levels, shape), rng.integers(0, levels, sample_shape)
    sample[0, :2] = 0, 1  # its variance is above 0
    sites = rng.integers(0, shape, (3, 2))
    check_lcpdf(
        REFERENCE, image, sample, sites, order=order, greys=levels, boundary=boundary,
        temperature=rng.random(shape),
    )  # fmt: skip


def test_lcpdf_of_a_device_has_the_references_bits_and_is_the_formula(cl_device, machine):
    rng = np.random.default_rng(4)
    for levels, order, boundary, bandwidth in [(256, 2, "torus", 0.15), (17, 8, "open", 3.0), (4096, 1, "torus", 1.0)]:
        image, sample = rng.integers(0, levels, (8, 7)), rng.integers(0, levels, (9, 12))
        sites, t = rng.integers(0, (8, 7), (11, 2)), rng.random((8, 7))
        options = {"order": order, "greys": levels, "boundary": boundary, "temperature": t, "bandwidth": bandwidth}
        check_lcpdf(REFERENCE, image, sample, sites[:2], **options)
        expected = simdtex.lcpdf(image, sample, sites, device=REFERENCE, **options)
        for m in (machine, opencl(cl_device, scratch=2**13, vector=4)):  # which holds few sites
            assert_same_bits(simdtex.lcpdf(image, sample, sites, device=m, **options), expected)


def test_lcpdf_of_a_constant_sample_and_of_no_site():
    constant = np.full((5, 5), 7, np.uint8)
    table = simdtex.lcpdf(constant, constant, [(0, 0)], order=1, device=REFERENCE)
    assert table.argmax() == 7
    assert table.sum() == pytest.approx(1, abs=LCPDF)
    assert simdtex.lcpdf(constant, constant, [], order=1, device=REFERENCE).shape == (0, 256)


GREY = np.arange(42, dtype=np.uint8).reshape(6, 7)


def test_bad_input_is_one_clear_sentence():
    given = {"image": GREY, "sample": GREY, "sites": [(0, 0)], "order": 2, "device": "reference"}
    for change, error, words in [
        ({"order": 16}, ValueError, "the largest order that fits is 8"),
        ({"bandwidth": 0}, ValueError, "bandwidth is 0; give a number above 0"),
        ({"greys": 1}, ValueError, "greys is 1; give 2 or more"),
        ({"greys": 40}, ValueError, "holds 0 to 41, beyond 0 to 39"),
        ({"boundary": "mirror"}, ValueError, "choose one of: torus, open"),
        ({"image": GREY.astype(float)}, TypeError, "image must hold integers"),
        ({"sample": GREY[:0]}, ValueError, "sample must be a .* not empty"),
        ({"sites": [(0, 0, 0)]}, ValueError, "sites must be an"),
        ({"sites": [(6, 0)]}, ValueError, "outside the image of 6 rows x 7 columns"),
        ({"temperature": np.zeros((2, 2))}, ValueError, r"temperature has shape \(2, 2\)"),
        ({"temperature": np.full(GREY.shape, 1.5)}, ValueError, "between 0 and 1"),
    ]:
        with pytest.raises(error, match=words):
            simdtex.lcpdf(**given | change)


DRAWS = 5_000
SEEDS = (1, 2**33 + 7, 2**64 - 1)


def draw_many(p, win, density, strength=0.0):
    """Draws at the problem's first site, each under another site's number and over several seeds."""
    drawn, places = [], np.arange(DRAWS)
    for seed in SEEDS:
        rule = p.relaxation(REFERENCE, exact=True, coherence=strength, seed=seed, level=1)
        rule = rule._replace(choice=lcpdf.SiteChoice(True, density, win))
        numbers, cost = rule.evaluate(p.sites[:1], p.field, 3)
        many, noise = np.repeat(cost, DRAWS, 1), rule.noise(numbers, places, 3)
        found = lcpdf.taken(numbers, many, noise, p.candidates(REFERENCE), places, rule.choice, lcpdf.Key(seed, 1, 3))
        drawn.append(found)
    choice, values = (np.concatenate(a, -1) for a in zip(*drawn, strict=True))
    return choice, values


def reweighted(p, strength):
    """d_p at the problem's first site, divided by 1 + coherence where the candidate continues a neighbour."""
    site, t = p.where()[0], p.field.temperature
    continuing = plain.coherent(p.source(), t, site, p.order, p.grid.step, p.grid.torus) if strength else ()
    x, y = p.image(), p.padded()
    found = []
    for position in p.positions():
        d = plain.distance(x, p.temperature(), site, y, position, p.order, p.grid.step, p.grid.torus)
        found.append(d / (1 + strength) if position in continuing else d)
    return np.array(found)


CASES = [(1, 1.0, "mixed", 1.0, True), (4, 1.5, "mixed", 5.0, False)]
"""Order, bandwidth, temperatures, coherence, and whether the lattice is a torus."""


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_draw_of_a_grey_level_follows_the_density(case):
    order, bandwidth, temperatures, strength, torus = case
    p = problem(1, order=order, temperatures=temperatures, torus=torus, shape=(7, 8))
    win, h = p.window(bandwidth)
    _, values = draw_many(p, win, True, strength)
    density = plain.mixture(reweighted(p, strength), [p.padded()[0][q] for q in p.positions()], h, 256)
    check_chi_square(np.bincount(values[0], minlength=256), density)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_draw_of_a_source_follows_the_weights(case):
    order, bandwidth, temperatures, strength, torus = case
    p = problem(3, order=order, channels=3, temperatures=temperatures, torus=torus, shape=(7, 8))
    win, h = p.window(bandwidth)
    choice, values = draw_many(p, win, False, strength)
    d = reweighted(p, strength)
    weights = np.exp(-(d - d.min()) / (2 * h * h))
    where = p.candidates(REFERENCE)
    counts = np.bincount(where.index_of[choice], minlength=len(weights))
    check_chi_square(counts, weights)
    assert np.array_equal(values, p.sample.working[:, choice])


def test_draws_are_legal_where_half_of_the_kernel_is_not():
    black = np.zeros((6, 6), np.uint8)
    black[0, 0] = 1
    p = problem(1, order=1)
    p.sample._lay([black[None].astype(np.uint16)], 0)
    p = p._replace(field=p.field._replace(source=np.zeros_like(p.field.source), values=p.field.values * 0))
    for h in (0.5, 40.0, 1e6):
        win = lcpdf.window(h, 255)
        _, values = draw_many(p, win, True)
        steps = np.exp(-(np.arange(256) ** 2) / (2 * h * h))
        if h > 0.5:
            check_chi_square(np.bincount(values[0], minlength=256), steps)
        assert values.max() <= 255


@pytest.mark.parametrize("gibbs", [False, True], ids=["mode", "draw"])
def test_choices_near_the_ends_of_the_levels_have_the_references_bits(machine, gibbs):
    """A wide kernel around black and white pixels."""
    p = problem(8, order=1, channels=3, shape=(9, 9))
    extremes = np.where(p.sample.levels[0] > 127, 255, 0).astype(np.uint16)
    p.sample._lay([extremes], p.sample.margin)
    how = {"exact": True, "density": True, "gibbs": gibbs, "bandwidth": 3.0}
    assert_same_bits(apart(machine, p, **how), apart(REFERENCE, p, **how))

"""Values of the output that are given stay; samples, masks, gaps, guides and kinds of variables do what they say."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, texture

import simdtex
from simdtex.methods.mrf.conditioning import centre_known, heaviest
from simdtex.methods.mrf.options import Options
from simdtex.model.given import MOST_NEAR, Given, nearest_data, planes, stand_ins
from simdtex.model.lattice import Grid
from simdtex.model.sample import Sample
from simdtex.schedules import SCHEDULES


def run(sample, shape, rng=3, **options):
    """Image and output on the reference."""
    return simdtex.synthesize(sample, shape, rng=rng, device=REFERENCE, full_output=True, **options)


def anything(shape, dtype, seed):
    """Any values of a type, also such as no sample has."""
    rng = np.random.default_rng(seed)
    if dtype == np.bool_:
        return rng.random(shape) < 0.5
    if np.issubdtype(dtype, np.integer):
        return rng.integers(np.iinfo(dtype).min, np.iinfo(dtype).max, shape, dtype, endpoint=True)
    return (rng.normal(size=shape) * 1e3).astype(dtype)


def keeps(sample, known, **options):
    """Run; what is known comes out to the bit, from nowhere, and cold."""
    axis = -1 if sample.ndim == 3 else None
    image, output = run(sample, known.shape[:2], known=known, channel_axis=axis, **options)
    there = ~np.ma.getmaskarray(known)
    assert_same_bits(image[there], known.data[there])
    whole = there.all(-1) if axis else there
    assert (output.source[whole] == -1).all()
    assert (output.source[~whole] >= 0).all()
    assert not output.temperature.any()
    return image


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_known_values_stay_under_every_schedule(schedule):
    number = [*SCHEDULES].index(schedule)
    search = ("exact", "coherent")[number // 2 % 2]
    known = np.ma.masked_array(anything((8, 9), np.uint8, number), np.random.default_rng(number).random((8, 9)) > 0.3)
    options = {"schedule": schedule, "search": search, "order": 2, "levels": 2, "free_sweeps": 3}
    torus = {"boundary": ("torus", "open")[number % 2], "finish": 1.5}
    keeps(texture((9, 8)), known, **options, **torus)


@pytest.mark.parametrize(("dtype", "channels"), [(np.bool_, 2), (np.int32, None), (np.float64, 2)])
def test_known_values_of_every_type_stay(dtype, channels):
    shape = (9, 10, channels) if channels else (9, 10)
    values = anything(shape, dtype, 1)
    known = np.ma.masked_array(values, np.random.default_rng(1).random(shape) < 0.6)  # of two, some alone
    options = {"search": "coherent", "boundary": "open", "finish": 1.0, "balance": 2.0}
    keeps(texture((10, 9), channels, dtype), known, order=2, levels=2, **options)


@pytest.mark.parametrize(
    ("schedule", "search", "site"),
    [("coloring", "coherent", (5, 6)), ("luby", "exact", (0, 0)), ("raster", "exact", (5, 6))],
)
def test_all_is_known_but_one_site(schedule, search, site):
    """At a coarse level nothing is left to relax, then, or that one alone."""
    sample = texture((9, 10))
    known = np.ma.masked_array(texture((9, 10), seed=1), np.zeros((9, 10), bool))
    known[site] = np.ma.masked
    options = {"schedule": schedule, "search": search, "finish": 0.0, "free_sweeps": 2}
    assert keeps(sample, known, order=2, levels=3, **options)[site] in sample


def standing(torus, spacing, *data, shape=(9, 10)):
    known = np.zeros(shape, bool)
    for at in data:
        known[at] = True
    site, datum = stand_ins(known, Grid.of(shape, spacing, torus))
    return {divmod(int(s), shape[1]): divmod(int(d), shape[1]) for s, d in zip(site, datum, strict=True)}


def test_known_answers_of_stand_ins():
    assert standing(True, 1, (3, 3)) == {}
    assert standing(True, 4, (3, 3)) == {(4, 4): (3, 3)}
    assert standing(True, 4, (4, 4)) == {}, "on the lattice already"
    assert standing(True, 4, (3, 3), (0, 4)) == {}, "a site around it is known"
    assert standing(True, 4, (3, 3), (0, 0)) == {}, "whichever of the four"
    assert standing(True, 4, (3, 3), (8, 8)) == {(4, 4): (3, 3)}, "and no other"
    assert standing(True, 4, (3, 3), (5, 4)) == {(4, 4): (5, 4)}, "the nearest"
    assert standing(True, 4, (5, 4), (3, 4), (4, 5)) == {(4, 4): (3, 4)}, "of several the first, row by row"
    assert standing(True, 4, (2, 2)) == {(4, 4): (2, 2)}, "halves go down and to the right"
    assert standing(False, 4, (2, 9), shape=(9, 10)) == {(4, 8): (2, 9)}
    assert standing(True, 4, (4, 11), shape=(8, 12)) == {(4, 0): (4, 11)}, "around the seam"
    assert standing(False, 4, (4, 11), shape=(8, 12)) == {(4, 8): (4, 11)}, "but of no open lattice"


def test_the_planes_of_what_is_given():
    """Of a site from the sample all channels are known, of one from nowhere those that its values tell."""
    pixels = texture((9, 8))[..., None]
    sample = Sample(pixels, 16, 2, weight=2.0)
    values, known = np.full((2, 3, 1), 7, np.uint8), np.zeros((2, 3, 1), bool)
    place = np.full((2, 3, 2), -1, np.int32)
    known[0, 1] = known[1, 2] = True
    place[1, 2], values[1, 2] = (4, 5), pixels[4, 5]
    place[0, 0] = (1, 1)  # of a site that is not known
    laid = planes(Given(values, known, place), sample)
    assert laid.known.tolist() == known[..., 0].tolist()
    assert laid.values[:, 0, 1].tolist() == [7, 65535]
    assert laid.values[:, 1, 2].tolist() == sample.levels[0][:, 4, 5].tolist()
    assert laid.source.tolist() == [[-1, -1, -1], [-1, -1, (4 + 2) * (8 + 4) + 5 + 2]]


def patchwork(labels=2, size=16):
    """A sample in stripes of one texture each, a bit alike, and their labels."""
    label = np.repeat(np.arange(labels), size)[:, None] * np.ones(2 * size, int)
    rng = np.random.default_rng(2)
    return (rng.integers(0, 160, label.shape) + 40 * label).astype(np.uint8), label


def test_a_map_of_labels_is_obeyed():
    sample, label = patchwork(3)
    row, col = np.indices((24, 20))
    wanted = ((row // 8 + col // 10) % 3).astype(int)
    share = {}
    for weight in (10.0, 0.0):
        _, output = run(sample, wanted.shape, order=4, guide=(label, wanted), guide_weight=weight)
        share[weight] = (label[tuple(np.moveaxis(output.source, -1, 0))] == wanted).mean()
    assert share[10.0] > 0.93
    assert share[0.0] < 0.8, "else the guide tells nothing"


@pytest.mark.parametrize(("search", "phases"), [("exact", 1), ("coherent", 64)])
def test_nothing_is_taken_from_where_the_mask_is_false(search, phases):
    mask = np.random.default_rng(5).random((14, 13)) < 0.4
    sample = texture((14, 13))
    _, output = run(sample, (12, 11), mask=mask, search=search, order=2, phases=phases, edges="reflect")
    assert mask[tuple(np.moveaxis(output.source, -1, 0))].all()


def test_a_source_names_its_sample():
    samples = [texture((9, 12), seed=1), texture((12, 9), seed=2), texture((8, 8), seed=3)]
    image, output = run(samples, (14, 13), order=2, finish=0.0)
    assert output.source.shape == (14, 13, 3)
    for (i, j, n), value in zip(output.source.reshape(-1, 3), image.ravel(), strict=True):
        assert samples[n][i, j] == value
    assert set(output.source[..., 2].ravel().tolist()) == {0, 1, 2}


@pytest.mark.parametrize(("search", "edges"), [("exact", "whole"), ("coherent", "auto")])
def test_no_gap_of_a_sample_comes_out(search, edges):
    sample = texture((16, 15), dtype=np.float32)
    sample[4:8, 3:9] = np.nan
    sample[13, 2] = np.nan
    image, output = run(sample, (13, 12), search=search, order=2, edges=edges, finish=1.5)
    assert np.isfinite(image).all()
    assert np.isfinite(sample[tuple(np.moveaxis(output.source, -1, 0))]).all()


def test_a_known_variable_counts_more_than_all_neighbours_together():
    for weight, heavy in ((1.0, 6.0), (16.0, 16.0)):
        options = Options(data_weight=weight)
        assert (heaviest(options, 24), centre_known(options, 24)) == (heavy, round(4 * (24 * heavy) ** 0.5))
    assert heaviest(Options(data_weight=0.5), 2) == 1


def test_what_is_looked_at_from_one_sample_is_no_other():
    """A wide finish at the edge of a picture."""
    samples = [np.full((9, 9), value, np.uint8) + texture((9, 9), dtype=np.bool_, seed=value) for value in (3, 250)]
    image, output = run([*samples], (10, 10), order=1, levels=1, finish=4.0, shares=(1.0, 0.0))
    assert (output.source[..., 2] == 0).all()
    assert image.max() <= 4


@pytest.mark.parametrize(("kinds", "search"), [(2, "coherent"), (3, "exact")])
def test_categories_are_names(kinds, search):
    """Others in the same order make the same picture; and nothing comes between them."""
    cells = np.random.default_rng(kinds).integers(0, kinds, (12, 11))
    renamed = np.array([5, 7, 31])[:kinds]
    options = {"categorical": True, "search": search, "order": 2, "levels": 2}
    image, output = run(cells.astype(np.uint8), (10, 12), **options)
    again, elsewhere = run(renamed[cells].astype(np.float32), (10, 12), **options)
    assert_same_bits(renamed[image].astype(np.float32), again)
    assert_same_bits(output.source, elsewhere.source)


def test_a_unit_changes_nothing_where_variables_are_weighted():
    """Metres or millimetres."""
    sample = texture((12, 11), 2, np.float32)
    other = sample * np.float32([1, 1024])
    options = {"weights": (1.0, 0.7), "order": 2, "levels": 2, "channel_axis": -1}
    image, output = run(sample, (10, 12), **options)
    scaled, elsewhere = run(other, (10, 12), **options)
    assert_same_bits(image * np.float32([1, 1024]), scaled)
    assert_same_bits(output.source, elsewhere.source)


def near(place, grid, order):
    """{site: [(number of the datum, offset)]} of the data near the sites of a lattice."""
    found = {}
    for site, datum, apart in zip(*(one.tolist() for one in nearest_data(np.array(place), grid, order)), strict=True):
        found.setdefault(site, []).append((datum, tuple(apart)))
    return found


def test_a_site_is_compared_with_the_data_that_its_neighbourhood_reaches():
    found = near([(5, 6)], Grid.of((16, 16), 4), 1)
    assert found == {5: [(0, (1, 2))], 6: [(0, (1, -2))], 9: [(0, (-3, 2))], 10: [(0, (-3, -2))]}
    assert near([(13, 6)], Grid.of((16, 16), 4), 1)[1] == [(0, (-3, 2))], "around the seam"
    assert 1 not in near([(13, 6)], Grid.of((16, 16), 4, False), 1), "but of no open lattice"
    far = [one for those in near([(5, 6)], Grid.of((64, 64), 2), 18).values() for _, one in those]
    assert np.abs(far).max() == 8, "no farther along rows and columns than the neighbourhood, whatever its order"


def test_of_many_data_the_nearest_count():
    place = [(20, 20 + k) for k in range(1, 24)]
    here = near(place, Grid.of((64, 64), 8, False), 18)[2 * 8 + 2]
    assert [datum for datum, _ in here] == list(range(MOST_NEAR))
    other = near(place[::-1], Grid.of((64, 64), 8, False), 18)[2 * 8 + 2]
    assert [datum for datum, _ in other] == list(range(22, 22 - MOST_NEAR, -1))


@pytest.mark.parametrize("torus", [True, False])
def test_a_window_has_the_data_of_the_whole(torus):
    rng, grid = np.random.default_rng(2), Grid.of((40, 48), 4, torus)
    place = rng.integers(0, 40, (30, 2))
    whole, window = near(place, grid, 8), grid.window(7 if torus else 4, 9 if torus else 6, 6, 5)
    rows, cols = window.lines()
    expected = {a * 5 + b: whole.get(i * 12 + j, []) for a, i in enumerate(rows) for b, j in enumerate(cols)}
    assert near(place, window, 8) == {site: data for site, data in expected.items() if data}

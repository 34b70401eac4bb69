"""What an ensemble of realisations is judged by, on cases whose answers are known."""

import hashlib

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray
from scipy.ndimage import binary_dilation, binary_erosion
from scipy.special import kl_div

from simdtex.figures.show import Realisations
from simdtex.jobs.simulation import ensemble
from simdtex.jobs.simulation.ensemble import MARGIN, variogram


def noise(seed, shape=(6, 40, 50), values=2):
    return np.random.default_rng(seed).integers(0, values, shape).astype(np.uint8)


def test_categories_are_those_of_the_training_image_unless_they_are_named():
    image = np.array([[3, 1], [1, 7]], np.uint8)
    assert ensemble.categories_of(image).tolist() == [1, 3, 7]
    assert ensemble.categories_of(image, [7, 1, 3]).tolist() == [7, 1, 3]
    assert len(ensemble.categories_of(image, [])) == 0
    assert len(ensemble.categories_of(image.astype(float))) == 0
    assert len(ensemble.categories_of(np.arange(17).reshape(1, 17))) == 0
    assert len(ensemble.categories_of(np.arange(16).reshape(1, 16))) == 16
    assert ensemble.categories_of(image > 2).tolist() == [False, True]


def test_the_variogram_of_stripes():
    """Pixels on both sides of the border of a stripe differ by 2, so half the square is 2."""
    stripes = np.tile(np.arange(12) // 3 % 2 * 2.0, (5, 1))
    np.testing.assert_allclose(variogram(stripes, 1, 3), [0, 2 * 3 / 11, 2 * 6 / 10, 2])
    np.testing.assert_array_equal(variogram(stripes > 0, 0, 2), 0)


def test_connectivity_of_two_bars():
    image = np.zeros((30, 40), int)
    image[5:8] = 4
    image[15:18] = 4
    found = ensemble.connectivity(image, 4, 14)
    assert found.components == pytest.approx(2 * 1e4 / 1200) and found.largest == 0.5
    down, along = found.function
    np.testing.assert_array_equal(along, np.ones(15))
    np.testing.assert_array_equal(down[:3], 1)
    assert np.isnan(down[3:8]).all()  # no pair so far apart
    np.testing.assert_array_equal(down[8:13], 0)


def test_connectivity_of_a_broken_bar():
    image = np.zeros((20, 20), int)
    image[4, :8] = image[4, 10:] = 1
    found = ensemble.connectivity(image, 1, 9)
    # at a distance of 3 there are 5 + 7 pairs within the pieces, and 7 - 8, 6 - 9 ... across: columns 7 to 10
    assert found.function[1, 3] == pytest.approx(12 / 13)
    assert found.function[1, 1] == 1 and found.largest == pytest.approx(10 / 18)
    assert ensemble.connectivity(np.eye(6, dtype=int), 1, 2).components == pytest.approx(6e4 / 36), "by their sides"


def lines(*ends, width=8, shape=(100, 120)):
    """Bars with round ends between (row, column)s."""
    image = np.zeros(shape, np.uint8)
    place = np.moveaxis(np.indices(shape), 0, -1)
    for start, end in ends:
        along = np.subtract(end, start)
        share = np.clip(((place - start) @ along) / (along @ along), 0, 1)
        image[np.linalg.norm(place - start - share[..., None] * along, axis=-1) <= width / 2] = 1
    return image


MIDDLE = (50, 60)
LEFT, UP, DOWN = (50, -20), (-30, 140), (130, 140)
DRAWN = {
    "across": (lines((LEFT, (50, 140))), 0),
    "inside": (lines((LEFT, (50, 70))), 1),
    "free": (lines(((50, 30), (50, 90))), 2),
    "Y that leaves": (lines((LEFT, MIDDLE), (MIDDLE, UP), (MIDDLE, DOWN)), 0),
    "Y with one end": (lines((LEFT, MIDDLE), (MIDDLE, (15, 90)), (MIDDLE, DOWN)), 1),
    "Y with three ends": (lines(((50, 20), MIDDLE), (MIDDLE, (15, 90)), (MIDDLE, (85, 90))), 3),
    "blob": (lines((MIDDLE, (50, 70)), width=24), 0),
    "wide across": (lines((LEFT, (50, 140)), width=30), 0),
    "bump": (lines((LEFT, (50, 140)), (MIDDLE, (42, 60))), 0),
    "stub": (lines((LEFT, (50, 140)), (MIDDLE, (30, 60))), 1),
    "ring": (lines((MIDDLE, (50, 61)), width=60) - lines((MIDDLE, (50, 61)), width=44), 0),
    "dash": (lines((LEFT, (50, 140))) | lines(((20, 50), (20, 57)), width=1), 0),
    "near the border": (lines((LEFT, (50, 118))), 0),
    "nothing": (lines(), 0),
    "everything": (lines() + 1, 0),
}


def test_dead_ends_of_drawn_figures():
    for turned, (name, (image, expected)) in enumerate(DRAWN.items()):
        assert len(ensemble.dead_ends(np.rot90(image, turned), 1)) == expected, name


def test_a_flat_end_counts_once_where_it_is():
    image = np.zeros((80, 100), np.uint8)
    image[36:44, :70] = 1
    (place,) = ensemble.dead_ends(image, 1)
    assert abs(place[0] - 40) <= 1 and 63 <= place[1] < 70
    found = ensemble.summary(image[np.newaxis], image).dead_ends[1]
    assert found == pytest.approx(1e4 / ((80 - 2 * MARGIN) * (100 - 2 * MARGIN)))


def test_rough_banks_holes_and_specks_hardly_make_dead_ends():
    rng, (image, expected) = np.random.default_rng(3), DRAWN["Y with one end"]
    bank = binary_dilation(image) & ~binary_erosion(image, border_value=1)
    rough, specks = [], []
    for _ in range(20):
        noisy = image.copy()
        noisy[bank] = rng.integers(0, 2, np.count_nonzero(bank))
        rough.append(len(ensemble.dead_ends(noisy, 1)))
        specks.append(len(ensemble.dead_ends(image ^ (rng.random(image.shape) < 0.01), 1)))
    for found in (rough, specks):
        assert np.mean(found) == pytest.approx(expected, abs=0.1)


def test_distances_against_their_definition():
    images, tables = noise(6, (3, 11, 13), 4), []  # four categories: patterns of 2 x 2
    for spread in (1, 2, 4):
        histograms = []
        for image in images:
            corners = [np.roll(image, (-i * spread, -j * spread), (0, 1)) for i in (0, 1) for j in (0, 1)]
            codes = (np.stack(corners, -1)[:-spread, :-spread] * 4 ** np.arange(4)).sum(-1)
            histograms.append(np.bincount(codes.ravel(), minlength=256) / codes.size)
        middles = [[(p + q) / 2 for q in histograms] for p in histograms]
        table = [
            [(kl_div(p, m).sum() + kl_div(q, m).sum()) / 2 for q, m in zip(histograms, row, strict=True)]
            for p, row in zip(histograms, middles, strict=True)
        ]
        tables.append(np.sqrt(np.array(table) / np.log(2)))
    expected = np.average(tables, axis=0, weights=[1, 1 / 2, 1 / 4])
    found = ensemble.anodi(images[:2], images[2])
    np.testing.assert_allclose(found.distances, expected, atol=1e-9)
    assert found.variety == pytest.approx(expected[0, 1])
    assert found.likeness == pytest.approx((expected[0, 2] + expected[1, 2]) / 2)
    assert found.ratio == pytest.approx(found.variety / found.likeness)
    np.testing.assert_allclose(found.by_level[:, 0], [table[0, 1] for table in tables])


def test_continuous_values_are_cut_by_quantiles_and_frequent_ones_are_classes_of_their_own():
    for frequent in (0.0, 1.0):
        training = np.where((np.indices((12, 12)) % 3).any(0), frequent, 1 - frequent)  # one in nine is the other
        assert ensemble.anodi(np.full((1, 12, 12), frequent), training).likeness == pytest.approx(1)
    training = np.random.default_rng(8).normal(size=(40, 40))
    same = ensemble.anodi(np.exp(training)[np.newaxis], np.exp(training))  # only ranks matter
    assert same.likeness == 0 and np.isnan(same.ratio) and np.isnan(same.variety)


def test_summary_puts_everything_together():
    training, hidden = (image[:, :64] for image in ensemble.channels())
    images, training = hidden[:192, :56].reshape(4, 48, 56), training[:64]
    data = [(3, 5, images[0, 5, 3]), (50, 40, images[0, 40, 50])]
    found = ensemble.summary(images, training, data=data)
    np.testing.assert_array_equal(found.categories, [0, 1])
    np.testing.assert_allclose(found.shares[:, -1], [1 - training.mean(), training.mean()])
    np.testing.assert_allclose(found.shares[1, :-1], images.mean(axis=(1, 2)))
    assert found.variograms.shape == found.connectivity.shape == (2, 2, 5, 25)
    np.testing.assert_array_equal(found.variograms[1, 0, 2], variogram(images[2] == 0, 1, 24))
    np.testing.assert_array_equal(found.variograms[0, 1, -1], variogram(training == 1, 0, 24))
    np.testing.assert_array_equal(found.connectivity[:, 1, 3], ensemble.connectivity(images[3], 1, 24).function)
    assert found.components[0, 1] == ensemble.connectivity(images[1], 0, 1).components
    assert found.dead_ends[1, -1] == 1e4 * len(ensemble.dead_ends(training, 1)) / 48**2
    p = np.array([1 - images.mean(0), images.mean(0)]).clip(1e-300)
    np.testing.assert_allclose(found.open, -(p * np.log2(p)).sum(0), atol=1e-12)
    np.testing.assert_array_equal(found.copied, ensemble.copied(ensemble.copies(images, training)))
    misses = [sum(int(one[y, x] != value) for x, y, value in data) for one in images]
    assert found.misses.tolist() == misses and misses[0] == 0


def test_summary_of_continuous_values():
    images = np.random.default_rng(2).normal(size=(3, 12, 14))
    found = ensemble.summary(images, images[0], data=[(1, 2, 0.5)])
    assert found.variograms.shape == (2, 1, 4, 7) and found.shares.shape == (0, 4)
    assert found.connectivity.shape == (2, 0, 4, 7)
    np.testing.assert_allclose(found.misses, np.abs(images[:, 2, 1] - 0.5))
    np.testing.assert_allclose(found.open, images.std(0, ddof=1))
    image = np.random.default_rng(1).integers(0, 200, (3, 20, 20)).astype(np.uint8)
    found = ensemble.summary(image[:2], image[2], categories=[])
    np.testing.assert_allclose(found.open, image[:2].std(0, ddof=1, dtype=float))


@pytest.mark.slow
def test_the_channels_of_the_package_are_those_that_the_benchmark_draws(script):
    make_channels = script("channels").channels
    for image, seed in zip(ensemble.channels(), (1, 7), strict=True):
        np.testing.assert_array_equal(image, make_channels((256, 256), seed))
    digest = hashlib.sha256(make_channels((96, 120), 2024).tobytes()).hexdigest()
    assert digest == "5c4f8284690ef1a95bd8b55732f0555e3bf72c474793046a453affd913ba9901"
    with pytest.raises(ValueError, match="the shape is 20 x 99"):
        make_channels((20, 99), 1)


@pytest.mark.parametrize("side", [2, 5])
def test_copies_against_plain_loops(side):
    training, made = noise(5, (1, 14, 17), 3)[0], noise(6, (2, 12, 15), 4)  # 3 is nowhere in the training image
    made[0, 1:12, 2:13] = training[3:14, 4:15]
    made[1, :9, :9] = 2
    found = ensemble.copies(made, training, side=side)
    assert found.shape == (2, 13 - side, 16 - side)
    plain = 0
    for n, i, j in np.ndindex(*found.shape):
        window = made[n, i : i + side, j : j + side]
        corners = np.ndindex(15 - side, 18 - side)
        same = [at for at in corners if (training[at[0] : at[0] + side, at[1] : at[1] + side] == window).all()]
        expected = same[0][0] * 17 + same[0][1] if same else -1
        assert found[n, i, j] == (-2 if (window == window[0, 0]).all() else expected)
        plain += found[n, i, j] == -2
    assert plain > 0
    shares = [(one >= 0).sum() / (one != -2).sum() if (one != -2).any() else np.nan for one in found]
    np.testing.assert_array_equal(ensemble.copied(found), shares)


def test_copies_of_the_image_itself_and_of_floats():
    training, hidden = ensemble.channels()
    assert ensemble.copied(ensemble.copies(training[np.newaxis], training)) == 1
    assert ensemble.copied(ensemble.copies(hidden[np.newaxis], training)) == pytest.approx(0.159, abs=1e-3)
    values = np.random.default_rng(1).normal(size=(20, 20))
    places = ensemble.copies(values[np.newaxis, 2:19, 3:20], values)
    assert places.tolist() == [[[43, 44], [63, 64]]]
    assert (ensemble.copies(np.nextafter(values, 9)[np.newaxis], values) == -1).all()


# -- Uncertainty: two realisations of three layers of 0.5 m, with cells of 10 x 20 m.


def reservoir():
    """A body of 7 cells along the first column and row, one of 2 in the last layer, and an empty realisation."""
    cells = np.zeros((2, 3, 4, 5), np.uint8)
    cells[0, :, 0, 0] = cells[0, 0, 0, :] = cells[0, 2, 3, 3:] = cells[1, 1, 1, 1] = 3
    axes = {"z": -2 + 0.5 * np.arange(3), "y": 5 + 20.0 * np.arange(4), "x": 100 + 10.0 * np.arange(5)}
    coords = {"realisation": [4, 9], **{name: (name, place, {"units": "m"}) for name, place in axes.items()}}
    sides = {"cell_x": 10.0, "cell_y": 20.0, "cell_z": 0.5}
    return Realisations(cells, coords, ("realisation", "z", "y", "x"), "facies", sides)


@pytest.mark.parametrize(
    ("well", "cells"),
    [
        ((100, 5), (7, 0)),  # a column of all layers
        ((104.9, -4.9, -1.76), (7, 0)),  # in the cell
        ((110, 25), (0, 1)),
        ([(100, 5, -2), (140, 65, -1), (130, 65, -1)], (9, 0)),  # a body counts once
        ((120, 25, -2), (0, 0)),
    ],
)
def test_the_volume_of_known_bodies_at_a_well(well, cells):
    found = ensemble.connected_volume(reservoir(), 3, well)
    assert found.values.tolist() == [100 * n for n in cells] and found.realisation.values.tolist() == [4, 9]
    assert (found.attrs["long_name"], found.attrs["units"]) == ("volume of facies 3 at the well", "m\u00b3")
    upside = reservoir().transpose("x", "realisation", "z", "y")
    xarray.testing.assert_identical(ensemble.connected_volume(upside, 3, well), found)
    area = ensemble.connected_volume(reservoir().isel(z=0), 3, (100, 5))
    assert area.values.tolist() == [1000, 0] and area.attrs["units"] == "m\u00b2" and area.attrs["z"] == -2
    assert found.quantile(0.5) == 50 * cells[0] + 50 * cells[1]


def test_maps_and_shares_of_a_known_ensemble():
    maps = reservoir()
    probability = ensemble.probability(maps, 3)
    np.testing.assert_array_equal(probability, (maps.values == 3).mean(0))
    assert probability.attrs["long_name"] == "probability of facies 3" and probability.attrs["cell_x"] == 10
    shares = ensemble.vertical_proportions(maps)
    assert shares.dims == ("category", "realisation", "z") and shares.category.values.tolist() == [0, 3]
    np.testing.assert_allclose(shares.sel(category=3), [[5 / 20, 1 / 20, 3 / 20], [0, 1 / 20, 0]])
    np.testing.assert_allclose(ensemble.vertical_proportions(maps.values[0], [3, 8]), [[5 / 20, 0.05, 0.15], [0] * 3])
    values = xarray.DataArray(np.random.default_rng(1).normal(1e6, 1, (7, 5, 6)), dims=("realisation", "y", "x"))
    values = values.assign_attrs(long_name="porosity", units="%")
    np.testing.assert_allclose(ensemble.quantiles(values), np.quantile(values, (0.1, 0.5, 0.9), axis=0))
    np.testing.assert_allclose(ensemble.e_type(values), values.mean("realisation"))
    assert ensemble.e_type(values).attrs == {"long_name": "E-type of porosity", "units": "%"}
    expected = [np.sqrt((values[:n].var("realisation", ddof=1) / n).mean()) for n in range(2, 8)]
    error = ensemble.standard_error(values)
    np.testing.assert_allclose(error, expected)
    assert error.realisations.values.tolist() == [2, 3, 4, 5, 6, 7] and error.attrs["units"] == "%"
    assert ensemble.standard_error(maps, 3)[0] == pytest.approx(np.sqrt(10 / 60 / 4))  # cells of which one has 3


def test_reliability_of_probabilities_that_are_right_and_of_those_that_are_too_sure():
    """Truths are drawn from probabilities of .05 ... .95; too sure are those that are moved from a half."""
    rng = np.random.default_rng(1)
    right = np.repeat(np.arange(0.05, 1, 0.1), 4000).reshape(10, 40, 100)
    truth = rng.random(right.shape) < right
    found = ensemble.reliability(right, truth)
    np.testing.assert_allclose(found.probability, right[:, 0, 0])
    np.testing.assert_allclose(found.frequency, found.probability, atol=0.03)
    assert found.number.values.tolist() == [4000] * 10 and found.upper.values[-1] == 1
    sure = ensemble.reliability(np.clip(2 * right - 0.5, 0, 1), truth)
    assert sure.frequency.sel(lower=0.9) < 0.9 and sure.frequency[0] > 0.1 and sure.number[0] > 8000


def test_reliability_has_bounds_below_no_number_for_empty_classes_and_no_unknown_cells():
    counts = np.arange(21) / 20  # as of 20 realisations; .3 belongs to the class from .3 on
    assert ensemble.reliability(counts, counts > 0.5).number.values.tolist() == [2] * 9 + [3]
    found = ensemble.reliability([0.2, 0.3, np.nan, 0.1], [0, 1, 1, np.nan], [0, 0.5, 1])
    assert found.number.values.tolist() == [2, 0] and found.frequency[0] == 0.5 and found.probability[0] == 0.25
    assert np.isnan(found.frequency[1]) and np.isnan(found.probability[1])
    axes = found.plot().axes[0]
    assert axes.lines[1].get_xydata()[0].tolist() == [0.25, 0.5] and axes.get_xlabel() == "probability"


def test_unknown_cells_count_for_nothing():
    maps = reservoir().assign_coords(region=(("z", "y", "x"), np.arange(60).reshape(3, 4, 5) % 20 < 10))
    maps[:, :, 2:] = 255
    assert np.isnan(ensemble.probability(maps, 3)[:, 2:]).all()
    shares = ensemble.vertical_proportions(maps)
    assert shares.category.values.tolist() == [0, 3] and shares.sel(category=3)[0, 0] == 0.5
    assert ensemble.e_type(maps)[0, 0, 1] == 1.5 and ensemble.connected_volume(maps, 255, (100, 65)).values.max() == 0


def test_plots_of_xarray_have_names_units_and_north_up():
    image = ensemble.probability(reservoir().isel(z=0), 3).plot()
    assert image.axes.get_title() == "" and image.colorbar.ax.get_ylabel() == "probability of facies 3"
    assert image.axes.get_ylim() == (-5, 75) and image.axes.get_xlabel() == "x [m]"
    plt.close("all")


IMAGE, FEW = np.zeros((20, 20), int), np.zeros((2, 20, 20), int)
HALF = xarray.DataArray(np.full((3, 3), 0.5), dims=("y", "x"), coords={"y": range(3), "x": range(3)})


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: ensemble.summary(IMAGE, IMAGE), r"the ensemble has the shape \(20, 20\)"),
        (lambda: ensemble.summary(FEW, IMAGE, categories=[1]), "holds 0, which is no category"),
        (lambda: ensemble.categories_of(IMAGE, [[0]]), "there are no categories"),
        (lambda: ensemble.categories_of(IMAGE, [0, 0]), "named twice"),
        (lambda: ensemble.connectivity(IMAGE, 1, 20), "max_lag is 20: give 1 to 19"),
        (lambda: ensemble.summary(np.full((1, 2, 2), np.nan), IMAGE), "not finite"),
        (lambda: ensemble.dead_ends(IMAGE[:16], 0), "a side of 16 pixels: give more than 16"),
        (lambda: ensemble.copies(FEW, IMAGE, side=21), "side is 21: give 1 to 20"),
        (lambda: ensemble.anodi(FEW, IMAGE[:2]), "there are no patterns of 4 x 4"),
        (lambda: ensemble.summary(FEW, IMAGE, data=[(1, 2)]), "give rows of x, y and value"),
        (lambda: ensemble.summary(FEW, IMAGE, data=[(1, 20, 0)]), "x 1, y 20 is at no pixel"),
        (lambda: ensemble.summary(FEW, IMAGE[:3]), "a side of 3 pixels"),
        (lambda: ensemble.summary(FEW, IMAGE - 1e200), "values beyond 1e.100: give them in a larger unit"),
        (lambda: ensemble.summary(np.ones((1, 2, 2), complex), IMAGE), "holds complex128"),
        (lambda: ensemble.probability(np.zeros((2, 3, 3)), 1), "with the dimension realisation"),
        (lambda: ensemble.e_type(reservoir().assign_attrs(options='{"categorical": true}')), "are of categories"),
        (lambda: ensemble.connected_volume(reservoir(), 3, (90, 5)), "outside"),
        (lambda: ensemble.connected_volume(reservoir(), 3, (90,)), "x, y and perhaps z of the well"),
        (lambda: ensemble.connected_volume(reservoir().isel(x=0), 3, (100, 5)), "one variable with y and x"),
        (lambda: ensemble.vertical_proportions(reservoir()[:, 0]), "with the dimension z"),
        (lambda: ensemble.reliability([0.5], [0, 1]), "different cells"),
        (lambda: ensemble.reliability(HALF, HALF.T > 1), "different cells"),
        (lambda: ensemble.reliability(HALF, (HALF > 1).assign_coords(x=[1, 2, 3])), "different cells"),
        (lambda: ensemble.reliability([1.5], [1]), "0 to 1, and the truth is 0 or 1"),
        (lambda: ensemble.reliability([0.5], [3]), "0 to 1, and the truth is 0 or 1"),
        (lambda: ensemble.reliability([0.5], [1], [0, 0.5]), "do not ascend from 0 to 1"),
        (lambda: ensemble.reliability([0.5], [1], [0, 0.5, 0.5, 1]), "do not ascend from 0 to 1"),
        (lambda: ensemble.connected_volume(reservoir()[..., ::-1], 3, (100, 5)), "evenly spaced in ascending order"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(call, words):
    with pytest.raises((TypeError, ValueError), match=words):
        call()

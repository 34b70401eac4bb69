"""What leads a run: guides, probabilities, the structure channel, and turned copies of the sample."""

from itertools import product
from math import cos, log, radians, sin

import numpy as np
import plain_sample
import pytest
from cases import REFERENCE, assert_same_bits, texture

import simdtex
from simdtex.model.given import EXCLUDED, Soft
from simdtex.model.guide import UNKNOWN, Colocated, Guide, Surroundings, smooth
from simdtex.model.pictures import MOST_COPIES, Pictures, copy_of, turned
from simdtex.model.sample import STEPS, Sample, variance
from simdtex.model.scale import REACH, Scale, distance, principal, structure

# -- The working levels of guides, and of variables that are known where others are not.

SPREAD, TOP = 100.0, 1000


def planes(samples, output, labels, weight=1.0):
    """Of guides that are given without a channel axis."""
    samples = tuple(np.asarray(one)[..., None] for one in samples)
    return Guide(samples, np.asarray(output)[..., None], labels, weight).planes(None, SPREAD, TOP)


def test_two_labels_are_one_channel():
    found = planes([[[4, 9], [9, 9]]], [[9, 4, 4]], True)
    height = int(found.output.max())
    assert found.samples[0].tolist() == [[[0, height], [height, height]]]
    assert found.output.tolist() == [[[height, 0, 0]]]
    assert height == round((SPREAD / (0.25 * 0.75)) ** 0.5), "the pixels' variance"


def test_three_labels_have_a_channel_each():
    found = planes([[[4, 9, 1]]], [[9.0, np.nan]], True)
    height = int(found.samples[0].max())
    assert found.samples[0].tolist() == [[[0, 0, height]], [[height, 0, 0]], [[0, height, 0]]]
    assert found.output.tolist() == [[[0, UNKNOWN]], [[0, UNKNOWN]], [[height, UNKNOWN]]]


def test_one_label_says_nothing():
    found = planes([[[4, 4]]], [[4]], True)
    assert not found.samples[0].any()
    assert not found.output.any()


@pytest.mark.parametrize("weight", [0.25, 1.0, 4.0])
@pytest.mark.parametrize("labels", [True, False])
def test_a_guide_varies_as_much_as_the_pixels_times_its_weight(labels, weight):
    rng = np.random.default_rng(1)
    sample = rng.integers(0, 3, (30, 31)) if labels else rng.normal(size=(30, 31))
    found = planes([sample], sample[:4], labels, weight)
    assert found.samples[0].var((1, 2)).sum() == pytest.approx(weight * SPREAD, rel=0.1)


def test_all_of_its_channels_together_vary_so():
    rng = np.random.default_rng(2)
    sample = rng.normal(size=(30, 31, 2)) * [1, 1000]
    found = Guide((sample,), sample[:2], False, 1.0).planes(None, 1e4, TOP)
    first, second = found.samples[0].var((1, 2))
    assert first == pytest.approx(second, rel=0.02)
    assert first + second == pytest.approx(1e4, rel=0.02)
    assert Guide((sample,), sample[:2], False, 1.0).channels == 2


def test_no_weight_is_no_guide():
    found = planes([[[0.0, 1.0, 3.0]]], [[1.0, np.nan]], False, 0.0)
    assert not found.samples[0].any()
    assert found.output.tolist() == [[[0, UNKNOWN]]]


def test_numbers_of_the_output_count_beside_those_of_the_sample():
    """Whatever the types: the same number is the same level."""
    for output in (np.float64([[-0.5, 7, 12]]), np.int16([[-3, 7, 12]]), np.float32([[7, np.nan, 20]])):
        for dtype in (np.uint8, np.int64, np.float32):
            sample = np.arange(5, 11, dtype=dtype)[None]
            found = planes([sample], output, False)
            at = int(np.flatnonzero(output[0] == 7)[0])
            assert found.output[0, 0, at] == found.samples[0][0, 0, 2]
            levels = found.samples[0][0, 0].astype(float)
            steps = np.diff(levels)
            assert steps.min() > 0
            assert np.ptp(steps) <= 1, "and equal steps are equal"


def test_several_samples_have_one_scale():
    found = planes([[[0.0, 1.0]], [[2.0], [4.0]]], [[4.0, 0.0, 2.0]], False)
    high = found.output[0, 0, 0]
    assert found.samples[1][0].ravel().tolist() == [round(high / 2), high]
    assert found.samples[0][0].ravel().tolist()[0] == 0 == found.output[0, 0, 1]


def test_variables_known_alone_are_told_again():
    """In the levels that the pixels have."""
    pixels = np.float32([[[0, 10], [4, 30], [2, 20]]])
    scale = Scale(Pictures((pixels,)), 64)
    values = np.zeros((1, 4, 2), np.float32)
    values[0, :, 1] = [10, 30, 20, 15]
    known = np.zeros((1, 4, 2), bool)
    known[0, 1:3, 1] = True
    found = Colocated((pixels,), values, known).planes(scale, SPREAD, TOP)
    assert found.samples[0].tolist() == scale.levels(pixels)[1:].tolist()
    assert found.output.tolist() == [[[UNKNOWN, scale.top, scale.levels(pixels)[1, 0, 2], UNKNOWN]]]


def test_a_category_known_alone_has_all_of_its_channels():
    pixels = np.stack([np.arange(6) % 3, np.arange(6)], -1)[None].astype(np.float64)
    scale = Scale(Pictures((pixels,), categorical=(True, False)), 64)
    known = np.zeros((1, 6, 2), bool)
    known[0, 2, 0] = True
    found = Colocated((pixels,), pixels, known).planes(scale, SPREAD, TOP)
    assert found.output.shape == (3, 1, 6)
    assert found.output[:, 0, 2].tolist() == scale.levels(pixels)[:3, 0, 2].tolist()
    assert (np.delete(found.output[:, 0], 2, 1) == UNKNOWN).all()


def test_a_sample_has_its_guide_last_and_does_not_vary_with_it():
    rng = np.random.default_rng(3)
    pixels, label = rng.integers(0, 256, (8, 9, 1)).astype(np.uint8), rng.integers(0, 4, (8, 9, 1))
    guide = Guide((label,), label[:2], True, 1.0)
    plain, guided = Sample(pixels, 24, 2, 1.0), Sample(pixels, 24 * 6, 2, 1.0, guides=[guide])
    assert guide.channels == 4
    assert guided.levels[0].shape == (1 + 1 + 4, 8, 9)
    assert guided.levels[0][:2].tolist() == plain.levels[0].tolist()
    assert (guided.channels, guided.shown, guided.variance) == (2, 1, plain.variance)
    assert guided.guides.shape == (4, 2, 9)


def test_colours_go_on_into_a_hole_from_the_known_pixels_near_its_rim():
    rng = np.random.default_rng(5)
    levels, known = rng.integers(0, 200, (2, 23, 31)).astype(np.uint16), np.ones((23, 31), bool)
    known[4:19, 6:25] = False
    found = smooth(levels, known)
    for i, j in np.ndindex(*known.shape):
        nearest = min(max(abs(i - k), abs(j - m)) for k, m in np.argwhere(known))
        reach = next(side for side in (4, 6, 9, 13) if side >= nearest + 4)
        square = slice(max(0, i - reach), i + reach + 1), slice(max(0, j - reach), j + reach + 1)
        inside = levels[:, *square][:, known[square]].astype(int)
        assert found[:, i, j].tolist() == (inside.sum(1) // inside.shape[1]).tolist()


def test_surroundings_are_colours_and_places():
    sample = np.random.default_rng(6).integers(0, 256, (40, 700, 2)).astype(np.uint8)
    known = np.random.default_rng(7).random((40, 700)) < 0.9
    scale = Scale(Pictures((sample,)), 100)
    guide = Surroundings(sample, known, sample[10:20, 50:], known[10:20, 50:], (10, 50))
    found = guide.planes(scale, 300_000.0, 4095)
    (own,), output = found
    assert len(own) == len(output) == guide.channels == 4
    assert (own[:2] == smooth(np.moveaxis(sample, -1, 0).astype(np.uint16), known)).all()
    assert (output[2:] == own[2:, 10:20, 50:]).all(), "a place is the same in both"
    step = own[3, 0].astype(int)
    assert step[600] - step[300] == round(0.3**0.5 * 300_000**0.5) and not np.diff(own[3], axis=0).any()
    assert (np.diff(own[2, :, 0].astype(int)) >= 0).all() and own[2, -1, 0] == round(39 * (0.3 * 3e5) ** 0.5 / 300)
    rows_alone = Surroundings(sample, known, sample[10:20], known[10:20], (10, np.nan)).planes(scale, 300_000.0, 4095)
    assert not rows_alone.output[3].any() and not rows_alone.samples[0][3].any()
    assert (rows_alone.output[2] == own[2, 10:20]).all()


# -- Probabilities of categories and of training images, as costs: the formula, what it leaves alone, what it excludes.

TRAINING = (np.add.outer(np.arange(20) // 3, np.arange(24) // 5) % 3).astype(np.uint8) * 4
SHAPE = (14, 17)
OPTIONS = {"order": 2, "levels": 2, "device": REFERENCE, "rng": 5, "categorical": True, "shape": SHAPE, "jobs": 1}


def simulate(**options):
    device = options.pop("device", "reference")
    return simdtex.simulate(TRAINING, 2, **OPTIONS | options | {"device": device})


def of(p):
    """The same probabilities everywhere."""
    return np.repeat(np.asarray(p, float), SHAPE[0] * SHAPE[1]).reshape(len(p), *SHAPE)


def shares(pixels=TRAINING):
    return np.unique(pixels, return_counts=True)[1] / pixels.size


def test_costs_are_the_formula():
    rng = np.random.default_rng(2)
    p = rng.random((3, 5, 6)) * (rng.random((3, 5, 6)) > 0.3)
    p[0, p.sum(0) == 0] = 1
    p /= p.sum(0)
    p[:, 2, 3] = np.nan
    images = np.stack([p[0], 1 - p[0]])
    pictures = Pictures((TRAINING[..., None], TRAINING[:5, :, None]), categorical=(True,))
    sample, soft = Sample(pictures, 8, 1), Soft(p, images)
    found = soft.costs(sample, 1, 300.0)
    q = shares(np.concatenate([TRAINING, TRAINING[:5]]))
    for one, share, rows in ((p, q, range(3)), (images, [0.8, 0.2], range(3, 5))):
        for i, j in np.ndindex(5, 6):
            known = [k for k in range(len(one)) if one[k, i, j] > 0]
            most = max([log(one[k, i, j] / share[k]) for k in known], default=0)
            for k, row in enumerate(rows):
                if np.isnan(one[k, i, j]):
                    assert found[row, i, j] == 0
                elif one[k, i, j] == 0:
                    assert found[row, i, j] == EXCLUDED
                else:
                    cost = 300 / 16 * (most - log(one[k, i, j] / share[k]))
                    assert found[row, i, j] == pytest.approx(cost, abs=300 / 16 / 2**10)
    assert_same_bits(soft.costs(sample, 2, 300.0), np.ascontiguousarray(found[:, ::2, ::2]))
    assert soft.rows == 5 and soft.shares == pytest.approx([np.nanmean(p[0]), 1 - np.nanmean(p[0])])


def test_a_pixel_is_of_its_category_and_of_its_picture():
    pictures = Pictures((TRAINING[..., None], TRAINING[:5, ::-1, None]), categorical=(True,))
    sample = Sample(pictures, 8, 2)
    source = np.flatnonzero(sample.inside)
    category, picture = Soft(of(shares()), of([0.5, 0.5])).kinds(sample, source)
    row, col, number = sample.place(source.astype(np.int32)).T
    for k in range(source.size):
        assert category[k] == pictures.pixels[number[k]][row[k], col[k], 0] // 4
        assert picture[k] == 3 + number[k]


@pytest.mark.parametrize("search", ["exact", "coherent"])
def test_what_is_as_probable_as_it_is_frequent_changes_no_bit(search):
    same = simulate(probabilities=of(shares()), search=search, soft_weight=7.0)
    assert_same_bits(same.values, simulate(search=search).values)
    nothing = simulate(probabilities=of([np.nan] * 3), search=search)
    assert_same_bits(nothing.values, simulate(search=search).values)


@pytest.mark.parametrize("search", ["exact", "coherent"])
@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_what_is_impossible_is_not_there(search, weight):
    p = of([0.5, 0.5, 0.0])
    p[:, :, 9:] = np.array([0, 0, 1])[:, None, None]
    p[:, 3:6, 4:7] = np.nan
    found = simulate(probabilities=p, search=search, soft_weight=weight).values
    told = ~np.isnan(p[0])
    assert not (found[:, told & (p[2] == 0)] == 8).any()
    assert (found[:, told & (p[2] == 1)] == 8).all()


def test_what_is_more_probable_is_more_frequent():
    asked = (0.05, 0.3, 0.6, 0.95)
    found = {
        weight: [
            (simulate(probabilities=of([(1 - p) / 2, p, (1 - p) / 2]), soft_weight=weight).values == 4).mean()
            for p in asked
        ]
        for weight in (1.0, 4.0)
    }
    assert all(one == sorted(one) for one in found.values())
    assert np.abs(np.array(found[4.0]) - asked).max() < 0.1
    assert found[4.0][0] < found[1.0][0] and found[1.0][-1] < found[4.0][-1]


def test_each_cell_is_from_the_training_image_of_its_number():
    images = [TRAINING, (TRAINING[:, :19] + 1).astype(np.uint8)]
    number = (np.arange(SHAPE[1]) > 8) * np.ones((SHAPE[0], 1), int)
    options = OPTIONS | {"device": "reference"}
    found = simdtex.simulate(images, 2, **options, image_map=number, source=True)
    assert (found.source_image == number).all()
    assert (found.simulation % 4 == number).all()
    free = np.where(number, np.nan, 0.0)
    both = simdtex.simulate(images, 2, **options, image_map=free, source=True).source_image.values
    assert (both[:, number == 0] == 0).all() and (both[:, number == 1] == 0).any()
    few = [
        (simdtex.simulate(images, 2, **options, image_map=of([1 - p, p]), source=True).source_image == 1).mean().item()
        for p in (0.05, 0.4, 0.95)
    ]
    assert few == sorted(few) and few[0] < few[-1]


# -- The structure channel: signed distance to the border between the bright and the dark parts of a sample.


@pytest.mark.parametrize("shape", [(40, 37), (1, 30), (30, 1), (6, 5)])
def test_the_distance_is_to_the_nearest_marked_pixel(shape):
    rng = np.random.default_rng(1)
    marked = rng.random(shape) < 0.02
    marked.ravel()[3] = True
    found = distance(marked)
    places = np.argwhere(marked)
    for i, j in np.ndindex(shape):
        nearest = min((i - k) ** 2 + (j - m) ** 2 for k, m in places)
        assert found[i, j] == min(nearest, REACH**2)


def test_nothing_marked_is_far():
    assert (distance(np.zeros((5, 6), bool)) == REACH**2).all()


def step(side=60, at=30):
    """A picture of one edge, between two columns."""
    return np.where(np.arange(side) < at, 40, 200)[None, None] * np.ones((1, side, 1), int)


@pytest.mark.parametrize("turned", [False, True])
def test_it_rises_across_a_border_from_the_dark_to_the_bright(turned):
    levels = step().astype(np.uint16)
    found = structure([np.swapaxes(levels, 1, 2) if turned else levels], 1.0, variance(levels), STEPS)[0]
    found = found.T if turned else found
    assert (found == found[0]).all(), "the border is a column"
    line = np.diff(found[0].astype(int))
    near = line[30 - 16 : 30 + 15]
    assert near.min() > 0
    assert near.max() - near.min() <= 1, "a pixel farther inside is as much more everywhere"
    assert (line[:8] <= 0).all(), "what is far from anything darker is no longer bright"


def test_a_bright_stripe_and_a_dark_one_differ():
    stripes = np.where(np.arange(60) // 6 % 2, 40, 200)[None, None] * np.ones((1, 20, 1), int)
    found = structure([stripes.astype(np.uint16)], 1.0, 6400.0, STEPS)[0][10].astype(int)
    assert (found[(stripes[0, 0] == 200)].min()) > found[stripes[0, 0] == 40].max()


def test_the_principal_component_is_that_of_greatest_variance():
    rng = np.random.default_rng(3)
    base = rng.integers(0, 100, (12, 30))
    levels = np.stack([4 * base, -base, rng.integers(0, 9, base.shape)])
    assert principal([levels[:, :5], levels[:, 5:]])[:2].tolist() == [127, -32]
    assert principal([-levels]).tolist()[:2] == [127, -32], "its weights add up to more than 0"
    assert principal([np.stack([base, -base])]).tolist() == [127, -127]
    assert principal([np.stack([base // 2, -base])]).tolist()[1] == 127
    assert principal([np.zeros((2, 3, 3), int)]).tolist() == [1, 1]


@pytest.mark.parametrize("weight", [0.5, 1.0, 2.0])
def test_its_deviation_is_its_weight_in_those_of_the_sample(weight):
    levels = np.moveaxis(texture((50, 48), 3, seed=2), -1, 0).astype(np.uint16)
    found = structure([levels], weight, variance(levels), STEPS)[0]
    assert found.std() == pytest.approx(weight * variance(levels) ** 0.5, rel=0.01)


def test_it_keeps_to_the_legal_levels():
    levels = (texture((50, 48), seed=2)[None] // 8 * 8).astype(np.uint16)
    found = structure([levels], 50.0, variance(levels), STEPS)[0]
    assert (found.min(), found.max()) == (0, STEPS)


@pytest.mark.parametrize("levels", [np.full((1, 9, 9), 7), np.zeros((3, 4, 5), int)])
def test_a_sample_without_an_edge_has_none(levels):
    assert not structure([levels.astype(np.uint16)], 1.0, 1.0, 255)[0].any()


@pytest.mark.parametrize("channels", [1, 3])
def test_it_is_what_plain_loops_find(channels):
    pictures = [np.moveaxis(texture(shape, channels, seed=4), -1, 0).astype(np.uint16) for shape in ((13, 15), (9, 40))]
    expected = plain_sample.structure([[*one.astype(int)] for one in pictures], 1.0, STEPS)
    found = structure(pictures, 1.0, variance(*pictures), STEPS)
    for one, other in zip(found, expected, strict=True):
        assert (one == other).all()
        assert one.any()


@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_a_sample_matches_it_and_does_not_show_it(dtype):
    pixels = texture((20, 22), 3, dtype, 1)
    sample, plain = Sample(pixels, 16, 2, 1.5), Sample(pixels, 16, 2)
    assert (sample.channels, sample.shown, plain.channels) == (4, 3, 3)
    assert (sample.working[:3] == plain.working).all()
    assert sample.working[3].max() > 0
    source = np.arange(sample.rows * sample.cols).reshape(sample.rows, sample.cols)[2:-2, 2:-2]
    values = sample.working[:, source].copy()
    values[3] += 5
    assert (sample.picture(values, source) == pixels).all()


# -- Turned and scaled copies of pictures: exact where they can be, the nearest pixel elsewhere, and their way back.


@pytest.mark.parametrize("shape", [(5, 8), (7, 7), (1, 4)])
def test_quarter_turns_are_exact(shape):
    picture = np.arange(shape[0] * shape[1]).reshape(shape)
    for quarter in range(4):
        copy = copy_of(0, shape, 2 * quarter, 0)
        assert copy.inside.all()
        assert np.array_equal(copy.of([picture]), np.rot90(picture, -quarter)), "from columns to rows"


@pytest.mark.parametrize(("eighths", "halves"), [*product(range(8), range(-2, 3))])
def test_a_pixel_is_the_nearest_of_the_picture(eighths, halves):
    rows, cols = 9, 14
    copy, by, angle = copy_of(3, (rows, cols), eighths, halves), 2.0 ** (halves / 2), radians(45 * eighths)
    assert copy.image == 3
    high, wide = copy.inside.shape
    far = 0.0
    for i, j in np.ndindex(high, wide):
        y, x = (i - (high - 1) / 2) / by, (j - (wide - 1) / 2) / by
        col = x * cos(angle) + y * sin(angle) + (cols - 1) / 2
        row = -x * sin(angle) + y * cos(angle) + (rows - 1) / 2
        if copy.inside[i, j]:
            far = max(far, abs(row - copy.row[i, j]), abs(col - copy.col[i, j]))
        else:
            assert not (-0.4 < row < rows - 0.6 and -0.4 < col < cols - 0.6)
        assert 0 <= copy.row[i, j] < rows and 0 <= copy.col[i, j] < cols
    assert far <= 0.5 + 1e-6
    assert copy.inside.sum() == pytest.approx(rows * cols * by**2, rel=0.2)


def test_only_what_is_wanted_is_made():
    picture = Pictures((texture((9, 14))[..., None],) * 2)
    images = np.zeros((2, 4, 5))
    images[0] = 1
    images[:, :, 4] = [[0.25] * 4, [0.75] * 4]
    rotation = np.array([[0, 359, 22, 23, 90]] * 3 + [[np.nan] * 5])
    found = turned(picture, images, rotation, None)
    assert len(found.copies) == 4, "0, 45 of the first, and 90 of both"
    assert found.probability[:, 0].T.tolist() == [[1, 0, 0, 0]] * 3 + [[0, 1, 0, 0], [0, 0, 0.25, 0.75]]
    assert np.isnan(found.probability[:, 3]).all()
    assert [one.image for one in found.copies] == [0, 0, 0, 1]
    scale = np.array([[0.5, 0.55, 0.6, 0.65, 2]] * 4)
    assert [one.inside.shape for one in turned(picture, images, None, scale).copies] == [
        (5, 7), (7, 10), (18, 28), (18, 28)]  # fmt: skip


def test_too_many_copies_are_refused():
    picture = Pictures((texture((9, 14))[..., None],) * 3)
    rotation, scale = (np.arange(40) % 8 * 45.0)[None], 2.0 ** ((np.arange(40) // 8 - 2) / 2)[None]
    with pytest.raises(ValueError, match=f"120 different copies .* round .* {MOST_COPIES} or fewer"):
        turned(picture, np.full((3, 1, 40), 1 / 3), rotation, scale)
    with pytest.raises(ValueError, match="have no number; leave them out"):
        turned(picture, np.full((3, 1, 40), 1 / 3), rotation * np.nan, scale)


def test_sources_lead_back_to_the_training_image():
    training = np.arange(400, dtype=np.int32).reshape(20, 20)
    row, col = np.indices((12, 13))
    maps = {"rotation": col * 30.0, "scale": np.where(row < 6, 0.6, 1.4)}
    options = {"order": 2, "levels": 2, "device": "reference", "rng": 1, "finish": 0.0, "source": True}
    found = simdtex.simulate(training, 2, **maps, **options)
    assert (training[found.source_row.values, found.source_column.values] == found.simulation.values).all()
    usable = training % 20 < 13
    half = simdtex.simulate([training, -training], 1, **maps, **options, mask=[usable, usable])
    assert (half.source_column < 13).all()
    signs = np.where(half.source_image.values == 1, -1, 1)
    assert (signs * training[half.source_row.values, half.source_column.values] == half.simulation.values).all()


@pytest.mark.parametrize("quarters", [0, 1])
def test_stripes_turn(quarters):
    stripes = np.tile(np.uint8([0, 0, 9, 9]), (24, 6))
    found = simdtex.simulate(
        stripes, 1, shape=(16, 16), rotation=np.full((16, 16), 90.0 * quarters), order=4, device="reference", rng=3
    ).values[0]
    along = (found == np.roll(found, 1, 1 if quarters else 0))[1:, 1:].mean()
    across = (found == np.roll(found, 1, 0 if quarters else 1))[1:, 1:].mean()
    assert along > 0.95 and across < 0.65


def test_guides_turn_with_their_training_image():
    training = np.arange(400, dtype=np.int32).reshape(20, 20)
    wanted = np.arange(12)[:, None] * np.ones((1, 12)) > 5
    found = simdtex.simulate(
        training, 1, rotation=np.full((12, 12), 90.0), guide=((training > 199).astype(int), wanted.astype(int)),
        guide_weight=1e6, order=2, levels=1, device="reference", rng=3, finish=0.0,
    ).values[0]  # fmt: skip
    assert ((found > 199) == wanted).mean() > 0.95

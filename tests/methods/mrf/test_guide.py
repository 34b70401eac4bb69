"""What leads a run: guides, probabilities, the structure channel, and turned copies of the sample."""

import json
from math import cos, radians, sin

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, texture
from scipy.ndimage import correlate1d, distance_transform_edt

import simdtex
from simdtex.jobs.simulation.ensemble import channels
from simdtex.model.given import Soft
from simdtex.model.guide import Guide, Surroundings, smooth
from simdtex.model.pictures import MOST_COPIES, Pictures, copy_of, turned
from simdtex.model.sample import STEPS, Sample, variance
from simdtex.model.scale import Scale, structure

# -- The working levels of guides, and of variables that are known where others are not.

SPREAD, TOP = 100.0, 1000


def planes(samples, output, labels, weight=1.0):
    """Of guides that are given without a channel axis."""
    samples = tuple(np.asarray(one)[..., None] for one in samples)
    return Guide(samples, np.asarray(output)[..., None], labels, weight).planes(None, SPREAD, TOP)


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


def test_colours_are_means_of_the_known_pixels_in_a_square():
    rng = np.random.default_rng(5)
    levels, known = rng.integers(0, 200, (2, 23, 31)).astype(np.uint16), np.ones((23, 31), bool)
    known[4:19, 6:25] = False
    found = smooth(levels, known, 6)
    for i, j in np.ndindex(*known.shape):
        square = slice(max(0, i - 6), i + 7), slice(max(0, j - 6), j + 7)
        inside = levels[:, *square][:, known[square]].astype(int)
        assert found[:, i, j].tolist() == (inside.sum(1) // max(1, inside.shape[1])).tolist()


def test_surroundings_are_colours_and_places():
    sample = np.random.default_rng(6).integers(0, 256, (40, 700, 2)).astype(np.uint8)
    known = np.random.default_rng(7).random((40, 700)) < 0.9
    known[12:17, 60:69] = False
    scale = Scale(Pictures((sample,)), 100)
    guide = Surroundings(sample, known, sample[10:20, 50:], known[10:20, 50:], (10, 50))
    found = guide.planes(scale, 300_000.0, 4095)
    (own,), output = found
    assert len(own) == len(output) == guide.channels == 4
    assert (own[:2] == smooth(np.moveaxis(sample, -1, 0).astype(np.uint16), known, 3 + 4)).all()
    assert (output[2:] == own[2:, 10:20, 50:]).all(), "a place is the same in both"
    step = own[3, 0].astype(int)
    assert abs(step[600] - step[300] - 3**0.5 * 300_000**0.5) <= 1 and not np.diff(own[3], axis=0).any()
    assert (np.diff(own[2, :, 0].astype(int)) >= 0).all() and own[2, -1, 0] == round(39 * (3 * 3e5) ** 0.5 / 300)
    rows_alone = Surroundings(sample, known, sample[10:20], known[10:20], (10, np.nan)).planes(scale, 300_000.0, 4095)
    assert not rows_alone.output[3].any() and not rows_alone.samples[0][3].any()
    assert (rows_alone.output[2] == own[2, 10:20]).all()
    assert (guide.planes(scale, 30_000_000.0, 4095).samples[0][3, 0, ::233] == [0, 1363, 2726, 4089]).all(), "and fits"
    places = Surroundings(sample, known, sample[10:20, 50:], known[10:20, 50:], (10, 50), colours=False)
    assert places.channels == 2 and (places.planes(scale, 300_000.0, 4095).output == output[2:]).all()


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


def test_what_asks_for_nothing_changes_no_bit():
    nothing = simulate(probabilities=of([np.nan] * 3))
    same = simulate(probabilities=of(shares()), soft_weight=0.0)
    assert_same_bits(same.values, nothing.values)
    options = json.loads(nothing.attrs["options"]) | {"device": REFERENCE}
    assert_same_bits(nothing.values[1], simdtex.synthesize(TRAINING, SHAPE, rng=int(nothing.seed[1]), **options))


@pytest.mark.parametrize(("search", "weight"), [("exact", 1.0), ("coherent", 0.0)])
def test_what_is_impossible_is_not_there(search, weight):
    p = of([0.5, 0.5, 0.0])
    p[:, :, 9:] = np.array([0, 0, 1])[:, None, None]
    p[:, 3:6, 4:7] = np.nan
    found = simulate(probabilities=p, search=search, soft_weight=weight).values
    told = ~np.isnan(p[0])
    assert not (found[:, told & (p[2] == 0)] == 8).any()
    assert (found[:, told & (p[2] == 1)] == 8).all()


def test_regions_are_connected_cells_with_about_the_same_probabilities():
    p = np.full((3, 40, 60), np.nan)
    p[:, :, :] = np.array([0.5, 0.3, 0.2])[:, None, None]
    p[:, :, 20:25] = np.array([0.51, 0.29, 0.2])[:, None, None]  # the same in sixteenths
    p[:, 10:30, 30:] = np.array([0.1, 0.2, 0.7])[:, None, None]
    p[:, 3, 3:9], p[:, 6, 3:9] = np.array([[0, 0, 1]]).T, np.array([[0, 0, 1]]).T  # small parts: together
    p[:, 39] = np.nan
    of = Soft(p).regions()
    assert (of[39] == -1).all() and np.unique(of).tolist() == [-1, 0, 1, 2]
    assert (of[10:30, 30:] == of[12, 33]).all() and (of[[3, 6], 3:9] == of[3, 3]).all() and of[0, 0] == of[8, 24]
    two = np.full((2, 40, 60), 0.5)
    two[:, :, 20:40] = np.array([[0.9], [0.1]])[..., None]
    of = Soft(two).regions()
    assert of.max() == 2 and of[0, 0] != of[0, 59], "which are not connected"


CHANNELS, _ = channels()


def of_channels(p, n, **options):
    """How often each cell is of a channel."""
    given = {} if p is None else {"probabilities": np.stack([1 - p, p]), "shape": p.shape}
    return simdtex.simulate(CHANNELS, n, categorical=True, rng=1, share_spread=0, **given, **options).values.mean(0)


@pytest.mark.slow
def test_shares_are_those_asked():
    assert abs(of_channels(np.full((64, 64), 0.8), 4).mean() - 0.8) < 0.03
    found = of_channels(None, 2, proportions=(0.9, 0.1), shape=(64, 64))
    assert abs(found.mean() - 0.1) < 0.03


def test_each_cell_is_from_the_training_image_of_its_number():
    images = [TRAINING, (TRAINING[:, :19] + 1).astype(np.uint8)]
    number = (np.arange(SHAPE[1]) > 8) * np.ones((SHAPE[0], 1), int)
    options = OPTIONS | {"device": "reference"}
    found = simdtex.simulate(images, 2, **options, image_map=number, source=True)
    assert (found.source_image == number).all()
    assert (found.simulation % 4 == number).all()
    few = [
        (simdtex.simulate(images, 1, **options, image_map=of([1 - p, p]), source=True).source_image == 1).mean().item()
        for p in (0.05, 0.95)
    ]
    assert few[0] < few[1]


# -- The structure channel: signed distance to the border between the bright and the dark parts of a sample.


@pytest.mark.parametrize("channels", [1, 3])
def test_it_is_the_signed_distance_to_the_border_in_the_first_principal_component(channels):
    pictures = [np.moveaxis(texture(shape, channels, seed=4), -1, 0).astype(np.uint16) for shape in ((13, 15), (9, 40))]
    edge = np.where(np.arange(60) < 29, 40, 200).astype(np.uint16) * np.ones((channels, 5, 1), np.uint16)
    pictures += [edge, edge.swapaxes(1, 2)]  # whose ends are farther from it than is measured
    wide = np.convolve(np.convolve(np.ones(19), np.ones(21)), np.ones(21))
    smooth, signed = pictures, []
    for axis in (1, 2):
        smooth = [correlate1d(one.astype(float), [1, 4, 6, 4, 1], axis, mode="nearest") for one in smooth]
    axes = np.linalg.eigh(np.atleast_2d(np.cov(np.hstack([one.reshape(channels, -1) for one in smooth]))))[1][:, -1]
    axes = np.rint(127 * axes / abs(axes).max() * np.sign(axes.sum()))
    for one in smooth:
        tone = np.tensordot(axes, one, 1)
        mean = correlate1d(correlate1d(tone, wide, 0, mode="reflect"), wide, 1, mode="reflect")
        bright = tone * wide.sum() ** 2 > mean
        far = distance_transform_edt(bright) + distance_transform_edt(~bright)
        signed.append((np.rint(np.minimum(far, 16) * 256) - 128) * np.where(bright, 1, -1))
    least, spread = min(one.min() for one in signed), np.hstack([one.ravel() for one in signed]).std()
    by = variance(*pictures) ** 0.5 / spread
    for one, expected in zip(structure(pictures, 1.0, variance(*pictures), STEPS), signed, strict=True):
        assert_same_bits(one.astype(float), np.rint((expected - least) * by))


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


@pytest.mark.parametrize("shape", [(5, 8), (1, 4)])
def test_quarter_turns_are_exact(shape):
    picture = np.arange(shape[0] * shape[1]).reshape(shape)
    for quarter in range(4):
        copy = copy_of(0, shape, 2 * quarter, 0)
        assert copy.inside.all()
        assert np.array_equal(copy.of([picture]), np.rot90(picture, -quarter)), "from columns to rows"


@pytest.mark.parametrize(("eighths", "halves"), [(0, 1), (1, -2), (3, 0), (6, 2)])
def test_a_pixel_is_the_nearest_of_the_picture(eighths, halves):
    rows, cols = 9, 14
    copy, by, angle = copy_of(3, (rows, cols), eighths, halves), 2.0 ** (halves / 2), radians(45 * eighths)
    assert copy.image == 3
    high, wide = copy.inside.shape
    far, (rows_at, cols_at) = 0.0, np.broadcast_arrays(*copy.at)
    for i, j in np.ndindex(high, wide):
        y, x = (i - (high - 1) / 2) / by, (j - (wide - 1) / 2) / by
        col = x * cos(angle) + y * sin(angle) + (cols - 1) / 2
        row = -x * sin(angle) + y * cos(angle) + (rows - 1) / 2
        if copy.inside[i, j]:
            far = max(far, abs(row - rows_at[i, j]), abs(col - cols_at[i, j]))
        else:
            assert not (-0.4 < row < rows - 0.6 and -0.4 < col < cols - 0.6)
        assert 0 <= rows_at[i, j] < rows and 0 <= cols_at[i, j] < cols
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
    training = np.arange(256, dtype=np.int32).reshape(16, 16)
    row, col = np.indices((8, 9))
    maps = {"rotation": col * 40.0, "scale": np.where(row < 4, 0.6, 1.4)}
    options = {"order": 2, "levels": 2, "device": "reference", "rng": 1, "finish": 0.0, "source": True}
    found = simdtex.simulate(training, 1, **maps, **options)
    assert (training[found.source_row.values, found.source_column.values] == found.simulation.values).all()
    usable = training % 16 < 11
    half = simdtex.simulate([training, -training], 1, **maps, **options, mask=[usable, usable])
    assert (half.source_column < 11).all()
    signs = np.where(half.source_image.values == 1, -1, 1)
    assert (signs * training[half.source_row.values, half.source_column.values] == half.simulation.values).all()

"""`simdtex.fill` and `simdtex.extend`: what they keep, where the rest is from, and what they refuse."""

import itertools

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, opencl, texture
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

import simdtex
from simdtex.jobs.filling.job import FEW, band_of, windows
from simdtex.model.source_map import apply_source_map

SHAPE = (16, 20)
QUICK = {"order": 2, "rng": 1, "xi": -8.0, "device": REFERENCE}


def hole_at(*parts, shape=SHAPE):
    mask = np.zeros(shape, bool)
    for part in parts:
        mask[part] = True
    return mask


MIDDLE = hole_at(np.s_[5:9, 6:11])


def fill(image, mask=None, **options):
    return simdtex.fill(image, mask, **(QUICK | options))


def extend(image, **options):
    return simdtex.extend(image, **(QUICK | options))


def planes(axis, image):
    return image[..., None] if axis is None else np.moveaxis(image, axis, -1)


def with_axis(axis, dtype=np.uint8, shape=SHAPE, seed=0):
    """A texture that is grey, or has three channels on an axis."""
    if axis is None:
        return texture(shape, dtype=dtype, seed=seed)
    return np.ascontiguousarray(np.moveaxis(texture(shape, 3, dtype, seed), -1, axis))


@pytest.mark.parametrize(("axis", "dtype"), [(None, np.bool_), (0, np.uint16), (-1, np.float32)])
def test_outside_the_hole_is_the_image_to_the_bit(dtype, axis):
    image = with_axis(axis, dtype)
    before = image.copy()
    found = fill(image, MIDDLE, channel_axis=axis, levels=1)
    assert_same_bits(image, before)
    assert (found.dtype, found.shape) == (image.dtype, image.shape)
    ours, theirs = planes(axis, found), planes(axis, image)
    assert_same_bits(ours[~MIDDLE], theirs[~MIDDLE])
    assert (ours[MIDDLE] != theirs[MIDDLE]).any()


def test_what_is_nan_or_masked_is_a_hole_whatever_it_holds():
    image = texture(SHAPE, 3, np.float32)
    known, holed = fill(image, MIDDLE, channel_axis=-1), image.copy()
    holed[MIDDLE, 1] = np.nan
    assert_same_bits(fill(holed, channel_axis=-1), known)
    assert_same_bits(fill(holed, MIDDLE, channel_axis=-1), known)
    masked = np.ma.array(image, mask=np.repeat(MIDDLE[..., None], 3, -1))
    assert_same_bits(fill(masked, channel_axis=-1), known)


def test_a_hole_is_widened_and_its_rim_blended():
    image, as_is = texture((30, 40)), {"light": "keep", "full_output": True}
    mask = hole_at(np.s_[12:16, 15:21], shape=image.shape)
    away = ndimage.distance_transform_edt(~mask)
    assert_same_bits(fill(image, mask, grow=2), fill(image, away <= 2))
    filled, far = fill(image, away <= 5, **as_is)
    blended, output = fill(image, mask, grow=2, feather=3, **as_is)
    share = np.clip(1 - np.ceil(away - 2) / 4, 0, 1)
    assert ((share > 0) == (away <= 5)).all()
    assert_same_bits(blended, np.round(share * filled + (1 - share) * image).astype(np.uint8))
    assert ((blended != filled) & (blended != image)).any()
    assert_same_bits(output.source[share >= 0.5], far.source[share >= 0.5])
    kept = fill(image, mask, grow=2, **as_is)[1].source
    assert_same_bits(output.source[share < 0.5], kept[share < 0.5])


def test_values_without_a_mean_change_half_way():
    image = np.where(texture((30, 40)) > 128, 200, 7).astype(np.uint8)
    for few in ({"categorical": True}, {}):
        found, output = fill(image, hole_at(np.s_[12:16, 15:21], shape=image.shape), feather=4, full_output=True, **few)
        assert set(np.unique(found)) == {7, 200}
        assert_same_bits(found, apply_source_map(output.source, image))


LEFT = np.s_[5:9, :3]


@pytest.mark.parametrize("boundary", ["open", "torus"])
def test_a_hole_may_be_anywhere(boundary):
    for part in (np.s_[-3:, 7:12], LEFT, np.s_[:4, -3:], np.s_[-1:, -1:], np.s_[6:8, :], np.s_[:, 9:11]):
        image, mask = texture(SHAPE), hole_at(part)
        found, output = fill(image, mask, boundary=boundary, finish=0.0, full_output=True)
        assert_same_bits(found[~mask], image[~mask])
        assert not mask[output.source[..., 0], output.source[..., 1]].any()
        assert not output.temperature.any()


FAR = hole_at(np.s_[3:6, 3:7], np.s_[20:24, 50:54], np.s_[2:5, 54:58], shape=(30, 60))


def test_a_hole_does_not_depend_on_what_is_beyond_its_reach():
    image, mask = texture((20, 80)), hole_at(np.s_[8:11, 8:12], shape=(20, 80))
    (window,) = windows(mask, 1, None)
    beyond = window.cols.stop + 6
    assert beyond < 40
    other = image.copy()
    other[:, beyond:] = 255 - other[:, beyond:]
    one, two = (fill(picture, mask, reach=6) for picture in (image, other))
    assert_same_bits(one[mask], two[mask])
    near = image.copy()
    near[:, beyond - 6 : beyond] = 255 - near[:, beyond - 6 : beyond]
    assert (fill(near, mask, reach=6)[mask] != one[mask]).any()


def test_the_middle_of_a_hole_sees_its_rim_at_the_coarsest_level():
    for side, radius, levels in ((1, 1, 1), (3, 1, 2), (4, 1, 2), (5, 1, 3), (9, 2, 3), (9, 5, 1)):
        mask = hole_at(np.s_[60 : 60 + side, 50 : 50 + side], shape=(200, 200))
        around = radius * 2 ** (levels - 1) + 1
        rows, cols = (slice(first - around, first + side + around) for first in (60, 50))
        assert windows(mask, radius, None) == [(rows, cols, levels)]


def test_equal_holes_get_different_pixels_and_each_those_that_it_gets_alone():
    parts = [np.s_[6:16, first : first + 10] for first in (8, 48, 88)]
    sample = np.random.default_rng(3).integers(0, 256, (16, 16), np.uint8)
    how = {"sample": sample, "order": 1, "xi": -1.0, "levels": 2, "schedule": "luby"}
    flat = np.full((24, 108), 128, np.uint8)
    filled = fill(flat, hole_at(*parts, shape=flat.shape), **how)
    first, second, third = (filled[part] for part in parts)
    assert max(np.mean(first == second), np.mean(second == third), np.mean(first == third)) < 0.5
    assert_same_bits(fill(flat, hole_at(parts[1], shape=flat.shape), **how)[parts[1]], second)


def test_many_holes_are_in_one_window():
    mask = np.zeros((100, 100), bool)
    mask.flat[[k * 2000 + 10 + 20 * j for k in range(4) for j in range(4)]] = True
    assert len(windows(mask, 1, None)) == mask.sum() == FEW
    mask[90, 90] = True
    assert windows(mask, 1, None) == [(slice(0, 93), slice(8, 93), 1)]
    for side, count in ((300, 16), (900, 1), (2800, 16)):  # of spots if it is cheaper: it has levels, and is prepared
        mask, first = np.zeros((side, side), bool), range(side // 8, side, side // 4)
        for row, col in itertools.product(first, first):
            mask[row : row + 5, col : col + 5] = True
        assert len(windows(mask, 7, None)) == count


@given(
    st.lists(st.tuples(*[st.integers(0, 59)] * 2, *[st.integers(1, 12)] * 2), min_size=1, max_size=8),
    st.integers(1, 3),
    st.sampled_from([None, 1, 2]),
)
def test_every_hole_is_in_one_window_with_what_its_sites_look_at(parts, radius, levels):
    mask = hole_at(*(np.s_[i : i + h, j : j + w] for i, j, h, w in parts), shape=(60, 60))
    found = windows(mask, radius, levels)
    covered = np.zeros(mask.shape, int)
    for rows, cols, _ in found:
        covered[rows, cols] += 1
    assert covered.max() == 1
    around = radius * 2 ** (found[0].levels - 1)
    for row, col in np.argwhere(mask):
        (one,) = (w for w in found if w.rows.start <= row < w.rows.stop and w.cols.start <= col < w.cols.stop)
        assert one.rows.start <= max(0, row - around) and min(60, row + around + 1) <= one.rows.stop
        assert one.cols.start <= max(0, col - around) and min(60, col + around + 1) <= one.cols.stop
    assert {one.levels for one in found} == {found[0].levels}
    assert len(found) <= FEW


def test_a_sample_is_all_that_a_hole_is_filled_from():
    image = with_axis(0) // 2
    sample = with_axis(0, shape=(12, 14), seed=4) // 2 + 128  # no pixel of the picture is one of the sample
    found, output = fill(image, MIDDLE, sample=sample, channel_axis=0, finish=0.0, full_output=True)
    ours = planes(0, found)
    assert_same_bits(ours[~MIDDLE], planes(0, image)[~MIDDLE])
    assert (output.source[~MIDDLE] == -1).all()
    row, col = output.source[MIDDLE].T
    assert_same_bits(ours[MIDDLE], planes(0, sample)[row, col])


def test_several_samples_are_told_apart():
    image, samples = texture(SHAPE), [texture((10, 12), seed=5), texture((14, 9), seed=6)]
    found, output = fill(image, MIDDLE, sample=samples, finish=0.0, shares=[1, 1], full_output=True)
    assert output.source.shape == (*SHAPE, 3) and (output.source[~MIDDLE] == -1).all()
    places = output.source[MIDDLE].tolist()
    assert {number for *_, number in places} == {0, 1}
    assert found[MIDDLE].tolist() == [samples[n][i, j] for i, j, n in places]


def test_a_callback_sees_the_whole_picture_and_a_fraction_that_never_falls():
    image, seen = texture(FAR.shape), []

    def look(progress):
        seen.append((progress.fraction, progress.image(), progress.temperature(), progress.source()))

    found, output = fill(image, FAR, reach=4, callback=look, full_output=True, xi=-1.0)
    fractions = [one[0] for one in seen]
    assert fractions == sorted(fractions)
    assert 0 < fractions[0] < 0.34 and 0.95 < fractions[-1] <= 1
    first, at_home = hole_at(np.s_[2:6, 3:7], shape=FAR.shape), np.moveaxis(np.indices(FAR.shape), 0, -1)
    for _, picture, temperature, source in seen:
        assert_same_bits(picture[~FAR], image[~FAR])
        assert temperature.shape == FAR.shape and (temperature[~FAR] == 0).all() and temperature.max() <= 1
        assert np.array_equal(source[~FAR], at_home[~FAR]) and (source < FAR.shape).all()
    assert max(one[2].max() for one in seen) > 0.5, "what is relaxed is warm"
    _, picture, _, source = seen[-1]  # windows that are finished are in the picture
    assert_same_bits(picture[first], found[first])
    assert np.array_equal(source[FAR], output.source[FAR]), "and the last sweep has found where all is from"
    assert_same_bits(fill(image, FAR, reach=4, xi=-1.0), found)


def test_statistics_are_of_every_window():
    _, output = fill(texture(FAR.shape), FAR, full_output=True, rng=7, levels=2)
    told = output.statistics
    assert (told["device"], told["seed"]) == (REFERENCE.name, 7)
    options = {name: told["options"][name] for name in ("boundary", "balance", "novelty", "chance", "data_weight")}
    assert options == {"boundary": "open", "balance": 0, "novelty": 0, "chance": 16, "data_weight": 4}
    assert told["device_seconds"] is None and told["levels"] == told["windows"][0]["levels"]
    assert len(told["levels"]) == 2
    assert len(told["windows"]) == 3 and told["seconds"] >= sum(one["seconds"] for one in told["windows"])
    for one in told["windows"]:
        top, bottom, left, right = one["window"]
        assert FAR[top:bottom, left:right].any()
        assert (one["levels"][-1]["rows"], one["levels"][-1]["cols"]) == (bottom - top, right - left)


def shaded(rows, cols):
    return (np.arange(cols) * 200 / cols + np.random.default_rng(8).integers(0, 40, (rows, cols))).astype(np.uint8)


def test_a_hole_takes_the_colours_of_its_rim():
    picture, hole = shaded(40, 60), hole_at(np.s_[12:28, 20:40], shape=(40, 60))
    made = simdtex.fill(picture, hole, rng=1, order=2, device=REFERENCE)
    assert np.abs(made[12:28, 20:40].mean(0) - picture[12:28, 20:40].mean(0)).mean() < 6


def test_rows_go_on_as_rows_and_columns_as_columns():
    picture, how = shaded(32, 40), {"rng": 1, "order": 2, "device": REFERENCE}
    below = simdtex.extend(picture, bottom=16, **how)[32:]
    beside = simdtex.extend(picture.T, right=16, **how)[:, 32:]
    for made in (below.mean(0), beside.mean(1)):
        assert np.abs(made - picture.mean(0)).mean() < 8


def test_on_a_torus_a_hole_at_an_edge_sees_the_other_side():
    image, mask = texture(SHAPE), hole_at(LEFT)
    other = image.copy()
    other[:, -1] = 255 - other[:, -1]
    for boundary, same in (("open", True), ("torus", False)):
        found = [fill(one, mask, boundary=boundary, reach=2)[mask] for one in (image, other)]
        assert (found[0] == found[1]).all() == same


def test_the_picture_is_in_its_place_to_the_bit():
    image = with_axis(-1, np.float32)
    found, output = extend(image, top=2, bottom=1, left=3, right=4, channel_axis=-1, finish=0.0, full_output=True)
    assert (found.dtype, found.shape) == (np.float32, (19, 27, 3))
    assert_same_bits(found[2:18, 3:23].copy(), image)
    assert np.array_equal(output.source[2:18, 3:23], np.moveaxis(np.indices(SHAPE), 0, -1))
    assert_same_bits(found, apply_source_map(output.source, image, SHAPE))
    assert output.statistics["options"]["boundary"] == "open"


@pytest.mark.parametrize(
    ("tile", "axis", "inner"), [(True, 0, np.s_[3:-3, 3:-3]), ("x", None, np.s_[:, 3:-3]), ("y", None, np.s_[3:-3, :])]
)
def test_a_tile_keeps_all_but_its_bands(tile, inner, axis):
    image = with_axis(axis)
    found, output = extend(image, seamless=tile, band=3, channel_axis=axis, finish=0.0, full_output=True)
    ours, theirs = planes(axis, found), planes(axis, image)
    assert ours.shape == theirs.shape
    assert_same_bits(ours[inner].copy(), theirs[inner].copy())
    assert np.array_equal(ours, apply_source_map(output.source, theirs, SHAPE))
    for one, unlike in ((ours != theirs, tile != "x"), ((ours != theirs).swapaxes(0, 1), tile != "y")):
        assert (one[:3].any() and one[-3:].any()) or not unlike


def test_a_tile_that_grows_in_one_direction_has_a_band_in_the_other_alone():
    image = texture(SHAPE)
    found = extend(image, seamless=True, right=5, band=3)
    assert found.shape == (16, 25)
    assert_same_bits(found[3:-3, :20].copy(), image[3:-3])
    assert (found[:3, :20] != image[:3]).any()


def wall(shape, brick, joint, seed=0):
    """Bricks of two sides with dark joints; every second course is shifted by half a brick."""
    rng, (y, x) = np.random.default_rng(seed), np.indices(shape)
    course = y // brick[0]
    x = x + course % 2 * (brick[1] // 2)
    tone = rng.integers(110, 200, shape)[course, x // brick[1]] + rng.integers(0, 30, shape)
    return np.where((y % brick[0] < joint) | (x % brick[1] < joint), 40, tone).astype(np.uint8)


def test_the_default_band_is_as_wide_as_the_parts_of_the_picture():
    for shape, width in (((24, 30), 8), ((72, 80), 9), ((600, 600), 64)):
        assert band_of(np.random.default_rng(1).integers(0, 256, (*shape, 1)).astype(np.uint8)) == width
    stones = ndimage.gaussian_filter(np.random.default_rng(3).normal(size=(240, 280, 1)), (11, 11, 0))
    assert 31 <= band_of(stones) <= 39, "sqrt(4 ln 10) standard deviations are 33 pixels"
    for scale in (1, 5):
        bricks = wall((190 * scale, 230 * scale), (12 * scale, 60 * scale), 2 * scale)[..., None]
        assert abs(band_of(bricks) - 32.3 * scale) < 2 * scale, "from a brick to one of the next course"
    assert band_of(np.arange(4000.0).reshape(100, 40, 1)) == 8


def test_the_default_band_is_replaced():
    image = texture((72, 80))
    changed = (extend(image, seamless="x", finish=0.0, order=1) != image).any(0)
    assert changed[: band_of(image[..., None])].all() and changed[-band_of(image[..., None]) :].all()
    assert not changed[band_of(image[..., None]) : -band_of(image[..., None])].any()


def test_half_of_a_small_picture_is_kept_by_default():
    for shape in ((16, 16), (4, 5), (9, 17)):
        image, middle = texture(shape), tuple(slice(side // 4, side - side // 4) for side in shape)
        assert np.array_equal(extend(image, seamless=True, finish=0.0, order=1)[middle], image[middle])


@pytest.mark.slow
def test_bricks_stay_whole_across_the_seam(any_device):
    """Of a wall whose width is no multiple of a brick; on a deformed lattice no joint would meet another."""
    image, courses = wall((96, 130), (16, 50), 2), np.arange(96) % 16 < 2
    made = simdtex.extend(image, seamless="x", rng=1, device=opencl(any_device))
    assert (made[courses] < 80).mean() > 0.99
    assert abs((made[~courses] < 80).mean() - (image[~courses] < 80).mean()) < 0.01


@pytest.mark.slow
def test_joints_go_on_through_a_hole(any_device):
    image, hole = wall((160, 200), (20, 50), 3), np.zeros((160, 200), bool)
    hole[45:115, 55:145] = True
    joints = hole & (np.arange(160) % 20 < 3)[:, None]
    made = simdtex.fill(image, hole, rng=1, device=opencl(any_device))
    assert (made[joints] < 80).mean() > 0.97


@pytest.mark.slow
def test_the_bands_beside_a_picture_take_pixels_of_about_the_same_rows(any_device):
    """Of noise, 14 pixels away on average; 60 to 90 without a guide, which puts grass into a sky."""
    image, device = np.random.default_rng(1).integers(0, 256, (400, 40)).astype(np.uint8), opencl(any_device)
    _, output = simdtex.extend(image, seamless="x", band=9, order=4, rng=1, device=device, full_output=True)
    rows = output.source[:, np.r_[:9, 31:40], 0]
    assert np.abs(rows - np.arange(400)[:, None]).mean() < 30


@pytest.mark.slow
def test_a_tile_wraps(any_device):
    """Of stripes that do not fit their picture the step across the seam is 93; a tile has 58, and finished 34."""

    def step(image, axis):
        return np.abs(np.take(image, 0, axis).astype(float) - np.take(image, -1, axis)).mean()

    for axis in (0, 1):
        images = [texture((32, 40), seed=seed) for seed in range(2)]
        how = {"seamless": True, "band": 5, "xi": -1.0, "device": opencl(any_device)}
        tiles = [extend(image, rng=seed, **how) for seed, image in enumerate(images)]
        assert np.mean([step(tile, axis) for tile in tiles]) < 0.55 * np.mean([step(image, axis) for image in images])


FLOAT = texture(SHAPE, dtype=np.float32)
NAN = np.where(hole_at(np.s_[3:4, 4:5]), np.float32(np.nan), FLOAT)
BAD = [
    (fill, {"mask": np.zeros(SHAPE, bool)}, "nothing to fill; give a mask that is True"),
    (fill, {"mask": np.ones(SHAPE, bool)}, "nothing of the picture is known; give a mask"),
    (fill, {"mask": MIDDLE.astype(np.uint8)}, "mask holds uint8 values; give True and False"),
    (fill, {"mask": MIDDLE[:-1]}, "mask is 15x20 and the picture 16x20 .*; give one size"),
    (fill, {"levels": 2**31 - 1}, f"levels={2**31 - 1} is too many"),
    (fill, {"reach": 0}, "reach is 0; give 1 or more"),
    (fill, {"sample": FLOAT}, "sample has 1 channel of float32 and the picture 1 channel of uint8; convert"),
    (fill, {"image": FLOAT, "sample": np.full(SHAPE, np.nan, np.float32)}, "no known pixel"),
    (extend, {}, "nothing to add; give top, bottom, left or right, or seamless=True"),
    (extend, {"top": -3}, "top is -3; give 0 or more"),
    (extend, {"seamless": "z"}, "seamless is 'z'; give True, False"),
    (extend, {"seamless": True, "band": 0}, "band is 0; give 1 or more"),
    (extend, {"seamless": True, "band": 8}, "band=8 leaves nothing of 16x20 .* narrower"),
    (extend, {"image": NAN, "left": 2}, "NaN or infinite, the first at row 3.*: fill them"),
    (extend, {"seamless": True, "band": 3, "boundary": "open"}, "follows from seamless; leave boundary out"),
]


@pytest.mark.parametrize(("function", "change", "words"), BAD)
def test_bad_input_is_refused_with_a_remedy(function, change, words):
    usual = {"image": texture(SHAPE), "mask": MIDDLE} if function is fill else {"image": texture(SHAPE)}
    with pytest.raises((ValueError, TypeError), match=words):
        function(**usual | change)


def test_the_remedy_for_a_picture_with_scattered_holes_works():
    image, hole = texture((24, 24)), np.random.default_rng(7).random((24, 24)) < 0.7
    with pytest.raises(ValueError, match="give more of it, order=1 or 2, or"):
        fill(image, hole, order=18)
    assert (fill(image, hole, order=2)[~hole] == image[~hole]).all()


def test_of_a_picture_that_is_mostly_unknown_fewer_levels_are_made():
    picture, hole = texture(SHAPE), ~hole_at(np.s_[5:11, 6:13])
    filled = fill(picture, hole)
    assert (filled[~hole] == picture[~hole]).all()
    with pytest.raises(ValueError, match="fewer levels"):
        fill(picture, hole, levels=3)

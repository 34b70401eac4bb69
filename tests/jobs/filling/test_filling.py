"""`simdtex.fill` and `simdtex.extend`: what they keep, where the rest is from, and what they refuse."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, opencl, texture
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

import simdtex
from simdtex.jobs.filling.job import FEW, band_of, windows
from simdtex.model.source_map import apply_source_map

TYPES = [np.bool_, np.uint8, np.uint16, np.int32, np.float32, np.float64]
SHAPE = (16, 20)
QUICK = {"order": 2, "rng": 1, "xi": -8.0, "device": REFERENCE}


def hole_at(*parts, shape=SHAPE):
    """A mask that is True in each part, (rows, columns) as slices."""
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
    """The picture with its channels last, (rows, cols, C)."""
    return image[..., None] if axis is None else np.moveaxis(image, axis, -1)


def with_axis(axis, dtype=np.uint8, shape=SHAPE, seed=0):
    """A texture that is grey, or has three channels on an axis."""
    if axis is None:
        return texture(shape, dtype=dtype, seed=seed)
    return np.ascontiguousarray(np.moveaxis(texture(shape, 3, dtype, seed), -1, axis))


@pytest.mark.parametrize(("axis", "dtype"), [*((None, dtype) for dtype in TYPES), (0, np.uint8), (-1, np.float32)])
def test_outside_the_hole_is_the_image_to_the_bit(dtype, axis):
    image = with_axis(axis, dtype)
    before = image.copy()
    found = fill(image, MIDDLE, channel_axis=axis, levels=1)
    assert_same_bits(image, before)
    assert (found.dtype, found.shape) == (image.dtype, image.shape)
    ours, theirs = planes(axis, found), planes(axis, image)
    assert_same_bits(ours[~MIDDLE], theirs[~MIDDLE])
    assert (ours[MIDDLE] != theirs[MIDDLE]).any()


@pytest.mark.parametrize(("axis", "dtype"), [(None, np.float64), (0, np.float32), (-1, np.float64)])
def test_nan_is_a_hole(dtype, axis):
    image = with_axis(axis, dtype)
    holed = image.copy()
    planes(axis, holed)[MIDDLE] = np.nan
    found = fill(holed, channel_axis=axis)
    assert np.isfinite(found).all()
    assert_same_bits(found, fill(image, MIDDLE, channel_axis=axis))
    assert_same_bits(found, fill(holed, MIDDLE, channel_axis=axis))


def test_nan_in_one_channel_is_a_hole_in_all():
    image = texture(SHAPE, 3, np.float32)
    image[5:9, 6:11, 1] = np.nan
    found, output = fill(image, channel_axis=-1, finish=0.0, full_output=True)
    assert_same_bits(found, image[output.source[..., 0], output.source[..., 1]])
    assert_same_bits(found[~MIDDLE], image[~MIDDLE])


def test_what_a_hole_holds_makes_no_difference():
    image, other = texture(SHAPE), texture(SHAPE)
    other[MIDDLE] = 255 - other[MIDDLE]
    assert_same_bits(fill(image, MIDDLE), fill(other, MIDDLE))


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


@pytest.mark.parametrize("few", [{"categorical": True}, {}], ids=["categories", "few"])
def test_values_without_a_mean_change_half_way(few):
    image = np.where(texture((30, 40)) > 128, 200, 7).astype(np.uint8)
    found, output = fill(image, hole_at(np.s_[12:16, 15:21], shape=image.shape), feather=4, full_output=True, **few)
    assert set(np.unique(found)) == {7, 200}
    assert_same_bits(found, apply_source_map(output.source, image))


EDGES = {
    "top": np.s_[:3, 7:12],
    "bottom": np.s_[-3:, 7:12],
    "left": np.s_[5:9, :3],
    "right": np.s_[5:9, -3:],
    "top left": np.s_[:4, :3],
    "top right": np.s_[:4, -3:],
    "bottom left": np.s_[-4:, :3],
    "bottom right": np.s_[-4:, -3:],
    "a pixel": np.s_[8:9, 8:9],
    "a corner": np.s_[-1:, -1:],
    "rows across": np.s_[6:8, :],
    "columns down": np.s_[:, 9:11],
}


@pytest.mark.parametrize("boundary", ["open", "torus"])
@pytest.mark.parametrize("where", EDGES)
def test_a_hole_may_be_anywhere(where, boundary):
    image, mask = texture(SHAPE), hole_at(EDGES[where])
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


@pytest.mark.parametrize("reach", [1, 3, None])
def test_nothing_is_from_beyond_the_reach(reach):
    image, mask = texture((20, 40)), hole_at(np.s_[8:11, 4:8], shape=(20, 40))
    _, output = fill(image, mask, reach=reach, full_output=True)
    top, bottom, left, right = output.statistics["windows"][0]["window"]
    reach = 128 if reach is None else reach
    row, col = output.source[mask].T
    assert top - reach <= row.min() and row.max() < bottom + reach
    assert left - reach <= col.min() and col.max() < right + reach


def test_levels_are_those_that_are_asked_for():
    image = texture(SHAPE)
    for levels in (1, 2):
        _, output = fill(image, MIDDLE, levels=levels, order=2, full_output=True)
        assert len(output.statistics["levels"]) == levels
    for levels in (9, 2**31 - 1):
        with pytest.raises(ValueError, match=f"levels={levels} is too many"):
            fill(image, MIDDLE, levels=levels)


@pytest.mark.parametrize(("side", "radius", "levels"), [(1, 1, 1), (2, 1, 1), (3, 1, 2), (4, 1, 2), (5, 1, 3),
                                                        (9, 1, 4), (9, 2, 3), (9, 4, 2), (9, 5, 1)])  # fmt: skip
def test_the_middle_of_a_hole_sees_its_rim_at_the_coarsest_level(side, radius, levels):
    mask = hole_at(np.s_[60 : 60 + side, 50 : 50 + side], shape=(200, 200))
    ((rows, cols, found),) = windows(mask, radius, None)
    around = radius * 2 ** (levels - 1) + 1
    assert found == levels
    assert (rows, cols) == (slice(60 - around, 60 + side + around), slice(50 - around, 50 + side + around))


@pytest.mark.parametrize("options", [{"levels": 1}, {"levels": 1, "schedule": "luby"}, {"levels": 3}], ids=str)
def test_equal_holes_get_different_pixels_and_each_those_that_it_gets_alone(options):
    """The random numbers of a site are those of its place in the picture."""
    parts = [np.s_[10:22, first : first + 12] for first in (12, 60, 108)]
    given = {"sample": np.random.default_rng(3).integers(0, 256, (20, 20), np.uint8), "order": 1, "xi": -1.0} | options
    flat = np.full((32, 132), 128, np.uint8)
    filled = fill(flat, hole_at(*parts, shape=flat.shape), **given)
    first, second, third = (filled[part] for part in parts)
    assert max(np.mean(first == second), np.mean(second == third), np.mean(first == third)) < 0.5
    assert_same_bits(fill(flat, hole_at(parts[1], shape=flat.shape), **given)[parts[1]], second)


def test_many_holes_are_in_one_window():
    mask = np.zeros((100, 100), bool)
    mask.flat[[k * 2000 + 10 + 20 * j for k in range(4) for j in range(4)]] = True
    assert mask.sum() == FEW
    assert len(windows(mask, 1, None)) == FEW
    mask[90, 90] = True
    assert windows(mask, 1, None) == [(slice(0, 93), slice(8, 93), 1)]


@pytest.mark.parametrize(("side", "count"), [(300, 16), (900, 1), (3000, 16)])
def test_spots_are_in_one_window_if_that_is_cheaper(side, count):
    """It has several levels where a picture is large, but its preparation takes longer the larger it is."""
    mask = np.zeros((side, side), bool)
    for row in range(side // 8, side, side // 4):
        for col in range(side // 8, side, side // 4):
            mask[row : row + 5, col : col + 5] = True
    assert len(windows(mask, 7, None)) == count


@given(
    st.lists(
        st.tuples(st.integers(0, 59), st.integers(0, 59), st.integers(1, 12), st.integers(1, 12)),
        min_size=1,
        max_size=8,
    ),
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


@pytest.mark.parametrize("axis", [None, 0])
def test_a_sample_is_all_that_a_hole_is_filled_from(axis):
    image = with_axis(axis) // 2
    sample = with_axis(axis, shape=(12, 14), seed=4) // 2 + 128  # no pixel of the picture is one of the sample
    found, output = fill(image, MIDDLE, sample=sample, channel_axis=axis, finish=0.0, full_output=True)
    ours = planes(axis, found)
    assert_same_bits(ours[~MIDDLE], planes(axis, image)[~MIDDLE])
    assert (output.source[~MIDDLE] == -1).all()
    row, col = output.source[MIDDLE].T
    assert_same_bits(ours[MIDDLE], planes(axis, sample)[row, col])


def test_several_samples_are_told_apart():
    image, samples = texture(SHAPE), [texture((10, 12), seed=5), texture((14, 9), seed=6)]
    found, output = fill(image, MIDDLE, sample=samples, finish=0.0, shares=[1, 1], full_output=True)
    assert output.source.shape == (*SHAPE, 3)
    assert (output.source[~MIDDLE] == -1).all()
    row, col, number = output.source[MIDDLE].T
    assert set(number.tolist()) == {0, 1}
    values = [int(samples[n][i, j]) for i, j, n in zip(row, col, number, strict=True)]
    assert found[MIDDLE].tolist() == values


@pytest.mark.parametrize(("axis", "sample"), [(None, None), (0, (17, 19))])
def test_a_callback_sees_the_whole_picture_and_a_fraction_that_never_falls(axis, sample):
    image = with_axis(axis, shape=FAR.shape)
    other = sample and with_axis(axis, shape=sample)
    seen = []

    def look(progress):
        seen.append((progress.fraction, progress.image(), progress.temperature(), progress.source()))

    found, output = fill(image, FAR, sample=other, reach=4, channel_axis=axis, callback=look, full_output=True, xi=-1.0)
    fractions = [one[0] for one in seen]
    assert fractions == sorted(fractions)
    assert 0 < fractions[0] < 0.34 and 0.95 < fractions[-1] <= 1
    known, first = ~FAR, hole_at(np.s_[2:6, 3:7], shape=FAR.shape)
    at_home = np.full((*FAR.shape, 2), -1) if sample else np.moveaxis(np.indices(FAR.shape), 0, -1)
    for _, picture, temperature, source in seen:
        assert (picture.shape, picture.dtype) == (image.shape, image.dtype)
        assert_same_bits(planes(axis, picture)[known], planes(axis, image)[known])
        assert temperature.shape == FAR.shape and (temperature[known] == 0).all() and temperature.max() <= 1
        assert np.array_equal(source[known], at_home[known])
        assert source.shape == (*FAR.shape, 2) and (source < (sample or FAR.shape)).all()
    assert max(one[2].max() for one in seen) > 0.5, "what is relaxed is warm"
    _, picture, _, source = seen[-1]  # windows that are finished are in the picture
    assert_same_bits(planes(axis, picture)[first], planes(axis, found)[first])
    assert np.array_equal(source[first], output.source[first])
    assert np.array_equal(source[FAR], output.source[FAR]), "and the last sweep has found where all is from"
    assert_same_bits(fill(image, FAR, sample=other, reach=4, channel_axis=axis, xi=-1.0), found)


def test_statistics_are_of_every_window():
    _, output = fill(texture(FAR.shape), FAR, full_output=True, rng=7)
    told = output.statistics
    assert (told["device"], told["seed"]) == (REFERENCE.name, 7)
    options = {name: told["options"][name] for name in ("boundary", "balance", "novelty", "chance", "data_weight")}
    assert options == {"boundary": "open", "balance": 0, "novelty": 0, "chance": 16, "data_weight": 4}
    assert told["device_seconds"] is None
    assert len(told["windows"]) == 3 and told["levels"] == told["windows"][0]["levels"]
    for one in told["windows"]:
        top, bottom, left, right = one["window"]
        assert FAR[top:bottom, left:right].any()
        assert (one["levels"][-1]["rows"], one["levels"][-1]["cols"]) == (bottom - top, right - left)
    assert told["seconds"] >= sum(one["seconds"] for one in told["windows"])
    assert output.temperature.shape == FAR.shape and not output.temperature.any()


def shaded(rows, cols):
    """Fine grain on a shade from black at the left to white at the right."""
    return (np.arange(cols) * 200 / cols + np.random.default_rng(8).integers(0, 40, (rows, cols))).astype(np.uint8)


def test_a_hole_takes_the_colours_of_its_rim(any_device):
    picture, hole = shaded(60, 90), np.zeros((60, 90), bool)
    hole[15:45, 30:60] = True
    made = simdtex.fill(picture, hole, rng=1, order=4, device=opencl(any_device))
    error = np.abs(made[15:45, 30:60].mean(0) - picture[15:45, 30:60].mean(0))
    assert error.mean() < 6


def test_rows_go_on_as_rows_and_columns_as_columns(any_device):
    picture = shaded(48, 60)
    below = simdtex.extend(picture, bottom=24, rng=1, order=4, device=opencl(any_device))[48:]
    beside = simdtex.extend(picture.T, right=24, rng=1, order=4, device=opencl(any_device))[:, 48:]
    for made in (below.mean(0), beside.mean(1)):
        assert np.abs(made - picture.mean(0)).mean() < 14


def test_on_a_torus_a_hole_at_an_edge_sees_the_other_side():
    image, mask = texture(SHAPE), hole_at(EDGES["left"])
    other = image.copy()
    other[:, -1] = 255 - other[:, -1]
    results = {
        boundary: [fill(one, mask, boundary=boundary, reach=2)[mask] for one in (image, other)]
        for boundary in ("open", "torus")
    }
    assert (results["torus"][0] != results["torus"][1]).any()
    assert_same_bits(*results["open"])


@pytest.mark.parametrize(("axis", "dtype"), [(None, np.bool_), (0, np.uint8), (-1, np.float32)])
def test_the_picture_is_in_its_place_to_the_bit(dtype, axis):
    image = with_axis(axis, dtype)
    found = extend(image, top=2, bottom=1, left=3, right=4, channel_axis=axis)
    assert found.dtype == image.dtype
    ours, theirs = planes(axis, found), planes(axis, image)
    assert ours.shape == (19, 27, theirs.shape[-1])
    assert_same_bits(ours[2:18, 3:23].copy(), theirs.copy())


@pytest.mark.parametrize("side", ["top", "bottom", "left", "right"])
def test_each_side_alone(side):
    image = texture(SHAPE)
    found, output = extend(image, **{side: 3}, finish=0.0, full_output=True)
    rows = slice(3 * (side == "top"), 3 * (side == "top") + 16)
    cols = slice(3 * (side == "left"), 3 * (side == "left") + 20)
    assert found.shape == (16 + 3 * (side in ("top", "bottom")), 20 + 3 * (side in ("left", "right")))
    assert_same_bits(found[rows, cols].copy(), image)
    assert np.array_equal(output.source[rows, cols], np.moveaxis(np.indices(SHAPE), 0, -1))
    assert_same_bits(found, apply_source_map(output.source, image, SHAPE))
    assert output.statistics["options"]["boundary"] == "open"


@pytest.mark.parametrize(("tile", "inner"), [(True, np.s_[3:-3, 3:-3]), ("x", np.s_[:, 3:-3]), ("y", np.s_[3:-3, :])])
@pytest.mark.parametrize("axis", [None, 0])
def test_a_tile_keeps_all_but_its_bands(tile, inner, axis):
    image = with_axis(axis)
    found, output = extend(image, seamless=tile, band=3, channel_axis=axis, finish=0.0, full_output=True)
    ours, theirs = planes(axis, found), planes(axis, image)
    assert ours.shape == theirs.shape
    assert_same_bits(ours[inner].copy(), theirs[inner].copy())
    assert (ours != theirs).any()
    assert np.array_equal(ours, apply_source_map(output.source, theirs, SHAPE))
    if tile != "y":
        assert (ours[:, :3] != theirs[:, :3]).any() and (ours[:, -3:] != theirs[:, -3:]).any()
    if tile != "x":
        assert (ours[:3] != theirs[:3]).any() and (ours[-3:] != theirs[-3:]).any()


def test_a_tile_that_grows_in_one_direction_has_a_band_in_the_other_alone():
    image = texture(SHAPE)
    found = extend(image, seamless=True, right=5, band=3)
    assert found.shape == (16, 25)
    assert_same_bits(found[3:-3, :20].copy(), image[3:-3])
    assert (found[:3, :20] != image[:3]).any()


def wall(shape, brick, joint, seed=0):
    """Bricks of two sides, (rows, columns), with dark joints; every second course is shifted by half a brick."""
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


@pytest.mark.parametrize("shape", [(16, 16), (4, 5), (9, 17), (16, 60)])
def test_half_of_a_small_picture_is_kept_by_default(shape):
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


def test_the_bands_beside_a_picture_take_pixels_of_about_the_same_rows(any_device):
    """Of noise, 14 pixels away on average; 60 to 90 without a guide, which puts grass into a sky."""
    image, device = np.random.default_rng(1).integers(0, 256, (400, 40)).astype(np.uint8), opencl(any_device)
    _, output = simdtex.extend(image, seamless="x", band=9, order=4, rng=1, device=device, full_output=True)
    rows = output.source[:, np.r_[:9, 31:40], 0]
    assert np.abs(rows - np.arange(400)[:, None]).mean() < 30


def step(image, axis):
    """The mean absolute step across the seam of a tile."""
    found = image.astype(float)
    return np.abs(np.take(found, 0, axis) - np.take(found, -1, axis)).mean()


@pytest.mark.parametrize(("finish", "most"), [pytest.param(0.0, 0.8, marks=pytest.mark.slow), (None, 0.55)])
def test_a_tile_wraps(any_device, finish, most):
    """Of stripes that do not fit their picture the step across the seam is 93; a tile has 58, and finished 34."""
    for axis in (0, 1):
        images = [texture((32, 40), seed=seed) for seed in range(2)]
        how = {"seamless": True, "band": 5, "finish": finish, "xi": -1.0, "device": opencl(any_device)}
        tiles = [extend(image, rng=seed, **how) for seed, image in enumerate(images)]
        assert np.mean([step(tile, axis) for tile in tiles]) < most * np.mean([step(image, axis) for image in images])


IMAGE = texture(SHAPE)
FLOAT = texture(SHAPE, dtype=np.float32)


def holding(value):
    found = FLOAT.copy()
    found[3, 4] = value
    return found


BAD_FILL = {
    "nothing to fill": ({"mask": np.zeros(SHAPE, bool)}, ValueError, "nothing to fill; give a mask that is True"),
    "nothing known": ({"mask": np.ones(SHAPE, bool)}, ValueError, "nothing of the picture is known; give a mask"),
    "a mask of numbers": ({"mask": MIDDLE.astype(np.uint8)}, TypeError, "mask holds uint8 values; give True and False"),
    "another size": ({"mask": MIDDLE[:-1]}, ValueError, "mask is 15x20 and the picture 16x20 .*; give one size"),
    "no reach": ({"reach": 0}, ValueError, "reach is 0; give 1 or more"),
    "a sample of another type": (
        {"sample": FLOAT}, ValueError, "sample has 1 channel of float32 and the picture 1 channel of uint8; convert"),
    "a sample with colour": ({"sample": texture(SHAPE, 3)}, ValueError, "the sample is 3-dimensional"),
    "a sample of nothing": (
        {"image": FLOAT, "sample": np.full(SHAPE, np.nan, np.float32)}, ValueError, "no known pixel"),
    "an unknown option": ({"method": "mrf"}, TypeError, "unknown option 'method'"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_FILL)
def test_bad_input_to_fill_is_refused_with_a_remedy(case):
    change, error, words = BAD_FILL[case]
    arguments = {"image": IMAGE, "mask": MIDDLE} | change
    with pytest.raises(error, match=words) as caught:
        fill(**arguments)
    assert "\n" not in str(caught.value)


def test_the_remedy_for_a_picture_with_scattered_holes_works():
    image, hole = texture((48, 48)), np.random.default_rng(0).random((48, 48)) < 0.75
    with pytest.raises(ValueError, match="give more of it, order=1 or 2, or"):
        fill(image, hole, order=18)
    assert (fill(image, hole, order=2)[~hole] == image[~hole]).all()


BAD_EXTEND = {
    "nothing to add": ({}, ValueError, "nothing to add; give top, bottom, left or right, or seamless=True"),
    **{side: ({side: -3}, ValueError, f"{side} is -3; give 0 or more") for side in ("top", "bottom", "left", "right")},
    "a tile in z": ({"seamless": "z"}, ValueError, "seamless is 'z'; give True, False"),
    "no band": ({"seamless": True, "band": 0}, ValueError, "band is 0; give 1 or more"),
    "all a band": (
        {"seamless": True, "band": 8},
        ValueError,
        "band=8 leaves nothing of 16x20 .* narrower",
    ),
    "NaN": ({"image": holding(np.nan), "left": 2}, ValueError, "NaN or infinite, the first at row 3.*: fill them"),
    "a boundary": (
        {"seamless": True, "band": 3, "boundary": "open"},
        ValueError,
        "follows from seamless; leave boundary out",
    ),
    "an unknown option": ({"left": 2, "reach": 3}, TypeError, "unknown option 'reach'"),
}


@pytest.mark.parametrize("case", BAD_EXTEND)
def test_bad_input_to_extend_is_refused_with_a_remedy(case):
    change, error, words = BAD_EXTEND[case]
    with pytest.raises(error, match=words) as caught:
        extend(**({"image": IMAGE} | change))
    assert "\n" not in str(caught.value)


def test_of_a_picture_that_is_mostly_unknown_fewer_levels_are_made():
    picture, hole = texture(SHAPE), ~hole_at(np.s_[5:11, 6:13])
    filled = fill(picture, hole)
    assert (filled[~hole] == picture[~hole]).all()
    with pytest.raises(ValueError, match="fewer levels"):
        fill(picture, hole, levels=3)


def test_a_masked_picture_is_filled_where_it_is_masked():
    masked = np.ma.array(texture(SHAPE), mask=MIDDLE)
    assert_same_bits(fill(masked), fill(texture(SHAPE), MIDDLE))

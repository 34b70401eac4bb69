"""What a sample is made of: its gaps, what may be used, and its categories."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.model.lattice import neighbourhood_offsets
from simdtex.model.pictures import Pictures, completed, unknown_in
from simdtex.model.sample import Sample


def line(*values, dtype=np.float32):
    """A picture of one row and one channel."""
    return np.array(values, dtype)[None, :, None]


def test_unknown_is_nan_in_any_channel():
    picture = np.zeros((2, 3, 2))
    picture[0, 1, 1] = picture[1, 2, 0] = np.nan
    assert np.argwhere(unknown_in(picture)).tolist() == [[0, 1], [1, 2]]
    assert not unknown_in(picture.astype(np.float32)[..., :0]).any()
    assert not unknown_in(np.zeros((2, 3, 1), np.uint8)).any()


def test_a_gap_is_completed_by_the_nearest_known_pixel():
    pictures = Pictures((line(1, np.nan, np.nan, np.nan, 9),))
    assert pictures.pixels[0].ravel().tolist()[:2] == [1, 1]
    assert pictures.pixels[0].ravel().tolist()[3:] == [9, 9]
    assert pictures.known[0].tolist() == [[True, False, False, False, True]]
    assert pictures.values(0, 0).tolist() == [1, 9]


@given(st.integers(0, 2**16), st.integers(1, 9), st.integers(1, 9))
@settings(max_examples=30)
def test_no_known_pixel_is_nearer_than_the_one_taken(seed, rows, cols):
    rng = np.random.default_rng(seed)
    picture, gap = rng.permutation(rows * cols).reshape(rows, cols, 1), rng.random((rows, cols)) < 0.7
    gap.flat[0] = False
    found = completed(picture, gap)
    place = {int(picture[i, j, 0]): (i, j) for i, j in np.ndindex(rows, cols) if not gap[i, j]}
    for i, j in np.ndindex(rows, cols):
        k, m = place[int(found[i, j, 0])]
        assert (k - i) ** 2 + (m - j) ** 2 == min((a - i) ** 2 + (b - j) ** 2 for a, b in place.values())


def test_what_is_said_to_be_unknown_is_so_beside_nan():
    unknown = (np.array([[False, True, False]]),)
    pictures = Pictures((line(5, 6, 7, dtype=np.uint8),), unknown)
    assert pictures.known[0].tolist() == [[True, False, True]]
    assert pictures.pixels[0].ravel().tolist()[::2] == [5, 7]
    with pytest.raises(ValueError, match="no known pixel"):
        Pictures((line(np.nan, np.nan),))


def test_a_copy_with_other_weights_has_the_same_gaps():
    pictures = replace(Pictures((line(1, np.nan, 3),)), weights=(2.0,))
    assert pictures.known[0].tolist() == [[True, False, True]]


def test_clean_is_one_picture_all_known_and_all_usable():
    one = line(1, 2)
    assert Pictures((one,)).clean
    assert not Pictures((one, one)).clean
    assert not Pictures((one,), usable=(np.array([[True, True]]),)).clean
    assert not Pictures((line(1, np.nan),)).clean


def test_categories_are_those_of_all_pictures_that_are_known():
    pictures = Pictures((line(3, np.nan, 1), line(7, 3)), categorical=(True,))
    assert pictures.categories(0).tolist() == [1, 3, 7]
    assert pictures.channels == 3
    assert Pictures((line(3, 7),), categorical=(True,)).channels == 1, "of two, one says which"
    assert Pictures((line(3, 3),), categorical=(True,)).channels == 1
    assert Pictures((line(3, 4, 5),)).categories(0) is None


def two(step=2, margin=2, apart=0):
    first, second = np.arange(20).reshape(4, 5, 1), np.arange(100, 121).reshape(7, 3, 1)
    return Sample(Pictures((first.astype(np.uint8), second.astype(np.uint8))), 8, margin, step=step, apart=apart)


def test_pictures_lie_one_below_another():
    sample = two()
    assert sample.boxes == [(0, 4, 5), (8, 7, 3)]
    assert (sample.height, sample.width) == (15, 5)
    assert sample.inside.sum() == 20 + 21
    assert sample.pixels[8:15, :3, 0].ravel().tolist() == list(range(100, 121))
    assert two(step=4, margin=3).boxes[1][0] == 12, "at a multiple of the step"
    assert two(apart=9).boxes[1][0] == 14, "or further"
    margins = sample.working.reshape(sample.rows, sample.cols)[8 : 8 + 11, :7]
    assert (margins == np.pad(np.arange(100, 121).reshape(7, 3), 2, mode="reflect")).all()


def test_places_and_pixel_indices_are_each_others_inverse():
    sample = two()
    place = np.array([[0, 0, 0], [3, 4, 0], [0, 0, 1], [6, 2, 1], [-1, -1, -1]])
    index = sample.index(place)
    assert index[-1] == -1
    assert sample.place(index).tolist() == place.tolist()
    assert sample.picture_of(index[:4]).tolist() == [0, 0, 1, 1]


@pytest.mark.parametrize("edges", ["whole", "reflect", "auto"])
@pytest.mark.parametrize(("spacing", "phases"), [(1, "all"), (2, "all"), (2, "decimated")])
def test_candidates_are_those_of_each_picture_alone(edges, spacing, phases):
    rng = np.random.default_rng(1)
    masks = [rng.random((7, 8)) < 0.7, rng.random((9, 6)) < 0.7]
    pictures = [rng.integers(0, 9, (*mask.shape, 1)).astype(np.uint8) for mask in masks]
    sample = Sample(Pictures(tuple(pictures), usable=tuple(masks)), 8, 2, step=2)
    offsets, step = neighbourhood_offsets(1), 1 if phases == "all" else spacing
    found = [tuple(p) for p in sample.place(sample.places(offsets, spacing, phases, edges).positions).tolist()]
    every = [(i, j, n) for n, mask in enumerate(masks) for i, j in np.ndindex(mask.shape) if mask[i, j]]
    every = [(i, j, n) for i, j, n in every if i % step == j % step == 0]
    whole = [
        (i, j, n)
        for i, j, n in every
        if all(spacing <= x < side - spacing for x, side in zip((i, j), masks[n].shape, strict=True))
    ]
    all_of_them = edges == "reflect" or (edges == "auto" and (spacing > 1 or len(whole) < 0.75 * len(every)))
    assert found == (every if all_of_them else whole)


def test_a_candidate_knows_enough_of_its_neighbours(monkeypatch):
    known = np.ones((9, 9), bool)
    known[4, 4] = known[4, 5] = False
    pixels = (np.zeros((9, 9, 1), np.uint8),)
    offsets = neighbourhood_offsets(1)
    found = {}
    for unsure in (0.0, 0.25, 0.5):
        monkeypatch.setattr("simdtex.model.sample.UNSURE", unsure)
        sample = Sample(Pictures(pixels, unknown=(~known,)), 4, 1)
        found[unsure] = {tuple(p) for p in sample.place(sample.places(offsets, 1, "all", "reflect").positions).tolist()}
    everywhere = {(i, j) for i, j in np.ndindex(9, 9) if known[i, j]}
    beside = {(3, 4), (5, 4), (4, 3), (3, 5), (5, 5), (4, 6)}  # each sees one of the two
    assert found == {0.0: everywhere - beside, 0.25: everywhere, 0.5: everywhere}


def test_what_is_fair_is_in_proportion_to_shares():
    offsets = neighbourhood_offsets(1)
    where = (offsets, 1, "all", "reflect")
    first, second = np.zeros((4, 5, 1), np.uint8), np.zeros((8, 5, 1), np.uint8)
    sample = Sample(Pictures((first, second), shares=(3.0, 1.0)), 4, 1)
    places = sample.places(*where)
    fair, picture = sample.fair(places), sample.picture_of(places.everywhere)
    assert fair[picture == 0].sum() == pytest.approx(3 * fair[picture == 1].sum(), rel=1e-4)
    assert (fair > 0).sum() == 60
    several, one = Sample(Pictures((first, second)), 4, 1), Sample(Pictures((first,)), 4, 1)
    alike = several.fair(several.places(*where))
    assert sorted(set(alike.tolist())) == [0, 1]
    assert one.fair(one.places(*where)) is None

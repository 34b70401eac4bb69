"""Cells that are out of place, and stripes that end."""

import numpy as np
import pytest

from simdtex import quality

SIDE = 96


def cells(rows=SIDE, cols=SIDE, period=(12, 16), seed=1):
    """Bright bricks in dark joints, every other row by half a brick to the right, with noise."""
    row, col = np.indices((rows, cols))
    col = col + (row // period[0]) % 2 * (period[1] // 2)
    joint = (row % period[0] < 2) | (col % period[1] < 2)
    return (np.where(joint, 60, 170) + np.random.default_rng(seed).normal(0, 12, (rows, cols))).astype(np.uint8)


def test_a_pattern_that_goes_on_has_no_fault():
    assert quality.lattice_faults(cells(), cells()) == 0
    assert quality.lattice_faults(cells(), cells(144, 130, seed=2)) == 0
    assert quality.lattice_faults(cells(), np.roll(cells(144, 160, seed=2), (5, 7), (0, 1))) == 0


def test_a_slip_is_a_fault_where_it_is():
    slipped = cells(144, 160, seed=2)
    slipped[:, 96:] = np.roll(slipped[:, 96:], 6, 0)
    where = quality.lattice_fault_map(cells(), slipped)
    assert where.shape == slipped.shape
    assert where[:, 112:].mean() > 0.9 and where[:, :80].mean() < 0.1
    assert quality.lattice_faults(cells(), slipped) == where.mean()


def test_a_part_that_is_no_cell_is_a_fault():
    spoiled = cells(144, 160, seed=2)
    spoiled[40:90, 50:110] = 140
    where = quality.lattice_fault_map(cells(), spoiled)
    assert where[55:75, 65:95].all() and not where[:20].any()


def test_a_torus_may_deform_the_lattice():
    fitted = np.tile(cells(96, 68, (12, 17), seed=2), (1, 4))
    assert quality.lattice_faults(cells(), fitted[:, :68]) < 0.05
    assert quality.lattice_faults(cells(), fitted[:, :250]) > 0.3, "it wraps around no more"


def test_colours_are_judged_by_what_varies_most():
    colour, slipped = (np.stack([one, 255 - one // 2, one // 3], -1) for one in (cells(), np.roll(cells(), 6, 0)))
    both = np.concatenate([colour, slipped], 1)
    assert quality.lattice_faults(colour, colour) == 0
    assert 0.3 < quality.lattice_faults(colour, both) < 0.7


@pytest.mark.parametrize("side", [9, 80])
def test_what_has_no_lattice_has_no_figure(side):
    noise = np.random.default_rng(1).integers(0, 256, (side, side))
    assert quality.lattice_faults(noise, noise) is None
    assert quality.lattice_fault_map(noise, noise) is None


def stripes(cut=0):
    """Slanted stripes of 12 pixels, of which some bright ones have gaps."""
    row, col = np.indices((SIDE, SIDE))
    across = (2 * row + col) / 5**0.5
    picture = np.where(across % 12 < 6, 200, 60)
    for k in range(cut):
        inside = (across // 12 == 3 + k) & (abs(col - 48) < 6)
        picture[inside] = 60
    return picture.astype(np.uint8)


@pytest.mark.parametrize("negative", [False, True])
def test_stripes_that_are_cut_have_two_ends_each(negative):
    whole, cut = stripes(), stripes(2)
    if negative:
        whole, cut = 255 - whole, 255 - cut
    ends = quality.cut_end_places(whole, cut)
    ours, others = (ends.dark, ends.bright) if negative else ends
    assert len(ours) == 4 and not len(others)
    assert (abs(ours[:, 1] - 48) < 14).all()
    assert quality.cut_ends(whole, whole) == 0
    assert quality.cut_ends(whole, cut) == pytest.approx(4e4 / (SIDE - 16) ** 2)


def test_pictures_of_one_tone_and_small_ones_have_no_ends():
    flat = np.full((40, 40), 9, np.uint8)
    assert quality.cut_ends(flat, flat) == 0
    assert quality.cut_ends(flat[:9, :9], flat[:9, :9]) == 0
    with pytest.raises(ValueError, match="at least 9 x 9"):
        quality.cut_ends(flat, flat[:8])

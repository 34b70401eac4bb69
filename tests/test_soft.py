"""Probabilities of categories and of training images, as costs: the formula, what it leaves alone, what it excludes."""

from math import log

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits

import simdtex
from simdtex.model.given import EXCLUDED, Soft
from simdtex.model.pictures import Pictures
from simdtex.model.sample import Sample

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

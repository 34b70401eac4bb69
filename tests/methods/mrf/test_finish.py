"""The finish: a pixel is the weighted mean of what its neighbours' sources say of it."""

from itertools import product
from math import exp, floor

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, problem
from hypothesis import given, settings
from hypothesis import strategies as st

import simdtex
from simdtex.methods.mrf import Options
from simdtex.methods.mrf.finish import finish
from simdtex.model.pictures import Pictures
from simdtex.model.source_map import apply_source_map


def finished(m, p, sd, rows=None):
    """What is from nowhere is given."""
    _, field, _ = p.on(m)
    given = m.put((p.field.source < 0).astype(np.uint8))
    return finish(m, field, given, p.grid, p.sample.planes(m), p.sample, sd, rows or range(p.grid.rows))


@pytest.mark.parametrize(
    ("sd", "torus", "how"),
    [
        (1.0, True, {"nowhere": 0.4}),
        (1.5, False, {"masked": 0.4}),
        (0.5, False, {"nowhere": 0.2, "masked": 0.6}),
        (2.0, True, {"dtype": np.uint16, "weight": 1.0}),
    ],
    ids=str,
)
def test_a_change_is_the_weighted_mean_of_what_neighbours_say(machine, sd, torus, how):
    """Neighbours whose sources may be used there; and given ones, by how much the site's own source misses them."""
    p = problem(6, shape=(9, 11), sample_shape=(10, 12), channels=2, edges="reflect", torus=torus, **how)
    usable, source, shown = p.sample.inside, p.source(), p.sample.working.reshape(-1, p.sample.rows, p.sample.cols)[:2]
    expected, values, spoken = np.zeros((2, 9, 11), np.int16), p.field.values[:2].astype(int), set()
    scale, far = 1 if p.sample.top == 255 else 8, int(2.5 * sd)

    def may(place):
        return all(0 <= x < n for x, n in zip(place, usable.shape, strict=True)) and usable[place]

    for i, j in np.ndindex(9, 11):
        total, said = 0, np.zeros(2, int)
        for a, b in product(range(-far, far + 1), repeat=2) if p.field.source[i, j] >= 0 else ():
            r, beyond = ((i + a) % 9, (j + b) % 11), not (0 <= i + a < 9 and 0 <= j + b < 11)
            if a * a + b * b > 6.25 * sd * sd or (beyond and not torus) or (r == (i, j) and (a, b) != (0, 0)):
                continue
            there, missed = (tuple(int(x) for x in at) for at in (source[r] - (a, b), source[i, j] + (a, b)))
            weight = round(1024 * exp(-(a * a + b * b) / (2 * sd * sd)))
            if p.field.source[r] >= 0 and may(there):
                by = shown[:, *there].astype(int) - shown[:, *source[i, j]]
            elif p.field.source[r] < 0 and may(missed):
                by = values[:, *r] - shown[:, *missed]
            else:
                continue
            spoken.add(p.field.source[r] < 0)
            total, said = total + weight, said + weight * by
        expected[:, i, j] = [floor(scale * one / total + 0.5) for one in said.tolist()] if total else 0
    assert spoken == {False, "nowhere" in how}
    for m in (REFERENCE, machine):
        assert_same_bits(finished(m, p, sd).reshape(expected.shape), expected)


@given(p=st.integers(0, 99), rows=st.integers(1, 6), torus=st.booleans())
@settings(max_examples=10)
def test_a_device_has_the_references_bits_on_any_rows(machine, p, rows, torus):
    p = problem(p, shape=(8, 7), torus=torus, channels=2)
    assert_same_bits(*(finished(m, p, 1.5, range(rows, rows + 2)) for m in (REFERENCE, machine)))


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32])
def test_a_finished_picture_is_the_source_plus_the_change_in_any_type(dtype):
    p = problem(5, shape=(9, 11), sample_shape=(10, 12), edges="reflect", dtype=dtype)
    by = finished(REFERENCE, p, 1.5).reshape(1, 9, 11)
    image = p.sample.moved(p.field.source, by)[..., 0]
    assert image.dtype == dtype
    own = p.sample.pixels[tuple(np.moveaxis(p.source() - p.sample.margin, -1, 0))][..., 0].astype(float)
    exact = by[0] * p.sample.unit / p.sample.fine + own
    assert np.abs(image - exact).max() <= (0 if dtype == np.uint8 else 0.5 if np.dtype(dtype).kind in "iu" else 1e-6)
    assert (image != own).any()


def run(sample, **options):
    return simdtex.synthesize(sample, (18, 17), rng=2, device=REFERENCE, full_output=True, order=5, **options)


@pytest.mark.parametrize(("side", "colours", "order"), [(3, 5, 3), (16, 64, 18)])
def test_the_output_of_pixel_art_has_its_colours(side, colours, order):
    """At most 64 colours are a palette, and the default order fits a small sample; a given order has to fit."""
    palette = np.random.default_rng(2).integers(0, 256, (colours, 3)).astype(np.uint8)
    sample = palette[np.arange(side * side).reshape(side, side) % colours]
    given = {"channel_axis": -1, "rng": 1, "device": REFERENCE, "xi": -16.0, "free_sweeps": 0}
    image, output = simdtex.synthesize(sample, (5, 6), full_output=True, **given)
    assert {tuple(one) for one in image.reshape(-1, 3)} <= {tuple(one) for one in palette}
    options = output.statistics["options"]
    assert (options["order"], options["finish"]) == (order, 0)
    if order < 18:
        with pytest.raises(ValueError, match=f"the largest order that fits is {order}"):
            simdtex.synthesize(sample, (5, 6), order=18, **given)


def test_a_small_photograph_is_finished():
    """Of 65 colours, or if hardly a pixel has the colour of another one."""
    for shape, colours in (((16, 16), 65), ((5, 5), 24)):
        pixels = np.stack([np.arange(np.prod(shape)).reshape(shape) % colours] * 3, -1).astype(np.uint8)
        assert Options().resolved(Pictures((pixels,))).finish == 1.5


def test_a_finish_that_is_asked_for_averages_categories_too_and_leaves_the_source_map():
    cells = np.random.default_rng(1).integers(0, 2, (18, 18)).astype(np.uint8) * 200
    (plain, without), (image, output) = run(cells), run(cells, finish=2.0)
    assert len(np.unique(plain)) == 2 < len(np.unique(image))
    assert_same_bits(output.source, without.source)
    assert_same_bits(apply_source_map(output.source, cells), plain)

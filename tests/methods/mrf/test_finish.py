"""The finish: a pixel is the weighted mean of what its neighbours' sources say of it."""

from math import exp, floor

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, problem, texture
from hypothesis import given, settings
from hypothesis import strategies as st

import simdtex
from simdtex.methods.mrf import Options
from simdtex.methods.mrf.finish import finish
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.model.lattice import Grid
from simdtex.model.pictures import Pictures
from simdtex.model.sample import Sample
from simdtex.model.source_map import apply_source_map


def plainly(p, sd):
    """(C, rows, cols) changes in Python numbers, in working levels or eighths of one."""
    scale = 1 if p.sample.top == 255 else 8
    reach = range(-5, 6)
    weight = {
        (a, b): round(1024 * exp(-(a * a + b * b) / (2 * sd * sd)))
        for a in reach
        for b in reach
        if a * a + b * b <= (2.5 * sd) ** 2
    }
    source, (rows, cols) = p.source() - p.sample.margin, p.field.source.shape
    shown = p.sample.levels[0][: p.sample.shown].astype(int)
    found = np.zeros((p.sample.shown, rows, cols), int)
    for i in range(rows):
        for j in range(cols):
            own = tuple(source[i, j])
            for c, y in enumerate(shown):
                total = said = 0
                for (a, b), w in weight.items():
                    k, m = (i + a) % rows, (j + b) % cols
                    inside = p.grid.torus or (0 <= i + a < rows and 0 <= j + b < cols)
                    if not inside or ((a, b) != (0, 0) and (k, m) == (i, j)):
                        continue
                    row, col = source[k, m] - (a, b)
                    if 0 <= row < p.sample.height and 0 <= col < p.sample.width:
                        total += w
                        said += w * (int(y[row, col]) - int(y[own]))
                found[c, i, j] = floor(scale * said / total + 0.5)
    return found


@pytest.mark.parametrize("how", [{"nowhere": 0.4}, {"masked": 0.4}, {"nowhere": 0.2, "masked": 0.6}], ids=str)
@pytest.mark.parametrize("torus", [True, False])
def test_who_has_something_to_say(machine, how, torus):
    """Neighbours whose sources may be used there; and given ones, by how much the site's own source misses them."""
    p = problem(6, shape=(9, 11), sample_shape=(10, 12), channels=2, edges="reflect", torus=torus, **how)
    usable, source, shown = p.sample.inside, p.source(), p.sample.working.reshape(-1, p.sample.rows, p.sample.cols)
    expected, values, spoken = np.zeros((2, 9, 11), np.int16), p.field.values.astype(int), set()
    for i, j in np.ndindex(9, 11):
        total, said = 0, np.zeros(2, int)
        if p.field.source[i, j] < 0:
            continue
        for a in range(-2, 3):
            for b in range(-2, 3):
                r, beyond = ((i + a) % 9, (j + b) % 11), not (0 <= i + a < 9 and 0 <= j + b < 11)
                if a * a + b * b > 6.25 or (beyond and not torus) or (r == (i, j) and (a, b) != (0, 0)):
                    continue
                there, missed = (tuple(int(x) for x in at) for at in (source[r] - (a, b), source[i, j] + (a, b)))
                told = p.field.source[r] >= 0 and all(0 <= x < n for x, n in zip(there, usable.shape, strict=True))
                weight = round(1024 * exp(-(a * a + b * b) / 2))
                if told and usable[there]:
                    by = shown[(slice(None), *there)].astype(int) - shown[(slice(None), *source[i, j])]
                elif (
                    p.field.source[r] < 0
                    and all(0 <= x < n for x, n in zip(missed, usable.shape, strict=True))
                    and usable[missed]
                ):
                    by = values[:, *r] - shown[(slice(None), *missed)]
                else:
                    continue
                spoken.add(p.field.source[r] < 0)
                total, said = total + weight, said + weight * by
        expected[:, i, j] = [floor(one / total + 0.5) for one in said.tolist()] if total else 0
    assert spoken == {False, "nowhere" in how}
    for m in (REFERENCE, machine):
        assert_same_bits(finished(m, p, 1.0).reshape(expected.shape), expected)


def finished(m, p, sd, rows=None):
    """What is from nowhere is given."""
    _, field, _ = p.on(m)
    given = m.put((p.field.source < 0).astype(np.uint8))
    where = (p.grid, p.sample.planes(m), p.sample)
    return finish(m, field, given, *where, sd, rows or range(p.grid.rows))


@pytest.mark.parametrize("sd", [0.5, 1.5, 2.0])
@pytest.mark.parametrize("how", [{}, {"channels": 3, "torus": False}, {"dtype": np.uint16, "weight": 1.0}], ids=str)
def test_a_change_is_the_weighted_mean(machine, sd, how):
    p = problem(3, shape=(9, 11), sample_shape=(10, 12), edges="reflect", **how)
    expected = plainly(p, sd).astype(np.int16)
    assert expected.any()
    for m in (REFERENCE, machine):
        assert_same_bits(finished(m, p, sd).reshape(expected.shape), expected)


@given(p=st.integers(0, 99), rows=st.integers(1, 6), torus=st.booleans())
@settings(max_examples=10)
def test_a_device_has_the_references_bits_on_any_rows(machine, p, rows, torus):
    p = problem(p, shape=(8, 7), torus=torus, channels=2)
    assert_same_bits(*(finished(m, p, 1.5, range(rows, rows + 2)) for m in (REFERENCE, machine)))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int8, np.float32, np.float64])
def test_where_the_arrangement_is_coherent_nothing_changes(machine, dtype):
    pixels = texture((20, 22), 2, dtype, 1)
    sample, grid = Sample(pixels, 8, 3), Grid.of((9, 10), 1, False)
    row, col = np.indices((9, 10)) + sample.margin + 4
    source = (row * sample.cols + col).astype(np.int32)
    for m in (REFERENCE, machine):
        values, t = sample.working[:, source], np.zeros((9, 10), np.uint16)
        field, given = Field(*(m.put(plane) for plane in (values, source, t))), m.put(np.zeros((9, 10), np.uint8))
        by = finish(m, field, given, grid, sample.planes(m), sample, 1.5, range(9))
        assert not by.any()
        assert_same_bits(sample.moved(source, by.reshape(2, 9, 10)), pixels[4:13, 4:14])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int16, np.float32, np.float64])
def test_a_finished_picture_is_close_to_the_mean_in_any_type(dtype):
    p = problem(5, shape=(9, 11), sample_shape=(10, 12), edges="reflect", dtype=dtype)
    by = finished(REFERENCE, p, 1.5).reshape(1, 9, 11)
    image = p.sample.moved(p.field.source, by)[..., 0]
    assert image.dtype == dtype
    own = p.sample.pixels[tuple(np.moveaxis(p.source() - p.sample.margin, -1, 0))][..., 0].astype(float)
    exact = plainly(p, 1.5)[0] * p.sample.unit / p.sample.fine + own
    assert np.abs(image - exact).max() <= (0 if dtype == np.uint8 else 0.5 if np.dtype(dtype).kind in "iu" else 1e-6)
    assert (image != own).any()


def run(sample, **options):
    return simdtex.synthesize(sample, (18, 17), rng=2, device=REFERENCE, full_output=True, order=5, **options)


def test_the_source_map_stays():
    sample = texture((18, 16), seed=3)
    (plain, without), (image, output) = run(sample, finish=0.0), run(sample)
    assert_same_bits(output.source, without.source)
    assert_same_bits(apply_source_map(output.source, sample), plain)
    assert (image != plain).any()
    assert output.statistics["options"]["finish"] == 1.5


@pytest.mark.parametrize(
    "sample", [np.uint8([[0, 255]]), np.uint8([[[1, 2, 3], [4, 5, 6]]]), np.array([[True, False]])]
)
def test_categories_are_never_averaged(sample):
    cells = np.random.default_rng(1).integers(0, 2, (20, 20))
    map_ = sample[0][cells]
    options = {"channel_axis": -1 if map_.ndim == 3 else None, "order": 4, "rng": 1, "device": REFERENCE}
    image, output = simdtex.synthesize(map_, (19, 17), full_output=True, **options)
    seen = {tuple(np.atleast_1d(pixel)) for row in image for pixel in row}
    assert seen <= {tuple(np.atleast_1d(pixel)) for pixel in sample[0]}
    assert output.statistics["options"]["finish"] == 0


@pytest.mark.parametrize(("side", "colours", "order"), [(3, 5, 3), (8, 7, 15), (16, 64, 18)])
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


def test_a_finish_that_is_asked_for_averages_categories_too():
    cells = np.random.default_rng(1).integers(0, 2, (18, 18)).astype(np.uint8) * 200
    assert len(np.unique(run(cells, finish=2.0)[0])) > 2


def test_a_density_is_left_alone():
    _, output = run(texture((18, 16), seed=3), pixel="density", relaxation="gibbs", free_sweeps=0, xi=-8.0)
    assert output.statistics["options"]["finish"] == 0

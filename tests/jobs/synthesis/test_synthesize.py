"""`simdtex.synthesize`: what it takes, what it gives, what it says along the way, and what it refuses."""

import math
from dataclasses import fields

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, texture
from hypothesis import given, settings
from hypothesis import strategies as st

import simdtex
from simdtex.jobs.synthesis.job import plan_synthesis
from simdtex.methods import mrf

QUICK = {"order": 2, "levels": 1, "xi": -8.0, "device": REFERENCE}


def quick(sample, shape, **options):
    return simdtex.synthesize(sample, shape, **({"rng": 1} | QUICK | options))


@pytest.mark.parametrize("dtype", [np.bool_, np.int8, np.uint16, np.float16])
def test_the_type_is_the_samples_and_every_pixel_is_one_of_its_own(dtype):
    sample = texture((9, 10), dtype=dtype)
    image = quick(sample, (7, 8), finish=0.0)
    assert (image.dtype, image.shape) == (sample.dtype, (7, 8))
    assert np.isin(image, sample).all()
    finished = quick(sample, (7, 8))
    assert finished.dtype == sample.dtype and sample.min() <= finished.min() <= finished.max() <= sample.max()


def test_levels_drawn_from_the_density_stay_in_the_range_of_the_type():
    for dtype in (np.bool_, np.uint16, np.float32):
        sample = texture((9, 10), dtype=dtype)
        image = quick(sample, (9, 8), pixel="density", relaxation="gibbs", bandwidth=2.0)
        assert image.dtype == sample.dtype and sample.min() <= image.min() <= image.max() <= sample.max()


def test_the_channel_axis_is_kept_and_one_channel_is_as_good_as_none():
    last = texture((9, 10), 3)
    image = quick(np.moveaxis(last, -1, 1), (6, 7), channel_axis=1)
    expected = quick(last, (6, 7), channel_axis=-1)
    assert_same_bits(np.ascontiguousarray(np.moveaxis(image, 1, -1)), expected)
    sample = texture((9, 10))
    assert_same_bits(quick(sample[..., None], (6, 7), channel_axis=-1)[..., 0], quick(sample, (6, 7)))


@given(
    st.tuples(st.integers(3, 12), st.integers(3, 12)),
    st.tuples(st.integers(1, 12), st.integers(1, 12)),
    st.sampled_from([1, 2, 4, 8]),
    st.sampled_from([None, 1, 3]),
    st.sampled_from(["torus", "open"]),
    st.sampled_from(["icm", "gibbs"]),
)
@settings(max_examples=8)
def test_any_sample_that_fits_any_size_and_any_order(sample_shape, shape, order, channels, boundary, relaxation):
    if min(sample_shape) <= 2 * math.isqrt(order):
        return
    image, output = simdtex.synthesize(
        texture(sample_shape, channels), shape, order=order, boundary=boundary, relaxation=relaxation,
        channel_axis=None if channels is None else -1, rng=1, device=REFERENCE, full_output=True,
    )  # fmt: skip
    assert image.shape == shape + (() if channels is None else (channels,))
    assert not output.temperature.any()


def test_a_sample_that_barely_fits_has_one_candidate_and_a_constant_gives_a_constant():
    sample = texture((5, 5))
    assert (quick(sample, (4, 4), order=8, edges="whole", finish=0.0) == sample[2, 2]).all()
    for dtype, pixel in ((np.uint8, "source"), (np.float64, "density")):
        assert (quick(np.full((6, 7), 3, dtype), (5, 6), relaxation="gibbs", pixel=pixel) == 3).all()


def test_no_seed_is_a_fresh_seed_that_the_statistics_tell_and_the_whole_seed_counts():
    sample = texture((10, 10))
    image, output = quick(sample, (9, 9), rng=None, full_output=True)
    assert_same_bits(quick(sample, (9, 9), rng=output.statistics["seed"]), image)
    images = [quick(sample, (9, 9), rng=seed).tobytes() for seed in (None, None, 1, 1 + 2**32, 1 + 2**63)]
    assert len(set(images)) == 5


def test_adding_a_constant_to_the_levels_changes_no_arrangement():
    dark = texture((12, 11)) // 2
    plain, output = quick(dark, (10, 9), full_output=True, relaxation="gibbs")
    bright, other = quick(dark + 100, (10, 9), full_output=True, relaxation="gibbs")
    assert np.array_equal(output.source, other.source)
    assert np.array_equal(plain.astype(int) + 100, bright)


def test_the_stages_are_the_levels_coarsest_first():
    sample = np.moveaxis(texture((17, 18), 2), -1, 0)
    how = {"order": 1, "levels": 3, "channel_axis": 0, "finish": 0.0, "full_output": True}
    image, output = quick(sample, (13, 10), **how)
    assert [(stage.level, stage.image.shape) for stage in output.stages] == [
        (2, (2, 4, 3)), (1, (2, 7, 5)), (0, (2, 13, 10))
    ]  # fmt: skip
    assert all(stage.image.dtype == sample.dtype for stage in output.stages)
    assert_same_bits(output.stages[-1].image, image)


def test_the_statistics_count_what_was_done():
    how = {"levels": 2, "free_sweeps": 1, "search": "exact", "rng": 7, "full_output": True}
    _, output = quick(texture((15, 14)), (9, 12), **how)
    told = output.statistics
    assert (told["device"], told["seed"], told["options"]["order"]) == (REFERENCE.name, 7, 2)
    assert {option.name for option in fields(mrf.Options)} == set(told["options"])
    assert [(level["level"], level["rows"], level["cols"]) for level in told["levels"]] == [(1, 5, 6), (0, 9, 12)]
    for level in told["levels"]:
        sites = level["rows"] * level["cols"]
        assert level["fma"] == level["relaxations"] * level["candidates"] * 8 * 2 * 2  # 8 neighbours, 2 channels
        assert sites < level["relaxations"] <= sites * level["sweeps"]
    assert told["seconds"] >= sum(level["seconds"] for level in told["levels"]) > 0


def test_progress_never_falls_and_tells_level_sweep_and_phase():
    seen = []
    quick(texture((16, 16)), (12, 13), levels=2, free_sweeps=2, xi=-1.0, callback=seen.append)
    fractions = [progress.fraction for progress in seen]
    assert fractions == sorted(fractions)
    assert 0 < fractions[0] < 0.5 and 0.95 < fractions[-1] <= 1
    assert {progress.levels for progress in seen} == {2}
    assert [progress.level for progress in seen] == sorted((p.level for p in seen), reverse=True)
    for level in (1, 0):
        here = [progress for progress in seen if progress.level == level]
        sweeps = [progress.sweep for progress in here]
        assert sweeps == sorted(sweeps) and {*sweeps} == {*range(1, max(sweeps) + 1)}
        ends = [f"level{level}-sweep{sweep:02d}" for sweep in range(1, max(sweeps) + 1)]
        assert [p.stage for p in here if p.stage] == ends and here[-1].stage == ends[-1], "one end for each"
        phases = [progress.phase for progress in here if progress.stage]
        assert phases == ["relax"] * (len(phases) - 2) + ["free"] * 2
        assert 0 < here[0].temperature_left <= 1
        assert all(progress.temperature_left == 0 for progress in here if progress.phase == "free")
        assert here[0].doing == f"level {level}, sweep 1, temperature {here[0].temperature_left:.3f}"


def test_progress_shows_the_picture_and_its_temperature():
    pictures, how = [], {"order": 1, "levels": 2, "channel_axis": 0, "finish": 0.0}

    def look(progress):
        if progress.stage:
            pictures.append((progress.level, progress.image(), progress.temperature()))

    image = quick(np.moveaxis(texture((12, 12), 2), -1, 0), (7, 10), callback=look, **how)
    for level, picture, temperature in pictures:
        assert picture.shape == (2, *temperature.shape) and temperature.shape == {0: (7, 10), 1: (4, 5)}[level]
        assert 0 <= temperature.min() <= temperature.max() <= 1
    assert_same_bits(pictures[-1][1], image)
    assert not pictures[-1][2].any()


SAMPLE = texture((9, 10))
NAN = np.where(np.arange(90).reshape(9, 10) == 45, np.nan, SAMPLE)
BAD = [
    ({"sample": NAN, "method": "multires"}, ValueError, "known everywhere"),
    ({"sample": SAMPLE.astype(complex)}, TypeError, "real"),
    ({"sample": texture((4, 30)), "order": 8}, ValueError, "the largest order that fits is 3"),
    ({"sample": texture((1, 1)), "order": 1}, ValueError, "give at least 3x3 pixels"),
    ({"shape": (0, 5)}, ValueError, "rows of the output is 0; give 1 or more"),
    ({"shape": (5.0, 5)}, TypeError, "rows of the output must be an integer"),
    ({"shape": (2**16, 2**16)}, ValueError, "give a smaller size, or make it in tiles: --tiles 2048"),
    ({"levels": 20}, ValueError, "levels=20 is too many .* give at most"),
    ({"reduction": 4, "levels": 2}, ValueError, "too much for 2 levels and this sample; give at most 2"),
    ({"sample": SAMPLE // 64, "reduction": 2, "levels": 2, "categorical": True}, ValueError, "takes means, .* leave"),
    ({"reduction": 2, "levels": 2, "pixel": "density"}, ValueError, "takes means, .* leave it out"),
    ({"reduction": 2, "levels": 2, "known": np.ma.masked_less(SAMPLE[:6, :7], 99)}, ValueError, "not from the sample"),
    ({"schedule": "rows"}, ValueError, "choose one of: coloring"),
    ({"temperature": 1}, TypeError, "unknown option 'temperature' .* choose from: preset, order, structure"),
    ({"method": "magic"}, ValueError, "unknown method 'magic'; choose one of: mrf"),
    ({"rng": -1}, ValueError, r"give an integer from 0 to 2\*\*64 - 1"),
    ({"rng": 0.5}, TypeError, "an integer or a numpy.random.Generator"),
    ({"device": "no such device"}, simdtex.DeviceError, "choose one of: .*reference"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "error", "words"), BAD, ids=lambda v: None)
def test_bad_input_is_refused_with_a_remedy(change, error, words):
    arguments = {"sample": SAMPLE, "shape": (6, 7), "order": 2, "rng": 1, "device": "reference"} | change
    with pytest.raises(error, match=words) as caught:
        simdtex.synthesize(arguments.pop("sample"), arguments.pop("shape"), **arguments)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def test_the_largest_order_that_is_named_works_and_the_next_does_not():
    for side in (3, 6, 8):
        sample = texture((side, 14))
        with pytest.raises(ValueError, match="the largest order that fits is") as caught:
            quick(sample, (4, 4), order=100)
        largest = int(str(caught.value).rpartition(" ")[2])
        assert quick(sample, (4, 4), order=largest).shape == (4, 4)
        with pytest.raises(ValueError, match=f"the largest order that fits is {largest}"):
            quick(sample, (4, 4), order=largest + 1)


def test_only_large_samples_are_reduced_and_a_cell_keeps_20_pixels():
    """`simdtex.synthesize` itself would take long at these sizes."""

    def reduction(sample, **options):
        return plan_synthesis(sample, (600, 600), **options).plan().sizes[-1].reduction

    large = texture((500, 520))
    assert [reduction(large[:n, :n], lattice="none") for n in (170, 250, 400)] == [1, 2, 4]
    assert [reduction(large, lattice=((0, n), (n, 0))) for n in (90, 41, 30)] == [4, 2, 1]
    paper = {"preset": "paper"}, {"search": "exact"}, {"phases": 64}, {"categorical": True}
    assert [reduction(large[:260, :270] // 64, **options) for options in ({}, *paper)] == [1] * 5
    assert [reduction(large[:260], reduction=n, lattice="none") for n in (4, 7)] == [4, 4]
    holes = large[:260, :270].astype(float)
    holes[::2, ::2] = np.nan  # no square of 2x2 is known
    assert reduction(holes, lattice="none", order=2) == 1


@pytest.mark.parametrize("edges", ["whole", "reflect"])
def test_the_most_levels_that_are_named_work_and_one_more_does_not(edges):
    for sample, shape in [((9, 10), (20, 20)), ((30, 31), (5, 9))]:
        options = {"edges": edges, "xi": -1.0}
        with pytest.raises(ValueError, match="give at most") as caught:
            quick(texture(sample), shape, levels=30, **options)
        most = int(str(caught.value).rpartition(" ")[2])
        assert quick(texture(sample), shape, levels=most, **options).shape == shape
        with pytest.raises(ValueError, match="give at most"):
            quick(texture(sample), shape, levels=most + 1, **options)


@pytest.mark.parametrize("scale", [1e-320, 1e300, 8e307])
def test_float_pixels_of_any_magnitude(scale):
    sample = texture((9, 10), dtype=np.float64) * scale
    assert np.isin(quick(sample, (5, 6), finish=0.0), sample).all()
    image = quick(sample, (5, 6))
    assert sample.min() <= image.min() <= image.max() <= sample.max()
    assert np.isfinite(quick(sample, (5, 6), pixel="density", relaxation="gibbs")).all()


@pytest.mark.parametrize("dtype", [np.int64, np.uint64])
def test_the_ends_of_64_bit_types_are_within_reach(dtype):
    bounds = np.iinfo(dtype)
    near = bounds.max - np.random.default_rng(0).integers(0, bounds.max // 400, (12, 12), dtype=dtype)
    near[0, :2] = bounds.min, bounds.max
    image = quick(near, (24, 24), order=1, pixel="density", relaxation="gibbs", bandwidth=3.0)
    assert (image > 0).mean() > 0.9
    image = quick(near, (5, 6), finish=0.0)
    assert image.dtype == dtype and np.isin(image, near).all()

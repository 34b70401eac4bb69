"""De Bonet's method as users see it: what it takes, what it says along the way, and what it refuses."""

import logging
import math
from dataclasses import fields

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, texture

import simdtex
from simdtex.machine import memory
from simdtex.methods import multires

INF = math.inf


def synthesize(sample, shape, **options):
    """An image; the last axis of a sample of three holds the channels."""
    given = {"rng": 1, "device": REFERENCE, "channel_axis": -1 if np.ndim(sample) == 3 else None} | options
    return simdtex.synthesize(sample, shape, method="multires", **given)


def run(sample, shape, **options):
    """Image and output."""
    return synthesize(sample, shape, full_output=True, **options)


def tiled(sample, shape):
    """The beginning of so many repetitions of a sample as fill a shape."""
    row, col = (np.arange(n) % m for n, m in zip(shape, sample.shape, strict=False))
    return sample[np.ix_(row, col)]


def halved(n, tile, times):
    """Pixels in a line at a level of an output that is made of tiles: each is halved and rounded up on its own."""
    whole, rest = divmod(n, tile)
    for _ in range(times):
        tile, rest = -(-tile // 2), -(-rest // 2)
    return whole * tile + rest


@pytest.mark.parametrize("axis", [0, 1])
def test_the_channel_axis_is_kept(axis):
    last = texture((9, 10), 3)
    image, output = run(np.moveaxis(last, -1, axis), (12, 17), channel_axis=axis)
    expected, other = run(last, (12, 17))
    assert_same_bits(np.ascontiguousarray(np.moveaxis(image, axis, -1)), expected)
    for ours, theirs in zip(output.stages, other.stages, strict=True):
        assert np.array_equal(np.moveaxis(ours.image, axis, -1), theirs.image)


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (5, 1), (2, 2), (3, 3), (4, 4)], ids=str)
def test_a_sample_too_small_for_the_filters_works_and_says_so(size, caplog):
    sample = texture(size, 3)
    for options in ({"alpha": 0}, {}, {"parity": "free"}, {"boundary": "open", "alpha": INF}):
        caplog.clear()
        image, output = run(sample, (10, 15), **options)
        assert image.shape == (10, 15, 3)
        assert min(stage.candidates.min() for stage in output.stages) >= 1
        told = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
        assert len(told) == (size != (1, 1)), "where there are no candidates, nothing is missed"
        assert all(f"{size[0]} rows x {size[1]} columns" in note and "3 x 3" in note for note in told)
    image = synthesize(sample, (3 * size[0], 2 * size[1]), alpha=0)
    assert_same_bits(image, np.tile(sample, (3, 2, 1)))


def test_a_constant_sample_gives_a_constant():
    for dtype in (np.uint8, np.uint16, np.float64, np.bool_):
        for options in ({"alpha": 0}, {"alpha": INF}):
            image, output = run(np.ones((6, 8), dtype), (9, 20), **options)
            assert_same_bits(image, np.ones((9, 20), dtype))
            assert (output.stages[-1].candidates == 12).all(), "nothing tells one node from another"


@pytest.mark.parametrize("scale", [1e-300, 1.0, 1e300, 8e307])
def test_float_pixels_of_any_magnitude(scale):
    sample = texture((9, 10), dtype=np.float64) * scale
    assert_same_bits(synthesize(sample, (18, 10), alpha=0), np.tile(sample, (2, 1)))
    image = synthesize(sample, (18, 10), alpha=INF)
    assert sample.min() <= image.min() < image.max() <= sample.max()


@pytest.mark.parametrize("dtype", [np.int64, np.uint64, np.int8])
def test_integer_pixels_of_any_magnitude(dtype):
    bounds = np.iinfo(dtype)
    sample = texture((9, 10), dtype=dtype)
    sample[4, 4:6] = bounds.min, bounds.max
    assert_same_bits(synthesize(sample, (18, 10), alpha=0), np.tile(sample, (2, 1)))
    assert synthesize(sample, (18, 10), alpha=INF).dtype == dtype


@pytest.mark.parametrize(("shape", "boundary"), [((20, 30), "torus"), ((5, 3), "open")], ids=str)
def test_one_level_is_a_tiling(shape, boundary):
    sample = texture((13, 7), 3, np.float32)
    image, output = run(sample, shape, levels=1, boundary=boundary, alpha=INF)
    assert_same_bits(image, tiled(sample, shape))
    [stage] = output.stages
    assert (stage.candidates == 1).all()


@pytest.mark.parametrize(
    ("size", "most"), [((13, 7), 5), ((1, 1), 1), ((1, 5), 4), ((64, 2), 7), ((65, 3), 8), ((16, 16), 5)], ids=str
)
def test_the_most_levels_that_are_named_work_and_one_more_does_not(size, most):
    sample = texture(size)
    for levels in (most + 1, 1000):
        with pytest.raises(ValueError, match=f"levels={levels} is too many for this sample; give at most {most}$"):
            synthesize(sample, (9, 9), levels=levels)
    image, output = run(sample, (9, 9), levels=most)
    assert len(output.stages) == most
    assert_same_bits(synthesize(sample, (9, 9)), image)


@pytest.mark.parametrize(
    ("size", "shape", "levels"), [((13, 7), (20, 17), None), ((16, 8), (39, 21), 2), ((3, 20), (2, 50), None)], ids=str
)
def test_the_stages_are_the_levels_of_every_tile_coarsest_first(size, shape, levels):
    sample = texture(size, 2, np.uint16)
    image, output = run(sample, shape, levels=levels)
    count = levels or 1 + math.ceil(math.log2(max(size)))
    assert [stage.level for stage in output.stages] == list(reversed(range(count)))
    for stage in output.stages:
        own = tuple(halved(n, m, stage.level) for n, m in zip(shape, size, strict=True))
        assert (stage.image.shape, stage.image.dtype) == ((*own, 2), np.uint16)
        assert (stage.source.shape, stage.source.dtype) == ((*own, 2), np.int32)
        assert stage.candidates.shape == own
        assert np.issubdtype(stage.candidates.dtype, np.integer)
    assert_same_bits(output.stages[-1].image, image)
    assert_same_bits(output.stages[-1].source, output.source)
    assert output.temperature is None


@pytest.mark.parametrize("alpha", [0.5, INF])
def test_the_statistics_count_what_was_done(alpha):
    sample = texture((13, 7))
    _, output = run(sample, (20, 17), alpha=alpha, rng=7)
    told = output.statistics
    assert (told["device"], told["seed"], told["device_seconds"]) == (REFERENCE.name, 7, None)
    assert set(told["options"]) == {option.name for option in fields(multires.Options)}
    assert told["options"]["alpha"] == alpha
    assert told["options"]["levels"] == 5
    assert [level["level"] for level in told["levels"]] == [4, 3, 2, 1, 0]
    nodes = [0, 1, 1 + 2, 1 + 2 + 8, 1 + 2 + 8 + 28]
    assert [level["nodes"] for level in told["levels"]] == nodes
    for level, stage in zip(told["levels"], output.stages, strict=True):
        assert (level["rows"], level["cols"]) == stage.candidates.shape
        assert level["most"] == stage.candidates.max()
        assert level["candidates"] == stage.candidates.mean()
        if alpha == INF:
            assert level["compared"] == level["nodes"]
        assert stage.level == 4 or 1 <= level["compared"] <= level["nodes"]
        assert level["seconds"] >= 0
    assert told["seconds"] >= sum(level["seconds"] for level in told["levels"])


@pytest.mark.parametrize("axis", [None, 0])
def test_progress_tells_every_piece_of_every_level(axis, monkeypatch):
    last = texture((13, 7), None if axis is None else 3)
    sample, seen = last if axis is None else np.moveaxis(last, -1, axis), []

    def look(progress):
        seen.append((progress, progress.image(), progress.candidates()))

    whole, output = run(sample, (40, 30), channel_axis=axis)
    monkeypatch.setattr("simdtex.methods.multires.analysis.LAUNCH", 1)  # so that levels come in pieces
    image = synthesize(sample, (40, 30), channel_axis=axis, callback=look)
    assert_same_bits(image, whole)
    fractions = [progress.fraction for progress, *_ in seen]
    assert fractions == sorted(fractions)
    assert fractions[0] > 0
    assert fractions[-1] == 1
    ends = [progress.level for progress, *_ in seen if progress.end_of_level]
    assert ends == [4, 3, 2, 1, 0], "one end for each"
    assert len(seen) > 2 * len(ends)
    stages = {stage.level: stage for stage in output.stages}
    for progress, picture, candidates in seen:
        assert progress.levels == 5
        shown = stages[progress.level + (not progress.end_of_level)]  # else the level before
        assert_same_bits(picture, shown.image)
        assert_same_bits(candidates, shown.candidates)
        assert progress.doing == f"level {progress.level}"
        assert progress.stage == (progress.doing.replace(" ", "") if progress.end_of_level else None)
        [marks] = progress.maps().values()
        assert marks.shape == candidates.shape and 0 <= marks.min() <= marks.max() <= 1


@pytest.mark.parametrize("options", [{}, {"levels": 1}], ids=str)
def test_progress_ends_at_1_and_a_callback_changes_nothing(options):
    sample, seen = texture((13, 7)), []
    image = synthesize(sample, (20, 17), callback=seen.append, **options)
    assert (seen[-1].level, seen[-1].end_of_level, seen[-1].fraction) == (0, True, 1)
    assert_same_bits(seen[-1].image(), image)
    assert_same_bits(synthesize(sample, (20, 17), **options), image)


def noted(monkeypatch, most=INF):
    """Note the bytes of device memory that runs ask for, of which there are so many."""
    sizes = []

    def require(machine, device, *_):
        sizes.append(device)
        if device > most:
            raise simdtex.DeviceError("too little memory")

    monkeypatch.setattr(memory, "require", require)
    return sizes


@pytest.mark.parametrize("channels", [None, 3])
def test_memory_grows_with_the_output_and_with_nothing_else(channels, monkeypatch):
    sample, asked, sizes = texture((13, 7), channels), {}, noted(monkeypatch)
    for cols in (14, 28, 42, 70):  # whole tiles
        for options in ({"alpha": 0}, {"alpha": INF}, {"alpha": INF, "parity": "free"}):
            sizes.clear()
            synthesize(sample, (40, cols), device=REFERENCE, **options)
            asked.setdefault(cols, set()).add(tuple(sizes))
    assert all(len(sizes) == 1 for sizes in asked.values()), "whatever the candidates"
    analysis, synthesis = zip(*(sizes.pop() for sizes in asked.values()), strict=True)
    assert len(set(analysis)) == 1
    steps = np.diff(synthesis) / np.diff(list(asked)) / 40
    assert np.ptp(steps) == 0 and steps[0] <= 4 + 2 * (12 + 4 * (channels or 1)), "bytes for each pixel"


@pytest.mark.parametrize("shape", [(2**31, 2**31), (1, 2**31), (2**70, 1), (2**16, 2**15)], ids=str)
def test_an_output_beyond_32_bits_is_refused_before_any_work(shape, monkeypatch):
    def never(*_, **__):
        raise AssertionError("worked")

    monkeypatch.setattr("simdtex.methods.multires.algorithm.analyse", never)
    with pytest.raises(ValueError, match=f"{shape[0]} rows x {shape[1]} columns is beyond .*; give a smaller size"):
        synthesize(texture((13, 7)), shape)

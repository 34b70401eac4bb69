"""Volumes: the lattice of layers, its sample and its data against plain loops, and what a run of layers keeps.

A volume is indexed [layer, row, column]; the loops here share no code with the package.
"""

import json
import shlex
from itertools import product
from math import isqrt
from pathlib import Path

import numpy as np
import pytest
import xarray
from cases import assert_same_bits, colors_of
from click.testing import CliRunner
from scipy.ndimage import gaussian_filter

import simdtex
from simdtex import schedules
from simdtex.commands import main
from simdtex.io import volume
from simdtex.jobs.simulation.ensemble import connectivity, copied, copies
from simdtex.methods import mrf
from simdtex.methods.mrf.lcpdf import optimal_bandwidth
from simdtex.methods.mrf.square import square_of
from simdtex.model.given import between, nearest_data
from simdtex.model.lattice import Grid, coloring_of_layers, neighbourhood_offsets, sums_around
from simdtex.model.pictures import Pictures
from simdtex.model.sample import Sample

SHAPE = (7, 9, 11)


def ball(order):
    """The offsets of a neighbourhood in canonical order."""
    side = range(-isqrt(order), isqrt(order) + 1)
    every = [o for o in product(side, side, side) if 0 < sum(n * n for n in o) <= order]
    return sorted(every, key=lambda o: (sum(n * n for n in o), *o))


def facies(shape=(9, 20, 22), seed=0, kinds=2):
    """Blobs of so many categories, flat ones."""
    field = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), (1, 2.5, 2.5), mode="wrap")
    return np.digitize(field, np.quantile(field, np.arange(1, kinds) / kinds)).astype(np.uint8)


def simulated(training=None, **options):
    training = facies() if training is None else training
    given = {"categorical": True, "order": 3, "rng": 7, "device": "reference", "jobs": 1} | options
    return simdtex.simulate(training, 1, **given).values[0]


@pytest.mark.parametrize(("order", "spacing"), [(1, 1), (1, 2), (5, 1), (8, 4)])
def test_sites_and_neighbours_are_those_of_plain_loops(order, spacing):
    grid, offsets = Grid.of(SHAPE, spacing, False), neighbourhood_offsets(order, 3)
    assert offsets.dtype == np.int32 and list(map(tuple, offsets.tolist())) == ball(order)
    sides = [range(0, n, spacing) for n in SHAPE]
    sites = [np.ravel_multi_index(at, SHAPE) for at in product(*sides)]
    assert grid.size == len(sites)
    assert grid.places(np.arange(grid.size, dtype=np.int32)).tolist() == sites
    marked = np.arange(np.prod(SHAPE)).reshape(SHAPE)
    assert grid.decimated(marked).ravel().tolist() == sites
    found = grid.neighbours(np.arange(grid.size, dtype=np.int32), offsets)
    for at, column in zip(product(*sides), found.T.tolist(), strict=True):
        there = [tuple(n + spacing * by for n, by in zip(at, offset, strict=True)) for offset in ball(order)]
        inside = [all(0 <= n < side for n, side in zip(one, SHAPE, strict=True)) for one in there]
        wanted = [sites.index(marked[one]) if yes else -1 for one, yes in zip(there, inside, strict=True)]
        assert column == wanted


def test_no_neighbours_share_a_colour():
    for order in (1, 3, 8):
        grid = Grid.of((5, 9, 11), 1, False)
        colors = colors_of(grid, order)
        assert colors.shape == grid.shape and set(colors.ravel()) <= set(range(coloring_of_layers(order)[0]))
        near = grid.neighbours(np.arange(grid.size, dtype=np.int32), neighbourhood_offsets(order, 3))
        assert not ((colors.ravel()[near] == colors.ravel()[None, :]) & (near >= 0)).any()


@pytest.mark.parametrize(("spacing", "phases", "edges"), [(1, 1, "whole"), (2, 1, "whole"), (2, 64, "reflect")])
def test_candidates_and_their_neighbours_are_those_of_plain_loops(spacing, phases, edges):
    """A volume of different values, and its reflection, say where everything is read."""
    order, shape = 5, (7, 6, 9)
    volume = np.random.default_rng(1).permutation(np.prod(shape)).reshape(shape).astype(np.uint16)
    offsets = neighbourhood_offsets(order, 3)
    margin = 2 * spacing
    sample = Sample(Pictures((volume[..., None],)), len(offsets), margin)
    working = sample.scale.levels(volume[..., None])[0]
    framed = np.pad(working, margin, mode="reflect")
    places = sample.places(offsets, spacing, phases, edges)
    step = max(1, spacing // phases)
    wanted = list(product(*(range(0, n, step) for n in shape)))
    if edges == "whole" and spacing == 1:  # at a coarse level they are too few
        wanted = [
            at for at in wanted if all(2 * spacing <= a < n - 2 * spacing for a, n in zip(at, shape, strict=True))
        ]
    assert sample.place(places.positions).tolist() == [list(at) for at in wanted]
    assert sample.index(np.array(wanted)).tolist() == places.positions.tolist()
    assert sample.own(places.positions)[:, 0].tolist() == [volume[at] for at in wanted]
    assert places.shape == tuple(len({at[axis] for at in wanted}) for axis in range(3))
    machine = simdtex.open_machine("reference")
    square = square_of(machine, sample, places, True)
    for number, at in enumerate(wanted):
        near = [framed[tuple(a + margin + spacing * b for a, b in zip(at, o, strict=True))] for o in ball(order)]
        assert sample.working[0, places.positions[number] + places.reach].tolist() == near
        row, col = divmod(number, square.cols)
        first = square.at[row * square.cols + col % square.runs]
        assert square.at[number] == first + col // square.runs, "every `runs`-th of a row is side by side"
        there = square.at[number] + offsets @ [square.layer_stride, square.row_stride, 1]
        assert square.levels[0, there].tolist() == near


def test_sums_are_those_of_plain_loops():
    values, reach = np.random.default_rng(2).integers(0, 9, (3, 5, 4)), 1
    for at in np.ndindex(*values.shape):
        near = tuple(slice(max(0, n - reach), n + reach + 1) for n in at)
        assert sums_around(values, reach)[at] == values[near].sum()


def test_data_between_sites_are_those_of_plain_loops():
    order, spacing, known = 5, 4, np.random.default_rng(3).random(SHAPE) < 0.05
    grid, wanted = Grid.of(SHAPE, spacing, False), []
    for at in map(tuple, np.argwhere(known).tolist()):
        ends = zip(at, grid.shape, strict=True)
        corners = product(*({n // spacing * spacing, min(-(-n // spacing), s - 1) * spacing} for n, s in ends))
        if any(n % spacing for n in at) and not any(known[corner] for corner in corners):
            wanted.append(list(at))
    place = between(known, grid)
    assert place.tolist() == wanted and wanted
    site, datum, apart = nearest_data(place, grid, order)
    found = {}
    for number, k, by in zip(site.tolist(), datum.tolist(), apart.tolist(), strict=True):
        found.setdefault(number, []).append((k, tuple(by)))
    for number, at in enumerate(product(*(range(0, n, spacing) for n in SHAPE))):
        by = [tuple(a - b for a, b in zip(there, at, strict=True)) for there in wanted]
        far = [max(map(abs, o)) > isqrt(order) * spacing or sum(n * n for n in o) > order * spacing**2 for o in by]
        near = sorted((sum(n * n for n in o), k, o) for k, (o, no) in enumerate(zip(by, far, strict=True)) if not no)
        assert found.get(number, []) == [(k, o) for _, k, o in near[:8]]


def sloping(shape=(8, 14, 15)):
    """A probability that rises from the first layer to the last."""
    return np.broadcast_to(np.linspace(0, 1, shape[0])[:, None, None], shape)


def test_data_are_honoured_and_pixels_are_the_samples():
    """And the schedule is checked at every step; a callback sees volumes."""
    truth, seen = facies(seed=5)[:8, :14, :15], []
    known = np.ma.MaskedArray(truth, np.random.default_rng(4).random(truth.shape) >= 0.03)
    schedule = schedules.Checked(schedules.get("coloring"))
    found = simulated(known=known, schedule=schedule, callback=lambda progress: seen.append(progress))
    assert (found[~known.mask] == known.data[~known.mask]).all()
    assert set(np.unique(found)) <= {0, 1} and found.shape == seen[-1].image().shape == known.shape
    liar = schedules.get("synchronous")
    liar.independent = lambda grid, offsets: True
    with pytest.raises(RuntimeError, match="neighbours"):
        simulated(schedule=schedules.Checked(liar), shape=(4, 5, 6))


def test_a_guide_of_a_volume_may_be_unknown():
    """An eighth of the places, all between the sites of the coarse levels, lead those around them."""
    own = np.broadcast_to(np.arange(9)[:, None, None] < 4, (9, 20, 22))
    wanted = np.broadcast_to(np.arange(22) < 11, own.shape)
    sparse = np.full(own.shape, np.nan)
    sparse[1::2, 1::2, 1::2] = wanted[1::2, 1::2, 1::2]
    found = simulated(own.astype(np.uint8), guide=(own.astype(float), sparse), shape=own.shape, levels=3)
    assert (found == wanted).all()


def test_soft_data_and_a_region_have_layers():
    found = simulated(probabilities=np.stack([1 - sloping(), sloping()]), shape=(8, 14, 15))
    assert (found[0] == 0).all() and (found[-1] == 1).all() and found[:4].mean() < 0.4 < 0.6 < found[4:].mean()
    inside = np.indices((8, 14, 15)).sum(0) > 12
    maps = simdtex.simulate(
        facies(), 1, region=inside, source=True, categorical=True, order=3, rng=7, device="reference"
    )
    assert (maps.region.values == inside).all() and set(np.unique(maps.simulation.values[0, ~inside])) == {255}
    names = ("source_layer", "source_row", "source_column")
    place = np.stack([maps[name].values[0][inside] for name in names])
    assert (facies()[tuple(place)] == maps.simulation.values[0][inside]).all()


@pytest.mark.slow
def test_the_shares_are_those_of_the_training_image():
    training = facies((10, 40, 40), kinds=3)
    wanted = np.bincount(training.ravel()) / training.size
    for seed in range(3):
        made = simulated(training, order=8, rng=seed, device=None)
        assert np.abs(np.bincount(made.ravel(), minlength=3) / made.size - wanted).max() < 0.04


def test_a_thin_volume_has_as_many_levels_as_its_rows_and_columns_allow():
    plan = mrf.plan(Pictures((facies((3, 64, 64))[..., None],)), (3, 64, 64), mrf.Options(boundary="open", order=1))
    assert plan.levels == 4


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"boundary": "torus"}, "boundary=torus is for pictures; leave it out for a volume"),
        ({"array": "4x4"}, "array=4x4 is for pictures; leave it out for a volume"),
        ({"shape": (8, 9)}, "shape must be three integers .layers, rows, columns., not .8, 9."),
        ({"shape": (0, 8, 9)}, "layers of the output is 0; give 1 or more"),
        ({"order": 40}, "order 40 does not fit the sample of 9 layers x 20 rows x 22 columns; the largest order"),
        ({"known": np.full((4, 4), np.nan)}, "known is 2-dimensional; give .layers, rows, cols."),
        ({"rotation": np.zeros((20, 22))}, "rotation is 20x22 and has to be 9x20x22, as the output; give one size"),
        ({"lattice": ((8.0, 0.0), (0.0, 8.0))}, "lattice=.* is for pictures; leave it out for a volume"),
        ({"finish": 2.0, "categorical": False}, "finish=2 takes means, which the training image lacks"),
        ({"training": facies()[0], "shape": (5, 6, 7)}, "the training image is a picture; give a training volume"),
        ({"training": np.stack([facies(), facies()])}, "the sample is 4-dimensional: give .layers, rows, cols."),
        ({"probabilities": np.full((2, 9, 20, 22), 0.4)}, "the probabilities of layer 0, row 0, column 0 are 0.4, 0.4"),
    ],
)
def test_what_only_pictures_have_is_refused(options, words):
    with pytest.raises(ValueError, match=words):
        simulated(**options)


VOLUMES = facies((9, 20, 22)), facies((8, 24, 18), 1)


def made_of(training, **options):
    """A realisation and the number of the volume of each cell, whose sources hold its values."""
    given = {"categorical": True, "order": 2, "rng": 7, "device": "reference", "jobs": 1, "source": True} | options
    found = simdtex.simulate(training, 1, **given).isel(realisation=0)
    number = found.source_image.values if "source_image" in found else np.zeros(found.simulation.shape, int)
    places = np.stack([found[f"source_{name}"].values for name in ("layer", "row", "column")], -1)
    volumes = training if isinstance(training, tuple) else (training,)
    for k, one in enumerate(volumes):
        assert (one[tuple(places[number == k].T)] == found.simulation.values[number == k]).all()
    return found.simulation.values, number


def test_candidates_of_several_volumes_are_those_of_each():
    volumes = [
        np.random.default_rng(n).permutation(np.prod(s)).reshape(s) for n, s in enumerate([(5, 8, 9), (6, 7, 10)])
    ]
    offsets, margin = neighbourhood_offsets(3, 3), 2
    sample = Sample(Pictures(tuple(one[..., None].astype(np.uint16) for one in volumes)), len(offsets), margin, step=2)
    for spacing, edges in product((1, 2), ("whole", "reflect")):
        level = sample.places(offsets, spacing, 1, edges)
        places = level.positions
        inside = 1 if edges == "whole" and spacing == 1 else 0  # at a coarse level they are too few
        lines = [[range(inside + -inside % spacing, n - inside, spacing) for n in one.shape] for one in volumes]
        wanted = [(*at, k) for k, each in enumerate(lines) for at in product(*each)]
        found = sample.place(places)
        assert sorted(map(tuple, found.tolist())) == sorted(wanted)
        assert (sample.index(found) == places).all()
        assert sample.own(places)[:, 0].tolist() == [volumes[k][tuple(at)] for *at, k in found.tolist()]
        near = sample.around(places, level.reach)[..., 0]
        for (*at, k), row in zip(found.tolist(), near.tolist(), strict=True):
            framed = np.pad(volumes[k], margin, mode="reflect")
            assert row == [framed[tuple(a + margin + spacing * b for a, b in zip(at, o, strict=True))] for o in ball(3)]


def test_cells_are_of_the_volumes_that_maps_ask_for():
    shape = (4, 10, 12)
    right = np.broadcast_to(np.arange(12) > 5, shape)
    assert (np.bincount(made_of(VOLUMES, shape=shape)[1].ravel(), minlength=2) > 0).all()
    assert (made_of(VOLUMES, image_map=right.astype(float))[1] == right).all()
    two = facies(), 2 + facies(seed=1)  # the shares that are asked are those of both
    values, number = made_of(two, image_map=right.astype(float))
    assert ((values > 1) == right).all() and (number == right).all()


def test_rotation_and_scale_of_a_volume():
    shape = (4, 8, 10)
    training = VOLUMES[0][:6, :12, :13]
    turned = np.ascontiguousarray(np.rot90(training, -1, (1, 2)))  # from x to y
    found, _ = made_of(training, rotation=np.full(shape, 90.0))
    assert (found == made_of(turned, shape=shape)[0]).all()
    larger = training.repeat(2, 0).repeat(2, 1).repeat(2, 2)
    found, _ = made_of(training, scale=np.full(shape, 2.0))
    assert (found == made_of(larger, shape=shape)[0]).all()
    made_of(VOLUMES, rotation=np.full(shape, 45.0), scale=np.full(shape, 0.5), order=1)


def test_estimates_of_a_volume_are_those_of_plain_loops(cl_device):
    """Two data, one on another layer; a cell that is near one only, and one that is near none."""
    training, known = facies((4, 7, 8)), np.ma.masked_all((3, 6, 9), np.uint8)
    known[0, 1, 2], known[2, 2, 3] = 1, 0
    given = {"known": known, "categorical": True, "nearest": 2, "reach": 3}
    found = simdtex.estimate(training, device="reference", **given)
    assert found.probability.dims == ("category", "z", "y", "x")
    framed = np.pad(training, 3, mode="reflect")
    for site in [(1, 1, 2), (2, 5, 3), (0, 5, 8)]:
        near = [at for at in np.argwhere(~known.mask) if ((at - site) ** 2).sum() <= 9]
        cost = np.zeros(training.shape)
        for at in near:
            part = tuple(slice(3 + a - s, 3 + a - s + n) for a, s, n in zip(at, site, training.shape, strict=True))
            cost += framed[part] != known[tuple(at)]
        h = optimal_bandwidth(training.var(), training.size, len(near) + 1)
        weight = np.exp(-cost / (2 * h * h))
        wanted = (weight * training).sum() / weight.sum()
        assert found.probability.values[(1, *site)] == pytest.approx(wanted, rel=1e-6)
    assert found.identical(simdtex.estimate(training, device=cl_device, **given).assign_attrs(found.attrs))


def test_windows_of_layers_that_occur_in_a_volume():
    training = facies((3, 20, 22))
    made = np.stack([training[::-1, 2:, 3:], facies((3, 18, 19), 5)])
    places = copies(made, training, side=8)
    assert places.shape == (2, 3, 11, 12)
    there = np.argwhere(places[0] >= 0)
    assert len(there)
    for layer, row, col in there:
        at = np.unravel_index(places[0, layer, row, col], training.shape)
        window = training[at[0], at[1] : at[1] + 8, at[2] : at[2] + 8]
        assert (window == made[0, layer, row : row + 8, col : col + 8]).all()
    whole, other = copied(places)
    assert whole == 1 and other < 1


@pytest.mark.parametrize(
    ("training", "options"),
    [
        (facies(kinds=5), {"shape": (3, 6, 7)}),  # half of the lanes
        # all of them, and the structure channel
        (facies(kinds=4)[4], {"order": 18, "levels": 2, "search": "coherent", "shape": (6, 10)}),
    ],
)
def test_categories_are_compared_by_number_as_by_channel(cl_device, training, options):
    found = [simulated(training, device=one, **options) for one in ("reference", cl_device)]
    assert_same_bits(*found)


def test_the_command_takes_a_volume_and_writes_a_report(tmp_path, monkeypatch):
    """The same bytes as in Python, with coordinates; the report has the training image's own figures."""
    monkeypatch.chdir(tmp_path)
    training = facies((9, 14, 15))
    simdtex.write_grid("ti.sgems", {"facies": training}, origin=(5, 7, -9), cell=(10, 10, 1))
    Path("wells.csv").write_text("x,y,z,facies\n15,27,-8,1\n")
    words = ["ti.sgems", "-o", "out.nc", "-n", "2", "--categorical", "--known", "wells.csv", "--size", "8x9x6"]
    result = CliRunner().invoke(
        main, ["simulate", *words, "--order", "2", "--seed", "7", "--device", "reference", "--report", "page"]
    )
    assert result.exit_code == 0, result.output
    found = xarray.open_dataarray("out.nc")
    place = {"origin": (5, 7, -9), "cell": (10, 10, 1)}
    given = {"known": "wells.csv", "shape": (6, 9, 8), "order": 2, "rng": 7, "device": "reference", **place}
    assert_same_bits(found.values, simdtex.simulate(training, 2, categorical=True, **given).values)
    assert (found.values[:, 1, 2, 1] == 1).all()
    assert found.y.values[0] == 7
    results = json.loads(Path("page/results.json").read_text())
    own = results["variograms"][0]
    assert own[1][2] == pytest.approx(np.mean(training[:, 2:] != training[:, :-2]) / 2)
    assert results["connectivity"][0] == connectivity(training, 1, len(own[0]) - 1).function.tolist()
    assert {"slices.png", "variograms.png", "connectivity.png", "index.html"} <= set(results["files"])


@pytest.mark.slow
def test_what_solid_writes_is_a_training_image(tmp_path, monkeypatch):
    """A block of three axes is a volume in each format, whose slices begin in the north, or a picture."""
    monkeypatch.chdir(tmp_path)
    training, found = facies((9, 14, 15)), []
    for name in ("ti.npy", "ti.tif", "slices"):
        volume.write(name, training[:, ::-1] if name != "ti.npy" else training)
        words = shlex.split("--size 9x8x7 --order 2 --seed 7 --device reference")
        result = CliRunner().invoke(main, ["simulate", name, "-o", f"{name}-out.npz", *words])
        assert result.exit_code == 0 and "9x8x7" in result.output, result.output
        found.append(np.load(f"{name}-out.npz")["values"])
    assert found[0].shape == (1, 7, 8, 9)
    for other in found[1:]:
        assert_same_bits(other, found[0])
    words = ["ti.npy", "-o", "out.npz", "--size", "8x7", "--order", "2", "--device", "reference", "--channels"]
    result = CliRunner().invoke(main, ["simulate", *words])
    assert result.exit_code == 0 and np.load("out.npz")["values"].shape == (1, 7, 8, 15), result.output
    Path("wells.csv").write_text("x,y,facies\n1,2,1\n")
    for more, words in (([], "or wells.csv with a column z"), (["--channels"], "has several channels")):
        result = CliRunner().invoke(main, ["estimate", "ti.npy", "-o", "out.npz", "--known", "wells.csv", *more])
        assert result.exit_code == 2 and words in result.output


def test_the_command_refuses_a_size_of_two_sides_and_an_output_among_slices(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    volume.write("slices", facies((9, 14, 15)))
    for words, said in (
        (["-o", "slices/out.npz"], "would be written into slices, which is an input"),
        (["-o", "out.npz", "--size", "12x13"], "is not WIDTHxHEIGHTxDEPTH"),
    ):
        result = CliRunner().invoke(main, ["simulate", "slices", *words])
        assert result.exit_code == 2 and said in result.output

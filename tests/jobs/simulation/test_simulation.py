"""`simdtex.simulate`: every realisation is its own seed's, honours the data, and the array tells what it is of."""

import json
import sys
import threading

import numpy as np
import pytest
from cases import assert_same_bits, texture

import simdtex
from simdtex.checkpoint import read
from simdtex.io.hard_data import place_hard_data, read_hard_data
from simdtex.jobs.simulation.ensemble import channels
from simdtex.jobs.simulation.job import realisation_seed
from simdtex.methods import mrf
from simdtex.model.pictures import Pictures

xarray = pytest.importorskip("xarray")

SHAPE = (12, 14)
QUICK = {"order": 2, "xi": -8.0, "device": "reference", "rng": 5, "jobs": 1}
TRAINING = texture((16, 20))
CATEGORIES = (TRAINING > 90).astype(np.uint8) * 3 + (TRAINING > 170) * np.uint8(4)


def simulate(training=TRAINING, n=2, **options):
    return simdtex.simulate(training, n, **({"shape": SHAPE} | QUICK | options))


def ran(found):
    """The options of a simulation."""
    return json.loads(found.attrs["options"])


def holed(dtype=np.float32, shape=SHAPE, channels=None):
    """Values of the training image here and there, NaN elsewhere."""
    rng = np.random.default_rng(3)
    source = texture((16, 20), channels, dtype)[: shape[0], : shape[1]]
    found = source.astype(np.float64 if dtype != np.float32 else dtype)
    found[rng.random(shape) < 0.9] = np.nan
    return found


def test_a_realisation_depends_on_its_number_alone():
    one, many = simulate(n=3), simulate(n=3, jobs=9)
    assert len({values.tobytes() for values in one.values}) == 3
    assert_same_bits(one.values, many.values)
    assert one.attrs == many.attrs
    assert_same_bits(simulate(n=2, first=1, jobs=None).values, one.values[1:])


def test_a_realisation_is_what_synthesize_gives_with_its_seed():
    training, data = texture((16, 20), dtype=np.float32), holed()
    found = simulate(training, known=data, scores=False)  # else with drawn shares of classes
    for seed, values in zip(found.seed.values, found.values, strict=True):
        own = simdtex.synthesize(training, SHAPE, rng=int(seed), known=data, device="reference", **ran(found))
        assert_same_bits(values, own)
        assert_same_bits(values[~np.isnan(data)], data[~np.isnan(data)])
    how = {"known": np.where(np.isnan(data), np.nan, CATEGORIES[:12, :14]), "categorical": True} | QUICK
    found = simdtex.simulate(CATEGORIES, 1, proportions=np.unique(CATEGORIES, return_counts=True)[1].tolist(), **how)
    del how["jobs"]
    own = simdtex.synthesize(CATEGORIES, SHAPE, **how | {"rng": int(found.seed[0])})
    assert_same_bits(found.values[0], own)  # which has the defaults of a simulation then


def test_seeds_are_apart_and_stay_what_they_are():
    seeds = [realisation_seed(seed, number) for seed in (0, 1, 2**64 - 1) for number in range(50)]
    assert len(set(seeds)) == 150
    assert all(0 <= seed < 2**64 for seed in seeds)
    # written down once: files of realisations name these seeds
    assert [realisation_seed(1, number) for number in (0, 1)] == [8431846347943309920, 4042681867674859579]
    assert simulate(first=3).seed.values.tolist() == [realisation_seed(5, 3), realisation_seed(5, 4)]


def test_the_size_is_that_of_the_data_of_a_map_or_of_the_training_image():
    training, how = texture((16, 20), dtype=np.float32), {"n": 1, "shape": None, "levels": 1, "free_sweeps": 0}
    assert simulate(training, **how, known=holed()).shape == (1, *SHAPE)
    assert simulate(training, **how).shape == (1, 16, 20)
    assert simulate(**how | {"shape": (np.int64(7), 9)}).shape == (1, 7, 9)
    assert simulate(**how, rotation=np.zeros((7, 9))).shape == (1, 7, 9)
    assert simulate(**how, image_map=np.ones((1, 7, 9))).shape == (1, 7, 9)


def test_a_table_of_several_variables_which_are_the_last_dimension(tmp_path):
    path = tmp_path / "wells.csv"
    path.write_text("x,y,a,b\n3,4,0.5,0.25\n7,2,,0.75\n")
    training = np.moveaxis(texture((16, 20), 2, np.float32), -1, 0)
    found = simulate(training, n=2, known=path, channel_axis=0)
    assert found.dims == ("realisation", "y", "x", "variable") and found.shape == (2, *SHAPE, 2)
    placed = place_hard_data(read_hard_data(path), SHAPE, np.float32)
    for values in found.values:
        assert_same_bits(values[~placed.mask], placed.data[~placed.mask])
    known = np.ma.MaskedArray(np.moveaxis(placed, -1, 0))
    assert_same_bits(found.values, simulate(training, n=2, known=known, channel_axis=0, shape=None).values)
    own = simdtex.synthesize(
        *(training, SHAPE), channel_axis=0, known=known, rng=int(found.seed[1]), **ran(found), device="reference"
    )
    assert np.array_equal(found.values[1], np.moveaxis(own, 0, -1))


def smooth(shape, seed):
    """A Gaussian random field that wraps around."""
    waves = np.meshgrid(*(np.fft.fftfreq(n) for n in shape), indexing="ij")
    noise = np.fft.fftn(np.random.default_rng(seed).normal(size=shape))
    field = np.fft.ifftn(noise * np.exp(-450 * sum(w**2 for w in waves))).real
    return (field / field.std()).astype(np.float32)


@pytest.mark.parametrize(
    ("search", "sample", "shape", "share"),
    [
        ("coherent", (64, 64), (48, 48), 0.03),
        pytest.param("exact", (80, 80), (64, 64), 0.03, marks=pytest.mark.slow),
        pytest.param("coherent", (10, 24, 24), (6, 16, 16), 0.1, marks=pytest.mark.slow),
    ],
)
def test_a_variable_known_alone_decides_on_the_others(search, sample, shape, share):
    """Facies are where porosity is positive; it is known in few cells, and the facies there must agree."""
    porosity, truth = smooth(sample, 1), smooth(shape, 2)
    truth = np.clip(truth, porosity.min(), porosity.max())
    there = np.random.default_rng(3).random(shape) < 0.03
    known = np.stack([np.where(there, truth, np.nan), np.full(shape, np.nan)], -1)
    training = np.stack([porosity, porosity > 0], -1).astype(np.float32)
    how = {"channel_axis": -1, "categorical": (1,), "search": search, "rng": 1}
    found = simdtex.simulate(training, 1, shape=shape, known=known, **how).values[0]
    assert np.array_equal(found[there, 0], truth[there])
    assert ((found[there, 1] > 0) != (truth[there] > 0)).mean() <= share


@pytest.mark.filterwarnings("ignore:Consolidated metadata")
def test_dimensions_coordinates_type_and_attributes_are_written_by_xarray_itself(tmp_path):
    for dtype in (np.bool_, np.float64):
        found = simulate(texture((16, 20), dtype=dtype), first=4, rng=2**64 - 1, order=np.int64(2), levels=1)
        assert found.dtype == dtype and found.name == "simulation"
        assert found.dims == ("realisation", "y", "x") and found.realisation.values.tolist() == [4, 5]
        assert np.array_equal(found.y, np.arange(12)) and np.array_equal(found.x, np.arange(14))
        assert found.seed.dims == ("realisation",) and found.seed.dtype == np.uint64
    shares = {"shares_asked", "shares_reached"}
    assert set(found.attrs) == {"seed", "version", "device", "options", "training_image"} | shares
    assert (found.attrs["seed"], found.attrs["version"]) == (2**64 - 1, simdtex.__version__)
    assert found.attrs["device"].startswith("reference") and len(found.attrs["training_image"]) == 64
    options = json.loads(found.attrs["options"])
    assert (options["order"], options["levels"], options["balance"]) == (2, 1, 0.15)
    found.to_netcdf(tmp_path / "t.nc")
    found.to_zarr(tmp_path / "t.zarr")
    for name in ("t.nc", "t.zarr"):
        with xarray.open_dataarray(tmp_path / name) as back:
            assert back.identical(found) and back.dtype == found.dtype


def test_coordinates_on_the_ground():
    found = simulate(origin=(1005, 2010.5), cell=(10, 21), n=1)
    assert np.array_equal(found.x, 1005 + 10 * np.arange(14)) and np.array_equal(found.y, 2010.5 + 21 * np.arange(12))
    assert (found.attrs["cell_x"], found.attrs["cell_y"]) == (10, 21) and "z" not in found.coords
    assert_same_bits(found.values, simulate(n=1).values)
    found = simulate(origin=(1, 2, 3), n=1)
    assert (found.x[0], found.y[0], found.z) == (1, 2, 3) and found.x[1] == 2 and found.attrs["cell_z"] == 1
    assert simulate(n=1).x.dtype.kind == "i", "columns, if nothing is said of the ground"


def test_data_on_the_ground(tmp_path):
    path = tmp_path / "wells.csv"
    path.write_text("x,y,value\n1035,2094.5,20\n1074,2053,30\n1074,2053,31\n1074,2053,31\n")
    how = {"known": path, "origin": (1005, 2010.5), "cell": (10, 21)}
    found = simulate(**how, several="most")
    assert_same_bits(found.values, simulate(known=place_hard_data([(3, 4, 20), (7, 2, 31)], SHAPE, np.uint8)).values)
    with pytest.raises(
        ValueError, match=r"line 2 of .*wells.csv .* x -0.5 to 13.5 .all points 1035 to 1074., .*: give"
    ):
        simulate(known=path)


def test_shares_are_drawn_for_each_realisation_unless_proportions_a_guide_or_variables_tell_others():
    training = np.random.default_rng(1).choice(3, (16, 20), p=(0.6, 0.3, 0.1)).astype(np.uint8)
    shares = np.bincount(training.ravel()) / training.size
    drawn = simulate(training, categorical=True)
    aims = np.stack([drawn.coords[f"share_{category}"] for category in range(3)], -1)
    assert np.ptp(aims, 0).min() > 0.005 and aims.sum(-1) == pytest.approx(1)
    second = simulate(training, n=1, first=1, categorical=True)
    told = simulate(training, n=1, first=1, categorical=True, proportions=aims[1].tolist())
    assert (second.values == drawn.values[1]).all() and (told.values == second.values).all()
    same = simulate(training, categorical=True, share_spread=0)
    assert same.attrs["shares_asked"] == " ".join(f"{share:.3f}" for share in shares)
    assert np.ptp(same.share_0.values) == 0 and np.ptp(same.values, 0).any()
    for how in ({"proportions": shares.tolist()}, {"guide": (training, np.zeros(SHAPE, np.uint8))}):
        assert "share_0" not in simulate(training, n=1, categorical=True, **how).coords
    several = simulate(np.dstack([training, training]), n=1, categorical=True, channel_axis=-1)
    assert "share_0" not in several.coords


def test_shares_do_not_change_to_and_fro_between_sweeps(machine):
    """The penalty of a category grows in proportion to the distances, which are small while neighbours are warm."""
    options = mrf.Options(categorical=True, boundary="open", balance=1.0, proportions=(0.7, 0.3))
    run = mrf.plan(Pictures((channels()[0][:128, :128, None],)), (64, 64), options).on(machine, 1)
    state, shares, coarsest = run.begin(), [], run.levels - 1
    while state.level == coarsest and not run.at_equilibrium(state):
        state, _ = run.step(state)
        shares.append(run.sample.category(machine.get(state.source).ravel()).mean())
    assert len(shares) > 20 and abs(np.diff(shares)).mean() < 0.25, shares


@pytest.mark.slow
def test_a_share_hardly_depends_on_the_place():
    """In bands of 8 rows and columns, and corners, means of 80; the image is turned over, since it has trends."""
    made, training = [], channels()[0]
    for number, image in enumerate((training, training[::-1], training[:, ::-1], training[::-1, ::-1])):
        image = np.ascontiguousarray(image)
        made += [*simdtex.simulate(image, 20, shape=(128, 128), categorical=True, rng=number).values]
    rest = made - np.mean(made, (1, 2), keepdims=True)
    corners = rest.reshape(80, 4, 32, 4, 32).mean((2, 4))[:, ::3, ::3].reshape(80, 4)
    for parts in (rest.reshape(80, 16, -1).mean(2), rest.mean(1).reshape(80, 16, 8).mean(2), corners):
        assert (abs(parts.mean(0)) < 4.5 * parts.std(0) / 80**0.5).all(), parts.mean(0)


DIGESTS = ("training_image", "hard_data", "guide", "mask", "region", "probabilities", "image_map", "rotation", "scale")
FLOATS = texture((16, 20), dtype=np.float32)


def digests(**change):
    arguments = {
        "training": FLOATS,
        "known": holed(),
        "guide": (texture((16, 20), seed=7), texture(SHAPE, seed=8)),
        "mask": np.arange(20) < np.full((16, 1), 14),
        "region": ~np.isnan(holed()) | (np.arange(14) < 9),
        "image_map": np.zeros(SHAPE),
        "rotation": np.zeros(SHAPE),
        "scale": np.ones(SHAPE),
    } | change
    kind = {"categorical": True} if "probabilities" in change else {}
    attrs = simulate(n=1, levels=1, free_sweeps=0, **kind, **arguments).attrs
    return {name: attrs.get(name) for name in DIGESTS}


def with_value(array, value, at=(2, 3)):
    found = array.copy()
    found[at] = value
    return found


CHANGES = [
    ("training_image", {"training": with_value(FLOATS, FLOATS[0, 0])}),
    ("training_image", {"training": with_value(FLOATS, np.nan)}),
    ("training_image", {"training": FLOATS.astype(np.float64)}),
    ("hard_data", {"known": with_value(holed(), 0.5)}),
    ("guide", {"guide": (texture((16, 20), seed=7), texture(SHAPE, seed=9))}),
    ("region", {"region": np.ones(SHAPE, bool)}),
    ("image_map", {"image_map": np.ones((1, *SHAPE))}),
    ("rotation", {"rotation": None}),
    ("scale", {"scale": np.full(SHAPE, 2.0)}),
    ("mask", {"mask": np.arange(20) < np.full((16, 1), 15)}),
]


def test_a_digest_changes_with_its_array_and_with_nothing_else():
    before, seen = digests(), []
    for name, change in CHANGES:
        after = digests(**change)
        assert before[name] and after[name] != before[name], name
        # hard data are of the training image's type
        kept = [other for other in DIGESTS if other != name and (other, name) != ("hard_data", "training_image")]
        assert [after[other] for other in kept] == [before[other] for other in kept], name
        seen.append(after)
    near = [with_value(FLOATS, FLOATS[i, j]) for i, j in ((1, 3), (3, 3), (2, 2), (2, 4))]
    completed = [digests(training=training)["training_image"] for training in near]
    assert seen[1]["training_image"] not in completed, "an unknown pixel is not what it is completed with"


def test_a_callback_is_told_of_every_realisation_and_its_parts():
    seen, shares = [], []

    def look(progress):
        shares.append(progress.fraction)
        if progress.stage:
            seen.append((progress, progress.image()))
        else:
            assert progress.image().ndim == 3

    training = np.moveaxis(texture((16, 20), 2), -1, 0)
    found = simulate(training, n=3, first=2, jobs=2, channel_axis=0, callback=look)
    assert [one.finished for one, _ in seen] == [1, 2, 3]
    assert len(shares) > 9 and shares == sorted(shares) and (0 < shares[0] < 1 / 3, shares[-1]) == (True, 1.0)
    assert sorted(one.realisation for one, _ in seen) == [2, 3, 4]
    assert {one.realisations for one, _ in seen} == {3}
    assert {one.stage for one, _ in seen} == {f"realisation000{number}" for number in (2, 3, 4)}
    assert seen[0][0].doing == "1 of 3 realisations finished"
    for one, picture in seen:
        assert np.array_equal(picture, found.sel(realisation=one.realisation).values)


@pytest.mark.parametrize(("jobs", "error"), [(1, KeyboardInterrupt), (2, ZeroDivisionError)])
def test_an_error_in_one_realisation_ends_all(jobs, error):
    before, calls = set(threading.enumerate()), []

    def stop(progress):
        calls.append(progress.finished)
        raise error("enough")

    with pytest.raises(error, match="enough"):
        simulate(n=40, jobs=jobs, callback=stop)
    assert len(calls) <= 3 * jobs
    assert set(threading.enumerate()) <= before


def test_without_xarray_a_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ValueError, match=r"xarray is not installed; pip install 'simdtex\[simulate\]'"):
        simulate()


def test_cells_outside_of_the_region_take_no_part():
    region = np.ones(SHAPE, bool)
    region[:4, :6] = region[7, 3:] = False
    known = region & (holed() > 0)
    data, outside = np.where(known, 1.0, np.nan), np.repeat(~region[None], 2, 0)
    for training, missing in ((FLOATS, np.nan), (TRAINING, 255)):
        found = simulate(training, region=region, known=data, source=True)
        values, row = found.simulation.values, found.source_row.values
        assert np.array_equal(found.region, region) and found.region.dims == ("y", "x")
        assert np.array_equal(np.isnan(values) if np.isnan(missing) else values == missing, outside)
        assert np.array_equal(row < 0, outside | known)
        assert found.attrs.get("missing") == (None if np.isnan(missing) else missing)
        assert np.array_equal(np.isnan(found.simulation.where(found.region)), outside)
    assert "hard_data" in found.attrs and "region" in found.attrs


def test_the_source_map_of_every_realisation():
    training = np.arange(16 * 20, dtype=np.int32).reshape(16, 20)
    data = holed()
    options = {"known": np.where(data > 0, 7, np.nan), "finish": 0.0}
    found = simulate([training, -training], source=True, **options)
    assert {*found.data_vars} == {"simulation", "source_row", "source_column", "source_image"}
    assert found.attrs == found.simulation.attrs and found.source_row.dims == ("realisation", "y", "x")
    taken = (found.source_row >= 0).values
    assert np.array_equal(taken, ~(data > 0) | np.zeros((2, 1, 1), bool))
    signs = np.where(found.source_image == 1, -1, 1)[taken]
    rows, cols = (found[name].values[taken] for name in ("source_row", "source_column"))
    assert np.array_equal(signs * training[rows, cols], found.simulation.values[taken])
    assert simulate([training, -training], **options).identical(found.simulation)


ANOTHER = {
    "source": {"source": False},
    "n": {"n": 4},
    "first": {"first": 1},
    "region": {"region": np.arange(14) < np.full((12, 1), 9)},
    "rotation": {"rotation": np.zeros(SHAPE)},
    "option order": {"order": 1},
    "shape of the output": {"shape": (9, 14)},
}
"""Changes of a call, by what a checkpoint of the call before says of them."""


def test_a_stop_does_not_wait_for_the_end_of_a_realisation(tmp_path):
    kept = simdtex.Checkpoint(tmp_path / "run.ckpt")
    with pytest.raises(KeyboardInterrupt):
        simulate(n=3, jobs=1, checkpoint=kept, callback=lambda progress: kept.stop())
    assert read(kept.path)[1]["numbers"] == []


def test_a_stopped_simulation_goes_on_with_its_source_maps(tmp_path):
    path, whole = tmp_path / "run.ckpt", simulate(n=3, source=True)

    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(n=3, source=True, jobs=1, checkpoint=path, callback=stop)
    for what, change in ANOTHER.items():
        with pytest.raises(ValueError, match=f"is of another {what}[ ;]"):
            simulate(**{"n": 3, "source": True, "checkpoint": path} | change)
    xarray.testing.assert_identical(simulate(n=3, source=True, checkpoint=path), whole)


def test_a_table_of_probabilities(tmp_path):
    path = tmp_path / "soft.csv"
    path.write_text("x,y,none,some,more\n3,4,0,0,1\n7,2,1,0,0\n5,5,,,\n")
    found = simulate(CATEGORIES, categorical=True, probabilities=path)
    assert (found.values[:, 4, 3] == 7).all() and (found.values[:, 2, 7] == 0).all()
    table = np.full((3, *SHAPE), np.nan)
    table[:, 4, 3], table[:, 2, 7] = [0, 0, 1], [1, 0, 0]
    same = simulate(CATEGORIES, categorical=True, probabilities=np.ma.masked_invalid(table))
    assert_same_bits(found.values, same.values)


NOTHING = np.full(SHAPE, np.nan)
THIRDS, LEFT = np.full((3, *SHAPE), 1 / 3), np.arange(14) < np.full((12, 1), 3)
NAMED = {"training": CATEGORIES, "categorical": True}
BAD = {
    "no categories": ({"probabilities": THIRDS}, "are of categories; give categorical=True"),
    "too few": (NAMED | {"probabilities": THIRDS[:2]}, "2x12x14 .* the 3 categories 0, 3, 7; give"),
    "another size": (NAMED | {"probabilities": THIRDS[:, :5]}, "is 3x5x14 and has to be 3x12x14"),
    "no sum": (NAMED | {"probabilities": THIRDS * 2}, "row 0, column 0 are 0.6.*add up to 1"),
    "below 0": (NAMED | {"probabilities": THIRDS * [[[-1]], [[2]], [[2]]]}, "of 0 or more that add up"),
    "scale": ({"scale": np.full(SHAPE, 3.0)}, "scale has 3 to 3; give factors of 0.5 to 2"),
    "infinite": ({"rotation": np.full(SHAPE, np.inf)}, "rotation has infinite values"),
    "no such image": ({"image_map": np.ones(SHAPE)}, "image_map has 1 and there is 1 training image;"),
    "no weight": ({"image_map": np.zeros((1, *SHAPE))}, "weights below 0, or 0 alone"),
    "shares, too": ({"image_map": np.zeros(SHAPE), "shares": (1.0,)}, "leave shares out"),
    "no region": ({"region": np.zeros(SHAPE, bool)}, "region is False everywhere"),
    "data outside": ({"region": LEFT, "known": with_value(NOTHING, 20, (0, 5))}, "row 0, column 5, outside region;"),
    "no missing value": ({"training": TRAINING > 90, "region": LEFT}, "as int16"),
    "none": ({"n": 0}, "n is 0; give 1 or more"),
    "first": ({"first": -1}, "first is -1; give 0 or more"),
    "jobs": ({"jobs": 0}, "jobs is 0; give 1 or more"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_with_a_remedy(case):
    change, words = BAD[case]
    with pytest.raises(ValueError, match=words):
        simulate(**change)


@pytest.mark.slow
def test_shares_near_the_border_are_those_inside():
    """Sites near the border have fewer neighbours, and there a cost of a category weighs more."""
    found = simdtex.simulate(channels()[0][:128, :128], 8, shape=(64, 64), categorical=True, rng=1).values.mean(0)
    assert abs(found[12:-12, 12:-12].mean() - np.delete(found, np.s_[6:-6], 0).mean()) < 0.06
    assert abs(found[12:-12, 12:-12].mean() - np.delete(found, np.s_[6:-6], 1).mean()) < 0.06

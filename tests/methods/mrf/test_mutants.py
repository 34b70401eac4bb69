"""What the method ``mrf`` counts, asks for and says, which no picture shows: survivors of mutation had it changed."""

import numpy as np
import pytest
from cases import REFERENCE, laid_out, sweeps, texture

import simdtex
from simdtex.machine import memory
from simdtex.methods import mrf
from simdtex.methods.mrf import level as level_of_a_run
from simdtex.methods.mrf.level import check_fit, number_of_levels, parts
from simdtex.methods.mrf.plan import check_guide
from simdtex.methods.mrf.relax import AllCandidates, CandidateList
from simdtex.model.lattice import neighbourhood_offsets
from simdtex.model.pictures import Pictures
from simdtex.model.sample import Sample


def test_the_mode_of_a_density_is_of_all_candidates():
    words = 'the mode of a density is of all candidates; give search="exact", or relaxation="gibbs"'
    with pytest.raises(ValueError, match=f"^{words}$"):
        mrf.Options(pixel="density", search="coherent")


def test_options_resolve():
    def resolved(**given):
        found = mrf.Options(**given).resolved(Pictures((np.arange(17).reshape(1, 17, 1),)))
        return found.search, found.finish

    assert resolved() == ("coherent", 1.5)
    assert resolved(relaxation="gibbs") == ("exact", 1.5)
    assert resolved(relaxation="gibbs", pixel="density") == ("exact", 0.0)
    assert resolved(pixel="density") == ("exact", 0.0)
    assert resolved(search="exact", finish=0.5) == ("exact", 0.5)
    assert resolved(search="coherent", relaxation="gibbs", finish=0) == ("coherent", 0)
    assert resolved(relaxation="gibbs", pixel="density", finish=0.5) == ("exact", 0.5)


def test_a_sample_of_sixteen_different_pixels_is_a_map_of_categories():
    late = np.zeros((300, 300, 2), np.uint8)
    late[299, 284:, 1] = np.arange(16)  # in its last few pixels, and one of them is the 0 of all others
    for changed, finish in ((16, 0.0), (17, 1.5)):
        late[0, 0] = (7, 0) if changed == 17 else 0
        assert mrf.Options().resolved(Pictures((late,))).finish == finish
    assert mrf.Options(finish=1.5).resolved(Pictures((late[1:],))).finish == 1.5


@pytest.mark.parametrize(
    ("values", "dtype", "labels"),
    [(16, np.uint8, True), (17, np.uint8, False), (4, np.float32, False)],
)
def test_few_integers_of_a_guide_are_labels(values, dtype, labels):
    own = np.arange(values, dtype=dtype).reshape(1, -1, 1)
    assert check_guide(((own,), own[:, :3]), mrf.Options()).labels is labels
    assert check_guide(((own,), own[:, :3].astype(np.float64)), mrf.Options()).labels is False


def test_labels_that_the_sample_lacks_are_named():
    own = np.arange(0, 24, 2).reshape(1, -1, 1)
    with pytest.raises(ValueError, match=r"the label 3 .* has 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, \.\.\.; give labels"):
        check_guide(((own,), own[:, :3] + 3), mrf.Options())


def test_a_neighbourhood_that_does_not_fit():
    check_fit((3, 9), 1, 1)
    for sample, radius, order, words in [
        ((9, 4), 2, 8, "order 8 does not fit the sample of 9 rows x 4 columns; the largest order that fits is 3"),
        ((5, 7), 3, 9, "order 9 does not fit the sample of 5 rows x 7 columns; the largest order that fits is 8"),
        ((3, 3), 2, 4, "order 4 does not fit the sample of 3 rows x 3 columns; the largest order that fits is 3"),
        ((2, 8), 1, 1, "order 1 does not fit the sample of 2 rows x 8 columns; give at least 3x3 pixels"),
    ]:
        with pytest.raises(ValueError, match=f"^a neighbourhood of {words}$"):
            check_fit(sample, radius, order)


@pytest.mark.parametrize(
    ("sample", "shape", "given", "expected"),
    [
        ((16, 16), (64, 64), {"order": 1}, 2),  # 8 x 8 candidates are 64
        ((8, 16), (64, 64), {"order": 1}, 2),  # 4 x 8 candidates are enough down to 8 pixels from site to site
        ((7, 17), (64, 64), {"order": 1}, 1),
        ((8, 15), (64, 64), {"order": 1, "overview": 29}, 1),
        ((64, 64), (5, 64), {"order": 1}, 2),
        ((64, 64), (4, 64), {"order": 1}, 1),
        ((64, 64), (64, 64), {"order": 1, "overview": 1}, 6),  # down to 2x2 sites
        ((16, 16), (8, 16), {"order": 1, "levels": 4}, 4),
        ((16, 16), (8, 16), {"order": 1, "levels": 5}, "give at most 4"),
    ],
)
def test_how_many_levels(sample, shape, given, expected):
    options = mrf.Options(**{"overview": 64} | given)
    offsets = neighbourhood_offsets(options.order)
    if isinstance(expected, int):
        assert number_of_levels([sample], offsets, shape, options) == expected
    else:
        words = f"levels={options.levels} is too many for this sample, output and order; {expected}"
        with pytest.raises(ValueError, match=f"^{words}$"):
            number_of_levels([sample], offsets, shape, options)


def prepared(machine=REFERENCE, **given):
    options = {"order": 2, "levels": 3, "phases": 64, "edges": "reflect"} | given
    return laid_out(machine, texture((24, 25), seed=3)[..., None], (20, 23), mrf.Options(**options), 5)


def test_a_coarse_level_may_have_a_sample_and_an_output_of_half_the_size():
    pixels = texture((24, 25))[..., None]
    plan = mrf.plan(Pictures((pixels,)), (13, 11), mrf.Options(order=2, levels=3, reduction=4, structure=0))
    assert [size.reduction for size in plan.sizes] == [1, 2, 4]
    assert [(size.shape, size.levels) for size in plan.sizes] == [((13, 11), 3), ((7, 6), 3), ((4, 3), 3)]
    assert [plan.of(number) for number in range(3)] == plan.sizes
    assert [(plan.of(n).grid(n).shape, plan.of(n).grid(n).step) for n in range(3)] == [
        ((13, 11), 1),
        ((7, 6), 1),
        ((4, 3), 1),
    ]
    mean = pixels[:24, :24, 0].reshape(12, 2, 12, 2).mean((1, 3))
    assert (plan.sizes[1].sample.levels[0][0] == np.rint(mean)).all()


def test_the_coarsest_level_has_fewer_decimations_if_it_has_many_candidates(monkeypatch):
    assert [prepared().places(number).step for number in range(3)] == [1, 1, 1]
    monkeypatch.setattr(level_of_a_run, "ALL", 4 * (24 * 25 // 4**2))
    assert [prepared().places(number).step for number in range(3)] == [1, 1, 2]


def test_the_memory_that_is_asked_for(monkeypatch):
    asked = []
    monkeypatch.setattr(memory, "require", lambda machine, device, host, remedy: asked.append((device, host)))
    prepared()
    prepared(schedule="block", levels=1, structure=0)
    laid_out(REFERENCE, texture((24, 25), 3), (20, 23), mrf.Options(order=2, levels=1), 5)
    laid_out(REFERENCE, texture((24, 25), 1, np.float64), (20, 23), mrf.Options(order=2, levels=1, structure=0), 5)
    coarse, fine = (24 + 8) * (25 + 8), (24 + 2) * (25 + 2)  # with the margin of the coarsest level
    each = 14, 80  # for every channel and pixel of the sample; the structure channel is one
    assert asked == [
        (460 * (12 + 10) + coarse * (2 * each[0] + each[1]), 460 * (84 + 2 * 11) + 64 * coarse),
        (460 * (12 + 16) + fine * (each[0] + each[1]), 460 * (100 + 11) + 64 * fine),
        (460 * (12 + 14) + fine * (4 * each[0] + each[1]), 460 * (84 + 4 * 11) + 64 * fine),
        (460 * (12 + 8) + fine * (each[0] + each[1]), 460 * (84 + 22) + 64 * fine),
    ]


@pytest.mark.parametrize(
    ("most", "expected"),
    [
        (
            5,
            [
                ([[0, 3], [3, 5], [5, 5]], 3, False),
                ([[9, 10]], 4, False),
                ([[20, 25]], 5, False),
                ([[25, 26]], 5, True),
            ],
        ),
        (6, [([[0, 3], [3, 5], [5, 5], [9, 10]], 4, False), ([[20, 26]], 5, True)]),
        (99, [([[0, 3], [3, 5], [5, 5], [9, 10], [20, 26]], 5, True)]),
    ],
)
def test_as_many_steps_as_may_be_go_together(most, expected):
    found = list(parts(np.array([[0, 3], [3, 5], [5, 5], [9, 10], [20, 26]]), most))
    assert [(here.tolist(), begun, last) for here, begun, last in found] == expected


def test_kept_sites_are_swept_at_the_finest_of_several_levels_alone():
    for levels, sites, expected in ((3, "all", [2, 2, 2]), (2, "kept", [2, 0]), (1, "kept", [0])):
        run = prepared(levels=levels, free_sites=sites)
        assert [run.free_sweeps(number) for number in range(levels)] == expected


def test_a_site_always_cools():
    assert [prepared(xi=xi).level(0).relaxation.xi for xi in (-1e-9, -0.001, -0.0024, -1.5)] == [-1, -1, -2, -1536]


def test_a_level_with_few_candidates_evaluates_them_all(monkeypatch):
    for most, kind in ((599, CandidateList), (600, AllCandidates)):
        monkeypatch.setattr("simdtex.methods.mrf.level.EXHAUSTIVE", most)
        assert type(prepared(search="coherent").level(0).proposal) is kind


def test_a_saved_state_shares_no_memory_with_the_run():
    run = prepared(free_sweeps=0)
    _, state, _ = next(sweeps(run))
    saved = run.save(state)
    assert not any(np.shares_memory(saved[name], plane) for name, plane in state.field._asdict().items())


def test_grey_levels_are_as_fine_as_the_channels_and_neighbours_allow():
    pixels = texture((24, 25), 3, np.uint16)
    run = laid_out(REFERENCE, pixels, (20, 23), mrf.Options(order=64, levels=1), 5)
    neighbours = len(neighbourhood_offsets(64))
    assert run.sample.top == Sample(pixels, 3 * neighbours, 8).top == 2047 < Sample(pixels, neighbours, 8).top


@pytest.mark.parametrize("given", [{"search": "exact"}, {"array": "4x4"}])
def test_a_run_is_counted(given):
    given = {"order": 2, "levels": 3, "phases": 64, "edges": "reflect", "free_sweeps": 1} | given
    told, seen, parts = [], [], []
    run = prepared(**given)
    done = {2: [], 1: [], 0: []}
    for level, _, _ in sweeps(run, watch=lambda *part: told.append(part)):
        these = told[sum(map(len, parts)) :]
        done[level.number].append((these[0][1].active, [part for *_, part in these]))
        parts.append(these)
    _, output = simdtex.synthesize(
        texture((24, 25), seed=3), (20, 23), rng=5, device=REFERENCE, full_output=True, callback=seen.append, **given
    )
    assert [(p.level, p.sweep, p.phase, p.temperature_left, bool(p.stage)) for p in seen] == [
        (
            level.number,
            state.cooling + state.free + 1,
            "relax" if state.active else "free",
            state.temperature_sum / (1024 * level.grid.rows * level.grid.cols),
            part.last,
        )
        for level, state, part in told
    ]
    assert {progress.levels for progress in seen} == {3}
    statistics = output.statistics
    assert seen[-1].fraction > 0.9
    for report, (number, swept_parts) in zip(statistics["levels"], done.items(), strict=True):
        cooled = [those for active, those in swept_parts if active]
        every = [those for _, those in swept_parts]
        for counted, swept in ((report, every), (report["equilibrium"], cooled)):
            assert counted["sweeps"] == len(swept)
            assert counted["steps"] == sum(part.steps for those in swept for part in those)
            assert counted["relaxations"] == sum(part.sites for those in swept for part in those)
        assert [p.step for p in seen if p.level == number][-1] == report["steps"]
        assert report["candidates"] == 600
        few = given.get("search") != "exact" and number < 2
        assert (0 < report["weighed"] <= 13) if few else report["weighed"] == 600
        assert report["fma"] == round(report["weighed"] * report["relaxations"]) * 16 * 2
    assert statistics["options"]["levels"] == 3
    assert statistics["options"]["schedule"] == "coloring"
    own = {"device", "seed", "options", "seconds", "device_seconds", "levels", "use", "lattice", "light"}
    assert set(statistics) == own | ({"accounting"} if "array" in given else set())


def test_a_callback_sees_the_known_variables_of_a_site():
    sample, known, seen = texture((16, 16), 3), np.full((12, 12, 3), np.nan), []
    known[2, 4, 1] = 77
    options = {"order": 2, "levels": 2, "rng": 1, "device": REFERENCE, "channel_axis": -1}
    simdtex.synthesize(sample, (12, 12), known=known, callback=lambda p: seen.append((p.level, p.image())), **options)
    assert {int(image[2 >> level, 4 >> level, 1]) for level, image in seen} == {77}
    assert {level for level, _ in seen} == {0, 1}

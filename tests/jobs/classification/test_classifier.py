"""The classifier: features, exemplars, windows, the Potts field, what is learned, and the test for the unknown."""

import numpy as np
import pytest
import tolerances
from cases import REFERENCE, assert_same_bits, opencl, texture
from scipy import ndimage
from scipy.special import softmax
from scipy.stats import multivariate_normal

from simdtex.driver import drive
from simdtex.jobs.classification import model, patterns
from simdtex.jobs.classification.algorithm import Classification
from simdtex.jobs.classification.model import FEWEST_NEIGHBOURHOODS, MEANS, UNITS, Region, experts_of, learn, windowed
from simdtex.jobs.classification.operations import (
    EXEMPLAR_MULTIPLE,
    LOGS,
    TAPS,
    exemplars,
    features,
    gaussian,
    potts,
    stacked,
    window,
)
from simdtex.jobs.classification.options import Options
from simdtex.model.pictures import Pictures
from simdtex.model.scale import Scale

# -- The whole neighbourhoods that a classifier compares: values, and what is left of them with contrast compressed.

TOP = 4080


def made(machine, operation, *values):
    """The result of an operation, whose arrays are put on the machine."""
    values = (machine.put(one) if isinstance(one, np.ndarray) else one for one in values)
    return machine.get(operation(machine, *values))


def plain(levels, sites, offsets, contrast):
    """Neighbourhoods in float64, (B * N, S), mirrored beyond the border."""
    pad = np.pad(levels, ((0, 0), (8, 8), (8, 8)), "reflect") / 16
    row, col = np.divmod(sites, levels.shape[2])
    values = np.stack([pad[:, 8 + row + y, 8 + col + x] for y, x in offsets], 1)
    if contrast:
        z = values - values.mean(1, keepdims=True)
        size = np.sqrt((z * z).sum((0, 1)))
        # below 1 the size is taken for its square
        shown, inverse = np.where(size > 1, (size, 1 / np.maximum(size, 1)), (size * size, size * 0 + 1))
        values = z * 40 * np.log1p(shown / 5) * inverse
    return values.reshape(-1, len(sites))


@pytest.mark.parametrize("contrast", [False, True])
def test_the_reference_is_the_formula(contrast):
    rng = np.random.default_rng(1)
    for bands, rows, cols, spread in ((1, 1, 1, 8), (3, 7, 5, TOP), (2, 2, 7, 300), (1, 6, 1, 1), (2, 5, 6, 8)):
        levels = rng.integers(0, spread, (bands, rows, cols), np.uint16, True)
        levels += rng.integers(0, TOP - spread, (), np.uint16, True)
        sites = rng.integers(0, rows * cols, 40, np.int32)
        offsets = np.concatenate([np.zeros((1, 2), np.int32), rng.integers(-4, 4, (9, 2), np.int32, True)])
        found = made(REFERENCE, features, levels, sites, offsets, contrast)
        assert found.dtype == np.float32 and (found == np.rint(found)).all()
        assert abs(found - plain(levels, sites, offsets, contrast)).max() <= tolerances.HALF + tolerances.GAIN


# -- The least squared distance of a neighbourhood to the exemplars of each class.


def run_exemplars(machine, features, classes):
    known = stacked([np.asarray(one, np.float32) for one in classes]).on(machine)
    return made(machine, exemplars, features.astype(np.float32), known)


def test_the_reference_is_the_least_of_all_distances():
    rng = np.random.default_rng(2)
    for count, sites, low, high, sizes in ((1, 1, 0, 3, [1]), (40, 70, -180, 180, [11, 2, 4]), (9, 33, 0, 255, [5, 8])):
        features = rng.integers(low, high, (count, sites), endpoint=True)
        classes = [rng.integers(low, high, (size, count), endpoint=True) for size in sizes]
        found = run_exemplars(REFERENCE, features, classes)
        assert (found.dtype, found.shape) == (np.uint16, (len(classes), sites))
        for logs, known in zip(found, classes, strict=True):
            squared = ((features.T[:, None] - known[None]) ** 2).sum(-1).min(1)
            assert abs(logs - 256 * np.log1p(squared)).max() <= 0.501


@pytest.mark.parametrize("vector", [1, 4])
def test_the_width_of_a_vector_changes_nothing(machine, vector):
    rng = np.random.default_rng(3)
    features, known = rng.integers(0, 255, (9, 37)), [rng.integers(0, 255, (n, 9)) for n in (5, 8)]
    assert_same_bits(
        run_exemplars(opencl(machine.info, vector=vector), features, known), run_exemplars(REFERENCE, features, known)
    )


def test_the_widest_neighbourhoods_are_exact(machine):
    """14 bands of 9 raw values, at the ends of their range: no sum reaches 2**24."""
    features = np.stack([np.zeros(126), np.full(126, 255), np.arange(126) % 2 * 255], 1)
    known = [np.full((1, 126), 255), np.zeros((3, 126))]
    expected = 256 * np.log1p([[126 * 255**2, 0, 63 * 255**2], [0, 126 * 255**2, 63 * 255**2]])
    for m in (REFERENCE, machine):
        assert abs(run_exemplars(m, features, known) - expected).max() <= 0.501


def test_classes_are_filled_up_by_their_own_last_exemplar():
    known = stacked([np.ones((3, 2), np.float32), np.full((EXEMPLAR_MULTIPLE + 1, 2), 2, np.float32)])
    assert known.starts.tolist() == [0, EXEMPLAR_MULTIPLE, 3 * EXEMPLAR_MULTIPLE]
    assert (known.doubled[:EXEMPLAR_MULTIPLE] == -2).all() and (known.doubled[EXEMPLAR_MULTIPLE:] == -4).all()
    assert known.squares.tolist() == [2.0] * EXEMPLAR_MULTIPLE + [8.0] * 2 * EXEMPLAR_MULTIPLE


# -- Sums over a Gaussian window around each site, of the sites with one label alone.


def test_the_reference_is_a_correlation():
    rng = np.random.default_rng(3)
    for rows, cols, reach, valued in ((9, 20, 5, True), (1, 7, 2, False), (4, 1, 1, True)):
        taps = np.diff([0, *np.sort(rng.integers(0, TAPS, 2 * reach, endpoint=True)), TAPS]).astype(np.uint32)
        labels, owner = rng.integers(0, 3, (rows, cols), np.uint8), np.array([0, 2, 1], np.int32)
        values = rng.integers(0, 2**13, (3, rows, cols), np.uint16) if valued else None
        found = made(REFERENCE, window, labels, owner, taps, values)
        assert found.dtype == np.uint32
        for p, label in enumerate(owner):
            here = (labels == label) * (1 if values is None else values[p])
            for axis in (0, 1):
                here = ndimage.correlate1d(here.astype(np.float64), taps.astype(np.float64), axis, mode="mirror")
            assert (found[p] == here).all()


def test_the_largest_sums_fit_32_bits(machine):
    labels, owner, taps = np.zeros((40, 40), np.uint8), np.zeros(1, np.int32), gaussian(6.0)
    values = np.full((1, 40, 40), 2**13 - 1, np.uint16)
    for m in (REFERENCE, machine):
        assert (made(m, window, labels, owner, taps, values) == (2**13 - 1) * TAPS**2).all()
        assert (made(m, window, labels, owner, taps) == TAPS**2).all()
    draw = np.random.default_rng(1)  # columns of a vector, and those that are left
    case = draw.integers(0, 2, (9, 40), np.uint8), np.arange(2, dtype=np.int32), taps
    values = draw.integers(0, 2**13, (2, 9, 40), np.uint16)
    assert np.array_equal(*(made(m, window, *case, values) for m in (machine, REFERENCE)))


@pytest.mark.parametrize("sd", [0.5, 1.8, 33.3])
def test_taps_are_a_gaussian_in_whole_numbers(sd):
    taps = gaussian(sd).astype(np.int64)
    reach = len(taps) // 2
    assert taps.sum() == TAPS and (taps == taps[::-1]).all() and reach >= min(3 * sd, 1)
    density = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sd) ** 2)
    assert abs(taps - TAPS * density / density.sum()).max() <= 2
    spread = np.sqrt((taps * np.arange(-reach, reach + 1) ** 2).sum() / TAPS)
    assert spread == pytest.approx(sd, rel=0.06, abs=0.15)


# -- Iterated conditional modes of a Potts field.


@pytest.mark.parametrize("scale", [2, 2**18, 2**24])  # of the smallest, many are equal
def test_sites_take_the_first_of_the_greatest_energies(machine, scale):
    rng = np.random.default_rng(scale)
    for classes, weight in ((1, 0), (3, 1), (5, 112), (4, 1600)):
        evidence = rng.integers(-scale, scale, (classes, 6, 5), np.int32)
        votes = rng.integers(0, min(scale, 2**18), (classes, 6, 5), np.uint32, True)
        sites, labels = rng.permutation(30)[:20].astype(np.int32), rng.integers(0, classes, (6, 5), np.uint8)
        found = made(REFERENCE, potts, sites, evidence, votes, weight, labels.copy())
        for site in range(30):
            at = np.unravel_index(site, (6, 5))
            energy = [int(u[at]) + (weight * int(v[at])) // 16 for u, v in zip(evidence, votes, strict=True)]
            assert found[at] == (energy.index(max(energy)) if site in sites else labels[at])
        assert_same_bits(made(machine, potts, sites, evidence, votes, weight, labels), found)


# -- The classifier: what it learns of its classes, the evidence, the field of labels, and the test for the unknown.


def stripes(shape, turned=False, seed=0):
    row, col = np.indices(shape)
    wave = 100 + 60 * np.sin((row if turned else col) * 1.3) + np.random.default_rng(seed).normal(0, 8, shape)
    return np.clip(np.rint(wave), 0, 255).astype(np.uint8)


def whole(*pictures, **more):
    return [Region(one[..., None] if one.ndim == 2 else one, np.ones(one.shape[:2], bool), **more) for one in pictures]


CLASSES = [whole(stripes((40, 40))), whole(stripes((40, 44), True))]


def planned(picture, classes=CLASSES, **options):
    names = {c + 1: f"class {c}" for c in range(len(classes))}
    return Classification(picture[..., None], np.zeros(picture.shape, bool), classes, names, Options(**options))


def run_classifier(picture, classes=CLASSES, machine=REFERENCE, seed=1, **options):
    labels, output = drive(planned(picture, classes, **options), machine, seed)
    return labels[..., 0], output


def halves(rows=36):
    """Both stripes side by side, and where which is."""
    picture = np.hstack([stripes((rows, 30), seed=5), stripes((rows, 30), True, seed=6)])
    return picture, np.repeat([1, 2], 30)[None].repeat(rows, 0)


def test_every_level_has_two_experts_whose_weights_add_up():
    found = experts_of(Options(), 3)
    assert [(one.level, one.contrast, len(one.offsets)) for one in found] == [
        (level, contrast, 13 if contrast else 9) for level in range(3) for contrast in (False, True)
    ]
    assert [one.reach for one in found] == [1, 2, 2, 4, 4, 8]
    weights = np.array([one.factor for one in found]) * 256 / 2**18
    assert weights.sum() == pytest.approx(2, abs=2e-3)
    assert weights == pytest.approx(2 * np.outer([1, 0.3, 0.09], [0.35, 0.65]).ravel() / 1.39, abs=2e-3)
    assert (found[0].offsets[0] == 0).all() and abs(found[-1].offsets).max() == 8


def distances(picture, known, expert):
    """Of every site to the nearest of all whole neighbourhoods of a picture, by formula."""

    def neighbourhoods(image):
        values = image * 16.0
        if expert.level:
            for axis in (0, 1):
                taps = gaussian(model.SMOOTHING[expert.level]) / 512
                values = ndimage.correlate1d(values, taps, axis, mode="mirror")
            values = np.floor(values + 0.5)
        features = plain(values[None], np.arange(image.size), expert.offsets, expert.contrast)
        return np.floor(features.T + 0.5).reshape(*image.shape, -1)

    inside = (slice(expert.reach, -expert.reach),) * 2
    mine, theirs = neighbourhoods(picture), neighbourhoods(known)[inside].reshape(-1, len(expert.offsets))
    return ((mine[..., None, :] - theirs) ** 2).sum(-1).min(-1)


ALIKE = [whole(stripes((16, 16), seed=1)), whole(stripes((40, 40), seed=2))]
"""One texture, of which one class shows nine times as much as the other."""


@pytest.mark.parametrize(("classes", "smoothing"), [(CLASSES, 0.0), (ALIKE, 1.5)], ids=["apart", "alike"])
def test_labels_without_a_field_are_those_of_the_greatest_evidence(classes, smoothing):
    picture, given = halves(20)[0][:, 20:40], {"levels": 1, "exemplars": 2**14, "typical": 0.3, "smoothing": smoothing}
    plan = planned(picture, classes, weight=0.0, unknown=0.0, sweeps=0, **given)
    labels = drive(plan, REFERENCE, 1)[0][..., 0]
    learned = learn(REFERENCE, classes, list(plan.names.values()), plan.options, 1)
    energy, share = [], np.array([0.35, 0.65])
    patterned = plan.on(REFERENCE, 1)._patterned(0, len(picture))
    for c, (region,) in enumerate(classes):
        logs = [
            np.log1p(distances(picture, region.pixels[..., 0], one)) - 0.3 * learned.own[c, e]
            for e, one in enumerate(learned.experts)
        ]
        fewer = 2 * np.log(learned.counts[c] / max(learned.counts)) / np.array([9, 13])
        single = -(np.tensordot(share, logs, 1) + share @ fewer) / model.TEMPERATURE
        energy.append(single - patterns.WEIGHT * patterned[c] / LOGS)
    gap = energy[1] - energy[0]
    for axis in (0, 1) if smoothing else ():
        gap = ndimage.correlate1d(gap, gaussian(smoothing) / TAPS, axis, mode="mirror")
    clear = abs(gap) > 0.05  # logarithms are rounded to 1/256, and divided by the temperature
    assert clear.mean() > 0.8
    assert (labels == np.where(gap > 0, 2, 1))[clear].all()


def test_a_texture_that_was_not_shown_is_unknown():
    picture, truth = halves(60)
    picture[20:, :30] = np.random.default_rng(9).integers(0, 255, (40, 30))
    labels, output = run_classifier(picture, coupling=4.0, window=5.0)
    inside = np.zeros(picture.shape, bool)
    inside[26:, :24] = True
    assert (labels[inside] == 0).all()
    assert (labels == truth)[~ndimage.binary_dilation(truth * 0 + inside, iterations=14)].mean() > 0.9
    assert (output.fit[inside].max(-1) < 0.05).all()
    assert (run_classifier(picture, coupling=4.0, window=5.0, unknown=0.0)[0] > 0).all()


def test_known_texture_is_rarely_unknown():
    """Noise does not drift, so the test may call few windows unknown, and the fit is not piled up at 0."""
    rng = np.random.default_rng(2)
    noise = [np.clip(rng.normal(120, 30, (64, 64)), 0, 255).astype(np.uint8) for _ in range(3)]
    labels, output = run_classifier(np.hstack(noise[1:]), [whole(noise[0])], unknown=0.1)
    assert (labels == 0).mean() <= 0.1
    assert np.median(output.fit) > 0.1


def test_any_schedule_of_few_steps_relaxes_the_labels():
    picture, truth = halves()
    labels, output = run_classifier(picture, schedule="random-subset:0.5", unknown=0.0)
    assert (labels == truth).mean() > 0.97
    assert output.statistics["options"]["schedule"] == "random-subset"


def test_the_field_ends_when_no_label_changes():
    changed = run_classifier(halves()[0], sweeps=500)[1].statistics["changed"]
    assert len(changed) < 500 and changed[-1] == 0 and all(changed[:-1])
    assert run_classifier(halves(12)[0], sweeps=0)[1].statistics["changed"] == []


def test_a_small_sample_has_fewer_levels_and_a_tiny_one_is_refused():
    picture, small = halves()[0], whole(stripes((12, 12)))
    assert run_classifier(picture, [small])[1].statistics["options"]["levels"] == 1
    large = whole(stripes((70, 70)))
    assert run_classifier(picture, [large])[1].statistics["options"]["levels"] == 2
    with pytest.raises(
        ValueError, match=f"'class 0' has 4 whole neighbourhoods of 5x5 pixels, and {FEWEST_NEIGHBOURHOODS} are needed"
    ):
        run_classifier(picture, [whole(stripes((6, 6)))])


def test_whole_neighbourhoods_lie_within_a_mask_and_centres_of_strokes_alone_do():
    sites = np.zeros((20, 20), bool)
    sites[5:12, 4:12] = True
    region = Region(np.zeros((20, 20, 1), np.uint8), sites)
    inner = np.zeros_like(sites)
    inner[7:10, 6:10] = True
    assert (model._centres(region, 2) == inner).all()
    assert (model._centres(region._replace(whole=False), 2) == sites).all()
    edge = region._replace(sites=np.ones((20, 20), bool), whole=False)
    assert model._centres(edge, 2).sum() == 16 * 16


def taught(scale, experts, regions, seed=1, **options):
    return model._Class(REFERENCE, scale, experts, Options(**{"exemplars": 2**16} | options), seed, 0, regions)


def test_a_stroke_is_learned_from_what_is_around_it_alone():
    """Its exemplars are those of the whole picture, whatever lies further away."""
    picture = texture((90, 100))
    sites = np.zeros(picture.shape, bool)
    sites[40:60, 50:70] = True
    experts = experts_of(Options(), 3)
    found = []
    for one in (picture, np.where(ndimage.binary_dilation(sites, np.ones((3, 3)), 13), picture, 255 - picture)):
        region = Region(one[..., None], sites, whole=False)
        known = taught(Scale(Pictures((one[..., None],)), 512), experts, [region])
        found.append([known.draw(expert) for expert in experts])
        assert known.regions[0].sites.sum() == 400 and known.regions[0].sites.shape == (46, 46)
    assert all((a == b).all() for a, b in zip(*found, strict=True))


def test_exemplars_of_a_judged_part_and_of_validation_are_not_drawn():
    values = np.repeat(np.arange(40, dtype=np.uint8), 40).reshape(40, 40) * 3
    regions = [*whole(values), *whole(np.full((20, 20), 200, np.uint8), judged=True)]
    expert = experts_of(Options(), 1)[0]
    given = Scale(Pictures(tuple(one.pixels for one in regions)), 512), [expert], regions
    upper = np.zeros((40, 40), bool)
    upper[:20] = True
    drawn = taught(*given).draw(expert)
    assert len(drawn) == 38 * 38 and drawn.max() < 200
    assert taught(*given).draw(expert, (0, upper))[:, 0].min() == 60
    few, again, other = (taught(*given, seed, exemplars=50).draw(expert) for seed in (1, 1, 2))
    assert len(few) == 50
    assert (few == again).all() and (few != other).any()


def test_a_validation_picture_widens_what_is_known():
    picture = stripes((40, 40), seed=4)
    brighter = np.clip(picture.astype(int) + 25, 0, 255).astype(np.uint8)
    plain = run_classifier(brighter, [whole(stripes((40, 40)))])[1].fit
    more = [*whole(stripes((40, 40))), *whole(np.clip(stripes((40, 40), seed=7) + 25, 0, 255), judged=True)]
    assert plain.max() < 0.05 < run_classifier(brighter, [more])[1].fit.min()


def test_means_over_a_window_are_of_the_sites_alone():
    rng = np.random.default_rng(0)
    logs, sites = rng.integers(0, 4000, (2, 12, 15)).astype(np.uint16), rng.random((12, 15)) < 0.5
    taps = gaussian(2.0)
    everywhere = np.ones_like(sites)
    means, found = windowed(REFERENCE, logs, sites, taps, everywhere)
    assert (windowed(REFERENCE, logs, sites, taps, sites)[0] == means.reshape(2, 12, 15)[:, sites]).all()

    def summed(plane):
        for axis in (0, 1):
            plane = ndimage.correlate1d(plane.astype(np.float64), taps.astype(np.float64), axis, mode="mirror")
        return plane

    weight = summed(sites)
    assert found.all()
    for mean, plane in zip(means, logs, strict=True):
        assert abs(mean.reshape(12, 15) - MEANS * summed(plane * sites) / weight).max() <= 0.5
    alone = np.zeros((40, 40), bool)
    alone[0, 0] = True
    near = windowed(REFERENCE, np.full((1, 40, 40), 9, np.uint16), alone, taps, np.ones_like(alone))
    assert (near[0][0] == np.where(near[1], 9 * MEANS, 0)).all() and 1 < near[1].sum() < 1600


def test_the_variance_of_a_class_has_its_share_that_of_all_and_the_drift():
    rng = np.random.default_rng(3)
    selves = [
        model.OwnDistances(np.zeros(2), rng.normal(5, 3 * scale, (2, 50)), rng.normal(0, scale, (parts, 2)), None)
        for scale, parts in ((0.2, 4), (0.4, 4), (0.1, 1))
    ]
    nulls, freedom = model._nulls(selves)
    within = [one.windows.var(1, ddof=1) for one in selves]
    drift = (selves[0].parts.var(0, ddof=1) + selves[1].parts.var(0, ddof=1)) / 2
    for null, one, own in zip(nulls, selves, within, strict=True):
        assert null.variance == pytest.approx(0.7 * own + 0.3 * np.mean(within, 0) + drift + 1e-4, rel=1e-9)
        assert null.mean == pytest.approx(one.windows.mean(1))
    assert freedom == 6


@pytest.mark.parametrize("bands", [1, 3])
def test_patterns_are_uniform_rings_by_the_number_of_greater_neighbours(bands):
    rng = np.random.default_rng(4)
    levels = rng.integers(0, 4, (2, bands, 9, 11)).astype(np.uint16)
    found = patterns.patterns(list(levels), slice(None))
    ring = [(-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1)]
    for level, place in np.ndindex(2, 9 * 11):
        row, col = divmod(place, 11)
        share = np.zeros(patterns.PATTERNS)
        for plane in levels[level]:
            padded = np.pad(plane, 2, "reflect")
            bits = [padded[row + 2 + y * 2**level, col + 2 + x * 2**level] >= plane[row, col] for y, x in ring]
            uniform = sum(a != b for a, b in zip(bits, np.roll(bits, 1), strict=True)) <= 2
            share[sum(bits) if uniform else 9] += patterns.OCCURRENCE // bands
        assert (found[patterns.PATTERNS * level :][: patterns.PATTERNS, row, col] == share).all()
    assert np.array_equal(patterns.patterns(list(levels), slice(2, 7)), found[:, 2:7])


def test_the_evidence_of_patterns_is_that_of_normal_densities():
    """Against SciPy's densities with the covariance of the docs: .7 own, .3 of all, and ten times the drift."""
    rng = np.random.default_rng(5)
    mixed = rng.normal(0, 0.05, (3, 4, 4)) + 0.1 * np.eye(4)
    windows = [0.4 + 0.1 * c + mix @ rng.normal(0, 0.3, (4, 200)) for c, mix in enumerate(mixed)]
    parts = [one[:, :4].T for one in windows[:2]] + [windows[2][:, :1].T]
    frequencies = np.concatenate([one[:, :100] for one in windows], 1) ** 2 - 0.02 + rng.uniform(0, 0.05, (4, 300))
    found = patterns.Discriminant.of(windows, parts).logarithms(frequencies * patterns.OCCURRENCE) / LOGS
    own, drift = [np.cov(one) for one in windows], (np.cov(parts[0].T) + np.cov(parts[1].T)) / 2
    logs = []
    for mean, one in zip(windows, own, strict=True):
        covariance = 0.7 * one + 0.3 * sum(own) / 3 + 10 * drift
        covariance += np.diag(1e-3 * np.diag(covariance) + 2.0**-24)
        logs.append(multivariate_normal(mean.mean(1), covariance).logpdf(np.sqrt(frequencies + 0.02).T) / 8)
    expected = np.log(1.05) - np.log(softmax(logs, 0) + 0.05)
    assert found == pytest.approx(expected, abs=0.01)
    assert found.max() > 3 and np.ptp(found.argmin(0)) == 2


def test_patterns_weigh_in_the_evidence():
    """The logarithms of probabilities by patterns times 0.35, on all rows of several strips."""
    run = planned(halves()[0]).on(REFERENCE, 1)
    strips = [run._patterned(first, first + 12) for first in (0, 12, 24)]
    assert np.array_equal(run._patterned(0, 36), np.concatenate(strips, 1))
    logs = np.zeros((len(run.model.experts) + 1, 2, 36, 60), np.uint16)
    logs[-1] = LOGS
    without = run.model.offsets[:, None, None]
    assert (run._single(logs) - without == -LOGS * round(0.35 * UNITS / LOGS)).all()


def test_sites_whose_neighbours_lie_beyond_their_segment_are_not_judged():
    """At the border of two known textures they fit neither, and a seam of unknown pixels would run along it."""
    found = planned(halves()[0]).on(REFERENCE, 1)
    reach = found._size // 2
    own = np.arange(60)[None] < np.full((36, 1), 30)
    state = found.begin()._replace(labels=np.where(own, 0, 1).astype(np.uint8))
    fits = []
    for seam in (1000, 4000):
        state.logs[:, 0] = 1000
        state.logs[:, 0, :, 30 - reach : 30] = seam
        fits.append(found._fits(state)[0][0, :, :30])
    assert (fits[0] == fits[1]).all()
    narrow = state._replace(labels=np.where(abs(np.arange(60) - 29) < 2, 0, 1)[None].repeat(36, 0).astype(np.uint8))
    assert found._fits(narrow)[0][0, :, 28:31].max() < 0.01, "it has no other sites"


def test_the_fit_compares_measures_with_their_variances():
    """F of the mean of squared differences, with 3 degrees of freedom for each sample."""
    learned = learn(REFERENCE, CLASSES, ("a", "b"), Options(), 1)
    assert learned.freedom == 6
    null, gap = learned.nulls[0], np.linspace(0, 1, len(learned.nulls[0].mean))
    distance = null.distance(np.array([null.mean, null.mean + gap]).T)
    assert distance == pytest.approx([0, (gap**2 / null.variance).mean()])


@pytest.mark.parametrize(("dtype", "channels"), [(np.uint16, 3), (np.float32, 1)])
def test_labels_fits_and_probabilities_have_the_references_bits(machine, dtype, channels):
    pictures = [texture(shape, channels, dtype, seed) for shape, seed in [((20, 22), 0), ((18, 18), 1), ((17, 23), 2)]]
    classes = [whole(pictures[1]), whole(pictures[2][::-1].copy())]
    plan = Classification(
        pictures[0], np.zeros((20, 22), bool), classes, {1: "a", 2: "b"}, Options(exemplars=60, coupling=2.0)
    )
    found, output = drive(plan, machine, 3)
    expected, theirs = drive(plan, REFERENCE, 3)
    assert (found == expected).all() and found.dtype == np.uint8
    assert (output.fit == theirs.fit).all()
    assert (output.probability == theirs.probability).all()
    assert output.statistics["changed"] == theirs.statistics["changed"]

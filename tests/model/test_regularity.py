"""The lattice of a regular sample, how it fits a torus, and the phases that guide an output."""

import numpy as np
import pytest
from cases import BASES, REFERENCE, spots, texture
from numpy.testing import assert_allclose
from scipy import ndimage

import simdtex
from simdtex.model import regularity
from simdtex.model.pictures import Pictures
from simdtex.model.regularity import Lattice, aligned, harmonics, parse_lattice, phases, plain, regular
from simdtex.options import resolve


def found_in(picture, known=None):
    """The lattice of one picture (rows, cols, channels)."""
    pictures = Pictures((picture,), None if known is None else (~known,))
    (plane,), (mask,) = plain(pictures)
    return regular(plane, mask)


def same_lattice(one, other, within):
    """Whether the vectors of each lattice are whole combinations of the other's, but for pixels."""
    there = np.asarray(one) @ np.linalg.inv(np.asarray(other))
    return abs(round(np.linalg.det(there))) == 1 and np.abs((there - np.rint(there)) @ np.asarray(other)).max() < within


@pytest.mark.parametrize("name", BASES)
def test_the_lattice_of_a_regular_picture_is_found(name):
    found = found_in(spots(BASES[name]))
    assert same_lattice(found.basis, BASES[name], 0.5 if name == "hexagons" else 0.25), found


def bars(shape, period, seed=1):
    """Bright bars 8 pixels wide and dark lines between them, along both axes, slightly turned, in noise."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    grey = 120.0
    for t in (y - 0.01 * x, x + 0.01 * y):
        grey = grey + np.where(t % period < 8, 60, 0) - np.where((t + 17) % period < 3, 40, 0)
    return (grey + np.random.default_rng(seed).normal(0, 8, shape)).clip(0, 255).astype(np.uint8)


def planks(shape, width, length, shift, seed=1):
    """Planks of different greys between dark joints; each row is moved by a part ``shift`` of a length."""
    rng, (y, x) = np.random.default_rng(seed), np.indices(shape)
    row = y // width
    along = x + row % shift * length // shift
    grey = rng.normal(130, 12, (shape[0] // width + 1, shape[1] // length + 3))[row, along // length]
    grey[(y % width < 3) | (along % length < 3)] = 40
    return (grey + rng.normal(0, 6, shape)).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("picture", "basis"),
    [
        (bars((300, 300), 100), ((100, -1), (1, 100))),
        (planks((256, 256), 24, 120, 3), ((24, -40), (24, 80))),
        (planks((192, 256), 32, 90, 2), ((32, 45), (32, -45))),
    ],
    ids=["bars", "planks", "wide planks"],
)
def test_ridges_of_the_autocorrelation_mislead_nobody(picture, basis):
    """All lags of whole rows are alike in planks, and neighbours of a node in bars, so false lattices are strong."""
    assert same_lattice(found_in(picture[..., None]).basis, basis, 0.5)


def jog(picture, period, width=8):
    """The largest distance in pixels of a bright vertical bar, the mean of nine rows each, from a straight line."""
    picture = picture - np.median(picture, 1, keepdims=True)
    strength = ndimage.uniform_filter(picture.astype(float), (9, width), mode="wrap")
    worst, step = 0.0, picture.shape[1] / round(picture.shape[1] / period)
    first = strength.mean(0)[: round(step)].argmax()
    for left in np.arange(first, picture.shape[1] - 1, step):
        near = (round(left) + np.arange(-10, 11)) % picture.shape[1]
        row, at = np.arange(len(picture)), strength[:, near].argmax(1)
        worst = max(worst, np.abs(at - np.polyval(np.polyfit(row, at, 1), row)).max())
    return worst


@pytest.mark.slow
def test_bars_and_joints_stay_straight(any_device):
    cloth, wall = bars((132, 132), 44), 255 - planks((96, 132), 24, 44, 2)
    made = [
        np.asarray(simdtex.synthesize(one, shape, rng=1, device=any_device), float)
        for one, shape in ((cloth, (176, 176)), (wall, (144, 132)))
    ]
    assert max(jog(cloth, 44), jog(wall.T, 24, 3)) < 1
    assert max(jog(made[0], 44), jog(made[0].T, 44), jog(made[1].T, 24, 3)) <= 2


@pytest.mark.parametrize("how", ["colour", "float", "gaps", "noisy"])
def test_it_is_found_in_pictures_of_every_kind(how):
    picture = spots(BASES["oblique"], channels=3 if how == "colour" else 1, noise=40 if how == "noisy" else 20)
    known = None
    if how == "float":
        picture = picture / np.float32(255) - 3
    if how == "gaps":
        known = np.ones(picture.shape[:2], bool)
        known[30:60, 20:70] = False
        picture = np.where(known[..., None], picture, 0).astype(np.uint8)
    assert same_lattice(found_in(picture, known).basis, BASES["oblique"], 0.25)


def test_an_irregular_a_flat_or_a_small_picture_has_none():
    for smooth, seed in ((0, 0), (0, 1), (1, 2), (2, 3), (4, 4)):
        noise = ndimage.gaussian_filter(np.random.default_rng(seed).random((80, 80)), smooth)
        assert found_in((noise / noise.max() * 255).astype(np.uint8)[..., None]) is None
    for picture in (np.full((40, 40, 1), 7), spots(BASES["weave"])[:31], np.zeros((1, 50, 2))):
        assert found_in(picture.astype(np.uint8)) is None


def test_the_lattice_of_stripes_has_their_period():
    y, x = np.mgrid[:90, :96]
    stripes = 120 + 100 * np.sin(2 * np.pi * (y + 0.5 * x) / 9) + np.random.default_rng(1).normal(0, 20, y.shape)
    along = found_in(stripes.clip(0, 255).astype(np.uint8)[..., None]).basis @ (1 / 9, 0.5 / 9)
    assert_allclose(along, np.rint(along), atol=0.03)
    assert along.any()


def test_the_autocorrelation_is_exact():
    rng = np.random.default_rng(2)
    picture, known = rng.integers(0, 256, (11, 14)), rng.random((11, 14)) < 0.8
    found = regularity.autocorrelation(picture, known)
    centred = picture - round(int(picture[known].sum()) / int(known.sum()))

    def mean(dy, dx):
        pairs = [
            centred[i, j] * centred[i + dy, j + dx]
            for i in range(11)
            for j in range(14)
            if 0 <= i + dy < 11 and 0 <= j + dx < 14 and known[i, j] and known[i + dy, j + dx]
        ]
        return sum(map(int, pairs)) / len(pairs)

    m, n = found.reach
    assert (m, n) == (6, 7)
    for dy, dx in ((0, 0), (1, 0), (3, -2), (-6, 3)):
        assert found.values[m + dy, n + dx] == mean(dy, dx) / mean(0, 0)


def test_pairs_are_reduced_to_the_shortest_vectors_of_their_lattice():
    rng = np.random.default_rng(4)
    for pair in rng.integers(-9, 9, (20, 2, 2)):
        area = abs(round(np.linalg.det(pair)))
        if not area:
            continue
        (one, other), *more = regularity.reduced(pair[None])
        assert not more and abs(one[0] * other[1] - one[1] * other[0]) == area
        vectors = [i * pair[0] + j * pair[1] for i in range(-15, 16) for j in range(-15, 16) if (i, j) != (0, 0)]
        assert (one**2).sum() == min((vector**2).sum() for vector in vectors)
        assert 2 * abs(one @ other) <= (one**2).sum() <= (other**2).sum()


@pytest.mark.parametrize("name", BASES)
@pytest.mark.parametrize("shape", [(256, 256), (101, 140)])
def test_a_torus_holds_the_fitted_lattice(name, shape):
    lattice = Lattice(*BASES[name])
    fitted = lattice.fitted(shape)
    assert fitted is not None
    nodes = np.diag(shape) @ np.linalg.inv(fitted.basis)
    assert_allclose(nodes, np.rint(nodes), atol=1e-9)
    assert np.linalg.norm(np.linalg.inv(lattice.basis) @ fitted.basis - np.eye(2)) <= regularity.MOST_STRAIN
    wanted = lattice.fitting(shape)
    better = lattice.fitted(wanted)
    assert all(0.7 * side <= other <= 1.3 * side for side, other in zip(shape, wanted, strict=True))
    strains = [np.linalg.norm(np.linalg.inv(lattice.basis) @ one.basis - np.eye(2)) for one in (better, fitted)]
    assert strains[0] <= max(0.03, strains[1])


def test_what_does_not_fit_is_left_alone_or_refused():
    assert Lattice((11.5, -16), (11.5, 16)).fitting((230, 256)) == (230, 256), "whole cells need no other size"
    lattice = Lattice((20, 0), (0, 20))
    assert lattice.fitted((30, 200)) is None
    pictures = Pictures((spots(((20, 0), (0, 20))),))
    assert phases(pictures, (30, 200), True, "auto") is None
    assert phases(pictures, (30, 200), False, "auto") is not None
    with pytest.raises(ValueError, match=r'^the lattice fits a torus of 30x200 .* shape \d+x200, or boundary="open"$'):
        phases(pictures, (30, 200), True, lattice)


def test_harmonics_are_the_amplitudes_of_the_shortest_waves():
    y, x = np.mgrid[:32, :24] / 8
    for n, (k, m) in enumerate(((0, 1), (1, 0), (1, 1), (1, -1))):
        picture = np.rint(100 * np.cos(2 * np.pi * (k * y + m * x))).astype(np.int64)
        found = np.abs(harmonics(picture, np.ones(picture.shape, bool), Lattice((8, 0), (0, 8))))
        assert_allclose(found / picture.size, 50 * (np.arange(4) == n), atol=1)


@pytest.mark.parametrize("moved", [(5.2, 9.1), (-4.1, 2.2)])
def test_pictures_are_brought_into_phase(moved):
    lattice = Lattice((11, 2), (-3, 13))
    one, other = (plain(Pictures((spots(lattice[:2], origin=o),)))[0][0] for o in ((0, 0), moved))
    known = np.ones(one.shape, bool)
    found = aligned(lattice, harmonics(one, known, lattice), harmonics(other, known, lattice))
    apart = Lattice(*lattice[:2], tuple(map(float, moved))).phases(*np.array(found.origin))
    assert_allclose(apart, np.rint(apart), atol=1 / 64 + 0.01)


def test_every_picture_of_a_sample_has_its_own_phase_and_the_largest_gives_the_lattice():
    basis, moved = ((11.2, 1.8), (-3.1, 12.7)), (5.2, 7.1)
    pictures = Pictures((spots(basis, (60, 64), moved), spots(basis)))
    found = phases(pictures, (50, 70), False, "auto")
    assert same_lattice(found.output.basis, basis, 0.25)
    small, large = found.pictures
    assert large == found.output
    apart = large.phases(np.array(small.origin[0]), np.array(small.origin[1])) - Lattice(*large[:2]).phases(
        *map(np.array, moved)
    )
    assert_allclose(apart, np.rint(apart), atol=0.06)


@pytest.mark.parametrize("from_sample", [False, True])
def test_known_pixels_fix_the_phase_of_the_output(from_sample):
    basis, corner = ((11.2, 1.8), (-3.1, 12.7)), (5, 8)
    whole = spots(basis, (120, 130))
    sample = whole[corner[0] : 100, corner[1] : 110]
    known = np.zeros((40, 50), bool)
    known[:15, :30] = True
    place = np.full((40, 50, 2), -1)
    place[known] = np.argwhere(known) - corner + (22, 8)  # two lattice vectors less a little
    values = whole[22 : 22 + 40, 8 : 8 + 50] if from_sample else whole[:40, :50]
    found = phases(Pictures((sample,)), (40, 50), False, "auto", (values, known, place if from_sample else None))
    (own,) = found.pictures
    by = np.subtract(corner, (22, 8)) if from_sample else corner
    apart = own.phases(*(np.array(o) for o in np.subtract(found.output.origin, by)))
    assert_allclose(apart, np.rint(apart), atol=1e-4 if from_sample else 0.06)


def test_vectors_are_given_in_several_forms():
    for value in ("12,0.5,-1,15", " 12, 0.5 ,-1,15", (12, 0.5, -1, 15), ((12, 0.5), (-1, 15)), [[12, 0.5], [-1, 15]]):
        assert parse_lattice(value) == Lattice((12, 0.5), (-1, 15))
        resolve(simdtex.methods.mrf.Options, "synth", {"lattice": value})
    assert (parse_lattice("auto"), parse_lattice("none")) == ("auto", None)
    for value, error, match in (
        ("square", ValueError, '^lattice is .square.; give "auto", "none", or two vectors in pixels'),
        ("1,2,3", ValueError, "^lattice is '1,2,3'; give"),
        (((1, 2), (3, "x")), ValueError, "; give"),
        ((1, None, 2, 3), ValueError, "; give"),
        (7, TypeError, "^lattice must be a text or two vectors, not 7; give"),
        ("8,8,4,4", ValueError, r"^the cell of the lattice '8,8,4,4' has 0 pixels; give 4 or more$"),
        ("8,inf,4,4", ValueError, "; give 4 or more$"),
    ):
        with pytest.raises(error, match=match):
            parse_lattice(value)


BRICK = spots(((8, -6), (8, 6)), (48, 44), noise=30)


def in_phase(source, site, lattice, fitted, within):
    """The share of sites (2, n) that are from their own place in a cell, within a part of it."""
    apart = lattice.phases(*np.moveaxis(source, -1, 0).reshape(2, -1)) - fitted.phases(*site)
    return (np.abs(apart - np.rint(apart)) <= within).all(0).mean()


@pytest.mark.slow
def test_a_regular_sample_is_repeated_without_a_fault():
    shape, lattice = (32, 36), found_in(BRICK)
    share, sites = {}, np.indices(shape).reshape(2, -1)
    for how in ("auto", "none"):
        options = {"lattice": how, "order": 8, "device": REFERENCE, "full_output": True}
        runs = [simdtex.synthesize(BRICK[..., 0], shape, rng=rng, **options)[1] for rng in range(2)]
        share[how] = np.mean([in_phase(one.source, sites, lattice, lattice.fitted(shape), 0.125) for one in runs])
    assert share["auto"] > 0.95 > 0.5 > share["none"]


def test_a_run_says_how_much_its_lattice_is_deformed_and_what_fits():
    how = {"rng": 3, "order": 2, "xi": -20.0, "free_sweeps": 0, "device": REFERENCE, "full_output": True}
    runs = ((34, 48), {}), ((32, 48), {}), ((34, 48), {"boundary": "open"}), ((34, 48), {"lattice": "none"})
    lattices = [
        simdtex.synthesize(BRICK[..., 0], shape, **how | {"lattice": "8,-6,8,6"} | more)[1].statistics["lattice"]
        for shape, more in runs
    ]
    assert lattices[0]["vectors"] == [[8.5, -6], [8.5, 6]]
    assert lattices[0]["deformation"] == pytest.approx(0.0625)
    assert [one and one["fitting"] for one in lattices] == [[32, 48], None, [32, 48], None]
    best = lattices[0] | {"fitting": None}
    assert [regularity.lattice_sentence(one) for one in (best, *lattices)] == [
        "The sample's pattern is deformed by 6% to fit this size.",
        "The sample's pattern is deformed by 6% to fit this size; 48x32 pixels fit it better.",
        *[""] * 3,
    ]


@pytest.mark.slow
def test_a_hole_is_filled_in_phase():
    hole = np.zeros(BRICK.shape[:2], bool)
    hole[16:32, 12:30] = True
    lattice, share = found_in(BRICK, ~hole), {}
    for how in ("auto", "none"):
        _, output = simdtex.fill(BRICK[..., 0], hole, rng=2, lattice=how, order=8, device=REFERENCE, full_output=True)
        share[how] = in_phase(output.source[hole], np.nonzero(hole), lattice, lattice, 0.2)
    assert share["auto"] > 0.98 > 0.95 > share["none"]


def test_categories_and_densities_have_none():
    options = simdtex.methods.mrf.Options
    pictures = Pictures((texture((12, 12), 1),))
    for given in ({"categorical": True}, {"pixel": "density", "relaxation": "gibbs"}):
        chosen = options(lattice="4,0,0,4", **given)
        assert chosen.resolved(chosen.of(pictures)).lattice == "none"


@pytest.mark.slow
def test_seeds_do_not_make_one_picture():
    """Of all candidates in phase some are nearer to the phase than others, which is no reason to take only them."""
    rng, sample = np.random.default_rng(3), spots(BASES["square"], (96, 96))[..., 0].astype(int)
    sample = np.clip(sample + rng.integers(-30, 30, (8, 8)).repeat(12, 0).repeat(12, 1), 0, 255).astype(np.uint8)
    options = {"full_output": True, "free_sweeps": 0}
    made = [simdtex.synthesize(sample, (108, 120), rng=seed, **options)[1] for seed in range(6)]
    assert all(one.statistics["lattice"] for one in made)
    same = [(a.source == b.source).all(-1).mean() for a, b in zip(made[::2], made[1::2], strict=True)]
    assert np.mean(same) < 0.2

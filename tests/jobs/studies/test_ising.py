"""The Ising model: its exact energy, heat-bath runs, which schedules sample it, and ``simdtex schedules --ising``."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, ising, opencl
from commands import run
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy import stats

from simdtex import random
from simdtex.figures.tables import print_table
from simdtex.jobs.studies import ising as exact
from simdtex.jobs.studies.ising import CRITICAL, Chains, Finding, findings
from simdtex.jobs.studies.operations import ising_commit, ising_relax, ising_sequence
from simdtex.jobs.studies.report import _sublattice, ising_tables
from simdtex.maspar.algorithm import heat_bath_chances
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.schedules import Info, Synchronous, Watched

# -- The exact energy of the Ising model, against every state of small lattices.


def by_counting(temperature, rows, cols):
    """Energy per spin of a torus, over all 2**(rows cols) states."""
    bits = np.arange(2 ** (rows * cols))[:, None] >> np.arange(rows * cols) & 1
    s = 2 * bits.reshape(-1, rows, cols) - 1
    energy = -sum((s * np.roll(s, 1, axis)).sum((1, 2)) for axis in (1, 2))
    weight = np.exp(-(energy - energy.min()) / temperature)
    return (energy * weight).sum() / weight.sum() / (rows * cols)


@pytest.mark.parametrize("temperature", [0.3, 2.0, exact.CRITICAL, 100.0])
def test_the_energy_of_a_torus_is_that_of_counting_its_states(temperature):
    for size in ((2, 2), (2, 3), (3, 2), (3, 4)):
        assert exact.torus_energy(temperature, *size) == pytest.approx(by_counting(temperature, *size), abs=1e-11)


def test_a_large_torus_at_the_critical_point_has_onsagers_energy():
    assert pytest.approx(2.269185314213022, abs=1e-14) == exact.CRITICAL
    assert exact.torus_energy(exact.CRITICAL, 800, 900) == pytest.approx(-np.sqrt(2), abs=2e-3)
    assert exact.torus_energy(2.0, 800, 900) == pytest.approx(-1.745564575, abs=1e-8)  # K_1 is far from its pole there


# -- Heat-bath Ising: the operations bit for bit, and which schedules sample the Ising distribution.

OFFSETS = neighbourhood_offsets(1)


def problem(seed=0, shape=(6, 5), torus=True, tile=None, temperatures=(1.5, 3.0), seeds=3, count=None):
    """Spins of chains, some sites of the lattice, and the chances."""
    rng = np.random.default_rng(seed)
    grid = replace(Grid.of(shape, torus=torus), tile=tile)
    rows = 2 * shape[0] if tile else shape[0]
    spins = rng.integers(0, 2, (len(temperatures) * seeds, rows, shape[1]), dtype=np.uint8)
    sites = rng.permutation(np.arange(grid.size, dtype=np.int32))[:count].astype(np.int32)
    return grid, spins, sites, heat_bath_chances(temperatures, len(OFFSETS))


def relaxed(machine, grid, spins, sites, chances, seed=7, key=3):
    """The step's draws, and the spins after the commit."""
    put = [machine.put(a) for a in (spins, sites, OFFSETS)]
    drawn = ising_relax(machine, *put, grid, machine.put(chances), seed, key)
    return machine.get(drawn), machine.get(ising_commit(machine, put[0], put[1], drawn))


def sequenced(machine, grid, spins, queue, chances, seed=7):
    put = [machine.put(a) for a in (spins, queue, OFFSETS)]
    return machine.get(ising_sequence(machine, *put, grid, machine.put(chances), seed))


problems = st.builds(
    problem,
    seed=st.integers(0, 2**16),
    shape=st.tuples(st.integers(1, 7), st.integers(1, 7)),
    torus=st.booleans(),
    tile=st.sampled_from([None, (2, 3), (4, 4)]),
    temperatures=st.sampled_from([(2.0,), (0.5, 2.3, 40.0)]),
    seeds=st.sampled_from([1, 3, 17]),
    count=st.sampled_from([1, 5, None]),
)


@given(problems)
@settings(max_examples=20)
def test_the_reference_is_the_formula(p):
    """Against a loop over chains, sites and neighbours, and floating-point probabilities."""
    (grid, spins, sites, chances), seed, key = p, 7, 3
    drawn, after = relaxed(REFERENCE, *p)
    expected, (h, w) = spins.copy(), grid.shape
    for chain in range(len(spins)):
        temperature = {1: (2.0,), 2: (1.5, 3.0), 3: (0.5, 2.3, 40.0)}[len(chances)][chain * len(chances) // len(spins)]
        for s, site in enumerate(sites):
            i, j = divmod(int(site), w)
            field = 0
            for di, dj in ((-1, 0), (0, -1), (0, 1), (1, 0)):
                k, m = i + di, j + dj
                if grid.torus:
                    k, m = k % h, m % w
                if not (0 <= k < h and 0 <= m < w) or (k, m) == (i, j):
                    continue
                a, b = grid.tile or (h, w)
                field += 2 * int(spins[chain, k + h * ((k // a, m // b) != (i // a, j // b)), m]) - 1
            attempt = chain % (len(spins) // len(chances))
            bits = int(random.draw4(seed, 0, key, np.array([site]), random.DRAW, attempt)[0][0])
            chance = 1 / (1 + np.exp(-2 * field / temperature))
            assert abs(bits - chance * 2**32) > 1  # no case so close that rounding decides
            expected[chain, i, j] = drawn[chain, s]
            assert drawn[chain, s] == (bits < chance * 2**32)
    assert_same_bits(after, expected)


@given(p=problems)
@settings(max_examples=15)
def test_a_sequence_is_its_single_steps(machine, p):
    grid, spins, sites, chances = p
    queue = np.stack([sites, np.arange(len(sites)) % 4], 1).astype(np.int32)
    one_by_one = spins
    for site, key in queue:
        one_by_one = relaxed(REFERENCE, grid, one_by_one, site[None], chances, key=int(key))[1]
    assert_same_bits(sequenced(REFERENCE, grid, spins, queue, chances), one_by_one)
    assert_same_bits(sequenced(machine, grid, spins, queue, chances), one_by_one)


def test_the_shape_of_a_launch_changes_no_bit(cl_device):
    p, machine = problem(2, count=7), opencl(cl_device, work_group=3)
    assert_same_bits(relaxed(machine, *p), relaxed(REFERENCE, *p))
    queue = np.stack([p[2], np.arange(7)], 1).astype(np.int32)
    args = (p[0], p[1], queue, p[3])
    assert_same_bits(sequenced(machine, *args), sequenced(REFERENCE, *args))


def test_the_chances():
    chances = heat_bath_chances([2.0, 1e-9, 1e9], 4)
    assert chances.shape == (3, 5, 5) and chances.dtype == np.uint32
    up, members = 3, 4
    assert chances[0, members, up] == round(2**32 / (1 + np.exp(-2.0)))
    assert list(chances[1, 4]) == [0, 0, 2**31, 2**32 - 1, 2**32 - 1]  # ice: the majority
    assert (abs(chances[2, 4].astype(float) - 2**31) < 100).all()  # and next to no correlation
    for n in range(5):  # turning all spins over exchanges up and down
        both = chances[0, n, : n + 1].astype(float) + chances[0, n, n::-1]
        assert (abs(both - 2.0**32) <= 1).all()


@pytest.mark.parametrize("schedule", ["coloring", "random-scan", "synchronous", "block:2x3"])
def test_a_run_is_the_same_on_a_device_and_the_reference(machine, schedule):
    options = {"seeds": 3, "sweeps": 3, "burn_in": 1, "start": "random"}
    ours, theirs = (ising(m, (4, 6), [1.8, 2.5], schedule, **options) for m in (machine, REFERENCE))
    for name in ("energy", "even", "odd", "spins"):
        assert_same_bits(getattr(ours, name), getattr(theirs, name))


def test_what_is_measured_is_what_it_says():
    run = ising(REFERENCE, (3, 5), [2.5], "luby", seeds=4, sweeps=2, burn_in=3)
    s = 2.0 * run.spins[0] - 1
    bonds = [(s * np.roll(s, -1, axis)) for axis in (1, 2)]
    assert run.energy[0, :, -1] == pytest.approx(-sum(b.sum((1, 2)) for b in bonds) / 15)
    assert run.magnetisation[0, :, -1] == pytest.approx(s.mean((1, 2)))
    parity = np.indices((3, 5)).sum(0) % 2
    assert run.odd[0, :, -1] == pytest.approx(s[:, parity == 1].mean(1))
    longer = ising(REFERENCE, (3, 5), [2.5], "luby", seeds=4, sweeps=3, burn_in=2)
    assert_same_bits(longer.energy[..., 1:].copy(), run.energy)  # burn-in is but not looking
    beside = ising(REFERENCE, (3, 5), [1.0, 2.5], "luby", seeds=4, sweeps=2, burn_in=3)
    assert_same_bits(beside.energy[1:].copy(), run.energy)  # temperatures are independent of one another


class Turns(Watched):
    """A step of one site, then all others at once, then one site again."""

    def step(self, setting, state, active):
        count = (state[0] if state else 0) + 1
        part = np.split(np.arange(setting.grid.size, dtype=np.int32), [1, setting.grid.size - 1])[(count - 1) % 3]
        return (count,), Info(part, count - 1, count % 3 == 0)


def test_single_sites_and_steps_of_many_keep_their_order(machine):
    chances, bits = heat_bath_chances([2.0], 4), random.draw4(1, 0, 0, np.arange(16), random.START, [[0], [1]])[0]
    expected = (bits >> 31).astype(np.uint8).reshape(2, 4, 4)
    for key, sites in enumerate(np.split(np.arange(16, dtype=np.int32), [1, 15])):
        expected = relaxed(REFERENCE, Grid((4, 4)), expected, sites, chances, seed=1, key=key)[1]
    for m in (machine, REFERENCE):
        turns = Turns(Synchronous())
        spins = ising(m, (4, 4), [2.0], turns, seeds=2, sweeps=1, burn_in=0, start="random").spins[0]
        assert_same_bits(spins, expected)


def test_bad_values_are_refused_in_a_sentence():
    for bad, sentence in (
        ({"size": (1, 4)}, "a side of the lattice is 1; give 2 or more"),
        ({"temperatures": []}, "there is no temperature"),
        ({"temperatures": [0.0]}, "temperature is 0.0; give a number above 0"),
        ({"start": "down"}, "unknown start 'down'; choose one of: up, random"),
        ({"size": (30000, 30000)}, "give a smaller size or fewer seeds"),
    ):
        with pytest.raises((ValueError, TypeError), match=sentence):
            ising(REFERENCE, **{"size": (4, 4), "temperatures": [2.0], "schedule": "coloring", **bad})


def chains(energy, spins=(4, 4)):
    """Chains of one temperature with these energies (R, n)."""
    none = np.zeros((1, *energy.shape))
    up = np.ones((1, len(energy), *spins), np.uint8)
    return Chains("luby", True, np.array([2.0]), energy[None], none, none, up)


def test_an_error_is_that_of_the_means_of_chains():
    energy = np.random.default_rng(3).normal(-1.7, 0.1, (20, 1)) + np.zeros((20, 500))  # sweeps that are all alike
    (found,) = findings([chains(energy)])
    assert found.energy == pytest.approx(energy.mean())
    assert found.error == pytest.approx(energy[:, 0].std(ddof=1) / np.sqrt(20))
    assert found.sigmas == pytest.approx((found.energy - found.exact) / found.error)


def test_a_deviation_counts_by_students_t_over_all_comparisons():
    noise = np.random.default_rng(3).normal(0, 1, 20)
    noise = (noise - noise.mean()) / noise.std(ddof=1) * np.sqrt(20)  # of a standard error of 1
    (found,) = findings([chains(np.full((20, 10), 0.0))])
    for runs, factor in ((1, 0.99), (1, 1.01), (10, 0.99), (10, 1.01)):
        limit = stats.t.isf(0.001 / runs / 2, 19)
        energy = found.exact + np.repeat((noise + factor * limit)[:, None], 10, 1)
        assert [each.differs for each in findings([chains(energy)] * runs)] == [factor > 1] * runs


EVERY = ("coloring", "coloring-fixed", "luby", "checkerboard", "raster", "random-scan", "synchronous", "block:4x4")


@pytest.mark.parametrize("names", [EVERY[::6], pytest.param(EVERY, marks=pytest.mark.slow)], ids=len)
def test_schedules_that_keep_equation_14_have_the_exact_energy_and_others_differ(any_device, names):
    """On a small lattice, below, near and above T_c."""
    options = {"seeds": 32, "sweeps": 200, "burn_in": 100, "seed": 5}
    found = findings([ising(opencl(any_device), (8, 8), [1.8, CRITICAL, 2.8], name, **options) for name in names])
    for finding in found:
        assert finding.independent == (finding.schedule in EVERY[:6])
        if finding.independent:
            assert not finding.differs, finding
            assert finding.error < 0.025  # not for want of precision
            assert finding.neighbours > 0.008, finding
        elif finding.schedule == "synchronous":
            assert finding.differs and finding.sigmas > 4.5, finding
            assert abs(finding.neighbours) < 0.004  # neighbours know nothing of one another
    assert any(finding.differs for finding in found if finding.schedule == names[-1])


# -- ``simdtex schedules --ising``, as its user meets it.


@pytest.mark.slow
def test_schedules_have_tables_of_the_ising_model_and_a_section_of_the_report(tmp_path, monkeypatch, any_device):
    monkeypatch.setattr("simdtex.jobs.studies.ising.SIZE", (4, 6))
    few = ("--size", "12x10", "--order", 1, "--seeds", 1, "--schedule", "coloring,synchronous,raster")
    done = run("schedules", "--ising", *few, "-o", tmp_path / "r", "--device", any_device.index)
    assert done.exit_code == 0, done.output
    said, found = done.output, json.loads((tmp_path / "r" / "results.json").read_text())["ising"]
    for word in ("T = 2:", "T = 2.3:", "T = 2.6:", "coloring", "keeps", "breaks"):
        assert word in said
    assert found["conclusion"] == [
        "No deviation from the Ising model at any temperature: coloring, raster.",
        "Something else is sampled by: synchronous.",
    ]
    assert all(sentence in said for sentence in found["conclusion"])
    assert [one["schedule"] for one in found["findings"]] == ["coloring", "synchronous", "raster"] * 3
    assert set(found["findings"][0]) == {field.name for field in fields(Finding)}
    for name in ("energy.png", "lattices.png"):
        with Image.open(tmp_path / "r" / name) as picture:
            assert min(picture.size) > 300 and len(np.unique(np.asarray(picture.convert("L")))) > 1
    page = (tmp_path / "r" / "index.html").read_text()
    assert "Kaufman" in page and "lattices.png" in page


def test_a_narrow_terminal_gets_whole_cells(capsys):
    one = Finding("random-subset:0.25", False, 2.0, -1.74, 0.01, -1.745, 55, 0.911, 0.04, True, 32)
    (table,) = ising_tables([one])
    assert table.rows[0]["Verdict"] == "differs by 55 sigma"
    assert replace(one, chains=7).verdict == "none, 7 of 8 chains"
    print_table(table, 80)
    shown = capsys.readouterr().out
    assert "…" not in shown and max(map(len, shown.splitlines())) <= 80
    words = " ".join(shown.split())
    assert all(word in words for row in table.rows for cell in row.values() for word in cell.split())


def test_a_sublattice_apart_shows_its_own_sites_only():
    row, col = np.indices((5, 4))
    for odd in (0, 1):
        spins = ((row + col) % 2 == odd).astype(np.uint8)  # its own sites are up, the others down
        assert _sublattice(spins, odd).all()
        assert not _sublattice(1 - spins, odd).any()

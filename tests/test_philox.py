"""simdtex/random.py: Philox4x32-10 against its authors' known answers, and what is made of its bits."""

import numpy as np
import pytest
from cases import assert_same_bits
from hypothesis import given
from hypothesis import strategies as st
from plain_numbers import philox

from simdtex import random
from simdtex.machine import runtimes
from simdtex.machine.opencl import kernel_folder, kernel_source

# kat_vectors of Random123 (Salmon et al., SC 2011): counter, key, answer.
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]
words = st.integers(0, 2**32 - 1)

SOURCE = """
__kernel void raw(__global const uint4 *counter, const uint2 key, __global uint4 *out)
{
    out[get_global_id(0)] = philox(counter[get_global_id(0)], key);
}
__kernel void draws(const ulong seed, const uint level, const uint sweep, const uint purpose, const uint attempt,
                    const ulong n, __global ulong *out)
{
    const uint4 bits = draw4(seed, level, sweep, get_global_id(0), purpose, attempt);
    out[get_global_id(0)] = below(bits.x, bits.y, n);
}
"""


def numbers(text):
    return [int(word, 16) for word in text.split()]


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_known_answers(counter, key, answer):
    counter = [np.array([c], np.uint32) for c in numbers(counter)]
    ours = random.philox(counter, tuple(numbers(key)))
    assert [int(o[0]) for o in ours] == numbers(answer) == philox([int(c[0]) for c in counter], numbers(key))
    assert all(o.dtype == np.uint32 for o in ours)


@given(st.lists(words, min_size=4, max_size=4), words, words)
def test_any_counter_and_key(counter, first, second):
    ours = random.philox([np.array([c], np.uint32) for c in counter], (first, second))
    assert [int(o[0]) for o in ours] == philox(counter, (first, second))


@given(st.integers(0, 2**64 - 1), st.integers(0, 2**20), words, st.integers(0, 2**31 - 1), words)
def test_a_draw_is_keyed_by_seed_level_sweep_site_and_attempt(seed, level, sweep, site, attempt):
    ours = random.draw4(seed, level, sweep, site, random.DRAW, attempt)
    counter = [site, sweep, level << 8 | random.DRAW, attempt]
    assert [int(o) for o in ours] == philox(counter, (seed & 0xFFFFFFFF, seed >> 32))


def test_draws_of_many_sites_are_the_draws_of_each():
    many = random.draw4(7, 2, 3, np.arange(5), random.START, 1)
    each = [random.draw4(7, 2, 3, site, random.START, 1) for site in range(5)]
    assert np.array_equal(np.stack(many, -1), np.array(each))


PURPOSES = ("START", "DRAW", "COLOR", "SCHEDULE", "NOISE", "SEARCH", "GUMBEL")


def test_no_two_purposes_share_a_number():
    purposes = [getattr(random, name) for name in PURPOSES]
    assert len(set(purposes)) == len(purposes)
    assert max(purposes) < 256, "the level begins at bit 8"


def test_the_kernels_know_the_same_purposes():
    header = (kernel_folder() / "common" / "philox.h").read_text()
    for name in PURPOSES:
        assert f"#define PURPOSE_{name} {getattr(random, name)}u\n" in header


@given(words, words, st.integers(1, 2**64 - 1))
def test_below_is_the_high_half_of_the_product(lo, hi, n):
    ours = random.below(np.uint32(lo), np.uint32(hi), n)
    assert ours.dtype == np.uint64
    assert int(ours) == ((hi << 32 | lo) * n) >> 64


@pytest.mark.parametrize("n", [1, 2, 3, 2**32 - 1, 2**32, 2**32 + 1, 2**63, 2**64 - 1])
def test_below_at_the_extremes(n):
    ends = np.array([0, 1, 2**31, 2**32 - 1], np.uint32)
    lo, hi = (a.ravel() for a in np.meshgrid(ends, ends))
    ours = random.below(lo, hi, n)
    exact = [((int(h) << 32 | int(low)) * n) >> 64 for low, h in zip(lo, hi, strict=True)]
    assert ours.tolist() == exact
    assert max(exact) == n - 1


def test_below_is_uniform():
    lo, hi, *_ = random.draw4(1, 0, 0, np.arange(60_000), random.START)
    counts = np.bincount(random.below(lo, hi, 6).astype(int), minlength=6)
    assert abs(counts - 10_000).max() < 500  # five standard deviations


@pytest.mark.parametrize("seed", [0, 1, 2**63, 2**64 - 1, np.int64(5), np.uint64(2**64 - 1)])
def test_a_whole_number_is_its_own_seed(seed):
    assert random.as_seed(seed) == int(seed)
    assert type(random.as_seed(seed)) is int


def test_a_generator_gives_a_seed_and_moves_on():
    generator = np.random.default_rng(3)
    first, second = random.as_seed(generator), random.as_seed(generator)
    assert first != second
    assert first == random.as_seed(np.random.default_rng(3))
    assert 0 <= min(first, second) <= max(first, second) < 2**64


def test_none_gives_a_fresh_seed():
    seeds = {random.as_seed() for _ in range(4)} | {random.as_seed(None)}
    assert len(seeds) == 5
    assert all(0 <= seed < 2**64 for seed in seeds)


@pytest.mark.parametrize("seed", [-1, 2**64, np.int64(-3)])
def test_a_seed_out_of_range_is_an_error_that_says_the_range(seed):
    with pytest.raises(ValueError, match=r"out of range; give an integer from 0 to 2\*\*64 - 1"):
        random.as_seed(seed)


@pytest.mark.parametrize("seed", [1.0, "1", True, [1], np.random.RandomState(0)])
def test_another_type_of_seed_is_an_error_that_says_the_types(seed):
    with pytest.raises(TypeError, match=r"None, an integer or a numpy\.random\.Generator"):
        random.as_seed(seed)


@pytest.fixture(scope="module")
def kernels(machine):
    return runtimes.build(machine.context, kernel_source("common/philox.h") + SOURCE, [])


def test_known_answers_on_a_device(machine, kernels):
    import pyopencl as cl

    for counter, key, answer in KNOWN:
        out = machine.empty((4,), np.uint32)
        packed = cl.cltypes.make_uint2(*numbers(key))
        counters = machine.put(np.array(numbers(counter), np.uint32))
        machine.enqueue(kernels["raw"], (1,), counters, packed, out, local=(1,))
        assert machine.get(out).tolist() == numbers(answer)


@pytest.mark.parametrize("n", [1, 7, 10_000, 2**32 + 1, 2**64 - 1])
def test_draws_on_a_device_are_the_references(machine, kernels, n):
    seed, level, sweep, attempt = 2**63 + 12345, 5, 17, 3
    out = machine.empty((1000,), np.uint64)
    scalars = (np.uint64(seed), *map(np.uint32, (level, sweep, random.DRAW, attempt)), np.uint64(n))
    machine.enqueue(kernels["draws"], out.shape, *scalars, out, local=(8,))
    lo, hi, *_ = random.draw4(seed, level, sweep, np.arange(1000), random.DRAW, attempt)
    assert_same_bits(machine.get(out), random.below(lo, hi, n))

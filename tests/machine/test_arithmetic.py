"""fma(), exp(), log() and random numbers: bits against exact arithmetic and known answers, devices against twins."""

from fractions import Fraction

import numpy as np
import pytest
import tolerances
from cases import assert_same_bits
from hypothesis import given
from hypothesis import strategies as st
from plain_numbers import philox

from simdtex import random
from simdtex.machine import devices
from simdtex.machine.opencl import kernel_folder, kernel_source
from simdtex.methods.mrf.arithmetic import exp32, fma32, log32, minus_gumbel

SOURCE = """
#pragma OPENCL FP_CONTRACT OFF
__kernel void fmas(__global const float *a, __global const float *b, __global const float *c, __global float *out)
{
    const int i = get_global_id(0);
    out[i] = fma(a[i], b[i], c[i]);
}
__kernel void exps(__global const float *x, __global float *out)
{
    const int i = get_global_id(0);
    out[i] = exp32(x[i]);
}
__kernel void gumbels(__global const uint *x, __global float *out)
{
    const int i = get_global_id(0);
    out[i] = minus_gumbel(x[i]);
}
__kernel void bounds(__global const uint *x, __global float *out)
{
    const int i = get_global_id(0);
    out[i] = least_noise(x[i]);
}
__kernel void logs(__global const float *x, __global float *out)
{
    const int i = get_global_id(0);
    out[i] = log32(x[i]);
}
"""

finite = st.floats(width=32, allow_nan=False, allow_infinity=False)


def to_float32(exact):
    """The float32 nearest to a Fraction, ties to even, by whole-number arithmetic alone."""
    if exact == 0:
        return np.float32(0)
    size, sign = abs(exact), -1 if exact < 0 else 1
    exponent = size.numerator.bit_length() - size.denominator.bit_length()
    if Fraction(2) ** exponent > size:
        exponent -= 1
    unit = Fraction(2) ** (max(exponent, -126) - 23)
    mantissa = round(size / unit)  # Python rounds a Fraction's half to even
    if mantissa * unit >= Fraction(2) ** 128:
        return np.float32(sign * np.inf)
    return np.float32(sign * float(mantissa * unit))


def exact_fma(a, b, c):
    return to_float32(Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c)))


def check(a, b, c):
    a, b, c = (np.asarray(v, np.float32).ravel() for v in (a, b, c))
    with np.errstate(over="ignore"):
        ours = fma32(a, b, c)
    exact = np.array([exact_fma(*abc) for abc in zip(a, b, c, strict=True)], np.float32)
    np.testing.assert_array_equal(ours, exact)


def triples(count, seed=0):
    """Factors and summands in which the sum's roundings matter: far apart, close, and cancelling."""
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((2, count)).astype(np.float32)
    scale = 2.0 ** rng.integers(-40, 41, count)
    c = (rng.standard_normal(count) * scale).astype(np.float32)
    cancelling = rng.random(count) < 0.3
    return a, b, np.where(cancelling, -(a * b), c).astype(np.float32)


def halfway_triples():
    """a b + c that float64 rounds onto the middle between two float32: rounding twice goes wrong there."""
    tiny = np.float32(2.0**-60)
    found = []
    for mantissa in (2**23, 2**23 + 1, 2**24 - 1):
        for sign in (1, -1):
            # (mantissa + 1/2) as a product of float32 factors is impossible in general, so the half is the product.
            for nudge in (tiny, -tiny, np.float32(0)):
                half = np.float32(0.5)
                found.append((half, sign * (np.float32(1) + nudge), np.float32(sign * mantissa)))
    # (1 + 2^-12)^2 = 1 + 2^-11 + 2^-24, half a unit in the last place; a summand far below decides.
    base = np.float32(1 + 2.0**-12)
    for below in (2.0**-80, -(2.0**-80), 2.0**-140, -(2.0**-149), 0.0):
        found += [(base, base, np.float32(below)), (-base, base, np.float32(below))]
    return found


def test_fma32_is_rounded_once_where_rounding_twice_errs():
    a, b, c = zip(*halfway_triples(), strict=True)
    a, b, c = (np.array(v, np.float32) for v in (a, b, c))
    check(a, b, c)
    twice = (a.astype(np.float64) * b + c).astype(np.float32)
    assert (twice != fma32(a, b, c)).any(), "these cases are meant to be hard"


@given(finite, finite, finite)
def test_fma32_is_exact_for_any_floats(a, b, c):
    check(a, b, c)


def test_fma32_is_exact_among_the_subnormal():
    for power in (-149, -127, -125):
        unit = np.float32(2.0**power)
        factors = np.float32([1, 1.5, 0.5, 0.75, 2.5, -1.5])
        a, c = np.meshgrid(factors, factors * unit)
        check(a, np.full(a.shape, unit), c)


def grid_of_exponents():
    near = -np.logspace(-45, 0, 20_001)
    return np.concatenate([np.linspace(-86.9, 0, 100_001), near]).astype(np.float32)


def test_exp32_is_as_close_as_stated_and_never_exceeds_1():
    x = grid_of_exponents()
    exact, found = np.exp(x.astype(np.float64)), exp32(x)
    assert (abs(found - exact) / exact).max() < tolerances.EXP32
    assert exp32(np.float32(0)) == found.max() == 1


@pytest.fixture(scope="module")
def build(machine):
    """The program above on a machine, as it builds its own."""
    headers = kernel_source("common/exp.h", "common/gumbel.h")
    kernels = devices.build(machine.context, headers + SOURCE, [])

    def run(name, *arrays):
        out = machine.empty(arrays[0].shape, np.float32)
        machine.enqueue(kernels[name], out.shape, *map(machine.put, arrays), out, local=(1,))
        return machine.get(out)

    return run


def test_a_device_has_the_twins_bits(build):
    for triple in (triples(20_000, 1), zip(*halfway_triples(), strict=True)):
        a, b, c = (np.array(v, np.float32) for v in triple)
        normal = abs(fma32(a, b, c)) >= 2.0**-126  # devices may flush the rest to 0; no kernel meets them
        a, b, c = a[normal], b[normal], c[normal]
        c = np.where(abs(c) < 2.0**-126, 0, c).astype(np.float32)
        assert_same_bits(build("fmas", a, b, c), fma32(a, b, c))
    x = grid_of_exponents()
    x = x[(x < -(2.0**-120)) | (x == 0)]
    assert_same_bits(build("exps", x), exp32(x))
    assert_same_bits(build("logs", numbers_to_log()), log32(numbers_to_log()))
    assert_same_bits(build("gumbels", words_of_all_sizes()), minus_gumbel(words_of_all_sizes()))


def numbers_to_log():
    rng = np.random.default_rng(2)
    near, whole = 1 + rng.random(30_000), np.arange(1, 2**14)
    small = np.exp(rng.uniform(-23, 0, 30_000))
    return np.concatenate([near, whole, np.exp(rng.uniform(0, 16.6, 60_000)), [2**24 - 1], small]).astype(np.float32)


def test_log32_is_as_close_as_stated():
    x = numbers_to_log()
    assert abs(log32(x) - np.log(x.astype(np.float64))).max() < tolerances.LOG32
    assert log32(np.float32(1)) == 0
    assert log32(np.float32(4)) == 2 * log32(np.float32(2)) > 0


def words_of_all_sizes():
    """Random words, and many near both ends."""
    near = np.unique(np.exp(np.linspace(0, 22, 100_000)).astype(np.int64))
    among = np.random.default_rng(3).integers(0, 2**32, 200_000)
    split = int(2**32 * 0.5**0.5) + np.arange(-1000, 1000)  # where u is sqrt(1/2)
    return np.unique(np.concatenate([[0], near, 2**32 - 1 - near, [2**32 - 1], among, split])).astype(np.uint32)


def test_gumbel_noise_is_as_close_as_stated_at_both_ends():
    bits = words_of_all_sizes()
    rest = (2.0**32 - 1 - bits + 0.5) / 2**32  # 1 - u, exact in float64
    exact = np.where(rest < 0.5, np.log(-np.log1p(-rest)), np.log(-np.log((bits + 0.5) / 2**32)))
    assert abs(minus_gumbel(bits) - exact).max() < tolerances.GUMBEL
    assert minus_gumbel(np.uint32([2**32 - 1]))[0] == pytest.approx(-33 * np.log(2))


def test_the_bound_of_gumbel_noise_is_below_it_and_close_where_noise_is_positive(build):
    bits = words_of_all_sizes()
    found, noise = build("bounds", bits).astype(float), 23 + minus_gumbel(bits).astype(float)
    assert (found >= 0).all()
    assert (found < noise - 1e-4).all()
    assert (found > noise - 1.2)[noise < 23].all()


# -- simdtex/random.py: Philox4x32-10 against its authors' known answers, and what is made of its bits.

# kat_vectors of Random123 (Salmon et al., SC 2011): counter, key, answer.
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]
words = st.integers(0, 2**32 - 1)


def numbers(text):
    return [int(word, 16) for word in text.split()]


def test_known_answers():
    for counter, key, answer in KNOWN:
        counter = [np.array([c], np.uint32) for c in numbers(counter)]
        ours = random.philox(counter, tuple(numbers(key)))
        assert [int(o[0]) for o in ours] == numbers(answer) == philox([int(c[0]) for c in counter], numbers(key))
        assert all(o.dtype == np.uint32 for o in ours)


@given(st.integers(0, 2**64 - 1), st.integers(0, 2**20), words, st.integers(0, 2**31 - 1), words)
def test_a_draw_is_keyed_by_seed_level_sweep_site_and_attempt(seed, level, sweep, site, attempt):
    ours = random.draw4(seed, level, sweep, site, random.DRAW, attempt)
    counter = [site, sweep, level << 8 | random.DRAW, attempt]
    assert [int(o) for o in ours] == philox(counter, (seed & 0xFFFFFFFF, seed >> 32))


PURPOSES = ("START", "DRAW", "COLOR", "SCHEDULE", "NOISE", "SEARCH", "GUMBEL")


def test_purposes_have_numbers_of_their_own_which_kernels_know():
    header = (kernel_folder() / "common" / "philox.h").read_text()
    purposes = {name: getattr(random, name) for name in PURPOSES}
    assert len(set(purposes.values())) == len(purposes)
    assert max(purposes.values()) < 256, "the level begins at bit 8"
    assert all(f"#define PURPOSE_{name} {number}u\n" in header for name, number in purposes.items())


@given(words, words, st.integers(1, 2**64 - 1))
def test_below_is_the_high_half_of_the_product(lo, hi, n):
    ours = random.below(np.uint32(lo), np.uint32(hi), n)
    assert ours.dtype == np.uint64
    assert int(ours) == ((hi << 32 | lo) * n) >> 64


def test_seeds():
    for seed in (0, 2**64 - 1, np.int64(5), np.uint64(2**64 - 1)):
        assert random.as_seed(seed) == int(seed) and type(random.as_seed(seed)) is int
    generator = np.random.default_rng(3)
    first, second = random.as_seed(generator), random.as_seed(generator)
    assert first == random.as_seed(np.random.default_rng(3)) != second
    seeds = {first, second, *(random.as_seed() for _ in range(4))}
    assert len(seeds) == 6 and 0 <= min(seeds) <= max(seeds) < 2**64
    for seed in (-1, 2**64, np.int64(-3)):
        with pytest.raises(ValueError, match=r"out of range; give an integer from 0 to 2\*\*64 - 1"):
            random.as_seed(seed)

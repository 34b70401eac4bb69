// SPDX-License-Identifier: BSD-3-Clause

// A stable radix sort of whole segments, 8 bits of the keys in each of four passes, lowest first. A pass counts the
// digits of every run of `length` keys, finds where each run's keys of each digit begin, and moves the keys there.
// Runs stay in order and a run is moved in order, so their length changes no bit.
//
// values (segments, n) from segment `begin` on; first (n,) the order of equal values
// pairs  (pieces, n) (key, index in the segment); counts (pieces, runs, 256); totals (pieces, 256)
// A piece is one of the segments that are sorted together. Work-item r takes run r % runs of piece r / runs.
#define DIGITS 256

#define RUN                                                                                                            \
    const int r = get_global_id(0);                                                                                    \
    if (r >= pieces * runs)                                                                                            \
        return;                                                                                                        \
    const size_t here = (size_t)(r / runs) * n;                                                                        \
    const int from = r % runs * length, to = min(n, from + length)

// Values as keys that sort without a sign, in the order `first`.
__kernel void sort_read(__global const int *restrict values, const int begin, __global const int *restrict first,
                        const int pieces, const int n, const int runs, const int length, __global uint2 *restrict pairs)
{
    RUN;
    __global const int *v = values + (size_t)begin * n + here;
    for (int i = from; i < to; ++i)
        pairs[here + i] = (uint2)((uint)v[first[i]] ^ 0x80000000u, first[i]);
}

// How often each digit, the 8 bits from `shift` on, stands in each run.
__kernel void sort_count(__global const uint2 *restrict pairs, const int pieces, const int n, const int runs,
                         const int length, const int shift, __global uint *restrict counts)
{
    RUN;
    __global uint *count = counts + (size_t)r * DIGITS;
    for (int d = 0; d < DIGITS; ++d)
        count[d] = 0;
    for (int i = from; i < to; ++i)
        ++count[(pairs[here + i].x >> shift) & (DIGITS - 1)];
}

// Of each piece and digit: how many there are in the runs before each, and in all. One work-item per piece and digit.
__kernel void sort_scan(const int pieces, const int runs, __global uint *restrict counts,
                        __global uint *restrict totals)
{
    const int s = get_global_id(0);
    if (s >= pieces * DIGITS)
        return;
    __global uint *count = counts + (size_t)(s / DIGITS) * runs * DIGITS + s % DIGITS;
    uint sum = 0;
    for (int i = 0; i < runs; ++i) {
        const uint own = count[i * DIGITS];
        count[i * DIGITS] = sum;
        sum += own;
    }
    totals[s] = sum;
}

// Every pair to its place; in the last pass only the index, to order (segments, n) from segment `begin` on.
__kernel void sort_scatter(__global const uint2 *restrict pairs, const int pieces, const int n, const int runs,
                           const int length, const int shift, __global uint *restrict counts,
                           __global const uint *restrict totals, __global uint2 *restrict moved, const int last,
                           __global int *restrict order, const int begin)
{
    RUN;
    __global uint *place = counts + (size_t)r * DIGITS;
    __global const uint *total = totals + r / runs * DIGITS;
    uint sum = 0;
    for (int d = 0; d < DIGITS; ++d) {
        place[d] += sum;
        sum += total[d];
    }
    __global uint2 *to_pairs = moved + here;
    __global int *to_order = order + (size_t)begin * n + here;
    for (int i = from; i < to; ++i) {
        const uint2 pair = pairs[here + i];
        const uint k = place[(pair.x >> shift) & (DIGITS - 1)]++;
        if (last)
            to_order[k] = pair.y;
        else
            to_pairs[k] = pair;
    }
}

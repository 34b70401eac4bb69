// SPDX-License-Identifier: BSD-3-Clause

// Histogram matching by rank in one launch: what sort.cl and matching_ranks do, one work-item per segment. The values of
// a segment, less the smallest, are sorted by 11 bits in each of one to three passes, lowest first, as many as their
// range asks for. All passes are stable, so equal values come in the order `first`. In the last pass a value's place is
// its rank k, and it becomes the target's of rank (2 k + 1) m / (2 n), rounded down: k m / n where m divides n.
//
// values, out (segments, n); first (n,); targets (T, m) sorted, `each` segments in a row with the same one
// pairs (2, pieces, n) (key, index in the segment); counts (pieces, 3, 2048); moved (segments,) sums of |value - out|
// A piece is one of the segments from `begin` on that are worked on in this launch.
#define BITS 11
#define INDEX (32 - BITS) // bits
#define DIGITS (1 << BITS)

__kernel void ranking(__global const int *restrict values, const int begin, __global const int *restrict first,
                      const int pieces, const int n, __global const int *restrict targets, const int each, const int m,
                      __global uint2 *pairs, __global uint *restrict counts, __global int *restrict out,
                      __global long *restrict moved)
{
    const int piece = get_global_id(0), segment = begin + piece;
    if (piece >= pieces)
        return;
    __global const int *v = values + (size_t)segment * n, *target = targets + (size_t)(segment / each) * m;
    __global int *to = out + (size_t)segment * n;
    __global uint *count = counts + (size_t)piece * 3 * DIGITS;

    int low = v[0], high = v[0];
    for (int i = 0; i < n; ++i) {
        low = min(low, v[i]);
        high = max(high, v[i]);
    }
    const uint width = (uint)high - (uint)low;
    const int passes = width >> 2 * BITS ? 3 : width >> BITS ? 2 : 1;
    for (int d = 0; d < passes * DIGITS; ++d)
        count[d] = 0;
    for (int i = 0; i < n; ++i) {
        const uint key = (uint)v[i] - (uint)low;
        ++count[key % DIGITS];
        if (passes > 1)
            ++count[DIGITS + (key >> BITS) % DIGITS];
        if (passes > 2)
            ++count[2 * DIGITS + (key >> 2 * BITS)];
    }
    for (int pass = 0; pass < passes; ++pass)
        for (uint d = 0, sum = 0; d < DIGITS; ++d) { // from how many there are to where they begin
            const uint own = count[pass * DIGITS + d];
            count[pass * DIGITS + d] = sum;
            sum += own;
        }

    const int times = n % m ? 0 : n / m;
#define RANKED(k) target[times ? (k) / (uint)max(1, times) : (uint)((2ul * (k) + 1) * m / (2ul * n))]
    if (passes < 3 && n <= 1 << INDEX) { // what is left of a key after the first pass, and the index, in one word
        __global uint *words = (__global uint *)(pairs + (size_t)piece * n);
        for (int i = 0; i < n; ++i) {
            const uint index = first[i], key = (uint)v[index] - (uint)low;
            words[count[key % DIGITS]++] = key >> BITS << INDEX | index;
        }
        if (passes == 1)
            count[DIGITS] = 0; // all are left in one bin
        for (int i = 0; i < n; ++i) {
            const uint k = count[DIGITS + (words[i] >> INDEX)]++;
            to[words[i] % (1 << INDEX)] = RANKED(k);
        }
    } else {
        for (int pass = 0; pass < passes; ++pass) {
            __global uint *place = count + pass * DIGITS;
            __global const uint2 *from = pairs + ((size_t)(pass & 1) * pieces + piece) * n;
            __global uint2 *into = pairs + ((size_t)(1 - (pass & 1)) * pieces + piece) * n;
            const int shift = pass * BITS, last = pass == passes - 1;
            for (int i = 0; i < n; ++i) {
                uint2 pair;
                if (pass)
                    pair = from[i];
                else
                    pair = (uint2)((uint)v[first[i]] - (uint)low, first[i]);
                const uint k = place[(pair.x >> shift) % DIGITS]++;
                if (last)
                    to[pair.y] = RANKED(k);
                else
                    into[k] = pair;
            }
        }
    }
    long sum = 0;
    for (int i = 0; i < n; ++i)
        sum += abs_diff(v[i], to[i]);
    moved[segment] = sum;
}

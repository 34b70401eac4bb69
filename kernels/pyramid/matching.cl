// SPDX-License-Identifier: BSD-3-Clause

// Histogram matching, Heeger and Bergen's match-histogram: every segment of a picture takes the histogram of a target,
// `each` segments in a row the same one. By rank: the k-th smallest value becomes the value of that rank in the target.
// By lookup, as in the paper: through the segment's cdf, in equal bins over its own range, then through the target's
// inverse cdf in a table. All in integers.
//
// values, out (segments, n); order (segments, n) from sort.cl; targets (T, m) sorted; tables (T, bins + 1)
// Where runs of a segment are gone through, work-item r takes run r % runs of segment r / runs, `length` values long.
#define RUN                                                                                                            \
    const int r = get_global_id(0);                                                                                    \
    if (r >= segments * runs)                                                                                          \
        return;                                                                                                        \
    const size_t here = (size_t)(r / runs) * n;                                                                        \
    const int from = r % runs * length, to = min(n, from + length)

#define FRACTION 20 // bits of a fraction of a bin

// One work-item per rank and segment.
__kernel void matching_ranks(__global const int *restrict order, const int segments, const int n,
                             __global const int *restrict targets, const int each, const int m,
                             __global int *restrict out)
{
    const int k = get_global_id(0), segment = get_global_id(1);
    if (k >= n || segment >= segments)
        return;
    const size_t here = (size_t)segment * n;
    const int rank = m == n ? k : (int)((2l * k + 1) * m / (2l * n));
    out[here + order[here + k]] = targets[(size_t)(segment / each) * m + rank];
}

// Least and greatest value of each run: ranges (segments, runs).
__kernel void matching_range(__global const int *restrict values, const int segments, const int n, const int runs,
                             const int length, __global int2 *restrict ranges)
{
    RUN;
    int low = values[here + from], high = low;
    for (int i = from; i < to; ++i) {
        low = min(low, values[here + i]);
        high = max(high, values[here + i]);
    }
    ranges[r] = (int2)(low, high);
}

// The same of each segment: spans (segments,).
__kernel void matching_span(__global const int2 *restrict ranges, const int segments, const int runs,
                            __global int2 *restrict spans)
{
    const int s = get_global_id(0);
    if (s >= segments)
        return;
    int2 span = ranges[s * runs];
    for (int i = 1; i < runs; ++i)
        span = (int2)(min(span.x, ranges[s * runs + i].x), max(span.y, ranges[s * runs + i].y));
    spans[s] = span;
}

// The bin of a value; the greatest value stands at the end of the last. A constant segment has one bin only.
static inline int bin_of(const int value, const int2 span, const int bins)
{
    const long width = max(1l, (long)span.y - span.x);
    return (int)min(((long)value - span.x) * bins / width, bins - 1l);
}

// How many values of each run lie in each bin: counts (segments, runs, bins).
__kernel void matching_count(__global const int *restrict values, const int segments, const int n, const int runs,
                             const int length, __global const int2 *restrict spans, const int bins,
                             __global uint *restrict counts)
{
    RUN;
    __global uint *count = counts + (size_t)r * bins;
    for (int b = 0; b < bins; ++b)
        count[b] = 0;
    const int2 span = spans[r / runs];
    for (int i = from; i < to; ++i)
        ++count[bin_of(values[here + i], span, bins)];
}

// Of each segment and bin, to the place after it in cdf (segments, bins + 1). One work-item per bin and segment.
__kernel void matching_total(__global const uint *restrict counts, const int segments, const int runs, const int bins,
                             __global uint *restrict cdf)
{
    const int b = get_global_id(0), segment = get_global_id(1);
    if (b >= bins || segment >= segments)
        return;
    uint sum = 0;
    for (int i = 0; i < runs; ++i)
        sum += counts[((size_t)segment * runs + i) * bins + b];
    cdf[(size_t)segment * (bins + 1) + b + 1] = sum;
}

// Values in the bins before each: n times the cdf at the edges of the bins. One work-item per segment.
__kernel void matching_cdf(const int segments, const int bins, __global uint *restrict cdf)
{
    const int s = get_global_id(0);
    if (s >= segments)
        return;
    __global uint *below = cdf + (size_t)s * (bins + 1);
    below[0] = 0;
    for (int b = 1; b <= bins; ++b)
        below[b] += below[b - 1];
}

// Every value through the cdf, even within a bin, and the table. Its place in its bin and in the table are rounded down
// to 2^-20 of a bin, the result to the nearest, halves up. A constant segment takes the table's middle, the median.
__kernel void matching_lookup(__global const int *restrict values, const int segments, const int n,
                              __global const int2 *restrict spans, const int bins, __global const uint *restrict cdf,
                              __global const int *restrict tables, const int each, __global int *restrict out)
{
    const int s = get_global_id(0), segment = get_global_id(1);
    if (s >= n || segment >= segments)
        return;
    const size_t pixel = (size_t)segment * n + s;
    const int2 span = spans[segment];
    const long width = (long)span.y - span.x;
    long place = (long)bins << (FRACTION - 1);
    if (width > 0) {
        const int value = values[pixel], b = bin_of(value, span, bins);
        __global const uint *below = cdf + (size_t)segment * (bins + 1) + b;
        const long part = ((((long)value - span.x) * bins - b * width) << FRACTION) / width;
        place = (((long)below[0] << FRACTION) + (below[1] - below[0]) * part) * bins / n;
    }
    const int k = (int)min(place >> FRACTION, bins - 1l);
    __global const int *table = tables + (size_t)(segment / each) * (bins + 1) + k;
    const long rise = ((long)table[1] - table[0]) * (place - ((long)k << FRACTION));
    out[pixel] = (int)(table[0] + ((rise + (1l << (FRACTION - 1))) >> FRACTION));
}

// The sum of |before - after| over each run: sums (segments, runs).
__kernel void matching_distance(__global const int *restrict before, __global const int *restrict after,
                                const int segments, const int n, const int runs, const int length,
                                __global long *restrict sums)
{
    RUN;
    long sum = 0;
    for (int i = from; i < to; ++i)
        sum += abs_diff(before[here + i], after[here + i]);
    sums[r] = sum;
}

// Over each segment: totals (segments,). One work-item per segment.
__kernel void matching_sum(__global const long *restrict sums, const int segments, const int runs,
                           __global long *restrict totals)
{
    const int s = get_global_id(0);
    if (s >= segments)
        return;
    long sum = 0;
    for (int i = 0; i < runs; ++i)
        sum += sums[s * runs + i];
    totals[s] = sum;
}

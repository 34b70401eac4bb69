// SPDX-License-Identifier: BSD-3-Clause
#include "common/border.h"

// Local texture measures of one level, De Bonet's equation (7), in integers: F^0 is the band, F^j = G * f_j.
//
// picture   (planes, rows, cols)                   G
// band      (planes, rows, cols)                   L
// taps      (count, side, side)                    f_j in 2^-14, laid over the picture as they are, without turning
// features  (rows * cols, planes * (1 + count))    out; F^0 .. F^count of the first plane, then of the next
// One work-item per pixel and feature. Sums are 64 bits wide, so nothing is rounded before the end.
__kernel void filters(__global const int *restrict picture, __global const int *restrict band, const int planes,
                      const int rows, const int cols, const int torus, __global const int *restrict taps,
                      const int count, const int side, __global int *restrict features)
{
    const int s = get_global_id(0), feature = get_global_id(1), all = planes * (1 + count);
    if (s >= rows * cols || feature >= all)
        return;
    const int plane = feature / (1 + count), f = feature % (1 + count);
    if (f == 0) {
        features[s * all + feature] = band[plane * rows * cols + s];
        return;
    }
    __global const int *g = picture + plane * rows * cols;
    __global const int *tap = taps + (f - 1) * side * side;
    const int i = s / cols - side / 2, j = s % cols - side / 2;
    long sum = 0;
    for (int a = 0; a < side; ++a)
        for (int b = 0; b < side; ++b)
            sum += (long)tap[a * side + b] * g[within(i + a, rows, torus) * cols + within(j + b, cols, torus)];
    features[s * all + feature] = (int)((sum + (1 << 13)) >> 14);
}

// SPDX-License-Identifier: BSD-3-Clause
#include "common/lattice.h"

// The finish: what the neighbours' sources say of a site, weighted by their distance,
//
//   sum_r w_r (Y[p_r + (s - r)] - Y[p_s]) / sum_r w_r,
//
// over those r whose p_r + (s - r) lies in the sample and may be used, s among them. What is from nowhere says nothing,
// and stays, as does what nobody says anything of. All in whole numbers, so where all continue one another nothing
// changes. Rounded to 1 / scale of a grey level, half up.
//
// source  (H, W)               pixel index in the sample of each site's source
// offsets (N, 2), weights (N,) of the sites around, itself included
// sample  (C, plane)           grey levels; `pitch` pixels to a row, a margin around rows x cols of them
// given   (H, W)               1 where a site's value is given
// values  (C.., area)          grey levels of the sites
// inside  (plane,)             whether a pixel of it is known and may be used
// out     (C, count)           for the sites first .. first + count - 1, row by row
// One work-item per site.
static inline int within(const int row, const int col, const int pitch, const int margin, const int rows, const int cols,
                         __global const uchar *restrict inside)
{
    if (row < margin || row >= margin + rows || col < margin || col >= margin + cols)
        return -1;
    return inside[row * pitch + col] ? row * pitch + col : -1;
}

__kernel void finish(const Lattice g, const int first, const int count, __global const int *restrict source,
                     __global const int *restrict offsets, __global const int *restrict weights, const int N,
                     __global const float *restrict sample, const int plane, const int pitch, const int margin,
                     const int rows, const int cols, __global const uchar *restrict inside,
                     __global const uchar *restrict given, __global const ushort *restrict values, const int area,
                     const int scale, __global short *restrict out)
{
#define WITHIN(row, col) within(row, col, pitch, margin, rows, cols, inside)
    const int n = get_global_id(0);
    if (n >= count)
        return;
    const int i = (first + n) / g.cols, j = (first + n) % g.cols, own = source[first + n];
    long sum[C];
    int total = 0;
    for (int c = 0; c < C; ++c)
        sum[c] = 0;
    for (int k = 0; k < N && own >= 0; ++k) {
        const int a = DOWN(offsets + AXES * k), b = RIGHT(offsets + AXES * k);
        const int r = a == 0 && b == 0 ? first + n : neighbour(g, i, j, offsets + AXES * k);
        const int p = r < 0 || source[r] < 0 ? -1 : WITHIN(source[r] / pitch - a, source[r] % pitch - b);
        const int q = r < 0 || !given[r] ? -1 : WITHIN(own / pitch + a, own % pitch + b);
        if (p < 0 && q < 0)
            continue;
        total += weights[k];
        for (int c = 0; c < C; ++c) {
            const int said = p < 0 ? (int)values[c * area + r] : (int)sample[c * plane + p];
            sum[c] += (long)weights[k] * (said - (int)sample[c * plane + (p < 0 ? q : own)]);
        }
    }
    for (int c = 0; c < C && own < 0; ++c)
        out[c * count + n] = 0;
    for (int c = 0; c < C && own >= 0; ++c) {
        const long twice = 2 * scale * sum[c] + total, whole = max(2 * total, 1), by = twice / whole;
        out[c * count + n] = (short)(by - (by * whole > twice ? 1 : 0));
    }
}

// SPDX-License-Identifier: BSD-3-Clause
// The local conditional probability density function as a table over grey levels, equations (6) to (8) and (12),
//
//   P(x) ~ sum_p w_p exp(-|x - y_p|^2 / 2h^2),   w_p = exp(-d_p / 2h^2),   d_p = sum_r ((x_r - y_r)(1 - t_r))^2,
//
// and its mode (ICM of a density). A draw needs no table: relax.h.
//
// Weights are integers, zero below 2^-40 of the largest: common/parzen.h. No distance is kept: each is evaluated again,
// for the least, for the sums of weights and for the source.
#pragma OPENCL FP_CONTRACT OFF
#include "mrf/costs.h"
#include "common/parzen.h"
#include "mrf/propose.h"

#ifndef CHANNELS
#define CHANNELS MADE // of what candidates count for
#endif

// W_p times the kernel of equation (7) around y_p, at grey levels x_c in all channels but one.
static inline ulong weight_at(ulong w, __global const float *y, const int plane, const __private int *x, const int but,
                              __global const float *window, const int radius)
{
    for (int c = 0; c < CHANNELS && w; ++c)
        if (c != but)
            w = weight_near(w, abs((int)y[c * plane] - x[c]), window, radius);
    return w;
}

// After FIELD the arguments of both kernels are
//
// own  (CHANNELS, plane)  what a candidate counts for, at its place in `levels`: its grey levels
// greys                   number of grey levels
#define COUNTED __global const float *restrict own, const int greys
#define EVALUATED(p, factor)                                                                                           \
    with_costs(distance_in_lanes(levels + at[p], u, xu, g.plane, g.row_stride, g.layer_stride, UNBOUNDED), p, factor,  \
               site, COSTED)

// The density over grey levels and its mode, of several levels the lowest. From the pixel of the nearest candidate on,
// each channel in turn, and once more, takes the mode given the others; the source gives most.
//
// window  (radius + 1,)   exp(-k^2 / 2h^2)
// mass    (S, greys)      scratch: sum of the weights per grey level
// table   (S, greys)      out: f(x) of the last channel, up to a factor: devices may round a division as they like
// choice  (S,), mode (CHANNELS, S)   out: pixel index in the sample, and grey levels
__kernel void lcpdf_density(FIELD, COUNTED, __global const float *restrict window, __global ulong *restrict mass,
                            __global float *restrict table, __global int *restrict choice, __global ushort *restrict mode)
{
    const int s = first + (int)get_global_id(0);
    if (s >= S)
        return;
    const int site = sites[s], i = site / g.lattice.cols, j = site % g.lattice.cols;
    int row[ROWS], col[SIDE], warmth[2];
    ALIGNED float u[CELLS * CONFIDENCES * 16], xu[CELLS * C * 16];
    square_around(g.lattice, i, j, row, col);
    gather(g, site, i, j, row, col, values, source, temperature, offsets, disc, u, xu, warmth);
    __global ulong *m = mass + (size_t)s * greys;
    __global float *f = table + (size_t)s * greys;

    // The candidates that continue a neighbour's source, each once, and the nearest of all.
    int next[N], coherent = 0, nearest = 0;
    ulong seen = 0;
    for (int k = 0; k < g.neighbours && g.discount < 1.0f; ++k) {
        const int r = neighbour_in_square(g.lattice, site, i, j, row, col, offsets + AXES * k);
        const int p = r < 0 || temperature[r] >= UNTOUCHED ? -1 : continuing(index_of, source[r], reach[k], g.pixels);
        coherent = proposed(p, next, coherent, &seen);
    }
    float smallest = INFINITY;
    for (int p = 0; p < g.candidates; ++p) {
        const float d = EVALUATED(p, 1.0f);
        nearest = d < smallest ? p : nearest;
        smallest = fmin(d, smallest);
    }
    for (int n = 0; n < coherent; ++n) {
        const float d = EVALUATED(next[n], g.discount);
        nearest = d < smallest || (d == smallest && next[n] < nearest) ? next[n] : nearest;
        smallest = fmin(d, smallest);
    }
#define WEIGHT(p, factor, but)                                                                                         \
    weight_at(weight(EVALUATED(p, factor), smallest, g.scale), own + at[p], g.plane, x, but, window, g.radius)
#define OWN_LEVEL(p, c) (int)own[(c) * g.plane + at[p]]

    int x[C];
    for (int c = 0; c < CHANNELS; ++c)
        x[c] = OWN_LEVEL(nearest, c);
    for (int n = 0; n < (CHANNELS > 1 ? 2 * CHANNELS : 1); ++n) {
        const int c = n % CHANNELS;
        for (int v = 0; v < greys; ++v) {
            m[v] = 0;
            f[v] = 0.0f;
        }
        for (int p = 0; p < g.candidates; ++p)
            m[OWN_LEVEL(p, c)] += WEIGHT(p, 1.0f, c);
        for (int k = 0; k < coherent; ++k)
            m[OWN_LEVEL(next[k], c)] += WEIGHT(next[k], g.discount, c) - WEIGHT(next[k], 1.0f, c);
        for (int v = 0; v < greys; ++v)
            for (int y = max(0, v - g.radius); m[v] && y <= min(greys - 1, v + g.radius); ++y)
                f[y] = fma((float)m[v], window[abs(y - v)], f[y]);
        x[c] = 0;
        for (int v = 1; v < greys; ++v)
            x[c] = f[v] > f[x[c]] ? v : x[c];
    }
    ulong most = 0;
    for (int p = 0; p < g.candidates; ++p) {
        const ulong w = WEIGHT(p, 1.0f, -1);
        nearest = w > most ? p : nearest;
        most = max(w, most);
    }
    for (int n = 0; n < coherent; ++n) {
        const ulong w = WEIGHT(next[n], g.discount, -1);
        nearest = w > most || (w == most && next[n] < nearest) ? next[n] : nearest;
        most = max(w, most);
    }
    choice[s] = positions[nearest];
    for (int c = 0; c < CHANNELS; ++c)
        mode[c * S + s] = (ushort)x[c];
}

// Equations (4) and (5): how often each grey level stands, in the sample, amid exactly the neighbours of the site. A
// match is a cost of 0, so a neighbour at temperature 1 matches anything.
//
// counts   (S, greys)   out: F(x, neighbours)
__kernel void lcpdf_histogram(FIELD, COUNTED, __global uint *restrict counts)
{
    const int s = first + (int)get_global_id(0);
    if (s >= S)
        return;
    const int site = sites[s], i = site / g.lattice.cols, j = site % g.lattice.cols;
    int row[ROWS], col[SIDE], warmth[2];
    ALIGNED float u[CELLS * CONFIDENCES * 16], xu[CELLS * C * 16];
    square_around(g.lattice, i, j, row, col);
    gather(g, site, i, j, row, col, values, source, temperature, offsets, disc, u, xu, warmth);
    __global uint *F = counts + (size_t)s * greys;
    for (int x = 0; x < greys; ++x)
        F[x] = 0;
    for (int p = 0; p < g.candidates; ++p)
        if (EVALUATED(p, 1.0f) == 0.0f)
            ++F[(int)own[at[p]]];
}

// SPDX-License-Identifier: BSD-3-Clause
// The local conditional probability density function, equations (6) to (8) and (12), and what relaxation takes
// from it: a draw (Gibbs), the nearest candidate or the mode (ICM), or the whole table of probabilities.
//
//   P(x) ~ sum_p w_p exp(-|x - y_p|^2 / 2h^2),   w_p = exp(-d_p / 2h^2),   d_p = sum_r ((x_r - y_r)(1 - t_r))^2
//
// Weights are integers, zero below 2^-40 of the largest: common/parzen.h.
#pragma OPENCL FP_CONTRACT OFF
#include "common/confidence.h"
#include "common/distance.h"
#include "common/lattice.h"
#include "common/parzen.h"
#include "common/philox.h"
#include "common/vector.h"

#ifndef BLOCK
#define BLOCK 64 // candidates to a block, each with its smallest distance
#endif
#ifndef STEP
#define STEP 4 // candidates that are kept in registers together
#endif

// The distances of V sites to STEP candidates. This loop is the cost of the exact search.
//
// confidence (N, P), weighted (N, C, P)   from neighbourhood.cl, from the first site on; -D OWN: confidence (N, C, P)
// sample     (C, plane)                   working grey levels as float
// candidates (STEP,)                      pixel index in the sample
// reach      (N,)                         pixel offset in the sample of each neighbour
// d          (STEP,)                      out
inline void weigh(__global const float *restrict confidence, __global const float *restrict weighted, const int N,
                  const int P, __global const float *restrict sample, const int plane,
                  __global const int *restrict candidates, __global const int *restrict reach, __private vec *d)
{
    __global const float *y[STEP];
#pragma unroll
    for (int q = 0; q < STEP; ++q) {
        y[q] = sample + candidates[q];
        d[q] = 0.0f;
    }
    for (int k = 0; k < N; ++k) {
        const int o = reach[k];
#pragma unroll
        for (int c = 0; c < C; ++c) {
            const vec u = LOAD(confidence + (k * CONFIDENCES + CONFIDENT(c)) * P);
            const vec xu = LOAD(weighted + (k * C + c) * P);
#pragma unroll
            for (int q = 0; q < STEP; ++q) {
                const vec e = GAP((vec)y[q][c * plane + o], u, xu);
                d[q] = fma(e, e, d[q]);
            }
        }
    }
}

// Equation (12): d_p for V sites and one block of candidates, neighbours in canonical order, channels inside.
//
// confidence (N, P), weighted (N, C, P)   from neighbourhood.cl
// sample     (C, plane)                   working grey levels as float
// candidates (blocks * BLOCK,)            pixel index in the sample; past `count` they repeat and get d = infinity
// reach      (N,)                         pixel offset in the sample of each neighbour
// distance   (blocks * BLOCK, P)          out
// nearest    (blocks, P)                  out: smallest d of each block
// One work-item per (V sites, block).
__kernel void lcpdf_distance(__global const float *restrict confidence, __global const float *restrict weighted,
                             const int N, const int P, __global const float *restrict sample, const int plane,
                             __global const int *restrict candidates, const int count,
                             __global const int *restrict reach, const int blocks,
                             __global float *restrict distance, __global float *restrict nearest)
{
    const int s = get_global_id(0) * V, block = get_global_id(1);
    if (s >= P || block >= blocks)
        return;
    vec least = INFINITY;
    for (int p = block * BLOCK; p < (block + 1) * BLOCK; p += STEP) {
        vec d[STEP];
        weigh(confidence + s, weighted + s, N, P, sample, plane, candidates + p, reach, d);
#pragma unroll
        for (int q = 0; q < STEP; ++q) {
            const vec dq = p + q < count ? d[q] : (vec)INFINITY;
            STORE(dq, distance + (p + q) * P + s);
            least = fmin(least, dq);
        }
    }
    STORE(least, nearest + block * P + s);
}

// Distances that coherence has divided carry the sign bit as a mark.
#define DISTANCE(p) fabs(distance[(p) * P + s])
inline float smallest_of(__global const float *nearest, const int blocks, const int P, const int s)
{
    float least = INFINITY;
    for (int b = 0; b < blocks; ++b)
        least = fmin(least, nearest[b * P + s]);
    return least;
}

// Loop over the candidates that can have weight, in ascending order.
#define FOR_CANDIDATES(p)                                                                                              \
    for (int b_ = 0; b_ < blocks; ++b_)                                                                                \
        if ((nearest[b_ * P + s] - smallest) * scale < NO_WEIGHT)                                                      \
            for (int p = b_ * BLOCK; p < (b_ + 1) * BLOCK; ++p)

// The Gibbs sampler: a candidate drawn with probability proportional to its mass, then each channel's grey level
// from the kernel around the candidate's, cut off at the legal levels.
//
// noise    (2 * radius + 1,)  cumulative probabilities of the steps -radius..radius in 2^-32; radius < 0: no step,
//                             the pixel is the sample's own
// choice   (S,)               out: pixel index in the sample
// values   (C, S)             out: working grey level
__kernel void lcpdf_draw(__global const float *restrict distance, __global const float *restrict nearest,
                         const int blocks, const int S, const int P, const float scale,
                         __global const float *restrict sample, const int plane,
                         __global const int *restrict candidates, __global const int *restrict sites,
                         const Lattice g, const ulong seed, const uint level, const uint turn, __global const uint *restrict noise,
                         const int radius, const int top, __global int *restrict choice,
                         __global ushort *restrict values)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    const float smallest = smallest_of(nearest, blocks, P, s);
#define MASS(p) mass_of(DISTANCE(p), smallest, scale, sample, plane, candidates[p], noise, radius, top)
    ulong total = 0;
    FOR_CANDIDATES(p) total += MASS(p);

    const ulong place = place_of(g, ROW_OF(g, sites[s]), COL_OF(g, sites[s]));
    const uint4 bits = draw4(seed, level, turn, place, PURPOSE_DRAW, 0);
    const ulong target = below(bits.x, bits.y, total);
    ulong sum = 0;
    int chosen = -1;
    for (int b = 0; b < blocks && chosen < 0; ++b) {
        if ((nearest[b * P + s] - smallest) * scale >= NO_WEIGHT)
            continue;
        for (int p = b * BLOCK; p < (b + 1) * BLOCK && chosen < 0; ++p) {
            sum += MASS(p);
            chosen = sum > target ? p : -1;
        }
    }
    const int from = candidates[chosen];
    choice[s] = from;
    for (int c = 0; c < MADE; ++c) {
        int x = (int)sample[c * plane + from];
        if (radius >= 0)
            x += step_from(noise, radius, x, top, draw4(seed, level, turn, place, PURPOSE_DRAW, 1 + c).x);
        values[c * S + s] = (ushort)x;
    }
}

// ICM over sample positions: the nearest candidate, of several the first. Where a bound is of no use, as it knows nothing
// of confidences of their own; elsewhere nearest.cl keeps no distance.
__kernel void lcpdf_least(__global const float *restrict distance, __global const float *restrict nearest,
                          const int blocks, const int S, const int P, const float scale,
                          __global const float *restrict sample, const int plane,
                          __global const int *restrict candidates, __global int *restrict choice,
                          __global ushort *restrict values)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    const float smallest = smallest_of(nearest, blocks, P, s);
    int b = 0;
    while (nearest[b * P + s] > smallest)
        ++b;
    int p = b * BLOCK;
    while (DISTANCE(p) > smallest)
        ++p;
    choice[s] = candidates[p];
    for (int c = 0; c < MADE; ++c)
        values[c * S + s] = (ushort)sample[c * plane + candidates[p]];
}

// W_p times the kernel of equation (7) around y_p, at a site's grey levels x_c in all channels but one.
inline ulong weight_at(ulong w, __global const float *y, const int plane, __global const ushort *x, const int S,
                       const int but, __global const float *window, const int radius)
{
    for (int c = 0; c < MADE; ++c)
        if (c != but)
            w = weight_near(w, abs((int)y[c * plane] - (int)x[c * S]), window, radius);
    return w;
}

// The density of equation (7) over grey levels and its mode (ICM), of several levels the lowest. From the pixel of the
// nearest candidate on, each channel in turn, and once more, takes the mode given the others; the source gives most.
//
// window  (radius + 1,)   exp(-k^2 / 2h^2)
// mass    (S, greys)      scratch: sum of the weights per grey level
// table   (S, greys)      out: f(x) of the last channel, up to a factor: devices may round a division as they like
// choice  (S,), values (C, S)   in: of the nearest candidate, by lcpdf_least (one channel: anything); out: of the mode
__kernel void lcpdf_density(__global const float *restrict distance, __global const float *restrict nearest,
                          const int blocks, const int S, const int P, const float scale,
                          __global const float *restrict sample, const int plane,
                          __global const int *restrict candidates, __global const float *restrict window,
                          const int radius, const int greys, __global ulong *restrict mass,
                          __global float *restrict table, __global int *restrict choice,
                          __global ushort *restrict values)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    const float smallest = smallest_of(nearest, blocks, P, s);
    __global ulong *m = mass + (size_t)s * greys;
    __global float *f = table + (size_t)s * greys;
#define WEIGHT(p, but)                                                                                                 \
    weight_at(weight(DISTANCE(p), smallest, scale), sample + candidates[p], plane, values + s, S, but, window, radius)
    for (int n = 0; n < (MADE > 1 ? 2 * MADE : 1); ++n) {
        const int c = n % MADE;
        for (int x = 0; x < greys; ++x) {
            m[x] = 0;
            f[x] = 0.0f;
        }
        FOR_CANDIDATES(p) m[(int)sample[c * plane + candidates[p]]] += WEIGHT(p, c);
        for (int v = 0; v < greys; ++v)
            for (int x = max(0, v - radius); m[v] && x <= min(greys - 1, v + radius); ++x)
                f[x] = fma((float)m[v], window[abs(x - v)], f[x]);
        int mode = 0;
        for (int x = 1; x < greys; ++x)
            mode = f[x] > f[mode] ? x : mode;
        values[c * S + s] = (ushort)mode;
    }
    ulong most = 0;
    FOR_CANDIDATES(p)
    {
        const ulong w = WEIGHT(p, -1);
        if (w > most) {
            most = w;
            choice[s] = candidates[p];
        }
    }
}

// SPDX-License-Identifier: BSD-3-Clause
// ICM over sample positions without keeping a distance: for each site the candidate of the least squared distance of
// equation (12), divided where it continues a neighbour's source, and of several the first.
//
//   d_p = sum_r ((x_r - y_r)(1 - t_r))^2,   d'_p = discount d_p + cost_p, discount = 1 unless p is coherent
//
// Whoever is proved to lie beyond the best so far is skipped. Three facts make that exact: partial sums never fall, no
// cost (common/costs.h) is below 0, and a sum in another order differs by less than SLACK. What survives is weighed again in the
// canonical order.
#pragma OPENCL FP_CONTRACT OFF
#include "common/distance.h"
#include "common/coherence.h"
#include "common/level.h"
#include "common/costs.h"
#include "common/vector.h"

#ifndef C
#define C 1 // channels of a pixel
#endif
#ifndef STEP
#define STEP 2 // vectors of candidates that are weighed together
#endif
#ifndef CHECK
#define CHECK 4 // neighbours between two looks at the bound
#endif
#define WORDS (2 + C) // of a term: offset, u, x u
#define FEATURES 16   // of a neighbourhood
#define FEW 8         // of them, the first, for boxes and a first look
#define LEAF 64       // candidates to a leaf
#define MANY 512      // candidates that are weighed one by one before the scan takes over
#define BUCKETS 8     // of confidence
#if V == 1
#define BITS(x) as_int(x)
#else
#define BITS(x) JOIN(as_int, V)(x)
#endif

// d_p of one candidate, neighbours in canonical order, or a part of it that exceeds `most` already. `site` holds u and
// then x u of each neighbour.
inline float canonical(__global const float *site, __global const float *y, const int plane, __global const int *reach,
                       const int N, const float most)
{
    float d = 0.0f;
    for (int k = 0; k < N; ++k) {
        if (k % 8 == 0 && d > most)
            break;
        const float u = site[k * (1 + C)];
#pragma unroll
        for (int c = 0; c < C; ++c) {
            const float e = GAP(y[c * plane + reach[k]], u, site[k * (1 + C) + 1 + c]);
            d = fma(e, e, d);
        }
    }
    return d;
}

// The neighbourhood of a site, and the first bound: the candidates that continue a neighbour's source, and its own
// source.
//
// spread   (N,)                      order in which neighbours are best looked at: far from one another
// near     (S, N * (1 + C))          out: u and x u in canonical order
// penalty    (count,)                  what each candidate costs beside its distance
// terms    (S, N * (2 + C))          out: offset in the strip, bits of u and x u; the most certain first, not u = 0
// count    (S,)                      out: terms, a multiple of CHECK
// axes     (N * C, FEATURES)         orthonormal directions: see nearest_leaves
// middle                             the grey level that features are taken from
// features (S, FEATURES)             out: of the neighbours' grey levels, whatever their temperatures
// least    (S,), where (S,)          out: the least d' of these candidates and its place in the list
// certain  (S,)                      out: the smallest u
// One work-item per site.
__kernel __attribute__((vec_type_hint(float4))) void
nearest_begin(__global const int *restrict sites, const int S, const int N, __global const ushort *restrict values,
              __global const int *restrict source, __global const ushort *restrict temperature,
              const int area, __global const int2 *restrict offsets, const Lattice g,
              __global const int *restrict index_of, const int plane,
              __global const float *restrict sample, __global const int *restrict positions,
              __global const int *restrict reach, __global const int *restrict strip_reach,
              __global const int *restrict spread, const float discount, COSTS,
              __global const float *restrict axes, const float middle, __global float *restrict near,
              __global int *restrict terms, __global int *restrict count,
              __global float *restrict features, __global float *restrict least,
              __global int *restrict where, __global float *restrict certain)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    const int i = ROW_OF(g, sites[s]), j = COL_OF(g, sites[s]);
    __global float *here = near + s * (N * (1 + C));
    __global int *list = terms + s * (N * WORDS); // until the terms come, the places that neighbours propose
    int held[BUCKETS + 1];
    for (int b = 0; b <= BUCKETS; ++b)
        held[b] = 0;
    float16 feature = 0.0f;
    int hottest = 0;
    for (int k = 0; k < N; ++k) {
        const int r = neighbour(g, i, j, offsets[k].x, offsets[k].y);
        const int t = r < 0 ? UNTOUCHED : temperature[r];
        const float u = (float)(1024 - t) * 0x1p-10f;
        here[k * (1 + C)] = u;
        hottest = max(hottest, t);
        for (int c = 0; c < C; ++c) {
            const float x = t < UNTOUCHED ? (float)values[c * area + r] : 0.0f;
            here[k * (1 + C) + 1 + c] = x * u;
            feature = fma(vload16(k * C + c, axes), (float16)(x - middle), feature);
        }
        list[k] = -1;
        if (t >= UNTOUCHED)
            continue;
        ++held[BUCKETS - 1 - ((1024 - t) * BUCKETS - 1) / 1024 + 1];
        list[k] = continuing(index_of, source[r], reach[k], plane);
    }
    certain[s] = (float)(1024 - hottest) * 0x1p-10f;
    vstore16(feature, s, features);
    // The bound.
    const int own = number_of(index_of, source[sites[s]]);
    float best = INFINITY;
    int at = 0x7fffffff;
    if (own >= 0) {
        best = PLUS_COSTS(canonical(here, sample + positions[own], plane, reach, N, INFINITY), own, sites[s]);
        at = own;
    }
    int last = -1, before = -1;
    for (int k = 0; k < N; ++k) {
        const int p = list[k];
        if (p < 0 || p == last || p == before)
            continue;
        before = last;
        last = p;
        const float d =
            PLUS_COSTS(canonical(here, sample + positions[p], plane, reach, N, INFINITY) * discount, p, sites[s]);
        if (d < best || (d == best && p < at)) {
            best = d;
            at = p;
        }
    }
    // Terms by confidence, sorted by counting.
    for (int b = 1; b <= BUCKETS; ++b)
        held[b] += held[b - 1];
    const int m = held[BUCKETS], end = (m + CHECK - 1) / CHECK * CHECK;
    for (int n = 0; n < N; ++n) {
        const int k = spread[n];
        const float u = here[k * (1 + C)];
        if (u == 0.0f)
            continue;
        const int b = BUCKETS - 1 - ((int)(u * 1024.0f) * BUCKETS - 1) / 1024;
        __global int *term = list + held[b]++ * WORDS;
        term[0] = strip_reach[k];
        term[1] = as_int(u);
        for (int c = 0; c < C; ++c)
            term[2 + c] = as_int(here[k * (1 + C) + 1 + c]);
    }
    for (int n = m * WORDS; n < end * WORDS; ++n)
        list[n] = 0;
    count[s] = end;
    least[s] = best;
    where[s] = at;
}

// Candidates by their features, for sites whose neighbours are all certain enough. Features are projections of the
// neighbourhood on orthonormal axes, so with u the smallest of a site's
//
//   d_p >= u^2 |x - y|^2 >= u^2 sum_f (X_f - Y_f)^2,
//
// and no candidate beyond `radius` of the site's features can win. Leaves are LEAF candidates alike, in a box.
//
// box    (FEW, 2, leaves)          least and greatest feature of each leaf; leaves is a multiple of V
// rows   (FEATURES, leaves * LEAF) features of the candidates, leaf by leaf
// order  (leaves * LEAF,)          their places in the list
// blur                             how far rounding may have moved a site's features from a candidate's
// found, at, work (split, S)       out: as of nearest_scan
// open   (split, S)                out: whether nearest_scan has to search the site after all
__kernel __attribute__((vec_type_hint(vec))) void
nearest_leaves(__global const int *restrict sites, const int S, const int N, __global const float *restrict near, __global const float *restrict features,
               __global const float *restrict least, __global const int *restrict where,
               __global const float *restrict certain, __global const float *restrict box,
               __global const float *restrict rows, __global const int *restrict order, const int leaves,
               const float blur, __global const float *restrict sample, const int plane,
               __global const int *restrict positions, __global const int *restrict reach,
               COSTS, const int split, __global float *restrict found, __global int *restrict at, __global ulong *restrict work,
               __global int *restrict open)
{
    const int s = get_global_id(0) / split, turn = get_global_id(0) % split;
    if (s >= S)
        return;
    float best = least[s];
    int best_at = where[s];
    const float u = certain[s];
    int unfit = u < 0.5f || best == INFINITY;
    ulong done = 0;
    if (!unfit) {
        const float scale = 1.0f / u;
        float radius = sqrt(best) * scale + blur;
        radius *= radius * 1.0001f;
        int weighed = 0;
        for (int g = turn * V; g < leaves && !unfit; g += split * V) {
            vec gap = 0.0f;
            for (int f = 0; f < FEW; ++f) {
                const vec x = features[s * FEATURES + f];
                const vec low = LOAD(box + 2 * f * leaves + g), high = LOAD(box + (2 * f + 1) * leaves + g);
                const vec e = fmax(fmax(low - x, x - high), (vec)0.0f);
                gap = fma(e, e, gap);
            }
            done += 2 * FEW * V;
            if (!ANY(gap <= radius))
                continue;
            float gaps[V];
            STORE(gap, gaps);
            for (int l = 0; l < V; ++l) {
                if (gaps[l] > radius)
                    continue;
                done += 2 * FEATURES * LEAF;
                for (int v = (g + l) * LEAF; v < (g + l + 1) * LEAF; v += V) {
                    vec d = 0.0f;
                    for (int f = 0; f < FEW; ++f) {
                        const vec e = LOAD(rows + f * leaves * LEAF + v) - features[s * FEATURES + f];
                        d = fma(e, e, d);
                    }
                    if (!ANY(d <= radius))
                        continue;
                    for (int f = FEW; f < FEATURES; ++f) {
                        const vec e = LOAD(rows + f * leaves * LEAF + v) - features[s * FEATURES + f];
                        d = fma(e, e, d);
                    }
                    if (!ANY(d <= radius))
                        continue;
                    float one[V];
                    STORE(d, one);
                    for (int w = 0; w < V; ++w) {
                        const int p = order[v + w];
                        if (one[w] > radius || (best == 0.0f && p >= best_at) || PLUS_COSTS(0.0f, p, sites[s]) > best)
                            continue;
                        __global const float *y = sample + positions[p];
                        const float d_p =
                            PLUS_COSTS(canonical(near + s * (N * (1 + C)), y, plane, reach, N, best), p, sites[s]);
                        ++weighed;
                        if (d_p < best || (d_p == best && p < best_at)) {
                            best = d_p;
                            best_at = p;
                            radius = sqrt(best) * scale + blur;
                            radius *= radius * 1.0001f;
                        }
                    }
                }
            }
            unfit = weighed > MANY;
        }
        done += (ulong)weighed * (2 * N * C);
    }
    found[turn * S + s] = best;
    at[turn * S + s] = best_at;
    work[turn * S + s] = done;
    open[turn * S + s] = unfit;
}

// All candidates against the bound, in blocks of STEP vectors of neighbours in a row of the sample.
//
// strip  (C, size)        the sample's pixels of this level, row by row, from which candidates and neighbours are read
// first, pitch            of the candidates' own pixels in the strip; rows x cols candidates, `high` rows to a layer
// thick                   pixels of the strip to a layer
// slack                   what a sum in another order may exceed this one by, as a factor
// all, open  (split, S)   whether all sites are to be searched, or those for which some of these are not 0
// found, at  (.., S)      out, from this row on: the least d' so far and its place
// work       (.., S)      out, likewise: fma done
// `split` work-items to a site, side by side, take its blocks in turn.
__kernel __attribute__((vec_type_hint(vec))) void
nearest_scan(__global const int *restrict sites, const int S, const int N, __global const int *restrict terms, __global const int *restrict count,
             __global const float *restrict near, __global const float *restrict least,
             __global const int *restrict where, __global const float *restrict strip, const int size,
             const int first, const int pitch, const int rows, const int cols, const int high, const int thick,
             __global const int *restrict strip_reach, COSTS, const float slack,
             const int split,
             const int all, __global const int *restrict open, const int row,
             __global float *restrict found, __global int *restrict at,
             __global ulong *restrict work)
{
    const int s = get_global_id(0) / split, turn = get_global_id(0) % split;
    if (s >= S)
        return;
    const int wide = (cols + V * STEP - 1) / (V * STEP), m = count[s];
    __global const int *list = terms + s * (N * WORDS);
    float best = least[s];
    int best_at = where[s];
    int limit = as_int(best * slack) + 1; // bits of the least sum that is too far; equals have a chance
    ulong done = 0;
    int wanted = all;
    for (int n = 0; !all && n < split; ++n)
        wanted |= open[n * S + s];
    for (int b = turn; wanted && b < rows * wide; b += split) {
        const int i = b / wide, j = b % wide * (V * STEP);
        __global const float *y = strip + first + STRIP_ROW(i, high, thick, pitch) + j;
        vec d[STEP];
#pragma unroll
        for (int q = 0; q < STEP; ++q) {
            d[q] = 0.0f; // with the phases, which are known at once
            for (int c = 0; c < WAVES; ++c) {
                const float x = (float)phases[c * area_ + sites[s]];
                const vec e = (x - LOAD(waves + c * listed + i * cols + j + q * V)) * certain_;
                d[q] = fma(e, e, d[q]);
            }
            d[q] = fmax(d[q] - free_, (vec)0.0f);
        }
        int k = 0, alive = 1;
        while (alive && k < m) {
#pragma unroll
            for (int n = 0; n < CHECK; ++n) {
                __global const int *term = list + (k + n) * WORDS;
                const int o = term[0];
                const vec u = as_float(term[1]);
#pragma unroll
                for (int c = 0; c < C; ++c) {
                    const vec xu = as_float(term[2 + c]);
#pragma unroll
                    for (int q = 0; q < STEP; ++q) {
                        const vec e = GAP(LOAD(y + c * size + o + q * V), u, xu);
                        d[q] = fma(e, e, d[q]);
                    }
                }
            }
            k += CHECK;
            vec low = d[0];
#pragma unroll
            for (int q = 1; q < STEP; ++q)
                low = fmin(low, d[q]);
            alive = ANY(BITS(low) < limit);
        }
        done += (ulong)(2 * C * k) * min(cols - j, V * STEP);
        for (int q = 0; alive && q < STEP; ++q) {
            float one[V];
            STORE(d[q], one);
            for (int v = 0; v < V; ++v) {
                const int col = j + q * V + v, p = i * cols + col;
                if (col >= cols || as_int(one[v]) >= limit)
                    continue;
                const float exact =
                    PLUS_COSTS(canonical(near + s * (N * (1 + C)), y + q * V + v, size, strip_reach, N, best), p, sites[s]);
                if (exact < best || (exact == best && p < best_at)) {
                    best = exact;
                    best_at = p;
                    limit = as_int(best * slack) + (best > 0.0f); // what follows must be nearer
                }
            }
        }
    }
    found[(row + turn) * S + s] = best;
    at[(row + turn) * S + s] = best_at;
    work[(row + turn) * S + s] = done;
}

// The nearest of all: the first bound's, and those of every part.
//
// found, at, work (split, S)   from nearest_leaves and nearest_scan
// tally (S,)                   in and out: fma done so far for the site of this number
// One work-item per site.
__kernel void nearest_end(const int S, __global const float *restrict least,
                          __global const int *restrict where, const int split, __global const float *restrict found,
                          __global const int *restrict at, __global const ulong *restrict work,
                          __global const float *restrict sample, const int plane,
                          __global const int *restrict positions, __global ulong *restrict tally,
                          __global int *restrict choice, __global ushort *restrict values)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    float best = least[s];
    int p = where[s];
    for (int n = 0; n < split; ++n) {
        const float d = found[n * S + s];
        const int here = at[n * S + s];
        if (d < best || (d == best && here < p)) {
            best = d;
            p = here;
        }
        tally[s] += work[n * S + s];
    }
    const int from = positions[p];
    choice[s] = from;
    for (int c = 0; c < C; ++c)
        values[c * S + s] = (ushort)sample[c * plane + from];
}

// SPDX-License-Identifier: BSD-3-Clause
// Step 6.2.2 of Algorithm 1 in one kernel: the relaxation of a site, the sites of a step in parallel. The steps are
//
//   6.2.2.1  gather the neighbourhood of s, propose candidates, and evaluate them: equation (12) and common/costs.h;
//   6.2.2.2  choose one of them: ICM that of least cost, the Gibbs sampler that of least cost - 2h^2 G with the noise
//            of common/gumbel.h, a draw from the LCPDF, equation (7); of equals the first in the sample;
//   6.2.2.3  cool the site, equation (13).
//
// There are two proposers. By default there are, in this order and each of them once,
//
//   1. p_r + (s - r), where the sample continues the source p_r of neighbour r, r one of the SUGGESTING nearest
//      neighbours that a relaxation has touched (t < 1);
//   2. the present source of s;
//   3. `chance` positions at random, and one where there would be none at all.
//
// -D EXACT proposes every candidate of the level, and skips those that are proved to cost more than the best so far.
//
// What relaxes together are the sites first .. S - 1 of a list, one work-item each, and it does so in place, since no two
// of them are neighbours. -D APART writes to new_values (C, S), new_source and new_temperature (S,) instead.
#pragma OPENCL FP_CONTRACT OFF
#include "common/costs.h"
#include "common/cool.h"
#include "common/gumbel.h"
#include "common/parzen.h"
#include "common/propose.h"

#ifdef APART
#define NEW(name) new_##name
#define PLACE(s, site) s
#define STRIDE(S, g) S
#else
#define NEW(name) name
#define PLACE(s, site) site
#define STRIDE(S, g) g.area
#endif
#ifndef SLOTS
#define SLOTS 64 // candidates that a site may have
#endif
#define SUGGESTING 12 // nearest neighbours that suggest a candidate each
#define AGAIN 4       // what being a neighbour's source costs, over continuing it
#ifndef N
#define N 64 // most neighbours
#endif
#ifndef STEP
#define STEP 4 // vectors of candidates in registers together
#endif
#define CHECK 4    // neighbours between two looks at the bound
#define NOISY 8    // neighbours before the noise of a draw is looked at, since it costs as much as many
#define BUCKETS 8  // of confidence, the most certain neighbours first
#define SLACK(terms) (1.0f + ((terms) + 8) * 0x1p-22f) // what a sum in another order may exceed this one by
#if V == 1
#define BITS(x) as_int(x)
#else
#define BITS(x) JOIN(as_int, V)(x)
#endif

// Units of candidates to a run: common/gumbel.h.
#define WIDTH(g) (((g).cols + (g).runs * LANES - 1) / ((g).runs * LANES))

// -G of candidate p; of a density, more by the logarithm of the share of the kernel around it that is legal.
static inline float noise_of(const Level g, const uint turn, const ulong place, const int p, __global const float *y,
                      __global const uint *noise)
{
    const int row = p / g.cols, col = p % g.cols, run = row * g.runs + col % g.runs, n = col / g.runs;
    float found = minus_gumbel_of(g.seed, g.level, turn, place, run * WIDTH(g) + n / LANES, n % LANES);
    for (int c = 0; c < C && g.radius >= 0; ++c)
        found -= log32((float)legal_mass(noise, g.radius, (int)y[c * g.plane], g.top)) - LOG_ONE;
    return found;
}

// How often candidate p continues a neighbour, and AGAIN times how often it is one's source.
static inline float repeated(const int p, const __private int *next, const __private int *same, const int neighbours)
{
    int found = 0;
    for (int k = 0; k < neighbours; ++k)
        found += (next[k] == p) + AGAIN * (same[k] == p);
    return (float)found;
}

// Evaluate candidate p, and keep it if it is the best so far. Noise takes `most` away at most.
#define CONSIDER(p, factor)                                                                                            \
    {                                                                                                                  \
        float total_ = EVALUATED(p, factor, site);                                                                     \
        if (total_ - most <= best) {                                                                                   \
            total_ += REPEATED(p);                                                                                     \
            if (g.spread > 0.0f)                                                                                       \
                total_ = fma(g.spread, noise_of(g, turn, place, p, levels + at[p], noise), total_);                    \
            if (total_ < best || (total_ == best && (p) < best_at)) {                                                  \
                best = total_;                                                                                         \
                best_at = p;                                                                                           \
            }                                                                                                          \
        }                                                                                                              \
    }

// sites    (S,)         number of each site
// values (C, area), source (area,), temperature (area,)   the field
// offsets  (N, AXES)     of the neighbours, canonical order
// reach    (N,)         pixel offset of each in the sample
// index_of (pixels,)    number of the candidate at a pixel of the sample, -1 where there is none
// positions (count,)    pixel index of each candidate
// disc     (CELLS, 16)  1 on the neighbourhood, 0 elsewhere
// looks    (N, 2)       lane of each neighbour in the square and its offset in `levels`, close ones far apart
// noise                 cumulative kernel of equation (7) over grey levels: common/parzen.h
// work                  in and out: candidates that each site has evaluated; EXACT: multiply-adds of site s
__kernel void relax(__global const int *restrict sites, const int first, const int S, __global ushort *values,
                    __global int *source, __global ushort *temperature, const Level g,
                    __global const int *restrict offsets, __global const int *restrict reach,
                    __global const int *restrict index_of, __global const int *restrict positions,
                    __global const float *restrict disc, __global const int2 *restrict looks, COSTS,
                    __global const uint *restrict noise, const uint turn,
#ifdef EXACT
                    __global ulong *restrict work,
#else
                    __global int *restrict work,
#endif
                    __global ushort *restrict new_values, __global int *restrict new_source,
                    __global ushort *restrict new_temperature)
{
    int s = first + (int)get_global_id(0);
#ifdef APART
    s = min(s, S - 1); // an idle work-item would read at wild indices on Intel's runtime
#else
    if (s >= S)
        return;
#endif
    const Lattice h = g.lattice;
    const int site = sites[s], i = site / h.cols, j = site - i * h.cols;
    const ulong place = place_of(h, i, j);

    // 6.2.2.1: the neighbourhood.
    AROUND(h, i, j);
    const int2 heat = gather(g, site, i, j, row, col, values, source, temperature, offsets, disc, u, xu);

    const float most = MOST_GUMBEL * g.spread;
    float best = INFINITY;
    int best_at = 0x7fffffff;
    ulong seen = 0;
#ifndef EXACT
#define REPEATED(p) 0.0f
    int list[SLOTS], m = 0;
    for (int k = 0; k < min(SUGGESTING, g.neighbours); ++k) {
        const int r = NEIGHBOUR(h, k);
        if (r >= 0 && temperature[r] < UNTOUCHED)
            m = proposed(continuing(index_of, source[r], reach[k], g.pixels), list, m, &seen);
    }
    const int suggested = m;
    m = proposed(number_of(index_of, source[site]), list, m, &seen);
    const int draws = max(g.chance, m == 0 ? 1 : 0);
    for (int k = 0; k < draws; k += 4) {
        const uint4 bits = draw4(g.seed, g.level, turn, place, PURPOSE_SEARCH, k / 4);
        const uint word[4] = {bits.x, bits.y, bits.z, bits.w};
        for (int n = 0; n < 4 && k + n < draws; ++n)
            m = proposed((int)((ulong)word[n] * (uint)g.candidates >> 32), list, m, &seen);
    }
    for (int k = 0; k < m; ++k)
        CONSIDER(list[k], k < suggested ? g.discount : 1.0f)
#else
    // Candidates that continue or are a neighbour's source.
    int next[N + 1], same[N];
    for (int k = 0; k < g.neighbours; ++k) {
        const int r = NEIGHBOUR(h, k), from = r >= 0 && temperature[r] < UNTOUCHED ? source[r] : -1;
        next[k] = continuing(index_of, from, reach[k], g.pixels);
        same[k] = number_of(index_of, from);
    }
    next[g.neighbours] = number_of(index_of, source[site]);
#define REPEATED(p) (g.novelty > 0.0f ? g.novelty * repeated(p, next, same, g.neighbours) : 0.0f)
    int list[N + 1], known = 0;
    for (int k = 0; k <= g.neighbours; ++k) {
        const int before = known;
        known = proposed(next[k], list, known, &seen);
        if (known > before)
            CONSIDER(next[k], k < g.neighbours ? g.discount : 1.0f)
    }

    // The terms of a sum, the most certain first.
    int m = 0, to[N + 1 + CHECK];
    float tu[(N + 1 + CHECK) * CONFIDENCES], txu[(N + 1 + CHECK) * C];
    for (int b = BUCKETS - 1; b >= 0; --b)
        for (int k = 0; k < g.neighbours + (G > 0); ++k) {
            const int cell = looks[k].x / 16, lane = looks[k].x % 16;
            float most = 0.0f;
            for (int c = 0; c < C; ++c)
                most = fmax(most, U(cell, c, lane));
            if (most == 0.0f || clamp((int)ceil(most * BUCKETS) - 1, 0, BUCKETS - 1) != b)
                continue;
            to[m] = looks[k].y;
            for (int c = 0; c < CONFIDENCES; ++c)
                tu[m * CONFIDENCES + c] = U(cell, c, lane);
            for (int c = 0; c < C; ++c)
                txu[m * C + c] = XU(cell, c, lane);
            ++m;
        }
    const int terms = m;
    const float slack = SLACK(terms * C + WAVES);
    for (; m % CHECK; ++m) {
        to[m] = 0;
        for (int c = 0; c < CONFIDENCES; ++c)
            tu[m * CONFIDENCES + c] = 0.0f;
        for (int c = 0; c < C; ++c)
            txu[m * C + c] = 0.0f;
    }

    // All candidates against the bound, V x STEP side by side. Three facts make that exact: partial sums never fall, no
    // cost is below 0, and a sum in another order differs by less than the slack. What survives is evaluated.
    const int wide = WIDTH(g) * (LANES / V), runs = g.candidates / g.cols * g.runs;
    const int blocks = (runs * wide + STEP - 1) / STEP;
    ulong looked = 0;
    for (int b = 0; b < runs * wide; b += STEP) {
        __global const float *y[STEP];
        vec d[STEP];
#pragma unroll
        for (int q = 0; q < STEP; ++q) {
            const int n = min(b + q, runs * wide - 1), run = n / wide;
            y[q] = levels + at[min(run / g.runs * g.cols + run % g.runs, g.candidates - 1)] + n % wide * V;
            d[q] = 0.0f; // and what costs nothing to look up
            if (g.runs == 1) {
                const int p = run * g.cols + n % wide * V;
                for (int c = 0; c < WAVES; ++c) {
                    const vec e = ((float)phases[c * area_ + site] - LOAD(waves + c * listed + p)) * phase_weight;
                    d[q] = fma(e, e, d[q]);
                }
                d[q] = LOAD(penalty + p) + fmax(d[q] - tolerance, (vec)0.0f);
            }
        }
        const float allowed = (best + most + (fabs(best) + most) * 0x1p-21f) * slack;
        const int limit = as_int(allowed) + (b / wide / g.runs * g.cols < best_at); // of equals the first
#define LESS_NOISE(k_)                                                                                                 \
    if (g.spread > 0.0f && k_)                                                                                         \
    {                                                                                                                  \
        uvec word[4];                                                                                                  \
        _Pragma("unroll") for (int q = 0; q < STEP; ++q)                                                               \
        {                                                                                                              \
            const int unit = (b + q) / (LANES / V);                                                                    \
            if (V < LANES || q % 4 == 0)                                                                               \
                words_of(g.seed, g.level, turn, place, DRAW_OF(unit, (b + q) % (LANES / V) * V), word);                \
            d[q] += g.spread * (MOST_GUMBEL + minus_gumbel(word[V < LANES || STEP < 4 ? unit % 4 : q % 4]));           \
        }                                                                                                              \
    }
        int k = 0, alive = 1;
        LESS_NOISE(m <= NOISY)
        while (alive && k < m) {
            LESS_NOISE(k == NOISY)
#pragma unroll
            for (int n = 0; n < CHECK; ++n) {
                const int o = to[k + n];
#pragma unroll
                for (int c = 0; c < C; ++c) {
                    const vec uc = tu[(k + n) * CONFIDENCES + CONFIDENT(c)], xuc = txu[(k + n) * C + c];
#pragma unroll
                    for (int q = 0; q < STEP; ++q) {
                        const vec e = GAP(LOAD(y[q] + c * g.plane + o), uc, xuc);
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
        looked += min(k, terms);
        for (int q = 0; alive && q < STEP; ++q) {
            if (!ANY(BITS(d[q]) < limit))
                continue;
            const int n = min(b + q, runs * wide - 1), run = n / wide, end = run / g.runs * g.cols + g.cols;
            int bits[V];
            STORE(BITS(d[q]), bits);
            for (int v = 0; v < V; ++v) {
                const int p = end - g.cols + run % g.runs + (n % wide * V + v) * g.runs;
                if (bits[v] < limit && p < end)
                    CONSIDER(p, 1.0f)
            }
        }
    }
#endif

    // 6.2.2.2
#ifdef APART
    if (first + (int)get_global_id(0) >= S)
        return;
#endif
    const int out = PLACE(s, site), step = STRIDE(S, g);
    for (int c = 0; c < MADE; ++c) {
        int x = (int)levels[c * g.plane + at[best_at]];
        if (g.spread > 0.0f && g.radius >= 0)
            x += step_from(noise, g.radius, x, g.top, draw4(g.seed, g.level, turn, place, PURPOSE_DRAW, 1 + c).x);
        NEW(values)[c * step + out] = (ushort)x;
    }
    NEW(source)[out] = positions[best_at];
    NEW(temperature)[out] = cooled_to(g.xi + heat.x, heat.y); // 6.2.2.3
#ifdef EXACT
    work[s] += looked * (2 * C) * g.candidates / blocks;
#else
    work[site] += m;
#endif
}

// SPDX-License-Identifier: BSD-3-Clause
// Step 6.2.2 of Algorithm 1 in one kernel: the relaxation of a site, the sites of a step in parallel. The steps are
//
//   6.2.2.1  gather the neighbourhood of s, propose candidates, and evaluate them: equation (12) and mrf/costs.h;
//   6.2.2.2  choose one of them: ICM that of least cost, the Gibbs sampler that of least cost - 2h^2 G with the noise
//            of common/gumbel.h, a draw from the LCPDF, equation (7); of equals the first in the sample;
//   6.2.2.3  cool the site, equation (13).
//
// There are two proposers: relax_coherent.cl and relax_exact.cl. What relaxes together are the sites first .. S - 1 of a
// list, and it does so in place, since no two of them are neighbours; with -D APART=1 the results are arrays of their own,
// new_values (C, S), new_source and new_temperature (S,). A site has one work-item, or -D ITEMS of them: these share its
// neighbours, its candidates, and the lanes of a distance.
#include "mrf/costs.h"
#include "mrf/cool.h"
#include "common/gumbel.h"
#include "common/parzen.h"
#include "mrf/propose.h"

#define AGAIN 4                                // what being a neighbour's source costs, over continuing it
#define ABREAST (ITEMS > 1 ? ITEMS / 16 : 1)   // candidates that a group evaluates at a time
#define REPEATABLE (NOVEL ? N : 1)             // neighbours whose candidates `next` and `same` have
#define MOST(g) PRODUCT(MOST_GUMBEL, (g).spread) // what noise takes away at most

// Units of candidates to a run: common/gumbel.h.
#define WIDTH(g) (((g).cols + (g).runs * LANES - 1) / ((g).runs * LANES))

// noise  cumulative kernel of equation (7) over grey levels: common/parzen.h
#define DRAW const Level g, const int site, const ulong place, const uint turn, __global const uint *noise
#define DRAWN g, site, place, turn, noise
#define RESULTS __global ushort *new_values, __global int *new_source, __global ushort *new_temperature

// The best candidate so far, and what it costs. Scalars: compilers would join a struct in one register, and part it again.
#define BEST __private float *best, __private int *best_at

INLINED void keep_better(const float cost, const int p, BEST)
{
    if (cost < *best || (cost == *best && p < *best_at)) {
        *best = cost;
        *best_at = p;
    }
}

// -G of candidate p; of a density, more by the logarithm of the share of the kernel around it that is legal.
static inline float noise_of(const Level g, const uint turn, const ulong place, const int p, __global const float *y,
                             __global const uint *noise)
{
    const int row = p / g.cols, col = p % g.cols, run = row * g.runs + col % g.runs, n = col / g.runs;
    float minus_g = minus_gumbel_of(g.seed, g.level, turn, place, run * WIDTH(g) + n / LANES, n % LANES);
    for (int c = 0; c < C && g.radius >= 0; ++c)
        minus_g -= log32((float)legal_mass(noise, g.radius, (int)y[c * g.plane], g.top)) - LOG_ONE;
    return minus_g;
}

// How often candidate p continues a neighbour, and AGAIN times how often it is one's source.
static inline float repeated(const int p, const SHARED int *next, const SHARED int *same, const int neighbours)
{
    int count = 0;
    for (int k = 0; k < neighbours; ++k)
        count += (next[k] == p) + AGAIN * (same[k] == p);
    return (float)count;
}

// The source of neighbour r, -1 where there is none or no relaxation has touched it.
static inline int source_of(const int r, __global const int *source, __global const ushort *temperature)
{
    return r >= 0 && temperature[r] < UNTOUCHED ? source[r] : -1;
}

// Put each candidate of raw[0 .. count - 1] into a list once; those that neighbours suggest are the first `suggested`, and
// random ones count only where there are no others, or g.chance > 0. Returns the length of the list, in a group with -1
// in the place of each that is left out; the number of candidates, and of slots with those that continue a neighbour.
INLINED int each_once(const SHARED int *raw, const int count, const int suggested, const int chance, SHARED int *list,
                      SHARED int *kept, __private int *coherent)
{
    *coherent = ITEMS > 1 ? suggested : 0;
    if (ITEMS > 1) {
        EACH(k, count) {
            bool first_of_them = raw[k] >= 0;
            for (int n = 0; n < k; ++n)
                first_of_them &= raw[n] != raw[k] && (raw[n] < 0 || k <= suggested || chance > 0);
            list[k] = first_of_them ? raw[k] : -1;
            if (first_of_them)
                ADDED(kept, 1);
        }
        TOGETHER;
        return count;
    }
    int m = 0;
    ulong seen = 0;
    for (int k = 0; k < count && !(m && k > suggested && chance == 0); ++k) {
        m = proposed(raw[k], list, m, &seen);
        *coherent = k < suggested ? m : *coherent;
    }
    *kept = m;
    return m;
}

// Keep candidate p at a distance if it is the best so far. Noise takes `most` away at most.
INLINED void consider(const float distance, const int p, const float factor, const SHARED int *next,
                      const SHARED int *same, BEST, DRAW, COSTS)
{
    float cost = with_costs(distance, p, factor, site, COSTED);
    if (!(cost - MOST(g) <= *best))
        return;
    if (NOVEL)
        cost += PRODUCT(g.novelty, repeated(p, next, same, g.neighbours));
    if (g.spread > 0.0f)
        cost = fma(g.spread, noise_of(g, turn, place, p, levels + at[p], noise), cost);
    keep_better(cost, p, best, best_at);
}

// Likewise at its distance, unless the bound leaves it out half-way.
INLINED void consider_below(const int p, const float factor, const SHARED float *u, const SHARED float *xu,
                            const SHARED int *next, const SHARED int *same, BEST, DRAW, COSTS)
{
    const float distance = distance_in_lanes(levels + at[p], u, xu, g.plane, g.row_stride, g.layer_stride, factor,
                                             MOST(g), *best);
    consider(distance, p, factor, next, same, best, best_at, DRAWN, COSTED);
}

// Consider the first m candidates of a list, of which the first `coherent` continue a neighbour. In a group, 16 items sum
// the lanes of a distance, and the first ITEMS / 16 of all consider a candidate each; in the end all know the best.
//
// lanes (ABREAST, 17), bests (ABREAST,), bests_at (ABREAST,)   scratch; 17: items that read a row each use different banks
#define SCRATCH SHARED float lanes[][17], SHARED float *bests, SHARED int *bests_at
INLINED void evaluate(const SHARED int *list, const int m, const int coherent, const SHARED float *u,
                      const SHARED float *xu, const SHARED int *next, const SHARED int *same, SCRATCH, BEST, DRAW, COSTS)
{
    if (ITEMS == 1) {
        for (int k = 0; k < m; ++k)
            consider_below(list[k], k < coherent ? g.discount : 1.0f, u, xu, next, same, best, best_at, DRAWN, COSTED);
        return;
    }
    for (int from = 0; from < m; from += ABREAST) {
        const int k = from + ITEM / 16, n = from + ITEM;
        if (k < m && list[k] >= 0)
            lanes[ITEM / 16][ITEM % 16] =
                lane_of_distance(levels + at[list[k]], u, xu, g.plane, g.row_stride, g.layer_stride, ITEM % 16);
        TOGETHER;
        if (ITEM < ABREAST && n < m && list[n] >= 0) {
            float d[16];
            for (int lane = 0; lane < 16; ++lane)
                d[lane] = lanes[ITEM][lane];
            consider(folded(d), list[n], n < coherent ? g.discount : 1.0f, next, same, best, best_at, DRAWN, COSTED);
        }
        TOGETHER;
    }
    if (ITEM < ABREAST) {
        bests[ITEM] = *best;
        bests_at[ITEM] = *best_at;
    }
    TOGETHER;
    for (int k = 0; k < ABREAST; ++k)
        keep_better(bests[k], bests_at[k], best, best_at);
}

// Steps 6.2.2.2 and 6.2.2.3 of site s of the list: it takes candidate p, and cools; `heat` is that of `gather`.
INLINED void settle(const int s, const int S, const int p, const int2 heat, __global const int *at,
                    __global const float *levels, __global const int *positions, DRAW, RESULTS)
{
    const int out = APART ? s : site, step = APART ? S : g.area;
    for (int c = 0; c < MADE; ++c) {
        int x = (int)levels[c * g.plane + at[p]];
        if (g.spread > 0.0f && g.radius >= 0)
            x += step_from(noise, g.radius, x, g.top, draw4(g.seed, g.level, turn, place, PURPOSE_DRAW, 1 + c).x);
        new_values[c * step + out] = (ushort)x;
    }
    new_source[out] = positions[p];
    new_temperature[out] = cooled_to(g.xi + heat.x, heat.y);
}

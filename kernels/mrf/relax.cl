// SPDX-License-Identifier: BSD-3-Clause
// Step 6.2.2 of Algorithm 1 in one kernel: the relaxation of a site, the sites of a step in parallel. The steps are
//
//   6.2.2.1  gather the neighbourhood of s, propose candidates, and evaluate them: equation (12) and mrf/costs.h;
//   6.2.2.2  choose one of them: ICM that of least cost, the Gibbs sampler that of least cost - 2h^2 G with the noise
//            of common/gumbel.h, a draw from the LCPDF, equation (7); of equals the first in the sample;
//   6.2.2.3  cool the site, equation (13).
//
// There are two proposers. By default there are, in this order and each of them once,
//
//   1. p_r + (s - r), where the sample continues the source p_r of neighbour r, r one of the SUGGESTING nearest
//      neighbours that a relaxation has touched (t < 1);
//   2. the present source of s;
//   3. `chance` positions at random, and one where there would be none at all; -D PHASES: of the site's phase, and if it
//      has no more than `chance`, all of them.
//
// -D EXACT proposes every candidate of the level, and skips those that are proved to cost more than the best so far.
//
// What relaxes together are the sites first .. S - 1 of a list, and it does so in place, since no two of them are
// neighbours. -D APART writes to new_values (C, S), new_source and new_temperature (S,) instead. A site has one work-item,
// or -D ITEMS of them: these share its neighbours, its candidates, and the lanes of a distance.
#pragma OPENCL FP_CONTRACT OFF
#include "mrf/costs.h"
#include "mrf/cool.h"
#include "common/gumbel.h"
#include "common/parzen.h"
#include "mrf/propose.h"

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
#define SLOTS 64 // proposals that a site may have
#endif
#define SUGGESTING 12 // nearest neighbours that suggest a candidate each
#ifdef EXACT
#define SUGGESTED(g) (g).neighbours // neighbours that suggest one here
#define RAW (N + 1)                 // suggestions at most
#define LISTED (RAW > ITEMS * STEP ? RAW : ITEMS * STEP)
#else
#define SUGGESTED(g) min(SUGGESTING, (g).neighbours)
#define RAW SLOTS
#define LISTED SLOTS
#endif
#ifdef PHASES
#define IN_PHASE                                                                                                       \
    __global const int *restrict begin_of, __global const int *restrict of_phase, __global const int *restrict phase_at,
#else
#define IN_PHASE
#endif
#ifdef NOVEL
#define LOOKED(g) (g).neighbours
#else
#define LOOKED(g) SUGGESTED(g)
#endif
#define AGAIN 4    // what being a neighbour's source costs, over continuing it
#ifndef N
#define N 64 // most neighbours
#endif
#ifndef STEP
#define STEP 4 // vectors of candidates in registers together
#endif
#define CHECK 4    // neighbours between two looks at the bound
#define NOISY 8    // neighbours that are looked at before the noise of a draw, unless most blocks need it
#define BUCKETS 8  // of confidence, the most certain neighbours first
#define SLACK(terms) (1.0f + ((terms) + 8) * 0x1p-22f) // what a sum in another order may exceed this one by
#define BITS(x) WIDE(as_int)(x)

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

// Random candidate k of `draws`, from a word; of a phase with `many` candidates.
#ifdef PHASES
#define AT_RANDOM(k, draws, word)                                                                                      \
    (many_of > draws ? of_phase[from_of + (int)((ulong)(word) * (uint)many_of >> 32)]                                  \
                     : (k) < many_of ? of_phase[from_of + (k)] : -1)
#else
#define AT_RANDOM(k, draws, word) (int)((ulong)(word) * (uint)g.candidates >> 32)
#endif

// How often candidate p continues a neighbour, and AGAIN times how often it is one's source.
static inline float repeated(const int p, const SHARED int *next, const SHARED int *same, const int neighbours)
{
    int found = 0;
    for (int k = 0; k < neighbours; ++k)
        found += (next[k] == p) + AGAIN * (same[k] == p);
    return (float)found;
}

// Keep candidate p at a distance if it is the best so far. Noise takes `most` away at most.
#define CONSIDER(distance, p, factor)                                                                                  \
    {                                                                                                                  \
        float total_ = WITH_COSTS(distance, p, factor, site);                                                          \
        if (total_ - most <= best) {                                                                                   \
            total_ += REPEATED(p);                                                                                     \
            if (g.spread > 0.0f)                                                                                       \
                total_ = fma(g.spread, noise_of(g, turn, place, p, levels + at[p], noise), total_);                    \
            KEEP(total_, p)                                                                                            \
        }                                                                                                              \
    }
#define KEEP(total, p)                                                                                                 \
    if ((total) < best || ((total) == best && (p) < best_at)) {                                                        \
        best = total;                                                                                                  \
        best_at = p;                                                                                                   \
    }

// Evaluate the first m of the list, of which the first `coherent` continue a neighbour. In a group, 16 items sum the lanes
// of a distance, and the first ITEMS / 16 of all consider a candidate each; in the end all know the best.
#define FACTOR(k, coherent) ((k) < (coherent) ? g.discount : 1.0f)
#if ITEMS == 1
#define EVALUATE(m, coherent)                                                                                          \
    for (int k_ = 0; k_ < (m); ++k_)                                                                                   \
        CONSIDER(DISTANCE_BELOW(list[k_], FACTOR(k_, coherent), most, best), list[k_], FACTOR(k_, coherent))
#else
#define ABREAST (ITEMS / 16)
#define EVALUATE(m, coherent)                                                                                          \
    {                                                                                                                  \
        for (int from_ = 0; from_ < (m); from_ += ABREAST) {                                                           \
            const int k_ = from_ + ITEM / 16, n_ = from_ + ITEM;                                                       \
            if (k_ < (m) && list[k_] >= 0)                                                                             \
                lanes[ITEM / 16][ITEM % 16] = lane_of_distance(levels + at[list[k_]], u, xu, g.plane, g.row_stride,    \
                                                               g.layer_stride, ITEM % 16);                             \
            TOGETHER;                                                                                                  \
            if (ITEM < ABREAST && n_ < (m) && list[n_] >= 0) {                                                         \
                float d_[16];                                                                                          \
                for (int lane_ = 0; lane_ < 16; ++lane_)                                                               \
                    d_[lane_] = lanes[ITEM][lane_];                                                                    \
                CONSIDER(folded(d_), list[n_], FACTOR(n_, coherent))                                                   \
            }                                                                                                          \
            TOGETHER;                                                                                                  \
        }                                                                                                              \
        if (ITEM < ABREAST) {                                                                                          \
            bests[ITEM] = best;                                                                                        \
            bests_at[ITEM] = best_at;                                                                                  \
        }                                                                                                              \
        TOGETHER;                                                                                                      \
        for (int k_ = 0; k_ < ABREAST; ++k_)                                                                           \
            KEEP(bests[k_], bests_at[k_])                                                                              \
    }
#endif

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
__kernel GROUP void relax(__global const int *restrict sites, const int first, const int S, __global ushort *values,
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
                          IN_PHASE
                          __global ushort *restrict new_values, __global int *restrict new_source,
                          __global ushort *restrict new_temperature)
{
#if ITEMS > 1
    const bool idle = false;
    const int s = first + (int)get_group_id(0);
    __local float lanes[ABREAST][17], bests[ABREAST]; // 17: items that read a row each use different banks
    __local int bests_at[ABREAST], kept;
    if (ITEM == 0)
        kept = 0;
#else
    // An idle work-item relaxes the last site, and writes nothing: if it returned here, Intel's runtime would read at wild
    // indices for it.
    const bool idle = first + (int)get_global_id(0) >= S;
    const int s = idle ? S - 1 : first + (int)get_global_id(0);
#endif
    const Lattice h = g.lattice;
    const int site = sites[s], i = site / h.cols, j = site - i * h.cols;
    const ulong place = place_of(h, i, j);

    // 6.2.2.1: the neighbourhood.
    AROUND(g, site, i, j);
#ifdef HOT
    by_category(xu);
#endif

    // What neighbours suggest, the present source, and random candidates.
    const int suggested = SUGGESTED(g);
    SHARED int raw[RAW], list[LISTED];
#ifdef EXACT
    SHARED int same[N];
#define NEXT raw
#elif defined(NOVEL)
    SHARED int NEXT[N], same[N];
#endif
    EACH(k, LOOKED(g)) {
        const int r = NEIGHBOUR(h, k), from = r >= 0 && temperature[r] < UNTOUCHED ? source[r] : -1;
        const int p = continuing(index_of, from, reach[k], g.pixels);
        if (k < suggested)
            raw[k] = p;
#if defined(EXACT) || defined(NOVEL)
        NEXT[k] = p;
        same[k] = number_of(index_of, from);
#endif
    }
    if (ITEM == 0)
        raw[suggested] = idle ? -1 : number_of(index_of, source[site]); // which the item of the last site may be writing
    int many = suggested + 1;
#ifndef EXACT
    const int draws = max(1, g.chance);
#ifdef PHASES
    const int phase = phase_at[site], from_of = begin_of[phase], many_of = begin_of[phase + 1] - from_of;
#endif
    EACH(n, (draws + 3) / 4) {
        const uint4 bits = draw4(g.seed, g.level, turn, place, PURPOSE_SEARCH, n);
        const uint word[4] = {bits.x, bits.y, bits.z, bits.w};
        for (int k = 4 * n; k < min(4 * n + 4, draws); ++k)
            raw[many + k] = AT_RANDOM(k, draws, word[k % 4]);
    }
    many += draws;
#endif
    TOGETHER;

    // Each of them once.
#if ITEMS > 1
    const int coherent = suggested;
    EACH(k, many) {
        bool first_of_them = raw[k] >= 0;
        for (int n = 0; n < k; ++n)
            first_of_them &= raw[n] != raw[k] && (raw[n] < 0 || k <= suggested || g.chance > 0);
        list[k] = first_of_them ? raw[k] : -1;
        if (first_of_them)
            atomic_inc(&kept);
    }
    TOGETHER;
#else
    int kept = 0, coherent = 0;
    ulong seen = 0;
    for (int k = 0; k < many && !(kept && k > suggested && g.chance == 0); ++k) {
        kept = proposed(raw[k], list, kept, &seen);
        coherent = k < suggested ? kept : coherent;
    }
    many = kept;
#endif

    const float most = PRODUCT(MOST_GUMBEL, g.spread);
    float best = INFINITY;
    int best_at = 0x7fffffff;
#if defined(EXACT) || defined(NOVEL)
#define REPEATED(p) (g.novelty > 0.0f ? g.novelty * repeated(p, NEXT, same, g.neighbours) : 0.0f)
#else
#define REPEATED(p) 0.0f
#endif
    EVALUATE(many, coherent)
#ifdef EXACT

    // The terms of a sum, the most certain first.
    SHARED int bucket[N + 1], to[N + 1 + CHECK];
    SHARED float tu[(N + 1 + CHECK) * CONFIDENCES], txu[(N + 1 + CHECK) * C];
    const int around = g.neighbours + (G > 0);
    EACH(k, around) {
        float certain = 0.0f;
        for (int c = 0; c < C; ++c)
            certain = fmax(certain, U(looks[k].x / 16, c, looks[k].x % 16));
        bucket[k] = certain == 0.0f ? -1 : clamp((int)ceil(certain * BUCKETS) - 1, 0, BUCKETS - 1);
    }
    TOGETHER;
    int terms = 0;
    for (int k = 0; k < around; ++k)
        terms += bucket[k] >= 0;
    EACH(b, BUCKETS) {
        int n = 0;
        for (int k = 0; k < around; ++k)
            n += bucket[k] > b;
        for (int k = 0; k < around; ++k) {
            if (bucket[k] != b)
                continue;
            const int cell = looks[k].x / 16, lane = looks[k].x % 16;
            to[n] = looks[k].y;
            for (int c = 0; c < CONFIDENCES; ++c)
                tu[n * CONFIDENCES + c] = U(cell, c, lane);
            for (int c = 0; c < C; ++c)
                txu[n * C + c] = XU(cell, c, lane);
            ++n;
        }
    }
    const int m = (terms + CHECK - 1) / CHECK * CHECK;
    EACH(n, m - terms) {
        to[terms + n] = 0;
        for (int c = 0; c < CONFIDENCES; ++c)
            tu[(terms + n) * CONFIDENCES + c] = 0.0f;
        for (int c = 0; c < C; ++c)
            txu[(terms + n) * C + c] = 0.0f;
    }
#if ITEMS > 1
    TOGETHER;
    if (ITEM == 0)
        kept = 0;
    TOGETHER;
#define SLOT(q) (b + (ITEM / LANES * STEP + (q)) * LANES + ITEM % LANES)
#define SURVIVES(p) list[atomic_inc(&kept)] = p;
#else
#define SLOT(q) (b + (q))
#define SURVIVES(p) CONSIDER(DISTANCE_BELOW(p, 1.0f, most, best), p, 1.0f)
#endif
    const float slack = SLACK(terms * C + WAVES);

    // All candidates against the bound, V x STEP side by side. Three facts make that exact: partial sums never fall, no
    // cost is below 0, and a sum in another order differs by less than the slack. What survives is evaluated.
    const int wide = WIDTH(g) * (LANES / V), runs = g.candidates / g.cols * g.runs, slots = runs * wide;
    const int blocks = (slots + STEP - 1) / STEP;
    ulong looked = 0;
    int late = 0, asked = 0; // blocks that looked at neighbours first, and those of them that needed noise
    for (int b = 0; b < slots; b += ITEMS * STEP) {
        __global const float *y[STEP];
        vec d[STEP];
#pragma unroll
        for (int q = 0; q < STEP; ++q) {
            const int n = min(SLOT(q), slots - 1), run = n / wide;
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
#define ALONE (V < LANES && ITEMS == 1) // four slots of an item share no draw
#define LESS_NOISE(k_)                                                                                                 \
    if (g.spread > 0.0f && k_)                                                                                         \
    {                                                                                                                  \
        uvec word[4];                                                                                                  \
        _Pragma("unroll") for (int q = 0; q < STEP; ++q)                                                               \
        {                                                                                                              \
            const int unit = SLOT(q) / (LANES / V);                                                                    \
            if (ALONE || q % 4 == 0)                                                                                   \
                words_of(g.seed, g.level, turn, place, DRAW_OF(unit, SLOT(q) % (LANES / V) * V), word);                \
            d[q] = fma(g.spread, least_noise(word[ALONE || STEP < 4 ? unit % 4 : q % 4]), d[q]);                      \
        }                                                                                                              \
    }
        int k = 0, alive = SLOT(0) < slots;
        const int wait = m <= NOISY || 2 * asked > late ? 0 : NOISY;
        LESS_NOISE(!wait)
        while (alive && k < m) {
            LESS_NOISE(wait && k == wait)
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
            ivec low = BITS(d[0]);
#pragma unroll
            for (int q = 1; q < STEP; ++q)
                low = min(low, BITS(d[q]));
            alive = LEAST(low) < limit;
        }
        looked += min(k, terms);
        late += wait > 0;
        asked += wait && k > wait;
        for (int q = 0; alive && q < STEP; ++q) {
            if (LEAST(BITS(d[q])) >= limit)
                continue;
            const int n = min(SLOT(q), slots - 1), run = n / wide, end = run / g.runs * g.cols + g.cols;
            int bits[V];
            STORE(BITS(d[q]), bits);
            for (int v = 0; v < V; ++v) {
                const int p = end - g.cols + run % g.runs + (n % wide * V + v) * g.runs;
                if (bits[v] < limit && p < end)
                    SURVIVES(p)
            }
        }
#if ITEMS > 1
        TOGETHER;
        many = kept;
        TOGETHER;
        if (many) {
            EVALUATE(many, 0)
            if (ITEM == 0)
                kept = 0;
            TOGETHER;
        }
#endif
    }
#endif

    // 6.2.2.2
#if ITEMS > 1
#ifdef EXACT
    atomic_add(&kept, (int)looked);
    TOGETHER;
    looked = kept;
#endif
#endif
    if (ITEM > 0 || idle)
        return;
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
    work[site] += kept;
#endif
}

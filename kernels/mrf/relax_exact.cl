// SPDX-License-Identifier: BSD-3-Clause
// The exact search of relax.h, which proposes every candidate of the level, and skips those that are proved to cost more
// than the best so far.
#pragma OPENCL FP_CONTRACT OFF
#include "mrf/relax.h"

#define CHECK 4    // neighbours between two looks at the bound
#define NOISY 8    // neighbours that are looked at before the noise of a draw, unless most blocks need it
#define BUCKETS 8  // of confidence, the most certain neighbours first
#define TERMS (N + 1 + CHECK) // of a sum, at most
#define SLACK(terms) (1.0f + ((terms) + 8) * 0x1p-22f) // what a sum in another order may exceed this one by
#define ALONE (V < LANES && ITEMS == 1) // four slots of an item share no draw
#define LISTED (N + 1 > ITEMS * STEP ? N + 1 : ITEMS * STEP) // -D STEP vectors of candidates in registers together
#define SLOT(b, q) ((b) + (ITEMS > 1 ? (ITEM / LANES * STEP + (q)) * LANES + ITEM % LANES : (q))) // q of this item in b
#define BITS(x) WIDE(as_int)(x)

// The terms of a sum, the most certain neighbours first: offset in `levels`, u and x_r u. Returns their number, after
// which others of 0 fill up a multiple of CHECK.
//
// bucket (N + 1,)  scratch
INLINED int sorted_terms(__global const int2 *looks, const int around, const SHARED float *u, const SHARED float *xu,
                         SHARED int *bucket, SHARED int *to, SHARED float *tu, SHARED float *txu)
{
    EACH(k, around) {
        const int cell = looks[k].x / 16, lane = looks[k].x % 16;
        float certain = 0.0f;
        for (int c = 0; c < C; ++c)
            certain = fmax(certain, u[U_AT(cell, c) + lane]);
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
                tu[n * CONFIDENCES + c] = u[U_AT(cell, c) + lane];
            for (int c = 0; c < C; ++c)
                txu[n * C + c] = xu[X_AT(cell, c) + lane];
            ++n;
        }
    }
    EACH(k, (CHECK - terms % CHECK) % CHECK) {
        const int n = terms + k;
        to[n] = 0;
        for (int c = 0; c < CONFIDENCES; ++c)
            tu[n * CONFIDENCES + c] = 0.0f;
        for (int c = 0; c < C; ++c)
            txu[n * C + c] = 0.0f;
    }
    return terms;
}

// What V candidates from p on cost at least, but their distances and noise: what costs nothing to look up.
INLINED vec least_cost(const int p, const int site, COSTS)
{
    vec d = 0.0f;
    for (int c = 0; c < WAVES; ++c) {
        const vec e = ((float)phases[c * area_ + site] - LOAD(waves + c * listed + p)) * phase_weight;
        d = fma(e, e, d);
    }
    return LOAD(penalty + p) + fmax(d - tolerance, (vec)0.0f);
}

// Add the least noise of the candidates of a block to their sums.
INLINED void add_noise(__private vec *d, const int b, const Level g, const ulong place, const uint turn)
{
    uvec word[4];
#pragma unroll
    for (int q = 0; q < STEP; ++q) {
        const int n = SLOT(b, q), unit = n / (LANES / V);
        if (ALONE || q % 4 == 0)
            words_of(g.seed, g.level, turn, place, DRAW_OF(unit, n % (LANES / V) * V), word);
        d[q] = fma(g.spread, least_noise(word[ALONE || STEP < 4 ? unit % 4 : q % 4]), d[q]);
    }
}

// Add the terms of neighbours k .. k + CHECK - 1 to the sums of the candidates at y.
INLINED void add_terms(__private vec *d, __global const float **y, const int plane, const int k, const SHARED int *to,
                       const SHARED float *tu, const SHARED float *txu)
{
#pragma unroll
    for (int n = 0; n < CHECK; ++n) {
        const int o = to[k + n];
#pragma unroll
        for (int c = 0; c < C; ++c) {
            const vec uc = tu[(k + n) * CONFIDENCES + CONFIDENT(c)], xuc = txu[(k + n) * C + c];
#pragma unroll
            for (int q = 0; q < STEP; ++q) {
                const vec e = GAP(LOAD(y[q] + c * plane + o), uc, xuc);
                d[q] = fma(e, e, d[q]);
            }
        }
    }
}

// The least of all sums, which are not negative, as bits.
INLINED int least_of(const __private vec *d)
{
    ivec low = BITS(d[0]);
#pragma unroll
    for (int q = 1; q < STEP; ++q)
        low = min(low, BITS(d[q]));
    return LEAST(low);
}

// work  in and out: multiply-adds of site s
__kernel GROUP void relax_exact(FIELD, __global const uint *restrict noise, const uint turn,
                                __global ulong *restrict work, RESULTS)
{
    const bool idle = ITEMS == 1 && first + (int)INDEX >= S; // as in relax_coherent.cl
    const int s = idle ? S - 1 : first + (int)INDEX;
    const Lattice h = g.lattice;
    const int site = sites[s], i = site / h.cols, j = site - i * h.cols;
    const ulong place = place_of(h, i, j);
    SHARED int kept;
    if (ITEM == 0)
        kept = 0;

    // 6.2.2.1: the neighbourhood.
    int row[ROWS], col[SIDE];
    SHARED ALIGNED float u[CELLS * CONFIDENCES * 16], xu[CELLS * C * 16];
    SHARED int warmth[2];
    square_around(h, i, j, row, col);
    const int2 heat = gather(g, site, i, j, row, col, values, source, temperature, offsets, disc, u, xu, warmth);

    // First what neighbours suggest, and the present source.
    SHARED int next[N + 1], list[LISTED], same[REPEATABLE];
    EACH(k, g.neighbours) {
        const int r = neighbour_in_square(h, site, i, j, row, col, offsets + AXES * k);
        const int from = source_of(r, source, temperature);
        next[k] = continuing(index_of, from, reach[k], g.pixels);
        if (NOVEL)
            same[k] = number_of(index_of, from);
    }
    if (ITEM == 0)
        next[g.neighbours] = idle ? -1 : number_of(index_of, source[site]); // which the item of the last site may be writing
    TOGETHER;
    int coherent;
    const int suggested = each_once(next, g.neighbours + 1, g.neighbours, g.chance, list, &kept, &coherent);
    SHARED float lanes[ABREAST][17], bests[ABREAST];
    SHARED int bests_at[ABREAST];
    float best = INFINITY;
    int best_at = 0x7fffffff;
    evaluate(list, suggested, coherent, u, xu, next, same, lanes, bests, bests_at, &best, &best_at, DRAWN, COSTED);

    SHARED int bucket[N + 1], to[TERMS];
    SHARED float tu[TERMS * CONFIDENCES], txu[TERMS * C];
    const int terms = sorted_terms(looks, g.neighbours + (G > 0), u, xu, bucket, to, tu, txu);
    const int m = (terms + CHECK - 1) / CHECK * CHECK;
    const float slack = SLACK(terms * C + WAVES), most = MOST(g);
    TOGETHER;
    if (ITEM == 0)
        kept = 0;
    TOGETHER;

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
            const int n = min(SLOT(b, q), slots - 1), run = n / wide;
            y[q] = levels + at[min(run / g.runs * g.cols + run % g.runs, g.candidates - 1)] + n % wide * V;
            d[q] = 0.0f;
            if (g.runs == 1)
                d[q] = least_cost(run * g.cols + n % wide * V, site, COSTED);
        }
        const float allowed = (best + most + (fabs(best) + most) * 0x1p-21f) * slack;
        const int limit = as_int(allowed) + (b / wide / g.runs * g.cols < best_at); // of equals the first
        int k = 0, alive = SLOT(b, 0) < slots;
        const int wait = m <= NOISY || 2 * asked > late ? 0 : NOISY;
        if (g.spread > 0.0f && !wait)
            add_noise(d, b, g, place, turn);
        while (alive && k < m) {
            if (g.spread > 0.0f && wait && k == wait)
                add_noise(d, b, g, place, turn);
            add_terms(d, y, g.plane, k, to, tu, txu);
            k += CHECK;
            alive = least_of(d) < limit;
        }
        looked += min(k, terms);
        late += wait > 0;
        asked += wait && k > wait;
        for (int q = 0; alive && q < STEP; ++q) {
            if (LEAST(BITS(d[q])) >= limit)
                continue;
            const int n = min(SLOT(b, q), slots - 1), run = n / wide, end = run / g.runs * g.cols + g.cols;
            int bits[V];
            STORE(BITS(d[q]), bits);
            for (int v = 0; v < V; ++v) {
                const int p = end - g.cols + run % g.runs + (n % wide * V + v) * g.runs;
                if (bits[v] >= limit || p >= end)
                    continue;
                if (ITEMS > 1)
                    list[ADDED(&kept, 1)] = p;
                else
                    consider_below(p, 1.0f, u, xu, next, same, &best, &best_at, DRAWN, COSTED);
            }
        }
        TOGETHER;
        const int survivors = ITEMS > 1 ? kept : 0;
        TOGETHER;
        if (survivors) {
            evaluate(list, survivors, 0, u, xu, next, same, lanes, bests, bests_at, &best, &best_at, DRAWN, COSTED);
            if (ITEM == 0)
                kept = 0;
            TOGETHER;
        }
    }
    if (ITEMS > 1) {
        ADDED(&kept, (int)looked);
        TOGETHER;
        looked = kept;
    }
    if (ITEM > 0 || idle)
        return;
    settle(s, S, best_at, heat, at, levels, positions, DRAWN, new_values, new_source, new_temperature);
    work[s] += looked * (2 * C) * g.candidates / blocks;
}

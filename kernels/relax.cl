// SPDX-License-Identifier: BSD-3-Clause
// Step 6.2.2 of Algorithm 1 in one kernel: the relaxation of a site, the sites of a step in parallel. The steps are
//
//   6.2.2.1  gather the neighbourhood of s, propose candidates, and weigh them by equation (12);
//   6.2.2.2  choose one of them: ICM the nearest, the Gibbs sampler a draw from the LCPDF, equation (7);
//   6.2.2.3  cool the site, equation (13).
//
// There are two proposers. relax_all proposes every candidate of a level that has few of them (-D ALL: at most so many);
// for levels that have more, lcpdf.cl and nearest.cl do the same with the same bits. relax_list proposes a few.
//
// What relaxes together are the sites first .. S - 1 of a list, one work-item each, and it does so in place, since no two
// of them are neighbours. -D APART writes to new_values (C, S), new_source and new_temperature (S,) instead.
//
// sites    (S,)         pixel index of each site
// values (C, area), source (area,), temperature (area,)   the field
// offsets  (N, 2)       of the neighbours, canonical order
// reach    (N,)         pixel offset of each in the sample
// index_of (pixels,)    number of the candidate at a pixel of the sample, -1 where there is none
// positions (count,)    pixel index of each candidate
// noise                 the kernel of equation (7) over grey levels, as in lcpdf.cl
#pragma OPENCL FP_CONTRACT OFF
#ifdef ALL
#define LEVEL float
#else
#define LEVEL ushort
#endif
#include "common/confidence.h"
#include "common/costs.h"
#include "common/vector.h"
#include "common/choose.h"
#include "common/cool.h"
#include "common/distance.h"
#include "common/coherence.h"
#include "common/propose.h"
#include "common/square.h"

#ifdef APART
#define NEW(name) new_##name
#define PLACE(s, site) s
#define STRIDE(S, g) S
#else
#define NEW(name) name
#define PLACE(s, site) site
#define STRIDE(S, g) g.area
#endif

#ifdef ALL
#ifndef N
#define N 64 // most neighbours
#endif
#define AGAIN 4.0f // what being a neighbour's source costs, over continuing it
#ifndef STEP
#define STEP 4 // vectors of candidates in registers together
#endif

// Confidence and weighted value of each channel at pixel r, the k-th of those that are looked at; -1: nobody.
#define GATHER(k, r, certain, guide)                                                                                   \
    for (int c = 0; c < C; ++c) {                                                                                      \
        const ushort x = r < 0 ? 0 : values[c * g.area + r];                                                           \
        u[(k) * CONFIDENCES + CONFIDENT(c)] = CONFIDENCE_OF(c < MADE, x, certain, guide);                              \
        xu[(k) * C + c] = (float)x * u[(k) * CONFIDENCES + CONFIDENT(c)];                                              \
    }

// strip       (C, size)  the sample's pixels of this level, row by row: candidates that follow one another side by side
// strip_reach (N,)       pixel offset of each neighbour there
__kernel __attribute__((vec_type_hint(vec))) void
relax_all(__global const int *restrict sites, const int first, const int S, __global ushort *values,
                        __global int *source, __global ushort *temperature, const Level g,
                        __global const int2 *restrict offsets,
                        __global const int *restrict reach, __global const int *restrict index_of,
                        __global const int *restrict positions, __global const float *restrict strip,
                        __global const int *restrict strip_reach, COSTS,
                        __global const uint *restrict noise, const uint turn,
                        __global ushort *restrict new_values, __global int *restrict new_source,
                        __global ushort *restrict new_temperature)
{
    const int s = first + (int)get_global_id(0);
    if (s >= S)
        return;
    const int site = sites[s], i = ROW_OF(g.lattice, site), j = COL_OF(g.lattice, site);
    const ulong place = place_of(g.lattice, i, j);

    // 6.2.2.1: the neighbourhood, and which candidates continue a neighbour's source.
    float u[(N + 1) * CONFIDENCES], xu[(N + 1) * C];
    int next[N], same[N], sum = g.xi, members = 0;
    const int neighbours = g.neighbours;
    for (int k = 0; k < neighbours; ++k) {
        const int r = neighbour(g.lattice, i, j, offsets[k].x, offsets[k].y);
        const int t = r < 0 ? UNTOUCHED : temperature[r];
        const float certain = WEIGHED_AS((float)(1024 - t) * 0x1p-10f, r < 0 ? 0 : source[r], g.hard);
        GATHER(k, r, certain, r < 0 ? 0.0f : 1.0f);
        sum += r < 0 ? 0 : t;
        members += r < 0 ? 0 : 1;
        next[k] = t < UNTOUCHED ? continuing(index_of, source[r], reach[k], g.pixels) : -1;
        same[k] = t < UNTOUCHED ? number_of(index_of, source[r]) : -1;
    }
    if (G)
        GATHER(neighbours, site, 0.0f, g.centre);

    // All candidates, V side by side, neighbours in canonical order; the last of a row are overwritten by the next row's.
    float d[ALL + V];
    const int wide = (g.strip_cols + V - 1) / V;
    for (int b = 0; b < g.strip_rows * wide; b += STEP) {
        __global const float *y[STEP];
        vec sums[STEP];
#pragma unroll
        for (int q = 0; q < STEP; ++q) {
            const int n = min(b + q, g.strip_rows * wide - 1);
            y[q] = strip + g.first + STRIP_ROW(n / wide, g.strip_high, g.thick, g.pitch) + n % wide * V;
            sums[q] = 0.0f;
        }
        for (int k = 0; k < neighbours + (G > 0); ++k) {
            const int reached = k < neighbours ? strip_reach[k] : 0;
#pragma unroll
            for (int c = 0; c < C; ++c)
#pragma unroll
                for (int q = 0; q < STEP; ++q) {
                    const vec e = GAP(LOAD(y[q] + c * g.size + reached), (vec)u[k * CONFIDENCES + CONFIDENT(c)],
                                      (vec)xu[k * C + c]);
                    sums[q] = fma(e, e, sums[q]);
                }
        }
#pragma unroll
        for (int q = 0; q < STEP; ++q) {
            const int n = min(b + q, g.strip_rows * wide - 1);
            STORE(sums[q], d + n / wide * g.strip_cols + n % wide * V);
        }
    }
    ulong coherent[ALL / 64] = {0}; // a bit for each candidate
    for (int k = 0; k < neighbours; ++k) {
        const int p = next[k];
        if (p < 0 || coherent[p / 64] >> p % 64 & 1)
            continue;
        coherent[p / 64] |= 1ul << p % 64;
        d[p] *= g.discount;
    }
    for (int p = 0; p < g.candidates; p += V) { // both lists have whole vectors
        vec apart = 0.0f;
        for (int c = 0; c < WAVES; ++c) {
            const vec e = ((float)phases[c * area_ + site] - LOAD(waves + c * listed + p)) * certain_;
            apart = fma(e, e, apart);
        }
        STORE(LOAD(d + p) + LOAD(penalty + p) + fmax(apart - free_, (vec)0.0f), d + p);
    }
#if SCATTERED
    if (begin_[site] < begin_[site + 1])
        for (int p = 0; p < g.candidates; ++p)
            d[p] += MISFIT(p, site);
#endif
#if KINDS
    for (int p = 0; p < g.candidates; ++p)
        d[p] += OF_KIND(p, site);
#endif
    if (g.novelty > 0.0f)
        for (int k = 0; k < neighbours; ++k) {
            if (next[k] >= 0)
                d[next[k]] += g.novelty;
            if (same[k] >= 0)
                d[same[k]] += AGAIN * g.novelty;
        }

    // 6.2.2.2
#define NUMBER(k) (k)
#define PIXEL(k) (g.first + STRIP_ROW((k) / g.strip_cols, g.strip_high, g.thick, g.pitch) + (k) % g.strip_cols)
    CHOOSE(chosen, g, d, g.candidates, strip, g.size, noise, turn, place)
    const int out = PLACE(s, site), step = STRIDE(S, g);
    for (int c = 0; c < MADE; ++c)
        NEW(values)[c * step + out] = (ushort)grey_level(g, (int)strip[c * g.size + PIXEL(chosen)], c, noise, turn, place);
    NEW(source)[out] = positions[chosen];
    NEW(temperature)[out] = cooled_to(sum, members); // 6.2.2.3
}

#else
#ifndef SLOTS
#define SLOTS 64 // candidates that a site may have
#endif
#define SUGGESTING 12 // nearest neighbours that suggest a candidate each

// The candidates are, in this order and each of them once,
//
//   1. p_r + (s - r), where the sample continues the source p_r of neighbour r, r one of the SUGGESTING nearest
//      neighbours that a relaxation has touched (t < 1);
//   2. the present source of s;
//   3. `chance` positions at random, and one where there would be none at all.
//
// Lane n of a cell gets what is known at pixel r.
#define PUT(cell, n, r, certain, guide)                                                                                \
    for (int c = 0; c < C; ++c) {                                                                                      \
        const ushort x = values[c * g.area + r];                                                                       \
        U(cell, c, n) = CONFIDENCE_OF(c < MADE, x, certain, guide);                                                    \
        XU(cell, c, n) = (float)x * U(cell, c, n);                                                                     \
    }

// disc    (CELLS, 16)  1 on the neighbourhood, 0 elsewhere
// at      (count,)     place of each candidate in `levels`
// levels  (C, plane)   grey levels of the sample, columns apart by the level's step side by side
// weighed (area,)      in and out: candidates that each site has weighed so far
__kernel void relax_list(__global const int *restrict sites, const int first, const int S, __global ushort *values,
                         __global int *source, __global ushort *temperature, const Level g,
                         __global const int2 *restrict offsets,
                         __global const int *restrict reach, __global const int *restrict index_of,
                         __global const int *restrict positions, __global const float *restrict disc,
                         __global const int *restrict at, __global const ushort *restrict levels,
                         COSTS,
                         __global const uint *restrict noise, __global int *restrict weighed, const uint turn,
                         __global ushort *restrict new_values,
                         __global int *restrict new_source, __global ushort *restrict new_temperature)
{
    int s = first + (int)get_global_id(0);
#ifdef APART
    s = min(s, S - 1); // an idle work-item would read at wild indices on Intel's runtime
#else
    if (s >= S)
        return;
#endif
    const Lattice h = g.lattice;
    const int site = sites[s], line = site / h.width, i = lattice_row(h, line), j = (site - line * h.width) / h.spacing;
    const ulong place = place_of(h, i, j);

    // 6.2.2.1: the neighbourhood, and the sum of equation (13). Vectors also read what is no neighbour, which others may
    // be writing, and multiply it by 0.
    int row[ROWS], col[SIDE];
    rows_around(h, i, row);
    lines_around(j, h.cols, h.around_cols, h.spacing, col);
#ifdef TILES
#define ELSEWHERE(a, b)                                                                                                \
    (row[a] / (h.width * h.spacing) / h.tile_rows != i / h.tile_rows || col[b] / h.spacing / h.tile_cols != j / h.tile_cols \
         ? h.elsewhere                                                                                                 \
         : 0)
#else
#define ELSEWHERE(a, b) 0
#endif
#define NEIGHBOUR(a, b)                                                                                                \
    (row[a] < 0 || col[b] < 0 || row[a] + col[b] == site ? -1 : row[a] + col[b] + ELSEWHERE(a, b))
    SQUARE;
    int sum = g.xi, members = 0;
#if V > 1
    if (h.spacing <= 2 && !h.tile_rows && h.high >= SIDE && j >= RADIUS &&
        (j - RADIUS + 16 * CHUNKS) * h.spacing <= h.width) {
        float16 heat = 0.0f, inside = 0.0f; // integers below 2^24, so in any order
        for (int a = 0; a < ROWS; ++a)
            for (int k = 0; k < CHUNKS; ++k) {
                const int cell = a * CHUNKS + k, from = max(row[a], 0) + (j - RADIUS + 16 * k) * h.spacing;
                const float16 in = row[a] < 0 ? (float16)0.0f : vload16(cell, disc);
                const float16 t = spread(temperature + from, h.spacing);
                float16 certain = (1024.0f - t) * 0x1p-10f * in;
#ifdef OWN
                certain *= select((float16)1.0f, (float16)g.hard, spread_int(source + from, h.spacing) < 0);
                const float16 guide = in + (row[a] < 0 ? 0.0f : g.centre) * middle(a, k);
#endif
                for (int c = 0; c < C; ++c) {
                    const float16 x = spread(values + c * g.area + from, h.spacing);
                    const float16 uc = CONFIDENCES_OF(c < MADE, x, certain, guide);
                    u[cell * CONFIDENCES + CONFIDENT(c)] = uc;
                    xu[cell * C + c] = x * uc;
                }
                heat += t * in;
                inside += in;
            }
        sum += (int)folded(heat);
        members = (int)folded(inside);
    } else
#endif
    {
        for (int cell = 0; cell < CELLS; ++cell)
            for (int n = 0; n < 16; ++n) {
                for (int c = 0; c < CONFIDENCES; ++c)
                    U(cell, c, n) = 0.0f;
                for (int c = 0; c < C; ++c)
                    XU(cell, c, n) = 0.0f;
            }
        for (int k = 0; k < g.neighbours; ++k) {
            const int a = ROW(offsets[k].x), b = offsets[k].y + RADIUS;
            const int r = NEIGHBOUR(a, b);
            if (r < 0)
                continue;
            const int t = temperature[r], cell = a * CHUNKS + b / 16, n = b % 16;
            sum += t;
            ++members;
            const float ur = WEIGHED_AS((float)(1024 - t) * 0x1p-10f, source[r], g.hard);
            PUT(cell, n, r, ur, 1.0f);
        }
        if (G)
            PUT(ROW(0) * CHUNKS + RADIUS / 16, RADIUS % 16, site, 0.0f, g.centre);
    }

    // The list.
    int list[SLOTS], m = 0;
    ulong seen = 0;
    for (int k = 0; k < min(SUGGESTING, g.neighbours); ++k) {
        const int r = NEIGHBOUR(ROW(offsets[k].x), offsets[k].y + RADIUS);
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
    float d[SLOTS + V];
    for (int k = 0; k < m; ++k)
        d[k] = PLUS_COSTS(distance_in_lanes(at[list[k]], u, xu, levels, g.plane, g.down, g.deep) *
                              (k < suggested ? g.discount : 1.0f),
                          list[k], site);

    // 6.2.2.2
#define NUMBER(k) list[k]
#define PIXEL(k) at[list[k]]
    CHOOSE(chosen, g, d, m, levels, g.plane, noise, turn, place)
#ifdef APART
    if (first + (int)get_global_id(0) >= S)
        return;
#endif
    const int out = PLACE(s, site), step = STRIDE(S, g);
    for (int c = 0; c < MADE; ++c)
        NEW(values)[c * step + out] = (ushort)grey_level(g, (int)levels[c * g.plane + PIXEL(chosen)], c, noise, turn, place);
    NEW(source)[out] = positions[list[chosen]];
    NEW(temperature)[out] = cooled_to(sum, members); // 6.2.2.3
    weighed[site] += m;
}
#endif

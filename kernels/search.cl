// SPDX-License-Identifier: BSD-3-Clause
// Coherent search: the relaxation of a site that weighs a few candidates instead of all. They are, in this order,
//
//   1. p_r + (s - r), where the sample continues the source p_r of neighbour r, r one of the `suggesting` nearest
//      neighbours that a relaxation has touched (t < 1);
//   2. the present source of s;
//   3. the K positions of the sample most similar to each of those so far;
//   4. `chance` positions at random, and one where there would be none at all,
//
// each of them once. The distance of equation (12), its coherence (1. is favoured), the weights of equation (7), the
// draw or mode and the temperature of equation (13) are those of lcpdf.cl, coherence.cl and temperature.cl, all in one
// kernel.
// -D ALL weighs every candidate of the level instead.
#pragma OPENCL FP_CONTRACT OFF
#include "common/lanes.h"
#include "common/lattice.h"
#define LEVEL ushort
#include "common/parzen.h"
#include "common/philox.h"

#ifndef RADIUS
#define RADIUS 4 // of the neighbourhood
#endif
#ifndef SLOTS
#define SLOTS 64 // candidates that a site may have, -D ALL apart
#endif
#ifndef KEPT
#define KEPT 0 // with -D ALL: distances that are kept, all of them or none
#endif
#ifndef V
#define V 1
#endif
#define SIDE (2 * RADIUS + 1)
#define CHUNKS ((SIDE + 15) / 16)
#define CELLS (SIDE * CHUNKS) // of 16 lanes: the square around the neighbourhood, row by row

// The sum over neighbours has one order: lane n takes the columns n, n + 16, ... of the square, row by row, channels
// inside; then lanes n and n + 8 are added, n and n + 4, n and n + 2, n and n + 1.
#if V == 1
inline float folded(__private float *a)
{
    for (int half_ = 8; half_; half_ /= 2)
        for (int n = 0; n < half_; ++n)
            a[n] += a[n + half_];
    return a[0];
}
#define WINDOW float u[CELLS * 16], xu[CELLS * C * 16]
#define U(cell, lane) u[(cell) * 16 + (lane)]
#define XU(cell, c, lane) xu[((cell) * C + (c)) * 16 + (lane)]
#define WINDOW_ARG __private const float *u, __private const float *xu
#else
inline float folded(const float16 a)
{
    const float8 b = a.lo + a.hi;
    const float4 c = b.lo + b.hi;
    const float2 d = c.lo + c.hi;
    return d.x + d.y;
}
#define WINDOW float16 u[CELLS], xu[CELLS * C]
#define U(cell, lane) ((__private float *)(u + (cell)))[lane]
#define XU(cell, c, lane) ((__private float *)(xu + (cell) * C + (c)))[lane]
#define WINDOW_ARG __private const float16 *u, __private const float16 *xu
#endif

#if V > 1
// Every first or second of what follows p, 16 of them.
inline float16 spread(__global const ushort *p, const int spacing)
{
    return convert_float16(spacing == 1 ? vload16(0, p) : (ushort16)(vload16(0, p).even, vload16(1, p).even));
}
#endif

// Equation (12): d of the candidate at place q of the sample's lattice, whose rows are `down` apart.
inline float distance_to(const int q, WINDOW_ARG, __global const LEVEL *restrict lattice, const int plane,
                         const int down)
{
    __global const LEVEL *y = lattice + q - RADIUS * down - RADIUS;
#if V == 1
    float d[16];
    for (int n = 0; n < 16; ++n)
        d[n] = 0.0f;
    for (int cell = 0; cell < CELLS; ++cell)
        for (int c = 0; c < C; ++c)
            for (int n = 0; n < 16; ++n) {
                const float un = u[cell * 16 + n];
                if (un == 0.0f) // would add 0
                    continue;
                const float yn = (float)y[c * plane + cell / CHUNKS * down + cell % CHUNKS * 16 + n];
                const float e = fma(-yn, un, xu[(cell * C + c) * 16 + n]);
                d[n] = fma(e, e, d[n]);
            }
#else
    float16 d = 0.0f;
#pragma unroll
    for (int cell = 0; cell < CELLS; ++cell)
#pragma unroll
        for (int c = 0; c < C; ++c) {
            const float16 yn = convert_float16(vload16(0, y + c * plane + cell / CHUNKS * down + cell % CHUNKS * 16));
            const float16 e = fma(-yn, u[cell], xu[cell * C + c]);
            d = fma(e, e, d);
        }
#endif
    return folded(d);
}

// Whether i is among the first m of a list; `seen` has a bit for each that is.
#define BIT(i) (1ul << ((uint)(i) * 0x9E3779B1u >> 26))
inline bool listed(const int i, __private const int *list, const int m, const ulong seen)
{
    if (!(seen & BIT(i)))
        return false;
    for (int j = 0; j < m; ++j)
        if (list[j] == i)
            return true;
    return false;
}

// sites    (S,)          those that relax together are first .. S-1
// values (C, H, W), source (H, W), temperature (H, W)   the field, in and out: in place, since no two of these sites
//                        are neighbours; -D APART writes to new_values (C, S), new_source, new_temperature (S,) instead
// weighed  (H, W)        in and out: candidates that each site has weighed so far
// offsets  (N, 2)        canonical order
// disc     (CELLS, 16)   1 on the neighbourhood, 0 elsewhere
// reach    (N,)          pixel offset in the sample of each neighbour
// index_of (pixels,)     number of the candidate at a pixel of the sample, -1 where there is none
// positions (count,)     pixel index of each candidate
// at       (count,)      its place in `lattice`
// lattice  (C, plane)    working grey levels of the sample, columns apart by the level's spacing side by side
// similar  (count, K)    numbers of the candidates most similar to each
// window arguments       as in lcpdf.cl
// One work-item per site.
__kernel void search(__global const int *restrict sites, const int S, __global ushort *values, __global int *source,
                     __global ushort *temperature, __global int *restrict weighed, const int area, GRID,
                     __global const int2 *restrict offsets, const int N, __global const float *restrict disc,
                     __global const int *restrict reach, const int suggesting,
                     __global const int *restrict index_of, const int pixels, __global const int *restrict positions,
                     __global const int *restrict at, const int count,
                     __global const LEVEL *restrict lattice, const int plane, const int down,
                     __global const int *restrict similar, const int K, const int chance, const float favour,
                     const int xi, const float scale, __global const uint *restrict noise, const int noise_radius,
                     const int top, const ulong seed, const uint level, const uint turn, const int gibbs,
                     __global ushort *restrict new_values, __global int *restrict new_source,
                     __global ushort *restrict new_temperature LANES_ARG)
{
    const int s = LANE;
    if (IDLE(s))
        return;
    const int site = sites[s], line = site / width, i = line / spacing, j = (site - line * width) / spacing;

    // Rows and columns of the square around the site as parts of a pixel index, -1 outside an open lattice.
    int row[SIDE], col[SIDE];
#ifdef TILES
    bool row_apart[SIDE], col_apart[SIDE];
#endif
    for (int a = 0; a < SIDE; ++a) {
        int k = i + a - RADIUS, l = j + a - RADIUS;
        while (torus && k < 0)
            k += rows;
        while (torus && k >= rows)
            k -= rows;
        while (torus && l < 0)
            l += cols;
        while (torus && l >= cols)
            l -= cols;
        row[a] = k < 0 || k >= rows ? -1 : SITE(k, 0);
        col[a] = l < 0 || l >= cols ? -1 : SITE(0, l);
#ifdef TILES
        row_apart[a] = k / tile_rows != i / tile_rows;
        col_apart[a] = l / tile_cols != j / tile_cols;
#endif
    }
#ifdef TILES
#define APART_FROM(a, b) (row_apart[a] || col_apart[b] ? elsewhere : 0)
#else
#define APART_FROM(a, b) 0
#endif
#define PIXEL(a, b)                                                                                                    \
    (row[a] < 0 || col[b] < 0 || row[a] + col[b] == site ? -1 : row[a] + col[b] + APART_FROM(a, b))

    // The neighbourhood, as in neighbourhood.cl, and the sum of equation (13). Vectors also read what is no neighbour,
    // which others may be writing, and multiply it by 0.
    WINDOW;
    int sum = xi, members = 0;
#if V > 1
    if (spacing <= 2 && !tile_rows && rows >= SIDE && j >= RADIUS && (j - RADIUS + 16 * CHUNKS) * spacing <= width) {
        float16 heat = 0.0f, inside = 0.0f; // whole numbers below 2^24, so in any order
        for (int a = 0; a < SIDE; ++a)
            for (int k = 0; k < CHUNKS; ++k) {
                const int cell = a * CHUNKS + k, from = max(row[a], 0) + (j - RADIUS + 16 * k) * spacing;
                const float16 in = row[a] < 0 ? (float16)0.0f : vload16(cell, disc);
                const float16 t = spread(temperature + from, spacing);
                u[cell] = (1024.0f - t) * 0x1p-10f * in;
                for (int c = 0; c < C; ++c)
                    xu[cell * C + c] = spread(values + c * area + from, spacing) * u[cell];
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
                U(cell, n) = 0.0f;
                for (int c = 0; c < C; ++c)
                    XU(cell, c, n) = 0.0f;
            }
        for (int k = 0; k < N; ++k) {
            const int a = offsets[k].x + RADIUS, b = offsets[k].y + RADIUS;
            const int r = PIXEL(a, b);
            if (r < 0)
                continue;
            const int t = temperature[r], cell = a * CHUNKS + b / 16, n = b % 16;
            sum += t;
            ++members;
            const float ur = (float)(1024 - t) * 0x1p-10f;
            U(cell, n) = ur;
            for (int c = 0; c < C; ++c)
                XU(cell, c, n) = (float)values[c * area + r] * ur;
        }
    }

    // The candidates.
    int list[SLOTS];
    int m = 0;
    ulong seen = 0;
#define ADD(number)                                                                                                    \
    {                                                                                                                  \
        const int number_ = number;                                                                                    \
        if (number_ >= 0 && !listed(number_, list, m, seen)) {                                                         \
            list[m++] = number_;                                                                                       \
            seen |= BIT(number_);                                                                                      \
        }                                                                                                              \
    }
    for (int k = 0; k < suggesting; ++k) {
        const int r = PIXEL(offsets[k].x + RADIUS, offsets[k].y + RADIUS);
        if (r < 0 || temperature[r] >= 1024)
            continue;
        const int p = source[r] - reach[k];
        ADD(p < 0 || p >= pixels ? -1 : index_of[p])
    }
    const int suggested = m;
#ifdef ALL
    m = count;
#define NUMBER(k) (k)
#define FAVOUR(k) (listed(k, list, suggested, seen) ? favour : 1.0f)
#define WEIGHED(k) (distance_to(at[k], u, xu, lattice, plane, down) * FAVOUR(k))
#if KEPT
#define D(k) distance[k]
    float distance[KEPT];
#else
#define D(k) WEIGHED(k)
#endif
    float smallest = INFINITY;
    int best = 0;
    for (int k = 0; k < m; ++k) {
        const float d = WEIGHED(k);
        best = d < smallest ? k : best;
        smallest = fmin(d, smallest);
#if KEPT
        distance[k] = d;
#endif
    }
#else
    ADD(index_of[source[site]])
    const int own = m;
    for (int k = 0; k < own; ++k)
        for (int n = 0; n < K; ++n)
            ADD(similar[list[k] * K + n])
    const int draws = max(chance, m == 0 ? 1 : 0);
    for (int k = 0; k < draws; k += 4) {
        const uint4 bits = draw4(seed, level, turn, site, PURPOSE_SEARCH, k / 4);
        const uint word[4] = {bits.x, bits.y, bits.z, bits.w};
        for (int n = 0; n < 4 && k + n < draws; ++n)
            ADD((int)((ulong)word[n] * (uint)count >> 32))
    }
#define NUMBER(k) list[k]
#define D(k) distance[k]
    float distance[SLOTS];
    float smallest = INFINITY;
    int best = 0;
    for (int k = 0; k < m; ++k) {
        const float d = distance_to(at[list[k]], u, xu, lattice, plane, down);
        const float dk = k < suggested ? d * favour : d;
        if (dk < smallest || (dk == smallest && list[k] < list[best]))
            best = k;
        smallest = fmin(dk, smallest);
        distance[k] = dk;
    }
#endif

    // What the site takes.
#define MASS(k) mass_of(D(k), smallest, scale, lattice, plane, at[NUMBER(k)], noise, noise_radius, top)
    if (gibbs) {
        ulong total = 0;
        for (int k = 0; k < m; ++k)
            total += MASS(k);
        const uint4 bits = draw4(seed, level, turn, site, PURPOSE_DRAW, 0);
        const ulong target = below(bits.x, bits.y, total);
        ulong reached = 0;
        best = -1;
        for (int k = 0; k < m && best < 0; ++k) {
            reached += MASS(k);
            best = reached > target ? k : -1;
        }
    }
    const int chosen = NUMBER(best);
#ifdef APART
#define OUT(name) new_##name
    const int out = s, step = S;
#else
#define OUT(name) name
    const int out = site, step = area;
#endif
    for (int c = 0; c < C; ++c) {
        int x = (int)lattice[c * plane + at[chosen]];
        if (gibbs && noise_radius >= 0)
            x += step_from(noise, noise_radius, x, top, draw4(seed, level, turn, site, PURPOSE_DRAW, 1 + c).x);
        OUT(values)[c * step + out] = (ushort)x;
    }
    OUT(source)[out] = positions[chosen];
    OUT(temperature)[out] = sum > 0 ? (ushort)(sum / max(members, 1)) : (ushort)0;
    weighed[site] += m;
}

// The K candidates whose neighbourhoods are most like that of candidate first + s, by the distances of lcpdf.cl;
// nearest first, the lowest index where several are as near.
//
// distance (candidates, P)
// similar  (candidates, K)   out: rows first .. first + S - 1
// One work-item per candidate.
__kernel void search_similar(__global const float *restrict distance, const int first, const int S, const int P,
                             const int count, const int K, __global int *restrict similar)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    __global int *best = similar + (first + s) * K;
    int m = 0;
    for (int p = 0; p < count; ++p) {
        const float d = distance[p * P + s];
        if (p == first + s || (m == K && d >= distance[best[K - 1] * P + s]))
            continue;
        int k = m < K ? m++ : K - 1;
        for (; k > 0 && distance[best[k - 1] * P + s] > d; --k)
            best[k] = best[k - 1];
        best[k] = p;
    }
}

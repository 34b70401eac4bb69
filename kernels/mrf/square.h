// SPDX-License-Identifier: BSD-3-Clause
// The square around a neighbourhood, or the cube (-D AXES=3), row by row in cells of 16 lanes, and the distance of one
// candidate summed over it.
//
// The sum has one order: lane n takes the columns n, n + 16, ... of the square, row by row, channels inside; then lanes n
// and n + 8 are added, n and n + 4, n and n + 2, n and n + 1.
#include "mrf/coherence.h"
#include "mrf/confidence.h"
#include "common/distance.h"
#include "mrf/group.h"
#include "mrf/level.h"
#include "common/vector.h"

#ifndef RADIUS
#define RADIUS 4 // of the neighbourhood
#endif
#define SIDE (2 * RADIUS + 1)
#define CHUNKS ((SIDE + 15) / 16)
#if AXES > 2
#define ROWS (SIDE * SIDE)
#define MIDDLE (RADIUS * SIDE + RADIUS) // row of the site itself
#define ROW(offset) ((LAYERS(offset) + RADIUS) * SIDE + DOWN(offset) + RADIUS)
#else
#define ROWS SIDE
#define MIDDLE RADIUS
#define ROW(offset) (DOWN(offset) + RADIUS)
#endif
#define CELLS (ROWS * CHUNKS)

#if ITEMS == 1
// Lines a = 0 .. SIDE - 1 about line `at` of `count`, as parts of a site's number; -1 beyond an end that does not wrap.
static inline void lines_around(const int at, const int count, const int wraps, const int stride, __private int *line)
{
    for (int a = 0; a < SIDE; ++a) {
        int k = at + a - RADIUS;
        while (wraps && k < 0)
            k += count;
        while (wraps && k >= count)
            k -= count;
        line[a] = k < 0 || k >= count ? -1 : k * stride;
    }
}

// The rows around row i of a lattice, likewise.
static inline void rows_around(const Lattice g, const int i, __private int *row)
{
#if AXES > 2
    int layer[SIDE], line[SIDE];
    lines_around(i / g.rows, g.layers, g.around_layers, g.rows * g.cols, layer);
    lines_around(i % g.rows, g.rows, g.around_rows, g.cols, line);
    for (int a = 0; a < ROWS; ++a)
        row[a] = layer[a / SIDE] < 0 || line[a % SIDE] < 0 ? -1 : layer[a / SIDE] + line[a % SIDE];
#else
    lines_around(i, g.rows, g.around_rows, g.cols, row);
#endif
}

// Number of the neighbour in row a and column b of the square; -1 where there is none. -D TILES: see lattice.h.
static inline int in_square(const Lattice g, const int site, const int i, const int j, const __private int *row,
                            const __private int *col, const int a, const int b)
{
    if (row[a] < 0 || col[b] < 0 || row[a] + col[b] == site)
        return -1;
#ifdef TILES
    if (row[a] / g.cols / g.tile_rows != i / g.tile_rows || col[b] / g.tile_cols != j / g.tile_cols)
        return row[a] + col[b] + g.elsewhere;
#endif
    return row[a] + col[b];
}
#endif

#if V == 1
static inline float folded(__private float *a)
{
    for (int half_ = 8; half_; half_ /= 2)
        for (int n = 0; n < half_; ++n)
            a[n] += a[n + half_];
    return a[0];
}
#define SQUARE SHARED float u[CELLS * CONFIDENCES * 16], xu[CELLS * C * 16]
#define U(cell, c, lane) u[((cell) * CONFIDENCES + CONFIDENT(c)) * 16 + (lane)]
#define XU(cell, c, lane) xu[((cell) * C + (c)) * 16 + (lane)]
#define SQUARE_ARG(const) const SHARED float *u, const SHARED float *xu
#else
static inline float folded(const float16 a)
{
    const float8 b = a.lo + a.hi;
    const float4 c = b.lo + b.hi;
    const float2 d = c.lo + c.hi;
    return d.x + d.y;
}
#define SQUARE float16 u[CELLS * CONFIDENCES], xu[CELLS * C]
#define U(cell, c, lane) ((__private float *)(u + (cell) * CONFIDENCES + CONFIDENT(c)))[lane]
#define XU(cell, c, lane) ((__private float *)(xu + (cell) * C + (c)))[lane]
#define SQUARE_ARG(const) const __private float16 *u, const __private float16 *xu

// 1 in the lane of cell k of row a that is the site itself, 0 elsewhere.
static inline float16 middle(const int a, const int k)
{
    float16 lanes = 0.0f;
    if (a == MIDDLE && k == RADIUS / 16)
        ((__private float *)&lanes)[RADIUS % 16] = 1.0f;
    return lanes;
}

#ifndef OWN
#define CONFIDENCES_OF(made, x, u, guide) (u)
#else
#define CONFIDENCES_OF(made, x, u, guide) select((made) ? (u) : (guide), (float16)0.0f, (x) == (float)UNKNOWN)
#endif
#endif

// The neighbourhood of a site: u = 1 - t_r and x_r u in the lane of each neighbour r, 0 in all others, and of guides in
// that of the site too; `heat`, the sum of the temperatures of the neighbours on the lattice, and their number. Neighbour
// k of `offsets`.
//
// disc (CELLS, 16)  1 on the neighbourhood, 0 elsewhere
#if ITEMS == 1
#define AROUND(g, site, i, j)                                                                                          \
    int row[ROWS], col[SIDE];                                                                                          \
    rows_around((g).lattice, i, row);                                                                                  \
    lines_around(j, (g).lattice.cols, (g).lattice.around_cols, 1, col);                                                \
    SQUARE;                                                                                                            \
    const int2 heat = gather(g, site, i, j, row, col, values, source, temperature, offsets, disc, u, xu)
#define NEIGHBOUR(g, k) in_square(g, site, i, j, row, col, ROW(offsets + AXES * (k)), RIGHT(offsets + AXES * (k)) + RADIUS)
#else
#define AROUND(g, site, i, j)                                                                                          \
    SQUARE;                                                                                                            \
    __local int warmth[2];                                                                                             \
    const int2 heat = gather(g, site, i, j, values, source, temperature, disc, u, xu, warmth)
#define NEIGHBOUR(g, k) neighbour(g, i, j, offsets + AXES * (k))
#endif

// Site r, a neighbour or the site itself, in a lane of a cell. Returns its temperature and 1, of the site itself 0.
static inline int2 put_in_lane(const Level g, const int r, const bool self, const int cell, const int lane,
                               __global const ushort *values, __global const int *source,
                               __global const ushort *temperature, SQUARE_ARG())
{
    const int t = self ? UNTOUCHED : temperature[r];
    const float certain = WEIGHED_AS((float)(1024 - t) * 0x1p-10f, source[r], g.hard);
    for (int c = 0; c < C; ++c) {
        const ushort x = values[c * g.area + r];
        const float guide = self ? g.centre : 1.0f, data = self ? g.centre_known : g.hard;
        const float uc = CONFIDENCE_OF(c < MADE, x, certain, c < C - KNOWN ? guide : data);
        U(cell, c, lane) = uc;
        XU(cell, c, lane) = (float)x * uc;
    }
    return self ? (int2)0 : (int2)(t, 1);
}

static inline void empty_lane(const int cell, const int lane, SQUARE_ARG())
{
    for (int c = 0; c < CONFIDENCES; ++c)
        U(cell, c, lane) = 0.0f;
    for (int c = 0; c < C; ++c)
        XU(cell, c, lane) = 0.0f;
}

#if ITEMS > 1
static inline int2 gather(const Level g, const int site, const int i, const int j, __global const ushort *values,
                          __global const int *source, __global const ushort *temperature,
                          __global const float *disc, SQUARE_ARG(), __local int *warmth)
{
    if (ITEM < 2)
        warmth[ITEM] = 0;
    TOGETHER;
    EACH(n, CELLS * 16) {
        const int cell = n / 16, a = cell / CHUNKS, b = cell % CHUNKS * 16 + n % 16 - RADIUS;
        const bool self = G > 0 && a == MIDDLE && b == 0;
        int r = self ? site : -1;
        if (disc[n] > 0.0f)
            r = neighbour_at(g.lattice, i, j, AXES > 2 ? a / SIDE - RADIUS : 0, a % SIDE - RADIUS, b);
        if (r < 0) {
            empty_lane(cell, n % 16, u, xu);
            continue;
        }
        const int2 found = put_in_lane(g, r, self, cell, n % 16, values, source, temperature, u, xu);
        atomic_add(warmth, found.x);
        atomic_add(warmth + 1, found.y);
    }
    TOGETHER;
    return (int2)(warmth[0], warmth[1]);
}
#else
// Vectors also read what is no neighbour, which others may be writing, and multiply it by 0.
static inline int2 gather(const Level g, const int site, const int i, const int j, const __private int *row,
                          const __private int *col, __global const ushort *values, __global const int *source,
                          __global const ushort *temperature, __global const int *offsets,
                          __global const float *disc, SQUARE_ARG())
{
    const Lattice h = g.lattice;
#if V > 1
    if (!h.tile_rows && h.rows >= SIDE && j >= RADIUS && j - RADIUS + 16 * CHUNKS <= h.cols) {
        float16 heat = 0.0f, inside = 0.0f; // integers below 2^24, so in any order
        for (int a = 0; a < ROWS; ++a)
            for (int k = 0; k < CHUNKS; ++k) {
                const int cell = a * CHUNKS + k, from = max(row[a], 0) + j - RADIUS + 16 * k;
                const float16 in = row[a] < 0 ? (float16)0.0f : vload16(cell, disc);
                const float16 t = convert_float16(vload16(0, temperature + from));
                float16 certain = (1024.0f - t) * 0x1p-10f * in;
#ifdef OWN
                certain *= select((float16)1.0f, (float16)g.hard, vload16(0, source + from) < 0);
                const float16 guide = in + (row[a] < 0 ? 0.0f : g.centre) * middle(a, k);
                const float16 data = in * g.hard + (row[a] < 0 ? 0.0f : g.centre_known) * middle(a, k);
#endif
                for (int c = 0; c < C; ++c) {
                    const float16 x = convert_float16(vload16(0, values + c * g.area + from));
                    const float16 uc = CONFIDENCES_OF(c < MADE, x, certain, c < C - KNOWN ? guide : data);
                    u[cell * CONFIDENCES + CONFIDENT(c)] = uc;
                    xu[cell * C + c] = x * uc;
                }
                heat += t * in;
                inside += in;
            }
        return (int2)((int)folded(heat), (int)folded(inside));
    }
#endif
    for (int cell = 0; cell < CELLS; ++cell)
        for (int n = 0; n < 16; ++n)
            empty_lane(cell, n, u, xu);
    int2 found = 0;
    for (int k = 0; k < g.neighbours + (G > 0); ++k) {
        const bool self = k == g.neighbours;
        const int a = self ? MIDDLE : ROW(offsets + AXES * k), b = (self ? 0 : RIGHT(offsets + AXES * k)) + RADIUS;
        const int r = self ? site : in_square(h, site, i, j, row, col, a, b);
        if (r >= 0)
            found += put_in_lane(g, r, self, a * CHUNKS + b / 16, b % 16, values, source, temperature, u, xu);
    }
    return found;
}
#endif

// Where row a of the square around a candidate begins in `levels`, from the candidate.
#if AXES > 2
#define ROW_AT(a, row_stride, layer_stride)                                                                            \
    (((a) / SIDE - RADIUS) * (layer_stride) + ((a) % SIDE - RADIUS) * (row_stride) - RADIUS)
#else
#define ROW_AT(a, row_stride, layer_stride) (((a) - RADIUS) * (row_stride) - RADIUS)
#endif

// Equation (12): d of the candidate whose grey levels are at y, in a sample with these strides.
#if V == 1
static inline float lane_of_distance(__global const float *y, SQUARE_ARG(const), const int plane,
                                     const int row_stride, const int layer_stride, const int lane)
{
    float d = 0.0f;
    for (int cell = 0; cell < CELLS; ++cell)
        for (int c = 0; c < C; ++c) {
            const int at = c * plane + ROW_AT(cell / CHUNKS, row_stride, layer_stride) + cell % CHUNKS * 16 + lane;
            const float e = GAP(y[at], U(cell, c, lane), XU(cell, c, lane));
            d = fma(e, e, d);
        }
    return d;
}
#endif

#if ITEMS == 1
// No partial sum exceeds the whole one, so that a candidate beyond the bound is left out half-way: infinity.
#define BOUND const float factor, const float most, const float best
#define UNBOUNDED 1.0f, 0.0f, INFINITY
#define BEYOND(d) (PRODUCT(d, factor) - most > best)
#if V == 1
static inline float distance_in_lanes(__global const float *y, SQUARE_ARG(const), const int plane,
                                      const int row_stride, const int layer_stride, BOUND)
{
    float d[16];
    for (int n = 0; n < 16; ++n)
        d[n] = lane_of_distance(y, u, xu, plane, row_stride, layer_stride, n);
    return folded(d);
}
#else
#if SIDE > 8
#define LOW(x) (x)
#define LOW_AT(y) vload16(0, y)
typedef float16 low;
#else // the other lanes are 0
#define LOW(x) (x).lo
#define LOW_AT(y) vload8(0, y)
typedef float8 low;
#endif
static inline float folded_low(const low d)
{
#if SIDE > 8
    return folded(d);
#else
    const float4 c = d.lo + d.hi;
    const float2 e = c.lo + c.hi;
    return e.x + e.y;
#endif
}

#if AXES > 2
#define APART_IN_ROW(a) (((a) / SIDE - RADIUS) * ((a) / SIDE - RADIUS) + ((a) % SIDE - RADIUS) * ((a) % SIDE - RADIUS))
#define EMPTY(a) (APART_IN_ROW(a) > ORDER) // row of the cube without a neighbour
#else
#define EMPTY(a) false
#endif

static inline float distance_in_lanes(__global const float *y, SQUARE_ARG(const), const int plane,
                                      const int row_stride, const int layer_stride, BOUND)
{
    low d = 0.0f;
#pragma unroll
    for (int cell = 0; cell < CELLS; ++cell) {
        if (EMPTY(cell / CHUNKS))
            continue;
        if ((cell == CELLS / 2 || cell == 3 * CELLS / 4) && BEYOND(folded_low(d)))
            return INFINITY;
        __global const float *row = y + ROW_AT(cell / CHUNKS, row_stride, layer_stride) + cell % CHUNKS * 16;
#ifdef HOT // x and y differ in two channels of the categories, whose terms are equal, or in none
        const low e = select(LOW(xu[cell * C]), (low)0.0f, LOW_AT(row + C * plane) == LOW(xu[cell * C + 1]));
        d = fma(e, e, fma(e, e, d));
#pragma unroll
        for (int c = HOT; c < C; ++c) {
#else
#pragma unroll
        for (int c = 0; c < C; ++c) {
#endif
            const low gap = GAP(LOW_AT(row + c * plane), LOW(u[cell * CONFIDENCES + CONFIDENT(c)]), LOW(xu[cell * C + c]));
            d = fma(gap, gap, d);
        }
    }
    return folded_low(d);
}
#endif

#ifdef HOT
// What replaces x_r u in the first HOT channels, of which one is not 0: it, and the number of its channel from 1.
static inline void by_category(__private float16 *xu)
{
    for (int cell = 0; cell < CELLS; ++cell) {
        float16 height = 0.0f, number = 0.0f;
        for (int c = 0; c < HOT; ++c) {
            height += xu[cell * C + c];
            number = select(number, (float16)(c + 1), xu[cell * C + c] > 0.0f);
        }
        xu[cell * C] = height;
        xu[cell * C + 1] = number;
    }
}
#endif
#endif

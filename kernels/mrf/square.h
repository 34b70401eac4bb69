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

#define SIDE (2 * RADIUS + 1) // -D RADIUS of the neighbourhood
#define CHUNKS ((SIDE + 15) / 16)
#define ROWS (AXES > 2 ? SIDE * SIDE : SIDE)
#define MIDDLE (AXES > 2 ? RADIUS * SIDE + RADIUS : RADIUS) // row of the site itself
#define CELLS (ROWS * CHUNKS)

// The first lane of a cell in u = 1 - t_r and in xu = x_r u.
#define U_AT(cell, c) (((cell) * CONFIDENCES + CONFIDENT(c)) * 16)
#define X_AT(cell, c) (((cell) * C + (c)) * 16)
#define ALIGNED __attribute__((aligned(V > 1 ? 64 : 4)))

// The row of the square in which an offset is.
static inline int row_of(__global const int *offset)
{
    return (AXES > 2 ? (LAYERS(offset) + RADIUS) * SIDE : 0) + DOWN(offset) + RADIUS;
}

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

// The rows and columns around site (i, j) of a lattice, likewise; a group needs none.
static inline void square_around(const Lattice g, const int i, const int j, __private int *row, __private int *col)
{
    if (ITEMS > 1)
        return;
    lines_around(j, g.cols, g.around_cols, 1, col);
    if (AXES == 2) {
        lines_around(i, g.rows, g.around_rows, g.cols, row);
        return;
    }
    int layer[SIDE], line[SIDE];
    lines_around(i / g.rows, g.layers, g.around_layers, g.rows * g.cols, layer);
    lines_around(i % g.rows, g.rows, g.around_rows, g.cols, line);
    for (int a = 0; a < ROWS; ++a)
        row[a] = layer[a / SIDE] < 0 || line[a % SIDE] < 0 ? -1 : layer[a / SIDE] + line[a % SIDE];
}

// Number of the neighbour in row a and column b of the square; -1 where there is none. -D TILES=1: see lattice.h.
static inline int in_square(const Lattice g, const int site, const int i, const int j, const __private int *row,
                            const __private int *col, const int a, const int b)
{
    if (row[a] < 0 || col[b] < 0 || row[a] + col[b] == site)
        return -1;
    const bool apart = TILES && (row[a] / g.cols / g.tile_rows != i / g.tile_rows || col[b] / g.tile_cols != j / g.tile_cols);
    return row[a] + col[b] + (apart ? g.elsewhere : 0);
}

// Number of the neighbour at an offset of the neighbourhood.
INLINED int neighbour_in_square(const Lattice g, const int site, const int i, const int j, const __private int *row,
                                const __private int *col, __global const int *offset)
{
    if (ITEMS > 1)
        return neighbour(g, i, j, offset);
    return in_square(g, site, i, j, row, col, row_of(offset), RIGHT(offset) + RADIUS);
}

// The sum of 16 lanes, or of 8.
static inline float folded(__private float *a)
{
    for (int half_ = 8; half_; half_ /= 2)
        for (int n = 0; n < half_; ++n)
            a[n] += a[n + half_];
    return a[0];
}

static inline float folded8(const float8 a)
{
    const float4 b = a.lo + a.hi;
    const float2 c = b.lo + b.hi;
    return c.x + c.y;
}

static inline float folded16(const float16 a)
{
    return folded8(a.lo + a.hi);
}

// Site r, a neighbour or the site itself, in a lane of a cell. Returns its temperature and 1, of the site itself 0.
static inline int2 put_in_lane(const Level g, const int r, const bool self, const int cell, const int lane,
                               __global const ushort *values, __global const int *source,
                               __global const ushort *temperature, SHARED float *u, SHARED float *xu)
{
    const int t = self ? UNTOUCHED : temperature[r];
    float certain = (float)(1024 - t) * 0x1p-10f;
    if (OWN && source[r] < 0) // hard data, which are from nowhere in the sample, count more
        certain *= g.hard;
    const float guide = self ? g.centre : 1.0f, data = self ? g.centre_known : g.hard;
    for (int c = 0; c < C; ++c) {
        const ushort x = values[c * g.area + r];
        float uc = certain;
        if (OWN)
            uc = x == UNKNOWN ? 0.0f : c < MADE ? certain : c < C - KNOWN ? guide : data;
        u[U_AT(cell, c) + lane] = uc;
        xu[X_AT(cell, c) + lane] = (float)x * uc;
    }
    return self ? (int2)0 : (int2)(t, 1);
}

static inline void empty_lane(const int cell, const int lane, SHARED float *u, SHARED float *xu)
{
    for (int c = 0; c < CONFIDENCES; ++c)
        u[U_AT(cell, c) + lane] = 0.0f;
    for (int c = 0; c < C; ++c)
        xu[X_AT(cell, c) + lane] = 0.0f;
}

// By a group of work-items.
static inline int2 gather_together(const Level g, const int site, const int i, const int j, __global const ushort *values,
                                   __global const int *source, __global const ushort *temperature,
                                   __global const float *disc, SHARED float *u, SHARED float *xu, SHARED int *warmth)
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
        const int2 heat = put_in_lane(g, r, self, cell, n % 16, values, source, temperature, u, xu);
        ADDED(warmth, heat.x);
        ADDED(warmth + 1, heat.y);
    }
    TOGETHER;
    return (int2)(warmth[0], warmth[1]);
}

// 1 in the lane of cell k of row a that is the site itself, 0 elsewhere.
static inline float16 middle(const int a, const int k)
{
    float16 lanes = 0.0f;
    if (a == MIDDLE && k == RADIUS / 16)
        ((__private float *)&lanes)[RADIUS % 16] = 1.0f;
    return lanes;
}

// By vectors, where no row of the square is cut. They also read what is no neighbour, which others may be writing, and
// multiply it by 0.
static inline int2 gather_rows(const Level g, const int j, const __private int *row, __global const ushort *values,
                               __global const int *source, __global const ushort *temperature,
                               __global const float *disc, SHARED float *u, SHARED float *xu)
{
    float16 heat = 0.0f, inside = 0.0f; // integers below 2^24, so in any order
    for (int a = 0; a < ROWS; ++a)
        for (int k = 0; k < CHUNKS; ++k) {
            const int cell = a * CHUNKS + k, from = max(row[a], 0) + j - RADIUS + 16 * k;
            const float16 in = row[a] < 0 ? (float16)0.0f : vload16(cell, disc);
            const float16 t = convert_float16(vload16(0, temperature + from));
            float16 certain = (1024.0f - t) * 0x1p-10f * in, guide = certain, data = certain;
            if (OWN) {
                certain *= select((float16)1.0f, (float16)g.hard, vload16(0, source + from) < 0);
                guide = in + (row[a] < 0 ? 0.0f : g.centre) * middle(a, k);
                data = in * g.hard + (row[a] < 0 ? 0.0f : g.centre_known) * middle(a, k);
            }
            for (int c = 0; c < C; ++c) {
                const float16 x = convert_float16(vload16(0, values + c * g.area + from));
                float16 uc = c < MADE ? certain : c < C - KNOWN ? guide : data;
                if (OWN)
                    uc = select(uc, (float16)0.0f, x == (float)UNKNOWN);
                vstore16(uc, 0, u + U_AT(cell, c));
                vstore16(x * uc, 0, xu + X_AT(cell, c));
            }
            heat += t * in;
            inside += in;
        }
    return (int2)((int)folded16(heat), (int)folded16(inside));
}

// The neighbourhood of a site: u = 1 - t_r and x_r u in the lane of each neighbour r, 0 in all others, and of guides in
// that of the site too. Returns the sum of the temperatures of the neighbours on the lattice, and their number.
//
// disc (CELLS, 16)  1 on the neighbourhood, 0 elsewhere
INLINED int2 gather(const Level g, const int site, const int i, const int j, const __private int *row,
                    const __private int *col, __global const ushort *values, __global const int *source,
                    __global const ushort *temperature, __global const int *offsets, __global const float *disc,
                    SHARED float *u, SHARED float *xu, SHARED int *warmth)
{
    const Lattice h = g.lattice;
    if (ITEMS > 1)
        return gather_together(g, site, i, j, values, source, temperature, disc, u, xu, warmth);
    if (V > 1 && !h.tile_rows && h.rows >= SIDE && j >= RADIUS && j - RADIUS + 16 * CHUNKS <= h.cols)
        return gather_rows(g, j, row, values, source, temperature, disc, u, xu);
    for (int cell = 0; cell < CELLS; ++cell)
        for (int n = 0; n < 16; ++n)
            empty_lane(cell, n, u, xu);
    int2 heat = 0;
    for (int k = 0; k < g.neighbours + (G > 0); ++k) {
        const bool self = k == g.neighbours;
        const int a = self ? MIDDLE : row_of(offsets + AXES * k), b = (self ? 0 : RIGHT(offsets + AXES * k)) + RADIUS;
        const int r = self ? site : in_square(h, site, i, j, row, col, a, b);
        if (r >= 0)
            heat += put_in_lane(g, r, self, a * CHUNKS + b / 16, b % 16, values, source, temperature, u, xu);
    }
    return heat;
}

// Where row a of the square around a candidate begins in `levels`, from the candidate.
static inline int row_at(const int a, const int row_stride, const int layer_stride)
{
    const int down = (AXES > 2 ? a % SIDE : a) - RADIUS;
    return (AXES > 2 ? (a / SIDE - RADIUS) * layer_stride : 0) + down * row_stride - RADIUS;
}

// Equation (12): d of the candidate whose grey levels are at y, in a sample with these strides.
static inline float lane_of_distance(__global const float *y, const SHARED float *u, const SHARED float *xu,
                                     const int plane, const int row_stride, const int layer_stride, const int lane)
{
    float d = 0.0f;
    for (int cell = 0; cell < CELLS; ++cell)
        for (int c = 0; c < C; ++c) {
            const int at = c * plane + row_at(cell / CHUNKS, row_stride, layer_stride) + cell % CHUNKS * 16 + lane;
            const float e = GAP(y[at], u[U_AT(cell, c) + lane], xu[X_AT(cell, c) + lane]);
            d = fma(e, e, d);
        }
    return d;
}

// Lanes that are not 0 in all cells.
#if SIDE > 8
#define USED 16
#else
#define USED 8
#endif
typedef JOIN(float, USED) low;
#define LOW(p) JOIN(vload, USED)(0, p)

// No partial sum exceeds the whole one, so that a candidate beyond the bound is left out half-way: infinity.
#define BEYOND(d) (PRODUCT(d, factor) - most > best)
#define UNBOUNDED 1.0f, 0.0f, INFINITY

// Whether row a of the cube has no neighbour.
static inline bool empty_row(const int a)
{
    const int layers = a / SIDE - RADIUS, down = a % SIDE - RADIUS;
    return AXES > 2 && layers * layers + down * down > ORDER;
}

static inline float distance_in_vectors(__global const float *y, const SHARED float *u, const SHARED float *xu,
                                        const int plane, const int row_stride, const int layer_stride,
                                        const float factor, const float most, const float best)
{
    low d = 0.0f;
#pragma unroll
    for (int cell = 0; cell < CELLS; ++cell) {
        if (empty_row(cell / CHUNKS))
            continue;
        if ((cell == CELLS / 2 || cell == 3 * CELLS / 4) && BEYOND(JOIN(folded, USED)(d)))
            return INFINITY;
        __global const float *row = y + row_at(cell / CHUNKS, row_stride, layer_stride) + cell % CHUNKS * 16;
        if (HOT) { // x and y differ in two channels of the categories, whose terms are equal, or in none
            const low height = LOW(xu + X_AT(cell, 0)), channel = LOW(xu + X_AT(cell, 1));
            const low e = select(height, (low)0.0f, LOW(row + C * plane) == channel);
            d = fma(e, e, fma(e, e, d));
        }
#pragma unroll
        for (int c = HOT; c < C; ++c) {
            const low gap = GAP(LOW(row + c * plane), LOW(u + U_AT(cell, c)), LOW(xu + X_AT(cell, c)));
            d = fma(gap, gap, d);
        }
    }
    return JOIN(folded, USED)(d);
}

static inline float distance_in_lanes(__global const float *y, const SHARED float *u, const SHARED float *xu,
                                      const int plane, const int row_stride, const int layer_stride,
                                      const float factor, const float most, const float best)
{
    if (V > 1)
        return distance_in_vectors(y, u, xu, plane, row_stride, layer_stride, factor, most, best);
    float d[16];
    for (int n = 0; n < 16; ++n)
        d[n] = lane_of_distance(y, u, xu, plane, row_stride, layer_stride, n);
    return folded(d);
}

// What replaces x_r u in the first HOT channels, of which one is not 0: it, and the number of its channel from 1.
static inline void by_category(SHARED float *xu)
{
    for (int cell = 0; cell < CELLS; ++cell) {
        float16 height = 0.0f, channel = 0.0f;
        for (int c = 0; c < HOT; ++c) {
            const float16 x = vload16(0, xu + X_AT(cell, c));
            height += x;
            channel = select(channel, (float16)(c + 1), x > 0.0f);
        }
        vstore16(height, 0, xu + X_AT(cell, 0));
        vstore16(channel, 0, xu + X_AT(cell, 1));
    }
}

// SPDX-License-Identifier: BSD-3-Clause
#include "common/border.h"
#include "common/vector.h"

// The steerable pyramid of Simoncelli and Freeman in integers: pictures are split into bands by small filters, and
// joined from bands by the same filters turned by 180 degrees. A sum is made in float32, over terms, bands, tap rows
// and tap columns in this order, each step an fma; the end result is rounded to an integer. Taps are multiples of
// 2^-24, which the twin relies on.
//
// Pictures are (planes, rows, cols). They are filtered in pieces: rows first_row .. of planes first .., of one or several
// bands, which steerable_pad lays out in float32 with what lies beyond the border, so that the filters need no rule for it.
// One work-item makes V adjacent columns of ROWS rows (-D V, -D ROWS), of one plane.

#if V == 1
#define TO_INT(x) convert_int_rte(x)
#define TO_FLOAT(x) convert_float(x)
#define STORE_INT(x, p) (*(p) = (x))
#define LOAD_INT(p) (*(p))
typedef int ivec;
#else
#define TO_INT(x) JOIN(JOIN(convert_int, V), _rte)(x)
#define TO_FLOAT(x) JOIN(convert_float, V)(x)
#define STORE_INT(x, p) JOIN(vstore, V)(x, 0, p)
#define LOAD_INT(p) JOIN(vload, V)(0, p)
typedef JOIN(int, V) ivec;
#endif

// V adjacent integers of a row, or as many as it has left.
static inline void store_row(const vec sum, const int left, __global int *to)
{
    const ivec whole = TO_INT(sum);
    if (left >= V) {
        STORE_INT(whole, to);
    } else {
        int lane[V];
        STORE_INT(whole, lane);
        for (int v = 0; v < left; ++v)
            to[v] = lane[v];
    }
}

#ifdef SPREAD
// A piece in float32 with `reach` pixels more on the left and above, and as many as needed on the right and below.
//
// picture  (bands, all planes, ceil(rows / SPREAD), ceil(cols / SPREAD))  (-D SPREAD=2: zeros are put between, for rows x cols)
// padded   (bands, planes of the piece, height, APART, pitch)             out; (-D APART=2: columns 0, 2, 4, ..., then 1, 3, ...)
__kernel void steerable_pad(__global const int *restrict picture, const int rows, const int cols, const int torus,
                            const int reach, const int bands, const int all, const int first, const int first_row,
                            const int planes, const int height, const int pitch, __global float *restrict padded)
{
    const int across = APART * (pitch / V);
    const int s = get_global_id(0), plane = get_global_id(1);
    if (s >= height * across || plane >= bands * planes)
        return;
    const int own = plane / planes * all + first + plane % planes;
    const int own_rows = (rows + SPREAD - 1) / SPREAD, own_cols = (cols + SPREAD - 1) / SPREAD;
    const int row = s / across, apart = s % across / (pitch / V), col = s % (pitch / V) * V;
    const int i = within(first_row + row - reach, rows, torus), j = APART * col + apart - reach;
    __global const int *from = picture + ((size_t)own * own_rows + i / SPREAD) * own_cols;
    __global float *to = padded + (((size_t)plane * height + row) * APART + apart) * pitch + col;
#if SPREAD == 1 && (APART == 1 || V > 1)
    if (j >= 0 && j + APART * V <= cols) {
#if APART == 1
        STORE(TO_FLOAT(LOAD_INT(from + j)), to);
#else
        STORE(TO_FLOAT((ivec)(LOAD_INT(from + j).even, LOAD_INT(from + j + V).even)), to);
#endif
        return;
    }
#endif
    for (int v = 0; v < V; ++v) {
        const int k = j + APART * v, l = k >= 0 && k < cols ? k : within(k, cols, torus);
        to[v] = i % SPREAD || l % SPREAD ? 0.0f : (float)from[l / SPREAD];
    }
}

#elif defined(BANDS)
// Every band of a piece: the picture correlated with each filter at every APART-th row and column.
//
// padded  (planes of the piece, height, APART, pitch)
// taps    (BANDS, side, side)
// bands   (BANDS, all planes, rows, cols)               out, of which rows first_row .. first_row + count - 1
__kernel void steerable_split(__global const float *restrict padded, const int planes, const int height,
                              const int pitch, __global const float *restrict taps, const int side, const int all,
                              const int rows, const int cols, const int first, const int first_row, const int count,
                              __global int *restrict bands)
{
    const int across = (cols + V - 1) / V;
    const int s = get_global_id(0), plane = get_global_id(1);
    if (s >= (count + ROWS - 1) / ROWS * across || plane >= planes)
        return;
    const int i = s / across * ROWS, j = s % across * V;
    const int line = APART * pitch;
    __global const float *from = padded + ((size_t)plane * height + APART * i) * line + j;
    vec sum[BANDS][ROWS];
    #pragma unroll
    for (int f = 0; f < BANDS; ++f)
        #pragma unroll
        for (int r = 0; r < ROWS; ++r)
            sum[f][r] = (vec)(0.0f);
    for (int a = 0; a < side; ++a)
        for (int b = 0; b < side; ++b) {
            __global const float *x = from + a * line + b % APART * pitch + b / APART;
            #pragma unroll
            for (int r = 0; r < ROWS; ++r) {
                const vec value = LOAD(x + r * APART * line);
                #pragma unroll
                for (int f = 0; f < BANDS; ++f)
                    sum[f][r] = fma((vec)(taps[(f * side + a) * side + b]), value, sum[f][r]);
            }
        }
    #pragma unroll
    for (int f = 0; f < BANDS; ++f)
        for (int r = 0; r < ROWS && i + r < count; ++r)
            store_row(sum[f][r], cols - j,
                      bands + (((size_t)f * all + first + plane) * rows + first_row + i + r) * cols + j);
}

#else
// The bands of a term more in a sum: correlated with their filters, turned by 180 degrees. Where every other row is
// zeros, with the filters' rows that do not meet them: skip is 2, and the item's rows are 2 apart.
//
// padded  (bands, planes of the piece, height, pitch)
// taps    (bands, side, side)                              not turned yet
// total   (planes of the piece, count, whole vectors)      the running sum, where this is not the first term
// picture (all planes, rows, cols)                         out, rounded, where this is the last one
__kernel void steerable_join(__global const float *restrict padded, const int planes, const int height,
                             const int pitch, __global const float *restrict taps, const int bands, const int side,
                             const int skip, const int begin, const int end, __global float *restrict total,
                             const int rows, const int cols, const int first, const int first_row, const int count,
                             __global int *restrict picture)
{
    const int across = (cols + V - 1) / V;
    const int s = get_global_id(0), plane = get_global_id(1);
    const int group = ROWS * skip;
    if (s >= (count + group - 1) / group * skip * across || plane >= planes)
        return;
    const int line = s / across, i = line / skip * group + line % skip, j = s % across * V;
    __global float *running = total + ((size_t)plane * count + i) * across * V + j;
    vec sum[ROWS];
    #pragma unroll
    for (int r = 0; r < ROWS; ++r)
        sum[r] = begin || i + r * skip >= count ? (vec)(0.0f) : LOAD(running + r * skip * across * V);
    const int reach = side / 2;
    for (int f = 0; f < bands; ++f) {
        __global const float *from = padded + (((size_t)f * planes + plane) * height + i) * pitch + j;
        for (int a = skip == 1 ? 0 : (first_row + i + reach) & 1; a < side; a += skip)
            for (int b = 0; b < side; ++b) {
                const vec tap = (vec)(taps[((f + 1) * side - 1 - a) * side + side - 1 - b]);
                #pragma unroll
                for (int r = 0; r < ROWS; ++r)
                    sum[r] = fma(tap, LOAD(from + (a + r * skip) * pitch + b), sum[r]);
            }
    }
    __global int *to = picture + ((size_t)(first + plane) * rows + first_row + i) * cols + j;
    #pragma unroll
    for (int r = 0; r < ROWS && i + r * skip < count; ++r) {
        if (end)
            store_row(sum[r], cols - j, to + r * skip * cols);
        else
            STORE(sum[r], running + r * skip * across * V);
    }
}
#endif

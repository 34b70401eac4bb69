// SPDX-License-Identifier: BSD-3-Clause
// Sums over a window around each site, of the sites with one label alone: along rows, then along columns. Whole numbers.
//
// labels  (rows, cols)
// owner   (planes,)               the label that counts in each plane
// values  (planes, rows, cols)    below 2^13; with COUNT every value is 1
// taps    (2 reach + 1,)          of the window; they add up to 2^9, and beyond the border a picture is mirrored
#include "common/border.h"
#include "common/vector.h"

#ifdef COUNT
#define VALUE(at) 1u
#else
#define VALUE(at) (uint)values[at]
#endif

// The values that count, 0 elsewhere, with `reach` more columns at each side.
// counted (planes, rows, cols + 2 reach) out. One work-item per column of these, and row of a plane.
__kernel void window_counted(__global const uchar *restrict labels, const int rows, const int cols,
                             __global const int *restrict owner, const int planes,
                             __global const ushort *restrict values, const int reach, __global uint *restrict counted)
{
    const int j = get_global_id(0), line = get_global_id(1), wide = cols + 2 * reach;
    if (j >= wide || line >= planes * rows)
        return;
    const int k = within(j - reach, cols, 0);
    counted[line * wide + j] = labels[line % rows * cols + k] == owner[line / rows] ? VALUE(line * cols + k) : 0;
}

// sums (planes, rows, cols) out. One work-item per V columns, and row of a plane.
__kernel void window_rows(__global const uint *restrict counted, const int rows, const int cols, const int planes,
                          __global const uint *restrict taps, const int reach, __global uint *restrict sums)
{
    int j = get_global_id(0) * V;
    const int line = get_global_id(1);
    if (line >= planes * rows)
        return;
    __global const uint *row = counted + line * (cols + 2 * reach);
    if (j + V <= cols) {
        WIDE(uint) sum = 0;
        for (int t = 0; t <= 2 * reach; ++t)
            sum += taps[t] * LOAD(row + j + t);
        STORE(sum, sums + line * cols + j);
        return;
    }
    for (; j < cols; ++j) {
        uint sum = 0;
        for (int t = 0; t <= 2 * reach; ++t)
            sum += taps[t] * row[j + t];
        sums[line * cols + j] = sum;
    }
}

// along (planes, rows, cols) the sums along rows; sums (planes, rows, cols) out. One work-item per V columns, and row of a
// plane.
__kernel void window_cols(__global const uint *restrict along, const int rows, const int cols, const int planes,
                          __global const uint *restrict taps, const int reach, __global uint *restrict sums)
{
    int j = get_global_id(0) * V;
    const int line = get_global_id(1), i = line % rows;
    if (line >= planes * rows)
        return;
    __global const uint *plane = along + (line - i) * cols;
    if (j + V <= cols) {
        WIDE(uint) sum = 0;
        for (int t = -reach; t <= reach; ++t)
            sum += taps[reach + t] * LOAD(plane + within(i + t, rows, 0) * cols + j);
        STORE(sum, sums + line * cols + j);
        return;
    }
    for (; j < cols; ++j) {
        uint sum = 0;
        for (int t = -reach; t <= reach; ++t)
            sum += taps[reach + t] * plane[within(i + t, rows, 0) * cols + j];
        sums[line * cols + j] = sum;
    }
}

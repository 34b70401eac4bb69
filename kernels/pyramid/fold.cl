// SPDX-License-Identifier: BSD-3-Clause
// Every second pixel of a torus, and back. Where the number of rows (or columns) is odd, every second row goes around
// the torus twice and meets each row once: 0, 2, 4, ..., 1, 3, ... Then none is left out, and neighbours in the result
// are two apart in the picture everywhere, across the seam too. Pictures are (planes, rows, cols).

// coarse (planes, coarse_rows, coarse_cols): half as many rows and columns where they are even, else as many.
__kernel void fold(__global const int *restrict fine, const int planes, const int rows, const int cols,
                   __global int *restrict coarse)
{
    const int coarse_rows = rows % 2 ? rows : rows / 2, coarse_cols = cols % 2 ? cols : cols / 2;
    const int s = get_global_id(0), plane = get_global_id(1);
    if (s >= coarse_rows * coarse_cols || plane >= planes)
        return;
    const int i = s / coarse_cols * 2 % rows, j = s % coarse_cols * 2 % cols;
    coarse[(size_t)plane * coarse_rows * coarse_cols + s] = fine[((size_t)plane * rows + i) * cols + j];
}

// The row (or column) of `fold` that row i of n goes to; -1 for one that is left out.
static inline int folded(const int i, const int n)
{
    if (i % 2 == 0)
        return i / 2;
    return n % 2 ? (i + n) / 2 : -1;
}

// fine (planes, rows, cols): what `fold` took apart at its place, 0 elsewhere.
__kernel void fold_back(__global const int *restrict coarse, const int planes, const int rows, const int cols,
                        __global int *restrict fine)
{
    const int coarse_rows = rows % 2 ? rows : rows / 2, coarse_cols = cols % 2 ? cols : cols / 2;
    const int s = get_global_id(0), plane = get_global_id(1);
    if (s >= rows * cols || plane >= planes)
        return;
    const int i = folded(s / cols, rows), j = folded(s % cols, cols);
    const bool there = i >= 0 && j >= 0;
    fine[(size_t)plane * rows * cols + s] = there ? coarse[((size_t)plane * coarse_rows + i) * coarse_cols + j] : 0;
}

// SPDX-License-Identifier: BSD-3-Clause
#include "common/border.h"

// Solid textures, Heeger and Bergen section 4: the Laplacian pyramid of a block in integers, the block turned so
// that its slices lie the other way, and the mean of several blocks. The Gaussian is (1, 4, 6, 4, 1) / 16 in each
// direction. Every level is rounded, so a band and what it was taken from add up exactly.
// Blocks wrap around. An odd number of slices, rows or columns is folded as in fold.cl: every second one goes around twice and
// meets each once, so that no seam is squeezed. Blocks are (depth, rows, cols). A launch is of the slices from `first` on: work-items (pixels of a slice, slices).
// Two directions are summed in 32 bits, the third in 64: right up to |fine| < 2^23 and |coarse| < 2^25.

// Index i, most often one of 0 .. n-1 already: a comparison is cheaper than a division.
static inline int inside(const int i, const int n)
{
    return i >= 0 && i < n ? i : within(i, n, 1);
}

// How many slices, rows or columns the level above n of them has.
static inline int above(const int n)
{
    return n % 2 ? n : n / 2;
}

// G_{i+1} = 2down(G_i * g) in three directions.
__kernel void solid_reduce(__global const int *restrict fine, const int first, const int depth, const int rows,
                           const int cols, __global int *restrict coarse)
{
    const int half_rows = above(rows), half_cols = above(cols);
    const int s = get_global_id(0), slice = first + (int)get_global_id(1);
    if (s >= half_rows * half_cols || slice >= above(depth))
        return;
    const int i = 2 * (s / half_cols), j = 2 * (s % half_cols);
    int row[5], col[5];
    for (int a = 0; a < 5; ++a) {
        row[a] = inside(i + a - 2, rows) * cols;
        col[a] = inside(j + a - 2, cols);
    }
    const int weight[5] = {1, 4, 6, 4, 1};
    long sum = 0;
    for (int c = 0; c < 5; ++c) {
        __global const int *g = fine + (size_t)inside(2 * slice + c - 2, depth) * rows * cols;
        int flat = 0;
        for (int a = 0; a < 5; ++a) {
            __global const int *p = g + row[a];
            flat += weight[a] * (p[col[0]] + p[col[4]] + 4 * (p[col[1]] + p[col[3]]) + 6 * p[col[2]]);
        }
        sum += (long)weight[c] * flat;
    }
    coarse[(size_t)slice * half_rows * half_cols + s] = (int)((sum + (1 << 11)) >> 12);
}

// 2up(G_{i+1}) at the eight children of voxel (slice, i, j) of G_{i+1}, child 4 a + 2 b + c at a slices, b rows and
// c columns on. In each direction the first child takes (1, 6, 1) / 8 around its parent, the second (4, 4) / 8.
static inline void expanded(__global const int *coarse, const int depth, const int rows, const int cols,
                            const int slice, const int i, const int j, int *up)
{
    int row[3], flat[3][4];
    for (int b = 0; b < 3; ++b)
        row[b] = inside(i + b - 1, rows) * cols;
    const int left = inside(j - 1, cols), right = inside(j + 1, cols);
    for (int a = 0; a < 3; ++a) {
        __global const int *g = coarse + (size_t)inside(slice + a - 1, depth) * rows * cols;
        int one[3], two[3];
        for (int b = 0; b < 3; ++b) {
            __global const int *p = g + row[b];
            one[b] = p[left] + 6 * p[j] + p[right];
            two[b] = 4 * (p[j] + p[right]);
        }
        flat[a][0] = one[0] + 6 * one[1] + one[2];
        flat[a][1] = two[0] + 6 * two[1] + two[2];
        flat[a][2] = 4 * (one[1] + one[2]);
        flat[a][3] = 4 * (two[1] + two[2]);
    }
    for (int c = 0; c < 4; ++c) {
        up[c] = (int)(((long)flat[0][c] + 6 * (long)flat[1][c] + flat[2][c] + (1 << 8)) >> 9);
        up[4 + c] = (int)((4 * ((long)flat[1][c] + flat[2][c]) + (1 << 8)) >> 9);
    }
}

// out = in + sign * 2up(coarse), G_i of L_i and G_{i+1} or L_i of G_i: one work-item per voxel of `coarse`, so that its
// eight children share the sums. All sides of `in` and `out` are even.
__kernel void solid_expanded(__global const int *restrict in, __global const int *restrict coarse, const int first,
                             const int depth, const int rows, const int cols, const int sign,
                             __global int *restrict out)
{
    const int s = get_global_id(0), slice = first + (int)get_global_id(1);
    if (s >= rows * cols / 4 || slice >= depth / 2)
        return;
    const int i = s / (cols / 2), j = s % (cols / 2);
    int up[8];
    expanded(coarse, depth / 2, rows / 2, cols / 2, slice, i, j, up);
    for (int c = 0; c < 8; ++c) {
        const int z = 2 * slice + (c >> 2), y = 2 * i + (c >> 1 & 1), x = 2 * j + (c & 1);
        const size_t voxel = ((size_t)z * rows + y) * cols + x;
        out[voxel] = in[voxel] + sign * up[c];
    }
}

// The voxels of the level above, and their weights in 2^-`bits`, that slice, row or column i of n takes on a torus.
static inline int taken(const int i, const int n, int *from, int *weight, int *bits)
{
    const int gauss[5] = {1, 4, 6, 4, 1}, child[2][3] = {{1, 6, 1}, {0, 4, 4}};
    const int odd = n % 2, count = odd ? 5 : 3, halved = max(1, n / 2); // some divide in a branch not taken
    for (int a = 0; a < count; ++a) {
        const int k = within(i + a - 2, n, 1);
        from[a] = odd ? (k % 2 ? (k + n) / 2 : k / 2) : within(i / 2 + a - 1, halved, 1);
        weight[a] = odd ? gauss[a] : child[i % 2][a];
    }
    *bits += odd ? 4 : 3;
    return count;
}

// out = in + sign * 2up(coarse) where some side is odd: one work-item per voxel of `in` and `out`.
__kernel void solid_folded(__global const int *restrict in, __global const int *restrict coarse, const int first,
                           const int depth, const int rows, const int cols, const int sign, __global int *restrict out)
{
    const int s = get_global_id(0), slice = first + (int)get_global_id(1);
    if (s >= rows * cols || slice >= depth)
        return;
    int z[5], y[5], x[5], u[5], v[5], w[5], bits = 0;
    const int zs = taken(slice, depth, z, u, &bits), ys = taken(s / cols, rows, y, v, &bits);
    const int xs = taken(s % cols, cols, x, w, &bits);
    const int up_rows = above(rows), up_cols = above(cols);
    long sum = 0;
    for (int a = 0; a < zs; ++a)
        for (int b = 0; b < ys; ++b) {
            __global const int *p = coarse + ((size_t)z[a] * up_rows + y[b]) * up_cols;
            for (int c = 0; c < xs; ++c)
                sum += (long)(u[a] * v[b] * w[c]) * p[x[c]];
        }
    const size_t voxel = (size_t)slice * rows * cols + s;
    out[voxel] = in[voxel] + sign * (int)((sum + (1 << (bits - 1))) >> bits);
}

// The block with its axes in another order: voxel (slice, i, j) of `turned`, which has rows x cols pixels in each of
// `depth` slices, is the block's voxel `far` slices, `down` rows and `along` columns of these steps on.
__kernel void solid_turn(__global const int *restrict block, const int first, const int depth, const int rows,
                         const int cols, const int far, const int down, const int along, __global int *restrict turned)
{
    const int s = get_global_id(0), slice = first + (int)get_global_id(1);
    if (s >= rows * cols || slice >= depth)
        return;
    const int i = s / cols, j = s % cols;
    turned[(size_t)slice * rows * cols + s] = block[(size_t)slice * far + (size_t)i * down + (size_t)j * along];
}

#ifndef COUNT
#define COUNT 4
#endif

// The mean of the first COUNT (-D) of four arrays of n numbers, half rounded up, below zero too: one work-item per
// number. Arrays past COUNT are not read.
__kernel void solid_mean(__global const int *restrict a, __global const int *restrict b, __global const int *restrict c,
                         __global const int *restrict d, const int n, __global int *restrict mean)
{
    const int s = get_global_id(0);
    if (s >= n)
        return;
    const long sum = (long)a[s] + (COUNT > 1 ? b[s] : 0) + (COUNT > 2 ? c[s] : 0) + (COUNT > 3 ? d[s] : 0);
    const long twice = 2 * sum + COUNT;
    const long quotient = twice / (2 * COUNT);
    mean[s] = (int)(quotient - (twice < quotient * (2 * COUNT)));
}

// SPDX-License-Identifier: BSD-3-Clause
#include "common/border.h"

// The Laplacian pyramid of Burt and Adelson in integers, De Bonet's equations (5) and (6). The Gaussian is
// (1, 4, 6, 4, 1) / 16 in each direction. Every level is rounded, so a band and what it was taken from add up exactly.
// Pictures are (planes, rows, cols); one work-item per pixel and plane.

// G_{i+1} = 2down(G_i * g), equation (6): `fine` is G_i, rows x cols; `coarse` has half as many of each, rounded up.
__kernel void laplacian_reduce(__global const int *restrict fine, const int planes, const int rows, const int cols,
                               const int torus, __global int *restrict coarse)
{
    const int half_rows = (rows + 1) / 2, half_cols = (cols + 1) / 2;
    const int s = get_global_id(0), plane = get_global_id(1);
    if (s >= half_rows * half_cols || plane >= planes)
        return;
    const int weight[5] = {1, 4, 6, 4, 1};
    const int i = 2 * (s / half_cols), j = 2 * (s % half_cols);
    __global const int *g = fine + plane * rows * cols;
    int sum = 0;
    for (int a = -2; a <= 2; ++a)
        for (int b = -2; b <= 2; ++b)
            sum += weight[a + 2] * weight[b + 2] * g[within(i + a, rows, torus) * cols + within(j + b, cols, torus)];
    coarse[plane * half_rows * half_cols + s] = (sum + 128) >> 8;
}

// `within` for -1 .. n.
static inline int beside(const int i, const int n, const int torus)
{
    if (torus)
        return i < 0 ? n - 1 : i == n ? 0 : i;
    return i < 0 ? min(1, n - 1) : i == n ? max(0, n - 2) : i;
}

// 2up(G_{i+1}) at pixel (i, j) of level i. In each direction the first child of a pixel takes (1, 6, 1) / 8 around it,
// the second (4, 4) / 8. Level i is made of tiles of tile_rows x tile_cols pixels, `coarse` of tiles of half as many.
static inline int expanded(__global const int *coarse, const int rows, const int cols, const int tile_rows,
                           const int tile_cols, const int torus, const int i, const int j)
{
    const int weight[2][3] = {{1, 6, 1}, {0, 4, 4}};
    const int p = i % tile_rows, q = j % tile_cols;
    const int k = i / tile_rows * ((tile_rows + 1) / 2) + p / 2, l = j / tile_cols * ((tile_cols + 1) / 2) + q / 2;
    const int left = beside(l - 1, cols, torus), right = beside(l + 1, cols, torus);
    const int u = 6 - 2 * (q & 1), v = 1 - (q & 1), w = 1 + 3 * (q & 1);
    int sum = 0;
    for (int a = 0; a < 3; ++a) {
        __global const int *g = coarse + beside(k + a - 1, rows, torus) * cols;
        sum += weight[p & 1][a] * (v * g[left] + u * g[l] + w * g[right]);
    }
    return (sum + 32) >> 6;
}

// L_i = G_i - 2up(G_{i+1}), equation (5), of the sample, which is one tile.
__kernel void laplacian_band(__global const int *restrict fine, __global const int *restrict coarse, const int planes,
                             const int rows, const int cols, const int torus, __global int *restrict band)
{
    const int half_rows = (rows + 1) / 2, half_cols = (cols + 1) / 2;
    const int s = get_global_id(0), plane = get_global_id(1);
    if (s >= rows * cols || plane >= planes)
        return;
    __global const int *g = coarse + plane * half_rows * half_cols;
    const int pixel = plane * rows * cols + s;
    band[pixel] = fine[pixel] - expanded(g, half_rows, half_cols, rows, cols, torus, s / cols, s % cols);
}

// Pixel (i, j) of L_i of the output where pieces of the sample that meet fade into each other: (1, 2, 1) / 4 in each
// direction of what the neighbours, and the pixel itself, were copied from would go on with here.
static inline int joined(__global const int *band, const int tile_rows, const int tile_cols, const int torus,
                         __global const int *source, const int rows, const int cols, const int i, const int j)
{
    int sum = 0;
    for (int a = -1; a <= 1; ++a)
        for (int b = -1; b <= 1; ++b) {
            const int k = torus ? beside(i + a, rows, 1) : clamp(i + a, 0, rows - 1);
            const int l = torus ? beside(j + b, cols, 1) : clamp(j + b, 0, cols - 1);
            const int s = source[k * cols + l];
            const int row = s / tile_cols - (torus ? a : k - i), col = s % tile_cols - (torus ? b : l - j);
            sum += (2 - abs(a)) * (2 - abs(b)) *
                   band[beside(row, tile_rows, torus) * tile_cols + beside(col, tile_cols, torus)];
        }
    return (sum + 8) >> 4;
}

// G_i = L_i + 2up(G_{i+1}) of the output, rows x cols, where pixel s of L_i is pixel source[s] of the sample's band,
// tile_rows x tile_cols; with `blend` pieces fade into each other. The output's level i + 1 is coarse_rows x coarse_cols.
__kernel void laplacian_collapse(__global const int *restrict band, const int planes, const int tile_rows,
                                 const int tile_cols, const int torus, __global const int *restrict source,
                                 const int rows, const int cols, __global const int *restrict coarse,
                                 const int coarse_rows, const int coarse_cols, const int blend, __global int *restrict fine)
{
    const int s = get_global_id(0), plane = get_global_id(1);
    if (s >= rows * cols || plane >= planes)
        return;
    const int i = s / cols, j = s % cols;
    __global const int *g = coarse + plane * coarse_rows * coarse_cols;
    __global const int *l = band + plane * tile_rows * tile_cols;
    const int own = blend ? joined(l, tile_rows, tile_cols, torus, source, rows, cols, i, j) : l[source[s]];
    fine[plane * rows * cols + s] = own + expanded(g, coarse_rows, coarse_cols, tile_rows, tile_cols, torus, i, j);
}

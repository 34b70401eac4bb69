// SPDX-License-Identifier: BSD-3-Clause
// Communication between PEs, and from the PEs to the ACU. A variable has `size` words of each PE and layer. A PE that is
// active gets the words; one outside the mask changes nothing.
#include "maspar/layout.h"

// The X-Net: each PE gets the words `distance` pixels away in one of 8 directions, around the edges of the array. At the
// edge of a layer they come from another layer, and within a block from the PE itself.
__kernel void maspar_xnet(const Layout g, __global const uchar *restrict mask, __global int *restrict to,
                          __global const int *restrict from, const int size, const int down, const int right,
                          const int distance)
{
    const int pe = get_global_id(0), high = g.rows * g.high, wide = g.cols * g.wide;
    if (pe >= PES(g))
        return;
    for (int layer = 0; layer < LAYERS(g); ++layer) {
        const int k = layer * PES(g) + pe;
        if (!mask[k])
            continue;
        const int2 there = pixel_of(g, layer, pe) + (int2)(down, right) * distance + (int2)(high, wide);
        const int r = address_of(g, there % (int2)(high, wide));
        for (int w = 0; w < size; ++w)
            to[k * size + w] = from[r * size + w];
    }
}

// The router: each PE gets the words of pixel (row, col), wherever that is.
__kernel void maspar_xnet_router(const Layout g, __global const uchar *restrict mask, __global int *restrict to,
                                 __global const int *restrict from, const int size, __global const int *restrict row,
                                 __global const int *restrict col)
{
    const int pe = get_global_id(0);
    if (pe >= PES(g))
        return;
    for (int k = pe; k < LAYERS(g) * PES(g); k += PES(g)) {
        if (!mask[k])
            continue;
        const int r = address_of(g, (int2)(row[k], col[k]));
        for (int w = 0; w < size; ++w)
            to[k * size + w] = from[r * size + w];
    }
}

// A reduction: the sum (0) or the minimum (1) of a word over the layers of each PE; the ACU combines those of all PEs.
__kernel void maspar_xnet_reduce(const Layout g, __global const uchar *restrict mask, __global const int *restrict a,
                                 const int size, const int word, const int operation, __global long *restrict part)
{
    const int pe = get_global_id(0);
    if (pe >= PES(g))
        return;
    long found = operation ? INT_MAX : 0;
    for (int k = pe; k < LAYERS(g) * PES(g); k += PES(g)) {
        const int x = a[k * size + word];
        if (mask[k])
            found = operation ? min(found, (long)x) : found + x;
    }
    part[pe] = found;
}

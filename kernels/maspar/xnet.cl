// SPDX-License-Identifier: BSD-3-Clause
// Communication between PEs, of all words of a variable, and from the PEs to the ACU.
#include "maspar/layout.h"

// The X-Net: each PE gets the words `distance` pixels away in one of 8 directions, around the edges of the array. At
// the edge of a layer they come from another layer, and within a block from the PE itself.
__kernel void maspar_xnet(ARRAY, PLURAL(T, to), PLURAL(const T, from), const int down, const int right,
                          const int distance)
{
    const int2 sides = (int2)(g.rows * g.high, g.cols * g.wide);
    WHERE_ACTIVE(pe, k) {
        const int2 there = pixel_of(g, k / PES(g), pe) + (int2)(down, right) * distance + sides;
        const int r = address_of(g, there % sides);
        for (int w = 0; w < to_size; ++w)
            to[k * to_size + w] = from[r * to_size + w];
    }
}

// The router: each PE gets the words of pixel (row, col), wherever that is.
__kernel void maspar_xnet_router(ARRAY, PLURAL(T, to), PLURAL(const T, from), PLURAL(const int, row),
                                 PLURAL(const int, col))
{
    WHERE_ACTIVE(pe, k) {
        const int r = address_of(g, (int2)(OF(row, k), OF(col, k)));
        for (int w = 0; w < to_size; ++w)
            to[k * to_size + w] = from[r * to_size + w];
    }
}

// A reduction: the sum or the minimum of a word over the layers of each PE; the ACU combines those of all PEs.
__kernel void maspar_xnet_reduce(ARRAY, PLURAL(long, part), PLURAL(const int, a), const int least)
{
    long found = least ? INT_MAX : 0;
    WHERE_ACTIVE(pe, k)
        found = least ? min(found, (long)OF(a, k)) : found + OF(a, k);
    if (get_global_id(0) < PES(g))
        part[get_global_id(0)] = found;
}

// SPDX-License-Identifier: BSD-3-Clause
// A colouring of the level's lattice in which no site has a neighbour of its own colour, so that each colour is a
// set of sites that may be relaxed together, equation (14).
#include "common/lattice.h"
#include "common/philox.h"

#define UNCOLORED (-1)

// The colour of a site is its coset of the sublattice spanned by (a, 0) and (b, c) (row, column): a * c colours. Two
// sites of one coset differ by a sublattice vector, none of which is as short as a neighbour's offset. Where a torus
// cuts through the pattern, the later of two clashing sites stays uncoloured.
//
// offsets (N, 2); color (rows, cols) out. One work-item per site.
__kernel void coloring_lattice(const Lattice g, __global const int2 *restrict offsets, const int N, const int a, const int b,
                               const int c, __global int *restrict color)
{
    const int site = get_global_id(0);
    if (site >= g.rows * g.cols)
        return;
    const int i = site / g.cols, j = site % g.cols;
#define COSET(i, j) (wrap((i) - (j) / c * b, a) * c + (j) % c)
    const int own = COSET(i, j);
    bool clash = false;
    for (int k = 0; k < N; ++k) {
        const int row = i + offsets[k].x, col = j + offsets[k].y;
        if (row >= 0 && row < g.rows && col >= 0 && col < g.cols) // no seam in between, so another coset
            continue;
        const int r = neighbour(g, i, j, offsets[k].x, offsets[k].y);
        clash = clash || (r >= 0 && r < site && COSET(r / g.cols, r % g.cols) == own);
    }
    color[site] = clash ? UNCOLORED : own;
}

// One round of parallel greedy colouring (Jones and Plassmann): an uncoloured site whose priority is above
// those of all its uncoloured neighbours takes the lowest colour that no neighbour has.
//
// bare (S,) sites that had no colour at first; color (rows, cols) in; next (rows, cols) out, where it differs at these sites
// alone. One work-item per site of the list.
__kernel void coloring_greedy(const Lattice g, __global const int *restrict bare, const int S,
                              __global const int2 *restrict offsets, const int N, const ulong seed,
                              __global const int *restrict color, __global int *restrict next)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    const int site = bare[s];
    next[site] = color[site];
    if (color[site] != UNCOLORED)
        return;
    const int i = site / g.cols, j = site % g.cols;
    const uint own = draw4(seed, 0, 0, site, PURPOSE_COLOR, 0).x;
    for (int k = 0; k < N; ++k) {
        const int r = neighbour(g, i, j, offsets[k].x, offsets[k].y);
        if (r < 0 || color[r] != UNCOLORED)
            continue;
        const uint other = draw4(seed, 0, 0, r, PURPOSE_COLOR, 0).x;
        if (other > own || (other == own && r > site))
            return;
    }
    for (int base = 0;; base += 32) { // 32 colours at a time
        uint taken = 0;
        for (int k = 0; k < N; ++k) {
            const int r = neighbour(g, i, j, offsets[k].x, offsets[k].y);
            const int other = r < 0 ? UNCOLORED : color[r];
            if (other >= base && other < base + 32)
                taken |= 1u << (other - base);
        }
        if (taken != 0xFFFFFFFFu) {
            next[site] = base + 31 - (int)clz(~taken & (taken + 1)); // the lowest bit that is not set
            return;
        }
    }
}

// SPDX-License-Identifier: BSD-3-Clause
// A random maximal set of sites none of which is a neighbour of another, equation (14), after Luby (1986): every
// active site draws a priority; in each round an undecided site above all its undecided neighbours joins
// the set, and the neighbours of a member are out.
#include "common/lattice.h"
#include "common/philox.h"

#define UNDECIDED 0
#define IN 1
#define OUT 2

// Before the first round. active (rows, cols); priority, state (rows, cols)  out; `begin`: lattice.h. One item per site.
__kernel void luby_priority(const int sites, const ulong seed, const uint level, const uint count, const ulong begin,
                            __global const uchar *restrict active, __global uint *restrict priority,
                            __global uchar *restrict state)
{
    const int site = get_global_id(0);
    if (site >= sites)
        return;
    priority[site] = draw4(seed, level, count, begin + site, PURPOSE_SCHEDULE, 0).x;
    state[site] = active[site] ? UNDECIDED : OUT;
}

// One round; equal priorities are decided by the higher index. state (rows, cols) in; next (rows, cols) out.
// One work-item per site.
__kernel void luby_round(const Lattice g, __global const int *restrict offsets, const int N,
                         __global const uint *restrict priority, __global const uchar *restrict state,
                         __global uchar *restrict next)
{
    const int site = get_global_id(0);
    if (site >= g.layers * g.rows * g.cols)
        return;
    next[site] = state[site];
    if (state[site] != UNDECIDED)
        return;
    const int i = site / g.cols, j = site % g.cols;
    const uint own = priority[site];
    bool highest = true;
    for (int k = 0; k < N; ++k) {
        const int r = neighbour(g, i, j, offsets + AXES * k);
        if (r < 0 || state[r] == OUT)
            continue;
        if (state[r] == IN) {
            next[site] = OUT;
            return;
        }
        highest = highest && (priority[r] < own || (priority[r] == own && r < site));
    }
    if (highest)
        next[site] = IN;
}

// SPDX-License-Identifier: BSD-3-Clause
// Which sites are active: those whose temperature is above 0. What a schedule and the loop of step 6.2 have to know of the
// temperatures, counted on the device, so that the plane stays there.
#include "common/lattice.h"

// How many sites of each stretch of the lattice, CHUNK sites row by row, are active, and the sum of their temperatures.
//
// temperature (H, W)       in 1/1024
// found       (2, stretches)  out: the one and the other
// One work-item per stretch.
__kernel void active_survey(const Lattice g, __global const ushort *restrict temperature, const int chunk,
                            const int stretches, __global int *restrict found)
{
    const int n = get_global_id(0);
    if (n >= stretches)
        return;
    const int end = min(g.layers * g.rows * g.cols, (n + 1) * chunk);
    int count = 0, sum = 0;
    for (int at = n * chunk; at < end; ++at) {
        const int t = temperature[at];
        count += t > 0 ? 1 : 0;
        sum += t;
    }
    found[n] = count;
    found[stretches + n] = sum;
}

// How many sites of each stretch of a list are active.
//
// sites  (S,)                 their numbers
// starts (stretches + 1,)     where each stretch begins in them
// counts (stretches,)         out
// One work-item per stretch.
__kernel void active_count(__global const int *restrict sites, __global const int *restrict starts, const int stretches,
                           __global const ushort *restrict temperature, __global int *restrict counts)
{
    const int n = get_global_id(0);
    if (n >= stretches)
        return;
    int count = 0;
    for (int at = starts[n]; at < starts[n + 1]; ++at)
        count += temperature[sites[at]] > 0 ? 1 : 0;
    counts[n] = count;
}

// The active sites of each stretch, in their order, from a place on.
//
// firsts (stretches,)  where the stretch's active sites go
// kept   (.., )        out
// One work-item per stretch.
__kernel void active_keep(__global const int *restrict sites, __global const int *restrict starts, const int stretches,
                          __global const ushort *restrict temperature, __global const int *restrict firsts,
                          __global int *restrict kept)
{
    const int n = get_global_id(0);
    if (n >= stretches)
        return;
    int to = firsts[n];
    for (int at = starts[n]; at < starts[n + 1]; ++at)
        if (temperature[sites[at]] > 0)
            kept[to++] = sites[at];
}

// SPDX-License-Identifier: BSD-3-Clause
#include "mrf/cool.h"
#include "common/lattice.h"

// Equation (13), by itself: what sites cool to.
// N_s holds the neighbours on the lattice: a neighbour outside an open lattice is no member.
//
// sites (S,), temperature (H, W) in 1/1024, offsets (N, AXES), xi in 1/1024 (negative)
// cooled (S,)  out
// One work-item per site.
__kernel void temperature(__global const int *restrict sites, const int S,
                          __global const ushort *restrict temperature, __global const int *restrict offsets,
                          const int N, const Lattice g, const int xi, __global ushort *restrict cooled)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    const int i = sites[s] / g.cols, j = sites[s] % g.cols;
    int sum = xi, members = 0;
    for (int k = 0; k < N; ++k) {
        const int r = neighbour(g, i, j, offsets + AXES * k);
        if (r < 0)
            continue;
        sum += temperature[r];
        ++members;
    }
    cooled[s] = cooled_to(sum, members);
}

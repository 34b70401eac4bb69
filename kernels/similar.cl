// SPDX-License-Identifier: BSD-3-Clause
// For each candidate of a level, the K others whose neighbourhoods in the sample are most like its own; nearest first,
// the lowest number where several are as near. Sites within `apart` rows and columns of one another are too much the same.
#pragma OPENCL FP_CONTRACT OFF
#include "common/lattice.h"
#include "common/vector.h"
#include "common/propose.h"
#include "common/square.h"

#ifndef K
#define K 4
#endif
#define PROPOSED (9 * K) // most candidates that one is compared with

// Put candidate i at distance e into the nearest of `best`, in order, if it belongs there.
inline int kept(const int i, const float e, __private int *best, __private float *d, const int m)
{
    if (m == K && !(e < d[K - 1] || (e == d[K - 1] && i < best[K - 1])))
        return m;
    int k = m < K ? m : K - 1;
    for (; k > 0 && (d[k - 1] > e || (d[k - 1] == e && best[k - 1] > i)); --k) {
        best[k] = best[k - 1];
        d[k] = d[k - 1];
    }
    best[k] = i;
    d[k] = e;
    return min(m + 1, K);
}

// Who is like p is looked for where those are that are like p's kin: the candidate `kin` of p, and of those one row and one
// column from p, in another table of the kind, moved by as much as p from them. A candidate of a coarser level is kin of
// those around it.
//
// positions (count,)     pixel index of each candidate; index_of (pixels,) its inverse, -1 elsewhere
// at        (count,)     place of each in `levels`
// levels    (C, plane)   grey levels of the sample, columns apart by the level's step side by side
// disc      (CELLS, 16)  1 on the neighbourhood
// kin       (count,)     row of each in `moves`, -1 where it has none
// moves     (.., K)      how many pixels those that are like it lie from it
// everyone               whether all candidates are looked at instead
// found     (count, K)   out; p itself where there are too few
// One work-item per candidate.
__kernel void similar(const int count, const int pixels, const int pitch, const int step, const int apart,
                      const int everyone, __global const int *restrict positions, __global const int *restrict index_of,
                      __global const int *restrict at, __global const ushort *restrict levels, const int plane,
                      const int down, __global const float *restrict disc, __global const int *restrict kin,
                      __global const int *restrict moves, __global int *restrict found)
{
    const int p = get_global_id(0);
    if (p >= count)
        return;
    SQUARE;
    __global const ushort *y = levels + at[p] - RADIUS * down - RADIUS;
    for (int cell = 0; cell < CELLS; ++cell)
        for (int n = 0; n < 16; ++n) {
            U(cell, 0, n) = disc[cell * 16 + n];
            for (int c = 0; c < C; ++c)
                XU(cell, c, n) = (float)y[c * plane + cell / CHUNKS * down + cell % CHUNKS * 16 + n] * disc[cell * 16 + n];
        }
    int best[K], held = 0;
    float d[K];
    const int here = positions[p], row = here / pitch, col = here % pitch;
#define NEAR(q) (abs((q) / pitch - row) <= apart * step && abs((q) % pitch - col) <= apart * step)
#define DISTANCE(i) distance_in_lanes(at[i], u, xu, levels, plane, down)
    for (int i = 0; everyone && i < count; ++i)
        if (!NEAR(positions[i]))
            held = kept(i, DISTANCE(i), best, d, held);
    int list[PROPOSED], m = 0;
    ulong seen = 0;
    for (int n = 0; !everyone && n < 9; ++n) {
        const int from = here + (n / 3 - 1) * step * pitch + (n % 3 - 1) * step;
        const int kind = from < 0 || from >= pixels || index_of[from] < 0 ? -1 : kin[index_of[from]];
        for (int k = 0; kind >= 0 && k < K; ++k) {
            const int q = here + moves[kind * K + k];
            if (q >= 0 && q < pixels && !NEAR(q))
                m = proposed(index_of[q], list, m, &seen);
        }
    }
    for (int k = 0; k < m; ++k)
        held = kept(list[k], DISTANCE(list[k]), best, d, held);
    for (int k = 0; k < K; ++k)
        found[p * K + k] = k < held ? best[k] : p;
}

// SPDX-License-Identifier: BSD-3-Clause

// Heat-bath relaxation of Ising spins: a site turns up with the probability 1 / (1 + exp(-2 S / T)), where S is the sum
// of its neighbours' spins -1 and +1. The host has rounded the probability to integers of 2^-32, so that a draw is one
// comparison of integers.
//
// Chains are independent copies of the lattice: `seeds` of them at each temperature, temperature after temperature.
// spins (chains, H, W) 0 or 1, or (chains, 2 H, W) with an older picture below; `stride` pixels from chain to chain
// chances (temperatures, N + 1, N + 1): for a site with so many neighbours on the lattice, of which so many are up
#include "common/lattice.h"
#include "common/philox.h"

// What a site becomes.
static inline uchar heat_bath(__global const uchar *spins, const int site, __global const int *offsets, const int N,
                       const Lattice g, __global const uint *chances, const ulong seed, const uint turn, const uint chain)
{
    const int i = site / g.cols, j = site % g.cols;
    int members = 0, up = 0;
    for (int k = 0; k < N; ++k) {
        const int r = neighbour(g, i, j, offsets + AXES * k);
        if (r < 0)
            continue;
        ++members;
        up += spins[r];
    }
    return draw4(seed, 0, turn, place_of(g, i, j), PURPOSE_DRAW, chain).x < chances[members * (N + 1) + up];
}

// One step: what its sites become, old values read.
// sites (S,); relaxed (chains, S)  out. One work-item per (site, seed, temperature).
__kernel void ising_relax(__global const int *restrict sites, const int S, __global const uchar *restrict spins,
                          const int stride, const int seeds, __global const int *restrict offsets, const int N, const Lattice g,
                          __global const uint *restrict chances, const ulong seed, const uint turn,
                          __global uchar *restrict relaxed)
{
    const int s = get_global_id(0), c = get_global_id(1), t = get_global_id(2);
    if (s >= S)
        return;
    const int chain = t * seeds + c;
    relaxed[chain * S + s] = heat_bath(spins + chain * stride, sites[s], offsets, N, g,
                                       chances + t * (N + 1) * (N + 1), seed, turn, c);
}

// The end of a step: what its sites have become goes into the spins, all at once.
// One work-item per (site, seed, temperature).
__kernel void ising_commit(__global const int *restrict sites, const int S, __global const uchar *restrict relaxed,
                           const int stride, const int seeds, __global uchar *restrict spins)
{
    const int s = get_global_id(0), c = get_global_id(1), t = get_global_id(2);
    if (s >= S)
        return;
    const int chain = t * seeds + c;
    spins[chain * stride + sites[s]] = relaxed[chain * S + s];
}

// A run of steps of one site each, one after another; each sees what the one before it has made.
// queue (Q, 2) the site and the turn of every step. One work-item per (seed, temperature).
__kernel void ising_sequence(__global const int2 *restrict queue, const int Q, __global uchar *spins, const int stride,
                             const int seeds, __global const int *restrict offsets, const int N, const Lattice g,
                             __global const uint *restrict chances, const ulong seed)
{
    const int c = get_global_id(0), t = get_global_id(1);
    if (c >= seeds)
        return;
    __global uchar *mine = spins + (t * seeds + c) * stride;
    for (int q = 0; q < Q; ++q)
        mine[queue[q].x] = heat_bath(mine, queue[q].x, offsets, N, g, chances + t * (N + 1) * (N + 1), seed,
                                     queue[q].y, c);
}

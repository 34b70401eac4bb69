// SPDX-License-Identifier: BSD-3-Clause
// The coherent search of relax.h, in which a site evaluates, in this order and each of them once,
//
//   1. p_r + (s - r), where the sample continues the source p_r of neighbour r, r one of the SUGGESTING nearest
//      neighbours that a relaxation has touched (t < 1);
//   2. the present source of s;
//   3. `chance` positions at random, and one where there would be none at all; -D PHASES=1: of the site's phase, and if it
//      has no more than `chance`, all of them.
#pragma OPENCL FP_CONTRACT OFF
#include "mrf/relax.h"

#define SUGGESTING 12 // nearest neighbours that suggest a candidate each

// Random candidate k of `draws`, from a word: one of `count`, of the phase whose candidates begin at `from`, or of all.
static inline int at_random(const int k, const int draws, const uint word, const int from, const int count,
                            __global const int *of_phase)
{
    const int n = PHASES && count <= draws ? k : (int)((ulong)word * (uint)count >> 32);
    if (!PHASES)
        return n;
    return n < count ? of_phase[from + n] : -1;
}

// work (area,)  in and out: candidates that each site has evaluated
// begin_of, of_phase, phase_at   candidates of each phase: simdtex.methods.mrf.relax.InPhase
__kernel GROUP void relax_coherent(FIELD, __global const uint *restrict noise, const uint turn,
                                   __global int *restrict work, __global const int *restrict begin_of,
                                   __global const int *restrict of_phase, __global const int *restrict phase_at, RESULTS)
{
    // An idle work-item relaxes the last site, and writes nothing: if it returned here, Intel's runtime would read at wild
    // indices for it.
    const bool idle = ITEMS == 1 && first + (int)INDEX >= S;
    const int s = idle ? S - 1 : first + (int)INDEX;
    const Lattice h = g.lattice;
    const int site = sites[s], i = site / h.cols, j = site - i * h.cols;
    const ulong place = place_of(h, i, j);
    SHARED int kept;
    if (ITEM == 0)
        kept = 0;

    // 6.2.2.1: the neighbourhood.
    int row[ROWS], col[SIDE];
    SHARED ALIGNED float u[CELLS * CONFIDENCES * 16], xu[CELLS * C * 16];
    SHARED int warmth[2];
    square_around(h, i, j, row, col);
    const int2 heat = gather(g, site, i, j, row, col, values, source, temperature, offsets, disc, u, xu, warmth);
    if (HOT)
        by_category(xu);

    // What neighbours suggest, the present source, and random candidates.
    SHARED int raw[SLOTS], list[SLOTS], next[REPEATABLE], same[REPEATABLE];
    const int suggested = min(SUGGESTING, g.neighbours), draws = max(1, g.chance);
    EACH(k, NOVEL ? g.neighbours : suggested) {
        const int r = neighbour_in_square(h, site, i, j, row, col, offsets + AXES * k);
        const int from = source_of(r, source, temperature), p = continuing(index_of, from, reach[k], g.pixels);
        if (k < suggested)
            raw[k] = p;
        if (NOVEL) {
            next[k] = p;
            same[k] = number_of(index_of, from);
        }
    }
    if (ITEM == 0)
        raw[suggested] = idle ? -1 : number_of(index_of, source[site]); // which the item of the last site may be writing
    const int phase = PHASES ? phase_at[site] : 0, from = PHASES ? begin_of[phase] : 0;
    const int count = PHASES ? begin_of[phase + 1] - from : g.candidates;
    EACH(n, (draws + 3) / 4) {
        const uint4 bits = draw4(g.seed, g.level, turn, place, PURPOSE_SEARCH, n);
        const uint word[4] = {bits.x, bits.y, bits.z, bits.w};
        for (int k = 4 * n; k < min(4 * n + 4, draws); ++k)
            raw[suggested + 1 + k] = at_random(k, draws, word[k % 4], from, count, of_phase);
    }
    TOGETHER;
    int coherent;
    const int m = each_once(raw, suggested + 1 + draws, suggested, g.chance, list, &kept, &coherent);

    SHARED float lanes[ABREAST][17], bests[ABREAST];
    SHARED int bests_at[ABREAST];
    float best = INFINITY;
    int best_at = 0x7fffffff;
    evaluate(list, m, coherent, u, xu, next, same, lanes, bests, bests_at, &best, &best_at, DRAWN, COSTED);
    if (ITEM > 0 || idle)
        return;
    settle(s, S, best_at, heat, at, levels, positions, DRAWN, new_values, new_source, new_temperature);
    work[site] += kept;
}

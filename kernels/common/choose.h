// SPDX-License-Identifier: BSD-3-Clause
// Step 6.2.2.2: what a site takes of the candidates that it has weighed. ICM takes the nearest one, of several the first
// in the sample; the Gibbs sampler draws one with the probability that the LCPDF of equation (7) gives it.
#ifndef SIMDTEX_CHOOSE_H
#define SIMDTEX_CHOOSE_H
#include "common/level.h"
#include "common/parzen.h"
#include "common/philox.h"
#include "common/vector.h"

// The place in the list of the candidate that is taken. NUMBER(k) is the number of the k-th of m candidates, PIXEL(k) the
// place of its grey levels in `sample`. Distances are looked at V together, and one by one only where one of them matters;
// `d` has room for V more.
#define CHOOSE(best, g, d, m, sample, stride, noise, turn, place)                                                      \
    int best = -1;                                                                                                     \
    {                                                                                                                  \
        STORE((vec)INFINITY, d + m);                                                                                   \
        vec nearest = LOAD(d);                                                                                         \
        for (int p = V; p < m; p += V)                                                                                 \
            nearest = fmin(nearest, LOAD(d + p));                                                                      \
        const float smallest = least_of(nearest);                                                                      \
        for (int p = 0; p < m; p += V)                                                                                 \
            if (ANY(LOAD(d + p) == smallest))                                                                          \
                for (int k = p; k < min(p + V, m); ++k)                                                                \
                    best = d[k] == smallest && (best < 0 || NUMBER(k) < NUMBER(best)) ? k : best;                      \
        if (g.draws) {                                                                                                 \
            ulong total = 0, reached = 0;                                                                              \
            for (int p = 0; p < m; p += V)                                                                             \
                if (ANY(WEIGHS(LOAD(d + p), smallest, g.scale)))                                                       \
                    for (int k = p; k < min(p + V, m); ++k)                                                            \
                        total += mass_of(d[k], smallest, g.scale, sample, stride, PIXEL(k), noise, g.radius, g.top);   \
            const uint4 bits = draw4(g.seed, g.level, turn, place, PURPOSE_DRAW, 0);                                   \
            const ulong target = below(bits.x, bits.y, total);                                                         \
            best = -1;                                                                                                 \
            for (int p = 0; p < m && best < 0; p += V)                                                                 \
                if (ANY(WEIGHS(LOAD(d + p), smallest, g.scale)))                                                       \
                    for (int k = p; k < min(p + V, m) && best < 0; ++k) {                                              \
                        reached +=                                                                                     \
                            mass_of(d[k], smallest, g.scale, sample, stride, PIXEL(k), noise, g.radius, g.top);        \
                        best = reached > target ? k : -1;                                                              \
                    }                                                                                                  \
        }                                                                                                              \
    }

// The grey level of channel c of what was taken: the sample's own, or one drawn from the kernel around it.
inline int grey_level(const Level g, const int own, const int c, __global const uint *restrict noise, const uint turn,
                      const ulong place)
{
    if (!g.draws || g.radius < 0)
        return own;
    return own + step_from(noise, g.radius, own, g.top, draw4(g.seed, g.level, turn, place, PURPOSE_DRAW, 1 + c).x);
}

#endif

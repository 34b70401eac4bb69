// SPDX-License-Identifier: BSD-3-Clause
// Step 6.2.2.2: what a site takes of the candidates that it has weighed. ICM takes the nearest one, of several the first
// in the sample; the Gibbs sampler draws one with the probability that the LCPDF of equation (7) gives it.
#ifndef SIMDTEX_CHOOSE_H
#define SIMDTEX_CHOOSE_H
#include "common/level.h"
#include "common/parzen.h"
#include "common/philox.h"

// The place in the list of the candidate that is taken. NUMBER(k) is the number of the k-th of m candidates, PIXEL(k) the
// place of its grey levels in `sample`.
#define CHOOSE(best, g, d, m, sample, stride, noise, turn, place)                                                      \
    int best = 0;                                                                                                      \
    {                                                                                                                  \
        for (int k = 1; k < m; ++k)                                                                                    \
            best = d[k] < d[best] || (d[k] == d[best] && NUMBER(k) < NUMBER(best)) ? k : best;                         \
        if (g.draws) {                                                                                                 \
            const float smallest = d[best];                                                                            \
            ulong total = 0, reached = 0;                                                                              \
            for (int k = 0; k < m; ++k)                                                                                \
                total += mass_of(d[k], smallest, g.scale, sample, stride, PIXEL(k), noise, g.radius, g.top);           \
            const uint4 bits = draw4(g.seed, g.level, turn, place, PURPOSE_DRAW, 0);                                   \
            const ulong target = below(bits.x, bits.y, total);                                                         \
            best = -1;                                                                                                 \
            for (int k = 0; k < m && best < 0; ++k) {                                                                  \
                reached += mass_of(d[k], smallest, g.scale, sample, stride, PIXEL(k), noise, g.radius, g.top);         \
                best = reached > target ? k : -1;                                                                      \
            }                                                                                                          \
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

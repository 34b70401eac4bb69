// SPDX-License-Identifier: BSD-3-Clause
// How far a candidate is from a site on the lattice of a regular sample (-D WAVES: cosines and sines of their phases):
// one more term of its cost, which is the same at all neighbours and so stands for them.
#ifndef SIMDTEX_PHASES_H
#define SIMDTEX_PHASES_H

#ifndef WAVES
#define WAVES 0
#endif

// waves   (WAVES, listed)  of the candidates
// phases  (WAVES, area)    of the sites
// certain                  factor of their differences
// free                     how much of the cost is not counted: candidates within half a step of a phase are alike
#define PHASES                                                                                                         \
    __global const float *restrict waves, const int listed, __global const ushort *restrict phases, const int area_,   \
        const float certain_, const float free_
#define APART_IN_PHASE(p, site) apart_in_phase(waves + (p), listed, phases + (site), area_, certain_, free_)

inline float apart_in_phase(__global const float *y, const int listed, __global const ushort *x, const int area,
                            const float certain, const float free)
{
    float d = 0.0f;
    for (int c = 0; c < WAVES; ++c) {
        const float e = ((float)x[c * area] - y[c * listed]) * certain;
        d = fma(e, e, d);
    }
    return fmax(d - free, 0.0f);
}

#endif

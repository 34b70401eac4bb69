// SPDX-License-Identifier: BSD-3-Clause
// All candidates, in full: the distance of equation (12) for V sites and STEP candidates at a time, neighbours in canonical
// order, channels inside. lcpdf.cl keeps the distances, nearest.cl the least of them. This loop is the cost of the exact
// search.
#ifndef SIMDTEX_WEIGH_H
#define SIMDTEX_WEIGH_H
#include "common/beside.h"
#include "common/distance.h"
#include "common/vector.h"

#ifndef STEP
#define STEP 4 // candidates that are kept in registers together
#endif

// confidence (N, P), weighted (N, C, P)   from neighbourhood.cl, from the first site on; -D OWN: confidence (N, C, P)
// sample     (C, plane)                   working grey levels as float
// candidates (STEP,)                      pixel index in the sample
// reach      (N,)                         pixel offset in the sample of each neighbour
// d          (STEP,)                      out
inline void weigh(__global const float *restrict confidence, __global const float *restrict weighted, const int N,
                  const int P, __global const float *restrict sample, const int plane,
                  __global const int *restrict candidates, __global const int *restrict reach, __private vec *d)
{
    __global const float *y[STEP];
#pragma unroll
    for (int q = 0; q < STEP; ++q) {
        y[q] = sample + candidates[q];
        d[q] = 0.0f;
    }
    for (int k = 0; k < N; ++k) {
        const int o = reach[k];
#pragma unroll
        for (int c = 0; c < C; ++c) {
            const vec u = LOAD(confidence + (k * CONFIDENCES + CONFIDENT(c)) * P);
            const vec xu = LOAD(weighted + (k * C + c) * P);
#pragma unroll
            for (int q = 0; q < STEP; ++q) {
                const vec e = GAP((vec)y[q][c * plane + o], u, xu);
                d[q] = fma(e, e, d[q]);
            }
        }
    }
}

#endif

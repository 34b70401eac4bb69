// SPDX-License-Identifier: BSD-3-Clause
// The least squared distance of a neighbourhood x to the exemplars y of each class, as log(d^2 + 1).
//
//   d^2 = |x|^2 + min over y of (|y|^2 - 2 x y)
//
// All values are whole numbers, and no sum reaches 2^24: every order of summation gives the same bits.
#pragma OPENCL FP_CONTRACT OFF
#include "common/log.h"
#include "common/vector.h"

#ifndef K
#define K 9 // values of a neighbourhood
#endif
#define TOGETHER 4 // exemplars that are compared together; each class has a multiple of these

// features  (K, S)        neighbourhoods
// doubled   (M, K)        -2 y, class after class
// squares   (M,)          |y|^2
// starts    (classes + 1) where each class begins among them
// logs      (classes, S)  out: log(d^2 + 1) in 1/256
// One work-item per V sites.
__kernel void exemplars(__global const float *restrict features, const int S, __global const float *restrict doubled,
                        __global const float *restrict squares, __global const int *restrict starts, const int classes,
                        __global ushort *restrict logs)
{
    const int first = get_global_id(0) * V;
    if (first >= S)
        return;
    vec x[K], own = 0.0f;
    for (int k = 0; k < K; ++k) {
        float side[V];
        for (int v = 0; v < V; ++v)
            side[v] = features[k * S + min(first + v, S - 1)];
        x[k] = LOAD(side);
        own = fma(x[k], x[k], own);
    }
    for (int c = 0; c < classes; ++c) {
        vec least = INFINITY;
        for (int m = starts[c]; m < starts[c + 1]; m += TOGETHER) {
            __global const float *y = doubled + m * K;
            vec d0 = squares[m], d1 = squares[m + 1], d2 = squares[m + 2], d3 = squares[m + 3];
            for (int k = 0; k < K; ++k) {
                d0 = fma(x[k], y[k], d0);
                d1 = fma(x[k], y[K + k], d1);
                d2 = fma(x[k], y[2 * K + k], d2);
                d3 = fma(x[k], y[3 * K + k], d3);
            }
            least = fmin(least, fmin(fmin(d0, d1), fmin(d2, d3)));
        }
        float side[V];
        STORE(least + own, side);
        for (int v = 0; v < V && first + v < S; ++v)
            logs[c * S + first + v] = (ushort)rint(log32(side[v] + 1.0f) * 256.0f);
    }
}

// SPDX-License-Identifier: BSD-3-Clause
#pragma OPENCL FP_CONTRACT OFF
#include "common/vector.h"

// What a device can do at most: multiply-adds in independent chains, and a copy.
//
// values (items * V,)  in
// result (items * V,)  out
// One work-item per V values.

#ifndef CHAINS
#define CHAINS 10 // enough to hide the latency of an fma, and few enough for the registers
#endif

// CHAINS chains a <- a / 2 + 0.1 from value + 0, value + 1, ..., `rounds` times each; the result is their sum in this order.
__kernel void limits_peak(__global const float *restrict values, const int items, const int rounds,
                          __global float *restrict result)
{
    const int s = get_global_id(0);
    if (s >= items)
        return;
    vec a[CHAINS];
#pragma unroll
    for (int i = 0; i < CHAINS; ++i)
        a[i] = LOAD(values + s * V) + (vec)((float)i);
    for (int n = 0; n < rounds; ++n) {
#pragma unroll
        for (int i = 0; i < CHAINS; ++i)
            a[i] = fma(a[i], (vec)(0.5f), (vec)(0.1f));
    }
    vec sum = 0.0f;
#pragma unroll
    for (int i = 0; i < CHAINS; ++i)
        sum += a[i];
    STORE(sum, result + s * V);
}

__kernel void limits_copy(__global const float *restrict values, const int items, __global float *restrict result)
{
    const int s = get_global_id(0);
    if (s < items)
        STORE(LOAD(values + s * V), result + s * V);
}

// SPDX-License-Identifier: BSD-3-Clause
// The whole neighbourhoods that a classifier compares: the pixel and its neighbours, in whole numbers.
//
// levels    (B, rows, cols)  bands in sixteenths of 0..255
// sites     (S,)             row * cols + column
// offsets   (N, 2)           the site itself and its neighbours; beyond its border a picture is mirrored
// features  (B * N, S)       out; whole numbers, so that sums of their squares are exact in any order
// One work-item per site.
#pragma OPENCL FP_CONTRACT OFF
#include "common/border.h"
#include "common/exp.h"
#include "common/log.h"

#define VALUE(band, k)                                                                                                 \
    levels[(band) * rows * cols + within(i + offsets[k].x, rows, 0) * cols + within(j + offsets[k].y, cols, 0)]

// The values themselves, rounded to 0..255.
__kernel void features_raw(__global const ushort *restrict levels, const int bands, const int rows, const int cols,
                           __global const int *restrict sites, const int S, __global const int2 *restrict offsets,
                           const int N, __global float *restrict features)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    const int i = sites[s] / cols, j = sites[s] % cols;
    for (int b = 0; b < bands; ++b)
        for (int k = 0; k < N; ++k)
            features[(b * N + k) * S + s] = (float)((VALUE(b, k) + 8) >> 4);
}

// z g(|z|) / |z| with z the values minus their mean, each band minus its own, and g(n) = 40 log(1 + n / 5): what is left
// when brightness is taken away, and contrast compressed. `unit` is 1 / (16 N) from the host, since devices may divide
// with an error of 2.5 ulp; z is a whole number of these.
__kernel void features_contrast(__global const ushort *restrict levels, const int bands, const int rows, const int cols,
                                __global const int *restrict sites, const int S, __global const int2 *restrict offsets,
                                const int N, const float unit, __global float *restrict features)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    const int i = sites[s] / cols, j = sites[s] % cols;
    long squares = 0;
    for (int b = 0; b < bands; ++b) {
        int sum = 0;
        for (int k = 0; k < N; ++k)
            sum += VALUE(b, k);
        for (int k = 0; k < N; ++k) {
            const int z = VALUE(b, k) * N - sum;
            squares += (long)z * z;
            features[(b * N + k) * S + s] = (float)z;
        }
    }
    const float square = (float)squares * (unit * unit);
    const float inverse = exp32(-0.5f * log32(fmax(square, 1.0f))); // 1 / |z|, at most 1
    const float gain = 40.0f * log32(fma(square * inverse, 0.2f, 1.0f)) * inverse * unit;
    for (int k = 0; k < bands * N; ++k)
        features[k * S + s] = rint(features[k * S + s] * gain);
}

// SPDX-License-Identifier: BSD-3-Clause
// Step 6.2.2 of Algorithm 1 on the array: the ACU broadcasts the sample candidate by candidate, and the PEs of a layer
// accumulate distances (12), weights (7) and the draw. A launch takes `count` candidates, beginning with `first`.
//
// near      (layers, PEs, N (C + 1))  of each neighbour the weighted values x_r u of the channels, and u = 1 - t_r
// distance  (1, PEs, size)            of all candidates, or of this launch's, as many as a PE keeps
// sample    (N, C, size)              neighbourhoods of the candidates, those of a neighbour and channel side by side
// own       (C, n)                    values of the candidates themselves
#pragma OPENCL FP_CONTRACT OFF
#include "common/vector.h"
#include "common/distance.h"
#include "common/parzen.h"
#include "common/philox.h"
#include "maspar/layout.h"

#define STEP 4 // vectors of candidates in registers together

// simdtex.ops.lcpdf.Choice; `noise` and `gauss` are the tables of its window.
#define CHOICE                                                                                                  \
    const int draws, const int density, const float scale, TABLE(uint, noise), TABLE(float, gauss), const int radius, \
        const int top

// simdtex.maspar.instructions.Broadcast
#define BROADCAST                                                                                               \
    const int first, const int count, TABLE(float, sample), TABLE(float, own), CHOICE, PLURAL(float, distance), \
        PLURAL(float, least), PLURAL(int, chosen)
#define DISTANCE(pe) (distance + (size_t)(pe) * distance_size + first % distance_size)

// Keeps what has arrived from neighbour n, and adds its temperature to `heat`.
__kernel void maspar_lcpdf_keep(ARRAY, PLURAL(float, near), const int n, PLURAL(const int, arrived), PLURAL(int, heat))
{
    WHERE_ACTIVE(pe, k) {
        __global float *z = &OF(near, k) + n * (C + 1);
        const int t = arrived[k * (C + 1) + C];
        z[C] = (float)(1024 - t) * 0x1p-10f;
        for (int c = 0; c < C; ++c)
            z[c] = (float)arrived[k * (C + 1) + c] * z[C];
        OF(heat, k) += t;
    }
}

// Equation (12): neighbours in canonical order, each term two fused multiply-adds. And the `least` so far and its
// candidate, of several the first, `chosen` by ICM.
__kernel void maspar_lcpdf_distance(ARRAY, BROADCAST, PLURAL(const float, near))
{
    WHERE_ACTIVE(pe, k) {
        __global const float *z = &OF(near, k);
        __global float *d = DISTANCE(pe);
        for (int p = 0; p < count; p += STEP * V) {
            vec sum[STEP];
            for (int q = 0; q < STEP; ++q)
                sum[q] = 0.0f;
            for (int r = 0; r < near_size / (C + 1); ++r)
                for (int c = 0; c < C; ++c)
#pragma unroll
                    for (int q = 0; q < STEP; ++q) {
                        const vec y = LOAD(sample + (r * C + c) * sample_size + first + p + q * V);
                        const vec e = GAP(y, (vec)z[r * (C + 1) + C], (vec)z[r * (C + 1) + c]);
                        sum[q] = fma(e, e, sum[q]);
                    }
            for (int q = 0; q < STEP; ++q)
                STORE(sum[q], d + p + q * V);
        }
        float found = OF(least, k);
        for (int p = 0; p < count; ++p)
            if (d[p] < found) {
                found = d[p];
                OF(chosen, k) = first + p;
            }
        OF(least, k) = found;
    }
}

// The weights of equation (7), added to `sum`. With `choose`, the first candidate at which that exceeds the target is
// `chosen`, if none was.
__kernel void maspar_lcpdf_weigh(ARRAY, BROADCAST, PLURAL(ulong, sum), PLURAL(const ulong, target),
                                 const int choose)
{
    WHERE_ACTIVE(pe, k) {
        __global const float *d = DISTANCE(pe);
        const float smallest = OF(least, k);
        ulong total = OF(sum, k);
        int taken = choose ? OF(chosen, k) : -1;
        for (int p = 0; p < count && taken < 0; ++p) {
            if (WEIGHS(d[p], smallest, scale))
                total += mass_of(d[p], smallest, scale, own, own_size, first + p, noise, density ? radius : -1, top);
            taken = choose && total > OF(target, k) ? first + p : -1;
        }
        OF(sum, k) = total;
        if (choose)
            OF(chosen, k) = taken;
    }
}

// The weights of equation (7) given the grey levels x of all channels but c, added to the `mass` of each grey level,
// which the first launch clears. With c = -1, the candidate that gives most is `chosen`; `most` is its weight so far.
__kernel void maspar_lcpdf_mode(ARRAY, BROADCAST, PLURAL(ulong, mass), PLURAL(ulong, most),
                                PLURAL(const int, x), const int c)
{
    WHERE_ACTIVE(pe, k) {
        __global ulong *m = mass + (size_t)pe * mass_size;
        for (int v = 0; !first && v <= top; ++v)
            m[v] = 0;
        for (int p = 0; p < count; ++p) {
            ulong w = weight(DISTANCE(pe)[p], OF(least, k), scale);
            for (int b = 0; b < C; ++b)
                if (b != c)
                    w = weight_near(w, abs((int)own[b * own_size + first + p] - (&OF(x, k))[b]), gauss, radius);
            if (c >= 0)
                m[(int)own[c * own_size + first + p]] += w;
            else if (w > OF(most, k)) {
                OF(most, k) = w;
                OF(chosen, k) = first + p;
            }
        }
    }
}

// The grey level x with the highest density, of several the lowest: the `mass` of all levels, smoothed by the kernel.
__kernel void maspar_lcpdf_highest(ARRAY, PLURAL(const ulong, mass), CHOICE, PLURAL(int, x))
{
    WHERE_ACTIVE(pe, k) {
        float best = -1.0f;
        for (int v = 0; v <= top; ++v) {
            float f = 0.0f;
            for (int y = max(0, v - radius); y <= min(top, v + radius); ++y)
                f = fma((float)mass[(size_t)pe * mass_size + y], gauss[abs(v - y)], f);
            if (f > best) {
                best = f;
                OF(x, k) = v;
            }
        }
    }
}

// A grey level of channel c, drawn from the kernel of equation (7) around that of the chosen candidate.
__kernel void maspar_lcpdf_step(ARRAY, PLURAL(int, x), CHOICE, PLURAL(const int, place), const ulong seed,
                                const uint level, const uint turn, const int c)
{
    WHERE_ACTIVE(pe, k) {
        const uint bits = draw4(seed, level, turn, (ulong)OF(place, k), PURPOSE_DRAW, 1 + c).x;
        OF(x, k) += step_from(noise, radius, OF(x, k), top, bits);
    }
}

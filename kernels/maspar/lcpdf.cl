// SPDX-License-Identifier: BSD-3-Clause
// Step 6.2.2 of Algorithm 1 on the array: the ACU broadcasts the sample candidate by candidate, and each PE keeps the best
// one so far. No distance is stored.
//
// near      (layers, PEs, N (C + 1))  of each neighbour the weighted values x_r u of the channels, and u = 1 - t_r
// sample    (N, C, size)              neighbourhoods of the candidates, those of a neighbour and channel side by side
// lanes     (LANES + 1,)              where the neighbours of each lane begin
// own       (C, n)                    values of the candidates themselves
// share     (C, n)                    logarithms of the legal shares of the kernels around them
// number    (n,)                      of each candidate's noise: 16 times its unit, and its lane
#pragma OPENCL FP_CONTRACT OFF
#include "common/distance.h"
#include "common/parzen.h"
#include "common/gumbel.h"
#include "maspar/layout.h"

#define STEP 4 // vectors of candidates in registers together
#define TOGETHER (STEP * V)

// simdtex.methods.mrf.lcpdf.Window
#define WINDOW const float scale, TABLE(uint, noise), TABLE(float, gauss), const int radius, const int top

// simdtex.maspar.instructions.Broadcast, a neighbourhood, and the best candidate so far
#define BROADCAST                                                                                                \
    TABLE(float, sample), TABLE(int, lanes), TABLE(float, own), TABLE(float, share), TABLE(int, number),         \
        PLURAL(const float, near), PLURAL(float, least), PLURAL(int, chosen)

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

// Equation (12): each term two fused multiply-adds, the neighbours of a lane row by row; then lanes n and n + 8 are
// added, n and n + 4, n and n + 2, n and n + 1.
static inline void distances(__global const float *restrict y, const int size, __global const int *restrict lanes,
                             __global const float *z, __private float *d)
{
    vec sum[LANES][STEP];
    for (int n = 0; n < LANES; ++n) {
        vec here[STEP];
        for (int q = 0; q < STEP; ++q)
            here[q] = 0.0f;
        for (int r = lanes[n] * C; r < lanes[n + 1] * C; ++r)
#pragma unroll
            for (int q = 0; q < STEP; ++q) {
                const vec e = GAP(LOAD(y + r * size + q * V), (vec)z[r / C * (C + 1) + C], (vec)z[r / C + r]);
                here[q] = fma(e, e, here[q]);
            }
        for (int q = 0; q < STEP; ++q)
            sum[n][q] = here[q];
    }
    for (int half_ = LANES / 2; half_; half_ /= 2)
        for (int n = 0; n < half_; ++n)
            for (int q = 0; q < STEP; ++q)
                sum[n][q] += sum[n + half_][q];
    for (int q = 0; q < STEP; ++q)
        STORE(sum[0][q], d + q * V);
}

// The candidate of least distance; of a draw, with 2h^2 times its noise, which takes MOST_GUMBEL times that away at most.
__kernel void maspar_lcpdf_choose(ARRAY, BROADCAST, const float spread, PLURAL(const int, place), const ulong seed,
                                  const uint level, const uint turn)
{
    WHERE_ACTIVE(pe, k) {
        float best = INFINITY;
        for (int first = 0; first < own_size; first += TOGETHER) {
            float d[TOGETHER];
            distances(sample + first, sample_size, lanes, &OF(near, k), d);
            for (int n = 0; n < TOGETHER && first + n < own_size; ++n) {
                const int p = first + n, q = number[p];
                float total = d[n];
                if (spread > 0.0f && total - PRODUCT(MOST_GUMBEL, spread) <= best) {
                    float noise = minus_gumbel_of(seed, level, turn, (ulong)OF(place, k), q / LANES, q % LANES);
                    for (int c = 0; c < C; ++c)
                        noise -= share[c * share_size + p];
                    total = fma(spread, noise, total);
                }
                if (total < best) {
                    best = total;
                    OF(chosen, k) = p;
                }
            }
        }
        OF(least, k) = best;
    }
}

// The weights of equation (7) given the grey levels x of all channels but c, added up for each grey level. With c = -1,
// the candidate that gives most is `chosen`.
__kernel void maspar_lcpdf_mode(ARRAY, BROADCAST, WINDOW, PLURAL(ulong, mass), PLURAL(const int, x), const int c)
{
    WHERE_ACTIVE(pe, k) {
        __global ulong *m = mass + (size_t)pe * mass_size;
        ulong most = 0;
        for (int v = 0; v <= top; ++v)
            m[v] = 0;
        for (int first = 0; first < own_size; first += TOGETHER) {
            float d[TOGETHER];
            distances(sample + first, sample_size, lanes, &OF(near, k), d);
            for (int n = 0; n < TOGETHER && first + n < own_size; ++n) {
                const int p = first + n;
                ulong w = weight(d[n], OF(least, k), scale);
                for (int b = 0; b < C; ++b)
                    if (b != c)
                        w = weight_near(w, abs((int)own[b * own_size + p] - (&OF(x, k))[b]), gauss, radius);
                if (c >= 0)
                    m[(int)own[c * own_size + p]] += w;
                else if (w > most) {
                    most = w;
                    OF(chosen, k) = p;
                }
            }
        }
    }
}

// The grey level x with the highest density, of several the lowest: the `mass` of all levels, smoothed by the kernel.
__kernel void maspar_lcpdf_highest(ARRAY, PLURAL(const ulong, mass), WINDOW, PLURAL(int, x))
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
__kernel void maspar_lcpdf_step(ARRAY, PLURAL(int, x), WINDOW, PLURAL(const int, place), const ulong seed,
                                const uint level, const uint turn, const int c)
{
    WHERE_ACTIVE(pe, k) {
        const uint bits = draw4(seed, level, turn, (ulong)OF(place, k), PURPOSE_DRAW, 1 + c).x;
        OF(x, k) += step_from(noise, radius, OF(x, k), top, bits);
    }
}

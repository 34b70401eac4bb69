// SPDX-License-Identifier: BSD-3-Clause
// Step 6.2.2 of Algorithm 1 on the array, for one virtual layer: the ACU broadcasts the sample candidate by candidate, and
// the PEs of a layer accumulate distances (12), weights (7) and the draw. A launch takes a block of `count` candidates.
//
// near     (layers, PEs, N, C + 1)  of each neighbour the weighted values x_r u of the channels, and u = 1 - t_r
// distance (PEs, pitch)             of the candidates that a PE keeps; `at` is the place of the block's first one
// own      (C, n)                   values of the candidates themselves, `first` that of the block's first one
#pragma OPENCL FP_CONTRACT OFF
#include "common/vector.h"
#include "common/distance.h"
#include "common/parzen.h"
#include "common/philox.h"
#include "maspar/layout.h"

#define STEP 4 // vectors of candidates in registers together

// Keeps what has arrived from neighbour n, and adds its temperature to `heat`.
__kernel void maspar_lcpdf_keep(const Layout g, __global const uchar *restrict mask, __global float *restrict near,
                                const int N, const int n, __global const int *restrict arrived,
                                __global int *restrict heat)
{
    const int pe = get_global_id(0);
    if (pe >= PES(g))
        return;
    for (int k = pe; k < LAYERS(g) * PES(g); k += PES(g)) {
        if (!mask[k])
            continue;
        __global float *z = near + ((size_t)k * N + n) * (C + 1);
        const int t = arrived[k * (C + 1) + C];
        z[C] = (float)(1024 - t) * 0x1p-10f;
        for (int c = 0; c < C; ++c)
            z[c] = (float)arrived[k * (C + 1) + c] * z[C];
        heat[k] += t;
    }
}

// Equation (12): neighbours in canonical order, each term two fused multiply-adds. And the `least` of all blocks and its
// candidate, of several the first, `chosen` by ICM. A block has `size` places and `count` candidates; the first, `begin`.
// sample (N, C, size)  the neighbourhoods of the candidates, those of one neighbour and channel side by side
__kernel void maspar_lcpdf_distance(const Layout g, __global const uchar *restrict mask, const int layer,
                                    __global const float *restrict near, const int N,
                                    __global const float *restrict sample, const int size,
                                    __global float *restrict distance, const int pitch, const int at, const int count,
                                    const int first, const int begin, __global float *restrict least,
                                    __global int *restrict chosen)
{
    const int pe = get_global_id(0);
    if (pe >= PES(g) || !mask[layer * PES(g) + pe])
        return;
    __global const float *z = near + (size_t)(layer * PES(g) + pe) * N * (C + 1);
    __global float *d = distance + (size_t)pe * pitch + at;
    for (int p = 0; p < size; p += STEP * V) {
        vec sum[STEP];
        for (int q = 0; q < STEP; ++q)
            sum[q] = 0.0f;
        for (int k = 0; k < N; ++k)
            for (int c = 0; c < C; ++c)
#pragma unroll
                for (int q = 0; q < STEP; ++q) {
                    const vec e = GAP(LOAD(sample + (k * C + c) * size + p + q * V), (vec)z[k * (C + 1) + C],
                                      (vec)z[k * (C + 1) + c]);
                    sum[q] = fma(e, e, sum[q]);
                }
        for (int q = 0; q < STEP; ++q)
            STORE(sum[q], d + p + q * V);
    }
    float found = begin ? INFINITY : least[pe];
    for (int p = 0; p < count; ++p)
        if (d[p] < found) {
            found = d[p];
            chosen[layer * PES(g) + pe] = first + p;
        }
    least[pe] = found;
}

// The weights of equation (7), and their sum over the blocks so far. With `choose`, that sum is drawn a target from by the
// random `bits` before the first block, and the first candidate at which the weights exceed it is `chosen`.
__kernel void maspar_lcpdf_weigh(const Layout g, __global const uchar *restrict mask, const int layer,
                                 __global const float *restrict distance, const int pitch, const int at,
                                 const int count, const int first, __global const float *restrict least,
                                 const float scale, __global const float *restrict own, const int n,
                                 __global const uint *restrict noise, const int radius, const int top,
                                 __global ulong *restrict sum, const int choose, __global const ulong *restrict bits,
                                 __global ulong *restrict target, __global int *restrict chosen)
{
    const int pe = get_global_id(0), k = layer * PES(g) + pe;
    if (pe >= PES(g) || !mask[k])
        return;
    if (choose && !first) {
        target[pe] = mul_hi(bits[k], sum[pe]);
        chosen[k] = -1;
    }
    ulong total = first ? sum[pe] : 0;
    int taken = choose ? chosen[k] : -1;
    for (int p = 0; p < count && taken < 0; ++p) {
        const float d = distance[(size_t)pe * pitch + at + p];
        if (WEIGHS(d, least[pe], scale))
            total += mass_of(d, least[pe], scale, own, n, first + p, noise, radius, top);
        taken = choose && total > target[pe] ? first + p : -1;
    }
    sum[pe] = total;
    if (choose)
        chosen[k] = taken;
}

// The mode of equation (7) in channel c given the grey levels x of the others, of several levels the lowest (ICM). The
// weights of a block add up in the `mass` (PEs, greys) of grey levels; x takes the mode after the last block. With `start`, x
// begins with the `chosen` candidate; with c = -1, that becomes the one that gives most at x.
__kernel void maspar_lcpdf_mode(const Layout g, __global const uchar *restrict mask, const int layer,
                                __global const float *restrict distance, const int pitch, const int at,
                                const int count, const int first, __global const float *restrict least,
                                const float scale, __global const float *restrict own, const int n,
                                __global const float *restrict window, const int radius, const int greys,
                                __global ulong *restrict mass, __global ulong *restrict sum, __global int *restrict x,
                                const int size, const int c, const int start, __global int *restrict chosen)
{
    const int pe = get_global_id(0), k = layer * PES(g) + pe;
    if (pe >= PES(g) || !mask[k])
        return;
    __global ulong *m = mass + (size_t)pe * greys;
    for (int v = 0; !first && v < greys; ++v)
        m[v] = 0;
    for (int b = 0; start && !first && b < C; ++b)
        x[k * size + b] = (int)own[b * n + chosen[k]];
    ulong most = first ? sum[pe] : 0;
    for (int p = 0; p < count; ++p) {
        ulong w = weight(distance[(size_t)pe * pitch + at + p], least[pe], scale);
        for (int b = 0; b < C; ++b)
            if (b != c)
                w = weight_near(w, abs((int)own[b * n + first + p] - x[k * size + b]), window, radius);
        if (c >= 0)
            m[(int)own[c * n + first + p]] += w;
        else if (w > most) {
            most = w;
            chosen[k] = first + p;
        }
    }
    sum[pe] = most;
    float best = -1.0f;
    for (int v = 0; c >= 0 && first + count == n && v < greys; ++v) {
        float f = 0.0f;
        for (int y = max(0, v - radius); y <= min(greys - 1, v + radius); ++y)
            f = fma((float)m[y], window[abs(v - y)], f);
        if (f > best) {
            best = f;
            x[k * size + c] = v;
        }
    }
}

// A grey level drawn from the kernel of equation (7) around that of the chosen candidate; word c is channel c.
__kernel void maspar_lcpdf_step(const Layout g, __global const uchar *restrict mask, __global int *restrict x,
                                const int size, const int c, __global const uint *restrict noise, const int radius,
                                const int top, __global const int *restrict place, const ulong seed, const uint level,
                                const uint turn)
{
    const int pe = get_global_id(0);
    if (pe >= PES(g))
        return;
    for (int k = pe; k < LAYERS(g) * PES(g); k += PES(g))
        if (mask[k]) {
            const uint bits = draw4(seed, level, turn, (ulong)place[k], PURPOSE_DRAW, 1 + c).x;
            x[k * size + c] += step_from(noise, radius, x[k * size + c], top, bits);
        }
}

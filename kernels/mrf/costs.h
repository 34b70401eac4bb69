// SPDX-License-Identifier: BSD-3-Clause
// What candidate p costs a site, simdtex.methods.mrf.costs: the sum of these, in this order,
//
//   factor d_p                                        equation (12), less where it continues a neighbour: coherence.h
//   penalty_p                                         for its use
//   max(0, sum_c (weight (x_c - y_c))^2 - tolerance)  for its phases where the sample is regular, -D WAVES of them
//   sum_r (hard (x_r - y_r))^2                        for data r between the sites of the level, -D SCATTERED channels
//   sum_k kind_cost[kind_k]                           for its kinds, as its category, -D KINDS of them
//   novelty n_p                                       for each neighbour that it continues, or 4 for one that it repeats
//
// Only the first may be less than that of all candidates; none is below 0.
#include "mrf/square.h"

// at      (listed,)        place of each candidate in `levels`
// levels  (C, plane)       grey levels of the sample, columns apart by the level's step side by side
// penalty (listed,)        of each candidate
// waves   (WAVES, listed)  of each candidate
// kinds_of (KINDS, listed) row of `kind_cost` that each candidate's kinds have
// kind_cost (.., area)     what a candidate of a kind costs at each site, 0 or more
// phases  (WAVES, area)    of each site
// begin_  (area + 1,)      where the data of the site at each pixel index begin
// reach_  (n,)             pixel offset of each datum in the sample
// told    (n, SCATTERED)   its grey levels
// pixels_ (C, plane_)      the sample
// at_     (listed,)        pixel index of each candidate
//
// `r` is restrict in a kernel. In a function it is empty, since Oclgrind fails on what clang makes of it there.
#define COSTS_OF(r)                                                                                                    \
    __global const int *r at, __global const float *r levels, __global const float *r penalty,                         \
        __global const float *r waves, const int listed, __global const ushort *r phases, const int area_,             \
        const float phase_weight, const float tolerance, __global const int *r begin_, __global const int *r reach_,   \
        __global const ushort *r told, const float hard_, __global const float *r pixels_, const int plane_,           \
        __global const int *r at_, __global const ushort *r kinds_of, __global const float *r kind_cost
#define COSTS COSTS_OF()
#define COSTED                                                                                                         \
    at, levels, penalty, waves, listed, phases, area_, phase_weight, tolerance, begin_, reach_, told, hard_, pixels_,  \
        plane_, at_, kinds_of, kind_cost

// The first parameters of kernels that evaluate candidates.
//
// sites    (S,)         number of each site; sites first .. S - 1 of the list are relaxed
// values (C, area), source (area,), temperature (area,)   the field
// offsets  (N, AXES)    of the neighbours, canonical order
// reach    (N,)         pixel offset of each in the sample
// index_of (pixels,)    number of the candidate at a pixel of the sample, -1 where there is none
// positions (count,)    pixel index of each candidate
// disc     (CELLS, 16)  1 on the neighbourhood, 0 elsewhere
// looks    (N, 2)       lane of each neighbour in the square and its offset in `levels`, close ones far apart
#define FIELD                                                                                                          \
    __global const int *restrict sites, const int first, const int S, __global const ushort *values,                   \
        __global const int *source, __global const ushort *temperature, const Level g,                                 \
        __global const int *restrict offsets, __global const int *restrict reach, __global const int *restrict index_of, \
        __global const int *restrict positions, __global const float *restrict disc,                                   \
        __global const int2 *restrict looks, COSTS_OF(restrict)

static inline float apart_in_phase(__global const float *y, const int listed, __global const ushort *x, const int area,
                                   const float weight, const float tolerance)
{
    float d = 0.0f;
    for (int c = 0; c < WAVES; ++c) {
        const float e = ((float)x[c * area] - y[c * listed]) * weight;
        d = fma(e, e, d);
    }
    return fmax(d - tolerance, 0.0f);
}

static inline float of_kind(__global const ushort *kind, const int listed, __global const float *kind_cost, const int area)
{
    float d = 0.0f;
    for (int k = 0; k < KINDS; ++k)
        d += kind_cost[kind[k * listed] * area];
    return d;
}

static inline float misfit(const int begin, const int end, __global const int *reach, __global const ushort *told,
                           const float hard, __global const float *y, const int plane)
{
    float d = 0.0f;
    for (int n = begin; n < end; ++n)
        for (int c = 0; c < SCATTERED; ++c) {
            const ushort x = told[n * SCATTERED + c];
            const float e = x == UNKNOWN ? 0.0f : ((float)x - y[c * plane + reach[n]]) * hard;
            d = fma(e, e, d);
        }
    return d;
}

// All costs of candidate p at a distance, but novelty.
INLINED float with_costs(const float distance, const int p, const float factor, const int site, COSTS)
{
    float cost = PRODUCT(distance, factor) + penalty[p];
    if (WAVES)
        cost += apart_in_phase(waves + p, listed, phases + site, area_, phase_weight, tolerance);
    if (SCATTERED)
        cost += misfit(begin_[site], begin_[site + 1], reach_, told, hard_, pixels_ + at_[p], plane_);
    if (KINDS)
        cost += of_kind(kinds_of + p, listed, kind_cost + site, area_);
    return cost;
}

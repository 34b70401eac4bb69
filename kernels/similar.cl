// SPDX-License-Identifier: BSD-3-Clause

// The K candidates whose neighbourhoods are most like that of candidate first + s, by the distances of lcpdf.cl;
// nearest first, the lowest index where several are as near.
//
// distance (candidates, P)
// found    (candidates, K)   out: rows first .. first + S - 1
// One work-item per candidate.
__kernel void similar(__global const float *restrict distance, const int first, const int S, const int P,
                             const int count, const int K, __global int *restrict found)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    __global int *best = found + (first + s) * K;
    int m = 0;
    for (int p = 0; p < count; ++p) {
        const float d = distance[p * P + s];
        if (p == first + s || (m == K && d >= distance[best[K - 1] * P + s]))
            continue;
        int k = m < K ? m++ : K - 1;
        for (; k > 0 && distance[best[k - 1] * P + s] > d; --k)
            best[k] = best[k - 1];
        best[k] = p;
    }
}

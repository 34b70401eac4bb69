// SPDX-License-Identifier: BSD-3-Clause
// Iterated conditional modes of the Potts field of a classification: a site takes the class c of the greatest
//
//   u_c + w (G * 1[l = c]),
//
// where the votes G * 1[l = c] are sums over a window of the labels as they were before the step. Of several the first.
//
// sites     (S,)             row * cols + column
// evidence  (classes, area)  u in 2^-18
// votes     (classes, area)  in 2^-18
// weight                     w in 1/16
// labels    (area,)          in place
// One work-item per site.
__kernel void potts(__global const int *restrict sites, const int S, __global const int *restrict evidence,
                    __global const uint *restrict votes, const int classes, const int area, const int weight,
                    __global uchar *restrict labels)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    int best = 0, most = INT_MIN;
    for (int c = 0; c < classes; ++c) {
        const int at = c * area + sites[s], mine = evidence[at] + ((weight * (int)votes[at]) >> 4);
        if (mine > most) {
            most = mine;
            best = c;
        }
    }
    labels[sites[s]] = (uchar)best;
}

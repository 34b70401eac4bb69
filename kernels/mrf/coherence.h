// SPDX-License-Identifier: BSD-3-Clause
// A preference for coherence, which the 1998 paper lacks: neighbour r of site s was taken from sample position p_r, so
// p_r + (s - r) continues it. The squared distance of such a candidate is multiplied by `discount` = 1 / (1 + coherence),
// once however many neighbours propose it. Neighbours that no relaxation has touched (t = 1) propose none.

#define UNTOUCHED 1024 // t = 1 in 1/1024

// Number of the candidate that continues pixel `source` of the sample, `reach` pixels before it; -1 where there is none.
// A site whose value is given may be from nowhere in the sample: its source is -1.
static inline int continuing(__global const int *index_of, const int source, const int reach, const int pixels)
{
    const int p = source - reach;
    return source < 0 || p < 0 || p >= pixels ? -1 : index_of[p];
}

// Number of the candidate that pixel `source` is; -1 where it is none, or from nowhere.
static inline int number_of(__global const int *index_of, const int source)
{
    return source < 0 ? -1 : index_of[source];
}

// SPDX-License-Identifier: BSD-3-Clause
// Confidences. The last G of C channels are guides: they are matched and never made. With -D OWN
// every channel has a confidence of its own: a guide's is 1 whatever the temperature, and `centre` at the site itself;
// what nobody knows has 0.
#ifndef SIMDTEX_CONFIDENCE_H
#define SIMDTEX_CONFIDENCE_H

#ifndef G
#define G 0
#endif
#define UNKNOWN 0xffff // the grey level of what nobody knows
#define MADE (C - G)

#ifdef OWN
#define CONFIDENCES C
#define CONFIDENT(c) (c)
#else
#define CONFIDENCES 1
#define CONFIDENT(c) 0
#endif

// The confidence of a site of confidence u: hard data, which are from nowhere in the sample, count more.
inline float weighed_as(const float u, const int source, const float hard)
{
    return source < 0 ? u * hard : u;
}

// The confidence of a value: `u` of channels that are made, `guide` of others.
inline float confidence_of(const bool made, const ushort x, const float u, const float guide)
{
    return x == UNKNOWN ? 0.0f : made ? u : guide;
}

#endif

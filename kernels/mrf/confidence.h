// SPDX-License-Identifier: BSD-3-Clause
// Confidences. The last G of C channels are guides: they are matched and never made. With -D OWN
// every channel has a confidence of its own: a guide's is 1 whatever the temperature, and `centre` at the site itself;
// an unknown value has 0. The last KNOWN guides are known variables, with the confidence of hard data, and
// `centre_known` at the site itself.

#ifndef G
#define G 0
#endif
#ifndef KNOWN
#define KNOWN 0
#endif
#define UNKNOWN 0xffff // the grey level of an unknown value
#define MADE (C - G)

// The confidence of a site of confidence u: hard data, which are from nowhere in the sample, count more. The confidence of
// a value x: u of channels that are made, `guide` of others.
#ifdef OWN
#define CONFIDENCES C
#define CONFIDENT(c) (c)
#define WEIGHED_AS(u, source, hard) ((source) < 0 ? (u) * (hard) : (u))
#define CONFIDENCE_OF(made, x, u, guide) ((x) == UNKNOWN ? 0.0f : (made) ? (u) : (guide))
#else
#define CONFIDENCES 1
#define CONFIDENT(c) 0
#define WEIGHED_AS(u, source, hard) (u)
#define CONFIDENCE_OF(made, x, u, guide) (u)
#endif

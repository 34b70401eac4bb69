// SPDX-License-Identifier: BSD-3-Clause
// Confidences. The last -D G of C channels are guides: they are matched and never made. With -D OWN=1
// every channel has a confidence of its own: a guide's is 1 whatever the temperature, and `centre` at the site itself;
// an unknown value has 0. The last -D KNOWN guides are known variables, with the confidence of hard data, and
// `centre_known` at the site itself.

#define UNKNOWN 0xffff // the grey level of an unknown value
#define MADE (C - G)
#define CONFIDENCES (OWN ? C : 1)
#define CONFIDENT(c) (OWN ? (c) : 0)

// SPDX-License-Identifier: BSD-3-Clause
// Which of the S sites that relax together a work-item takes. Packed: the n-th work-item takes the n-th site. On a
// processor array (-D LANES) a launch has one work-item per processing element (PE), site or none: lane[pe] is the
// number of its site, and -1 idles under the mask.
#ifndef SIMDTEX_LANES_H
#define SIMDTEX_LANES_H

#ifdef LANES
#define LANES_ARG , __global const int *restrict lane
#define LANE (lane[get_global_id(0)])
#else
#define LANES_ARG
#define LANE ((int)get_global_id(0))
#endif
#define IDLE(s) ((s) < 0 || (s) >= S)

// The second dimension of a launch, which an array lacks: each PE goes through it alone.
#define ALONG(k, count) for (int k = get_global_id(1); k < (count); k += get_global_size(1))

#endif

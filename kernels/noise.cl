// SPDX-License-Identifier: BSD-3-Clause
#include "common/philox.h"

// White noise, all 32 bits uniform: values (planes, n). One draw of Philox serves four planes; plane p has word p % 4
// of draw p / 4. One work-item per draw of 8 sites.
__kernel void noise(const ulong seed, const int level, const int planes, const int n, __global int *restrict values)
{
    const int s = 8 * get_global_id(0), turn = get_global_id(1);
    if (s >= n || 4 * turn >= planes)
        return;
    ulong8 word[4] = {convert_ulong8((uint)s + (uint8)(0, 1, 2, 3, 4, 5, 6, 7)), (uint)turn,
                      ((uint)level << 8) | PURPOSE_NOISE, 0};
    philox8(word, word + 1, word + 2, word + 3, (uint2)((uint)seed, (uint)(seed >> 32)));
    for (int p = 4 * turn; p < min(planes, 4 * turn + 4); ++p) {
        const int8 bits = as_int8(convert_uint8(word[p % 4]));
        __global int *to = values + (size_t)p * n + s;
        if (s + 8 <= n) {
            vstore8(bits, 0, to);
        } else {
            int lane[8];
            vstore8(bits, 0, lane);
            for (int k = 0; k < n - s; ++k)
                to[k] = lane[k];
        }
    }
}

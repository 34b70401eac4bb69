// SPDX-License-Identifier: BSD-3-Clause
#include "common/philox.h"

// White noise, all 32 bits uniform: values (planes, n). One draw of Philox serves four planes; plane p has word p % 4
// of draw p / 4. One work-item per draw.
__kernel void noise(const ulong seed, const int level, const int planes, const int n, __global int *restrict values)
{
    const int s = get_global_id(0), turn = get_global_id(1);
    if (s >= n || 4 * turn >= planes)
        return;
    const uint4 bits = draw4(seed, level, turn, s, PURPOSE_NOISE, 0);
    const uint word[4] = {bits.x, bits.y, bits.z, bits.w};
    for (int p = 4 * turn; p < min(planes, 4 * turn + 4); ++p)
        values[(size_t)p * n + s] = (int)word[p % 4];
}

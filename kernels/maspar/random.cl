// SPDX-License-Identifier: BSD-3-Clause
#include "common/philox.h"
#include "maspar/layout.h"

// 64 random bits, keyed by the place of the PE's pixel in the picture.
__kernel void maspar_random(const Layout g, __global const uchar *restrict mask, __global ulong *restrict bits,
                            __global const int *restrict place, const ulong seed, const uint level, const uint turn,
                            const uint purpose)
{
    const int pe = get_global_id(0);
    if (pe >= PES(g))
        return;
    for (int k = pe; k < LAYERS(g) * PES(g); k += PES(g))
        if (mask[k]) {
            const uint4 r = draw4(seed, level, turn, (ulong)place[k], purpose, 0);
            bits[k] = (ulong)r.y << 32 | r.x;
        }
}

// SPDX-License-Identifier: BSD-3-Clause
#include "common/philox.h"
#include "maspar/layout.h"

// 64 random bits, keyed by the place of the PE's pixel in the picture.
__kernel void maspar_random(ARRAY, PLURAL(ulong, bits), PLURAL(const int, place), const ulong seed, const uint level,
                            const uint turn, const uint purpose)
{
    WHERE_ACTIVE(pe, k) {
        const uint4 r = draw4(seed, level, turn, (ulong)OF(place, k), purpose, 0);
        OF(bits, k) = (ulong)r.y << 32 | r.x;
    }
}

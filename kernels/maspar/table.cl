// SPDX-License-Identifier: BSD-3-Clause
#include "maspar/layout.h"

// The entry `index` of a table (count,): the ACU broadcasts entry after entry, and a PE takes its own.
__kernel void maspar_table(const Layout g, __global const uchar *restrict mask, __global T *restrict to, const int size,
                           const int word, __global const T *restrict table, __global const int *restrict index)
{
    const int pe = get_global_id(0);
    if (pe >= PES(g))
        return;
    for (int k = pe; k < LAYERS(g) * PES(g); k += PES(g))
        if (mask[k])
            to[k * size + word] = table[index[k]];
}

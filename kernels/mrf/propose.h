// SPDX-License-Identifier: BSD-3-Clause
// A list of candidates in which each stands once.
#include "mrf/group.h"

// Whether i is among the first m of a list; `seen` has a bit for each that is.
#define BIT(i) (1ul << ((uint)(i) * 0x9E3779B1u >> 26))
static inline bool listed(const int i, const SHARED int *list, const int m, const ulong seen)
{
    if (!(seen & BIT(i)))
        return false;
    for (int j = 0; j < m; ++j)
        if (list[j] == i)
            return true;
    return false;
}

// Append a candidate to list[m], but none that is -1 or stands there already.
static inline int proposed(const int i, SHARED int *list, const int m, __private ulong *seen)
{
    if (i < 0 || listed(i, list, m, *seen))
        return m;
    list[m] = i;
    *seen |= BIT(i);
    return m + 1;
}

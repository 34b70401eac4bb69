// SPDX-License-Identifier: BSD-3-Clause
#include "maspar/layout.h"

// The entry `index` of a table: the ACU broadcasts entry after entry, and a PE takes its own.
__kernel void maspar_table(ARRAY, PLURAL(T, to), TABLE(T, entries), PLURAL(const int, index))
{
    WHERE_ACTIVE(pe, k) OF(to, k) = entries[OF(index, k)];
}

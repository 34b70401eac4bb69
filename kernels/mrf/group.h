// SPDX-License-Identifier: BSD-3-Clause
// Work-items that relax one site together, -D ITEMS of them in a work-group, a multiple of 16: sums have 16 lanes, and so
// an item has one lane of one candidate. With ITEMS=1 an item relaxes a site by itself, and its arrays are its own.

#if ITEMS > 1
#define SHARED __local
#define ITEM ((int)get_local_id(0))
#define INDEX get_group_id(0)
#define TOGETHER barrier(CLK_LOCAL_MEM_FENCE)
#define GROUP __attribute__((reqd_work_group_size(ITEMS, 1, 1)))
#define ADDED(sum, n) atomic_add(sum, n) // returns what the sum was
#else
#define SHARED __private
#define ITEM 0
#define INDEX get_global_id(0)
#define TOGETHER
#define GROUP
#define ADDED(sum, n) ((*(sum) += (n)) - (n))
#endif
#define EACH(k, n) for (int k = ITEM; k < (n); k += ITEMS) // those of 0 .. n - 1 that this item does
#define INLINED static inline __attribute__((always_inline)) // what a call would keep in memory stays in registers

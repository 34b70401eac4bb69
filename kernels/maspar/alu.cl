// SPDX-License-Identifier: BSD-3-Clause
// An instruction of the PEs' arithmetic unit: word c becomes an operation of words a and b, or of a and a number that
// the ACU broadcasts. The operations have the numbers of simdtex.maspar.instructions.OPERATIONS.
#pragma OPENCL FP_CONTRACT OFF
#include "maspar/layout.h"

__kernel void maspar_alu(ARRAY, const int operation, PLURAL(TO, c), PLURAL(const T, a), PLURAL(const T, b),
                         const int singular, const T number)
{
    WHERE_ACTIVE(pe, k) {
        const T x = OF(a, k), y = singular ? number : OF(b, k);
        TO z = (TO)x;
        switch (operation) {
        case 1: z = (TO)(x + y); break;
        case 2: z = (TO)(x - y); break;
        case 3: z = (TO)(x * y); break;
        case 4: z = (TO)(x < y); break;
        case 5: z = (TO)(x <= y); break;
        case 6: z = (TO)(x == y); break;
        case 7: z = (TO)(x != y); break;
        case 8: z = (TO)(x > y); break;
        case 9: z = (TO)(x >= y); break;
        case 10: z = (TO)y; break;
#ifdef WHOLE
        case 11: z = (TO)((x - (x % y + y) % y) / y); break; // rounded down, as in Python
        case 12: z = (TO)((x % y + y) % y); break;
        case 13: z = (TO)(x & y); break;
        case 14: z = (TO)(x | y); break;
        case 15: z = (TO)(x >> y); break;
        case 16: z = (TO)(x < 64 ? (T)1 << x : 0); break;
        case 17: z = (TO)popcount(x & ~(x + 1)); break; // number of the lowest bit that is 0
        case 18: z = (TO)mul_hi(x, y); break; // x as a fraction of y
#endif
        }
        OF(c, k) = z;
    }
}

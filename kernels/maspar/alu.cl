// SPDX-License-Identifier: BSD-3-Clause
// An instruction of the PEs' arithmetic unit: word w of c becomes an operation of a word of a and a word of b, or of a word
// of a and a number that the ACU broadcasts (b_size 0). PEs outside the mask change nothing.
//
// A variable has c_size words of each PE and layer, mask (layers, PEs) is 1 where a PE is active. The operations have the
// numbers of simdtex.maspar.instructions.OPERATIONS.
#pragma OPENCL FP_CONTRACT OFF
#include "maspar/layout.h"

__kernel void maspar_alu(const Layout g, __global const uchar *restrict mask, const int operation, __global TO *c,
                         const int c_size, const int c_word, __global const T *a, const int a_size, const int a_word,
                         __global const T *b, const int b_size, const int b_word, const T number)
{
    const int pe = get_global_id(0);
    if (pe >= PES(g))
        return;
    for (int k = pe; k < LAYERS(g) * PES(g); k += PES(g)) {
        if (!mask[k])
            continue;
        const T x = a[k * a_size + a_word], y = b_size ? b[k * b_size + b_word] : number;
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
        c[k * c_size + c_word] = z;
    }
}

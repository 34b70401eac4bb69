// SPDX-License-Identifier: BSD-3-Clause
// All kernels of the processor array have one work-item for each PE. A PE holds one pixel in each virtual layer; mask
// (layers, PEs) is 1 where it is active. PEs outside the mask change nothing.

// simdtex.maspar.machine.LAYOUT is the same.
typedef struct {
    int rows, cols; // PEs
    int high, wide; // virtual layers by rows and by columns
    int blocks;     // whether the mapping is hierarchical: blocks of high x wide pixels on each PE
    int begin, end; // the layers that execute the instruction, up to `end` - 1
} Layout;

#define PES(g) ((g).rows * (g).cols)

// The first arguments of every kernel; then plural variables (layers, PEs, size), and tables of the ACU (..., size).
#define ARRAY const Layout g, __global const uchar *restrict mask
#define PLURAL(TYPE, x) __global TYPE *x, const int x##_size, const int x##_word
#define TABLE(TYPE, x) __global const TYPE *restrict x, const int x##_size

// Executes a statement for PE `pe` in one layer after another, wherever it is active; its address in a variable is `k`.
#define WHERE_ACTIVE(pe, k)                                                                                    \
    for (int pe = get_global_id(0), k = g.begin * PES(g) + pe; pe < PES(g) && k < g.end * PES(g); k += PES(g)) \
        if (mask[k])

#define OF(x, k) x[(size_t)(k) * x##_size + x##_word]

// Row and column of the pixel in a layer of a PE, in the picture padded to whole layers.
static inline int2 pixel_of(const Layout g, const int layer, const int pe)
{
    const int2 at = (int2)(pe / g.cols, pe % g.cols), n = (int2)(layer / g.wide, layer % g.wide);
    return g.blocks ? at * (int2)(g.high, g.wide) + n : n * (int2)(g.rows, g.cols) + at;
}

// The address of a pixel among the values of a variable: layer * PEs + PE.
static inline int address_of(const Layout g, const int2 pixel)
{
    const int2 by = g.blocks ? (int2)(g.high, g.wide) : (int2)(g.rows, g.cols), q = pixel / by, r = pixel % by;
    const int2 layer = g.blocks ? r : q, at = g.blocks ? q : r;
    return (layer.x * g.wide + layer.y) * PES(g) + at.x * g.cols + at.y;
}

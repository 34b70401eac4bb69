// SPDX-License-Identifier: BSD-3-Clause
// The places of a picture's pixels on a processor array: each PE holds one pixel in each virtual layer. A kernel has one
// work-item for each PE, which loops over the layers from `first` to `last` - 1 where it has these arguments.
#ifndef SIMDTEX_LAYOUT_H
#define SIMDTEX_LAYOUT_H

// simdtex.maspar.instructions.LAYOUT is the same.
typedef struct {
    int rows, cols; // PEs
    int high, wide; // virtual layers by rows and by columns
    int blocks;     // whether the mapping is hierarchical: blocks of high x wide pixels on each PE
} Layout;

#define PES(g) ((g).rows * (g).cols)
#define LAYERS(g) ((g).high * (g).wide)

// Row and column of the pixel in a layer of a PE, in the picture padded to whole layers.
inline int2 pixel_of(const Layout g, const int layer, const int pe)
{
    const int2 at = (int2)(pe / g.cols, pe % g.cols), n = (int2)(layer / g.wide, layer % g.wide);
    return g.blocks ? at * (int2)(g.high, g.wide) + n : n * (int2)(g.rows, g.cols) + at;
}

// The address of a pixel among the values of a variable: layer * PEs + PE.
inline int address_of(const Layout g, const int2 pixel)
{
    const int2 by = g.blocks ? (int2)(g.high, g.wide) : (int2)(g.rows, g.cols), q = pixel / by, r = pixel % by;
    const int2 layer = g.blocks ? r : q, at = g.blocks ? q : r;
    return (layer.x * g.wide + layer.y) * PES(g) + at.x * g.cols + at.y;
}

#endif

// SPDX-License-Identifier: BSD-3-Clause
// The lattice of one level, equations (10) and (11), or a window of it: an array of sites with a shape and an origin. Site
// (i, j) has number i * cols + j. A volume (-D AXES=3) is a stack of layers, one below another, and so is its lattice: row
// i of it is row i % rows of layer i / rows.

#ifndef AXES
#define AXES 2
#endif

// simdtex.model.lattice.LATTICE is the same; tests/methods/mrf/test_level.py holds the one against the other.
typedef struct {
    int layers, rows, cols;                      // sites; a picture has one layer
    int around_layers, around_rows, around_cols; // whether the axis wraps around
    int front, top, left;                        // the first site's place in the whole lattice
    int whole_layers, whole_rows, whole_cols;    // sites of the whole lattice
    int step;                                    // pixels of the output from site to site
    int picture_rows, picture_cols;              // pixels of the output, or of a layer
    int tile_rows, tile_cols;                    // where > 0, what lies in another tile is read
    int elsewhere;                               // so many sites on, where an older picture stands
    ulong begin;                                 // the pixel of the output at site (0, 0) of the whole lattice
} Lattice;

// An offset (AXES,) in layers, rows and columns.
#define LAYERS(offset) (AXES > 2 ? (offset)[0] : 0)
#define DOWN(offset) (offset)[AXES - 2]
#define RIGHT(offset) (offset)[AXES - 1]

static inline int wrap(const int i, const int n)
{
    if (i >= 0 && i < n) // nearly always, and a division takes long
        return i;
    const int k = i % n;
    return k < 0 ? k + n : k;
}

// The pixel of the output at site (i, j): what keys its random numbers.
static inline ulong place_of(const Lattice g, const int i, const int j)
{
    const ulong layer = AXES > 2 ? wrap(g.front + i / g.rows, g.whole_layers) : 0;
    const ulong row = wrap(g.top + (AXES > 2 ? i % g.rows : i), g.whole_rows), col = wrap(g.left + j, g.whole_cols);
    return g.begin + ((layer * g.picture_rows + row) * g.picture_cols + col) * g.step;
}

// Number of the neighbour of site (i, j) at an offset, equation (3). -1 outside an open lattice or a window, and where a
// small torus wraps the offset back onto the site itself.
static inline int neighbour_at(const Lattice g, const int i, const int j, const int layers, const int down, const int right)
{
    const int layer = AXES > 2 ? i / g.rows : 0, row = AXES > 2 ? i % g.rows : i;
    int n = layer + layers, k = row + down, l = j + right;
    n = g.around_layers ? wrap(n, g.layers) : n;
    k = g.around_rows ? wrap(k, g.rows) : k;
    l = g.around_cols ? wrap(l, g.cols) : l;
    if (n < 0 || n >= g.layers || k < 0 || k >= g.rows || l < 0 || l >= g.cols || (n == layer && k == row && l == j))
        return -1;
    const bool apart = g.tile_rows > 0 && (row / g.tile_rows != k / g.tile_rows || j / g.tile_cols != l / g.tile_cols);
    return (n * g.rows + k) * g.cols + l + (apart ? g.elsewhere : 0);
}

static inline int neighbour(const Lattice g, const int i, const int j, __global const int *offset)
{
    return neighbour_at(g, i, j, LAYERS(offset), DOWN(offset), RIGHT(offset));
}

// SPDX-License-Identifier: BSD-3-Clause
// The lattice of one level, equations (10) and (11): sites (spacing * i, spacing * j) of a picture that is `width`
// pixels wide, 0 <= i < rows, 0 <= j < cols. Images stay at full size; a level only reads through it. Or a window of
// such a lattice, which lies in a picture of its own, site by site. A volume is a stack of layers, one below another, and
// so is its lattice: row i of it is row i % high of layer i / high. Volumes are open, and have no windows.
#ifndef SIMDTEX_LATTICE_H
#define SIMDTEX_LATTICE_H

// simdtex.model.lattice.LATTICE is the same; tests/test_level.py holds the one against the other.
typedef struct {
    int rows, cols;               // sites
    int spacing, width;           // pixels from site to site, and to a row
    int around_rows, around_cols; // whether rows and columns wrap around
    int tile_rows, tile_cols;     // where > 0, what lies in another tile is read
    int elsewhere;                // so many pixels on, where an older picture stands
    int top, left;                // the first site's row and column in the whole lattice
    int whole_rows, whole_cols;   // sites of the whole lattice
    int step, whole_width;        // pixels of the whole picture from site to site, and to a row
    int layers, high, height;     // layers of sites, 1 of a picture; rows of sites to a layer, and of pixels
} Lattice;

// The row of pixels that row i of a lattice is, and back.
inline int pixel_row(const Lattice g, const int i)
{
    return g.layers > 1 ? (i / g.high * g.height + i % g.high) * g.spacing : i * g.spacing;
}

inline int lattice_row(const Lattice g, const int row)
{
    return g.layers > 1 ? row / g.height / g.spacing * g.high + row % g.height / g.spacing : row / g.spacing;
}

// Pixel index of site (i, j), and back.
#define SITE(g, i, j) (pixel_row(g, i) * (g).width + (j) * (g).spacing)
#define ROW_OF(g, site) lattice_row(g, (site) / (g).width)
#define COL_OF(g, site) ((site) % (g).width / (g).spacing)

// Layers of an offset (layers * 2^16 + rows, columns).
#define LAYERS(down) (((down) + 0x8000) >> 16)

inline int wrap(const int i, const int n)
{
    if (i >= 0 && i < n) // nearly always, and a division takes long
        return i;
    const int k = i % n;
    return k < 0 ? k + n : k;
}

// The place of site (i, j) in the whole picture, as a pixel index: what keys its random numbers.
inline ulong place_of(const Lattice g, const int i, const int j)
{
    if (g.layers > 1)
        return SITE(g, i, j);
    const ulong row = wrap(g.top + i, g.whole_rows), col = wrap(g.left + j, g.whole_cols);
    return (row * (ulong)g.whole_width + col) * (ulong)g.step;
}

// Pixel index of the neighbour of site (i, j) at offset (di, dj), equation (3). -1 outside an open lattice or a window,
// and where a small torus wraps the offset back onto the site itself.
inline int neighbour(const Lattice g, const int i, const int j, const int di, const int dj)
{
    if (g.layers > 1) {
        const int up = LAYERS(di), layer = i / g.high + up, row = i % g.high + di - (up << 16), col = j + dj;
        return layer < 0 || layer >= g.layers || row < 0 || row >= g.high || col < 0 || col >= g.cols
                   ? -1
                   : SITE(g, layer * g.high + row, col);
    }
    const int k = g.around_rows ? wrap(i + di, g.rows) : i + di;
    const int l = g.around_cols ? wrap(j + dj, g.cols) : j + dj;
    if (k < 0 || k >= g.rows || l < 0 || l >= g.cols || (k == i && l == j))
        return -1;
    const bool apart = g.tile_rows > 0 && (i / g.tile_rows != k / g.tile_rows || j / g.tile_cols != l / g.tile_cols);
    return apart ? SITE(g, k, l) + g.elsewhere : SITE(g, k, l);
}

#endif

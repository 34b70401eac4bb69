// SPDX-License-Identifier: BSD-3-Clause
// The lattice of one level, equations (10) and (11): sites (spacing * i, spacing * j) of a picture that is
// `width` pixels wide, 0 <= i < rows, 0 <= j < cols. Images stay at full size; a level only reads through it.
#ifndef SIMDTEX_LATTICE_H
#define SIMDTEX_LATTICE_H

// The numbers every lattice kernel takes, in this order. Where tile_rows > 0, the lattice is cut into tiles, and what lies
// in another tile is read `elsewhere` pixels on, where an older picture stands; commit writes here only.
#define GRID                                                                                                           \
    const int rows, const int cols, const int spacing, const int width, const int torus, const int tile_rows,          \
        const int tile_cols, const int elsewhere
#define HERE rows, cols, spacing, width, torus, tile_rows, tile_cols, elsewhere
#define FLAT rows, cols, 1, cols, torus, 0, 0, 0 // the level's grid as a lattice of its own

// Pixel index of grid site (i, j).
#define SITE(i, j) (((i) * width + (j)) * spacing)
#define ROW_OF(site) ((site) / width / spacing)
#define COL_OF(site) ((site) % width / spacing)

inline int wrap(const int i, const int n)
{
    if (i >= 0 && i < n) // nearly always, and a division takes long
        return i;
    const int k = i % n;
    return k < 0 ? k + n : k;
}

// Pixel index of the neighbour of grid site (i, j) at grid offset (di, dj), equation (3).
// -1 outside an open lattice, and where a small torus wraps the offset back onto the site itself.
inline int neighbour(const int i, const int j, const int di, const int dj, GRID)
{
    int k = i + di, l = j + dj;
    if (torus) {
        k = wrap(k, rows);
        l = wrap(l, cols);
    } else if (k < 0 || k >= rows || l < 0 || l >= cols)
        return -1;
    if (k == i && l == j)
        return -1;
    const bool apart = tile_rows > 0 && (i / tile_rows != k / tile_rows || j / tile_cols != l / tile_cols);
    return apart ? SITE(k, l) + elsewhere : SITE(k, l);
}

#endif

// SPDX-License-Identifier: BSD-3-Clause
#include "common/philox.h"

#ifndef FEATURES
#define FEATURES 9 // of a node
#endif
#define MOST 32 // levels

// The candidates of a pixel and a draw of one of them, De Bonet's equations (8) to (12).
//
// Nodes are the pixels of the levels above the one that is sampled. A pixel's parent structure, equation (8), is made
// of the features of the nodes above it. The output's lattice is made of tiles, each laid out like the sample's.
//
// analysis   (levels,)          of the sample's pyramid: rows, columns, where the level begins in `features`, and whether
//                               its last row (1) and column (2) stand for fewer pixels of the sample than the others
// features   (nodes, FEATURES)  level after level
// threshold  (levels, FEATURES) the largest difference that passes, the square root of T Z in (9) to (11)
// synthesis  (levels,)          of the output's pyramid: rows, columns, where the level begins in `source` and `counts`
// source     (pixels,)          the pixel of the sample's level that each was copied from; those of the levels above are
//                               read, those of this level are written
// counts     (pixels, 2) out    candidates of each pixel, and nodes it was compared with to find them

typedef struct {
    int level, top, match;
    __global const int4 *analysis;
    __global const int *features;
    __global const uint *threshold;
    int own[MOST];  // the pixel's own parent structure: for each level the node in `features`
    int rows, cols; // of the lowest nodes those that may stand for the pixel's parent
} Parents;

// Equations (9) to (11) for the features of one level: no component differs by more than its threshold.
inline bool similar(const Parents *own, const int level, const int node)
{
    __global const int *u = own->features + node * FEATURES, *v = own->features + own->own[level] * FEATURES;
    __global const uint *most = own->threshold + level * FEATURES;
    for (int m = 0; m < FEATURES; ++m)
        if (abs_diff(u[m], v[m]) > most[m])
            return false;
    return true;
}

// Goes through the nodes from the top down. Parents are compared before their children, so one that fails rejects all
// that is below it. What is left in the lowest level of nodes gives candidates: its children, or, with `match`, the one
// child in the pixel's own place among its siblings, from a node that has all the pixels below it that the pixel's parent
// has. Stops at candidate number `wanted`, whose node is then (row, col) and which is its child number `child`. Returns
// how many candidates came before, and counts the nodes compared.
inline int scan(const Parents *own, const int wanted, int *row, int *col, int *child, int *compared)
{
    int count = 0, level = own->top, r = 0, c = 0;
    int4 lattice = own->analysis[level];
    *compared = 0;
    for (;;) {
        ++*compared;
        if (similar(own, level, lattice.z + r * lattice.y + c)) {
            if (level > own->level + 1) { // on to the first child
                lattice = own->analysis[--level];
                r *= 2;
                c *= 2;
                continue;
            }
            const int4 below = own->analysis[own->level];
            const int children =
                own->match ? r < own->rows && c < own->cols : min(2, below.x - 2 * r) * min(2, below.y - 2 * c);
            if (wanted - count < children) {
                *row = r;
                *col = c;
                *child = wanted - count;
                return wanted;
            }
            count += children;
        }
        // On to the next sibling, or to that of the nearest ancestor that has one. All nodes of the top are siblings.
        for (; level < own->top; r /= 2, c /= 2) {
            const int next_col = !(c & 1) && c + 1 < lattice.y, next_row = !(r & 1) && r + 1 < lattice.x;
            if (next_col || next_row) {
                c = next_col ? c + 1 : c & ~1;
                r += next_col ? 0 : 1;
                break;
            }
            lattice = own->analysis[++level];
        }
        if (level == own->top && ++c == lattice.y) {
            c = 0;
            if (++r == lattice.x)
                return count;
        }
    }
}

// The parent structure of pixel (i, j).
inline void find_parents(Parents *own, __global const int4 *synthesis, __global const int *source, const int i,
                         const int j)
{
    const int4 tile = own->analysis[own->level];
    for (int k = own->level + 1; k <= own->top; ++k) {
        const int4 above = own->analysis[k], there = synthesis[k];
        const int up = k - own->level;
        const int r = i / tile.x * above.x + (i % tile.x >> up), c = j / tile.y * above.y + (j % tile.y >> up);
        own->own[k] = above.z + source[there.z + r * there.y + c];
    }
    const int4 above = own->analysis[own->level + 1];
    const int last_row = above.x - 1, last_col = above.y - 1;
    own->rows = above.w & 1 && i % tile.x / 2 != last_row ? last_row : above.x;
    own->cols = above.w & 2 && j % tile.y / 2 != last_col ? last_col : above.y;
}

// The size of C_i, (9), for the pixels first .. end-1 of a level. One work-item per pixel; siblings have the same
// parents, so the first of them counts for all.
__kernel void candidates_count(const int level, const int top, const int match, __global const int4 *restrict analysis,
                               __global const int *restrict features, __global const uint *restrict threshold,
                               __global const int4 *restrict synthesis, const int first, const int end,
                               __global const int *restrict source, __global int2 *restrict counts)
{
    const int4 here = synthesis[level], tile = analysis[level];
    const int s = first + get_global_id(0);
    if (s >= end)
        return;
    const int i = s / here.y, j = s % here.y, p = i % tile.x, q = j % tile.y;
    const int top_row = i - (p & 1), left = j - (q & 1);
    const int rows = min(min(2, tile.x - (p & ~1)), here.x - top_row); // of siblings
    const int cols = min(min(2, tile.y - (q & ~1)), here.y - left);
    for (int k = 0; k < rows * cols; ++k) {
        const int sibling = (top_row + k / cols) * here.y + left + k % cols;
        if (sibling >= first && sibling < s)
            return;
    }
    Parents own = {level, top, match, analysis, features, threshold};
    find_parents(&own, synthesis, source, i, j);
    int row, col, child, compared;
    const int count = scan(&own, INT_MAX, &row, &col, &child, &compared);
    for (int k = 0; k < rows * cols; ++k) {
        const int sibling = (top_row + k / cols) * here.y + left + k % cols;
        if (sibling >= s && sibling < end)
            counts[here.z + sibling] = (int2)(count, compared);
    }
}

// A uniform draw from C_i, (12), by its number in the order of the scan: no list is kept. One work-item per pixel.
__kernel void candidates_draw(const ulong seed, const int level, const int top, const int match,
                              __global const int4 *restrict analysis, __global const int *restrict features,
                              __global const uint *restrict threshold, __global const int4 *restrict synthesis,
                              const int first, const int end, __global int *restrict source,
                              __global const int2 *restrict counts)
{
    const int4 here = synthesis[level], tile = analysis[level];
    const int s = first + get_global_id(0);
    if (s >= end)
        return;
    const int i = s / here.y, j = s % here.y, p = i % tile.x, q = j % tile.y;
    Parents own = {level, top, match, analysis, features, threshold};
    find_parents(&own, synthesis, source, i, j);
    const uint4 bits = draw4(seed, level, 0, s, PURPOSE_DRAW, 0);
    int row = 0, col = 0, child = 0, compared;
    scan(&own, below(bits.x, bits.y, counts[here.z + s].x), &row, &col, &child, &compared);
    const int wide = min(2, tile.y - 2 * col);
    row = 2 * row + (match ? p & 1 : child / wide);
    col = 2 * col + (match ? q & 1 : child % wide);
    source[here.z + s] = row * tile.y + col;
}

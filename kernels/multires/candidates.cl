// SPDX-License-Identifier: BSD-3-Clause
#include "common/philox.h"

#ifndef FEATURES
#define FEATURES 9 // of a node
#endif
#define MOST 32 // levels
#ifndef NOTES
#define NOTES 32 // places of a scan that are noted, an even number
#endif

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
    int level, top;
    __global const int4 *analysis;
    __global const int *features;
    __global const uint *threshold;
    int own[MOST]; // the pixel's own parent structure: for each level the node in `features`
    int stop;      // the lowest level whose nodes need be compared: those of the levels between all pass
    int down;      // levels from there to the leaves, each of which stands for one candidate
    int2 leaves;   // rows and columns of leaves there are
} Parents;

typedef struct {
    int level, row, col;
    uchar left[MOST]; // of each level, which of the siblings here pass and are still to be visited, a bit for each
} Place;

// Equations (9) to (11) for the features of one level: no component differs by more than its threshold. Of four nodes
// at a time, a bit for each, to the end: that is quicker than a branch for each feature.
static inline uint similar(const Parents *own, const int level, const int4 node)
{
    __global const int *a = own->features + node.x * FEATURES, *b = own->features + node.y * FEATURES;
    __global const int *c = own->features + node.z * FEATURES, *d = own->features + node.w * FEATURES;
    __global const int *v = own->features + own->own[level] * FEATURES;
    __global const uint *most = own->threshold + level * FEATURES;
    uint fails = 0;
    for (int m = 0; m < FEATURES; ++m)
        fails |= (abs_diff(a[m], v[m]) > most[m]) | (abs_diff(b[m], v[m]) > most[m]) << 1 |
                 (abs_diff(c[m], v[m]) > most[m]) << 2 | (abs_diff(d[m], v[m]) > most[m]) << 3;
    return ~fails & 15;
}

// Which of the siblings at a place pass, row by row.
static inline uint siblings(const Parents *own, const int level, const int row, const int col, int *compared)
{
    const int4 lattice = own->analysis[level];
    const int first = lattice.z + (row & ~1) * lattice.y + (col & ~1);
    const int right = (col | 1) < lattice.y, below = (row | 1) < lattice.x; // else there is none, and a bit is dropped
    const int4 node = first + (int4)(0, right, below * lattice.y, below * lattice.y + right);
    *compared += (1 + right) * (1 + below);
    return similar(own, level, node) & (right ? 15 : 5) & (below ? 15 : 3);
}

// From a place on to the next node that passes where the scan stops, and false if there is none. The scan goes from the
// top down. Parents are compared before their children, so one that fails rejects all that is below it.
static inline bool next(const Parents *own, Place *at, int *compared)
{
    for (;;) {
        if (at->level == own->top) { // whose nodes are siblings
            const int4 lattice = own->analysis[own->top];
            if (++at->col == lattice.y) {
                at->col = 0;
                ++at->row;
            }
            if (at->row == lattice.x)
                return false;
            ++*compared;
            if (!similar(own, at->level, (int4)(lattice.z + at->row * lattice.y + at->col)))
                continue;
        } else {
            const uint left = at->left[at->level];
            if (!left) { // back to the parent
                ++at->level;
                at->row /= 2;
                at->col /= 2;
                continue;
            }
            const int child = popcount((left & -left) - 1); // the first
            at->left[at->level] = left & (left - 1);
            at->row = (at->row & ~1) + child / 2;
            at->col = (at->col & ~1) + child % 2;
        }
        if (at->level == own->stop)
            return true;
        --at->level; // on to the children
        at->row *= 2;
        at->col *= 2;
        at->left[at->level] = siblings(own, at->level, at->row, at->col, compared);
    }
}

// To a node where the scan stops, as if it had come there from the beginning.
static inline void resume(const Parents *own, Place *at, const int2 node)
{
    int ignored;
    at->level = own->stop;
    at->row = node.x;
    at->col = node.y;
    for (int k = own->stop, r = node.x, c = node.y; k < own->top; ++k, r /= 2, c /= 2)
        at->left[k] = siblings(own, k, r, c, &ignored) & (14 << 2 * (r & 1) + (c & 1));
}

// How many of a level's rows, or columns, are `down` levels below number k.
static inline int beneath(const int k, const int down, const int rows)
{
    return max(0, min(rows - (k << down), 1 << down));
}

// Candidates below a node so many levels above the leaves.
static inline int candidates_below(const Parents *own, const int row, const int col, const int down)
{
    return beneath(row, down, own->leaves.x) * beneath(col, down, own->leaves.y);
}

// What the scan needs to know of pixel (i, j); it is the same for its siblings.
static inline void find_parents(Parents *own, __global const int4 *synthesis, __global const int *source, const int match,
                                const int i, const int j)
{
    const int level = own->level;
    const int4 tile = own->analysis[level], above = own->analysis[level + 1];
    const int number_i = i / tile.x, number_j = j / tile.y, p = i % tile.x, q = j % tile.y;
    for (int k = level + 1; k <= own->top; ++k) {
        const int4 lattice = own->analysis[k], there = synthesis[k];
        const int r = number_i * lattice.x + (p >> k - level), c = number_j * lattice.y + (q >> k - level);
        own->own[k] = lattice.z + source[there.z + r * there.y + c];
    }
    for (own->stop = level + 1; own->stop < own->top; ++own->stop) {
        uint least = UINT_MAX;
        for (int m = 0; m < FEATURES; ++m)
            least = min(least, own->threshold[own->stop * FEATURES + m]);
        if (least < UINT_MAX)
            break;
    }
    // With `match` a node has one child in the pixel's place, but at an edge only if all those the pixel's parent has.
    own->down = own->stop - level - match;
    const int2 whole = (int2)(above.x - (above.w & 1 && p / 2 != above.x - 1),
                              above.y - (above.w & 2 && q / 2 != above.y - 1));
    own->leaves = match ? whole : tile.xy;
}

// The size of C_i, (9), for the pixels first .. end-1 of a level, and a uniform draw from C_i, (12), by its number in
// the order of the scan. Siblings have the same parents, so a work-item makes one scan for up to four of them, and goes
// on to the siblings `items` further. No list of candidates is kept: every so many places of the scan are noted, half as
// many as soon as the notes are full, and a draw goes on from the last one before it.
__kernel void candidates(const ulong seed, const int level, const int top, const int match,
                         __global const int4 *restrict analysis, __global const int *restrict features,
                         __global const uint *restrict threshold, __global const int4 *restrict synthesis,
                         const int first, const int end, const int items, __global int *source,
                         __global int2 *restrict counts)
{
    if (get_global_id(0) >= items)
        return;
    const int4 here = synthesis[level], tile = analysis[level];
    const int2 parents = (tile.xy + 1) / 2, tiles = here.xy / tile.xy;
    const int first_row = first / here.y, last_row = (end - 1) / here.y;
    const int begin = first_row / tile.x * parents.x + first_row % tile.x / 2;
    const int rows = last_row / tile.x * parents.x + last_row % tile.x / 2 - begin + 1;
    const int across = tiles.y * parents.y + (here.y % tile.y + 1) / 2;
    Parents own = {level, top, analysis, features, threshold};
    for (int group = get_global_id(0); group < rows * across; group += items) {
        const int a = begin + group / across, b = group % across;
        const int i = a / parents.x * tile.x + a % parents.x * 2, j = b / parents.y * tile.y + b % parents.y * 2;
        find_parents(&own, synthesis, source, match, i, j);

        Place at = {top, 0, -1};
        int2 noted[NOTES];
        int before[NOTES], notes = 0, stride = 1, seen = 0, count = 0, compared = 0;
        while (next(&own, &at, &compared)) {
            for (int k = level + 1; k < own.stop; ++k)
                compared += beneath(at.row, own.stop - k, analysis[k].x) * beneath(at.col, own.stop - k, analysis[k].y);
            const int found = candidates_below(&own, at.row, at.col, own.down);
            if (!found)
                continue;
            if (seen++ % stride == 0) {
                if (notes == NOTES) {
                    for (notes = 1; notes < NOTES / 2; ++notes) {
                        noted[notes] = noted[2 * notes];
                        before[notes] = before[2 * notes];
                    }
                    stride *= 2;
                }
                noted[notes] = (int2)(at.row, at.col);
                before[notes++] = count;
            }
            count += found;
        }

        const int siblings_i = min(min(2, tile.x - i % tile.x), here.x - i);
        const int siblings_j = min(min(2, tile.y - j % tile.y), here.y - j);
        for (int k = 0; k < siblings_i * siblings_j; ++k) {
            const int down = k / siblings_j, along = k % siblings_j, s = (i + down) * here.y + j + along;
            if (s < first || s >= end)
                continue;
            counts[here.z + s] = (int2)(count, compared);
            int wanted = 0, note = notes - 1, ignored;
            if (count > 1) {
                const uint4 bits = draw4(seed, level, 0, s, PURPOSE_DRAW, 0);
                wanted = below(bits.x, bits.y, count);
            }
            while (before[note] > wanted)
                --note;
            int row = noted[note].x, col = noted[note].y, found = candidates_below(&own, row, col, own.down);
            wanted -= before[note];
            if (wanted >= found)
                resume(&own, &at, noted[note]);
            while (wanted >= found) {
                wanted -= found;
                next(&own, &at, &ignored);
                row = at.row;
                col = at.col;
                found = candidates_below(&own, row, col, own.down);
            }
            for (int above = own.down - 1; above >= 0; --above) // on to the leaf
                for (int child = 0;; ++child) {
                    const int r = 2 * row + child / 2, c = 2 * col + child % 2;
                    found = candidates_below(&own, r, c, above);
                    if (wanted < found) {
                        row = r;
                        col = c;
                        break;
                    }
                    wanted -= found;
                }
            if (match) {
                row = 2 * row + down;
                col = 2 * col + along;
            }
            source[here.z + s] = row * tile.y + col;
        }
    }
}

// SPDX-License-Identifier: BSD-3-Clause
// What stays the same for all relaxations of a level. simdtex.methods.mrf.relax.LEVEL is the same; tests/methods/mrf/test_level.py holds the
// one against the other.
#include "common/lattice.h"

typedef struct {
    Lattice lattice;
    ulong seed;                   // keys of random numbers
    uint level;
    int area;                     // pixels to a channel of the field
    int neighbours;               // N
    int pixels;                   // of the sample with its margin
    int candidates;               // of the level
    int chance;                   // candidates at random
    int plane, row_stride, layer_stride; // of the sample with its columns side by side: pixels to a channel, a row, a layer
    int cols, runs;               // of candidates: columns, and runs of a row whose columns lie side by side in `levels`
    float discount;               // 1 / (1 + coherence)
    float scale, spread;          // 1 / 2h^2 of equation (7), and 2h^2 where a site draws, else 0
    int radius;                   // of its kernel over grey levels; -1 where a pixel is the sample's own
    int top;                      // highest legal grey level
    int xi;                       // of equation (13), in 1/1024
    float novelty;                // what a candidate costs for each neighbour that it continues
    float centre;                 // confidence of a guide at the site itself
    float hard;                   // confidence of hard data
    float centre_known;           // confidence of a known variable at the site itself
} Level;

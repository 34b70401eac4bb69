// SPDX-License-Identifier: BSD-3-Clause
#include "common/lattice.h"
#include "common/philox.h"

// Steps 2 and 5 of Algorithm 1, the beginning of a level: a site of the level above keeps what it is, every other site
// takes a pixel of the sample at random, at temperature 1. If the level above has a sample of half the size, each site
// takes the pixel of this sample in the square of the pixel that the site of the level above has, at temperature 0; none
// (-1) if that has none, since its value is given.
//
// sample (C, plane) working grey levels; pixels (count,) pixel indices in it to take from
// above_values (C, above), above_source, above_temperature   the sites of the level above, `above_cols` to a row, without
//                          older pictures; `above` from channel to channel; 0 columns: there is no level above
// squares                  the first pixel of each pixel's square, for each pixel of the sample of half the size, -1 if
//                          no site has it, and `cols` pixels to a row of this sample; 0: the level above has the same
// values (C, sites), source (sites,), temperature (sites,) in 1/1024  out
// One work-item per site.
__kernel void start(const ulong seed, __global const float *restrict sample, const int plane, const int channels,
                    __global const int *restrict pixels, const int count, const Lattice g,
                    __global const ushort *restrict above_values, __global const int *restrict above_source,
                    __global const ushort *restrict above_temperature, const int above, const int above_rows,
                    const int above_cols, __global const int *restrict squares, const int cols,
                    __global ushort *restrict values, __global int *restrict source,
                    __global ushort *restrict temperature)
{
    const int s = get_global_id(0), sites = g.layers * g.rows * g.cols;
    if (s >= sites)
        return;
    const int i = s / g.cols, j = s % g.cols, layer = AXES > 2 ? i / g.rows : 0, row = AXES > 2 ? i % g.rows : i;
    const int down = (g.top + row) % 2, right = (g.left + j) % 2; // from the site of the level above
    const int r = (layer / 2 * above_rows + (g.top + row) / 2 - g.top / 2) * above_cols + (g.left + j) / 2 - g.left / 2;
    int from;
    if (cols > 0) {
        const int pixel = above_source[r], square = pixel < 0 ? -1 : squares[pixel];
        from = square < 0 ? -1 : square + down * cols + right;
    } else if (above_cols > 0 && (g.front + layer) % 2 == 0 && !down && !right) {
        source[s] = above_source[r];
        temperature[s] = above_temperature[r];
        for (int c = 0; c < channels; ++c)
            values[c * sites + s] = above_values[c * above + r];
        return;
    } else {
        const uint4 bits = draw4(seed, 0, 0, place_of(g, i, j), PURPOSE_START, 0);
        from = pixels[below(bits.x, bits.y, count)];
    }
    source[s] = from;
    temperature[s] = cols > 0 ? 0 : 1024;
    for (int c = 0; c < channels; ++c)
        values[c * sites + s] = from < 0 ? 0 : (ushort)sample[c * plane + from];
}

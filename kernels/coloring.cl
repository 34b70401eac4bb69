// SPDX-License-Identifier: BSD-3-Clause
// Sites that relax together, equation (14): the colour of each site, and the list of the sites colour by colour. No two
// sites of a colour of the schedule `coloring` are neighbours. Other schedules have groups, as other patterns.
#include "common/lattice.h"

// The colour of each site: a formula of its place in the whole lattice,
//
//   (layers layer + rows row + cols floor(col / width)) mod period * width + col mod width
//
// For a coset of the sublattice spanned by (period, 0) and (b, width), row and column, rows = 1 and cols = -b mod period.
//
// names  (named,)  the number of each colour among those that occur; none: its own
// colors (sites,)  out
// One work-item per site.
__kernel void coloring_sites(const Lattice g, const int layers, const int rows, const int cols, const int period,
                             const int width, __global const int *restrict names, const int named,
                             __global int *restrict colors)
{
    const int site = get_global_id(0), area = g.rows * g.cols;
    if (site >= g.layers * area)
        return;
    const ulong layer = wrap(g.front + site / area, g.whole_layers);
    const ulong row = wrap(g.top + site % area / g.cols, g.whole_rows), col = wrap(g.left + site % g.cols, g.whole_cols);
    const ulong turned = layer * layers + row * rows + col / width * cols;
    const int color = (int)(turned % period * width + col % width);
    colors[site] = named ? names[color] : color;
}

// The colours of the sites along the seam of a torus that cuts through the pattern, as far as they lie in the window.
//
// seam (n,)  their places in the whole lattice, row by row; own (n,)  their colours
// One work-item per place.
__kernel void coloring_seam(const Lattice g, __global const long *restrict seam, __global const int *restrict own,
                            const int n, __global int *restrict colors)
{
    const int k = get_global_id(0);
    if (k >= n)
        return;
    const int i = wrap((int)(seam[k] / g.whole_cols) - g.top, g.whole_rows);
    const int j = wrap((int)(seam[k] % g.whole_cols) - g.left, g.whole_cols);
    if (i < g.rows && j < g.cols)
        colors[i * g.cols + j] = own[k];
}

// How many sites of each run, `length` sites row by row, have each colour. Colours outside 0 .. count - 1 are left out.
//
// colors (sites,)
// counts (count, runs)  out
// One work-item per run.
__kernel void coloring_count(__global const int *restrict colors, const int sites, const int length, const int runs,
                             const int count, __global int *restrict counts)
{
    const int r = get_global_id(0);
    if (r >= runs)
        return;
    for (int color = 0; color < count; ++color)
        counts[color * runs + r] = 0;
    for (int site = r * length; site < min(sites, (r + 1) * length); ++site)
        if (colors[site] >= 0 && colors[site] < count)
            ++counts[colors[site] * runs + r];
}

// The sites, colour by colour and row by row within each: a stable counting sort.
//
// places (count, runs)  in: where the run's sites of a colour begin in the list; out: where they end
// list   (sites,)       out
// One work-item per run.
__kernel void coloring_list(__global const int *restrict colors, const int sites, const int length, const int runs,
                            __global int *restrict places, __global int *restrict list)
{
    const int r = get_global_id(0);
    if (r >= runs)
        return;
    for (int site = r * length; site < min(sites, (r + 1) * length); ++site)
        list[places[colors[site] * runs + r]++] = site;
}

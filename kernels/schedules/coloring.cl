// SPDX-License-Identifier: BSD-3-Clause
// Sites that relax together, equation (14): the colour of each site, and the list of the sites colour by colour.
#include "common/lattice.h"

// The coset of each site in a sublattice, of its place in the whole lattice (simdtex.model.lattice.Sublattice):
//
//   (layers layer + rows row - b floor(col / c)) mod a * c + col mod c
//
// names     (named,)  the number of each coset among those that occur; none: its own
// seam, own (n,)      sites along the seam of a torus that cuts through the cosets, ascending, and their colours
// colors    (sites,)  out
// One work-item per site.
__kernel void coloring_sites(const Lattice g, const int a, const int b, const int c, const int layers, const int rows,
                             __global const int *restrict names, const int named, __global const long *restrict seam,
                             __global const int *restrict own, const int n, __global int *restrict colors)
{
    const int site = get_global_id(0), i = site / g.cols;
    if (i >= g.layers * g.rows)
        return;
    const long layer = wrap(g.front + i / g.rows, g.whole_layers);
    const long row = wrap(g.top + i % g.rows, g.whole_rows), col = wrap(g.left + site % g.cols, g.whole_cols);
    const int coset = (int)((layer * layers + row * rows + col / c * (a - b)) % a * c + col % c);
    const long place = row * g.whole_cols + col;
    int first = 0;
    for (int end = n; first < end;)
        if (seam[(first + end) / 2] < place)
            first = (first + end) / 2 + 1;
        else
            end = (first + end) / 2;
    colors[site] = first < n && seam[first] == place ? own[first] : named ? names[coset] : coset;
}

// A stable counting sort. Work-item r takes a run of `length` sites; colours that are not 0 .. count - 1 are left out.
#define RUN const int sites, const int length, const int runs, const int count
#define EACH                                                                                                           \
    for (int first = r * length, site = first; r < runs && site < sites && site - first < length; ++site)              \
        if (colors[site] >= 0 && colors[site] < count)
#define OF(color) (size_t)(color) * runs + r

// counts (count, runs)  out: how many sites of each run have each colour
__kernel void coloring_count(__global const int *restrict colors, RUN, __global int *restrict counts)
{
    const int r = get_global_id(0);
    for (int color = 0; r < runs && color < count; ++color)
        counts[OF(color)] = 0;
    EACH
        ++counts[OF(colors[site])];
}

// places (count, runs)  in: where the run's sites of each colour begin in the list; out: where they end
// list   (sites,)       out
__kernel void coloring_list(__global const int *restrict colors, RUN, __global int *restrict places,
                            __global int *restrict list)
{
    const int r = get_global_id(0);
    EACH
        list[places[OF(colors[site])]++] = site;
}

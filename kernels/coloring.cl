// SPDX-License-Identifier: BSD-3-Clause
// Sites that relax together, equation (14): the colour of each site, and the list of the sites colour by colour.
#include "common/lattice.h"

// The coset of each site in a sublattice, of its place in the whole lattice (simdtex.model.lattice.Sublattice):
//
//   (layers layer + rows row - b floor(col / c)) mod a * c + col mod c
//
// names  (named,)  the number of each coset among those that occur; none: its own
// colors (sites,)  out
// One work-item per site.
__kernel void coloring_sites(const Lattice g, const int a, const int b, const int c, const int layers, const int rows,
                             __global const int *restrict names, const int named, __global int *restrict colors)
{
    const int site = get_global_id(0), i = site / g.cols;
    if (i >= g.layers * g.rows)
        return;
    const ulong layer = wrap(g.front + i / g.rows, g.whole_layers);
    const ulong row = wrap(g.top + i % g.rows, g.whole_rows), col = wrap(g.left + site % g.cols, g.whole_cols);
    const ulong turned = layer * layers + row * rows + col / c * (a - b);
    const int coset = (int)(turned % a * c + col % c);
    colors[site] = named ? names[coset] : coset;
}

// The colours of sites along the seam of a torus that cuts through the cosets. One work-item per site of seam (n,).
__kernel void coloring_seam(__global const int *restrict seam, __global const int *restrict own, const int n,
                            __global int *restrict colors)
{
    const int k = get_global_id(0);
    if (k < n)
        colors[seam[k]] = own[k];
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

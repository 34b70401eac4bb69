// SPDX-License-Identifier: BSD-3-Clause

// The end of a step: what the relaxed sites have become goes into the field, all at once.
//
// sites (S,), new_values (C, S), new_source (S,), new_temperature (S,)
// values (C, H, W), source (H, W), temperature (H, W)  in and out
// One work-item per site.
__kernel void commit(__global const int *restrict sites, const int S, const int channels, const int plane,
                     __global const ushort *restrict new_values, __global const int *restrict new_source,
                     __global const ushort *restrict new_temperature, __global ushort *restrict values,
                     __global int *restrict source, __global ushort *restrict temperature)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    const int site = sites[s];
    for (int c = 0; c < channels; ++c)
        values[c * plane + site] = new_values[c * S + s];
    source[site] = new_source[s];
    temperature[site] = new_temperature[s];
}

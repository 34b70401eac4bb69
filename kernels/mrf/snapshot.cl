// SPDX-License-Identifier: BSD-3-Clause

// What tiles see of one another: the picture as it is now, kept below the picture itself, where neighbours in another
// tile are read from (common/lattice.h). -D T is the type.
//
// picture (planes, height, width); stacked (planes, 2 height, width)  out, both halves; may be the same memory when
// the picture is the upper half of a stack already (`stride` pixels from plane to plane).
// One work-item per pixel and plane.
__kernel void snapshot(__global const T *picture, const int plane, const int planes, const int stride,
                       __global T *stacked)
{
    const int n = get_global_id(0);
    if (n >= plane * planes)
        return;
    const int p = n / plane, at = n % plane;
    const T value = picture[p * stride + at];
    stacked[p * 2 * plane + at] = value;
    stacked[p * 2 * plane + plane + at] = value;
}

// SPDX-License-Identifier: BSD-3-Clause
// What lies beyond the border of a picture: the other side of a torus, or the picture's mirror image.

// Index i, any integer, brought to 0 .. n-1. The mirror stands on the outer pixels: -1 is 1, n is n - 2.
static inline int within(const int i, const int n, const int torus)
{
    const int period = torus ? n : max(1, 2 * n - 2);
    const int k = i % period, r = k < 0 ? k + period : k;
    return r < n ? r : period - r;
}

// SPDX-License-Identifier: BSD-3-Clause
// Equation (13): t_s = max(0, (xi + sum of t_r over r in N_s) / |N_s|), in integers of 1/1024, rounded down.

// `sum` is xi plus the temperatures of the `members` of N_s: neighbours on the lattice.
static inline ushort cooled_to(const int sum, const int members)
{
    return sum > 0 ? (ushort)(sum / max(members, 1)) : (ushort)0;
}

# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks: the time of the methods on each device, and the factor by which NumPy takes longer."""

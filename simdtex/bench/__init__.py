# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks: how long the methods take on each device, and how many times longer in NumPy."""

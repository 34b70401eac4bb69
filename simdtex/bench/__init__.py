# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks: what a device can do at most, what the methods make of it, and what library code takes for the same."""

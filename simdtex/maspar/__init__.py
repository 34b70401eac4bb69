# SPDX-License-Identifier: BSD-3-Clause
"""The processor array of 1998, and the cost of a run on it."""

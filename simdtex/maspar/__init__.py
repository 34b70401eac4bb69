# SPDX-License-Identifier: BSD-3-Clause
"""The processor array of 1998, and what a run costs on it."""

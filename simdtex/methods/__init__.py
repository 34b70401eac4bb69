# SPDX-License-Identifier: BSD-3-Clause
"""The methods: programs over whole-array steps, to be read with the papers."""

# SPDX-License-Identifier: BSD-3-Clause
"""The data types that all methods share: lattices, samples, guides, source maps."""

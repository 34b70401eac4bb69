# SPDX-License-Identifier: BSD-3-Clause
"""What the methods speak of: lattices, samples, source maps."""

# SPDX-License-Identifier: BSD-3-Clause
"""De Bonet's multiresolution sampling (1997)."""

# SPDX-License-Identifier: BSD-3-Clause
"""Reading and writing of pictures, volumes, tables, grids and realisations."""

# SPDX-License-Identifier: BSD-3-Clause
"""Realisations of a training image, estimates of cells, and how an ensemble is judged."""

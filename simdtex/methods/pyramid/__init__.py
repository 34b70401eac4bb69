# SPDX-License-Identifier: BSD-3-Clause
"""Heeger and Bergen's pyramid matching (1995)."""

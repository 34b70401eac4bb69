# SPDX-License-Identifier: BSD-3-Clause
"""Figures, sheets of pictures, and the pages of reports."""

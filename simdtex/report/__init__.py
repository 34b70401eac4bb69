# SPDX-License-Identifier: BSD-3-Clause
"""Pictures and pages about a synthesis: stages, contact sheets, maps in colour, plots, reports."""

# SPDX-License-Identifier: BSD-3-Clause
"""Pictures about a synthesis: contact sheets, animations, heat maps, stages."""

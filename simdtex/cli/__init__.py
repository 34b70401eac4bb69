# SPDX-License-Identifier: BSD-3-Clause
"""What the commands have in common."""

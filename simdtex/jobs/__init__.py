# SPDX-License-Identifier: BSD-3-Clause
"""Jobs with conditioning data: checked input arrays, filling and extending pictures, and simulation."""

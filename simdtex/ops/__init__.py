# SPDX-License-Identifier: BSD-3-Clause
"""One module per operation: the launcher of its kernels and their NumPy twin side by side."""

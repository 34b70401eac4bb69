# SPDX-License-Identifier: BSD-3-Clause
"""A fuzzer of the command line: `make fuzz`, and docs/testing.rst."""

# SPDX-License-Identifier: BSD-3-Clause
"""Jobs with constraints: what users give beside a sample, filling and extending pictures, and simulation."""

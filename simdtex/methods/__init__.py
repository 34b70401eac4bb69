# SPDX-License-Identifier: BSD-3-Clause
"""The methods: programs of whole-array steps, which follow the papers."""

# SPDX-License-Identifier: BSD-3-Clause
"""Studies of the methods: schedules compared, the Ising model, figures of quality, times of devices."""

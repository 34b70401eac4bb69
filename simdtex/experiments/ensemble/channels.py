# SPDX-License-Identifier: BSD-3-Clause
"""A training image made by code: sinuous channels that meet, part and now and then end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.random import as_seed, philox

Pixels = NDArray[np.uint8]
Path = NDArray[np.int64]

ONE = 256  # fixed point: parts of a pixel
TURN = 4096  # parts of a full turn
# Sines as whole numbers, so that no platform's library decides on a pixel.
SINE = np.rint(ONE * 4 * np.sin(np.arange(TURN) * (2 * np.pi / TURN))).astype(np.int64).tolist()

# SPDX-License-Identifier: BSD-3-Clause
"""What runs here: for ``simdtex --version``, and for whoever says what went wrong."""

from __future__ import annotations

import platform
from importlib.metadata import version

from simdtex.machine.devices import DeviceError, find


def lines() -> list[str]:
    """The versions of simdtex, of Python and of what computes, and the device that would be chosen.

    Returns
    -------
    list of str
        A line each; where no device works, why.
    """
    found = [
        f"simdtex {version('simdtex')}",
        f"Python {platform.python_version()}, NumPy {version('numpy')}, pyopencl {version('pyopencl')}",
    ]
    try:
        device = find()
    except DeviceError as error:
        return [*found, str(error)]
    driver = f", {device.version}, driver {device.driver}" if device.version else ""
    return [*found, f"{device}{driver}"]


__all__ = ["lines"]

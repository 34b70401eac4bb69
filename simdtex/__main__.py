# SPDX-License-Identifier: BSD-3-Clause
"""``python -m simdtex`` is the command ``simdtex``."""

from simdtex.cli import main

main()

# SPDX-License-Identifier: BSD-3-Clause
"""A fuzzer of the command line: `make fuzz`, and docs/testing.rst."""

import random
import tempfile
from importlib import import_module

KINDS = {"lines": "fuzz.worker", "stores": "fuzz.stores", "checkpoints": "fuzz.checkpoints"}
"""The module of each kind of try."""


def begin(kind, root, device):
    """Prepare a process for tries of a kind."""
    import_module(KINDS[kind]).begin(tempfile.mkdtemp(dir=root), device)


def seeded(seed, number):
    """Return the generator of a try."""
    return random.Random(f"{seed}-{number}")


def one_try(kind, seed, number):
    """Return what was tried, how it ended, and the faults, pairs of a kind and a text."""
    return import_module(KINDS[kind]).one_try(seeded(seed, number))

# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex live`` itself: a socket, an address, a machine that is warm, and the server until it is stopped."""

from __future__ import annotations

import os
import secrets
import socket
import threading
from collections.abc import Callable

import numpy as np
import uvicorn

from simdtex.live.server import LARGEST, Pages, application
from simdtex.live.settings import Picture
from simdtex.machine import Machine, open_machine
from simdtex.synthesis import synthesize

__all__ = ["TOKEN", "serve"]

TOKEN = "SIMDTEX_LIVE_TOKEN"
"""The variable of the environment that says what comes first in the page's address, so that it stays the same."""

SHORTEST = 16
"""Characters of a token, at least."""


def serve(
    picture: Picture | None,
    device: str | None,
    address: str,
    port: int,
    ready: Callable[[str, Machine], None],
) -> None:
    """Serve the live page until Ctrl-C.

    Parameters
    ----------
    picture : Picture, optional
        What every new page begins with.
    device : str, optional
        As of `simdtex.open_machine`.
    address : str
        What to listen to; others than those of this machine alone reach the page with anything else than 127.0.0.1.
    port : int
        0 takes a free one.
    ready : callable
        Called with the page's address and the machine, once it can be opened.

    Raises
    ------
    ValueError
        The address cannot be listened to, or the token is too short.
    """
    token = os.environ.get(TOKEN) or secrets.token_urlsafe(24)
    if len(token) < SHORTEST or not token.replace("-", "").replace("_", "").isalnum() or not token.isascii():
        raise ValueError(f"{TOKEN} must be {SHORTEST} or more letters, digits, - and _; leave it unset for a fresh one")
    machine = open_machine(device)
    listening = _listen(address, port)
    pages = Pages(lambda: machine, (lambda session: session.use(picture)) if picture else None)
    config = uvicorn.Config(
        application(pages, token, address),
        log_level="warning",
        ws="websockets-sansio",
        ws_max_size=LARGEST,
        ws_per_message_deflate=False,
        lifespan="on",
        timeout_graceful_shutdown=1,
    )
    threading.Thread(target=warm, args=(machine,), daemon=True).start()
    shown = f"[{address}]" if ":" in address else address
    ready(f"http://{shown}:{listening.getsockname()[1]}/{token}/", machine)
    try:
        uvicorn.Server(config).run(sockets=[listening])
    finally:
        pages.close()
        listening.close()


def _listen(address: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    found = socket.socket(family, socket.SOCK_STREAM)
    try:
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind((address, port))
        found.listen()
    except (OSError, OverflowError) as error:
        found.close()
        why = getattr(error, "strerror", None) or error
        raise ValueError(
            f"{address} port {port} cannot be listened to ({why}); give another --port or --host"
        ) from None
    return found


def warm(machine: Machine) -> None:
    """Have the kernels built that a first run needs, for grey and colour."""
    rng = np.random.default_rng(0)
    for axis, shape in ((None, (32, 32)), (-1, (32, 32, 3))):
        sample = rng.integers(0, 256, shape, np.uint8)
        synthesize(sample, (48, 48), channel_axis=axis, rng=0, device=machine)

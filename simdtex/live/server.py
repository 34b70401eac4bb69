# SPDX-License-Identifier: BSD-3-Clause
"""The server of the live page: by default for this computer only, and for users who know the page's address.

A message is a text of JSON. In messages from the page, ``buffers`` has the size of the file that follows in pieces, if
any; in messages to the page it is the number of binary messages that follow.
"""

from __future__ import annotations

import ipaddress
import json
import os
import re
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from websockets.datastructures import MultipleValuesError
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.sync.server import ServerConnection
from websockets.sync.server import serve as websocket_server

from simdtex.jobs.synthesis.job import synthesize
from simdtex.live import PAGE, script, style
from simdtex.live.job import Message, Picture
from simdtex.live.session import MAX_BYTES, Send, Session
from simdtex.machine import Machine, open_machine
from simdtex.options import whole

TOKEN = "SIMDTEX_LIVE_TOKEN"
"""The environment variable with the token of the page's address, which keeps the address constant."""

FILES: dict[str, tuple[Callable[[], str], str]] = {
    "": (lambda: (PAGE / "index.html").read_text(encoding="utf-8"), "text/html"),
    "live.js": (script, "text/javascript"),
    "live.css": (style, "text/css"),
}
"""The files of the page, by the part of the address after the token: a function that returns the text, and its type."""

HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Headers of every response: the page loads only its own files, cannot be framed, and does not reveal its address."""

REFUSED = "This address lacks the right token. Open the address that `simdtex live` has printed."

MAX_PAGES = 8  # that are open at the same time
KEPT = 600.0  # seconds that the session of a page without a connection is kept, unless another page needs its place
RUN_KEPT = 30.0  # seconds that the run of such a session continues
MAX_MESSAGE = 2**22  # bytes of a message without its file, and of a piece of a file
SMALL = 2**16  # bytes of a message that may wait together with others
PIECE_WAIT, FILE_WAIT = 10.0, 120.0  # seconds to receive a piece of a file, and the whole file
ENDING = 2.0  # seconds that the server, when it ends, waits for a session's run or for an incomplete request

LOOPBACK = ("127.0.0.1", "localhost", "::1")

BAD_MESSAGE, TOO_MANY = 1003, 1013
"""Codes with which a WebSocket is closed (RFC 6455, section 7.4.1)."""


class Pages:
    """The sessions of pages that are open or have recently lost their connection."""

    def __init__(self, machine: Machine, picture: Picture | None = None) -> None:
        self._machine, self._picture = machine, picture
        self._lock = threading.Lock()
        self._sessions: dict[str, Session] = {}
        self._lost: dict[str, float] = {}  # time of the loss, the oldest first
        self._closed = threading.Event()

    def join(self, key: str | None, send: Send) -> Session | None:
        """Return the session of a page, its earlier one or a new one; None if there are too many."""
        with self._lock:
            if key in self._lost:
                del self._lost[key]
                self._sessions[key].send = send
                return self._sessions[key]
            self._expire()
            if self._closed.is_set() or len(self._sessions) >= MAX_PAGES:
                return None
            session = Session(send, self._machine, self._picture)
            self._sessions[session.key] = session
            return session

    def leave(self, session: Session) -> None:
        """Keep the session of a page that has lost its connection."""
        with self._lock:
            self._lost[session.key] = time.monotonic()
            session.send = lambda message, buffers: None

    def tend(self, every: float = 1.0) -> None:
        """End runs and sessions of pages that have been lost for too long, until `close`."""
        while not self._closed.wait(every):
            with self._lock:
                self._expire()

    def _expire(self) -> None:
        for key, since in list(self._lost.items()):
            alone = time.monotonic() - since
            if alone > KEPT or len(self._sessions) >= MAX_PAGES:
                del self._lost[key]
                self._sessions.pop(key).close()
            elif alone > RUN_KEPT:
                self._sessions[key].receive({"kind": "cancel"})

    def close(self) -> None:
        """End all sessions."""
        self._closed.set()
        for wait in (0.0, ENDING / MAX_PAGES):
            for session in self._sessions.values():
                session.close(wait)


def serve(
    picture: Picture | None, device: str | None, address: str, port: int, ready: Callable[[str, Machine], None]
) -> None:
    """Serve the live page until Ctrl-C; call ``ready`` with its address and the machine when it can be opened."""
    token = os.environ.get(TOKEN) or secrets.token_urlsafe(24)
    if not re.fullmatch(r"[\w-]{16,}", token, re.ASCII):
        raise ValueError(f"{TOKEN} must be 16 or more letters, digits, - and _; leave it unset for a fresh one")
    machine = open_machine(device)
    with listen(Pages(machine, picture), token, address, port) as port:
        threading.Thread(target=build_kernels, args=(machine,), daemon=True).start()
        host = f"[{address}]" if ":" in address else address
        ready(f"http://{host}:{port}/{token}/", machine)
        while True:
            time.sleep(3600)  # until Ctrl-C, which does not interrupt a wait for a thread on Windows


@contextmanager
def listen(pages: Pages, token: str, address: str, port: int) -> Iterator[int]:
    """Serve pages in threads until the block ends, and yield the port; every path begins with the token."""
    try:
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        listening = socket.create_server((address, port), family=family)
    except (OSError, OverflowError) as error:
        why = getattr(error, "strerror", None) or error
        raise ValueError(f"cannot listen to {address} port {port} ({why}); give another --port or --host") from None

    def answer(connection: ServerConnection, request: Request) -> Response | None:
        """Return the response to a request; None opens the WebSocket."""
        try:
            host, origin = request.headers.get("Host", ""), request.headers.get("Origin")
        except MultipleValuesError as error:
            return _response(connection, 400, f"The request has several headers {error}.")
        secret, slash, name = request.path.partition("?")[0].lstrip("/").partition("/")
        if not is_own_name(host, address):
            return _response(connection, 400, "This server has another name.")
        if not secrets.compare_digest(secret.encode(errors="surrogateescape"), token.encode()):
            return _response(connection, 403, REFUSED)
        if not slash:  # without it, relative addresses in the page would lack the token
            response = _response(connection, 308, "")
            response.headers["Location"] = f"/{token}/"
            return response
        if name == "socket":
            return None if origin == f"http://{host}" else _response(connection, 403, REFUSED)
        if name not in FILES:
            return _response(connection, 404, "There is no such page.")
        text, kind = FILES[name]
        return _response(connection, 200, text(), kind)

    server = websocket_server(
        lambda connection: talk(connection, pages),
        sock=listening,
        process_request=answer,
        compression=None,
        max_size=MAX_MESSAGE,
        max_queue=2,
        ping_timeout=FILE_WAIT,  # pongs are not read while a message waits for an earlier one
        open_timeout=ENDING,
        close_timeout=ENDING,
    )
    for target in (server.serve_forever, pages.tend):
        threading.Thread(target=target, daemon=True).start()
    try:
        yield listening.getsockname()[1]
    finally:
        pages.close()
        ending = threading.Thread(target=server.shutdown, daemon=True)
        ending.start()
        ending.join(ENDING)
        for connection in server.connections:  # a page that does not read cannot be told
            with suppress(OSError):
                connection.socket.shutdown(socket.SHUT_RDWR)
        ending.join(ENDING)


def _response(connection: ServerConnection, status: int, text: str, kind: str = "text/plain") -> Response:
    response = connection.respond(status, text)
    del response.headers["Content-Type"]
    response.headers.update(HEADERS | {"Content-Type": f"{kind}; charset=utf-8"})
    return response


def is_own_name(host: str, address: str) -> bool:
    """Return whether a Host header names this server, and not a name of another site that resolves to it."""
    match = re.fullmatch(r"(?:\[([0-9a-f:.]*:[0-9a-f:.]*)\]|([^][:@/]+))(:[0-9]+)?", host.lower())
    name = (match[1] or match[2]) if match else ""
    if name in (*LOOPBACK, address.lower()):
        return True
    with suppress(ValueError):
        ipaddress.ip_address(name)
        return address not in LOOPBACK  # only names can be redirected
    return False


def talk(connection: ServerConnection, pages: Pages) -> None:
    """Pass messages between a page and its session until the connection ends."""

    def send(message: Message, buffers: Sequence[bytes]) -> None:
        with suppress(ConnectionClosed):
            connection.send(json.dumps(message | {"buffers": len(buffers)}))
            for buffer in buffers:
                connection.send(buffer)

    assert connection.request is not None
    session = pages.join(connection.request.path.partition("?session=")[2], send)
    if session is None:
        connection.close(TOO_MANY, f"{MAX_PAGES} pages are open already; close one of them")
        return
    try:
        for text in connection:
            message = json.loads(text)
            sizes = message.pop("buffers", [])
            files = [_file(size, connection) for size in sizes[:1]]
            # a large message is handled before the next one is received
            session.follow(session.receive(message, files), every=bool(sizes) or len(text) > SMALL)
    except ConnectionClosed:
        pass
    except TimeoutError:
        connection.close(BAD_MESSAGE, "the file has not come in time")
    except (ValueError, TypeError, AttributeError, RecursionError):
        connection.close(BAD_MESSAGE, "this is no message")
    finally:
        pages.leave(session)


def _file(size: Any, connection: ServerConnection) -> bytes:
    """Return a file of ``size`` bytes, which arrives in pieces."""
    whole("the size of a file", size, 1, MAX_BYTES)
    data, end = bytearray(), time.monotonic() + FILE_WAIT
    while len(data) < size:
        piece = connection.recv(timeout=min(PIECE_WAIT, end - time.monotonic()))
        if not isinstance(piece, bytes) or not 0 < len(piece) <= size - len(data):
            raise ValueError("this is no piece of a file")
        data += piece
    return bytes(data)


def build_kernels(machine: Machine) -> None:
    """Build the kernels of a first run, for a grey and for a coloured sample."""
    rng = np.random.default_rng(0)
    for axis, shape in ((None, (32, 32)), (-1, (32, 32, 3))):
        synthesize(rng.integers(0, 256, shape, np.uint8), (48, 48), channel_axis=axis, rng=0, device=machine)

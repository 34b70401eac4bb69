# SPDX-License-Identifier: BSD-3-Clause
"""The server of the live page: on this machine alone, for whoever knows its address.

A message on the WebSocket is one binary frame: the length of a JSON text, 4 bytes little-endian, the text, and the
buffers one after another; the text has the lengths of these under ``buffers``.
"""

from __future__ import annotations

import asyncio
import ipaddress
import json
import secrets
import struct
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from importlib.resources import files
from itertools import pairwise
from typing import Any

from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from simdtex.live.session import BYTES, Session
from simdtex.machine import Machine

__all__ = ["Pages", "application", "pack", "unpack"]

FILES = {
    "": ("index.html", "text/html; charset=utf-8"),
    "live.js": ("live.js", "text/javascript; charset=utf-8"),
    "live.css": ("live.css", "text/css; charset=utf-8"),
}
"""What is served, by its address after the token."""

HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Of every answer: nothing is loaded from elsewhere, nobody frames the page, and nobody learns its address from it."""

REFUSED = "This address lacks the right token. Open the address that `simdtex live` has printed."

HEADER = 2**20
"""Bytes of a message's text, at most."""

PAGES = 8
"""Pages at a time, at most."""

WAITED = 600.0
"""Seconds that the work of a page is kept after its connection is lost."""

ENDING = 2.0
"""Seconds that the end of the server waits for a session's thread, at most."""

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")

REFUSING, TOO_MANY = 1008, 1013
"""Codes with which a WebSocket is closed (RFC 6455, section 7.4.1)."""


def pack(message: dict[str, Any], buffers: Sequence[bytes]) -> bytes:
    """A message as one binary frame."""
    text = json.dumps(message | {"buffers": [len(one) for one in buffers]}).encode()
    return b"".join([struct.pack("<I", len(text)), text, *buffers])


def unpack(frame: bytes) -> tuple[dict[str, Any], list[memoryview]]:
    """The message and the buffers of a frame.

    Raises
    ------
    ValueError
        It is none.
    """
    try:
        (length,) = struct.unpack_from("<I", frame)
        if length > HEADER:
            raise ValueError
        message = json.loads(frame[4 : 4 + length])
        lengths = message.pop("buffers", [])
        ends = [4 + length]
        for one in lengths:
            if not isinstance(one, int) or one < 0:
                raise ValueError
            ends.append(ends[-1] + one)
        if ends[-1] != len(frame):
            raise ValueError
    except (ValueError, TypeError, AttributeError, struct.error, RecursionError):
        raise ValueError("a frame that is no message") from None
    view = memoryview(frame)
    return message, [view[begin:end] for begin, end in pairwise(ends)]


class Pages:
    """The sessions of the pages that are open, or were a little while ago.

    Parameters
    ----------
    machine : callable
        Gives the machine.
    begin : callable, optional
        Called with each new session.
    """

    def __init__(self, machine: Callable[[], Machine], begin: Callable[[Session], None] | None = None) -> None:
        self._machine, self._begin = machine, begin
        self._sessions: dict[str, Session] = {}
        self._left: dict[str, float] = {}  # when the page of a session was lost

    def join(self, key: str | None, send: Callable[..., None]) -> tuple[str, Session] | None:
        """The session of a page: the one that it had, or a new one; None where there are too many."""
        self._tidy()
        if key in self._left:
            del self._left[key]
            self._sessions[key].attach(send)
            return key, self._sessions[key]
        if len(self._sessions) >= PAGES and not self._drop():
            return None
        key, session = secrets.token_urlsafe(16), Session(send, self._machine)
        self._sessions[key] = session
        if self._begin:
            self._begin(session)
        return key, session

    def leave(self, key: str) -> None:
        """A page has lost its connection, or is closed."""
        self._left[key] = time.monotonic()
        self._sessions[key].attach(lambda message, buffers: None)

    def close(self) -> None:
        """End all that is being made."""
        for session in self._sessions.values():
            session.close()
        for session in self._sessions.values():
            session.close(ENDING)

    def _tidy(self) -> None:
        for key in [key for key, since in self._left.items() if time.monotonic() - since > WAITED]:
            self._forget(key)

    def _drop(self) -> bool:
        if self._left:
            self._forget(min(self._left, key=self._left.__getitem__))
            return True
        return False

    def _forget(self, key: str) -> None:
        del self._left[key]
        self._sessions.pop(key).close()


def host_name(host: str) -> str:
    """The name of a Host header, without the port."""
    if host.startswith("["):
        return host.partition("]")[0] + "]"
    return host.partition(":")[0].lower()


class Guard:
    """Lets a request pass whose Host is this server's, so that no other site's name can stand for it.

    Parameters
    ----------
    app : ASGI application
    address : str
        What the server listens to. With one that others reach, any address in figures passes: only names can be made
        to point here by somebody else.
    """

    def __init__(self, app: ASGIApp, address: str) -> None:
        self._app, self._address = app, address

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer 400 or close where it is not."""
        if scope["type"] in ("http", "websocket") and not self._own(HTTPConnection(scope).headers.get("host", "")):
            if scope["type"] == "http":
                await PlainTextResponse("This server has another name.", 400, HEADERS)(scope, receive, send)
            else:
                await WebSocket(scope, receive, send).close(REFUSING)
            return
        await self._app(scope, receive, send)

    def _own(self, host: str) -> bool:
        name = host_name(host)
        if name in LOOPBACK or name == self._address.lower():
            return True
        try:
            ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            return False
        return self._address not in (*LOOPBACK, "::1")


def application(pages: Pages, token: str, address: str = "127.0.0.1") -> ASGIApp:
    """The server's application.

    Parameters
    ----------
    pages : Pages
    token : str
        What comes first in every address.
    address : str
        What the server listens to.
    """

    def known(connection: HTTPConnection) -> bool:
        return secrets.compare_digest(connection.path_params["token"].encode(), token.encode())

    async def serve(request: Request) -> Response:
        name = request.path_params.get("name", "")
        if not known(request):
            return PlainTextResponse(REFUSED, 403, HEADERS)
        if name not in FILES:
            return PlainTextResponse("There is no such page.", 404, HEADERS)
        file, kind = FILES[name]
        return Response((files("simdtex.live") / "page" / file).read_bytes(), 200, HEADERS, kind)

    async def refuse(request: Request) -> Response:
        return PlainTextResponse(REFUSED, 403, HEADERS)

    async def socket(websocket: WebSocket) -> None:
        own = f"http://{websocket.headers.get('host')}"
        if not known(websocket) or websocket.headers.get("origin") != own:
            await websocket.close(REFUSING)  # before it is accepted: 403
            return
        await websocket.accept()
        await _talk(websocket, pages)

    @asynccontextmanager
    async def lifespan(app: Any) -> AsyncIterator[None]:
        yield
        pages.close()

    routes = [
        WebSocketRoute("/{token}/socket", socket),
        Route("/{token}/", serve),
        Route("/{token}/{name}", serve),
        Route("/{rest:path}", refuse),
    ]
    return Guard(Starlette(routes=routes, lifespan=lifespan), address)


async def _talk(websocket: WebSocket, pages: Pages) -> None:
    """Carry the messages of a page and its session until one of them ends."""
    loop, out = asyncio.get_running_loop(), asyncio.Queue[bytes]()

    def send(message: dict[str, Any], buffers: Sequence[bytes]) -> None:
        frame = pack(message, buffers)
        with suppress(RuntimeError):  # the server has ended
            loop.call_soon_threadsafe(out.put_nowait, frame)

    joined = pages.join(websocket.query_params.get("session"), send)
    if joined is None:
        await websocket.close(TOO_MANY, f"{PAGES} pages are open already; close one of them")
        return
    key, session = joined
    send({"kind": "session", "key": key}, [])

    async def write() -> None:
        while True:
            await websocket.send_bytes(await out.get())

    writer = asyncio.create_task(write())
    try:
        while True:
            message, buffers = unpack(await websocket.receive_bytes())
            session.receive(message, buffers)
    except (WebSocketDisconnect, KeyError):  # KeyError: a frame of text
        pass
    except ValueError:
        await websocket.close(REFUSING, "a frame that is no message")
    finally:
        writer.cancel()
        pages.leave(key)


LARGEST = BYTES + HEADER
"""Bytes of a frame, at most."""

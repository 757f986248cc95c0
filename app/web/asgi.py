"""ASGI layers: HEAD requests, the server's own `send`, startup errors without a traceback."""

import asyncio
import sys
from typing import Final

from fastapi import FastAPI
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.system.errors import KioskError
from app.web.server import bounded

KEY: Final = "panel.send"


class Application(FastAPI):
    """A FastAPI application with `HeadAsGet` and `KeepServerSend` around FastAPI's own outer layers.

    `state.server` is the configuration of the server, set at startup; None if it is not uvicorn.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            self.state.server = bounded(receive)  # here: FastAPI wraps it
        await super().__call__(scope, receive, send)

    def build_middleware_stack(self) -> ASGIApp:
        return HeadAsGet(KeepServerSend(super().build_middleware_stack()))


class HeadAsGet:
    """Answers HEAD as GET without the body (RFC 9110, 9.3.2), whatever route it is.

    The route gets a disconnect once its head is sent: an event stream ends there.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["method"] == "HEAD":
            head = _Head(receive, send)
            await self._app({**scope, "method": "GET"}, head.receive, head.send)
        else:
            await self._app(scope, receive, send)


class _Head:
    """One HEAD request."""

    def __init__(self, receive: Receive, send: Send) -> None:
        self._receive = receive
        self._send = send
        self._received = False
        self._sent = asyncio.Event()

    async def receive(self) -> Message:
        if not self._received:
            self._received = True
            return await self._receive()
        await self._sent.wait()
        return {"type": "http.disconnect"}

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            await self._send(message)
            await self._send({"type": "http.response.body", "body": b"", "more_body": False})
            self._sent.set()


class KeepServerSend:
    """Keeps the `send` of the server in the scope while the request is handled."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        scope[KEY] = send
        try:
            await self._app(scope, receive, send)
        finally:
            del scope[KEY]  # else a reference cycle: `send` refers to the scope


def server_send(scope: Scope, send: Send) -> Send:
    """The `send` that `KeepServerSend` kept, past all layers; without that layer `send` itself."""
    own: Send = scope.get(KEY, send)
    return own


class ReadableStartupErrors:
    """Replaces the traceback of a KioskError at startup by its message."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_readable(message: Message) -> None:
            error = sys.exception()  # Starlette sends while it handles the lifespan's error
            if message["type"] == "lifespan.startup.failed" and isinstance(error, KioskError):
                message = {**message, "message": str(error)}
            await send(message)

        await self._app(scope, receive, send_readable if scope["type"] == "lifespan" else send)

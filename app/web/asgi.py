"""Wrappers around the ASGI application: errors of the start in words; the server's own `send`."""

import sys
from typing import Final

from fastapi import FastAPI
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.errors import KioskError
from app.web.serving import bounded

KEY: Final = "panel.send"


class Application(FastAPI):
    """With that layer around all others: FastAPI has some of its own around those that are added.

    `state.server` is the configuration of the server from the start on; None where it is not uvicorn's.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            self.state.server = bounded(receive)  # here: FastAPI wraps it
        await super().__call__(scope, receive, send)

    def build_middleware_stack(self) -> ASGIApp:
        return Direct(super().build_middleware_stack())


class Direct:
    """The outermost layer: keeps `send` in the scope for as long as the request is answered."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        scope[KEY] = send
        try:
            await self._app(scope, receive, send)
        finally:
            del scope[KEY]  # a circle otherwise: who sends knows the scope


def direct(scope: Scope, send: Send) -> Send:
    """The server's own, where the application has that layer; else `send`."""
    own: Send = scope.get(KEY, send)
    return own


class InWords:
    """Passes everything on, but for the tracebacks of the kiosk's own errors."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def in_words(message: Message) -> None:
            error = sys.exception()  # Starlette sends while it handles what the lifespan raised
            if message["type"] == "lifespan.startup.failed" and isinstance(error, KioskError):
                message = {**message, "message": str(error)}
            await send(message)

        await self._app(scope, receive, in_words if scope["type"] == "lifespan" else send)

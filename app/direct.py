"""The server's own `send`, at hand for a body that no layer in between changes.

Each layer around the application wraps `send`, and would be gone through once for every event and every
browser. What begins an answer goes through all of them: they see its headers.
"""

from typing import Final

from fastapi import FastAPI
from starlette.types import ASGIApp, Receive, Scope, Send

from app.serving import bounded

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

"""A start that fails says why in words: what Starlette tells the server is a traceback."""

import sys

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.errors import KioskError


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

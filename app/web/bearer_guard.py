"""Refuses the requests of programs whose token is not known or makes too many, before anything else
reads them. Pure ASGI, for WebSockets too."""

from typing import Final

from starlette.requests import HTTPConnection
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from app.i18n import render, say
from app.web.app_state import AppState
from app.web.client_cookie import bearer_of
from app.web.language import language_of
from app.web.security import refuse

CHALLENGE: Final = {"www-authenticate": 'Bearer realm="operator-panel", error="invalid_token"'}
AGAIN: Final = {"retry-after": "1"}


class BearerGuard:
    """Lets requests without a token through, and all of a panel without users."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] in ("http", "websocket"):
            connection = HTTPConnection(scope)
            bearer = bearer_of(connection.headers.get("authorization", ""))
            state: AppState | None = getattr(scope["app"].state, "app_state", None)
            if bearer and state is not None and state.access.configured:
                known = state.access.knows(bearer)
                if not known or not state.access.admit_token(bearer):
                    sentence = say("token_too_often" if known else "token_unknown")
                    content = {"error": render(sentence, language_of(connection))}
                    status, headers = (429, AGAIN) if known else (401, CHALLENGE)
                    await refuse(JSONResponse(content, status, headers), scope, receive, send)
                    return
        await self._app(scope, receive, send)

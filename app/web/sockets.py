"""uvicorn's WebSocket, which gives the place of its connection back, and knows that it was answered."""

import asyncio
from typing import cast

from uvicorn._types import ASGISendEvent
from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from app.web import connections
from app.web.client_transport import ClientTransport


class Socket(WebSocketsSansIOProtocol):
    """A WebSocket that was a `Connection` before. It is closed when its handshake takes too long."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self.loop.call_later(connections.HEAD_WITHIN_S, self._check_handshake)

    def connection_lost(self, exc: Exception | None) -> None:
        cast(ClientTransport, self.transport).release()
        super().connection_lost(exc)

    async def send(self, message: ASGISendEvent) -> None:
        if self.close_sent and message["type"] == "websocket.send":
            raise ClientDisconnected  # uvicorn takes it for a fault of the application
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and not message.get("more_body", False):
            self.handshake_complete = True  # uvicorn would take the answer for none

    def _check_handshake(self) -> None:
        if not self.handshake_complete:
            self.transport.close()

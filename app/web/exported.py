"""The response with an export as CSV, which another process makes."""

import asyncio
import logging
from contextlib import AsyncExitStack
from datetime import datetime
from typing import Final

from fastapi.responses import Response
from starlette.types import Message, Receive, Scope, Send

from app.audit import ReaderProcess
from app.errors import LogError

log = logging.getLogger("kiosk.log")

TAKEN_WITHIN_S: Final = 20.0  # a piece of an export: another one may be waited for
START: Final = "http.response.start"
BODY: Final = "http.response.body"


class Exported(Response):
    """The response with an export, sent piece by piece. An export that fails, or that no client reads,
    is not terminated: no client takes it for complete."""

    media_type = "text/csv"

    def __init__(
        self, export: ReaderProcess, first: bytes, gzip: bool, opened: AsyncExitStack, name: str
    ) -> None:
        """`opened` is closed when it is over; `name` says what is exported: "operator's log"."""
        self._name = name
        begin = name.replace(" ", "-").replace("'", "")
        name = f"{begin}-{datetime.now().strftime('%Y%m%d-%H%M%S')}.csv"
        headers = {"content-disposition": f'attachment; filename="{name}"', "cache-control": "no-store"}
        if gzip:
            headers |= {"content-encoding": "gzip", "vary": "accept-encoding"}
        self._export = export
        self._first = first
        self._opened = opened
        self.status_code = 200
        self.background = None
        self.init_headers(headers)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async with self._opened, asyncio.TaskGroup() as group:
            going = group.create_task(self._gone(receive))
            try:
                await self._send(send, going)
            except TimeoutError:
                log.warning("an export of the %s was not taken for %g s", self._name, TAKEN_WITHIN_S)
            except LogError as error:
                if not going.done():
                    log.warning("an export of the %s broke off: %s", self._name, error)
            going.cancel()

    async def _send(self, send: Send, going: "asyncio.Task[None]") -> None:
        await _taken(send, {"type": START, "status": 200, "headers": self.raw_headers})
        piece = self._first
        while piece and not going.done():
            await _taken(send, {"type": BODY, "body": piece, "more_body": True})
            piece = await self._export.read_next()
        await self._opened.aclose()  # who has it whole may ask for the next
        await _taken(send, {"type": BODY, "body": b"", "more_body": False})

    async def _gone(self, receive: Receive) -> None:
        """Returns when the client has disconnected."""
        while (await receive())["type"] != "http.disconnect":
            pass
        self._export.kill()


async def _taken(send: Send, message: Message) -> None:
    """TimeoutError where no client takes it."""
    async with asyncio.timeout(TAKEN_WITHIN_S):
        await send(message)

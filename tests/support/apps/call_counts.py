"""The application of `tests.support.apps.patient`, which counts the calls of its own functions during
each post and shortly after it, for `uvicorn tests.support.apps.call_counts:app`. `GET /calls` returns
those of the last."""

import asyncio
import sys
from pathlib import Path
from types import FrameType
from typing import Final

from starlette.responses import JSONResponse
from starlette.types import Receive, Scope, Send

import app as package
from tests.support.apps import patient

DRAWN_WITHIN_S: Final = 0.03
OWN: Final = str(Path(package.__file__).parent)


class CountedCalls:
    """An ASGI application around the server's. Everything on its thread counts, also what comes from
    the robot meanwhile: the fewest of several posts are those of a post."""

    def __init__(self) -> None:
        self._calls = 0
        self._counted = asyncio.Event()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["path"] == "/calls":
            await self._counted.wait()
            await JSONResponse(self._calls)(scope, receive, send)
        elif scope.get("method") != "POST":
            await patient.app(scope, receive, send)
        else:
            self._calls = 0
            self._counted.clear()
            sys.setprofile(self._count)
            try:
                await patient.app(scope, receive, send)
                await asyncio.sleep(DRAWN_WITHIN_S)
            finally:
                sys.setprofile(None)
                self._counted.set()

    def _count(self, frame: FrameType, event: str, _: object) -> None:
        self._calls += event == "call" and frame.f_code.co_filename.startswith(OWN)


app = CountedCalls()

"""Listings: a page for who reads pages, JSON for programs. Answers that may be large are made and
packed on a thread, one at a time, so that holds and events go on beside them."""

import asyncio
import gzip
import json
from collections.abc import Callable
from typing import Any, Final

from fastapi import Request
from fastapi.responses import Response

from app.system.texts import localized
from app.web.caller import caller_of

JSON: Final = "application/json"
PACKED_BYTES: Final = 4_000  # a shorter answer is not packed here
LEVEL: Final = 1  # of gzip: quick
SMALL: Final = 50  # rows of which an answer takes some milliseconds

# Of the threads that make answers: each takes the interpreter from the event loop for milliseconds.
_turn: Final = asyncio.Semaphore(1)


def wants_page(request: Request) -> bool:
    """Whether the client reads pages; a program gets JSON."""
    return "text/html" in request.headers.get("accept", "")


async def rows_answer(request: Request, content: Callable[[], dict[str, Any]], count: int) -> Response:
    """The JSON of a content with so many rows, with its texts in the reader's language. `content` may
    be called on a thread: its rows must not change."""
    language = caller_of(request).language
    if count <= SMALL:
        return await packed_answer(request, _encoded(content, language))
    async with _turn:
        return await packed_answer(request, await asyncio.to_thread(_encoded, content, language))


async def packed_answer(request: Request, body: bytes) -> Response:
    """The JSON, packed if it is long and the client takes that."""
    headers = {"cache-control": "no-store", "vary": "accept, accept-encoding"}
    if "gzip" in request.headers.get("accept-encoding", "") and len(body) > PACKED_BYTES:
        body = await asyncio.to_thread(gzip.compress, body, LEVEL)
        headers["content-encoding"] = "gzip"
    return Response(body, media_type=JSON, headers=headers)


def _encoded(content: Callable[[], dict[str, Any]], language: str) -> bytes:
    answer = localized(content(), language)
    return json.dumps(answer, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()

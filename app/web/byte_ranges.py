"""Ranges of a file in memory (RFC 9110, 14): the answer to a GET with or without a `Range`."""

import re
from collections.abc import AsyncIterator, Mapping
from typing import Final

from fastapi import Request
from fastapi.responses import Response, StreamingResponse

PIECE: Final = 256_000  # bytes sent at once
RANGE: Final = re.compile(r"bytes=[ \t]*(?P<first>\d{0,18})-(?P<last>\d{0,18})[ \t]*")


def ranged(request: Request, content: bytes, etag: str, headers: Mapping[str, str]) -> Response:
    """200 with the file, 206 with the range that is asked for, 416 where the file has none of it.
    Several ranges and what is not a range are answered with the whole file, as is a range of another
    version (`If-Range`)."""
    size = len(content)
    headers = {**headers, "accept-ranges": "bytes", "etag": etag}
    wanted = RANGE.fullmatch(request.headers.get("range", ""))
    if wanted is None or wanted[0].endswith("=-") or request.headers.get("if-range", etag) != etag:
        return _streamed(content, 0, size, 200, headers)
    first, end = _bounds(wanted["first"], wanted["last"], size)
    if wanted["last"] and wanted["first"] and int(wanted["last"]) < int(wanted["first"]):
        return _streamed(content, 0, size, 200, headers)
    if first >= end:
        return Response(status_code=416, headers={**headers, "content-range": f"bytes */{size}"})
    headers["content-range"] = f"bytes {first}-{end - 1}/{size}"
    return _streamed(content, first, end, 206, headers)


def _bounds(first: str, last: str, size: int) -> tuple[int, int]:
    """The first byte and the one after the last; "-500" are the last 500."""
    if not first:
        return max(size - int(last), 0), size
    return int(first), min(int(last) + 1, size) if last else size


def _streamed(
    content: bytes, first: int, end: int, status: int, headers: Mapping[str, str]
) -> Response:
    """In pieces: no more is waiting for a slow client than one of them."""
    view = memoryview(content)

    async def pieces() -> AsyncIterator[memoryview]:
        for at in range(first, end, PIECE):
            yield view[at : min(at + PIECE, end)]

    length = {"content-length": str(end - first)}
    return StreamingResponse(pieces(), status, {**headers, **length})

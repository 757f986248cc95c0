"""The Chrome DevTools Protocol over a pipe (`--remote-debugging-pipe`): JSON messages, each ended by a
zero byte. Chromium reads descriptor 3 and writes descriptor 4; no port is opened.

Source: https://chromedevtools.github.io/devtools-protocol/
"""

import asyncio
import json
import os
from collections.abc import Callable, Mapping
from typing import Any, Final

BROWSER_READS: Final = 3
BROWSER_WRITES: Final = 4
END: Final = b"\0"
LONGEST_MESSAGE: Final = 1 << 24  # bytes

Event = Mapping[str, Any]


class DevToolsError(Exception):
    """The browser refused a command, or is gone."""


class NoResponse(DevToolsError):
    """The browser, or its page, did not answer in time."""


class DevTools:
    """One browser's end of the protocol. `on_event` gets (method, parameters)."""

    def __init__(self, on_event: Callable[[str, Event], None]) -> None:
        self._on_event = on_event
        self._replies: dict[int, asyncio.Future[Event]] = {}
        self._last = 0
        self._reader: asyncio.ReadTransport | None = None
        self._writer: asyncio.WriteTransport | None = None
        self._reading: asyncio.Task[None] | None = None

    async def open(self, read_fd: int, write_fd: int) -> None:
        """Takes over both descriptors."""
        loop = asyncio.get_running_loop()
        reader = asyncio.StreamReader(limit=LONGEST_MESSAGE)
        self._reader, _ = await loop.connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(read_fd, "rb", 0)
        )
        self._writer, _ = await loop.connect_write_pipe(
            asyncio.BaseProtocol, os.fdopen(write_fd, "wb", 0)
        )
        self._reading = asyncio.create_task(self._read(reader))

    async def call(
        self, method: str, timeout_s: float, session: str = "", **params: Any
    ) -> dict[str, Any]:
        """The result of a command; NoResponse if there is none within `timeout_s`."""
        if self._writer is None or self._writer.is_closing():
            raise DevToolsError(f"{method}: the browser is gone")
        self._last += 1
        number = self._last
        message = {"id": number, "method": method, "params": params}
        if session:
            message["sessionId"] = session
        self._replies[number] = reply = asyncio.get_running_loop().create_future()
        self._writer.write(json.dumps(message).encode() + END)
        try:
            async with asyncio.timeout(timeout_s):  # wait_for of Python 3.11 may lose a cancellation
                response = await reply
        except TimeoutError:
            raise NoResponse(f"{method}: no response within {timeout_s:g} s") from None
        finally:
            self._replies.pop(number, None)
        if "error" in response:
            raise DevToolsError(f"{method}: {response['error'].get('message')}")
        return dict(response["result"])

    def close(self) -> None:
        for transport in (self._writer, self._reader):
            if transport is not None and not transport.is_closing():
                transport.close()
        if self._reading is not None:
            self._reading.cancel()
        self._fail()

    async def _read(self, reader: asyncio.StreamReader) -> None:
        try:
            while True:
                self._received(json.loads((await reader.readuntil(END))[:-1]))
        except (asyncio.IncompleteReadError, OSError):  # the browser has ended
            self._fail()

    def _received(self, message: Event) -> None:
        reply = self._replies.get(message.get("id", 0))
        if reply is not None and not reply.done():
            reply.set_result(message)
        elif "method" in message:
            self._on_event(message["method"], message.get("params", {}))

    def _fail(self) -> None:
        for reply in self._replies.values():
            if not reply.done():
                reply.set_exception(DevToolsError("the browser is gone"))

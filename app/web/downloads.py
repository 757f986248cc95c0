"""Downloads: exports as CSV, and recordings that are shared with Foxglove."""

import asyncio
import logging
import os
import secrets
import time
import weakref
from collections import OrderedDict
from collections.abc import Callable, Mapping
from contextlib import AbstractAsyncContextManager, AsyncExitStack
from dataclasses import dataclass
from datetime import datetime
from typing import Final, NamedTuple
from urllib.parse import urlencode

from fastapi import Request
from fastapi.responses import FileResponse, Response
from starlette.datastructures import MutableHeaders
from starlette.types import Message, Receive, Scope, Send

from app.system.clock import iso_time
from app.system.errors import KioskError
from app.system.worker import RunningWorker

# The response with a file that another process makes, such as an export as CSV.

log = logging.getLogger("kiosk.log")

TAKEN_WITHIN_S: Final = 20.0  # a piece of an export: another one may be waited for
EXPORT_TYPES: Final = {".csv": "text/csv", ".zip": "application/zip"}
START: Final = "http.response.start"
BODY: Final = "http.response.body"


class Exported(Response):
    """The response with an export, sent piece by piece. An export that fails, or that no client reads,
    is not terminated: no client takes it for complete."""

    def __init__(
        self,
        export: RunningWorker,
        first: bytes,
        encoding: Mapping[str, str],
        opened: AsyncExitStack,
        name: str,
        suffix: str,
    ) -> None:
        """`encoding` are its headers; `opened` is closed when it is over; `name` says what is exported:
        "operator's log"."""
        self._name = name
        self.media_type = EXPORT_TYPES[suffix]
        begin = name.replace(" ", "-").replace("'", "")
        name = f"{begin}-{datetime.now().strftime('%Y%m%d-%H%M%S')}{suffix}"
        headers = {"content-disposition": f'attachment; filename="{name}"', "cache-control": "no-store"}
        headers |= encoding
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
            except KioskError as error:
                if not going.done():
                    log.warning("an export of the %s broke off: %s", self._name, error)
            going.cancel()

    async def _send(self, send: Send, going: "asyncio.Task[None]") -> None:
        await _send_in_time(send, {"type": START, "status": 200, "headers": self.raw_headers})
        piece: bytes | None = self._first
        while piece is not None and not going.done():
            await _send_in_time(send, {"type": BODY, "body": piece, "more_body": True})
            piece = await self._export.next_result()
        await self._opened.aclose()  # who has it whole may ask for the next
        await _send_in_time(send, {"type": BODY, "body": b"", "more_body": False})

    async def _gone(self, receive: Receive) -> None:
        """Returns when the client has disconnected."""
        while (await receive())["type"] != "http.disconnect":
            pass
        self._export.kill()


async def exported(
    request: Request,
    export: Callable[[bool], AbstractAsyncContextManager[RunningWorker]],
    name: str,
) -> Exported:
    """The response with an export, which gets whether it is compressed; LogError if it can't begin."""
    gzip = "gzip" in request.headers.get("accept-encoding", "")
    encoding = {"content-encoding": "gzip", "vary": "accept-encoding"} if gzip else {}
    return await _begun(export(gzip), encoding, name, ".csv")


async def exported_zip(export: AbstractAsyncContextManager[RunningWorker], name: str) -> Exported:
    """The response with a zip; the error of `export` if it can't begin."""
    return await _begun(export, {"content-encoding": "identity"}, name, ".zip")


async def _begun(
    export: AbstractAsyncContextManager[RunningWorker],
    encoding: Mapping[str, str],
    name: str,
    suffix: str,
) -> Exported:
    async with AsyncExitStack() as opened:
        running = await opened.enter_async_context(export)
        first = await running.next_result()
        return Exported(running, first, encoding, opened.pop_all(), name, suffix)


async def _send_in_time(send: Send, message: Message) -> None:
    """TimeoutError where no client takes it."""
    async with asyncio.timeout(TAKEN_WITHIN_S):
        await send(message)


# Recordings that are shared with Foxglove for some minutes, each below an address with a secret token.
#
# Foxglove reads a file from another origin, without the panel's cookies: the token in the address is
# what permits it. Recordings are in memory only and end with the server. Used on the event loop only.

MCAP: Final = "application/octet-stream"  # it has no media type of its own
VALID_S: Final = 600.0
COUNT_MOST: Final = 3
BYTES_MOST: Final = 64_000_000  # of all together; the newest is kept, however large it is
TOKEN_BYTES: Final = 32
BROWSER: Final = "https://app.foxglove.dev/~/view"
DESKTOP: Final = "foxglove://open"


class MemoryFile:
    """A file that is in memory only, as long as someone has this object."""

    def __init__(self, content: bytes) -> None:
        self._file = os.memfd_create("recording")
        weakref.finalize(self, os.close, self._file)
        with open(self._file, "wb", closefd=False) as file:
            file.write(content)
        self.path = f"/proc/self/fd/{self._file}"
        self.size = len(content)


@dataclass(frozen=True, slots=True, repr=False)
class SharedRecording:
    """An MCAP file as it was at `at`; `until` is when it ends: both in seconds since the epoch. `robot`
    is the robot's id, "" on a panel with one robot; `act_id` is the act that shared it. `stop` is the
    key of the stop that it is about and `moment` the time of that, "" and None of a last minute."""

    token: str
    file: MemoryFile
    robot: str
    act_id: str
    at: float
    until: float
    stop: str = ""
    moment: float | None = None


class SharedRecordings:
    """The latest recordings, at most `COUNT_MOST` of `BYTES_MOST` together, each for `valid_s`."""

    def __init__(self, valid_s: float = VALID_S) -> None:
        self._valid_s = valid_s
        self._by_token: OrderedDict[str, SharedRecording] = OrderedDict()  # the oldest first

    def share(
        self, content: bytes, robot: str, act_id: str, stop: str = "", moment: float | None = None
    ) -> SharedRecording:
        """Shares a file under a new token; the oldest ones end if there are too many."""
        now = time.time()
        recording = SharedRecording(
            token=secrets.token_urlsafe(TOKEN_BYTES),
            file=MemoryFile(content),
            robot=robot,
            act_id=act_id,
            at=now,
            until=now + self._valid_s,
            stop=stop,
            moment=moment,
        )
        self._by_token[recording.token] = recording
        while len(self._by_token) > 1 and self._too_many():
            self._by_token.popitem(last=False)
        asyncio.get_running_loop().call_later(self._valid_s, self._end, recording.token)
        return recording

    def by_token(self, token: str) -> SharedRecording | None:
        """The recording with this token, until it ends."""
        return self._by_token.get(token)

    def by_act(self, act_id: str) -> SharedRecording | None:
        """The recording that this act shared, until it ends."""
        return next((shared for shared in self._by_token.values() if shared.act_id == act_id), None)

    def latest(self, robot: str) -> SharedRecording | None:
        """The newest last minute of a robot, until it ends."""
        shared = (s for s in reversed(self._by_token.values()) if s.robot == robot and not s.stop)
        return next(shared, None)

    def of_stop(self, stop: str) -> SharedRecording | None:
        """The newest recording of a stop, by its key, until it ends."""
        return next((s for s in reversed(self._by_token.values()) if s.stop == stop), None)

    def _too_many(self) -> bool:
        size = sum(recording.file.size for recording in self._by_token.values())
        return len(self._by_token) > COUNT_MOST or size > BYTES_MOST

    def _end(self, token: str) -> None:
        self._by_token.pop(token, None)


class SharedFile(FileResponse):
    """The response with a recording or with ranges of it. All its answers have these headers, which a
    page of another origin needs."""

    def __init__(self, recording: SharedRecording, headers: Mapping[str, str]) -> None:
        self._file = recording.file  # as long as it is sent
        self._every = headers
        super().__init__(self._file.path, media_type=MCAP)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_with_headers(message: Message) -> None:
            if message["type"] == START:
                MutableHeaders(scope=message).update(self._every)
            await send(message)

        await super().__call__(scope, receive, send_with_headers)


class SharedLinks(NamedTuple):
    """Where a shared recording is, and the links that open it in Foxglove in a browser and in its
    desktop app."""

    recording: SharedRecording
    address: str
    browser: str
    desktop: str


def links_of(recording: SharedRecording, base_url: str) -> SharedLinks:
    """The links of a recording; `base_url` is that of the panel as the client names it."""
    address = f"{base_url.rstrip('/')}/recordings/shared/{recording.token}.mcap"
    query = {"ds": "remote-file", "ds.url": address}
    if recording.moment is not None:
        query["time"] = iso_time(recording.moment)  # where Foxglove begins
    source = urlencode(query)
    return SharedLinks(recording, address, f"{BROWSER}?{source}", f"{DESKTOP}?{source}")

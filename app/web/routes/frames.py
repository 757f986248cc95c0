"""The pictures of cameras: a WebSocket for each camera that is seen, and one picture by itself.

A browser asks for the next picture once it has drawn the last: so nothing piles up, however slow it is,
and nothing is sent to a page that is hidden. Not a request for each, nor a stream: a browser has six
connections to one host for all its pages, and each page's events take one; sockets are not counted.

    browser  {"next": true}
    server   {"number": 41, "type": "image/jpeg", "time": "10:00:00"}, and then its bytes
    browser  {"next": true}

A picture that can't be shown is none: the events say why, and the next one is waited for.
"""

import asyncio
import json
import logging
from contextlib import suppress
from typing import Annotated, Any, Final

from fastapi import APIRouter, Query, Request, WebSocket, WebSocketDisconnect
from fastapi.responses import Response

from app.cell.robot.pictures import NoPicture, Picture
from app.cell.session.frames import Feed, Frame
from app.panel.widgets.displays import Camera
from app.system.clock import format_time
from app.system.concurrency import spawn_logged
from app.system.errors import NotFound, TooMany
from app.system.texts import render, say
from app.web.app_state import AppState, CurrentSession, CurrentState
from app.web.caller import caller_of
from app.web.requests import Described, errors, received

log = logging.getLogger("kiosk.web")

router = APIRouter()

FIRST_WITHIN_S: Final = 2.0  # for the first picture of a topic that no browser showed
AFTER_WITHIN_S: Final = 10.0
BAD_PAUSE_S: Final = 0.2  # between two pictures that can't be shown
SILENT_S: Final = 10.0  # without a request while none is open
TRY_AGAIN_LATER: Final = 4429  # 4000 + HTTP's
SILENT: Final = 4408
SIGNED_OUT: Final = 4403
IMAGES: Final[Described] = {
    200: {
        "content": {
            kind: {"schema": {"type": "string", "format": "binary"}}
            for kind in ("image/jpeg", "image/png", "image/webp")
        }
    }
}


@router.get(
    "/widgets/{widget}/frame",
    response_class=Response,
    summary="The newest picture of a camera; with `after`, the next one after that number",
    responses=errors(403, 404, 422, 429) | IMAGES,
)
async def frame(
    widget: str, request: Request, session: CurrentSession, after: Annotated[int, Query(ge=0)] = 0
) -> Response:
    camera = session.panel.widget(widget, Camera)
    feed = session.frames.feed(camera)
    with feed.subscribed(caller_of(request).key):
        try:
            async with asyncio.timeout(AFTER_WITHIN_S if after else FIRST_WITHIN_S):
                shown, picture = await _next(feed, camera, after)
        except TimeoutError:
            raise NotFound(say("camera_none")) from None
    headers = {
        "cache-control": "no-store",
        "x-frame": str(shown.number),
        "x-frame-time": f"{shown.wall:.3f}",
        "content-encoding": "identity",  # to pack it would stop the event loop, for next to nothing
    }
    return Response(picture.data, media_type=picture.media_type, headers=headers)


@router.websocket("/widgets/{widget}/frames")
async def frames(socket: WebSocket, widget: str, state: CurrentState, session: CurrentSession) -> None:
    camera = session.panel.widget(widget, Camera)
    await socket.accept()
    served = _FrameSocket(socket, session.frames.feed(camera), camera, state)
    with suppress(WebSocketDisconnect), state.access.notifying(served.check_user):
        try:
            await served.run()
        except TooMany:
            await socket.close(TRY_AGAIN_LATER)


async def _next(feed: Feed, camera: Camera, after: int) -> tuple[Frame, Picture]:
    """The next frame that can be shown."""
    while True:
        frame = await feed.newer(after)
        try:
            return frame, await feed.picture(frame, camera)
        except NoPicture:
            after = frame.number
            await asyncio.sleep(BAD_PAUSE_S)


class _FrameSocket:
    """One browser that shows one camera."""

    def __init__(self, socket: WebSocket, feed: Feed, camera: Camera, state: AppState) -> None:
        self._socket = socket
        self._state = state
        self._who = caller_of(socket)
        self._then = self._who.principal
        self._ended = False
        self._feed = feed
        self._camera = camera
        self._requested = asyncio.Event()
        self._waits = False  # for the picture that it asked for
        self._language = self._who.language

    def check_user(self) -> None:
        """Closes the socket of a user who has signed out, is disabled, or may do something else now; a
        page that may see the camera opens another one."""
        now, then = self._who.principal, self._then
        same = (now.user, now.role, now.groups) == (then.user, then.role, then.groups)
        if self._ended or (same and not self._who.signed_in_since):
            return
        self._ended = True
        spawn_logged(self._close(), log, "closing a camera's socket failed")

    async def _close(self) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):  # the browser was faster
            await self._socket.close(SIGNED_OUT)

    async def run(self) -> None:
        """Sends frames until the browser closes the WebSocket."""
        with self._feed.subscribed(self._who.key):
            writing = spawn_logged(self._send_pictures(), log, "sending pictures failed")
            try:
                while await self._read():
                    pass
            finally:
                writing.cancel()
                await asyncio.gather(writing, return_exceptions=True)

    async def _read(self) -> bool:
        """Receives a request; False at the end. A browser that asks for nothing has no place here."""
        try:
            async with asyncio.timeout(SILENT_S):
                message = await received(self._socket)
        except TimeoutError:
            if not self._waits:
                await self._socket.close(SILENT)
            return self._waits
        if message.get("text"):
            self._waits = True
            self._requested.set()
        return bool(message["type"] == "websocket.receive")

    async def _send_pictures(self) -> None:
        with suppress(WebSocketDisconnect):
            await self._write()

    async def _write(self) -> None:
        """Sends the newest picture each time that one is asked for, not too often."""
        loop, number = asyncio.get_running_loop(), 0
        while True:
            await self._requested.wait()
            if self._ended:
                return
            self._requested.clear()
            shown, picture = await _next(self._feed, self._camera, number)
            if self._ended:
                return
            due, number = loop.time() + 1 / self._camera.max_hz, shown.number
            about: dict[str, Any] = {
                "number": number,
                "type": picture.media_type,
                "time": render(format_time(shown.wall), self._language),
            }
            await self._socket.send_text(json.dumps(about))
            await self._socket.send_bytes(picture.data)
            self._waits = self._requested.is_set()
            await asyncio.sleep(due - loop.time())

"""The event stream: a snapshot first, then changes, and a heartbeat that never stops."""

import asyncio
from collections.abc import Callable
from typing import Final

from fastapi import APIRouter, Request
from fastapi.responses import Response
from starlette.types import Message, Receive, Scope, Send

from app.panel.rules import ControlRules
from app.permission.control_authority_view import Role, role
from app.permission.principal import Principal
from app.view.heartbeat import beat
from app.view.publisher import EVERYTHING, Reader, ViewPublisher, client_id_event
from app.web.app_state import CurrentSession, CurrentState
from app.web.asgi import server_send
from app.web.client_cookie import principal_with_new_token, set_client_cookie
from app.web.embedding import from_frame, only_shows
from app.web.language import language_of
from app.web.metrics import Open
from app.web.openapi_parts import TEXT, errors

router = APIRouter()

RECONNECT_MS: Final = 500

HEADERS: Final = {"cache-control": "no-store", "x-accel-buffering": "no"}
MEDIA_TYPE: Final = "text/event-stream"


@router.get(
    "/events",
    response_class=Response,
    responses=errors(403, 404, 422) | {200: {"content": {MEDIA_TYPE: {"schema": TEXT}}}},
    summary="Server-sent events: snapshot, <interlock>-enabled-updated, update, link, control, beat",
)
async def events(
    request: Request,
    state: CurrentState,
    session: CurrentSession,
    once: bool = False,
    page: str = "",
    embed: bool = False,
) -> Response:
    """`once`: one snapshot and the end, for programs. `page`: of its widgets only, and those of the
    frame; without one, or with one that the panel does not have, of all. `embed`: for a page in a
    frame."""
    publisher, rules = session.publisher, session.control.rules
    embedded = embed or from_frame(request.scope)
    who, token = None, ""
    if only_shows(state.fleet.panel.embed, embedded):
        role_now = embedded_role
    elif rules.required:
        who, token = principal_with_new_token(request, state, embedded)
        role_now = _role_of(who, publisher, rules)
    else:
        role_now = no_role
    first = client_id_event(who.client.id) if who else b""
    answer: Response
    reader = publisher.reader(language_of(request), page)
    if once:
        all_of_it = publisher.snapshot(reader, role_now()) + first + beat(reader.language)
        answer = Response(all_of_it, media_type=MEDIA_TYPE, headers=HEADERS)
    else:
        answer = EventStream(publisher, first, state.metrics.streams, reader, role_now)
    return set_client_cookie(answer, request, token)


def _role_of(who: Principal, publisher: ViewPublisher, rules: ControlRules) -> Callable[[], Role]:
    return lambda: role(publisher.view["control"], who, rules)


def no_role() -> Role:
    """The role of all clients if control is not required."""
    return ""


def embedded_role() -> Role:
    """The role of a page in a frame that may only show."""
    return "embedded"


class EventStream(Response):
    """The event stream of one browser, until it disconnects or the publisher is closed. While the
    browser does not read, the stream waits, and then continues with the newest view."""

    media_type = MEDIA_TYPE

    def __init__(
        self,
        publisher: ViewPublisher,
        first: bytes,
        streams: Open,
        reader: Reader = EVERYTHING,
        role: Callable[[], Role] = no_role,
    ) -> None:
        """`first` is sent with the snapshot; `streams` counts the open streams; `role` returns the
        client's role in control."""
        self._publisher = publisher
        self._first = first
        self._streams = streams
        self._reader = reader
        self._role = role
        self.status_code = 200
        self.background = None
        self.init_headers(HEADERS)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": self.raw_headers})
        with self._streams.another(), self._publisher.heartbeat.heard():
            async with asyncio.TaskGroup() as group:
                # A task of its own: waking it wakes nothing of what the request came through.
                writing = group.create_task(self._write(server_send(scope, send)))
                while (await receive())["type"] != "http.disconnect":
                    pass
                writing.cancel()

    async def _write(self, send: Send) -> None:
        publisher, reader, role_now = self._publisher, self._reader, self._role
        heartbeat, now = publisher.heartbeat, role_now()
        version, view, beats = publisher.version, publisher.for_role(now), heartbeat.count
        await send(_body(self._beginning(now)))
        while not publisher.closed:
            await publisher.wait_for_change(version, beats)
            chunk = b""
            if publisher.version > version:
                was, now = now, role_now()
                chunk = publisher.events_since(version, view, reader, was, now)
                version, view = publisher.version, publisher.for_role(now)
            if heartbeat.count > beats:
                chunk += heartbeat.event(reader.language)
                beats = heartbeat.count
            if chunk:
                await send(_body(chunk))
        await send({"type": "http.response.body", "body": b"", "more_body": False})

    def _beginning(self, role: Role) -> bytes:
        retry = f"retry: {RECONNECT_MS}\n\n".encode()
        snapshot = self._publisher.snapshot(self._reader, role)
        return retry + snapshot + self._first + beat(self._reader.language)


def _body(chunk: bytes) -> Message:
    return {"type": "http.response.body", "body": chunk, "more_body": True}

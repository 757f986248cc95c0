"""The event stream: a snapshot first, then changes, and a heartbeat that never stops."""

import asyncio
from collections.abc import Callable
from typing import Final

from fastapi import APIRouter, Request
from fastapi.responses import Response
from starlette.types import Message, Receive, Scope, Send

from app.i18n import ENGLISH
from app.permission.control_authority_view import Role, role
from app.view.heartbeat import beat
from app.view.publisher import ViewPublisher, client_id_event
from app.web.app_state import CurrentSession, CurrentState
from app.web.asgi import server_send
from app.web.client_cookie import principal_with_new_token, set_client_cookie
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
) -> Response:
    """`once`: one snapshot and the end, for programs. `page`: of its widgets only, and those of the
    frame; without one, or with one that the panel does not have, of all."""
    publisher, rules = session.publisher, session.control.rules
    who, token = principal_with_new_token(request, state) if rules.required else (None, "")
    first = client_id_event(who.client.id) if who else b""

    def role_now() -> Role:
        return role(publisher.view["control"], who, rules) if who else ""

    answer: Response
    language = language_of(request)
    if once:
        all_of_it = publisher.snapshot(language, role_now(), page) + first + beat(language)
        answer = Response(all_of_it, media_type=MEDIA_TYPE, headers=HEADERS)
    else:
        answer = EventStream(publisher, first, state.metrics.streams, language, role_now, page)
    return set_client_cookie(answer, request, token)


def no_role() -> Role:
    """The role of all clients if control is not required."""
    return ""


class EventStream(Response):
    """The event stream of one browser, until it disconnects or the publisher is closed. While the
    browser does not read, the stream waits, and then continues with the newest view."""

    media_type = MEDIA_TYPE

    def __init__(
        self,
        publisher: ViewPublisher,
        first: bytes,
        streams: Open,
        language: str = ENGLISH,
        role: Callable[[], Role] = no_role,
        page: str = "",
    ) -> None:
        """`first` is sent with the snapshot; `streams` counts the open streams; `role` returns the
        client's role in control, `page` is the id of its page."""
        self._page = page
        self._publisher = publisher
        self._first = first
        self._streams = streams
        self._language = language
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
        publisher, heartbeat, language = self._publisher, self._publisher.heartbeat, self._language
        page = self._page
        now = self._role()
        version, view, beats = publisher.version, publisher.for_role(now, page), heartbeat.count
        retry = f"retry: {RECONNECT_MS}\n\n".encode()
        await send(
            _body(retry + publisher.snapshot(language, now, page) + self._first + beat(language))
        )
        while not publisher.closed:
            await publisher.wait_for_change(version, beats)
            was, now = now, self._role()
            newer = publisher.version > version
            chunk = publisher.events_since(version, view, language, was, now, page) if newer else b""
            if heartbeat.count > beats:
                chunk += heartbeat.event(language)
            version, view, beats = publisher.version, publisher.for_role(now, page), heartbeat.count
            if chunk:
                await send(_body(chunk))
        await send({"type": "http.response.body", "body": b"", "more_body": False})


def _body(chunk: bytes) -> Message:
    return {"type": "http.response.body", "body": chunk, "more_body": True}

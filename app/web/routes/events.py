"""The event stream: a snapshot first, then changes, and a heartbeat that never stops."""

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Final

from fastapi import APIRouter, Request
from fastapi.responses import Response
from starlette.types import Message, Receive, Scope, Send

from app.cell.permission.roles import unmet
from app.cell.view.publisher import ViewPublisher, beat, client_id_event
from app.cell.view.view import EVERYONE, NOTHING, Audience, audience, audience_of
from app.panel.rules import ControlRules
from app.web.app_state import AppState, CurrentSession, CurrentState
from app.web.asgi import server_send
from app.web.caller import Caller, caller_of, only_shows
from app.web.metrics import Open
from app.web.requests import TEXT, errors

router = APIRouter()

RECONNECT_MS: Final = 500

HEADERS: Final = {"cache-control": "no-store", "x-accel-buffering": "no"}
MEDIA_TYPE: Final = "text/event-stream"


@router.get(
    "/events",
    response_class=Response,
    responses=errors(403, 404, 422) | {200: {"content": {MEDIA_TYPE: {"schema": TEXT}}}},
    summary="Server-sent events: snapshot, <interlock>-enabled-updated, update, alarms, link, beat, …",
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
    first, token, asks = b"", "", caller_of(request)
    embedded, language = embed or asks.from_frame, asks.language
    only = only_shows(state.fleet.panel.embed, embedded)
    if rules.required and not only:
        who, token = asks.identified(embedded)
        first = client_id_event(who.client.id)
        asks.token = token or asks.token
    current = partial(_audience_now, state, publisher, asks, rules, language, only)
    shown = publisher.shown_page(page)
    answer: Response
    if once:
        with publisher.watching(shown):
            everything = publisher.snapshot(current(), shown) + first + beat(language)
        answer = Response(everything, media_type=MEDIA_TYPE, headers=HEADERS)
    else:
        is_other_user = partial(_is_other_user, asks, asks.session is not None)
        answer = EventStream(publisher, first, state.metrics.streams, shown, current, is_other_user)
    return asks.with_client_cookie(answer, token)


def _is_other_user(asks: Caller, had_session: bool) -> bool:
    """Whether the user of the browser is another one than when its stream began, or no one: its page
    is told by the end of the stream, and asks who it is."""
    return asks.signed_in_since or (had_session and asks.session is None)


def _audience_now(
    state: AppState,
    publisher: ViewPublisher,
    asks: Caller,
    rules: ControlRules,
    language: str,
    embedded: bool,
) -> Audience:
    """The audience of a client now: it may have signed in or out, or the panel its first users, since
    its stream began. `embedded`: a page in a frame, which only shows."""
    has_roles = state.access.has_roles
    if not has_roles and (embedded or not rules.required):
        return audience("embedded" if embedded else "", language)
    who, needs = asks.principal, publisher.needs.named if has_roles else NOTHING
    if embedded:
        return audience("embedded", language, lacks=unmet(needs, who))
    control, others = publisher.view["control"], publisher.shared.controls
    return audience_of(who, control, rules, language, others, needs)


def _everyone() -> Audience:
    return EVERYONE


class EventStream(Response):
    """The event stream of one browser, until it disconnects or the publisher is closed. While the
    browser does not read, the stream waits, and then continues with the newest view."""

    media_type = MEDIA_TYPE

    def __init__(
        self,
        publisher: ViewPublisher,
        first: bytes,
        streams: Open,
        page: str = "",
        audience: Callable[[], Audience] = _everyone,
        is_outdated: Callable[[], bool] = bool,
    ) -> None:
        """`first` is sent with the snapshot; `streams` counts the open streams; `page` is the page
        whose widgets it sends, "" for all; `audience` returns that of the client now. It ends when it
        `is_outdated`, after what has changed with that: the browser opens another one, with the cookie
        of its new session."""
        self._publisher = publisher
        self._first = first
        self._streams = streams
        self._page = page
        self._audience = audience
        self._is_outdated = is_outdated
        self.status_code = 200
        self.background = None
        self.init_headers(HEADERS)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": self.raw_headers})
        publisher = self._publisher
        with (
            self._streams.another(),
            publisher.heartbeat.heard(),
            publisher.watching(self._page),
        ):
            async with asyncio.TaskGroup() as group:
                # A task of its own: waking it wakes nothing of what the request came through.
                writing = group.create_task(self._write(server_send(scope, send)))
                while (await receive())["type"] != "http.disconnect":
                    pass
                writing.cancel()

    async def _write(self, send: Send) -> None:
        publisher, page = self._publisher, self._page
        heartbeat, audience = publisher.heartbeat, self._audience()
        version, view, beats = publisher.version, publisher.for_audience(audience), heartbeat.count
        await send(_body(self._beginning(audience)))
        while not publisher.closed:
            await publisher.wait_for_change(version, beats)
            is_over = publisher.version > version and self._is_outdated()
            chunk = b""
            if publisher.version > version:
                before, audience = audience, self._audience()
                chunk = publisher.events_since(version, view, audience, page, before)
                version, view = publisher.version, publisher.for_audience(audience)
            if heartbeat.count > beats:
                chunk += heartbeat.event(audience.language)
                beats = heartbeat.count
            if chunk:
                await send(_body(chunk))
            if is_over:
                break
        await send({"type": "http.response.body", "body": b"", "more_body": False})

    def _beginning(self, audience: Audience) -> bytes:
        retry = f"retry: {RECONNECT_MS}\n\n".encode()
        snapshot = self._publisher.snapshot(audience, self._page)
        return retry + snapshot + self._first + beat(audience.language)


def _body(chunk: bytes) -> Message:
    return {"type": "http.response.body", "body": chunk, "more_body": True}

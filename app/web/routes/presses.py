"""Presses over HTTP: as JSON, by WebSocket, and as forms for a browser without scripts."""

import asyncio
import json
import logging
import re
import secrets
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Annotated, Any, Final
from urllib.parse import quote

from fastapi import APIRouter, Query, Request, WebSocket, WebSocketDisconnect
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from pydantic import BaseModel, ConfigDict, Field, JsonValue, WithJsonSchema
from starlette.routing import Route
from starlette.types import Message

from app.cell.commands.judge import RETRY_AFTER_S
from app.cell.commands.press import EVENT_ID, MAX_ID_LENGTH, PRESS_ID, Press
from app.cell.commands.receipts import Receipt
from app.cell.session.session import RobotSession
from app.panel.layout import Page
from app.panel.model import Panel
from app.panel.widgets.families import PressCommand
from app.panel.widgets.recipe_load import RecipeLoad
from app.panel.widgets.switch import Switch
from app.panel.widgets.templated import is_stop
from app.records.principal import Principal
from app.system import clock
from app.system.errors import InputError, KioskError
from app.system.printable import printable_texts
from app.system.texts import TextLike, localized, say
from app.web.answers import STATUS, ReceiptAnswer
from app.web.app_state import AppState, CurrentSession, CurrentState, PageSession, site_of
from app.web.caller import LONGEST_TOKEN, Caller, caller_of, confirmed
from app.web.pages.words import ask_of
from app.web.requests import (
    FORM,
    JSON,
    PAGE,
    TEXT,
    Described,
    ErrorAnswer,
    FormFields,
    Moment,
    as_model,
    body_of,
    described_body,
    errors,
    form_moment,
    form_of,
    is_second_tap,
    json_of,
    kind_of,
    received,
    refusals,
)
from app.web.route_needs import check_route

# A press as a form, for a browser without scripts: the answer is the page again, with the receipt.
#
# What a person confirms with a PIN needs scripts, as recipes do: such a form is refused.


@dataclass(frozen=True, slots=True)
class PressForm:
    """A form that presses a widget. `fields` are its texts: of inputs, and of the page, whose names
    begin with "_"; the latter are removed as they are read. `stopped` are the robots of a press that
    stops several."""

    caller: Caller
    fields: dict[str, str] = field(repr=False)
    widget: PressCommand
    stopped: Sequence[RobotSession] = ()


CONFIRMED: Final = "_confirmed"  # a form's field: the server has asked, and this is the yes
QUESTION_LIFE_S: Final = 30.0  # the answer is a press, and no later one


async def pressed_by_form(
    state: AppState, page: RobotSession, session: RobotSession, form: PressForm
) -> Response:
    """The response to a press: a redirect to the page with its receipt, or the question before the
    press. `session` is that of the widget's robot, `page` that of the robot whose page it was."""
    fields, presses = form.fields, session.presses
    too_soon, before = is_second_tap(fields), fields.pop("_last", "")
    fields.pop("_since", None)
    if is_stop(form.widget) and not form.widget.asks:
        too_soon = False  # to stop twice does no harm
    shown_on = fields.pop("_page", "")
    answered = fields.pop(CONFIRMED, "") == "yes" and not too_soon
    if form.widget.asks and not form.widget.confirmation and not answered:
        return _ask(state, page, session, form, shown_on)
    press = _press_of(state, session, form)
    if not state.limits.admit(press.principal):
        receipt = presses.limited(press, shown=True)
    elif form.stopped and not too_soon:
        receipt = await state.fleet.group_stops.press(form.stopped, press, state.counted)
    else:
        session.press_guard.receive(press)
        work = presses.too_soon(press, before) if too_soon else presses.press(press)
        receipt = await state.counted(work)
    path = page_after(state, page, press.widget.id, receipt.id, shown_on)
    return RedirectResponse(path, status_code=303)


def _press_of(state: AppState, session: RobotSession, form: PressForm) -> Press[PressCommand]:
    """The press of a form. One rendered page has one id for all its buttons, and each button is a press
    of its own."""
    fields, widget = form.fields, form.widget
    page_id = fields.pop("_id", secrets.token_hex(8))
    if not re.fullmatch(PRESS_ID, page_id):
        raise InputError(f'_id: "{page_id:.40}" is not the id of a press')
    seen, until = fields.pop("_seen", ""), _until(fields)
    language = _language(state, form)
    inputs = session.dispatcher.parse_form(fields, language)
    return Press(f"{page_id}.{widget.id}", widget, inputs, form.caller.principal, seen, until)


def _ask(
    state: AppState, page: RobotSession, session: RobotSession, form: PressForm, shown_on: str
) -> Response:
    """The page that asks before a press; its answer is the press."""
    widget = form.widget
    html = state.templates.render(
        "ask.html",
        form.caller.language,
        site=state,
        display=form.caller.display,
        panel=state.fleet.panel,
        banner=session.publisher.view["notice"]["banner"],
        question=ask_of(session, widget),
        action=f"{page.base}/widgets/{widget.id}{_robots(form)}",
        back=page_after(state, page, widget.id, "", shown_on),
        fields={
            **form.fields,
            "_page": shown_on,
            CONFIRMED: "yes",
            # What the page showed before the question counts, such as the map of a goal.
            "_seen": form.fields.get("_seen") or page.publisher.id,
            "_until": str(round(clock.server_now() + QUESTION_LIFE_S, 3)),
            "_since": str(round(clock.server_now(), 3)),
        },
        entries=printable_texts(form.fields),
        no=say("back"),
        empty=say("empty"),
        label=_label(form),
    )
    return HTMLResponse(html, headers={"cache-control": "no-store"})


def _robots(form: PressForm) -> str:
    """The query that names the robots of a press that stops several."""
    names = ",".join(str(session.entry.id) for session in form.stopped if session.entry)
    return f"?robots={names}" if names else ""


def _label(form: PressForm) -> TextLike:
    """The label of the button that was touched."""
    widget = form.widget
    if isinstance(widget, Switch):
        return widget.on if form.fields.get(widget.id) == "true" else widget.off
    return widget.label


def _page_of(panel: Panel, widget: str, shown_on: str) -> Page:
    """The page of a widget that it was `shown_on`, else the first with it; one in the frame is on every
    page."""
    pressed_on = panel.page(shown_on)
    if any(shown.id == widget for shown in panel.frame.widgets):
        return pressed_on or panel.pages[0]
    if pressed_on and any(shown.id == widget for shown in pressed_on.widgets):
        return pressed_on
    pages = (page for page in panel.pages if any(shown.id == widget for shown in page.widgets))
    return next(pages, panel.pages[0])


def _until(fields: dict[str, str]) -> float | None:
    """When a page without scripts should have reloaded, if that is over, else now.

    It can't say when it was pressed, but a page that does not reload itself is none to press on.
    """
    until = form_moment(fields, "_until")
    fields.pop("_until", None)
    return until if until is None else min(until, clock.server_now())


def _language(state: AppState, form: PressForm) -> str:
    """The language of the page whose form this is: another page of the browser may have changed its
    language since. A program's form has the language of its request."""
    language = form.fields.pop("_language", form.caller.language)
    panel = state.fleet.panel
    if language not in (*panel.readers_languages, panel.language):
        raise InputError(f'_language: "{language:.40}" is not a language of this panel')
    return language


def page_after(
    state: AppState, page: RobotSession, widget: str, receipt_id: str, shown_on: str = ""
) -> str:
    """The path of a widget's page, with a receipt if there is one. `page` is the session of the robot
    whose page it was, `shown_on` the page's id where it was pressed, "" if unknown."""
    receipt = f"?receipt={quote(receipt_id)}" if receipt_id else ""
    return f"{page.base}/pages/{_page_of(state.fleet.panel, widget, shown_on).id}{receipt}"


router = APIRouter()

PRESSED: Final = "/widgets/{widget}"
ROBOTS_MOST: Final = 4000  # characters

# Pydantic's own has a reference within the model, which is not the description's.
INPUTS: Final = {"type": "object", "description": "values by the ids of inputs"}


Robots = Annotated[
    str,
    Query(
        max_length=ROBOTS_MOST,
        description="of a stop button of the frame: the ids of the robots to stop, by commas; each gets"
        " the command, and `receipts` has the receipt of each",
    ),
]


class PressBody(BaseModel):
    """What a client posts as JSON; only `inputs` is needed."""

    model_config = ConfigDict(extra="forbid", title="Press")

    inputs: Annotated[dict[str, JsonValue], WithJsonSchema(INPUTS)]
    id: Annotated[str, Field(pattern=PRESS_ID)] | None = None
    seen: Annotated[str, Field(pattern=EVENT_ID)] | None = None
    at: Moment | None = None
    confirmation: Annotated[str, Field(max_length=LONGEST_TOKEN)] = ""

    def press(self, widget: PressCommand, principal: Principal) -> Press[PressCommand]:
        """The press of a widget by a client. A press without an id gets one."""
        at = self.at.timestamp() if self.at else None
        press_id = self.id or secrets.token_hex(8)
        return Press(press_id, widget, self.inputs, principal, self.seen or "", at)


class Cancel(BaseModel):
    """What a client may post as JSON to cancel: the id of the goal's press; without it, it is the goal
    under way. What else comes with it is not judged: stopping stays easy."""

    press: str = ""


CANCEL_FORM: Final = FormFields({"_press": {}}, has_values=True)

RECEIPTS: Final[Described] = (
    errors(404, 408, 413)
    | refusals(ReceiptAnswer)
    | {
        303: {"description": "of a form: back to the page, with the receipt on it"},
        409: {
            "model": ReceiptAnswer,
            "description": "refused: an interlock, who has control, no such goal",
        },
        503: {
            "model": ReceiptAnswer | ErrorAnswer,
            "description": "no way to the robot, or to the log",
        },
    }
)


@router.post(
    PRESSED,
    response_model=ReceiptAnswer,
    summary="Press a widget",
    responses=RECEIPTS
    | {
        200: {"description": "done or under way; of a form: a page that asks first", "content": PAGE},
        422: {"model": ReceiptAnswer | ErrorAnswer, "description": "bad input"},
        504: {"model": ReceiptAnswer, "description": "no answer in time"},
    },
    openapi_extra=described_body(
        PressBody, {"type": "object", "additionalProperties": TEXT}, required=True
    ),
)
async def press(
    widget: str,
    request: Request,
    state: CurrentState,
    session: CurrentSession,
    page: PageSession,
    robots: Robots = "",
) -> Response:
    command = session.presses.widget(widget)
    stopped = state.fleet.stopped(widget, robots) if robots else ()
    caller = caller_of(request)
    who = caller.principal
    body = await body_of(request)
    kind = kind_of(request)
    if kind == JSON:
        posted = as_model(PressBody, json_of(body))
        pressed = confirmed(state, caller, posted.press(command, who), posted.confirmation)
        return _answer(request, await receipt_of_press(state, session, pressed, stopped))
    if kind == FORM:
        if isinstance(command, RecipeLoad):
            raise InputError(say("recipes_need_javascript"))
        form = PressForm(caller, form_of(body), command, stopped)
        return await pressed_by_form(state, page, session, form)
    raise InputError(f'a press is "{JSON}" or "{FORM}", not "{kind}"')


async def press_directly(request: Request) -> Response:
    """`press` without FastAPI's solving of dependencies, which takes a tenth of the CPU of a press."""
    state, widget = site_of(request), request.path_params["widget"]
    if state.access.has_roles:
        check_route(request, PRESSED)
    page = state.fleet.session(request.path_params.get("robot"))
    robots = request.query_params.get("robots", "")
    if len(robots) > ROBOTS_MOST:
        raise InputError(f"robots: it must have at most {ROBOTS_MOST} characters")
    return await press(widget, request, state, state.fleet.session_for(page, widget), page, robots)


def direct_routes(prefix: str) -> list[Route]:
    """The routes that stand before those of FastAPI, which describes them."""
    return [Route(prefix + PRESSED, press_directly, methods=["POST"])]


@router.post(
    "/widgets/{widget}/cancel",
    response_model=ReceiptAnswer,
    summary="Ask the robot to cancel an action's goal",
    responses=errors(422) | RECEIPTS,
    openapi_extra=described_body(Cancel, CANCEL_FORM.schema, required=False),
)
async def cancel(
    widget: str, request: Request, state: CurrentState, session: CurrentSession, page: PageSession
) -> Response:
    command = session.presses.widget(widget)
    who = caller_of(request).principal
    body, kind = await body_of(request), kind_of(request)
    form = kind == FORM
    press_id = ""
    if form:
        press_id = form_of(body).get("_press", "")
    elif kind == JSON and body:
        press_id = as_model(Cancel, json_of(body)).press
    canceling = Press("", command, {}, who)
    if state.limits.admit_cancel(who, session.base, widget, press_id[:MAX_ID_LENGTH]):
        receipt = await state.counted(session.presses.cancel(canceling, press_id))
    else:
        receipt = session.presses.limited(canceling, "cancel_too_often", shown=form)
    if form:
        return RedirectResponse(page_after(state, page, widget, receipt.id), status_code=303)
    return _answer(request, receipt)


async def receipt_of_press(
    state: AppState,
    session: RobotSession,
    press: Press[PressCommand],
    stopped: Sequence[RobotSession] = (),
) -> Receipt:
    """The receipt of a press in JSON, from HTTP or from a WebSocket. `stopped` are the robots of a
    press that stops several."""
    if not state.limits.admit(press.principal):
        return session.presses.limited(press)
    if stopped:
        return await state.fleet.group_stops.press(stopped, press, state.counted)
    session.press_guard.receive(press)
    return await state.counted(session.presses.press(press))


def _answer(request: Request, receipt: Receipt) -> Response:
    content = localized(receipt.as_json(), caller_of(request).language)
    headers = {"retry-after": str(RETRY_AFTER_S)} if receipt.cause == "limit" else None
    return JSONResponse(content, status_code=STATUS[receipt.cause], headers=headers)


# Presses by WebSocket: a page opens one at its first touch, and sends all its presses there.
#
# A press has the fields of a post's body, and `widget`. Its `id` is required, since answers come in any
# order. `status` is that of the answer to a post, with a receipt or an `error`:
#
#     browser  {"widget": "operation", "inputs": {…}, "id": "5f…", "seen": "<instance>-<n>", "at": …}
#     server   {"press": "5f…", "status": 200, "id": "5f…", "outcome": "published", "code": "…", …}
#     server   {"press": "5f…", "status": 404, "error": "…"}
#
# A client that closes the socket loses only the answers: presses that were begun are finished and
# logged.

log = logging.getLogger("kiosk.presses")


MOST_AT_ONCE: Final = 16  # presses of one socket that have no answer yet
MOST_REFUSED: Final = (
    100  # messages of one socket, one after the other, that are no press or one too many
)
POLICY_VIOLATION: Final = 1008  # RFC 6455
PLACE: Final = "the message"


class SocketPress(PressBody):
    """The message of one press; `robots` as in the query of a post."""

    widget: str
    id: Annotated[str, Field(pattern=PRESS_ID)]
    robots: str = ""


@router.websocket("/presses")
async def presses(socket: WebSocket, state: CurrentState, session: CurrentSession) -> None:
    """`session` is a dependency only to refuse the socket if there is no such robot."""
    await socket.accept()
    await _PressSocket(socket, state).run()


class _PressSocket:
    """One socket and its presses. Each press names the view that its page shows."""

    __slots__ = ("_caller", "_in_flight", "_language", "_refused", "_socket", "_state")

    def __init__(self, socket: WebSocket, state: AppState) -> None:
        self._socket = socket
        self._state = state
        self._caller = caller_of(socket)
        self._language = self._caller.language
        self._in_flight: set[asyncio.Task[None]] = set()
        self._refused = 0  # one after the other

    async def run(self) -> None:
        """Reads presses until the socket is closed, then waits until all have ended."""
        try:
            while (message := await received(self._socket))["type"] == "websocket.receive":
                await self._begin(message)
                if self._refused >= MOST_REFUSED:
                    await self._socket.close(POLICY_VIOLATION)
                    break
        finally:
            await asyncio.gather(*self._in_flight)

    async def _begin(self, message: Message) -> None:
        """Starts the press of a message, without waiting for its receipt."""
        fields: Any = None
        try:
            text = message.get("text")
            if text is None:
                raise InputError(f"{PLACE} is not text")
            fields = json_of(text, PLACE)
            body = as_model(SocketPress, fields, PLACE)
        except InputError as error:
            await self._refuse(_press_id(fields), error.status, error.text)
            return
        if len(self._in_flight) >= MOST_AT_ONCE:
            await self._refuse(body.id, 429, say("press_too_many_pending", most=MOST_AT_ONCE))
            return
        task = asyncio.create_task(self._press(body))
        self._in_flight.add(task)
        task.add_done_callback(self._in_flight.discard)

    async def _press(self, body: SocketPress) -> None:
        state, socket = self._state, self._socket
        try:
            shown = state.fleet.session(socket.path_params.get("robot"))
            session = state.fleet.session_for(shown, body.widget)
            who = self._caller.principal
            press = body.press(session.presses.widget(body.widget), who)
            press = confirmed(state, self._caller, press, body.confirmation)
            stopped = state.fleet.stopped(body.widget, body.robots) if body.robots else ()
            receipt = await receipt_of_press(state, session, press, stopped)
        except KioskError as error:
            await self._answer(body.id, error.status, error=error.text)
        except Exception:
            log.exception("press %s broke off", body.id)
            await self._answer(body.id, 500, error=say("press_server_error"))
        else:
            self._refused = self._refused + 1 if receipt.cause == "limit" else 0
            await self._answer(body.id, STATUS[receipt.cause], **receipt.as_json())

    async def _refuse(self, press_id: str | None, status: int, error: TextLike) -> None:
        self._refused += 1
        await self._answer(press_id, status, error=error)
        await asyncio.sleep(0)  # much may come in one piece: others have their turn

    async def _answer(self, press_id: str | None, status: int, **fields: TextLike | None) -> None:
        answer = localized({"press": press_id, "status": status, **fields}, self._language)
        text = json.dumps(answer, ensure_ascii=False)
        with suppress(WebSocketDisconnect, RuntimeError):  # the client is gone
            await self._socket.send_text(text)


def _press_id(fields: object) -> str | None:
    """The press id in an invalid message, None without one."""
    press_id = fields.get("id") if isinstance(fields, dict) else None
    return press_id if isinstance(press_id, str) and re.fullmatch(PRESS_ID, press_id) else None

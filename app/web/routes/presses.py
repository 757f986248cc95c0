"""A press: JSON for the panel's scripts, a form for a browser without them; one module behind."""

import math
import re
import secrets
from collections.abc import Awaitable, Mapping
from typing import Annotated, Final
from urllib.parse import parse_qsl, quote

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, JsonValue, WithJsonSchema

from app import clock
from app.audit.press_record import origin_of
from app.commands.press_context import SEEN
from app.commands.press_limits import RETRY_AFTER_S
from app.commands.receipts import Receipt
from app.errors import InputError
from app.i18n import say
from app.panel.model import Page
from app.permission.clients import Browser
from app.printable import printable_texts
from app.runtime.robot_session import Kiosk
from app.web.app_state import CurrentKiosk, CurrentSite, Site
from app.web.client_cookie import visitor
from app.web.described import (
    FORM,
    JSON,
    PAGE,
    TEXT,
    Described,
    ErrorAnswer,
    described_body,
    errors,
    fields,
)
from app.web.request_body import as_model, body_of, json_of
from app.web.routes.pages import ask_of

router = APIRouter()

CONFIRMED: Final = "_confirmed"  # a form's field: the server has asked, and this is the yes
TAP_AGAIN_S: Final = 0.7  # as the page's scripts have it
ASKED_S: Final = 30.0  # the answer is a press, and no later one
LONGEST_ID: Final = 64
PRESS_ID: Final = rf"^[A-Za-z0-9_.:-]{{1,{LONGEST_ID}}}$"
STATUS: Final[Mapping[str, int]] = {
    "": 200,
    "interlock": 409,
    "input": 422,
    "link": 503,
    "log": 503,
    "time": 504,
    "limit": 429,
}


# Pydantic's own has a reference within the model, which is not the description's.
INPUTS: Final = {"type": "object", "description": "values by the ids of inputs"}


class Press(BaseModel):
    """What a client posts as JSON; only `inputs` is needed."""

    model_config = ConfigDict(extra="forbid")

    inputs: Annotated[dict[str, JsonValue], WithJsonSchema(INPUTS)]
    id: Annotated[str, Field(pattern=PRESS_ID)] | None = None
    seen: Annotated[str, Field(pattern=SEEN)] | None = None
    at: AwareDatetime | None = None


class Cancel(BaseModel):
    """What a client may post as JSON to cancel: the id of the goal's press; without it, it is the goal
    under way. What else comes with it is not judged: stopping stays easy."""

    press: str = ""


class ReceiptAnswer(BaseModel):
    """What came of a press."""

    id: str
    widget: str
    outcome: str
    reason: str
    at: AwareDatetime


RECEIPTS: Final[Described] = errors(403, 404, 408, 413) | {
    303: {"description": "of a form: back to the page, with the receipt on it"},
    409: {
        "model": ReceiptAnswer,
        "description": "refused: an interlock, who has control, no such goal",
    },
    429: {
        "model": ReceiptAnswer,
        "description": "more than a client may",
        "headers": {"Retry-After": {"description": "seconds", "schema": {"type": "integer"}}},
    },
    503: {"model": ReceiptAnswer | ErrorAnswer, "description": "no way to the robot, or to the log"},
}


@router.post(
    "/widgets/{widget}",
    response_model=ReceiptAnswer,
    summary="Press a widget",
    responses=RECEIPTS
    | {
        200: {"description": "done or under way; of a form: a page that asks first", "content": PAGE},
        422: {"model": ReceiptAnswer | ErrorAnswer, "description": "bad input"},
        504: {"model": ReceiptAnswer, "description": "no answer in time"},
    },
    openapi_extra=described_body(
        Press, {"type": "object", "additionalProperties": TEXT}, required=True
    ),
)
async def press(widget: str, request: Request, site: CurrentSite, kiosk: CurrentKiosk) -> Response:
    kiosk.presses.widget(widget)
    browser = visitor(request, site)
    body = await body_of(request)
    kind = _kind(request)
    if kind == JSON:
        receipt = await pressed(site, kiosk, browser, widget, as_model(Press, json_of(body)))
        return _answer(receipt)
    if kind == FORM:
        return await _pressed_by_form(site, kiosk, browser, widget, _form(body))
    raise InputError(f'a press is "{JSON}" or "{FORM}", not "{kind}"')


@router.post(
    "/widgets/{widget}/cancel",
    response_model=ReceiptAnswer,
    summary="Ask the robot to cancel an action's goal",
    responses=RECEIPTS | errors(422),
    openapi_extra=described_body(Cancel, fields(_press={}), required=False),
)
async def cancel(widget: str, request: Request, site: CurrentSite, kiosk: CurrentKiosk) -> Response:
    kiosk.presses.widget(widget)
    browser = visitor(request, site)
    body, kind = await body_of(request), _kind(request)
    form = kind == FORM
    of = ""
    if form:
        of = _form(body).get("_press", "")
    elif kind == JSON and body:
        of = as_model(Cancel, json_of(body)).press
    if site.limits.admit_cancel(browser, kiosk.base, widget, of[:LONGEST_ID]):
        receipt = await _told(site, kiosk.presses.cancel(widget, origin_of(browser), of))
    else:
        receipt = kiosk.presses.limited(widget, {}, "", "cancel_too_often", shown=form)
    if form:
        return RedirectResponse(page_after(kiosk, widget, receipt.id), status_code=303)
    return _answer(receipt)


async def pressed(site: Site, kiosk: Kiosk, browser: Browser, widget: str, given: Press) -> Receipt:
    """What comes of a press that was given as JSON, by whatever way."""
    kiosk.presses.widget(widget)
    press_id = given.id or secrets.token_hex(8)
    if not site.limits.admit(browser):
        return kiosk.presses.limited(widget, given.inputs, press_id)
    at = given.at.timestamp() if given.at else None
    by = kiosk.doubts.by(widget, browser, given.seen or "", at)
    return await _told(site, kiosk.presses.press(widget, given.inputs, press_id, by))


async def _pressed_by_form(
    site: Site, kiosk: Kiosk, browser: Browser, widget: str, inputs: dict[str, str]
) -> Response:
    """Back to the page, with the receipt on it; or the question that comes first."""
    too_soon, before = _is_second_tap(inputs), inputs.pop("_last", "")
    asks = kiosk.presses.widget(widget).confirm_press
    if asks and (inputs.pop(CONFIRMED, "") != "yes" or too_soon):
        return _ask(site, kiosk, widget, inputs)
    # One rendered page has one id for all its buttons, and each button is a press of its own.
    page_id = inputs.pop("_id", secrets.token_hex(8))
    if not re.fullmatch(PRESS_ID, page_id):
        raise InputError(f'_id: "{page_id:.40}" is not the id of a press')
    press_id = f"{page_id}.{widget}"
    seen, until = inputs.pop("_seen", ""), _until(inputs)
    typed = kiosk.sending.typed(inputs)
    if not site.limits.admit(browser):
        receipt = kiosk.presses.limited(widget, typed, press_id, shown=True)
        return RedirectResponse(page_after(kiosk, widget, receipt.id), status_code=303)
    by = kiosk.doubts.by(widget, browser, seen, until)
    if too_soon:
        work = kiosk.presses.too_soon(widget, typed, press_id, before, by.origin)
    else:
        work = kiosk.presses.press(widget, typed, press_id, by)
    receipt = await _told(site, work)
    return RedirectResponse(page_after(kiosk, widget, receipt.id), status_code=303)


def _answer(receipt: Receipt) -> Response:
    headers = {"retry-after": str(RETRY_AFTER_S)} if receipt.cause == "limit" else None
    return JSONResponse(receipt.as_json(), status_code=STATUS[receipt.cause], headers=headers)


def _kind(request: Request) -> str:
    """What the body is, as its header says."""
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


def _ask(site: Site, kiosk: Kiosk, widget: str, inputs: dict[str, str]) -> Response:
    """Asks a browser without scripts whether it is meant: the answer is the press."""
    pressed = kiosk.presses.widget(widget)
    html = site.templates.get_template("ask.html").render(
        site=site,
        panel=kiosk.panel,
        banner=kiosk.board.view["notice"]["banner"],
        asked=ask_of(kiosk, pressed),
        action=f"{kiosk.base}/widgets/{widget}",
        back=f"{kiosk.base}/pages/{_page_of(kiosk, widget).id}",
        fields={
            **inputs,
            CONFIRMED: "yes",
            "_seen": kiosk.board.id,
            "_until": str(round(clock.server_now() + ASKED_S, 3)),
            "_since": str(round(clock.server_now(), 3)),
        },
        typed=printable_texts(inputs),
        no=say("back"),
        empty=say("empty"),
        label=pressed.label,
    )
    return HTMLResponse(html, headers={"cache-control": "no-store"})


def _page_of(kiosk: Kiosk, widget: str) -> Page:
    return next(p for p in kiosk.panel.pages if any(w.id == widget for w in p.widgets))


def _until(inputs: dict[str, str]) -> float | None:
    """When a page without scripts should have loaded anew, if that is over, else now.

    It can't say when it was pressed, but a page that does not reload itself is none to press on.
    """
    until = _moment(inputs, "_until")
    return until if until is None else min(until, clock.server_now())


def _is_second_tap(inputs: dict[str, str]) -> bool:
    """Whether a page without scripts is pressed sooner than anybody reads it: by the second tap of what
    brought it. Scripts tell by themselves; a page that loaded itself was not tapped for."""
    since = _moment(inputs, "_since")
    return since is not None and clock.server_now() - since < TAP_AGAIN_S


def _moment(inputs: dict[str, str], name: str) -> float | None:
    given = inputs.pop(name, None)
    if given is None:
        return None
    try:
        moment = float(given)
    except ValueError:
        moment = math.nan
    if not math.isfinite(moment):
        raise InputError(f'{name}: "{given:.40}" is not that of a page')
    return moment


async def _told(site: Site, coming: Awaitable[Receipt]) -> Receipt:
    """What comes of it, counted; the server's end waits for that."""
    with site.owed.one():
        receipt = await coming
    site.metrics.pressed(receipt.outcome)
    return receipt


def _form(body: bytes) -> dict[str, str]:
    try:
        pairs = parse_qsl(
            body.decode("ascii"), keep_blank_values=True, errors="strict", max_num_fields=200
        )
    except ValueError as error:
        raise InputError(f"the body is not a form: {error}") from None
    inputs: dict[str, str] = {}
    for name, text in pairs:
        # A toggle that is on comes after the hidden field that is there when it is off.
        if name in inputs and (inputs[name], text) != ("false", "true"):
            raise InputError("a field is in the form twice")
        inputs[name] = text
    return inputs


def page_after(kiosk: Kiosk, widget: str, receipt_id: str) -> str:
    """The page of a widget, with a receipt if there is one."""
    page = f"{kiosk.base}/pages/{_page_of(kiosk, widget).id}"
    return f"{page}?receipt={quote(receipt_id)}" if receipt_id else page

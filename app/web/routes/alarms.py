"""Alarms of all robots: what is not normal now, their history, and the acts on them. JSON for programs
and scripts, forms without them."""

import asyncio
from collections.abc import Iterable, Mapping
from functools import partial
from typing import Annotated, Any, Final
from urllib.parse import quote, urlsplit

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import JSONResponse, RedirectResponse, Response
from pydantic import BaseModel

from app.alarms.history import read_history
from app.alarms.shown import more_text
from app.alarms.transition_json import finite, transition
from app.commands.act_receipt import ActReceipt
from app.commands.alarm_acts import ALARM_ACTS
from app.commands.press import PRESS_ID
from app.commands.press_limits import RETRY_AFTER_S
from app.i18n import localized, say
from app.permission.confirmations import ConfirmedBy
from app.web.alarm_answers import (
    AcknowledgeBody,
    AlarmActBody,
    AlarmQuery,
    AlarmReceipt,
    AlarmReceipts,
    AlarmsAnswer,
    HistoryAnswer,
    receipt_json,
)
from app.web.alarm_runs import AlarmRun, AlarmRuns
from app.web.app_state import AppState, CurrentState
from app.web.client_cookie import principal_with_new_token, set_client_cookie
from app.web.framed_page import FramedPage, framed_page
from app.web.language import language_of
from app.web.openapi_parts import PAGE, Described, described_body, errors, fields, refusals
from app.web.rendering.alarm_choice import chosen_rows, segment_counts
from app.web.rendering.alarms_page import alarms_context, word
from app.web.request_body import act_body_of, as_model
from app.web.routes.alarm_confirm import OWN_PAGE, AlarmId, confirmed_act
from app.web.routes.press_forms import is_second_tap
from app.web.routes.presses import STATUS

router = APIRouter()

AlarmAct = Annotated[str, Path(json_schema_extra={"enum": list(ALARM_ACTS)})]

FORM_FIELDS_MOST: Final = 600
OCCURRENCE: Final = "occurrence."  # begins the fields of a form that acknowledges several alarms
TOO_OFTEN: Final = say("control_too_often")
TOO_SOON: Final = say("press_too_soon")


def _acts(model: type[BaseModel]) -> Described:
    """The responses of an act: receipts of this model."""
    return (
        errors(404, 408, 413, 422)
        | refusals(model)
        | {
            303: {
                "description": "of a form: back to the page that it came from, with the receipt's id"
            },
            503: {"model": model, "description": "the operator's log can't be written"},
        }
    )


FORM_PARTS: Final[Mapping[str, dict[str, Any]]] = {
    "id": {"pattern": PRESS_ID},
    "page": {"description": "the path of the panel's page to go back to"},
    "_since": {
        "description": "when the page was rendered, in the server's own time",
        "pattern": r"^[0-9]{1,10}(\.[0-9]{1,3})?$",
    },
}
ACT_FORM_PARTS: Final[Mapping[str, dict[str, Any]]] = {
    **FORM_PARTS,
    "occurrence": {"pattern": "^[0-9]{1,15}$"},
    "reason": {"maxLength": 200},
    "for_s": {"pattern": "^[1-9][0-9]{0,3}$"},
}


@router.get(
    "/alarms",
    response_model=AlarmsAnswer | HistoryAnswer,
    summary="The alarms that are not normal now, or the history of all alarms",
    responses=errors(403, 422, 503) | {200: {"content": PAGE}},
)
async def alarms(
    request: Request, state: CurrentState, query: Annotated[AlarmQuery, Query()]
) -> Response:
    content: dict[str, Any]
    if not query.history and "text/html" in request.headers.get("accept", ""):
        return _page(request, state, query)
    if query.history:
        read = partial(read_history, wanted=query.filter(), limit=query.limit)
        rows = await state.fleet.alarms.history.read(read)
        older = rows[-1].seq if len(rows) == query.limit else None
        content = {"history": [transition(row) for row in rows], "older": older}
    else:
        content = _chosen(state, query, language_of(request))
    answer = localized(content, language_of(request))
    return JSONResponse(answer, headers={"cache-control": "no-store"})


def _chosen(state: AppState, query: AlarmQuery, language: str) -> dict[str, Any]:
    """The alarms that a query chooses, and how many there are of all that it might list."""
    rows, limit = state.fleet.alarms.rows(), query.rows_limit
    choice = query.choice()
    listed = chosen_rows(choice, rows, language, limit)
    return {
        "alarms": [finite(row) for row in listed.rows],
        "more": listed.more,
        "more_text": more_text(listed.more),
        "counts": segment_counts(listed.taken),
        "alarm": next((finite(row) for row in rows if row["id"] == choice.alarm), None),
    }


def _page(request: Request, state: AppState, query: AlarmQuery) -> Response:
    """The page of alarms, for a browser."""
    choice = query.choice()
    page = FramedPage(
        "alarms.html", word("title"), alarms_page=f"alarms?{choice.address()}", vary="accept"
    )
    context = alarms_context(state, choice, language_of(request), with_sheet=query.sheet)
    return framed_page(request, state, page, {**context, "word": word})


@router.post(
    "/alarms/acknowledge",
    response_model=AlarmReceipts,
    summary="Acknowledge several alarms, such as those that a page shows",
    responses=_acts(AlarmReceipts),
    openapi_extra=described_body(
        AcknowledgeBody,
        {
            **fields(**FORM_PARTS),
            "description": f'"{OCCURRENCE}" and the id: the occurrence that the page showed',
            "additionalProperties": {"type": "string", "pattern": "^[0-9]{1,15}$"},
        },
        required=True,
    ),
)
async def acknowledge(request: Request, state: CurrentState) -> Response:
    is_form, content = await act_body_of(request, FORM_FIELDS_MOST)
    if is_form:
        shown = {k.removeprefix(OCCURRENCE): v for k, v in content.items() if k.startswith(OCCURRENCE)}
        body = as_model(AcknowledgeBody, {"alarms": shown, "id": content.get("id")})
    else:
        body = as_model(AcknowledgeBody, content)
    acts = {
        alarm: AlarmActBody(occurrence=occurrence, at=body.at, id=body.id, seen=body.seen)
        for alarm, occurrence in body.alarms.items()
    }
    return await _answer(
        request, state, "acknowledge", acts, content if is_form else None, several=True
    )


@router.post(
    "/alarms/{alarm:path}/{act}",
    response_model=AlarmReceipt,
    summary="Acknowledge, shelve or reset an alarm, or take it out of service",
    responses=_acts(AlarmReceipt),
    openapi_extra=described_body(AlarmActBody, fields(**ACT_FORM_PARTS), required=False),
)
async def act(alarm: AlarmId, act: AlarmAct, request: Request, state: CurrentState) -> Response:
    is_form, content = await act_body_of(request, FORM_FIELDS_MOST)
    confirmed: ConfirmedBy | None = None
    if is_form:
        confirmed, asked = await confirmed_act(request, state, alarm, act, content)
        if asked is not None:
            return asked
    filled = {k: v for k, v in content.items() if v != "" and k not in ("page", "_since")}
    body = as_model(AlarmActBody, filled if is_form else content)
    return await _answer(
        request, state, act, {alarm: body}, content if is_form else None, confirmed=confirmed
    )


async def _answer(
    request: Request,
    state: AppState,
    act: str,
    bodies: Mapping[str, AlarmActBody],
    form: Mapping[str, str] | None,
    *,
    several: bool = False,
    confirmed: ConfirmedBy | None = None,
) -> Response:
    """Runs an act on alarms and answers with the receipts."""
    # Without a cookie the client is anonymous; its next request has this one.
    who, token = principal_with_new_token(request, state)
    refusal = TOO_SOON if form is not None and is_second_tap(form) else None
    if not state.limits.admit(who):
        refusal = TOO_OFTEN
    runs = AlarmRuns(state, who, refusal, scripted=form is None, confirmed=confirmed)
    with state.in_flight.track():
        answers = await asyncio.gather(*(runs.run(act, alarm, body) for alarm, body in bodies.items()))
    pairs = list(zip(bodies, answers, strict=True))
    if form is not None:
        response: Response = _back(request, state, form, [answer.receipt for answer in answers])
    else:
        response = _json(request, pairs, several)
    return set_client_cookie(response, request, token)


def _json(request: Request, pairs: list[tuple[str, AlarmRun]], several: bool) -> Response:
    receipts = [receipt_json(alarm, *answer) for alarm, answer in pairs]
    cause = next((answer.receipt.cause for _, answer in pairs if not answer.receipt.done), "")
    headers = {"retry-after": str(RETRY_AFTER_S)} if cause == "limit" else None
    content = {"receipts": receipts} if several else receipts[0]
    return JSONResponse(
        localized(content, language_of(request)), status_code=STATUS[cause], headers=headers
    )


def _back(
    request: Request, state: AppState, form: Mapping[str, str], receipts: Iterable[ActReceipt]
) -> Response:
    """A redirect to the page of the form, which shows the first receipt that says something."""
    receipt = next((receipt for receipt in receipts if receipt.reason), None)
    page = form.get("page") or _referring_page(request)
    page = page.removeprefix(state.root)
    page = page if OWN_PAGE.fullmatch(page) else "/"
    if receipt is not None:
        shown = receipt.code if receipt.cause == "limit" else receipt.id
        page += f"{'&' if '?' in page else '?'}act={quote(shown, safe='')}"
    return RedirectResponse(state.root + page, status_code=303)


def _referring_page(request: Request) -> str:
    """The path and query of the page that a browser names as the referrer, if it is one of this
    server."""
    try:
        referrer = urlsplit(request.headers.get("referer", ""))
    except ValueError:
        return ""
    if referrer.netloc != request.headers.get("host"):
        return ""
    return f"{referrer.path}?{referrer.query}" if referrer.query else referrer.path

"""Alarms of all robots: what is not normal now, their history, and the acts on them. JSON for programs
and scripts, forms without them."""

import asyncio
import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Final
from urllib.parse import quote, urlencode, urlsplit

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from pydantic import BaseModel, ConfigDict
from pydantic import Field as PydanticField

from app.cell.alarms.history import read_history
from app.cell.alarms.records import finite, transition
from app.cell.alarms.shown import more_text
from app.cell.alarms.states import AlarmInstance
from app.cell.commands.alarm_acts import ALARM_ACTS, CONFIRMED
from app.cell.commands.press import PRESS_ID
from app.cell.people.access import PIN_HERE
from app.cell.people.secrets_hash import LONGEST
from app.cell.permission.roles import ConfirmedBy, role_lock, role_name, role_verdict, strictest
from app.records.principal import Principal
from app.system.errors import NotFound
from app.system.texts import TextLike, say
from app.web.acts import SentAct, act_responses, sent_with
from app.web.alarm_answers import (
    AcknowledgeBody,
    AlarmActBody,
    AlarmQuery,
    AlarmReceipt,
    AlarmReceipts,
    AlarmsAnswer,
    HistoryAnswer,
    Occurrence,
    receipt_json,
)
from app.web.alarm_runs import AlarmRun, AlarmRuns
from app.web.answers import receipt_answer
from app.web.app_state import AppState, CurrentState
from app.web.caller import Caller, caller_of
from app.web.large_answers import rows_answer
from app.web.pages.alarms import alarms_context, chosen_rows, segment_counts, word
from app.web.pages.confirm import Subject, confirm_sheet
from app.web.pages.context import FramedPage, framed_page
from app.web.pages.words import Ask
from app.web.requests import (
    PAGE,
    SINCE,
    Field,
    FormFields,
    act_body_of,
    described_body,
    errors,
    is_second_tap,
)
from app.web.routes.confirm import FIELDS, checked_entry, entered_fields

# Acts on alarms that a person confirms with a PIN, password or badge: the page that asks for it.

router = APIRouter()

ConfirmedAct = Annotated[str, Path(json_schema_extra={"enum": sorted(CONFIRMED)})]
AlarmId = Annotated[str, Path(max_length=300, description="the id of an alarm")]
OWN_PAGE: Final = re.compile(
    r"(/robots/[a-z0-9_]+)?/"
    r"(pages/[a-z0-9_]+|alarms[a-z/_-]*|log|diagnostics|help|recipes/[a-z0-9_]+)(\?[!-~]*)?"
)
CARRIED: Final = ("id", "page", "occurrence", "reason", "for_s")
PLAIN: Final = frozenset(
    {
        "confirm_wrong_pin", "confirm_wrong_password", "confirm_wrong_badge", "confirm_empty",
        "confirm_who", "confirm_same_person", PIN_HERE,
    }
)  # fmt: skip


class ConfirmQuery(BaseModel):
    """The fields of the act, the second person so far, and the code of the last refusal."""

    model_config = ConfigDict(extra="forbid")

    id: Annotated[str, PydanticField(pattern=PRESS_ID)] | None = None
    page: Annotated[str, PydanticField(max_length=400)] = ""
    occurrence: Occurrence | None = None
    reason: Annotated[str, PydanticField(max_length=200)] = ""
    for_s: Annotated[int, PydanticField(gt=0, le=86_400)] | None = None
    user: Annotated[str, PydanticField(max_length=40)] = ""
    refused: Annotated[str, PydanticField(max_length=40)] = ""


@router.get(
    "/alarms/{alarm:path}/{act}/confirm",
    response_class=HTMLResponse,
    summary="The page on which a person confirms an act on an alarm",
    responses=errors(403, 404, 422),
)
async def confirm_page(
    alarm: AlarmId,
    act: ConfirmedAct,
    request: Request,
    state: CurrentState,
    query: Annotated[ConfirmQuery, Query()],
) -> Response:
    standing = state.fleet.alarms.engine.alarms.get(alarm)
    subject = _subject(standing, act) if standing else None
    if subject is None:
        raise NotFound(f'there is no act "{act:.40}" on an alarm "{alarm:.64}" that a person confirms')
    who = caller_of(request).principal
    fields = {name: str(value) for name in CARRIED if (value := getattr(query, name))}
    address = f"{state.root}/alarms/{quote(alarm, safe='')}"
    page = query.page.removeprefix(state.root)
    context: dict[str, Any] = {
        **confirm_sheet(state, subject, who, query.user),
        "action": f"{address}/{act}",
        "away": state.root + (page if OWN_PAGE.fullmatch(page) else "/alarms"),
        "no": say("back"),
        "fields": fields,
        "failed": _failure(state, subject, who, query),
    }
    framed = FramedPage("alarm-confirm.html", word(act), f"/alarms/{alarm}/{act}/confirm")
    return framed_page(request, state, framed, context)


async def confirmed_act(
    request: Request, state: AppState, alarm_id: str, act: str, content: dict[str, str]
) -> tuple[ConfirmedBy | None, Response | None]:
    """Who has confirmed the act of a form, whose fields for it are removed; else the redirect to the
    page that asks. (None, None) for an act that needs none, or that is refused without a PIN."""
    alarm, client = state.fleet.alarms.engine.alarms.get(alarm_id), caller_of(request)
    subject = _subject(alarm, act) if alarm else None
    who = client.principal
    entered = entered_fields(content) if any(name in content for name in FIELDS) else None
    if subject is None or not who.user or role_verdict(subject.needs, who):
        return None, None
    too_soon = is_second_tap(content)
    if entered is None:
        return None, None if too_soon else _asking(state, alarm_id, act, content)
    typed = any(entered[name] for name in ("_pin", "_password", "_badge"))  # no second tap types
    if too_soon and not typed:
        return None, _asking(state, alarm_id, act, content, entered["_user"])
    by, checked = await checked_entry(state, subject, act, client, entered)
    if by is not None:
        content.pop("_since", None)
        return by, None
    return None, _asking(state, alarm_id, act, content, entered["_user"], checked.code)


def _asking(
    state: AppState,
    alarm: str,
    act: str,
    content: Mapping[str, str],
    user: str = "",
    refused: str = "",
) -> Response:
    """The redirect to the page that asks."""
    fields = {name: content[name] for name in CARRIED if content.get(name)}
    query = fields | {name: text for name, text in (("user", user), ("refused", refused)) if text}
    address = f"{state.root}/alarms/{quote(alarm, safe='')}/{act}/confirm?{urlencode(query)}"
    return RedirectResponse(address, status_code=303)


def _subject(alarm: AlarmInstance, act: str) -> Subject | None:
    """What is confirmed; None for an act on this alarm that needs no confirmation."""
    described = alarm.definition.alarm
    if act not in CONFIRMED or described.confirm_act is None:
        return None
    needs = frozenset(filter(None, (ALARM_ACTS[act].needs, described.needs)))
    ask = Ask(
        sentence=say("alarms_confirm", act=word(act), alarm=alarm.text), inputs=[], changes=[], note=""
    )
    return Subject(described.id, described.confirm_act, needs, ask, word(act))


def _failure(state: AppState, subject: Subject, who: Principal, query: ConfirmQuery) -> TextLike:
    """Why the last confirmation failed, by its code; how many tries are left."""
    if not query.refused:
        return ""
    name = query.user if subject.confirmation == "two_persons" else who.user
    if wait_s := state.access.wait_s(who.client, name):
        return say("sign_in_wait", seconds=str(wait_s))
    role = strictest(subject.needs)
    if query.refused == "confirm_second_role":
        return say(query.refused, name=query.user, role=role_name(role))
    if query.refused not in PLAIN:
        return role_lock(role).reason or "" if query.refused == "role_needed" else ""
    said = say(query.refused)
    if "wrong" not in query.refused:
        return said
    return say("signin_tries_left", why=said, count=str(state.access.tries_left(who.client, name)))


AlarmAct = Annotated[str, Path(json_schema_extra={"enum": list(ALARM_ACTS)})]

FORM_FIELDS_MOST: Final = 600
OCCURRENCE: Final = "occurrence."  # begins the fields of a form that acknowledges several alarms
FORM_PARTS: Final[Mapping[str, Field]] = {
    "id": {"pattern": PRESS_ID},
    "page": {"description": "the path of the panel's page to go back to"},
    "_since": SINCE,
}
OCCURRENCE_SCHEMA: Final[Field] = {"pattern": "^[0-9]{1,15}$"}
ACKNOWLEDGE_FORM: Final = FormFields(
    FORM_PARTS,
    {f"^{re.escape(OCCURRENCE)}": OCCURRENCE_SCHEMA},
    about=f'"{OCCURRENCE}" and the id: the occurrence that the page showed',
)
ACT_FORM: Final = FormFields(
    {
        **FORM_PARTS,
        "occurrence": OCCURRENCE_SCHEMA,
        "reason": {"maxLength": 200},
        "for_s": {
            "description": "up to 86400",
            "pattern": "^([1-9][0-9]{0,3}|[1-7][0-9]{4}|8[0-5][0-9]{3}|86[0-3][0-9]{2}|86400)$",
        },
        **{name: {"maxLength": LONGEST, "description": "of who confirms it"} for name in FIELDS},
    }
)


@router.get(
    "/alarms",
    response_model=AlarmsAnswer | HistoryAnswer,
    summary="The alarms that are not normal now, or the history of all alarms",
    responses=errors(403, 422, 503) | {200: {"content": PAGE}},
)
async def alarms(
    request: Request, state: CurrentState, query: Annotated[AlarmQuery, Query()]
) -> Response:
    if query.history:
        read = partial(read_history, wanted=query.filter(), limit=query.limit)
        rows = await state.fleet.alarms.history.read(read)
        older = rows[-1].seq if len(rows) == query.limit else None
        history = {"history": [transition(row) for row in rows], "older": older}
        return await rows_answer(request, lambda: history, len(rows))
    if caller_of(request).accepts_html:
        return _page(request, state, query)
    content = _listed_alarms(state, query, caller_of(request).language)
    return await rows_answer(request, partial(_with_finite, content), len(content["alarms"]))


def _listed_alarms(state: AppState, query: AlarmQuery, language: str) -> dict[str, Any]:
    """The alarms that a query chooses, and how many there are of all that it might list."""
    rows, limit = state.fleet.alarms.rows(), query.rows_limit
    choice = query.choice()
    listed = chosen_rows(choice, rows, language, limit)
    return {
        "alarms": listed.rows,
        "more": listed.more,
        "more_text": more_text(listed.more),
        "counts": segment_counts(listed.taken),
        "alarm": next((row for row in rows if row["id"] == choice.alarm), None),
    }


def _with_finite(content: dict[str, Any]) -> dict[str, Any]:
    alarm = content["alarm"]
    rows = [finite(row) for row in content["alarms"]]
    return {**content, "alarms": rows, "alarm": None if alarm is None else finite(alarm)}


def _page(request: Request, state: AppState, query: AlarmQuery) -> Response:
    """The page of alarms, for a browser."""
    choice = query.choice()
    page = FramedPage("alarms.html", word("title"), f"/alarms?{choice.address()}", "alarms")
    context = alarms_context(state, choice, caller_of(request).language, with_sheet=query.sheet)
    return framed_page(request, state, page, {**context, "word": word})


@router.post(
    "/alarms/acknowledge",
    response_model=AlarmReceipts,
    summary="Acknowledge several alarms, such as those that a page shows",
    responses=act_responses(AlarmReceipts),
    openapi_extra=described_body(AcknowledgeBody, ACKNOWLEDGE_FORM.schema, required=True),
)
async def acknowledge(request: Request, state: CurrentState) -> Response:
    is_form, content = await act_body_of(request, ACKNOWLEDGE_FORM, FORM_FIELDS_MOST)
    sent = sent_with(request, state, AcknowledgeBody, ACKNOWLEDGE_FORM, content, is_form, _shown_alarms)
    acts = {
        alarm: AlarmActBody(
            occurrence=occurrence, at=sent.body.at, id=sent.body.id, seen=sent.body.seen
        )
        for alarm, occurrence in sent.body.alarms.items()
    }
    pairs = await _run(sent, "acknowledge", acts)
    return _answer(sent, pairs, {"receipts": [receipt_json(alarm, *run) for alarm, run in pairs]})


def _shown_alarms(form: Mapping[str, str]) -> dict[str, Any]:
    """The body of a form: the occurrences that its page showed."""
    shown = {
        name.removeprefix(OCCURRENCE): occurrence
        for name, occurrence in form.items()
        if name.startswith(OCCURRENCE)
    }
    return {"alarms": shown, "id": form.get("id")}


@router.post(
    "/alarms/{alarm:path}/{act}",
    response_model=AlarmReceipt,
    summary="Acknowledge, shelve or reset an alarm, or take it out of service",
    responses=act_responses(AlarmReceipt),
    openapi_extra=described_body(AlarmActBody, ACT_FORM.schema, required=False),
)
async def act(alarm: AlarmId, act: AlarmAct, request: Request, state: CurrentState) -> Response:
    is_form, content = await act_body_of(request, ACT_FORM)
    confirmed: ConfirmedBy | None = None
    if is_form:
        confirmed, asked = await confirmed_act(request, state, alarm, act, content)
        if asked is not None:
            return asked
    sent = sent_with(request, state, AlarmActBody, ACT_FORM, content, is_form)
    pairs = await _run(sent, act, {alarm: sent.body}, confirmed)
    return _answer(sent, pairs, receipt_json(alarm, *pairs[0][1]))


async def _run(
    sent: SentAct[Any],
    act: str,
    bodies: Mapping[str, AlarmActBody],
    confirmed: ConfirmedBy | None = None,
) -> list[tuple[str, AlarmRun]]:
    """Runs an act on each of these alarms."""
    scripted = sent.form is None
    runs = AlarmRuns(sent.state, sent.who, sent.refusal(), scripted=scripted, confirmed=confirmed)
    with sent.state.in_flight.track():
        answers = await asyncio.gather(*(runs.run(act, alarm, body) for alarm, body in bodies.items()))
    return list(zip(bodies, answers, strict=True))


def _answer(
    sent: SentAct[Any], pairs: Sequence[tuple[str, AlarmRun]], content: dict[str, Any]
) -> Response:
    """The receipts; of a form the page that it came from, with the first that says something."""
    receipts = [run.receipt for _, run in pairs]
    if sent.form is not None:
        said = next((receipt for receipt in receipts if receipt.reason), None)
        return sent.back(_page_of(sent, sent.form), said)
    cause = next((receipt.cause for receipt in receipts if not receipt.done), "")
    return sent.with_cookie(receipt_answer(sent.caller, content, cause))


def _page_of(sent: SentAct[Any], form: Mapping[str, str]) -> str:
    """The page of a form; the first one for what is none of this panel's."""
    page = form.get("page") or _referring_page(sent.caller)
    page = page.removeprefix(sent.state.root)
    return sent.state.root + (page if OWN_PAGE.fullmatch(page) else "/")


def _referring_page(caller: Caller) -> str:
    """The path and query of the page that a browser names as the referrer, if it is one of this
    server."""
    try:
        referrer = urlsplit(caller.headers.get("referer", ""))
    except ValueError:
        return ""
    if referrer.netloc != caller.headers.get("host"):
        return ""
    return f"{referrer.path}?{referrer.query}" if referrer.query else referrer.path

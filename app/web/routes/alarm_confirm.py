"""Acts on alarms that a person confirms with a PIN, password or badge: the page that asks for it."""

import re
from collections.abc import Mapping
from typing import Annotated, Any, Final
from urllib.parse import quote, urlencode

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.alarms.instance import AlarmInstance
from app.commands.alarm_acts import ALARM_ACTS, CONFIRMED
from app.commands.press import PRESS_ID
from app.errors import NotFound
from app.i18n import TextLike, say
from app.permission.client_places import client_key
from app.permission.confirmations import ConfirmedBy
from app.permission.principal import Principal
from app.permission.role_locks import hardest, role_lock, role_name, role_verdict
from app.web.alarm_answers import Occurrence
from app.web.app_state import AppState, CurrentState
from app.web.client_cookie import caller
from app.web.framed_page import FramedPage, framed_page
from app.web.openapi_parts import errors
from app.web.rendering.alarms_page import word
from app.web.rendering.confirm_sheet import Subject, confirm_sheet, digits_key
from app.web.rendering.page_words import Ask
from app.web.routes.confirm_forms import FIELDS, ConfirmForm, checked_entry, entered_fields
from app.web.routes.press_forms import is_second_tap

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
        "confirm_who", "confirm_same_person",
    }
)  # fmt: skip


class ConfirmQuery(BaseModel):
    """The fields of the act, the second person so far, and the code of the last refusal."""

    model_config = ConfigDict(extra="forbid")

    id: Annotated[str, Field(pattern=PRESS_ID)] | None = None
    page: Annotated[str, Field(max_length=400)] = ""
    occurrence: Occurrence | None = None
    reason: Annotated[str, Field(max_length=200)] = ""
    for_s: Annotated[int, Field(gt=0, le=86_400)] | None = None
    user: Annotated[str, Field(max_length=40)] = ""
    refused: Annotated[str, Field(max_length=40)] = ""


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
    who = caller(request).principal(state)
    fields = {name: str(value) for name in CARRIED if (value := getattr(query, name))}
    address = f"{state.root}/alarms/{quote(alarm, safe='')}"
    page = query.page.removeprefix(state.root)
    context: dict[str, Any] = {
        **confirm_sheet(state, subject, who, query.user),
        "action": f"{address}/{act}",
        "away": state.root + (page if OWN_PAGE.fullmatch(page) else "/alarms"),
        "no": say("back"),
        "fields": fields,
        "failed": _said(state, subject, who, query),
        "scripted": False,
    }
    framed = FramedPage("alarm-confirm.html", word(act), own_path=f"/alarms/{alarm}/{act}/confirm")
    return framed_page(request, state, framed, context)


async def confirmed_act(
    request: Request, state: AppState, alarm_id: str, act: str, content: dict[str, str]
) -> tuple[ConfirmedBy | None, Response | None]:
    """Who has confirmed the act of a form, whose fields for it are removed; else the redirect to the
    page that asks. (None, None) for an act that needs none, or that is refused without a PIN."""
    alarm, client = state.fleet.alarms.engine.alarms.get(alarm_id), caller(request)
    subject = _subject(alarm, act) if alarm else None
    who = client.principal(state)
    entered = entered_fields(content) if any(name in content for name in FIELDS) else None
    if subject is None or not who.user or role_verdict(subject.needs, who):
        return None, None
    too_soon, digits = is_second_tap(content), digits_key(subject.id)
    if entered is None:
        return None, None if too_soon else _asking(state, alarm_id, act, content)
    typed = any(entered[name] for name in ("_pin", "_password", "_badge"))  # no second tap types
    if entered["_digit"] != "enter" or (too_soon and not typed):
        if entered["_digit"] != "enter":
            state.access.typed_digits.press(who.client.id, digits, entered["_digit"])
        return None, _asking(state, alarm_id, act, content, entered["_user"])
    form = ConfirmForm(who, content, client.session)
    by, checked = await checked_entry(state, subject, act, form, entered)
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


def _said(state: AppState, subject: Subject, who: Principal, query: ConfirmQuery) -> TextLike:
    """Why the last confirmation failed, by its code; how many tries are left."""
    if not query.refused:
        return ""
    here = who.client.local
    address = "127.0.0.1" if here else client_key(who.client.address)
    name = query.user if subject.confirmation == "two_persons" else who.user
    delays = state.access.delays
    if wait_s := delays.wait_s(name, address):
        return say("sign_in_wait", seconds=str(wait_s))
    role = hardest(subject.needs)
    if query.refused == "confirm_second_role":
        return say(query.refused, name=query.user, role=role_name(role))
    if query.refused not in PLAIN:
        return role_lock(role).reason or "" if query.refused == "role_needed" else ""
    said = say(query.refused)
    if "wrong" not in query.refused:
        return said
    return say("signin_tries_left", why=said, count=str(delays.tries_left(name, address)))

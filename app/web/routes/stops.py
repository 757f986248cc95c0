"""Why the machine stopped: the list of stops, and the story of each as a page and as JSON."""

import asyncio
import secrets
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, NamedTuple, TypedDict, get_args
from urllib.parse import quote

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.cell.alarms.report import shift_at
from app.cell.alarms.shown import AskedReason, panel_id
from app.cell.commands.acts import ActRequest
from app.cell.commands.press import PRESS_ID
from app.cell.session.session import RobotSession
from app.cell.session.stops import StopReader, reason_given, stores_of
from app.cell.stops.sources import PanelNames
from app.cell.stops.story import MOST_EVENTS, Event, Line, Stop, StopSort, Story
from app.cell.view.times import duration_text
from app.panel.roles import MAINTENANCE
from app.panel.rules import OeeReason
from app.system.clock import format_datetime, format_time, iso_time
from app.system.errors import LogError, NotFound
from app.system.printable import printable
from app.system.texts import Text, TextLike, joined, localized, number, render, say
from app.system.texts.locales import MINUS
from app.web.acts import ActBody, act_responses, said_of, sent_act
from app.web.answers import ActAnswer
from app.web.app_state import AppState, CurrentState
from app.web.caller import caller_of
from app.web.downloads import BYTES_MOST, SharedLinks, exported_zip, links_of
from app.web.pages.alarms import word as alarm_word
from app.web.pages.context import FramedPage, framed_page
from app.web.pages.log_words import day_name, who_of
from app.web.pages.log_words import word as log_word
from app.web.pages.story_curves import StoryCurves, story_curves
from app.web.requests import SINCE, TEXT, FormFields, described_body, errors
from app.web.routes.alarm_report import SHIFTS

if TYPE_CHECKING:
    from app.cell.history.kept import KeptRecording

router = APIRouter()

WRITTEN_S: Final = 600.0  # after which the recording of a stop is not expected any more
DAYS_S: Final = 7 * 86_400.0  # that the list goes back
STOP_SORTS: Final[tuple[StopSort, ...]] = get_args(StopSort)
KEY: Final = rf"^({'|'.join(STOP_SORTS)})-[1-9][0-9]{{0,17}}$"
# The icon of each sort of event.
SIGNS: Final = {
    "state": "arrow-right", "interlock": "lock", "condition": "circle-dot", "alarm": "",
    "link": "unlink", "node": "unlink", "publisher": "unlink", "clock": "clock",
    "press": "pointer", "refused": "lock", "goal": "flag", "control": "user",
    "recipe": "clipboard-list", "server": "power",
}  # fmt: skip
Key = Annotated[str, Path(pattern=KEY, max_length=24)]


class StopsQuery(BaseModel):
    """`robot` is the id of the one whose stops are listed; "" lists those of all."""

    model_config = ConfigDict(extra="forbid")

    robot: Annotated[str, Field(max_length=64)] = ""


class StoryQuery(BaseModel):
    """`all`: every line, not only those that tell most. `act` is the id of an act whose receipt is
    shown."""

    model_config = ConfigDict(extra="forbid")

    all: Literal["", "1"] = ""
    act: Annotated[str, Field(max_length=400)] = ""


class AlarmQuery(BaseModel):
    """A raise of an alarm."""

    model_config = ConfigDict(extra="forbid")

    id: Annotated[str, Field(max_length=300)]
    occurrence: Annotated[int, Field(ge=0, lt=2**53)]


REASON_FORM: Final = FormFields({"id": {"pattern": PRESS_ID}, "reason": TEXT, "_since": SINCE})


class ReasonBody(ActBody):
    """The id of the reason in the panel file; "" is "later". The same `id` again is the same act."""

    reason: Annotated[str, Field(max_length=64)] = ""


class ReasonReceipt(ActAnswer):
    """The receipt: `reason` is "" where it was done, `code` is its stable name."""


FOXGLOVE_FORM: Final = FormFields({"id": {"pattern": PRESS_ID}, "_since": SINCE})


class FoxgloveReceipt(ActAnswer):
    """The receipt: `reason` is "" where it was done, `code` is its stable name. `recording` is the
    address of the recording that was shared."""

    recording: str


class AskedStop(NamedTuple):
    """The keys by which the reason of a stop is given; `chosen` is the id of the newest, `answer` says
    who gave it. `refused`: why an act was refused."""

    keys: Sequence[OeeReason]
    chosen: str
    answer: TextLike
    refused: TextLike


class ShownStop(NamedTuple):
    """A row of the list."""

    key: str
    sort: str
    time: Text
    iso: str
    robot: str
    text: TextLike


class ShownLine(NamedTuple):
    """A line of a story; `offset` is counted from the first cause, or else from the stop."""

    offset: TextLike
    sort: str
    sign: str
    priority: int
    text: TextLike
    detail: TextLike
    change: TextLike
    is_first: bool
    is_before: bool


class ToDo(NamedTuple):
    """What to do about a stop: steps, and the picture of the panel's folder, "" without one."""

    steps: Sequence[str]
    picture: TextLike


class ShownRecording(NamedTuple):
    """The link to a recording; `at` says where the stop is in it. `path` is "" while it is written, and
    `at` says so. `shared` are the links of one that is shared with Foxglove, `refused` is why it was
    not."""

    path: str
    at: TextLike
    shared: SharedLinks | None = None
    shared_until: TextLike = ""
    refused: TextLike = ""


class StoryContext(TypedDict):
    """The variables of `stop.html`, beside those of the frame. `of_robot` is the name of the robot that
    stopped, "" for the only one."""

    story: Story
    of_robot: TextLike
    at: Text
    lasted: TextLike
    lines: list[ShownLine]
    is_whole: bool
    these: TextLike
    every: TextLike
    order: TextLike
    left_out: TextLike
    to_do: ToDo
    asked: AskedStop | None
    parcel: bool
    recording: ShownRecording | None
    curves: StoryCurves | None
    say: Any
    alarm_word: Any
    log_word: Any
    word: Any
    figures_word: Any


def word_of_figures(name: str, **about: Any) -> Text:
    return say(f"oee_{name}", **about)


def word(name: str, **about: Any) -> Text:
    return say(f"story_{name}", **about)


@router.get(
    "/stops",
    response_class=HTMLResponse,
    summary="The stops of the last week, the newest first",
    responses=errors(403, 404, 422, 429, 503),
)
async def stops(
    request: Request, state: CurrentState, query: Annotated[StopsQuery, Query()]
) -> Response:
    now, robots = time.time(), state.fleet.panel.robot_names
    state.fleet.chosen(query.robot)
    newest = await _reader(state).stops(now - DAYS_S, now + 1.0, query.robot or None)
    path = f"/stops?robot={quote(query.robot)}" if query.robot else "/stops"
    page = FramedPage("stops.html", word("list"), path, "alarms")
    context = {
        "days": list(_by_day(newest)), "robots": robots, "chosen": query.robot, "word": word,
        "alarm_word": alarm_word, "log_word": log_word,
    }  # fmt: skip
    return framed_page(request, state, page, context)


@router.get(
    "/stops/latest",
    summary="To the story of the newest stop of the last day, or else to the list",
    responses=errors(403, 422, 429, 503),
    status_code=303,
    response_class=RedirectResponse,
)
async def latest(state: CurrentState, query: Annotated[StopsQuery, Query()]) -> Response:
    stop = await _reader(state).latest(time.time(), query.robot or None)
    return _to(state, stop)


@router.get(
    "/stops/alarm",
    summary="To the story of a raise of an alarm",
    responses=errors(403, 404, 422, 429, 503),
    status_code=303,
    response_class=RedirectResponse,
)
async def of_alarm(state: CurrentState, query: Annotated[AlarmQuery, Query()]) -> Response:
    stop = await _reader(state).of_alarm(query.id, query.occurrence)
    if stop is None:
        raise NotFound(say("story_gone"))
    return _to(state, stop)


@router.get(
    "/stops/asked",
    summary="To the story of the stop whose reason is asked, or to the list of several",
    responses=errors(403, 422, 429, 503),
    status_code=303,
    response_class=RedirectResponse,
)
async def asked(state: CurrentState) -> Response:
    question = state.fleet.alarms.asked
    key = ""
    if question is not None and len(question["stops"]) > 1:
        return RedirectResponse(f"{state.root}{_list_of(state, question)}", status_code=303)
    if question is not None:
        stop = question["stops"][0]
        key = await _reader(state).key_at(stop["robot"], stop["began"])
    path = f"/stops/{key}#reasons" if key else "/stops"
    return RedirectResponse(f"{state.root}{path}", status_code=303)


def _list_of(state: AppState, question: AskedReason) -> str:
    """The page with the stops of a shift that have no reason."""
    now, starts, ends = time.time(), state.fleet.panel.alarm_rules.shifts, question["shift_ends"]
    shift = next((name for n, name in enumerate(SHIFTS) if shift_at(now, starts, n).since < ends), "")
    return f"/oee?shift={shift or SHIFTS[-1]}&open=1#stops"


@router.post(
    "/stops/{key}/reason",
    response_model=ReasonReceipt,
    summary="Say why the machine stood still, or leave it for later",
    responses=act_responses(ReasonReceipt),
    openapi_extra=described_body(ReasonBody, REASON_FORM.schema, required=False),
)
async def give_reason(request: Request, state: CurrentState, key: Key) -> Response:
    sent = await sent_act(request, state, ReasonBody, REASON_FORM)
    reader = _reader(state)
    stop = await reader.stop(*sort_and_number(key))
    stood = await reader.standstill_at(stop)
    if stood is None or not stood.key:
        raise NotFound(word_of_figures("no_stop"))
    began, reason = iso_time(stood.standstill.since), sent.body.reason
    values = {"stop": stood.key, "began": began} | ({"reason": reason} if reason else {})
    asked = sent.asked("reason" if reason else "later", stood.key, values)
    session = state.fleet.of_robot(stop.robot)
    receipt = await sent.run(session.shift_acts, asked, sent.act_id(reason or "later"))
    if receipt.done:
        reason_given(state.fleet, stop.robot, stood.standstill.since)
    answer = sent.answer(receipt, f"{state.root}/stops/{key}")
    if "location" in answer.headers:
        answer.headers["location"] += "#reasons"
    return answer


@router.get(
    "/stops/{key}",
    response_class=HTMLResponse,
    summary="Why the machine stopped: what changed in the minute before, and what was first",
    responses=errors(403, 404, 422, 429, 503),
)
async def story_page(
    request: Request, state: CurrentState, key: Key, query: Annotated[StoryQuery, Query()]
) -> Response:
    reader = _reader(state)
    story = await reader.story(*sort_and_number(key))
    end = await reader.end_of(story.stop)
    names = reader.names(story.stop.robot)
    page = FramedPage("stop.html", word("title"), f"/stops/{key}", "alarms")
    language = caller_of(request).language
    asked = await _asked(state, reader, story.stop, query.act)
    robots = state.fleet.panel.robot_names
    context = story_context(story, end, names, robots, bool(query.all), language, asked)
    robot = state.fleet.of_robot(story.stop.robot).robot
    context["curves"] = story_curves(story, names, robot, time.monotonic(), time.time())
    context["parcel"] = caller_of(request).principal.meets(MAINTENANCE)
    if context["parcel"]:
        context["recording"] = await _shown_recording(request, state, story.stop, query.act)
    return framed_page(request, state, page, context)


@router.get(
    "/stops/{key}/story.json",
    summary="The story of a stop as JSON",
    responses=errors(403, 404, 422, 429, 503),
)
async def story_json(request: Request, state: CurrentState, key: Key) -> JSONResponse:
    reader = _reader(state)
    story = await reader.story(*sort_and_number(key))
    end = await reader.end_of(story.stop)
    name = state.fleet.panel.robot_names.get(story.stop.robot, "")
    answer = story_answer(story, name, end, caller_of(request).language)
    recording = await _recording(state, story.stop)
    answer["recording"] = recording and {
        "path": f"{state.root}{recording.path}",
        "since": iso_time(recording.since),
        "until": iso_time(recording.until),
        "offset_s": round(story.stop.at - recording.since, 3),
    }
    return JSONResponse(answer, headers={"cache-control": "no-store"})


@router.post(
    "/stops/{key}/foxglove",
    response_model=FoxgloveReceipt,
    summary="Share the recording of a stop with Foxglove, which begins at the stop",
    responses=act_responses(FoxgloveReceipt),
    openapi_extra=described_body(ActBody, FOXGLOVE_FORM.schema, required=False),
)
async def share(request: Request, state: CurrentState, key: Key) -> Response:
    """404 for a stop without a recording, and for one that is too large to be shared."""
    sent = await sent_act(request, state, ActBody, FOXGLOVE_FORM)
    stop = await _reader(state).stop(*sort_and_number(key))
    recording, folder = await _recording(state, stop), state.fleet.recordings_folder
    if recording is None or folder is None:
        raise NotFound(say("recording_gone"))
    if recording.size > BYTES_MOST:
        raise NotFound(word("recording_large", size=number(f"{recording.size / 1e6:.0f}", "MB")))
    acts = state.fleet.of_robot(stop.robot).shift_acts
    asked = sent.asked("foxglove", values={"stop": stop.key, "began": iso_time(stop.at)})
    act_id = sent.act_id("foxglove") if sent.form else sent.act_id()
    receipt = await sent.run(acts, asked, act_id)
    address = ""
    if receipt.done:
        shared = state.shared.by_act(act_id)
        if shared is None:
            content = await asyncio.to_thread((folder / recording.name).read_bytes)
            shared = state.shared.share(content, stop.robot, act_id, stop.key, stop.at)
        address = links_of(shared, str(request.base_url)).address
    return sent.answer(receipt, f"{state.root}/stops/{key}", recording=address)


@router.get(
    "/stops/{key}/parcel.zip",
    response_class=Response,
    summary="What is known of a stop, as a zip for the vendor's service desk",
    responses=errors(403, 404, 422, 429, 503)
    | {200: {"content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}}}},
)
async def parcel(request: Request, state: CurrentState, key: Key) -> Response:
    """Each one is an entry of the operator's log."""
    stop = await _reader(state).stop(*sort_and_number(key))
    caller = caller_of(request)
    who, token = caller.identified()
    asked = ActRequest("parcel", who, values={"stop": stop.key, "began": iso_time(stop.at)})
    session = state.fleet.of_robot(stop.robot)
    acts = session.shift_acts
    with state.in_flight.track():
        receipt = await acts.act(asked, secrets.token_hex(8))
    if not receipt.done:
        raise LogError(receipt.reason)
    now = partial(_shown_now, state, session)
    made = state.doctor.parcel(stop, caller.language, who, now)
    return caller.with_client_cookie(await exported_zip(made, "fault"), token)


async def _shown_now(state: AppState, session: RobotSession) -> bytes | None:
    """What the pages of a robot show now; None where that is not known."""
    views = state.fleet.stop_views
    with suppress(LogError):  # it is too large
        return await views.now(session) if views is not None else None
    return None


def _reader(state: AppState) -> StopReader:
    return StopReader(stores_of(state.fleet, state.log))


async def _recording(state: AppState, stop: Stop) -> "KeptRecording | None":
    """None without one."""
    folder = state.fleet.recordings_folder
    if folder is None:
        return None
    from app.cell.history.kept import recording_of  # imports MCAP

    return await asyncio.to_thread(recording_of, folder, stop.robot, stop.at)


async def _shown_recording(
    request: Request, state: AppState, stop: Stop, act: str
) -> ShownRecording | None:
    if recording := await _recording(state, stop):
        offset = number(f"{stop.at - recording.since:.1f}", "s")
        shared = state.shared.of_stop(stop.key)
        links = links_of(shared, str(request.base_url)) if shared else None
        until = word("shared", until=format_time(shared.until)) if shared else ""
        refused = said_of(act, [session.shift_acts for session in state.fleet.sessions])
        at = word("recording_at", offset=offset)
        return ShownRecording(recording.path, at, links, until, refused)
    folder = state.fleet.recordings_folder
    if folder is None or time.time() - stop.at > WRITTEN_S:
        return None
    from app.cell.history.kept import has_unfinished  # imports MCAP

    is_written = await asyncio.to_thread(has_unfinished, folder, stop.robot)
    return ShownRecording("", word("recording_going")) if is_written else None


async def _asked(state: AppState, reader: StopReader, stop: Stop, act: str) -> AskedStop | None:
    """The keys of a stop; None where its reason can't be given."""
    rules = state.fleet.panel.oee
    if rules is None or not rules.reasons:
        return None
    stood = await reader.standstill_at(stop)
    if stood is None or not stood.key:
        return None
    refused = said_of(act, [session.shift_acts for session in state.fleet.sessions])
    newest = stood.answer
    answer: TextLike = ""
    if newest is not None:
        label = next((r.label for r in rules.reasons if r.id == newest.reason), newest.reason)
        who, at = who_of(printable(newest.who)), format_time(newest.at)
        answer = word_of_figures("given", reason=label, who=who, time=at)
    return AskedStop(rules.reasons, stood.reason, answer, refused)


def _to(state: AppState, stop: Stop | None) -> Response:
    path = f"/stops/{stop.key}" if stop else "/stops"
    return RedirectResponse(f"{state.root}{path}", status_code=303)


def sort_and_number(key: str) -> tuple[StopSort, int]:
    """Of a key in addresses."""
    sort, _, written = key.partition("-")
    return next(each for each in STOP_SORTS if each == sort), int(written)  # the pattern has them


def _by_day(stops: Sequence[Stop]) -> Iterator[tuple[Text, list[ShownStop]]]:
    for day, of_day in groupby(stops, key=lambda stop: datetime.fromtimestamp(stop.at).date()):
        yield (
            day_name(day),
            [
                ShownStop(
                    each.key, each.sort, format_time(each.at), iso_time(each.at), each.robot, each.text
                )
                for each in of_day
            ],
        )


def story_context(
    story: Story,
    end: float | None,
    names: PanelNames,
    robots: Mapping[str, TextLike],
    is_whole: bool,
    language: str,
    asked: AskedStop | None = None,
) -> StoryContext:
    """The variables of a story, for its page and for paper; `end` is when the stop was over, None while
    it is not known to be. `robots` are the names of the panel's robots by their ids."""
    short = story.short()
    lines = story.lines if is_whole else short
    count, every = number(str(len(short))), number(f"{len(story.lines):,d}")
    duration = duration_text(float(round(end - story.stop.at))) if end is not None else ""
    return StoryContext(
        story=story,
        of_robot=robots.get(story.stop.robot, "") if len(robots) > 1 else "",
        at=format_datetime(story.stop.at),
        lasted=word("stopped_for", duration=duration) if duration else "",
        lines=[_shown(line, story) for line in lines],
        is_whole=is_whole,
        these=word("these", count=count),
        every=word("all", count=every),
        order=word("by_stamps" if story.by_stamps else "by_arrival"),
        left_out="" if story.is_complete else word("left_out", count=number(f"{MOST_EVENTS:,d}")),
        to_do=to_do(story, names, language),
        asked=asked,
        parcel=False,
        recording=None,
        curves=None,
        say=say,
        alarm_word=alarm_word,
        log_word=log_word,
        word=word,
        figures_word=word_of_figures,
    )


def _shown(line: Line, story: Story) -> ShownLine:
    event = line.event
    beside = [part for part in (who_of(event.by) if event.by else "", event.detail) if part]
    change: TextLike = ""
    if event.before and event.after:
        change = say("story_change", before=event.before, after=event.after)
    return ShownLine(
        _offset(line.offset_s, story),
        event.sort,
        SIGNS[event.sort],
        event.priority if event.sort == "alarm" else 0,
        event.text,
        joined(beside, "between_names") if beside else "",
        change,
        line.is_first,
        line.is_before,
    )


def _offset(seconds: float, story: Story) -> TextLike:
    """Thousandths only where stamps have them."""
    is_fine = story.by_stamps and abs(seconds) < 10.0
    text = f"{seconds:.3f}" if is_fine else f"{seconds:.1f}"
    return number(text.replace("-", MINUS), "s")


def to_do(story: Story, names: PanelNames, language: str) -> ToDo:
    """The steps of the first cause, or else of the stop: those of its alarm or interlock."""
    for event in (story.first, *(line.event for line in story.lines if line.event.breaks)):
        if event is not None and (advice := advice_of(event, names)):
            text, picture = advice
            return ToDo([line for line in render(text, language).splitlines() if line.strip()], picture)
    return ToDo([], "")


def advice_of(event: Event, names: PanelNames) -> tuple[TextLike, TextLike] | None:
    """What the panel file says to do about an event, and its picture."""
    if event.sort == "alarm":
        alarm = names.alarms.get(panel_id(event.id))
        return (alarm.action, alarm.picture or "") if alarm and alarm.action else None
    if event.sort not in ("interlock", "condition"):
        return None
    interlock = next((each for each in names.panel.interlocks if each.id == event.id), None)
    if interlock is not None:
        return (interlock.advice, interlock.help.picture or "") if interlock.advice else None
    condition = next((each for each in names.panel.own_conditions if each.id == event.id), None)
    return (condition.action, "") if condition and condition.action else None


def story_answer(story: Story, name: TextLike, end: float | None, language: str) -> dict[str, Any]:
    """A story for programs: times are RFC 3339, offsets seconds from its zero. `name` is that of the
    robot that stopped, "" for a panel without `[[robot]]`."""
    stop, first = story.stop, story.first

    def text(value: TextLike) -> str:
        return str(localized(value, language))

    return {
        "stop": {
            "key": stop.key,
            "sort": stop.sort,
            "id": stop.id,
            "robot": stop.robot,
            "robot_name": text(name),
            "text": text(stop.text),
            "at": iso_time(stop.at),
            "end": None if end is None else iso_time(end),
        },
        "sentence": text(story.sentence),
        "first_cause": None if first is None else {"sort": first.sort, "id": first.id},
        "not_told": story.why,
        "ordered_by": "stamps" if story.by_stamps else "arrival",
        "zero": iso_time(story.zero),
        "complete": story.is_complete,
        "lines": [
            {
                "offset_s": round(line.offset_s, 3),
                "at": iso_time(line.event.at),
                "sent": None if line.event.sent is None else iso_time(line.event.sent),
                "sort": line.event.sort,
                "id": line.event.id,
                "text": text(line.event.text),
                "detail": text(line.event.detail),
                "before": text(line.event.before),
                "after": text(line.event.after),
                "by": line.event.by,
                "first_cause": line.is_first,
            }
            for line in story.lines
        ],
    }

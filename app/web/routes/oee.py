"""The figures of a shift: a page to be printed, JSON and CSV."""

import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Final, Literal, NamedTuple, TypedDict
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, JSONResponse, Response
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field

from app.cell.alarms.records import text_of
from app.cell.alarms.report import Shift, shift_at
from app.cell.session.stops import figures_of
from app.cell.stops.oee import (
    NOT_ANSWERED,
    SHORT,
    ReasonTime,
    ShiftFigures,
    StopTime,
    open_stops,
    state_text,
)
from app.cell.view.times import duration_text
from app.panel.rules import OeeRules
from app.system.clock import format_time, iso_time
from app.system.csv_text import csv_text, text_cell
from app.system.errors import NotFound
from app.system.texts import Text, TextLike, localized, number, say
from app.web.app_state import AppState, CurrentState
from app.web.caller import caller_of
from app.web.pages.alarm_figures import clock_text
from app.web.pages.alarms import word as alarm_word
from app.web.pages.context import FramedPage, framed_page
from app.web.requests import TEXT, errors
from app.web.routes.alarm_report import SHIFT_WORDS, SHIFTS, span_text

router = APIRouter()

MARKS: Final = 4  # of the band
MINUTE_S: Final = 60.0


class OeeQuery(BaseModel):
    """`robot` is the id of the one whose figures are shown; "" shows those of all. With `open` the page
    lists their stops whose reason is not known, else the longest."""

    model_config = ConfigDict(extra="forbid")

    shift: Literal["this", "last", "previous"] = "this"
    robot: Annotated[str, Field(max_length=64)] = ""
    open: Literal["", "1"] = ""

    def address(self) -> str:
        """The shift and the robot as the query of an address."""
        return urlencode({"shift": self.shift} | ({"robot": self.robot} if self.robot else {}))


class Figure(NamedTuple):
    """A figure in percent, "" where it is not known; `beside` says what it is made of, and `bar` is its
    length in percent. `target` is "" and `mark` None without a target."""

    name: TextLike
    value: TextLike
    beside: TextLike
    bar: float
    target: TextLike = ""
    mark: float | None = None


class ShownBand(NamedTuple):
    """A part of the band of states, in percent of it."""

    kind: str
    x: float
    width: float


class ShownReason(NamedTuple):
    """A row of the Pareto; `bar` is in percent of the first."""

    label: TextLike
    is_open: bool
    bar: float
    minutes: TextLike
    stops: TextLike
    share: TextLike


class ShownStop(NamedTuple):
    """A stop of the table; `key` leads to its story, "" without one. `reason` is "" where it is not
    answered."""

    key: str
    began: TextLike
    lasted: TextLike
    state: TextLike
    reason: TextLike
    asks: bool


class ListedStops(NamedTuple):
    """The stops of one robot in the table. `robot` is its name, "" for the panel's only one."""

    robot: TextLike
    stops: list[ShownStop]


class RobotShown(NamedTuple):
    """The figures of one robot. `robot` is its name, "" for the panel's only one."""

    robot: TextLike
    oee: Figure
    parts: list[Figure]
    bands: list[ShownBand]
    summed: TextLike
    reasons: list[ShownReason]
    lacks: list[TextLike]


class OeeContext(TypedDict):
    """The variables of `oee.html`, beside those of the frame."""

    form: OeeQuery
    shifts: list[tuple[Text, TextLike, str, bool]]
    robots: Mapping[str, TextLike]
    span: Text
    shown: list[RobotShown]
    marks: list[TextLike]
    table: TextLike
    has_open: bool
    listed: list[ListedStops]
    query: str
    alarm_word: Any
    word: Any


class StopAnswer(BaseModel):
    """A stop of a shift, without its breaks. `key` is its name in addresses, "" without a story, and
    `reason` the id of its reason, "" where none was given. `short`: its reason is not asked."""

    key: str
    began: AwareDatetime
    ended: AwareDatetime | None
    seconds: float
    state: str
    reason: str
    reason_text: str
    by: str
    short: bool


class ReasonAnswer(BaseModel):
    """How long and how often the machine stood still for a reason; `share` is that of it and all above
    it, from 0 to 1. `reason` is "" for stops without an answer, "-" for short ones."""

    reason: str
    text: str
    seconds: float
    stops: int
    share: float


class TargetsAnswer(BaseModel):
    """The targets of the panel file, from 0 to 1; null without one."""

    availability: float | None
    performance: float | None
    quality: float | None
    oee: float | None


class RobotFigures(BaseModel):
    """The figures of a robot, with the names of ISO 22400-2; null is not known. Times in seconds.
    `robot` is its id and `name` its name, both "" for a panel without `[[robot]]`."""

    robot: str
    name: str
    planned_busy_time_s: float
    actual_production_time_s: float
    actual_unit_down_time_s: float
    planned_stops_s: float
    not_recorded_s: float
    counted_s: float
    produced_quantity: float | None
    good_quantity: float | None
    availability: float | None
    performance: float | None
    quality: float | None
    oee: float | None
    reasons: list[ReasonAnswer]
    stops: list[StopAnswer]


class OeeAnswer(BaseModel):
    """A shift up to now, with the figures of each robot."""

    since: AwareDatetime
    until: AwareDatetime
    targets: TargetsAnswer
    robots: list[RobotFigures]


def word(name: str, **about: Any) -> Text:
    return say(f"oee_{name}", **about)


@router.get(
    "/oee",
    response_class=HTMLResponse,
    summary="The figures of a shift: OEE, reasons of stops, the longest stops",
    responses=errors(403, 404, 422, 429, 503),
)
async def oee_page(
    request: Request, state: CurrentState, form: Annotated[OeeQuery, Query()]
) -> Response:
    now = time.time()
    rules, shift, figures = await _figures(state, form, now)
    page = FramedPage("oee.html", word("title"), f"/oee?{form.address()}", "alarms")
    return framed_page(request, state, page, oee_context(state, form, rules, shift, figures, now))


@router.get(
    "/oee/figures",
    response_model=OeeAnswer,
    summary="The figures of a shift as JSON",
    responses=errors(403, 404, 422, 429, 503),
)
async def oee_figures(
    request: Request, state: CurrentState, form: Annotated[OeeQuery, Query()]
) -> Response:
    now, names = time.time(), state.fleet.panel.robot_names
    rules, shift, figures = await _figures(state, form, now)
    content = localized(figures_json(rules, shift, figures, names, now), caller_of(request).language)
    return JSONResponse(content, headers={"cache-control": "no-store"})


@router.get(
    "/oee/stops.csv",
    response_class=Response,
    summary="The stops of a shift as CSV",
    responses=errors(403, 404, 422, 429, 503) | {200: {"content": {"text/csv": {"schema": TEXT}}}},
)
async def oee_stops(
    request: Request, state: CurrentState, form: Annotated[OeeQuery, Query()]
) -> Response:
    rules, _, figures = await _figures(state, form, time.time())
    language = caller_of(request).language
    names, columns = state.fleet.panel.robot_names, list(StopAnswer.model_fields)
    rows = [
        [_cell(value, language) for value in (robot, names.get(robot, ""), *map(stop.get, columns))]
        for robot, of_robot in figures.items()
        for stop in (_stop_json(rules, each) for each in of_robot.stops)
    ]
    columns = ["robot", "name", *columns]
    headers = {"content-disposition": 'attachment; filename="stops.csv"', "cache-control": "no-store"}
    return Response(csv_text(columns, rows), media_type="text/csv", headers=headers)


def _cell(value: Any, language: str) -> Any:
    is_text = isinstance(value, str | Text)
    return text_cell(str(localized(value, language))) if is_text else value


async def _figures(
    state: AppState, form: OeeQuery, now: float
) -> tuple[OeeRules, Shift, dict[str, ShiftFigures]]:
    """The figures of the chosen robots up to now, by the robot's id."""
    panel, sessions = state.fleet.panel, state.fleet.chosen(form.robot)
    if panel.oee is None or panel.state is None:
        raise NotFound("this panel has no [oee]")
    shift = shift_at(now, panel.alarm_rules.shifts, SHIFTS.index(form.shift))
    until = min(shift.until, now)
    return panel.oee, shift, await figures_of(state.fleet, state.log, sessions, shift.since, until)


def _listed(
    form: OeeQuery,
    rules: OeeRules,
    figures: Mapping[str, ShiftFigures],
    names: Mapping[str, TextLike],
) -> Iterator[ListedStops]:
    """The table of stops: those without a reason, or the longest of each robot."""
    opened = open_stops(figures)
    for robot, of_robot in figures.items():
        stops: Sequence[StopTime] = of_robot.longest
        if form.open:
            stops = [stop.time for stop in opened if stop.robot == robot]
        if stops:
            yield ListedStops(names.get(robot, ""), [_shown(stop, rules) for stop in stops])


def oee_context(
    state: AppState,
    form: OeeQuery,
    rules: OeeRules,
    shift: Shift,
    figures: Mapping[str, ShiftFigures],
    now: float,
) -> OeeContext:
    """The page of a shift up to now, with the figures of robots by their ids."""
    panel = state.fleet.panel
    starts = panel.alarm_rules.shifts
    # A name tells robots apart: the only one of a panel needs none.
    names = panel.robot_names if len(panel.robots) > 1 else {}
    passed = min(shift.until, now) - shift.since
    return OeeContext(
        form=form,
        shifts=[
            (say(SHIFT_WORDS[back]), span_text(shift_at(now, starts, back)), name, name == form.shift)
            for back, name in enumerate(SHIFTS)
        ],
        robots=names,
        span=span_text(shift),
        shown=[_robot_shown(names.get(robot, ""), each, rules) for robot, each in figures.items()],
        marks=[clock_text(shift.since + n * passed / MARKS) for n in range(MARKS + 1)],
        table=word("open" if form.open else "longest"),
        has_open=any(each.open for each in figures.values()),
        listed=list(_listed(form, rules, figures, names)),
        query=form.address(),
        alarm_word=alarm_word,
        word=word,
    )


def _robot_shown(name: TextLike, figures: ShiftFigures, rules: OeeRules) -> RobotShown:
    whole = max(1.0, figures.until - figures.since)
    down, count = _minutes(figures.down_s), number(str(len(figures.stops)))
    return RobotShown(
        name,
        oee=_figure("index", figures.oee, _good(figures), rules.target),
        parts=list(_parts(figures, rules)),
        bands=[
            ShownBand(
                band.kind,
                round(100 * (band.since - figures.since) / whole, 3),
                round(100 * (band.until - band.since) / whole, 3),
            )
            for band in figures.bands
        ],
        summed=word("sum", minutes=down, count=count) if figures.stops else "",
        reasons=list(_reasons(figures.reasons, rules)),
        lacks=list(_lacks(figures)),
    )


def _percent(share: float | None) -> TextLike:
    return "" if share is None else number(f"{100 * share:.1f}")


def _minutes(seconds: float) -> TextLike:
    return number(f"{seconds / MINUTE_S:.1f}")


def _quantity(parts: float) -> TextLike:
    return number(f"{parts:,.0f}")


def _good(figures: ShiftFigures) -> TextLike:
    return "" if figures.good is None else word("good", count=_quantity(figures.good))


def _figure(name: str, share: float | None, beside: TextLike, target: float | None) -> Figure:
    bar = min(100.0, 100 * (share or 0.0))
    if target is None:
        return Figure(word(name), _percent(share), beside, bar)
    said = word("target", target=number(f"{target:g}"))
    return Figure(word(name), _percent(share), beside, bar, said, target)


def _parts(figures: ShiftFigures, rules: OeeRules) -> Iterator[Figure]:
    """Availability, performance and quality, with what each is made of."""
    times = word("of_minutes", part=_minutes(figures.running_s), whole=_minutes(figures.busy_s))
    yield _figure("availability", figures.availability, times, rules.target_availability)
    cycle: TextLike = ""
    if figures.performance and rules.ideal_cycle_s is not None:
        actual = rules.ideal_cycle_s / figures.performance
        ideal = number(f"{rules.ideal_cycle_s:.1f}")
        cycle = word("cycle", cycle=number(f"{actual:.1f}"), ideal=ideal)
    yield _figure("performance", figures.performance, cycle, rules.target_performance)
    rejected: TextLike = ""
    if figures.quality is not None and figures.produced is not None and figures.good is not None:
        bad = _quantity(figures.produced - figures.good)
        rejected = word("rejected", count=bad, whole=_quantity(figures.produced))
    yield _figure("quality", figures.quality, rejected, rules.target_quality)


def _label(reason: str, rules: OeeRules) -> TextLike:
    """A reason as an operator reads it; one that the panel file no longer has by its id."""
    if reason == NOT_ANSWERED:
        return word("not_answered")
    if reason == SHORT:
        return word("short")
    return next((each.label for each in rules.reasons if each.id == reason), reason)


def _reasons(rows: Sequence[ReasonTime], rules: OeeRules) -> Iterator[ShownReason]:
    for row in rows:
        yield ShownReason(
            _label(row.reason, rules),
            row.reason == NOT_ANSWERED,
            round(100 * row.seconds / rows[0].seconds, 2),
            _minutes(row.seconds),
            number(f"{row.stops:,d}", "×"),
            number(f"{100 * row.share:.0f}", "%"),
        )


def _shown(stop: StopTime, rules: OeeRules) -> ShownStop:
    of_stop = stop.stop
    reason = "" if of_stop.reason == NOT_ANSWERED else _label(of_stop.reason, rules)
    return ShownStop(
        of_stop.key,
        format_time(of_stop.standstill.since),
        duration_text(float(round(stop.seconds))),
        text_of(state_text(of_stop.standstill.state)),
        reason,
        bool(of_stop.key and rules.reasons) and not stop.is_short,
    )


def _lacks(figures: ShiftFigures) -> Iterator[TextLike]:
    """What the figures lack."""
    if not (figures.running_s or figures.down_s or figures.planned_s):
        yield word("no_record")
    elif figures.unknown_s >= 1.0:
        yield word("unrecorded", duration=duration_text(float(round(figures.unknown_s))))
    if figures.performance is not None and figures.running_s - figures.counted_s >= MINUTE_S:
        part, whole = (
            duration_text(float(round(seconds))) for seconds in (figures.counted_s, figures.running_s)
        )
        yield word("uncounted", part=part, whole=whole)


def figures_json(
    rules: OeeRules,
    shift: Shift,
    figures: Mapping[str, ShiftFigures],
    names: Mapping[str, TextLike],
    now: float,
) -> dict[str, Any]:
    """The figures of robots by their ids as JSON, with texts that are not rendered yet."""
    return {
        "since": iso_time(shift.since),
        "until": iso_time(min(shift.until, now)),
        "targets": {
            name: None if target is None else target / 100
            for name, target in (
                ("availability", rules.target_availability),
                ("performance", rules.target_performance),
                ("quality", rules.target_quality),
                ("oee", rules.target),
            )
        },
        "robots": [
            {"robot": robot, "name": names.get(robot, ""), **_robot_json(rules, each)}
            for robot, each in figures.items()
        ],
    }


def _robot_json(rules: OeeRules, figures: ShiftFigures) -> dict[str, Any]:
    return {
        "planned_busy_time_s": figures.busy_s,
        "actual_production_time_s": figures.running_s,
        "actual_unit_down_time_s": figures.down_s,
        "planned_stops_s": figures.planned_s,
        "not_recorded_s": figures.unknown_s,
        "counted_s": figures.counted_s,
        "produced_quantity": figures.produced,
        "good_quantity": figures.good,
        "availability": figures.availability,
        "performance": figures.performance,
        "quality": figures.quality,
        "oee": figures.oee,
        "reasons": [{**row._asdict(), "text": _label(row.reason, rules)} for row in figures.reasons],
        "stops": [_stop_json(rules, stop) for stop in figures.stops],
    }


def _stop_json(rules: OeeRules, stop: StopTime) -> dict[str, Any]:
    of_stop, standstill = stop.stop, stop.stop.standstill
    return {
        "key": of_stop.key,
        "began": iso_time(standstill.since),
        "ended": iso_time(standstill.until) if standstill.is_over else None,
        "seconds": stop.seconds,
        "state": text_of(state_text(standstill.state)),
        "reason": of_stop.reason,
        "reason_text": _label(SHORT if stop.is_short else of_stop.reason, rules),
        "by": of_stop.answer.who if of_stop.answer else "",
        "short": stop.is_short,
    }

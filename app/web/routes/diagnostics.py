"""The page of diagnostics, the same as JSON, a live look into a topic, and the acts of the page."""

import asyncio
import sys
import time
from collections.abc import Mapping
from dataclasses import fields
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Any, Final
from urllib.parse import urlencode

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import HTMLResponse, Response

from app.cell.commands.acts import ActContext, ActRunner
from app.cell.commands.diagnostic_acts import DIAGNOSTIC_ACTS
from app.cell.commands.machine_acts import MACHINE_ACTS, MachineRunner
from app.cell.commands.press import PRESS_ID
from app.cell.robot.traffic import RoundTripSummary
from app.cell.session.alarm_mqtt import AlarmMqtt
from app.cell.session.doctor_process import DoctorProcess
from app.cell.session.looks import Look, Survey, TopicPreview
from app.cell.session.session import RobotSession
from app.cell.view.clock_status import clock_status
from app.cell.view.diagnostics import (
    TopicRow,
    graph_topic_rows,
    node_rows,
    parameter_rows,
    robots_in,
    server_rows,
    topic_rows,
)
from app.cell.view.link_status import LinkStatus
from app.cell.view.machine_status import MachineRow, machine_rows
from app.panel.roles import ENGINEER
from app.records.press_record import PressLog
from app.ros.graph.model import SurveyedTopic, topic_forwarding
from app.ros.messages.names import Qos
from app.system.clock import iso_time
from app.system.errors import KioskError, NotFound
from app.system.texts import TextLike, say
from app.web.acts import act_responses, said_of, sent_act
from app.web.app_state import AppState, CurrentState
from app.web.caller import caller_of
from app.web.downloads import SharedLinks, links_of
from app.web.large_answers import rows_answer
from app.web.pages.context import FramedPage, framed_page
from app.web.pages.diagnostics import (
    TEXTS,
    DiagnosticActBody,
    DiagnosticReceipt,
    DiagnosticsAnswer,
    DiagnosticsQuery,
    LookAnswer,
    LookQuery,
    diagnostics_context,
    trip_note,
    versions,
    word,
)
from app.web.requests import JSON, PAGE, FormFields, described_body, errors

if TYPE_CHECKING:
    from app.cell.history.recording import Recorder
    from app.cell.session.forward_process import ForwardProcess


# What the page of diagnostics shows, as JSON for programs.


def diagnostics_json(
    session: RobotSession, survey: Survey, doctor: DoctorProcess, versions: Mapping[str, str]
) -> dict[str, Any]:
    """The content of a `DiagnosticsAnswer`, with texts in no language yet."""
    panel, robot, now = session.panel, session.robot, time.monotonic()
    topics = topic_rows(panel, robot, now)
    behind = robots_in(survey.graph, robot.graph.every_peer)
    used = {row.key for row in topics}
    trips = {"bridge": robot.round_trips.summary(now), "node": session.node_trips.summary(now)}
    return {
        "versions": dict(versions),
        "links": [
            _link(name, link, trips.get(name))
            | {"trip_note": trip_note(name, link, trips.get(name), session.node_trips)}
            for name, link in session.publisher.view["link"].items()
        ],
        "clock": fields_of(clock_status(robot, now)),
        "topics": [_topic(row) for row in topics],
        "servers": [fields_of(row) for row in server_rows(panel, robot, now)],
        "parameters": [
            {**fields_of(row), "read_at": _at(row.read_wall)} for row in parameter_rows(panel, robot)
        ],
        "graph": {
            "at": _at(survey.wall),
            "fault": survey.fault,
            "nodes": [fields_of(row) for row in node_rows(behind)],
            "topics": [fields_of(row) for row in graph_topic_rows(behind, used, survey.lost_topics)],
        },
        "doctor": _doctor(doctor),
        "looks": sorted(session.looks.keys),
    }


def mqtt_json(mqtt: AlarmMqtt) -> dict[str, Any] | None:
    """The content of an `MqttAnswer`; None for a panel that does not publish its alarms."""
    if not mqtt.address:
        return None
    return {
        "address": mqtt.address,
        "connected": mqtt.is_connected,
        "state": mqtt.state,
        "since": _at(mqtt.since),
        "last_error": mqtt.last_error,
        "waiting": mqtt.waiting,
        "published": mqtt.published,
        "dropped": mqtt.dropped,
    }


def machine_runner(state: AppState) -> MachineRunner:
    """Made with the first act: no page needs it."""
    if state.machine_acts is None:
        context = ActContext(state.fleet.first.press_guard, PressLog(state.log), "", lambda: None)
        state.machine_acts = ActRunner(
            "diagnostics", MACHINE_ACTS, lambda: state.fleet.machine, context
        )
    return state.machine_acts


def rows_of_machine(state: AppState) -> list[MachineRow]:
    """None on a wall, and in the first seconds."""
    watch = state.fleet.machine
    return [*machine_rows(watch.now, time.time())] if watch is not None else []


def machine_json(state: AppState) -> list[dict[str, Any]]:
    """The contents of `MachineAnswer`s."""
    names = ("id", "state", "text", "about", "reason")
    return [{name: getattr(row, name) for name in names} for row in rows_of_machine(state)]


def forward_json(forward: "ForwardProcess | None") -> dict[str, Any] | None:
    """The content of a `ForwardAnswer`; None for a panel without a central database."""
    if forward is None:
        return None
    status = forward.status
    return {
        "address": status.address,
        "connected": status.connected,
        "fault": status.fault,
        "note": status.note,
        "since": _at(status.since),
        "rows": status.rows,
        "oldest": None if status.oldest is None else iso_time(status.oldest),
        "bytes": status.size,
        "unsent": status.unsent,
        "sent": status.sent,
    }


def fields_of(row: Any) -> dict[str, Any]:
    """The fields of a dataclass. Texts in them are not copied."""
    return {field.name: getattr(row, field.name) for field in fields(row)}


def _at(wall: float) -> str | None:
    return iso_time(wall) if wall else None


def _link(name: str, link: LinkStatus, trips: RoundTripSummary | None) -> dict[str, Any]:
    shown = {"state": link["state"], "text": link["text"], "reason": link["reason"]}
    return {"name": name, **shown, "round_trips": round_trips_json(trips)}


def round_trips_json(trips: RoundTripSummary | None) -> dict[str, Any] | None:
    """In ms."""
    if trips is None:
        return None
    numbers = {name: _ms(getattr(trips, name)) for name in ("least", "median", "most", "last")}
    return {**numbers, "medians": [_ms(seconds) for seconds in trips.medians]}


def _ms(seconds: float) -> float:
    return round(seconds * 1000, 3)


def _topic(row: TopicRow) -> dict[str, Any]:
    content, undecodable = fields_of(row), row.undecodable
    if undecodable is not None:
        content["undecodable"] = {
            "first": undecodable.first.hex(" "),
            "size": undecodable.size,
            "reason": undecodable.reason,
            "at": _at(undecodable.wall),
        }
    return content


def _doctor(doctor: DoctorProcess) -> dict[str, Any]:
    report = doctor.report
    return {
        "running": doctor.is_busy,
        "at": _at(doctor.wall),
        "fault": doctor.fault,
        "well": report.well if report else None,
        "findings": [finding.model_dump(by_alias=True) for finding in report.findings]
        if report
        else [],
        "more": report.more if report else {},
        "facts": report.facts if report else [],
    }


def look_json(look: Look) -> dict[str, Any]:
    """The content of a `LookAnswer`, with texts in no language yet."""
    return {
        "topic": look.topic.name,
        "types": look.topic.types,
        "received": look.received,
        "fault": look.fault,
        "messages": [
            {"number": message.number, "at": _at(message.wall), **fields_of(message.content)}
            for message in look.messages
        ],
    }


router = APIRouter()

DiagnosticAct = Annotated[str, Path(json_schema_extra={"enum": [*DIAGNOSTIC_ACTS, *MACHINE_ACTS]})]
ACT_FORM: Final = FormFields(
    {
        "id": {"pattern": PRESS_ID},
        "page": {},
        "robot": {"maxLength": 64},
        "version": {"maxLength": 64},
        "days": {"pattern": "^[0-9]{1,2}$"},
    }
)
DEPTH: Final = 10  # of the bridge's reader for a look: two messages a second are shown
ZIP: Final = "application/zip"


@router.get(
    "/diagnostics",
    response_model=DiagnosticsAnswer,
    summary="Links, topics, services, parameters, the ROS graph and the doctor's findings",
    responses=errors(403, 404, 422) | {200: {"content": PAGE}},
)
async def diagnostics(
    request: Request, state: CurrentState, query: Annotated[DiagnosticsQuery, Query()]
) -> Response:
    session = _session(state, query.robot)
    if caller_of(request).accepts_html:
        return await _page(request, state, session, query)
    content = diagnostics_json(session, await _survey(session), state.doctor, versions())
    content["mqtt"] = mqtt_json(state.fleet.alarms.mqtt)
    content["forward"] = forward_json(state.fleet.forward)
    content["machine"] = machine_json(state)
    return await rows_answer(request, lambda: content, sys.maxsize)


@router.get(
    "/diagnostics/look",
    response_model=LookAnswer,
    summary="The newest messages of any topic of the robot, read only",
    responses=errors(403, 404, 422) | {200: {"content": PAGE}},
)
async def look(request: Request, state: CurrentState, query: Annotated[LookQuery, Query()]) -> Response:
    """Goes on for six seconds after each request."""
    looked = await _look(_session(state, query.robot), query.topic)
    if not caller_of(request).accepts_html:
        return await rows_answer(request, lambda: look_json(looked), len(looked.messages))
    about = {"looked": looked, "form": query.form, **TEXTS}
    html = state.templates.render("_look.html", caller_of(request).language, **about)
    return HTMLResponse(html, headers={"cache-control": "no-store", "vary": "accept"})


@router.post(
    "/diagnostics/{act}",
    summary="A check by the doctor, the support bundle, a shared recording, or a postponed notice",
    responses=act_responses(DiagnosticReceipt)
    | {
        200: {
            "content": {
                JSON: {"schema": DiagnosticReceipt.model_json_schema()},
                ZIP: {"schema": {"type": "string", "format": "binary"}},
            },
            "description": "the receipt, of `bundle` the zip",
        },
        503: {"description": "the operator's log can't be written, or the bundle not be made"},
    },
    openapi_extra=described_body(DiagnosticActBody, ACT_FORM.schema, required=False),
)
async def act(act: DiagnosticAct, request: Request, state: CurrentState) -> Response:
    session = _session(state, "")
    sent = await sent_act(request, state, DiagnosticActBody, ACT_FORM)
    robot = sent.body.robot
    recorder = state.fleet.of_robot(robot).commands.recorder
    if act == "foxglove" and recorder is None:
        raise NotFound(say("recording_off"))
    act_id = sent.act_id(act) if sent.form else sent.act_id()
    if act in MACHINE_ACTS:
        asked = sent.asked(act, sent.body.version, {"days": sent.body.days})
        receipt = await sent.run(machine_runner(state), asked, act_id)
    else:
        receipt = await sent.run(session.diagnostic_acts, sent.asked(act), act_id)
    if receipt.done and act == "bundle":
        return sent.with_cookie(await _bundle(state))
    address = ""
    if receipt.done and act == "foxglove" and recorder is not None:
        address = await _share(request, state, recorder, robot, act_id)
    query = sent.form.get("page", "") if sent.form else ""
    page = f"{state.root}/diagnostics{f'?{query}' if query else ''}"
    return sent.answer(receipt, page, recording=address)


def _session(state: AppState, robot: str) -> RobotSession:
    """NotFound on a panel without the page."""
    if not state.fleet.panel.diagnostics.enabled:
        raise NotFound(word("off"))
    return state.fleet.of_robot(robot)


async def _page(
    request: Request, state: AppState, session: RobotSession, query: DiagnosticsQuery
) -> Response:
    """The whole page, or its content alone."""
    language = caller_of(request).language
    looked, refused = await _preview(session, "" if query.paused else query.look)
    survey = await _survey(session)
    trips = _page_trips(request, state, query.rtt)
    context = diagnostics_context(
        session, survey, state.doctor, query, looked, refused, language, trips
    )
    again = urlencode({"robot": query.robot} if query.robot else {})
    name = "_diagnostics.html" if query.part else "diagnostics.html"
    page = FramedPage(name, word("title"), f"/diagnostics?{again}", "diagnostics", query.robot)
    more = {
        "act_refused": said_of(query.act, [state.fleet.first.diagnostic_acts, machine_runner(state)]),
        "mqtt": state.fleet.alarms.mqtt,
        "forward": state.fleet.forward.status if state.fleet.forward else None,
        "shared": _shared(request, state, query.robot),
        "machine_rows": rows_of_machine(state),
        "may_postpone": caller_of(request).principal.meets(ENGINEER),
        "sent_panel": await _sent_panel(state),
    }
    return framed_page(request, state, page, {**context, **TEXTS, **more})


async def _sent_panel(state: AppState) -> tuple[str, TextLike] | None:
    """The mark and the text of the panel file that was sent last; None without one."""
    if state.receiver is None:
        return None
    from app.cell.session.sent_panels import outcome_text

    receiver = state.receiver
    take = await asyncio.to_thread(lambda: receiver.last)
    marks = {"kept": "ok", "restored": "problem"}
    return (marks.get(take.phase, "unknown"), outcome_text(take)) if take is not None else None


def _shared(request: Request, state: AppState, robot: str) -> SharedLinks | None:
    """The links to the recording that was shared last, None without one."""
    recording = state.shared.latest(robot)
    return links_of(recording, str(request.base_url)) if recording else None


async def _survey(session: RobotSession) -> Survey:
    """The robot's graph. Begins to measure the round trip to one of its nodes."""
    survey = await session.survey.read()
    if survey.wall:
        session.node_trips.measure(robots_in(survey.graph, session.robot.graph.every_peer))
    return survey


def _page_trips(request: Request, state: AppState, rtt_ms: float | None) -> RoundTripSummary | None:
    """The round trips of this browser, with the one that it sends."""
    caller, now = caller_of(request), time.monotonic()
    browser = caller.principal.client.id or caller.key
    if rtt_ms is not None:
        state.page_trips.record(browser, rtt_ms / 1000, now)
    return state.page_trips.summary(browser, now)


async def _preview(session: RobotSession, key: str) -> tuple[Look | None, TextLike]:
    """A look for the page, or why there is none; without a key neither."""
    if not key:
        return None, ""
    try:
        return await _look(session, key), ""
    except KioskError as error:
        return None, error.text


async def _look(session: RobotSession, key: str) -> Look:
    """A look into a topic that is in the robot's graph; NotFound for others, TooMany for more than a
    few."""
    robot = session.robot
    survey = await session.survey.read()
    used = {robot.key(name) for name in (*session.panel.listened(), *session.panel.publications())}
    for behind in robots_in(survey.graph, robot.graph.every_peer):
        for topic in behind.topics:
            if topic.key != key:
                continue
            name = f"{behind.namespace}{topic.name}"
            if topic_forwarding(behind, topic) == "denied":
                raise NotFound(say("look_not_forwarded", topic=name))
            return await session.looks.look(
                _topic_preview(name, topic, bool(behind.bridges) and topic.key not in used)
            )
    raise NotFound(say("look_no_topic", topic=f"/{key}"))


def _topic_preview(name: str, topic: SurveyedTopic, keeps_route: bool) -> TopicPreview:
    types = dict.fromkeys(end.type for end in topic.publishers or topic.subscribers)
    hashes = {end.type_hash for end in topic.publishers} - {""}
    return TopicPreview(
        name=name,
        key=topic.key,
        types=tuple(types),
        hashes=tuple(sorted(hashes)),
        qos=Qos(topic.reliable, topic.latched, DEPTH),
        keeps_route=keeps_route and bool(topic.publishers),
    )


async def _bundle(state: AppState) -> Response:
    data = await state.doctor.bundle()
    name = f"operator-panel-support-{datetime.now().strftime('%Y%m%d-%H%M%S')}.zip"
    headers = {"content-disposition": f'attachment; filename="{name}"', "cache-control": "no-store"}
    return Response(data, media_type=ZIP, headers=headers | {"content-encoding": "identity"})


async def _share(
    request: Request, state: AppState, recorder: "Recorder", robot: str, act_id: str
) -> str:
    """The address of the last minute of a robot, which is shared once for each act."""
    recording = state.shared.by_act(act_id)
    if recording is None:
        recording = state.shared.share(await recorder.last_minute(), robot, act_id)
    return links_of(recording, str(request.base_url)).address

"""What the page of diagnostics shows, as JSON for programs."""

import time
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from app.clock import iso_time
from app.robot.round_trips import RoundTripSummary
from app.runtime.alarm_mqtt import AlarmMqtt
from app.runtime.doctor_process import DoctorProcess
from app.runtime.graph_survey import Survey
from app.runtime.live_look import Look
from app.runtime.robot_session import RobotSession
from app.view.diagnostic_graph import graph_topic_rows, node_rows, robots_in
from app.view.diagnostic_rows import TopicRow, parameter_rows, server_rows, topic_rows
from app.view.link_status import LinkStatus
from app.web.rendering.diagnostics_texts import trip_note


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
        "topics": [_topic(row) for row in topics],
        "servers": [fields_of(row) for row in server_rows(panel, robot, now)],
        "parameters": [
            {**fields_of(row), "read_at": _at(row.read_wall)} for row in parameter_rows(panel, robot)
        ],
        "graph": {
            "at": _at(survey.wall),
            "fault": survey.fault,
            "nodes": [fields_of(row) for row in node_rows(behind)],
            "topics": [fields_of(row) for row in graph_topic_rows(behind, used, survey.lost)],
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
            {"number": message.number, "at": _at(message.wall), **fields_of(message.shown)}
            for message in look.messages
        ],
    }

"""The options of a select that the robot has: what they are now, and the lock while they are not known.
Pure, from (select, robot, time)."""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from app.cell.permission.verdict import (
    PERMITTED,
    Verdict,
    locked,
    parameters_offered,
    server_offered,
    topic_mismatch,
    unsettable,
)
from app.cell.robot.parameter_state import UNKNOWN
from app.cell.robot.state import RobotState
from app.panel.widgets.families import TopicSource
from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.parameter import Parameter, listed_parameter
from app.panel.widgets.robot_options import MOST, ListingService, RobotOptions
from app.system.texts import number


class OptionsNow(NamedTuple):
    """The texts that may be chosen, none where they are not known; `verdict` locks then."""

    texts: tuple[str, ...]
    verdict: Verdict


class _Listed(NamedTuple):
    """A list as the robot gave it, and when (monotonic seconds); `lock` where there is none."""

    texts: Iterable[Any] = ()
    at: float = math.inf
    lock: Verdict | None = None


def options_now(select: SelectInput, source: RobotOptions, robot: RobotState, now: float) -> OptionsNow:
    """The options at `now` (monotonic seconds): those of the newest list, each once."""
    listed = _listed(select, source, robot)
    if listed.lock is not None:
        return OptionsNow((), listed.lock)
    texts = tuple(dict.fromkeys(text for text in listed.texts if text))[:MOST]
    if not texts:
        return OptionsNow((), locked("options_empty", label=select.label))
    if source.limit_s is None:
        return OptionsNow(texts, PERMITTED)
    stale_at = listed.at + source.limit_s
    if now >= stale_at:
        limit = number(f"{source.limit_s:g}")
        return OptionsNow((), locked("options_old", label=select.label, limit=limit))
    return OptionsNow(texts, Verdict(True, until=stale_at))


def _listed(select: SelectInput, source: RobotOptions, robot: RobotState) -> _Listed:
    unknown = locked("options_unknown", label=select.label)
    if (topic := source.source) is not None:
        return _of_topic(topic, robot, unknown)
    if (service := source.listing) is not None:
        return _of_service(service, robot, unknown)
    parameter = listed_parameter(select)
    if parameter is None:
        return _Listed(lock=unknown)
    listed = _of_parameter(parameter, robot)
    return listed if listed.lock or not source.range else _of_range(select, parameter, robot)


def _of_topic(source: TopicSource, robot: RobotState, unknown: Verdict) -> _Listed:
    reading = robot.reading(source.topic)
    if topic_mismatch("MS", source, robot) is not None or reading.status != "message":
        return _Listed(lock=unknown)
    return _Listed(reading.value(source.fields[0]) or (), reading.at)


def _of_service(service: ListingService, robot: RobotState, unknown: Verdict) -> _Listed:
    if (lock := server_offered("SS", service.name, service.type, robot)) is not None:
        return _Listed(lock=lock)
    answer = robot.option_lists.get(service)
    return _Listed(lock=unknown) if answer is None else _Listed(answer.texts, answer.at)


def _of_parameter(parameter: Parameter, robot: RobotState) -> _Listed:
    """A node reports each change: its list is of now while its state is known."""
    known = robot.parameters.get(parameter.id, UNKNOWN)
    lock = parameters_offered(parameter.node, robot)
    if lock is None and known.state != "live":
        lock = unsettable(parameter, known, robot)
    texts = known.value if isinstance(known.value, tuple) else ()
    return _Listed(map(str, texts), lock=lock)


def _of_range(select: SelectInput, parameter: Parameter, robot: RobotState) -> _Listed:
    """The whole numbers of the range in a node's description, its highest one even beside a step."""
    limits = robot.parameters[parameter.id].range
    if limits.low is None or limits.high is None:
        return _Listed(lock=locked("options_no_range", label=select.label))
    low, high, step = int(limits.low), int(limits.high), int(limits.step or 1)
    if (high - low) // step >= MOST:
        return _Listed(lock=locked("options_too_many", label=select.label, most=str(MOST)))
    numbers = [*range(low, high + 1, step)]
    return _Listed(map(str, numbers if high in numbers else [*numbers, high]))


def options_verdict(widget_id: str, robot: RobotState, now: float) -> Verdict | None:
    """The lock of a command whose message has a choice that is not known now, or until when all are
    known; None for a command without such a choice."""
    verdicts = [
        options_now(select, select.options_from, robot, now).verdict
        for select in robot.selects.get(widget_id, ())
        if select.options_from is not None
    ]
    return min(verdicts, key=lambda verdict: (verdict.permitted, verdict.until)) if verdicts else None

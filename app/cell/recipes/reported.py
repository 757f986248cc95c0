"""The values that a robot reports for the fields of a set of recipes, and what they say about a recipe.
Pure. A value that was never received, is old or cut off is not known."""

import math
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

from app.cell.permission.interlocks import link_verdict
from app.cell.permission.verdict import parameters_offered, topic_mismatch
from app.cell.recipes.recipe import Recipe, Values
from app.cell.robot.parameter_state import UNKNOWN
from app.cell.robot.state import RobotState
from app.cell.robot.topics import kept_s
from app.panel.base import HasTopic, TopicQos
from app.panel.recipe import RecipeReadback
from app.panel.shared_keys import stale_at
from app.panel.values import same_value
from app.panel.widgets.families import Input
from app.panel.widgets.recipe_load import RecipeLoad
from app.system.texts import TextLike, say

NEAR: Final = 1e-6  # of a float32


class Reported(NamedTuple):
    """The value of one field as the robot has it, None if that is not known now: `why` says so then.
    Time alone changes it at `until` (monotonic seconds)."""

    value: Any = None
    why: TextLike = ""
    until: float = math.inf

    @property
    def is_known(self) -> bool:
        return self.value is not None


ReportedFields = Mapping[str, Reported]


class _Topic(NamedTuple):
    topic: str
    type: str
    qos: TopicQos


def reported_fields(load: RecipeLoad, robot: RobotState, now: float) -> dict[str, Reported]:
    """What the robot reports at `now` (monotonic seconds), by the fields' ids."""
    link = link_verdict(robot, now)
    if not link.permitted:
        return {field.id: Reported(None, link.reason or "", link.until) for field in load.fields}
    readback = load.set.readback
    if readback is not None and readback.topic is not None:
        topic = _Topic(readback.topic, readback.type or "", readback.qos)
        return {field.id: _of_topic(readback, topic, field, robot, now) for field in load.fields}
    return {field.id: _of_parameter(load, field, robot) for field in load.fields}


def _of_topic(
    readback: RecipeReadback, topic: HasTopic, field: Input, robot: RobotState, now: float
) -> Reported:
    if mismatch := topic_mismatch("MS", topic, robot):
        return Reported(None, mismatch.reason or "")
    path, most = readback.fields[field.id], readback.max_age_s
    reading = robot.reading(topic.topic).of_field(path, kept_s(most))
    if reading.status not in ("message", "reading") or reading.fields is None:
        return Reported(None, say("recipe_not_reported", topic=topic.topic))
    until = stale_at(reading.at, most)
    if now >= until:
        return Reported(None, say("recipe_report_old", topic=topic.topic))
    value = reading.value(path)
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return Reported(None, say("recipe_not_reported", topic=topic.topic), until)
    return Reported(value, "", until)


def _of_parameter(load: RecipeLoad, field: Input, robot: RobotState) -> Reported:
    parameter = load.reported.get(field.id)
    if parameter is None:
        return Reported(None, say("recipe_not_read"))
    if mismatch := parameters_offered(parameter.node, robot):
        return Reported(None, mismatch.reason or "")
    known = robot.parameters.get(parameter.id, UNKNOWN)
    node, name = parameter.node, parameter.parameter
    if known.state == "mistyped":
        kind, wanted = known.robot_type, parameter.type
        why = say("parameter_mistyped", node=node, name=name, found=kind, wanted=wanted)
        return Reported(None, why)
    if known.state != "live" or known.value is None:
        return Reported(None, say("recipe_parameter_not_read", node=node, name=name))
    return Reported(known.value)


def is_same(field: Input, value: Any, reported: Any) -> bool:
    """Whether the robot has a recipe's value: that which a message would send."""
    sent = field.sent_value(value)
    numbers = [
        isinstance(each, int | float) and not isinstance(each, bool) for each in (sent, reported)
    ]
    if all(numbers):
        return math.isclose(sent, reported, rel_tol=NEAR, abs_tol=1e-9)
    if isinstance(sent, list | tuple) and isinstance(reported, list | tuple):
        return list(sent) == list(reported)
    return same_value(sent, reported)


def loaded(
    fields: Iterable[Input], recipes: Iterable[Recipe], reported: ReportedFields
) -> tuple[str, ...] | None:
    """The ids of the recipes whose values the robot has, all of them; None while it is not known what
    it has."""
    every = list(fields)
    if not all(reported[field.id].is_known for field in every):
        return None
    return tuple(r.id for r in recipes if not differing(every, r.values, reported))


def differing(fields: Iterable[Input], values: Values, reported: ReportedFields) -> list[Input]:
    """The fields of which the robot is known to have another value, or the recipe has none."""
    return [
        field
        for field in fields
        if field.id not in values
        or (
            reported[field.id].is_known
            and not is_same(field, values[field.id], reported[field.id].value)
        )
    ]


def unknown_reason(reported: ReportedFields) -> TextLike:
    """Why it is not known what the robot has; "" if it is."""
    return next((field.why for field in reported.values() if not field.is_known), "")

"""Why a command is locked: the link, its interlocks, its topics and servers. Pure functions from
(robot, time) to a verdict with its reason; `press_permission` calls them in their order.

Unknown means locked: each condition must be known to be met. The first that is not is the reason that
an operator reads.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, Final

from app.cell.permission.conditions import (
    ConditionState,
    condition_state,
    no_value,
    not_finite,
    stale,
    unread,
    value_verdict,
)
from app.cell.permission.verdict import (
    PERMITTED,
    Verdict,
    call_blocked,
    locked,
    parameters_offered,
    set_blocked,
    topic_mismatch,
    unsettable,
)
from app.cell.robot.parameter_state import UNKNOWN
from app.cell.robot.state import RobotState
from app.cell.robot.topics import kept_s
from app.panel.condition import Interlock, NamedCondition
from app.panel.shared_keys import stale_at
from app.panel.template import uses_now
from app.panel.values import number_text
from app.panel.widgets.families import Command, PublishCommand
from app.panel.widgets.kinds import find_row, require_rows
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.publish import PublishPress, Step
from app.panel.widgets.recipe_load import RecipeLoad
from app.panel.widgets.service_action import ServerCommand
from app.panel.widgets.switch import Switch
from app.panel.widgets.templated import is_stop
from app.records.entry import IDLE
from app.ros.dialects.peer_traits import EVERY_SENTENCES, PeerSentences
from app.ros.messages import has_key
from app.system.texts import ended, joined, number, say

# The codes of a `link_verdict` that locks.
LINK_CODES: Final = frozenset({"link_starting", "link_connecting", "link_catching_up"}).union(
    *(sentences.link_codes for sentences in EVERY_SENTENCES)
)

MAX_ENDPOINTS: Final = 3
SEVERAL: Final = 2  # publishers
# The codes of locks that the robot's value decides.
BY_VALUE: Final = frozenset(
    {
        "interlock_not_permitted",
        "interlock_condition_unmet",
        "interlock_field_missing",
        "interlock_field_ambiguous",
        "interlock_field_no_value",
    }
)


def link_verdict(robot: RobotState, now: float) -> Verdict:
    """Whether commands can reach the robot at all."""
    sentences = robot.traits.sentences
    if now < robot.starting_until and not (robot.link_up and robot.graph.peers):
        return Verdict(False, "link_starting", say("link_starting"), robot.starting_until)
    if not robot.link_up:
        return _unreachable(sentences, robot.endpoints)
    if not robot.graph.peers:
        return locked(sentences.absent_named if robot.name else sentences.absent, name=robot.title)
    if robot.graph.has_silent_peer:
        return locked(sentences.silent)
    if sentences.unqueryable and not robot.is_queryable:
        return locked(sentences.unqueryable)
    if now < robot.settled_at:
        return Verdict(False, "link_connecting", say("link_connecting"), robot.settled_at)
    if not robot.is_responding:
        return locked(sentences.silent)
    if not robot.is_caught_up:
        return locked("link_catching_up")
    return PERMITTED


@lru_cache(maxsize=64)
def _unreachable(sentences: PeerSentences, endpoints: tuple[str, ...]) -> Verdict:
    """The reason names the configured endpoints, if there are any."""
    if not endpoints:
        return locked(sentences.unreachable)
    named, more = endpoints[:MAX_ENDPOINTS], len(endpoints) - MAX_ENDPOINTS
    where = say("and_more", names=named, number=more) if more > 0 else named
    return Verdict(False, sentences.unreachable, say(sentences.unreachable_at, where=where))


def interlock_verdict(
    interlock: Interlock, robot: RobotState, now: float, link: Verdict | None = None
) -> Verdict:
    """Whether an interlock permits: its topic has the type and QoS, a publisher where that is required,
    and a value that is fresh and meets its comparisons. `link` is the link's verdict at `now` if it is
    known already. An interlock of another robot is judged by that robot's link and values."""
    publishing = robot.named(interlock.robot)
    if publishing is None:
        return locked("link_connecting")
    if publishing is not robot:
        return _of_another(publishing, interlock_verdict(interlock, publishing, now))
    link = link or link_verdict(robot, now)
    if not link.permitted:
        return link
    verdict = (
        topic_mismatch("MS", interlock, robot)
        or _publishers_lock(interlock, robot)
        or value_verdict(interlock, robot, now, single_publisher=interlock.publishers == "one")
    )
    if verdict.code in BY_VALUE and not has_key(interlock.field):
        return _with_publishers(verdict, interlock, robot)
    return verdict


def _of_another(robot: RobotState, verdict: Verdict) -> Verdict:
    """The verdict with the name of the robot whose link locks."""
    if verdict.code not in LINK_CODES or verdict.reason is None:
        return verdict
    return replace(verdict, reason=say("ready_robot", name=robot.title, state=verdict.reason))


def state_of(condition: NamedCondition, robot: RobotState, now: float, link: Verdict) -> ConditionState:
    """The state of an interlock or another condition, as a list of conditions shows it. `link` is the
    link's verdict at `now`."""
    state = condition_state(condition, robot, now, link)
    if not isinstance(condition, Interlock):
        return state
    return replace(state, verdict=interlock_verdict(condition, robot, now, link))


def _publishers_lock(interlock: Interlock, robot: RobotState) -> Verdict | None:
    """The lock for a topic with fewer or more publishers than the interlock demands; None if there are
    as many."""
    key = robot.key(interlock.topic)
    if interlock.require_publisher and not robot.graph.has_endpoint("MP", key):
        return locked("interlock_no_publisher", topic=interlock.subject)
    return several_publishers(interlock, robot) if interlock.publishers == "one" else None


def several_publishers(interlock: Interlock, robot: RobotState) -> Verdict | None:
    """The lock for a topic that only one publisher may have; None while there is one at most. Messages
    of several can't be told apart."""
    publishers = robot.topic_publishers.of_topic(robot.key(interlock.topic), robot.graph)
    if publishers.number < SEVERAL:
        return None
    reason = say("interlock_several_publishers", topic=interlock.subject, number=publishers.number)
    text = joined([reason, publishers.sentence(interlock.subject)])
    return Verdict(False, "interlock_several_publishers", text)


def _with_publishers(verdict: Verdict, interlock: Interlock, robot: RobotState) -> Verdict:
    """The same lock with the nodes that publish the topic, where there are several: it may flap."""
    publishers = robot.topic_publishers.of_topic(robot.key(interlock.topic), robot.graph)
    if publishers.number < SEVERAL or verdict.reason is None:
        return verdict
    said = publishers.sentence(interlock.subject)
    return replace(verdict, reason=joined([ended(verdict.reason), said]))


def command_blocked(widget: Command, robot: RobotState, now: float) -> Verdict | None:
    """Why a command may not be sent, beside the link and its interlocks; None where nothing locks
    it."""
    if robot.clock.is_awaited and not is_stop(widget) and any(map(uses_now, widget.templates())):
        return locked("clock_awaited_lock")
    return find_row(COMMAND_CHECKS, widget)(widget, robot, now)


def publish_blocked(command: PublishCommand, robot: RobotState) -> Verdict | None:
    """Why a message may not be published: another type, or the last one's effect is awaited."""
    if mismatch := topic_mismatch("MP", command, robot):
        return mismatch
    if command.one_at_a_time and robot.command_status.get(command.id, IDLE).busy:
        return locked("press_in_progress")
    return None


def blocked_buttons(buttons: tuple[PublishPress, ...], robot: RobotState) -> frozenset[str]:
    """The ids of those of a panel's uniform buttons whose topic can't be used; cached until the graph
    changes."""
    key = blocked_buttons, id(buttons)
    names: frozenset[str] | None = robot.graph.cache.get(key)
    if names is None:
        blocked = (button.id for button in buttons if topic_mismatch("MP", button, robot))
        names = robot.graph.cache[key] = frozenset(blocked)
    return names


def reported_value(step: Step, robot: RobotState, now: float) -> tuple[float | None, Verdict]:
    """The value from which a step is made, None where it is not known now; and why that locks, or until
    when it counts."""
    source, subject = step.value, step.label
    if mismatch := topic_mismatch("MS", source, robot):
        return None, mismatch
    reading = robot.reading(source.topic).of_field(source.field, kept_s(source.max_age_s))
    if reading.status != "message":
        return None, unread(reading, subject, source.type)
    value = reading.value(source.field)
    if value is None and (absence := reading.absence(source.field)) is not None:
        return None, no_value(subject, source.field, absence)
    if value is None:
        return None, locked("interlock_field_missing", field=source.field, topic=subject)
    if not math.isfinite(value):
        return None, locked(
            "interlock_not_a_number", field=source.field, topic=subject, value=not_finite(value)
        )
    if source.max_age_s is None:
        return value, PERMITTED
    until = stale_at(reading.at, source.max_age_s)
    if now >= until:
        return None, stale(subject, source.field, source.max_age_s)
    return value, Verdict(True, until=until)


def step_blocked(step: Step, robot: RobotState, now: float) -> Verdict | None:
    """Why no step may be made: the value is not known, or beyond the limits."""
    if (blocked := publish_blocked(step, robot)) is not None:
        return blocked
    value, verdict = reported_value(step, robot, now)
    if value is not None and not step.min <= value <= step.max:
        low, high = number(number_text(step.min)), number(number_text(step.max))
        return locked("step_value_outside_limits", value=number(f"{value:g}"), low=low, high=high)
    return verdict


def recipe_blocked(load: RecipeLoad, robot: RobotState, now: float) -> Verdict | None:
    """Why no recipe may be loaded: what it is sent by can't be used, or a load is not over."""
    for part in load.parts:
        if (blocked := command_blocked(part, robot, now)) is not None:
            return blocked
    if load.set.node is not None and (mismatch := parameters_offered(load.set.node, robot)):
        return mismatch
    for parameter in load.parameters.values():  # what the node would refuse, or has not reported yet
        if fault := unsettable(parameter, robot.parameters.get(parameter.id, UNKNOWN), robot):
            return fault
    return locked("press_in_progress") if robot.command_status.get(load.id, IDLE).busy else None


# What may lock a command, beside the link and its interlocks: a check for each family of widgets.
COMMAND_CHECKS: Final[Mapping[type[Any], Callable[[Any, RobotState, float], Verdict | None]]] = {
    PublishCommand: lambda command, robot, _: publish_blocked(command, robot),
    Step: step_blocked,
    Switch: lambda switch, robot, now: command_blocked(switch.parts[0], robot, now),
    RecipeLoad: recipe_blocked,
    ServerCommand: call_blocked,
    Parameter: lambda parameter, robot, _: set_blocked(parameter, robot),
}
require_rows("check of its command", COMMAND_CHECKS, Command)

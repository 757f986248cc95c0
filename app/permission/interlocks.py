"""Why a command is locked: the link, its interlocks, its topics and servers. Pure functions from
(robot, time) to a verdict with its reason; `press_permission` calls them in their order.

Unknown means locked: each condition must be known to be met. The first that is not is the reason that
an operator reads.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

from app.dialect.endpoint import TopicRole
from app.i18n import TextLike, joined, number, say
from app.interfaces.names import Qos
from app.panel.base import HasTopic
from app.panel.interlock import Interlock
from app.panel.values import number_text
from app.panel.widgets.families import Command, PublishCommand
from app.panel.widgets.kinds import find_row
from app.panel.widgets.parameter import DESCRIBE, GET, SET, Parameter
from app.panel.widgets.service_action import ServerCommand
from app.panel.widgets.step import Step
from app.permission.conditions import permits, unmet
from app.robot.command_status import IDLE
from app.robot.graph import LiveGraph, cached_until_change
from app.robot.parameter_state import (
    UNKNOWN,
    ParameterState,
    each_text,
    has_allowed_value,
    panel_limits_text,
)
from app.robot.state import Reading, RobotState


@dataclass(frozen=True, slots=True)
class Verdict:
    """`reason` is None when permitted; `code` is its stable name; `until` (monotonic seconds) is
    when time alone would change the verdict. `others` are further verdicts that lock the same."""

    permitted: bool
    code: str = "permitted"
    reason: TextLike | None = None
    until: float = math.inf
    others: tuple["Verdict", ...] = ()

    @property
    def reasons(self) -> list[TextLike]:
        """All reasons of a lock, each sentence once."""
        reasons = (one.reason for one in (self, *self.others))
        return list(dict.fromkeys(reason for reason in reasons if reason))


PERMITTED: Final = Verdict(True)
# The codes of a `link_verdict` that locks.
NO_WAY: Final = frozenset(
    {"no_link", "no_bridge", "no_bridge_of", "bridge_silent", "joining", "catching_up"}
)

MAX_ENDPOINTS: Final = 3

# What comes so soon after joining may be a value of any age, sent again.
HISTORY_S: Final = 1.0

# From a server's token to routes that carry the first call: a call sent in the same millisecond was
# lost 2 times in 30, none after 5 ms, with all on one machine.
SERVER_SETTLE_S: Final = 0.2


def link_verdict(robot: RobotState, now: float) -> Verdict:
    """Whether commands can reach the robot at all."""
    if not robot.link_up:
        return _no_link(robot.endpoints)
    if not robot.graph.bridges:
        return locked("no_bridge_of" if robot.name else "no_bridge", name=robot.title)
    if robot.graph.has_silent_bridge:
        return locked("bridge_silent")
    if now < robot.settled_at:
        return Verdict(False, "joining", say("joining"), robot.settled_at)
    if not robot.is_responding:
        return locked("bridge_silent")
    if not robot.is_caught_up:
        return locked("catching_up")
    return PERMITTED


@lru_cache(maxsize=64)
def _no_link(endpoints: tuple[str, ...]) -> Verdict:
    """The reason names the configured endpoints, if there are any."""
    if not endpoints:
        return locked("no_link")
    named, more = endpoints[:MAX_ENDPOINTS], len(endpoints) - MAX_ENDPOINTS
    where = say("and_more", names=named, number=more) if more > 0 else named
    return Verdict(False, "no_link", say("no_link_at", where=where))


def interlock_verdict(
    interlock: Interlock, robot: RobotState, now: float, link: Verdict | None = None
) -> Verdict:
    """Whether an interlock permits: its topic has the type and QoS, a publisher where that is required,
    and a value that is fresh and meets its conditions. `link` is the link's verdict at `now` if it is
    known already."""
    link = link or link_verdict(robot, now)
    if not link.permitted:
        return link
    topic, key = interlock.topic, robot.key(interlock.topic)
    if doubt := topic_mismatch("MS", interlock, robot):
        return doubt
    if interlock.require_publisher and not robot.graph.has_endpoint("MP", key):
        return locked("no_publisher", topic=topic)
    reading = robot.reading(topic)
    if reading.status != "message":
        return locked(reading.status, topic=topic, wanted=interlock.type)
    if robot.silent_publishers.has_silent(key, robot.graph.bridges):
        return locked("new_publisher", topic=topic)
    if not permits(interlock, reading.value(interlock.field)):
        return _forbidden(interlock, reading)
    if interlock.max_age_s is None:
        return PERMITTED
    if reading.at < _fresh_since(robot, key):
        return locked("waiting", topic=topic)
    stale_at = reading.at + interlock.max_age_s
    if now >= stale_at:
        return locked("stale", topic=topic, limit=number(f"{interlock.max_age_s:g}"))
    return Verdict(True, until=stale_at)


def _fresh_since(robot: RobotState, key: str) -> float:
    """From when on a received message is a new one, not one that was replayed on joining. Where a
    publisher is, or may be, transient local, that is known only some time after its first message."""
    joined = robot.settled_at + HISTORY_S
    return joined if robot.graph.is_volatile(key) else max(joined, robot.replayed.known_since(key))


def _forbidden(interlock: Interlock, reading: Reading) -> Verdict:
    value = reading.value(interlock.field)
    if reading.is_ambiguous(interlock.field):
        return locked("several", field=interlock.field, topic=interlock.topic)
    if value is None:
        return locked("missing", field=interlock.field, topic=interlock.topic)
    if not interlock.conditions:
        return locked("forbidden", name=interlock.name)
    return Verdict(False, "unmet", unmet(interlock, value))


def command_blocked(widget: Command, robot: RobotState, now: float) -> Verdict | None:
    """Why a command may not be sent, beside the link and its interlocks; None where nothing locks
    it."""
    return find_row(COMMAND_CHECKS, widget)(widget, robot, now)


def publish_blocked(of: PublishCommand, robot: RobotState) -> Verdict | None:
    """Why a message may not be published: another type, or the last one's effect is awaited."""
    if doubt := topic_mismatch("MP", of, robot):
        return doubt
    if of.one_at_a_time and robot.command_status.get(of.id, IDLE).busy:
        return locked("busy")
    return None


def reported_value(step: Step, robot: RobotState, now: float) -> tuple[float | None, Verdict]:
    """The value from which a step is made, None where it is not known now; and why that locks, or until
    when it counts."""
    of = step.value
    if doubt := topic_mismatch("MS", of, robot):
        return None, doubt
    reading = robot.reading(of.topic)
    if reading.status != "message":
        return None, locked(reading.status, topic=of.topic, wanted=of.type)
    value = reading.value(of.field)
    if value is None or not math.isfinite(value):
        return None, locked("missing", field=of.field, topic=of.topic)
    stale_at = math.inf if of.max_age_s is None else reading.at + of.max_age_s
    if now >= stale_at:
        return None, locked("stale", topic=of.topic, limit=number(f"{of.max_age_s:g}"))
    return value, PERMITTED if stale_at == math.inf else Verdict(True, until=stale_at)


def step_blocked(step: Step, robot: RobotState, now: float) -> Verdict | None:
    """Why no step may be made: the value is not known, or beyond the limits."""
    if (blocked := publish_blocked(step, robot)) is not None:
        return blocked
    value, verdict = reported_value(step, robot, now)
    if value is not None and not step.min <= value <= step.max:
        low, high = number(number_text(step.min)), number(number_text(step.max))
        return locked("step_outside", value=number(f"{value:g}"), low=low, high=high)
    return verdict


def call_blocked(call: ServerCommand, robot: RobotState, now: float) -> Verdict | None:
    """Why a service may not be called or a goal not be sent: no server has its name and type, or
    a response is awaited."""
    role, name = call.server_role, call.server_name
    key = robot.key(name)
    found = robot.graph.server_type(role, key)
    if found is None:
        return locked("no_service", name=name)
    if found != call.type:
        return locked("wrong_type", topic=name, found=found, wanted=call.type)
    ready_at = robot.graph.served_since(role, key) + SERVER_SETTLE_S
    if now < ready_at:
        return Verdict(False, "getting_ready", say("getting_ready", name=name), ready_at)
    known = robot.command_status.get(call.id, IDLE)
    if not known.busy:
        return None
    return locked("perhaps_busy") if known.outcome == "unknown" else locked("busy")


def set_blocked(parameter: Parameter, robot: RobotState) -> Verdict | None:
    """Why a parameter may not be set: its node is not running or has not reported what may be set, or
    a response is awaited."""
    if doubt := parameters_offered(parameter.node, robot) or unsettable(
        parameter, robot.parameters.get(parameter.id, UNKNOWN)
    ):
        return doubt
    return locked("busy") if robot.command_status.get(parameter.id, IDLE).busy else None


def parameters_offered(node: str, robot: RobotState) -> Verdict | None:
    """Why the parameters of a node can't be read and set, by what the graph shows."""
    for name, wanted in (GET, DESCRIBE, SET):
        found = robot.graph.server_type("SS", robot.key(f"{node}/{name}"))
        if found is None:
            return locked("no_parameters", node=node)
        if found != wanted:
            return locked("wrong_type", topic=f"{node}/{name}", found=found, wanted=wanted)
    return None


def unsettable(parameter: Parameter, known: ParameterState) -> Verdict | None:
    """Why a parameter can't be set, by what its node says of it."""
    code = {
        "waiting": "parameter_waiting",
        "cut": "parameter_waiting",
        "silent": "parameter_silent",
        "undeclared": "parameter_undeclared",
        "mistyped": "parameter_mistyped",
        "unreadable": "parameter_unreadable",
    }.get(known.state)
    node, name = parameter.node, parameter.parameter
    if code == "parameter_silent" and known.wall == 0.0:
        return Verdict(False, code, _silent_parameter(node, name))
    if code is not None:
        return locked(code, node=node, name=name, found=known.robot_type, wanted=parameter.type)
    if known.read_only:
        return locked("parameter_read_only", node=node, name=name)
    if not has_allowed_value(parameter, known):
        theirs = each_text(parameter, known.range)
        return locked(
            "parameter_apart", node=node, name=name, theirs=theirs, ours=panel_limits_text(parameter)
        )
    return None


def _silent_parameter(node: str, name: str) -> TextLike:
    return joined([say("parameter_silent", node=node, name=name), say("cyclone_hint")])


def topic_mismatch(role: TopicRole, of: HasTopic, robot: RobotState) -> Verdict | None:
    """Why a topic can't be used, by the graph: another type, an incompatible QoS, a bridge that does
    not route it. `role` is what the panel does with it: publish ("MP") or subscribe ("MS")."""
    return _misfit(
        robot.graph,
        role,
        robot.key(of.topic),
        of.topic,
        of.type,
        of.qos.wire_qos,
    )


@cached_until_change
def _misfit(
    graph: LiveGraph, role: TopicRole, key: str, topic: str, type_name: str, qos: Qos
) -> Verdict | None:
    if found := graph.mismatched_type(role, key, type_name):
        return locked("wrong_type", topic=topic, found=found, wanted=type_name)
    if code := graph.mismatched_qos(role, key, qos):
        return locked(code, topic=topic)
    return locked("unheard", topic=topic) if role == "MS" and graph.is_unrouted(key) else None


@lru_cache(maxsize=256)
def locked(code: str, **about: TextLike) -> Verdict:
    """The verdict for a sentence; the same one again for the same."""
    return Verdict(False, code, say(code, **about))


# What may lock a command, beside the link and its interlocks: a check for each family of widgets.
COMMAND_CHECKS: Final[Mapping[type[Any], Callable[[Any, RobotState, float], Verdict | None]]] = {
    PublishCommand: lambda of, robot, _: publish_blocked(of, robot),
    Step: step_blocked,
    ServerCommand: call_blocked,
    Parameter: lambda of, robot, _: set_blocked(of, robot),
}

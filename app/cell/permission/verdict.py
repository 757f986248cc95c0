"""A verdict: permitted, or locked with a reason. With the verdicts on a topic or a server that can't be
used. Pure."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

from app.cell.robot.definitions import timeout_hint, uncallable_dds
from app.cell.robot.graph import LiveGraph, cached_until_change
from app.cell.robot.parameter_state import (
    UNKNOWN,
    ParameterState,
    each_text,
    has_allowed_value,
    panel_limits_text,
)
from app.cell.robot.state import RobotState
from app.panel.base import HasTopic
from app.panel.widgets.parameter import GET, SERVICES, Parameter
from app.panel.widgets.service_action import ServerCommand
from app.records.entry import IDLE
from app.ros.dialects.dialect import Role, ServerRole, TopicRole
from app.ros.messages.names import Qos
from app.system.texts import TextLike, ended, hint, joined, say

# What permission is judged to be: permitted, or locked with a reason.


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
        reasons = (verdict.reason for verdict in (self, *self.others))
        return list(dict.fromkeys(reason for reason in reasons if reason))


PERMITTED: Final = Verdict(True)
# Of a stop that a client without control presses: the operator's log says so.
WITHOUT_CONTROL: Final = Verdict(True, "permitted_without_control")
PERMITTED_CODES: Final = frozenset({PERMITTED.code, WITHOUT_CONTROL.code})


@lru_cache(maxsize=256)
def locked(code: str, **about: TextLike) -> Verdict:
    """The verdict for a sentence; the same one again for the same."""
    return Verdict(False, code, say(code, **about))


@lru_cache(maxsize=256)
def with_advice(verdict: Verdict, advice: TextLike) -> Verdict:
    """A lock whose reason begins with what to do, as its end may be cut; the same one again for the
    same."""
    if verdict.permitted:
        return verdict
    return replace(verdict, reason=joined((ended(advice), verdict.reason or "")))


# Why a topic can't be used, by what the graph shows of it. Pure.

_COUNTERPART: Final[Mapping[TopicRole, TopicRole]] = {"MS": "MP", "MP": "MS"}


def topic_mismatch(role: TopicRole, source: HasTopic, robot: RobotState) -> Verdict | None:
    """Why a topic can't be used, by the graph: another type, an incompatible QoS, a peer that does
    not forward it, another definition. `role` is what the panel does with it: publish ("MP") or
    subscribe ("MS")."""
    key = robot.key(source.topic)
    qos = source.qos.wire_qos if robot.traits.has_dds_qos else None
    if qos is not None and role == "MS" and robot.adapts_reliability(key):
        qos = qos._replace(reliable=False)
    unrouted = robot.traits.sentences.unrouted
    mismatch = _type_mismatch(robot.graph, role, key, source.topic, source.type, qos, unrouted)
    return mismatch or definition_mismatch(_COUNTERPART[role], source.topic, robot)


def definition_mismatch(role: Role, name: str, robot: RobotState) -> Verdict | None:
    """Why what is sent and received would be misread: the robot's definition of its type is not the
    panel's. `role` is the robot's."""
    differing = robot.difference(role, robot.key(name))
    return locked("topic_definition_differs", name=name, type=differing.type) if differing else None


@cached_until_change
def _type_mismatch(
    graph: LiveGraph,
    role: TopicRole,
    key: str,
    topic: str,
    type_name: str,
    qos: Qos | None,
    unrouted: str,
) -> Verdict | None:
    """`qos` is None where each fits. `unrouted` is the code of the lock for a topic that the peer does
    not forward."""
    if robot_type := graph.mismatched_type(role, key, type_name):
        return locked("topic_wrong_type", topic=topic, found=robot_type, wanted=type_name)
    if qos is not None and (code := graph.mismatched_qos(role, key, qos)):
        return locked(code, topic=topic)
    return locked(unrouted, topic=topic) if role == "MS" and graph.is_unrouted(key) else None


# Why a service, an action or a parameter can't be used: its server, its node, a response that is
# awaited. Pure.


def call_blocked(call: ServerCommand, robot: RobotState, now: float) -> Verdict | None:
    """Why a service may not be called or a goal not be sent: no server has its name and type, or
    a response is awaited."""
    role, name = call.server_role, call.server_name
    if mismatch := server_offered(role, name, call.type, robot):
        return mismatch
    ready_at = robot.graph.since(role, robot.key(name)) + robot.traits.server_settle_s
    if now < ready_at:
        return Verdict(False, "service_connecting", say("service_connecting", name=name), ready_at)
    known = robot.command_status.get(call.id, IDLE)
    if not known.busy:
        return None
    return locked("goal_may_be_running") if known.outcome == "unknown" else locked("press_in_progress")


def server_offered(role: ServerRole, name: str, type_name: str, robot: RobotState) -> Verdict | None:
    """Why a service or an action can't be used, by what the graph shows."""
    robot_type = robot.graph.server_type(role, robot.key(name))
    if robot_type is None:
        return locked("service_unavailable", name=name)
    if robot_type != type_name:
        return locked("topic_wrong_type", topic=name, found=robot_type, wanted=type_name)
    return _unfit(role, name, robot)


def _unfit(role: ServerRole, name: str, robot: RobotState) -> Verdict | None:
    """Why a server of the right type can't be called: it is on a DDS that its peer does not call, its
    definition is another one, or neither is known yet."""
    graph, key = robot.graph, robot.key(name)
    if robot.nodes_are_read and graph.since(role, key) > graph.nodes_read_at:
        return locked("service_connecting", name=name)
    if vendor := uncallable_dds(graph, role, key):
        return locked(robot.traits.sentences.uncallable, name=name, vendor=vendor)
    return definition_mismatch(role, name, robot)


def set_blocked(parameter: Parameter, robot: RobotState) -> Verdict | None:
    """Why a parameter may not be set: its node is not running or has not reported what may be set, or
    a response is awaited."""
    known = robot.parameters.get(parameter.id, UNKNOWN)
    if mismatch := parameters_offered(parameter.node, robot) or unsettable(parameter, known, robot):
        return mismatch
    return locked("press_in_progress") if robot.command_status.get(parameter.id, IDLE).busy else None


def parameters_offered(node: str, robot: RobotState) -> Verdict | None:
    """Why the parameters of a node can't be read and set, by what the graph shows."""
    for name, wanted in SERVICES:
        robot_type = robot.graph.server_type("SS", robot.key(f"{node}/{name}"))
        if robot_type is None:
            return locked("parameter_node_unavailable", node=node)
        if robot_type != wanted:
            return locked("topic_wrong_type", topic=f"{node}/{name}", found=robot_type, wanted=wanted)
        if mismatch := _unfit("SS", f"{node}/{name}", robot):
            return mismatch
    return None


def unsettable(parameter: Parameter, known: ParameterState, robot: RobotState) -> Verdict | None:
    """Why a parameter can't be set, by what its node says of it."""
    code = {
        "waiting": "parameter_waiting",
        "cut": "parameter_waiting",
        "silent": "parameter_no_reply",
        "undeclared": "parameter_undeclared",
        "mistyped": "parameter_mistyped",
        "unreadable": "parameter_unreadable",
    }.get(known.state)
    node, name = parameter.node, parameter.parameter
    if code == "parameter_no_reply" and known.wall == 0.0:
        return Verdict(False, code, _silent_parameter(node, name, robot))
    if code is not None:
        return locked(code, node=node, name=name, found=known.robot_type, wanted=parameter.type)
    if known.read_only:
        return locked("parameter_read_only", node=node, name=name)
    if not has_allowed_value(parameter, known):
        theirs = each_text(parameter, known.range)
        return locked(
            "parameter_no_common_value",
            node=node,
            name=name,
            theirs=theirs,
            ours=panel_limits_text(parameter),
        )
    return None


def _silent_parameter(node: str, name: str, robot: RobotState) -> TextLike:
    key = robot.key(f"{node}/{GET[0]}")
    code = timeout_hint(robot.graph, "SS", key, robot.traits.sentences.timeout_hint)
    return joined([say("parameter_no_reply", node=node, name=name), hint(code)])

"""Why a service, an action or a parameter can't be used: its server, its node, a response that is
awaited. Pure."""

from app.dialect.endpoint import ServerRole
from app.i18n import TextLike, hint, joined, say
from app.panel.widgets.parameter import DESCRIBE, GET, SET, Parameter
from app.panel.widgets.service_action import ServerCommand
from app.permission.mismatches import definition_mismatch
from app.permission.verdict import Verdict, locked
from app.robot.command_status import IDLE
from app.robot.definitions import uncallable_dds
from app.robot.parameter_state import (
    UNKNOWN,
    ParameterState,
    each_text,
    has_allowed_value,
    panel_limits_text,
)
from app.robot.state import RobotState


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
    if mismatch := parameters_offered(parameter.node, robot) or unsettable(
        parameter, known, robot.traits.sentences.timeout_hint
    ):
        return mismatch
    return locked("press_in_progress") if robot.command_status.get(parameter.id, IDLE).busy else None


def parameters_offered(node: str, robot: RobotState) -> Verdict | None:
    """Why the parameters of a node can't be read and set, by what the graph shows."""
    for name, wanted in (GET, DESCRIBE, SET):
        robot_type = robot.graph.server_type("SS", robot.key(f"{node}/{name}"))
        if robot_type is None:
            return locked("parameter_node_unavailable", node=node)
        if robot_type != wanted:
            return locked("topic_wrong_type", topic=f"{node}/{name}", found=robot_type, wanted=wanted)
        if mismatch := _unfit("SS", f"{node}/{name}", robot):
            return mismatch
    return None


def unsettable(parameter: Parameter, known: ParameterState, timeout_hint: str) -> Verdict | None:
    """Why a parameter can't be set, by what its node says of it; `timeout_hint` as in
    `PeerSentences`."""
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
        return Verdict(False, code, _silent_parameter(node, name, timeout_hint))
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


def _silent_parameter(node: str, name: str, timeout_hint: str) -> TextLike:
    return joined([say("parameter_no_reply", node=node, name=name), hint(timeout_hint)])

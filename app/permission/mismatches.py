"""Why a topic can't be used, by what the graph shows of it. Pure."""

from collections.abc import Mapping
from typing import Final

from app.dialect.endpoint import Role, TopicRole
from app.interfaces.names import Qos
from app.panel.base import HasTopic
from app.permission.verdict import Verdict, locked
from app.robot.graph import LiveGraph, cached_until_change
from app.robot.state import RobotState

_COUNTERPART: Final[Mapping[TopicRole, TopicRole]] = {"MS": "MP", "MP": "MS"}


def topic_mismatch(role: TopicRole, of: HasTopic, robot: RobotState) -> Verdict | None:
    """Why a topic can't be used, by the graph: another type, an incompatible QoS, a peer that does
    not forward it, another definition. `role` is what the panel does with it: publish ("MP") or
    subscribe ("MS")."""
    key, qos = robot.key(of.topic), of.qos.wire_qos
    if role == "MS" and robot.adapts_reliability(key):
        qos = qos._replace(reliable=False)
    unrouted = robot.traits.sentences.unrouted
    return _misfit(robot.graph, role, key, of.topic, of.type, qos, unrouted) or definition_mismatch(
        _COUNTERPART[role], of.topic, robot
    )


def definition_mismatch(role: Role, name: str, robot: RobotState) -> Verdict | None:
    """Why what is sent and received would be misread: the robot's definition of its type is not the
    panel's. `role` is the robot's."""
    found = robot.difference(role, robot.key(name))
    return locked("topic_definition_differs", name=name, type=found.type) if found else None


@cached_until_change
def _misfit(
    graph: LiveGraph, role: TopicRole, key: str, topic: str, type_name: str, qos: Qos, unrouted: str
) -> Verdict | None:
    """`unrouted` is the code of the lock for a topic that the peer does not forward."""
    if found := graph.mismatched_type(role, key, type_name):
        return locked("topic_wrong_type", topic=topic, found=found, wanted=type_name)
    if code := graph.mismatched_qos(role, key, qos):
        return locked(code, topic=topic)
    return locked(unrouted, topic=topic) if role == "MS" and graph.is_unrouted(key) else None

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


def topic_mismatch(role: TopicRole, source: HasTopic, robot: RobotState) -> Verdict | None:
    """Why a topic can't be used, by the graph: another type, an incompatible QoS, a peer that does
    not forward it, another definition. `role` is what the panel does with it: publish ("MP") or
    subscribe ("MS")."""
    key, qos = robot.key(source.topic), source.qos.wire_qos
    if role == "MS" and robot.adapts_reliability(key):
        qos = qos._replace(reliable=False)
    unrouted = robot.traits.sentences.unrouted
    misfit = _misfit(robot.graph, role, key, source.topic, source.type, qos, unrouted)
    return misfit or definition_mismatch(_COUNTERPART[role], source.topic, robot)


def definition_mismatch(role: Role, name: str, robot: RobotState) -> Verdict | None:
    """Why what is sent and received would be misread: the robot's definition of its type is not the
    panel's. `role` is the robot's."""
    differing = robot.difference(role, robot.key(name))
    return locked("topic_definition_differs", name=name, type=differing.type) if differing else None


@cached_until_change
def _misfit(
    graph: LiveGraph, role: TopicRole, key: str, topic: str, type_name: str, qos: Qos, unrouted: str
) -> Verdict | None:
    """`unrouted` is the code of the lock for a topic that the peer does not forward."""
    if robot_type := graph.mismatched_type(role, key, type_name):
        return locked("topic_wrong_type", topic=topic, found=robot_type, wanted=type_name)
    if code := graph.mismatched_qos(role, key, qos):
        return locked(code, topic=topic)
    return locked(unrouted, topic=topic) if role == "MS" and graph.is_unrouted(key) else None

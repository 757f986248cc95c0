"""What a scaffold is made of: a robot's topics, services, actions, parameters, samples: read once."""

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from app.cli.robot.topic_reader import endpoint_for
from app.errors import DecodeError
from app.graph.model import RobotGraph, RosGraph, Server, Topic
from app.graph.node_services import NodeParameter, NodeServices
from app.interfaces import Interfaces
from app.scaffold.displays import JOINTS
from app.scaffold.draft import Known, shown
from app.scaffold.fields import shown_fields
from app.transport.bridge_observer import BridgeObserver


def robot_at(graph: RosGraph, namespace: str) -> tuple[RobotGraph, str]:
    """The robot that the pages are made of, and the part of a namespace that is below its bridge's."""
    for robot in sorted(graph.robots, key=lambda one: -len(one.namespace)):
        if f"{namespace}/".startswith(f"{robot.namespace}/") and (namespace or not robot.namespace):
            return robot, namespace.removeprefix(robot.namespace)
    return max(graph.robots, key=lambda one: len(one.topics)), ""


async def survey(
    observer: BridgeObserver, robot: RobotGraph, below: str, interfaces: Interfaces, listen_s: float
) -> Known:
    """What is on the robot, with names below the panel's namespace."""
    parameters, unreadable = await _parameters(NodeServices(robot, interfaces, observer), robot, below)
    topics = [_topic(one, below) for one in robot.topics if _is_below(one.name, below)]
    return Known(
        topics=topics,
        services=[_server(one, below) for one in robot.services if _is_below(one.name, below)],
        actions=[_server(one, below) for one in robot.actions if _is_below(one.name, below)],
        parameters=parameters,
        samples=await _samples(observer, topics, interfaces, listen_s),
        unreadable=unreadable,
    )


async def _parameters(
    services: NodeServices, robot: RobotGraph, below: str
) -> tuple[list[NodeParameter], list[str]]:
    """Those of all nodes but the bridge's own, and the nodes that have some which can't be read."""
    found: list[NodeParameter] = []
    unreadable: list[str] = []
    bridges = {bridge.node for bridge in robot.bridges}
    for node in robot.nodes:
        if not _is_below(node.name, below) or node.name in bridges:
            continue
        of_node = await services.parameters(node)
        if of_node is not None:
            found += [replace(one, node=one.node.removeprefix(below)) for one in of_node]
        elif robot.service(f"{node.name}/list_parameters") is not None:
            unreadable.append(node.name.removeprefix(below))
    return found, unreadable


def _is_below(name: str, namespace: str) -> bool:
    return name.startswith(f"{namespace}/")


def _topic(one: Topic, below: str) -> Topic:
    return replace(one, name=one.name.removeprefix(below))


def _server(one: Server, below: str) -> Server:
    return replace(one, name=one.name.removeprefix(below))


def _has_use(topic: Topic, interfaces: Interfaces) -> bool:
    """Whether a message of it has names or values that the panel is made with."""
    return topic.type == JOINTS or any(shown_fields(topic.type, interfaces))


async def _samples(
    observer: BridgeObserver, topics: Sequence[Topic], interfaces: Interfaces, listen_s: float
) -> dict[str, Any]:
    """A message of each topic that has a use, by the topic's name: until all arrived or time is up."""
    wanted = {
        one.key: one
        for one in shown(topics)
        if one.publishers and one.type in interfaces.structures and _has_use(one, interfaces)
    }
    found: dict[str, Any] = {}
    if not wanted:
        return found
    own = [endpoint_for(topic, topic.type) for topic in wanted.values()]
    with suppress(TimeoutError):
        async with asyncio.timeout(listen_s):
            async for key, sample in observer.listen(own):
                topic = wanted[key]
                with suppress(DecodeError):  # of another definition than the one known here
                    found[topic.name] = interfaces.decode(topic.type, bytes(sample.payload))
                if len(found) == len(wanted):
                    break
    return found

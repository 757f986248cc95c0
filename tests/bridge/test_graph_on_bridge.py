"""The ROS graph, read through the real bridge without a server."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest

from app.errors import LinkError
from app.graph.model import RosGraph
from app.transport.bridge_observer import observing
from app.transport.zenoh_config import config_to
from tests.support import cyclone
from tests.support.cyclone import NODE, CycloneRobot
from tests.support.parts import Bridge, RosNode, free_port, live, until

cyclone_bridge = cyclone.cyclone_bridge
client = cyclone.client
robots = cyclone.robots
robot = cyclone.robot

BOOL = "std_msgs/msg/Bool"


def graph_at(endpoint: str) -> RosGraph:
    async def read() -> RosGraph:
        async with observing(config_to(endpoint)) as observer:
            return await observer.graph()

    return asyncio.run(read())


def until_graph(endpoint: str, holds: Callable[[RosGraph], bool], why: str) -> RosGraph:
    found: list[RosGraph] = []

    def there() -> bool:
        found.append(graph_at(endpoint))
        return holds(found[-1])

    until(there, why, every_s=0.1)
    return found[-1]


def test_topics_have_the_qos_and_the_node_of_each_endpoint(
    own_bridge: Bridge, own_node: RosNode
) -> None:
    own_node.advertise("/arm/enabled", BOOL, durability="transient_local", depth=1)
    own_node.advertise("/picture", "std_msgs/msg/String", reliability="best_effort")
    own_node.subscribe("/command", "std_msgs/msg/String", reliability="best_effort")
    names = {"/arm/enabled", "/picture", "/command"}
    graph = until_graph(
        own_bridge.endpoint,
        lambda graph: names <= {t.name for r in graph.robots for t in r.topics if t.announced},
        "the bridge has found the topics",
    )
    (found,) = graph.robots
    (bridge,) = found.bridges
    assert (bridge.version, bridge.domain, bridge.namespace) == ("v1.10.2", own_bridge.domain, "")
    enabled, picture, command = (found.topic(n) for n in ("/arm/enabled", "/picture", "/command"))
    assert enabled is not None
    assert picture is not None
    assert command is not None
    (publisher,) = enabled.publishers
    assert (publisher.nodes, publisher.dds) == (("/system_controller",), "Fast DDS")
    assert publisher.type_hash.startswith("RIHS01_feb91e99")
    assert (enabled.type, enabled.latched, enabled.reliable) == (BOOL, True, True)
    assert (picture.latched, picture.reliable) == (False, False)
    assert (command.publishers, command.subscribers[0].qos.reliable) == ((), False)
    services = {s.name: s for s in found.services}
    assert not services["/system_controller/get_parameters"].can_be_called  # on Fast DDS


def test_services_and_actions_have_their_types_and_nodes(
    robot: CycloneRobot, cyclone_bridge: Bridge
) -> None:
    graph = until_graph(
        cyclone_bridge.endpoint,
        lambda graph: any(s.nodes for r in graph.robots for s in (*r.services, *r.actions)),
        "the bridge has found the node",
    )
    (found,) = graph.robots
    reset, fibonacci = found.service("/reset"), found.action("/fibonacci")
    assert reset is not None
    assert fibonacci is not None
    assert (reset.type, reset.nodes) == ("std_srvs/srv/Trigger", (f"/{NODE}",))
    assert (reset.dds, reset.can_be_called) == ("Cyclone DDS", True)
    assert fibonacci.type == "example_interfaces/action/Fibonacci"
    assert found.topic("/fibonacci/_action/status") is None
    node = found.node(f"/{NODE}")
    assert node
    assert "/reset" in node.services
    assert any(peer.key == "parameter_events" for peer in graph.peers)  # the client of this test


def test_a_bridge_with_a_namespace_is_a_robot_of_that_namespace(domain: int) -> None:
    bridge = Bridge(domain + 1, "/robot1")
    bridge.start()
    node = RosNode(bridge.domain)
    try:
        node.advertise("/speed", "std_msgs/msg/Float64")
        graph = until_graph(
            bridge.endpoint,
            lambda graph: any(r.topic("/speed") for r in graph.robots),
            "the bridge has found the topic",
        )
    finally:
        node.end()
        bridge.end()
    found = graph.robot("/robot1")
    assert found
    speed = found.topic("/speed")
    assert speed
    assert (speed.key, found.key("/speed")) == ("robot1/speed", "robot1/speed")


def test_nothing_there_is_an_error_that_says_where() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"

    async def read() -> None:
        async with observing(config_to(endpoint), within_s=0.3):
            pass

    with pytest.raises(
        LinkError, match=f"no Zenoh router or bridge answers at {endpoint} within 0.3 s"
    ):
        asyncio.run(read())


def test_the_routes_tell_which_panels_use_them(
    bridge: Bridge, node: RosNode, tmp_path: Path, servers: Callable[..., object]
) -> None:
    servers(live(bridge.endpoint, tmp_path))
    graph = until_graph(
        bridge.endpoint,
        lambda graph: any(r.key == "operation" and r.remote for g in graph.robots for r in g.routes),
        "the panel's routes",
    )
    (found,) = graph.robots
    (route,) = [r for r in found.routes if r.key == "operation" and r.remote]
    assert (route.kind, route.direction, route.local_nodes) == ("topic", "sub", ("/system_controller",))
    assert route.endpoint

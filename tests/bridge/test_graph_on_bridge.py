"""The ROS graph, read through the real bridge without a server."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from app.cell.link.bridge import BRIDGE
from app.cell.link.observer import CONNECT_S, RobotObserver
from app.ros.dialects.dialect import PanelEndpoint
from app.ros.graph.model import GraphSnapshot, Node
from app.ros.graph.node_services import NodeParameter, NodeServices
from app.ros.messages import Interfaces, load_interfaces
from app.ros.messages.definitions import Definitions
from app.ros.messages.derived import _describe_structure, referenced_structures, type_hash
from app.ros.messages.names import Qos
from app.ros.messages.parsing import parse_definition
from app.ros.messages.type_descriptions import SERVICE_TYPE_NAME, definitions_of
from app.ros.zenoh.config import Config, config_to
from app.system.errors import LinkError
from app.tools.cli.interfaces import main as add_interfaces
from tests.support.cyclone import NODE, CycloneRobot
from tests.support.parts import ENOUGH_S, Bridge, RosNode, free_port, live, until

GRIPPER = "gripper_msgs/msg/Gripper"
INTERFACES = load_interfaces("kilted")
BOOL = "std_msgs/msg/Bool"


@asynccontextmanager
async def observing(config: Config, within_s: float = CONNECT_S) -> AsyncIterator[RobotObserver]:
    """A connected observer, closed at the end."""
    observer = RobotObserver(config, BRIDGE)
    try:
        await observer.connect(within_s)
        yield observer
    finally:
        await observer.close()


def graph_at(endpoint: str) -> GraphSnapshot:
    async def read() -> GraphSnapshot:
        async with observing(config_to(endpoint)) as observer:
            return await observer.observe()

    return asyncio.run(read())


def until_graph(
    endpoint: str, holds: Callable[[GraphSnapshot], bool], why: str, within_s: float = ENOUGH_S
) -> GraphSnapshot:
    graphs: list[GraphSnapshot] = []

    def there() -> bool:
        graphs.append(graph_at(endpoint))
        return holds(graphs[-1])

    try:
        until(there, why, within_s, every_s=0.1)
    except AssertionError as error:
        raise AssertionError(f"{error}: {graphs[-1]}") from None
    return graphs[-1]


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
    (robot_graph,) = graph.robots
    (bridge,) = robot_graph.bridges
    assert (bridge.version, bridge.domain, bridge.namespace) == ("v1.10.2", own_bridge.domain, "")
    enabled, picture, command = (robot_graph.topic(n) for n in ("/arm/enabled", "/picture", "/command"))
    assert enabled is not None
    assert picture is not None
    assert command is not None
    (publisher,) = enabled.publishers
    assert (publisher.nodes, publisher.dds) == (("/system_controller",), "Fast DDS")
    assert publisher.type_hash.startswith("RIHS01_feb91e99")
    assert (enabled.type, enabled.latched, enabled.reliable) == (BOOL, True, True)
    assert (picture.latched, picture.reliable) == (False, False)
    assert (command.publishers, command.subscribers[0].qos.reliable) == ((), False)
    services = {s.name: s for s in robot_graph.services}
    assert not services["/system_controller/get_parameters"].can_be_called  # on Fast DDS


def test_services_and_actions_have_their_types_and_nodes(
    robot: CycloneRobot, cyclone_bridge: Bridge
) -> None:
    graph = until_graph(
        cyclone_bridge.endpoint,
        lambda graph: any(s.nodes for r in graph.robots for s in (*r.services, *r.actions)),
        "the bridge has found the node",
    )
    (robot_graph,) = graph.robots
    reset, fibonacci = robot_graph.service("/reset"), robot_graph.action("/fibonacci")
    assert reset is not None
    assert fibonacci is not None
    assert (reset.type, reset.nodes) == ("std_srvs/srv/Trigger", (f"/{NODE}",))
    assert (reset.dds, reset.can_be_called) == ("Cyclone DDS", True)
    assert fibonacci.type == "example_interfaces/action/Fibonacci"
    assert robot_graph.topic("/fibonacci/_action/status") is None
    node = robot_graph.node(f"/{NODE}")
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
    robot_graph = graph.robot("/robot1")
    assert robot_graph
    speed = robot_graph.topic("/speed")
    assert speed
    assert (speed.key, robot_graph.key("/speed")) == ("robot1/speed", "robot1/speed")


def on_fast_dds(bridge: Bridge) -> tuple[RosNode, GraphSnapshot]:
    """A node on Fast DDS whose name the bridge knows. On a busy machine Cyclone DDS may get a type of
    Fast DDS out of order ("invalid type object"), and the name of that node never arrives: it starts
    again."""
    for _ in range(5):
        node = RosNode(bridge.domain, "on_fast_dds")
        with suppress(AssertionError):
            return node, until_graph(
                bridge.endpoint,
                lambda graph: any(
                    robot.node("/on_fast_dds") and robot.service(f"/{NODE}/get_parameters")
                    for robot in graph.robots
                ),
                "the bridge knows the node",
                within_s=10,
            )
        node.end()
    raise AssertionError("the bridge knows the name of none of five nodes")


def test_parameters_are_those_of_nodes_that_can_be_asked(
    robot: CycloneRobot, cyclone_bridge: Bridge
) -> None:
    ros, graph = on_fast_dds(cyclone_bridge)
    try:
        (robot_graph,) = graph.robots

        async def ask(name: str) -> tuple[NodeParameter, ...] | None:
            async with observing(config_to(cyclone_bridge.endpoint)) as observer:
                services = NodeServices(robot_graph, INTERFACES, observer)
                return await services.parameters(Node(name=name, bridge=""))

        assert asyncio.run(ask("/on_fast_dds")) is None  # it would misread the request
        declared = asyncio.run(ask(f"/{NODE}"))
    finally:
        ros.end()
    assert declared is not None
    parameters = {parameter.name: parameter for parameter in declared}
    speed, serial = parameters["speed"], parameters["serial"]
    assert (speed.type, speed.value, speed.min, speed.max) == ("double", 0.5, 0.0, 2.0)
    assert speed.step == 0.1
    assert (serial.type, serial.value, serial.read_only) == ("string", "CR-0001", True)


def described(definitions: Definitions, name: str) -> list[dict[str, Any]]:
    """The plain description of a type, as REP 2016 has it, with what it refers to."""
    structure = definitions.structures[name]
    inner = referenced_structures(structure, definitions.structures.__getitem__)
    return [_describe_structure(described) for described in (structure, *inner.values())]


def test_a_node_describes_a_type_that_no_other_knows(
    robot: CycloneRobot, cyclone_bridge: Bridge, tmp_path: Path
) -> None:
    text = {"Gripper": "float64 width\nJaw[] jaws", "Jaw": "string name\nfloat32 force"}
    whole = Definitions()
    for name, lines in text.items():
        whole |= parse_definition(lines, "gripper_msgs", "msg", name, Path("x.msg"))
    hash_ = type_hash(whole.structures[GRIPPER], whole.structures.__getitem__)
    robot.describe_gripper(types=described(whole, GRIPPER), hash=hash_)
    until(lambda: not robot.unmatched(), "the bridge found the service")
    graph = until_graph(
        cyclone_bridge.endpoint,
        lambda graph: any(
            r.topic("/gripper") and r.service(f"/{NODE}/get_type_description") for r in graph.robots
        ),
        "the bridge has found the topic",
    )
    (robot_graph,) = graph.robots
    gripper = robot_graph.topic("/gripper")
    assert gripper is not None

    async def ask() -> Definitions | None:
        async with observing(config_to(cyclone_bridge.endpoint)) as observer:
            return await NodeServices(robot_graph, INTERFACES, observer).definitions(gripper)

    definitions = asyncio.run(ask())
    assert definitions is not None
    assert definitions.structures == whole.structures
    interfaces = Interfaces(described=definitions)
    assert interfaces.type_hash(GRIPPER) == hash_
    assert interfaces.field_type(GRIPPER, "jaws[0].force") == "float32"
    where = ["--connect", cyclone_bridge.endpoint, "--to", str(tmp_path)]
    assert add_interfaces(["add", "gripper_msgs", "--from", "robot", *where]) == 0
    assert load_interfaces("jazzy", [tmp_path]).type_hash(GRIPPER) == hash_


@pytest.mark.parametrize(
    "name",
    [
        "std_msgs/msg/Bool",
        "sensor_msgs/msg/JointState",
        "diagnostic_msgs/msg/DiagnosticArray",
        "rcl_interfaces/msg/Log",
    ],
)
def test_an_rclpy_node_describes_its_types_as_they_are_known(node: RosNode, name: str) -> None:
    """The service itself: through the bridge a node on Fast DDS can't be asked."""
    node.subscribe(f"/described/{name.rpartition('/')[2].lower()}", name)
    answer = INTERFACES.decode_whole(
        f"{SERVICE_TYPE_NAME}_Response", bytes.fromhex(node.describe(name, INTERFACES.type_hash(name)))
    )
    assert (answer.successful, answer.failure_reason) == (True, "")
    definitions = definitions_of(answer.type_description, INTERFACES.type_hash(name))
    assert definitions.structures.keys() >= {name}
    for each, structure in definitions.structures.items():
        known = INTERFACES.structures[each].fields
        assert [(f.name, f.type) for f in structure.fields] == [(f.name, f.type) for f in known]


@pytest.mark.parametrize("hold", [True, False])
def test_listener_keeps_a_route_only_if_requested(
    own_bridge: Bridge, own_node: RosNode, hold: bool
) -> None:
    own_node.advertise("/heard", BOOL, durability="transient_local", depth=1)
    own_node.publish("/heard", {"data": True})
    graph = until_graph(
        own_bridge.endpoint,
        lambda graph: any(r.topic("/heard") for r in graph.robots),
        "the bridge has found the topic",
    )
    topic = graph.robots[0].topic("/heard")
    assert topic is not None

    async def listen() -> tuple[bytes, tuple[str, ...]]:
        async with observing(config_to(own_bridge.endpoint)) as observer:
            own = PanelEndpoint("MS", topic.key, BOOL, Qos(transient_local=True))
            async for _, sample in observer.listen([own], hold=hold):
                async with observing(config_to(own_bridge.endpoint)) as other:
                    (robot_graph,) = (await other.observe()).robots
                used = [r for r in robot_graph.routes if r.key == "heard" and r.direction == "pub"]
                return bytes(sample.payload), used[0].remote
        raise AssertionError("it ended")

    payload, remote = asyncio.run(listen())
    assert payload[4:5] == b"\1"
    assert bool(remote) is hold


def test_missing_bridge_is_an_error_with_the_endpoint() -> None:
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

    def has_route(graph: GraphSnapshot) -> bool:
        """The bridge learns later which node a subscription belongs to."""
        routes = (route for robot in graph.robots for route in robot.routes)
        return any(r.key == "operation" and r.remote and r.local_nodes for r in routes)

    graph = until_graph(bridge.endpoint, has_route, "the panel's routes")
    (robot_graph,) = graph.robots
    (route,) = [r for r in robot_graph.routes if r.key == "operation" and r.remote]
    assert (route.kind, route.direction, route.local_nodes) == ("topic", "sub", ("/system_controller",))
    assert route.endpoint

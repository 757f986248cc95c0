"""The ROS graph from a bridge's answers, as the real bridge gives them."""

import json
from typing import Any

import pytest

from app.ros.dialects.bridge_entities import entity_of
from app.ros.graph.bridge_graph import GraphAnswers, ros_graph
from app.ros.graph.model import EndpointQos, PeerEndpoint, RobotGraph

FAST, CYCLONE = "010f78fdb176d54800000000000001c1", "01103b80c068b0dad3529cde000001c1"
BOOL = "std_msgs::msg::dds_::Bool_"


def entity(
    zid: str, participant: str, role: str, name: str, type_name: str = BOOL, **qos: Any
) -> tuple[str, Any]:
    answer = {"topic_name": f"rt{name}", "type_name": type_name, "qos": qos}
    return f"@/{zid}/ros2/dds/{participant}/{role}/{participant[:30]}03/rt{name}", answer


def node(zid: str, participant: str, name: str, **lists: list[str]) -> tuple[str, Any]:
    answer = {
        part: [{"name": name, "type": "x/msg/Y"} for name in names] for part, names in lists.items()
    }
    return f"@/{zid}/ros2/node/{participant}{name}", answer


def token(zid: str, role: str, key: str, type_name: str, qos: str = ":1:::") -> str:
    end = f"/{qos}" if role in ("MP", "MS") else ""
    return f"@/{zid}/@ros2_lv/{role}/{key}/{type_name}{end}".replace(
        f"{key}/{type_name}", f"{key.replace('/', '§')}/{type_name.replace('/', '§')}"
    )


def read(**more: Any) -> RobotGraph:
    (robot,) = ros_graph(GraphAnswers(**more)).robots
    return robot


@pytest.mark.parametrize(
    ("key", "answer"),
    [
        (f"@/a/ros2/dds/{FAST}", {"key": FAST}),  # a participant
        (f"@/a/ros2/dds/{FAST}/writer/x/rt/on", None),
        (f"@/a/ros2/dds/{FAST}/writer/x/rt/on", {"topic_name": 1}),
        (f"@/a/ros2/dds/{FAST}/writer/x/rt/on", {"topic_name": "rt/on", "type_name": "Bool"}),
        (f"@/a/ros2/dds/{FAST}/writer/x/rr/on", {"topic_name": "rr/on", "type_name": BOOL}),
        (f"@/a/ros2/dds/{FAST}/writer/x/rt/o n", {"topic_name": "rt/o n", "type_name": BOOL}),
    ],
)
def test_topic_that_is_not_of_ros_is_left_out(key: str, answer: Any) -> None:
    assert entity_of(key, answer) is None
    assert (
        ros_graph(GraphAnswers(versions={"a": "v1"}, entities=[(key, answer)])).robots[0].topics == ()
    )


def test_a_topic_with_its_endpoints_and_their_nodes() -> None:
    robot = read(
        versions={"a": "v1.10.2"},
        configs={"a": {"namespace": "/robot1", "domain": 7, "nodename": "web_ui"}},
        tokens=[token("a", "MP", "robot1/on", "std_msgs/msg/Bool")],
        entities=[
            entity("a", FAST, "writer", "/on", durability={"kind": "TRANSIENT_LOCAL"}),
            entity("a", CYCLONE, "reader", "/on"),
            entity("a", CYCLONE, "writer", "/walk/_action/status"),
            entity("a", CYCLONE, "writer", "/secret"),
        ],
        nodes=[
            node("a", FAST, "/io", publishers=["/on"]),
            node("a", FAST, "/other", publishers=["/off"]),
            node("a", CYCLONE, "/arm/driver", subscribers=["/on"]),
        ],
    )
    assert (robot.namespace, robot.bridges[0].domain, robot.bridges[0].node) == (
        "/robot1",
        7,
        "/web_ui",
    )
    assert [topic.name for topic in robot.topics] == ["/on", "/secret"]
    on, secret = robot.topics
    assert (on.key, on.type, on.latched, on.announced) == ("robot1/on", "std_msgs/msg/Bool", True, True)
    assert not secret.announced  # the bridge's configuration holds it back
    assert [(e.nodes, e.dds) for e in on.publishers] == [(("/io",), "Fast DDS")]
    assert [(e.nodes, e.dds) for e in on.subscribers] == [(("/arm/driver",), "Cyclone DDS")]
    assert [n.name for n in robot.nodes] == ["/arm/driver", "/io", "/other"]


def test_a_robot_that_has_tokens_only() -> None:
    robot = read(
        versions={"a": "demo robot"},
        tokens=["@/a/@ros2_lv", token("a", "MP", "on", "std_msgs/msg/Bool", ":1:1:0,1:")],
    )
    (on,) = robot.topics
    assert on.publishers[0].qos == EndpointQos(reliable=True, transient_local=True, depth=1)
    assert str(on.publishers[0].qos) == "reliable, transient local, depth 1"


def test_services_have_their_servers() -> None:
    robot = read(
        tokens=[
            "@/a/@ros2_lv",
            token("a", "SS", "reset", "std_srvs/srv/Trigger"),
            token("a", "SS", "halt", "std_srvs/srv/Trigger"),
            token("a", "SS", "walk/_action/send_goal", "x/srv/Y"),
            token("a", "AS", "walk", "example_interfaces/action/Fibonacci"),
        ],
        nodes=[
            node("a", CYCLONE, "/plc", service_servers=["/reset", "/halt"], action_servers=["/walk"]),
            node("a", FAST, "/old", service_servers=["/halt"]),
        ],
    )
    halt, reset = robot.services
    assert (reset.nodes, reset.dds, reset.can_be_called) == (("/plc",), "Cyclone DDS", True)
    # Both would get the request, and one of them misread it.
    assert (halt.nodes, halt.dds, halt.can_be_called) == (("/old", "/plc"), "Fast DDS", False)
    assert [(a.name, a.nodes) for a in robot.actions] == [("/walk", ("/plc",))]


@pytest.mark.parametrize(
    ("role", "name", "part"), [("SS", "/reset", ""), ("AS", "/walk", "/_action/send_goal")]
)
def test_server_has_the_hashes_of_its_messages(role: str, name: str, part: str) -> None:
    type_hash = f"RIHS01_{'1' * 64}"
    place = f"rq{name}{part}Request"
    answer = {
        "topic_name": place,
        "type_name": "x::srv::dds_::Y_Request_",
        "qos": {"user_data": list(f"serviceid= 1.2;typehash={type_hash};".encode())},
    }
    robot = read(
        tokens=["@/a/@ros2_lv", token("a", role, name[1:], "x/srv/Y")],
        entities=[(f"@/a/ros2/dds/{CYCLONE}/reader/{CYCLONE[:30]}03/{place}", answer)],
    )
    (server,) = (*robot.services, *robot.actions)
    assert server.hashes == (("x/srv/Y_Request", type_hash),)
    assert robot.topics == ()


def test_each_namespace_is_a_robot_and_a_silent_bridge_is_in_the_graph() -> None:
    graph = ros_graph(
        GraphAnswers(
            zid="me",
            versions={"a": "v1", "b": "v1", "c": "v1"},
            configs={"a": {"namespace": "/r2"}, "b": {"namespace": "/r1/"}, "c": {"namespace": "/r1"}},
            tokens=[
                "@/silent/@ros2_lv",
                token("a", "MP", "r2/on", "std_msgs/msg/Bool"),
                token("b", "MP", "r1/on", "std_msgs/msg/Bool"),
                token("c", "MS", "r1/on", "std_msgs/msg/Bool"),
                token("panel", "MS", "r1/on", "std_msgs/msg/Bool", ":0::0,3:"),
                token("me", "MS", "r1/on", "std_msgs/msg/Bool"),
            ],
        )
    )
    assert [(r.namespace, [b.zid for b in r.bridges]) for r in graph.robots] == [
        ("", ["silent"]),
        ("/r1", ["b", "c"]),
        ("/r2", ["a"]),
    ]
    assert [b.zid for b in graph.bridges if not b.answers] == ["silent"]
    r1 = graph.robot("/r1/")
    assert r1 is not None
    (on,) = r1.topics
    assert (on.name, len(on.publishers), len(on.subscribers)) == ("/on", 1, 1)
    qos = EndpointQos(reliable=False, depth=3)
    assert graph.peers == (
        PeerEndpoint(zid="panel", role="MS", key="r1/on", type="std_msgs/msg/Bool", qos=qos),
    )


def test_a_token_with_a_depth_of_many_digits_has_none() -> None:
    token = f"@/a/@ros2_lv/MP/speed/std_msgs§msg§Bool/:1::0,{'9' * 5000}:"
    graph = ros_graph(GraphAnswers(tokens=["@/a/@ros2_lv", token]))
    assert graph.robots[0].topics[0].publishers[0].qos.depth is None


def test_a_route_of_the_bridge() -> None:
    answer = json.loads(
        '{"dds_reader":"01","local_nodes":["/io"],"remote_routes":["p:on"],"ros2_name":"/on",'
        '"ros2_type":"std_msgs/msg/Bool"}'
    )
    robot = read(
        versions={"a": "v1"}, routes=[("@/a/ros2/route/topic/pub/on", answer), ("@/a/ros2/route/x", {})]
    )
    (route,) = robot.routes
    assert (route.kind, route.direction, route.name, route.endpoint) == ("topic", "pub", "/on", "01")
    assert (route.local_nodes, route.remote, route.active) == (("/io",), ("p:on",), None)

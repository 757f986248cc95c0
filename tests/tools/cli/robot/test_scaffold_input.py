"""What is known of a robot: its topics by their names in a panel file, and how often they are
published, from when their messages arrived."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from app.ros.graph.model import (
    Bridge,
    EndpointQos,
    GraphSnapshot,
    RobotGraph,
    SurveyedTopic,
    TopicEndpoint,
)
from app.tools.robot.scaffold import (
    MOST_ROBOTS,
    Heard,
    read_scaffold_input,
    scaffold_base,
    usable,
)
from tests.support.builders import INTERFACES
from tests.tools.cli.robot.test_link import place_below


@pytest.mark.parametrize(
    ("arrivals", "period_s"),
    [
        ([5.0, 5.1, 5.2], 0.1),
        ([5.0, 5.9, 7.0], 1.1),
        ([5.0, 5.0, 5.1], 0.1),  # a machine that was busy
        ([5.0, 5.1], None),  # perhaps two events
        ([5.0, 5.1, 6.1], None),  # not regular
        ([], None),
    ],
)
def test_period_is_known_of_regular_topics_only(arrivals: list[float], period_s: float | None) -> None:
    assert Heard(arrivals=arrivals).period_s == (period_s and pytest.approx(period_s))


def test_one_message_is_enough_for_a_latched_topic() -> None:
    assert Heard(message=True).is_enough(latched=True)
    assert not Heard(message=True, arrivals=[1.0]).is_enough(latched=False)
    assert Heard(message=True, arrivals=[1.0, 2.0, 3.0]).is_enough(latched=False)
    assert not Heard(arrivals=[1.0, 2.0, 3.0]).is_enough(latched=False)


def topic(name: str, node: str) -> SurveyedTopic:
    end = TopicEndpoint(type="none_msgs/msg/None", qos=EndpointQos(), bridge="a", nodes=(node,))
    return SurveyedTopic(name=name, key=name[1:], publishers=(end,))


def test_topics_outside_of_a_namespace_are_those_of_its_nodes() -> None:
    topics = (
        topic("/amr/speed", "/amr/drive"),
        topic("/diagnostics", "/amr/drive"),
        topic("/rosout", "/amr/drive"),
        topic("/lift", "/other/lift"),
    )
    robot = RobotGraph(bridges=(Bridge(zid="a", version="v1", config={}),), topics=topics)
    observer: Any = None  # nothing is listened to: no type is known
    known = asyncio.run(read_scaffold_input(observer, robot, "/amr", INTERFACES, 0))
    assert [topic.name for topic in known.topics] == ["/speed", "//diagnostics", "/rosout"]
    assert [topic.key for topic in known.topics] == ["amr/speed", "diagnostics", "rosout"]


def graph_of(*namespaces: str) -> GraphSnapshot:
    end = TopicEndpoint(type="std_msgs/msg/Bool", qos=EndpointQos(), bridge="a")
    topic = SurveyedTopic(name="/enabled", key="enabled", publishers=(end,))
    return GraphSnapshot(
        robots=tuple(RobotGraph(namespace=namespace, topics=(topic,)) for namespace in namespaces)
    )


def test_unusable_robots_do_not_prevent_a_scaffold() -> None:
    graph = usable(graph_of("", "/r1", "/r1\\u000a[[page]]", "/a__b", "no namespace", "/r2"))
    assert [robot.namespace for robot in graph.robots] == ["", "/r1", "/r2"]
    many = usable(graph_of(*(f"/r{number}" for number in range(1000))))
    assert len(many.robots) == MOST_ROBOTS


def test_robots_of_alike_namespaces_have_names_of_their_own() -> None:
    draft = scaffold_base(place_below(""), graph_of("/cell1/arm", "/cell2/arm"), "/cell1/arm", Path())
    assert [(robot["id"], robot["name"]) for robot in draft.robots] == [
        ("robot1", "Cell1 arm"),
        ("robot2", "Cell2 arm"),
    ]

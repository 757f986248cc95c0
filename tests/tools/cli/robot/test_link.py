"""How commands find a robot and a topic, and how often a topic is published."""

import argparse
import asyncio
from collections.abc import Mapping, Sequence
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
from app.system.errors import LinkError, PanelError
from app.tools.cli.robot.hz import Rate
from app.tools.cli.robot.options import add_options, place_of
from app.tools.robot import topic_reader
from app.tools.robot.link import Place, topic_named
from app.tools.robot.topic_reader import TopicReader

BOOL = "std_msgs/msg/Bool"


def topic(name: str, *types: str, **more: Any) -> SurveyedTopic:
    publishers = [
        TopicEndpoint(type=type_name, qos=EndpointQos(), bridge="a") for type_name in types or (BOOL,)
    ]
    return SurveyedTopic(name=name, key=name[1:], publishers=tuple(publishers), **more)


def graph_of(
    *robots: tuple[str, Sequence[SurveyedTopic]], config: Mapping[str, Any] | None = None
) -> GraphSnapshot:
    return GraphSnapshot(
        robots=tuple(
            RobotGraph(
                namespace=namespace,
                bridges=(
                    Bridge(
                        zid=namespace or "a",
                        version="v1",
                        config={"namespace": namespace, **(config or {})},
                    ),
                ),
                topics=tuple(topics),
            )
            for namespace, topics in robots
        )
    )


ONE = graph_of(("", [topic("/arm/enabled"), topic("/speed"), topic("/arm2/enabled")]))
TWO = graph_of(("/r1", [topic("/speed")]), ("/r2", [topic("/speed"), topic("/load")]))


def place_below(namespace: str) -> Place:
    return Place(zenoh=Path("zenoh.json5"), namespace=namespace)


@pytest.mark.parametrize(
    ("graph", "below", "written", "robot", "name"),
    [
        (ONE, "", "/speed", "", "/speed"),
        (ONE, "", "speed", "", "/speed"),
        (ONE, "/arm", "/enabled", "", "/arm/enabled"),
        (ONE, "/arm", "//speed", "", "/speed"),
        (TWO, "", "/r2/speed", "/r2", "/speed"),
        (TWO, "/r1", "/speed", "/r1", "/speed"),
    ],
)
def test_a_topic_is_found_by_its_name(
    graph: GraphSnapshot, below: str, written: str, robot: str, name: str
) -> None:
    robot_graph, topic = topic_named(graph, place_below(below), written)
    assert (robot_graph.namespace, topic.name) == (robot, name)


@pytest.mark.parametrize(
    ("graph", "below", "written", "sentence"),
    [
        (ONE, "", "/sped", "no topic /sped is there: did you mean /speed?"),
        (ONE, "", "/enabled", "did you mean /arm/enabled or /arm2/enabled?"),
        (ONE, "", "/zzz", "no topic /zzz is there: `operator-panel topics` lists them"),
        (TWO, "", "/load", "did you mean /r2/load?"),
        (TWO, "/r3", "/load", "there are no topics below /r3: the bridges have /r1, /r2"),
        (ONE, "/r3", "/load", "there are no topics below /r3: no bridge has a namespace"),
    ],
)
def test_a_topic_that_is_not_there_is_a_sentence(
    graph: GraphSnapshot, below: str, written: str, sentence: str
) -> None:
    with pytest.raises(LinkError) as caught:
        topic_named(graph, place_below(below), written)
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("surveyed", "type_name", "sentence"),
    [
        (topic("/x", announced=False), "", "The robot has /x, and the bridge does not forward it."),
        (topic("/secret", announced=False), "", "does not forward /secret: see `allow` and `deny`"),
        (topic("/x"), "std_msgs/msg/String", "/x is std_msgs/msg/Bool on the robot, not std_msgs"),
        (
            topic("/x", BOOL, "a/msg/B"),
            "",
            "/x has several types, name one: std_msgs/msg/Bool, a/msg/B",
        ),
    ],
)
def test_a_topic_that_can_not_be_read_is_a_sentence(
    surveyed: SurveyedTopic, type_name: str, sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def settled(observer: Any, graph: GraphSnapshot, *_: Any) -> GraphSnapshot:
        return graph

    monkeypatch.setattr(topic_reader, "settled_graph", settled)
    observer: Any = None
    graph = graph_of(("", [surveyed]), config={"deny": {"publishers": "^/secret$"}})
    with pytest.raises(LinkError) as caught:
        asyncio.run(TopicReader.find(observer, graph, place_below(""), surveyed.name, type_name))
    assert sentence in str(caught.value)


def place_from(*words: str) -> Place:
    parser = argparse.ArgumentParser()
    add_options(parser)
    return place_of(parser.parse_args(words))


PANEL = 'title = "x"\ndistro = "humble"\nnamespace = "/r7"\n[[page]]\nid = "a"\ntitle = "A"\n'


def test_a_panel_file_says_where_the_robot_is(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(PANEL)
    place = place_from("--panel", str(path))
    assert (place.namespace, place.distro, place.connect) == ("/r7", "humble", ())
    robot = '[[robot]]\nid = "a"\nname = "A"\nnamespace = "/r9"\nconnect = ["tcp/r9:7447"]\n'
    path.write_text(PANEL.replace('namespace = "/r7"\n', robot))
    place = place_from("--panel", str(path), "--distro", "jazzy")
    assert (place.robots, place.bridges) == (("/r9",), 1)
    assert (place.namespace, place.distro, place.connect) == ("/r9", "jazzy", ("tcp/r9:7447",))
    assert place_from("--panel", str(path), "--connect", "tcp/x:1").connect == ("tcp/x:1",)
    with pytest.raises(PanelError):
        place_from("--panel", str(tmp_path / "none.toml"))


@pytest.mark.parametrize(
    "words", [("--namespace", "a b"), ("--wait", "0"), ("--wait", "inf"), ("--wait", "x")]
)
def test_mistyped_option_is_reported(words: Sequence[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        place_from(*words)
    assert "is not a" in capsys.readouterr().err


def test_a_namespace_may_be_given_with_or_without_its_slash() -> None:
    assert place_from("--namespace", "robot1/").namespace == "/robot1"
    assert place_from("--namespace", "/").namespace == ""


def test_a_rate_is_that_of_the_window() -> None:
    rate = Rate(window=3)
    assert str(rate) == ""
    for at in (0.0, 1.0, 1.5, 2.0):
        rate.arrivals.append(at)
    assert str(rate) == ("average rate: 2.000\n\tmin: 0.500s max: 0.500s std dev: 0.00000s window: 3")

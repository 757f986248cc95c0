"""A graph that is read once all of it is there."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import replace
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
from app.tools.robot.link import Place, settled_graph

LONG_S = 60.0
PLACE = Place(zenoh=Path("zenoh.json5"))


class Reader:
    """Gives one graph after the other, then the last one again and again."""

    def __init__(self, graphs: Sequence[GraphSnapshot]) -> None:
        self._graphs = list(graphs)
        self.read = 0
        self.endpoints = ("tcp/127.0.0.1:7447",)

    async def observe(self) -> GraphSnapshot:
        self.read += 1
        return self._graphs.pop(0) if len(self._graphs) > 1 else self._graphs[0]


def topic(name: str, announced: bool = True) -> SurveyedTopic:
    end = TopicEndpoint(type="std_msgs/msg/Bool", qos=EndpointQos(), bridge="b")
    return SurveyedTopic(name=name, key=name.strip("/"), publishers=(end,), announced=announced)


def graph_of(*topics: SurveyedTopic, **config: Any) -> GraphSnapshot:
    bridge = Bridge(zid="b", version="1.10.2", config=config)
    return GraphSnapshot(robots=(RobotGraph(bridges=(bridge,), topics=topics),))


def settled(
    *graphs: GraphSnapshot,
    within_s: float = LONG_S,
    place: Place = PLACE,
    is_enough: Callable[[GraphSnapshot], bool] = lambda _: False,
) -> tuple[GraphSnapshot, int]:
    """The graph, and how often it was read."""
    reader = Reader(graphs[1:] or graphs)
    graph = asyncio.run(settled_graph(reader, graphs[0], place, is_enough, within_s, every_s=0.001))
    return graph, reader.read


WHOLE = graph_of(topic("/a"), topic("/b"))


def test_a_graph_that_is_whole_is_read_once_more() -> None:
    assert settled(WHOLE) == (WHOLE, 1)


@pytest.mark.parametrize(
    "early",
    [
        graph_of(),
        graph_of(topic("/a")),
        graph_of(topic("/a", announced=False), topic("/b", announced=False)),
        graph_of(topic("/a"), topic("/b", announced=False)),
    ],
    ids=["no topic", "another topic comes", "none is passed on yet", "one is not passed on yet"],
)
def test_incomplete_graph_is_waited_for(early: GraphSnapshot) -> None:
    assert settled(early, WHOLE)[0] == WHOLE


def test_denied_topics_are_not_waited_for() -> None:
    graph = graph_of(topic("/a"), topic("/b", announced=False), deny={"publishers": "/b"})
    assert settled(graph) == (graph, 1)


def test_wait_for_a_missing_endpoint_ends_at_the_limit() -> None:
    graph = graph_of(topic("/a", announced=False))
    assert settled(graph, within_s=0.02)[0] == graph


def test_a_graph_that_is_enough_is_not_read_again() -> None:
    early = graph_of(topic("/a"), topic("/b", announced=False))
    assert settled(early, WHOLE, is_enough=lambda graph: True) == (early, 0)
    assert settled(early, WHOLE, is_enough=lambda graph: graph is WHOLE)[0] is WHOLE


BEHIND = graph_of(topic("/c"), namespace="/r2")
BOTH = GraphSnapshot(robots=(*WHOLE.robots, replace(BEHIND.robots[0], namespace="/r2")))


@pytest.mark.parametrize("place", [replace(PLACE, robots=("/r1", "/r2")), replace(PLACE, bridges=2)])
def test_each_bridge_that_the_panel_names_is_waited_for(place: Place) -> None:
    early = BOTH.robots[1:] if place.robots else WHOLE.robots
    assert settled(*[GraphSnapshot(robots=early)] * 3, BOTH, place=place)[0] == BOTH
    assert settled(GraphSnapshot(robots=early), place=place, within_s=0.02)[0].robots == early

"""The graph of robots whose peers, or whose nodes, may have started just now.

A bridge knows a topic some time before it announces it, nodes are discovered one after the other, and
of several bridges one may be connected before the others.
"""

import asyncio
from collections.abc import Callable, Sequence
from typing import Final, Protocol

from app.cli.robot.link import Place, absent_robots
from app.survey.forwarding import lost_topics
from app.survey.model import GraphSnapshot

SETTLES_WITHIN_S: Final = 5.0
READ_EVERY_S: Final = 0.5


class GraphReader(Protocol):
    @property
    def endpoints(self) -> Sequence[str]: ...

    async def observe(self) -> GraphSnapshot: ...


async def settled_graph(
    reader: GraphReader,
    first: GraphSnapshot,
    place: Place,
    is_enough: Callable[[GraphSnapshot], bool] = lambda _: False,
    within_s: float = SETTLES_WITHIN_S,
    every_s: float = READ_EVERY_S,
) -> GraphSnapshot:
    """The first graph that is enough; else the graph once it has topics, has the same ones twice, has
    all bridges of the place, and these announce all that their `allow` and `deny` let through; the last
    one read after `within_s`."""
    clock = asyncio.get_running_loop().time
    end = clock() + within_s
    bridges = place.bridges or len(reader.endpoints)
    before, now = first, first
    while not is_enough(now) and clock() < end:
        await asyncio.sleep(every_s)
        before, now = now, await reader.observe()
        if _topics(now) and _topics(now) == _topics(before) and _is_whole(now, place, bridges):
            break
    return now


def _topics(graph: GraphSnapshot) -> set[str]:
    return {topic.key for robot in graph.robots for topic in robot.topics}


def _is_whole(graph: GraphSnapshot, place: Place, bridges: int) -> bool:
    return (
        (not graph.bridges or sum(bridge.answers for bridge in graph.bridges) >= bridges)
        and not absent_robots(graph, place)
        and not any(any(lost_topics(robot)) for robot in graph.robots)
    )

"""The graph of a robot whose bridge, or whose nodes, may have started just now.

A bridge knows a topic some time before it passes it on, and nodes are found one after the other.
"""

import asyncio
from typing import Final, Protocol

from app.diagnose.bridges import denies
from app.graph.model import GraphSnapshot, RobotGraph, Topic

SETTLES_WITHIN_S: Final = 5.0
READ_EVERY_S: Final = 0.5


class GraphReader(Protocol):
    async def graph(self) -> GraphSnapshot: ...


async def settled_graph(
    reader: GraphReader,
    first: GraphSnapshot,
    within_s: float = SETTLES_WITHIN_S,
    every_s: float = READ_EVERY_S,
) -> GraphSnapshot:
    """The graph once it has topics, has the same ones twice, and the bridge passes on all that its
    `allow` and `deny` let through; the last one read after `within_s`."""
    clock = asyncio.get_running_loop().time
    end = clock() + within_s
    before, now = first, first
    while clock() < end:
        await asyncio.sleep(every_s)
        before, now = now, await reader.graph()
        if (
            _topics(now)
            and _topics(now) == _topics(before)
            and not any(map(_announces_more, now.robots))
        ):
            break
    return now


def _topics(graph: GraphSnapshot) -> set[str]:
    return {topic.key for robot in graph.robots for topic in robot.topics}


def _announces_more(robot: RobotGraph) -> bool:
    """Whether a bridge is still to pass on a topic that it knows."""
    return any(not topic.announced and _is_let_through(robot, topic) for topic in robot.topics)


def _is_let_through(robot: RobotGraph, topic: Topic) -> bool:
    ends = {"publishers": topic.publishers, "subscribers": topic.subscribers}
    return any(there and not denies(robot.bridges, kind, topic.name) for kind, there in ends.items())

"""Asks the bridges for the publishers of the interlocks' topics.

No token says that a second node publishes a topic, so the admin space is asked at intervals: of each
topic its DDS writers, and the names of nodes when writers have changed.
"""

import asyncio
import json
from collections.abc import Collection, Iterator
from contextlib import suppress
from typing import Any, Final

from app.concurrency import spawn_logged
from app.dialect import bridge_entities as entities
from app.dialect.bridge_entities import Writer
from app.dialect.endpoint import within
from app.errors import LinkError
from app.robot.topic_publishers import Publisher
from app.ros_logging import RobotLog
from app.transport.bridge_admin import BridgeAdmin
from app.transport.peer import RobotContext

ASK_EVERY_S: Final = 1.0  # where an interlock locks while there are several
ASK_SELDOM_S: Final = 5.0

Nodes = dict[tuple[Writer, str], tuple[str, ...]]  # (writer, topic's name) → nodes


class PublisherWatch:
    """Keeps the publishers of one robot's interlocks up to date."""

    def __init__(self, context: RobotContext, bridges: BridgeAdmin, log: RobotLog) -> None:
        self._robot = context.robot
        self._link = context.link
        self._changed = context.signals.changed.emit
        self._bridges = bridges
        self._log = log
        interlocks = context.panel.interlocks
        self._keys = sorted({self._robot.key(interlock.topic) for interlock in interlocks})
        is_needed = any(interlock.publishers == "one" for interlock in interlocks)
        self._every_s = ASK_EVERY_S if is_needed else ASK_SELDOM_S
        self._nodes: Nodes = {}
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        if self._keys:
            self._task = spawn_logged(self._run(), self._log, "asking for publishers failed")

    async def stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def update(self) -> bool:
        """Asks once; returns whether publishers have changed. LinkError without a link."""
        publishers_of_topics = await asyncio.gather(*(self._publishers(key) for key in self._keys))
        changed = [
            self._robot.topic_publishers.update(key, publishers)
            for key, publishers in zip(self._keys, publishers_of_topics, strict=True)
        ]
        known = {
            (publisher.peer, publisher.guid)
            for publishers in publishers_of_topics
            for publisher in publishers
        }
        self._nodes = {at: n for at, n in self._nodes.items() if (at[0].zid, at[0].guid) in known}
        return any(changed)

    async def _run(self) -> None:
        while True:
            await asyncio.sleep(self._every_s)
            with suppress(LinkError):
                if self._robot.graph.peers and await self.update():
                    self._changed()

    async def _publishers(self, key: str) -> list[Publisher]:
        return [
            Publisher(writer.zid, writer.guid, await self._nodes_of(writer, name))
            for zid, name in self._names(key)
            for writer in await self._writers(zid, name)
        ]

    def _names(self, key: str) -> Iterator[tuple[str, str]]:
        """(bridge, name of the topic behind it)."""
        for zid in sorted(self._robot.graph.peers):
            namespace = self._bridges.namespaces.get(zid, "")
            if within(f"/{key}", namespace):
                yield zid, f"/{key}".removeprefix(namespace)

    async def _writers(self, zid: str, name: str) -> Collection[Writer]:
        answers = await self._link.query_all(entities.writers(zid, name))
        writers = (entities.writer_place(key) for key, _ in answers)
        return sorted({writer for writer in writers if writer is not None})

    async def _nodes_of(self, writer: Writer, name: str) -> tuple[str, ...]:
        """The nodes of a writer's process that publish the topic; asked for until they are known."""
        if known := self._nodes.get((writer, name)):
            return known
        answers = await self._link.query_all(entities.nodes_of(writer))
        nodes = [node for key, answer in answers if (node := _publishing(key, answer, name))]
        self._nodes[writer, name] = tuple(sorted(nodes))
        return self._nodes[writer, name]


def _publishing(key: str, answer: bytes, name: str) -> str:
    """The name of the node in an answer, if it publishes the topic; else ""."""
    place = entities.node_place(key)
    node: Any = None
    with suppress(ValueError):
        node = json.loads(answer)
    if place is None or not isinstance(node, dict):
        return ""
    return place[2] if name in {topic for topic, _ in entities.names_of(node, "publishers")} else ""

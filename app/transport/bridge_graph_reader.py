"""Reads the whole ROS graph behind all bridges of a link."""

import asyncio
import time
from collections.abc import Callable
from typing import Final

from app.dialect import bridge_dialect as dialect
from app.dialect import bridge_entities as entities
from app.errors import LinkError
from app.printable import one_line
from app.survey.model import GraphSnapshot
from app.transport.admin_space import GraphLink, ask_json
from app.transport.bridge_graph import GraphAnswers, ros_graph

ANNOUNCED_WITHIN_S: Final = 1.5
ANSWERED_WITHIN_S: Final = 5.0
POLL_S: Final = 0.02
MOST_VERSION: Final = 40  # characters


async def observe_bridges(
    link: GraphLink, zid: str, earlier: GraphSnapshot | None = None
) -> GraphSnapshot:
    """The `Observe` of robots behind bridges.

    In a new session, a router announces the bridges some time after the connection: without a bridge
    it takes `ANNOUNCED_WITHIN_S`. A bridge that answered for the `earlier` graph has
    `ANSWERED_WITHIN_S` to answer again and to announce what it still has: on a busy machine it stalls
    for seconds and loses its link.
    """

    def is_whole(graph: GraphSnapshot) -> bool:
        if earlier is None:
            return bool(graph.bridges)
        return not graph.silent_since(earlier) and not _unannounced(earlier, graph)

    within_s = ANNOUNCED_WITHIN_S if earlier is None else ANSWERED_WITHIN_S
    return await _read_until(link, zid, is_whole, within_s)


def _unannounced(earlier: GraphSnapshot, graph: GraphSnapshot) -> set[str]:
    """The keys of services and actions that were announced earlier, and are now only known to be
    offered by a node."""
    offered = {
        robot.key(name)
        for robot in graph.robots
        for node in robot.nodes
        for name in (*node.services, *node.actions)
    }
    return (_servers(earlier) - _servers(graph)) & offered


def _servers(graph: GraphSnapshot) -> set[str]:
    return {server.key for robot in graph.robots for server in (*robot.services, *robot.actions)}


async def _read_until(
    link: GraphLink, zid: str, is_whole: Callable[[GraphSnapshot], bool], within_s: float
) -> GraphSnapshot:
    end = time.monotonic() + within_s
    while True:
        try:
            graph = await read_graph(link, zid)
            if is_whole(graph) or time.monotonic() > end:
                return graph
        except LinkError:
            if time.monotonic() > end:
                raise
        await asyncio.sleep(POLL_S)


async def read_graph(link: GraphLink, zid: str) -> GraphSnapshot:
    """The graph now; `zid` is that of the querying session. LinkError without a link, or if the tokens
    do not arrive in time. A bridge that has a token but does not answer has no version."""
    tokens, versions, configs, nodes, dds, routes = await asyncio.gather(
        link.tokens(),
        link.query_all(dialect.VERSION),
        ask_json(link, dialect.CONFIG),
        ask_json(link, dialect.NODES),
        ask_json(link, entities.DDS),
        ask_json(link, entities.EVERY_ROUTE),
    )
    return await asyncio.to_thread(
        ros_graph,
        GraphAnswers(
            zid=zid,
            tokens=tokens,
            versions={
                dialect.zid_of(key): one_line(version.decode(errors="replace").strip('"'), MOST_VERSION)
                for key, version in versions
            },
            configs={
                dialect.zid_of(key): config for key, config in configs if isinstance(config, dict)
            },
            nodes=nodes,
            entities=dds,
            routes=routes,
        ),
    )

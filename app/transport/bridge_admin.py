"""Queries the admin space of a robot's bridges: their versions, routes, nodes and namespaces."""

import asyncio
import time
from collections.abc import Mapping
from typing import Any, Final

from app.dialect import bridge_dialect
from app.interfaces.names import valid_type
from app.robot.graph import Route
from app.robot.state import RobotState
from app.transport.admin_space import AdminSpace, ask_json
from app.transport.bridge_participants import BridgeParticipants

MISSES_ALLOWED: Final = 1


class BridgeAdmin:
    """Queries the bridges of one robot and updates its graph."""

    def __init__(self, robot: RobotState, link: AdminSpace) -> None:
        self._robot = robot
        self._link = link
        self._participants = BridgeParticipants(link)
        robot.nodes_are_read = True
        self.namespaces: Mapping[str, str] = {}  # of the bridges, by zid
        self.missed = 0  # queries in a row that a bridge did not answer

    async def answered(self, within_s: float) -> bool:
        """Whether all of the bridges answer a query of their version; LinkError without a link."""
        answers = await self._link.query_all(bridge_dialect.VERSION, within_s)
        return self._robot.graph.peers <= {bridge_dialect.zid_of(key) for key, _ in answers}

    async def ask(self) -> None:
        """Queries versions, namespaces, routes and nodes. LinkError without a link."""
        graph = self._robot.graph
        answers, namespaces = await asyncio.gather(
            self._link.query_all(bridge_dialect.VERSION), self._namespaces()
        )
        versions = {
            bridge_dialect.zid_of(key): answer.decode(errors="replace") for key, answer in answers
        }
        graph.update_namespaces(namespaces)
        self.namespaces = namespaces or self.namespaces
        self._robot.update_shared_topics()
        self.missed = 0 if graph.peers <= versions.keys() else self.missed + 1
        if self.missed == 0 or self.missed > MISSES_ALLOWED:
            graph.update_versions(versions)
        if self.missed:
            return  # it would answer nothing else either, and each query would wait for its timeout
        routes = [
            r
            for key, answer in await ask_json(self._link, bridge_dialect.ROUTES)
            if (r := _route(key, answer))
        ]
        began = time.monotonic()
        nodes = await ask_json(self._link, bridge_dialect.NODES)
        own = {zid: namespaces.get(zid, self._robot.namespace) for zid in graph.peers}
        endpoints = await self._participants.endpoints(
            nodes,
            own,
            self._robot.required_keys,
            lambda endpoint: graph.since(endpoint.role, endpoint.key),
        )
        graph.update_routes(routes, endpoints, began)

    async def _namespaces(self) -> dict[str, str]:
        """The namespace in each bridge's configuration, by zid; "" for none."""
        return {
            bridge_dialect.zid_of(key): answer["namespace"].rstrip("/")
            for key, answer in await ask_json(self._link, bridge_dialect.CONFIG)
            if isinstance(answer, dict) and isinstance(answer.get("namespace"), str)
        }


def _route(key: str, answer: Any) -> Route | None:
    """The route that an answer describes; None if it describes none."""
    place = bridge_dialect.route_of(key)
    if place is None or not isinstance(answer, dict) or not isinstance(answer.get("ros2_type"), str):
        return None
    zid, direction, topic_key = place
    whole = direction == "sub" or answer.get("dds_reader") != ""
    return Route(zid, direction, topic_key, valid_type(answer["ros2_type"]), whole)

"""What a robot's bridges say of themselves in their admin space: that they run, their routes and
nodes, the namespace that tells whose they are."""

import asyncio
import json
from contextlib import suppress
from typing import Any, Final, Protocol

from app import keys
from app.graph import Route
from app.keys import Endpoint
from app.robot import Robot

MISSES_ALLOWED: Final = 1


class AdminSpace(Protocol):
    """What is needed of the link: (key, payload) of each answer to a query."""

    async def ask(self, selector: str, within_s: float = ...) -> list[tuple[str, bytes]]: ...


class Bridges:
    """Asks the bridges of one robot; what they say goes into its graph."""

    def __init__(self, robot: Robot, link: AdminSpace) -> None:
        self._robot = robot
        self._link = link
        self.missed = 0  # askings in a row that a bridge did not answer

    async def answered(self, within_s: float) -> bool:
        """Whether all of this robot's bridges run, asked for nothing else. LinkError without a link."""
        answers = await self._link.ask(keys.VERSION, within_s)
        return self._robot.graph.bridges <= {keys.zid_of(key) for key, _ in answers}

    async def ask(self) -> None:
        """Asks how they are, and of their routes and nodes. LinkError without a link."""
        graph = self._robot.graph
        answers, namespaces = await asyncio.gather(self._link.ask(keys.VERSION), self._namespaces())
        versions = {keys.zid_of(key): told.decode(errors="replace") for key, told in answers}
        graph.configured(namespaces)
        self.missed = 0 if graph.bridges <= versions.keys() else self.missed + 1
        if self.missed == 0 or self.missed > MISSES_ALLOWED:
            graph.answered(versions)
        if self.missed:
            return  # it would answer nothing else either, and each question takes its time
        routes = [r for key, told in await self._ask_json(keys.ROUTES) if (r := _route(key, told))]
        nodes: set[Endpoint] = set()
        for key, told in await self._ask_json(keys.NODES):
            with suppress(KeyError, TypeError):  # an answer that is no node's
                namespace = namespaces.get(keys.zid_of(key), self._robot.namespace)
                nodes.update(keys.endpoints_of(key, told, namespace))
        graph.learn(routes, nodes)

    async def _namespaces(self) -> dict[str, str]:
        """The namespace of each bridge that says it, "" for none."""
        return {
            keys.zid_of(key): told["namespace"].rstrip("/")
            for key, told in await self._ask_json(keys.CONFIG)
            if isinstance(told, dict) and isinstance(told.get("namespace"), str)
        }

    async def _ask_json(self, selector: str) -> list[tuple[str, Any]]:
        """(key, answer) of each answer that is JSON; others are passed over."""
        found = []
        for key, told in await self._link.ask(selector):
            with suppress(ValueError):
                found.append((key, json.loads(told)))
        return found


def _route(key: str, told: Any) -> Route | None:
    """What a bridge says of a route; None for what is none."""
    place = keys.route_of(key)
    if place is None or not isinstance(told, dict) or not isinstance(told.get("ros2_type"), str):
        return None
    zid, direction, topic_key = place
    whole = direction == "sub" or told.get("dds_reader") != ""
    return Route(zid, direction, topic_key, keys.type_in(told["ros2_type"]), whole)

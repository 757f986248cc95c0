"""Queries the admin space of a robot's bridges: versions, routes, nodes, namespaces, and what nodes
have announced in DDS."""

import asyncio
import time
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any, Final

from app.cell.robot.graph import Route
from app.cell.robot.state import RobotState
from app.ros.dialects import bridge_dialect
from app.ros.dialects import bridge_entities as entities
from app.ros.dialects.bridge_entities import DdsEntity
from app.ros.dialects.dialect import Endpoint
from app.ros.messages.names import ROSOUT_TOPIC, valid_type
from app.ros.zenoh.answers import AdminSpace, ask_json

# What the nodes behind a bridge have announced in DDS: the QoS and the type hash of each endpoint.
#
# A liveliness token has those of a topic's first publisher or subscriber only, and of services none.
# The bridge's admin space has all. A participant is queried when it appears with an endpoint that the
# panel needs, and again when these endpoints or their tokens have changed.

AT_ONCE: Final = 32  # participants that are queried together
EVERY_NODES: Final = frozenset({ROSOUT_TOPIC, "/parameter_events"})  # their types are ROS 2's own

Place = tuple[str, str]  # a bridge's zid, a participant
Announced = frozenset[tuple[Endpoint, float]]  # with the time of each endpoint's newest token


class BridgeParticipants:
    """The participants behind one robot's bridges, with the endpoints that the panel needs."""

    def __init__(self, link: AdminSpace) -> None:
        self._link = link
        self._announced: dict[Place, tuple[Announced, list[DdsEntity]]] = {}

    async def endpoints(
        self,
        answers: Iterable[tuple[str, Any]],
        namespaces: Mapping[str, str],
        keys: Collection[str],
        since: Callable[[Endpoint], float],
    ) -> list[Endpoint]:
        """The endpoints of these keys in the bridges' answers about nodes, with QoS and hashes.
        LinkError without a link. `namespaces` are the bridges' by zid; others are left out. `since` is
        when the newest token of such an endpoint appeared."""
        by_place = _by_participant(answers, namespaces, keys)
        asked = {
            place: frozenset(
                (endpoint, since(endpoint)) for endpoint in ends if _is_described(endpoint)
            )
            for place, ends in by_place.items()
        }
        stale = [
            place
            for place, ends in asked.items()
            if ends and self._announced.get(place, (None,))[0] != ends
        ]
        for start in range(0, len(stale), AT_ONCE):
            some = stale[start : start + AT_ONCE]
            for place, announced in zip(some, await self._read(some), strict=True):
                if announced:  # else the bridge did not answer in time: it is asked again
                    self._announced[place] = asked[place], announced
        self._announced = {
            place: announced for place, announced in self._announced.items() if place in by_place
        }
        return [
            self._completed(place, endpoint, namespaces[place[0]])
            for place, ends in by_place.items()
            for endpoint in ends
        ]

    async def _read(self, places: Iterable[Place]) -> list[list[DdsEntity]]:
        selectors = [entities.of_participant(*place) for place in places]
        answers = await asyncio.gather(*(ask_json(self._link, selector) for selector in selectors))
        return [
            [
                entity
                for key, answer in several
                if (entity := entities.entity_of(key, answer)) is not None
            ]
            for several in answers
        ]

    def _completed(self, place: Place, endpoint: Endpoint, namespace: str) -> Endpoint:
        name = f"/{endpoint.key}".removeprefix(namespace)
        _, announced = self._announced.get(place, ((), ()))
        return entities.with_entities(endpoint, name, announced)


def _is_described(endpoint: Endpoint) -> bool:
    """Whether its definition counts: every node publishes some topics."""
    return not any(f"/{endpoint.key}".endswith(topic) for topic in EVERY_NODES)


def _by_participant(
    answers: Iterable[tuple[str, Any]], namespaces: Mapping[str, str], keys: Collection[str]
) -> dict[Place, list[Endpoint]]:
    endpoints: defaultdict[Place, list[Endpoint]] = defaultdict(list)
    for place, endpoint in _endpoints(answers, namespaces):
        if endpoint.key in keys:
            endpoints[place].append(endpoint)
    return endpoints


def _endpoints(
    answers: Iterable[tuple[str, Any]], namespaces: Mapping[str, str]
) -> Iterator[tuple[Place, Endpoint]]:
    for admin_key, answer in answers:
        place = entities.node_place(admin_key)
        if place is None or place[0] not in namespaces or not isinstance(answer, dict):
            continue
        for endpoint in entities.node_endpoints(admin_key, answer, namespaces[place[0]]):
            yield place[:2], endpoint


# Queries the admin space of a robot's bridges: their versions, routes, nodes and namespaces.

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

"""What the nodes behind a bridge have announced in DDS: the QoS and the type hash of each endpoint.

A liveliness token has those of a topic's first publisher or subscriber only, and of services none. The
bridge's admin space has all. A participant is queried when it appears with an endpoint that the panel
needs, and again when these endpoints or their tokens have changed.
"""

import asyncio
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any, Final

from app.dialect import bridge_entities as entities
from app.dialect.bridge_entities import DdsEntity
from app.dialect.endpoint import Endpoint
from app.interfaces.names import ROSOUT_TOPIC
from app.transport.admin_space import AdminSpace, ask_json

AT_ONCE: Final = 32  # participants that are queried together
EVERY_NODES: Final = frozenset({ROSOUT_TOPIC, "/parameter_events"})  # their types are ROS 2's own

Place = tuple[str, str]  # a bridge's zid, a participant
Asked = frozenset[tuple[Endpoint, float]]  # with the time of each endpoint's newest token


class BridgeParticipants:
    """The participants behind one robot's bridges, with the endpoints that the panel needs."""

    def __init__(self, link: AdminSpace) -> None:
        self._link = link
        self._announced: dict[Place, tuple[Asked, list[DdsEntity]]] = {}

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

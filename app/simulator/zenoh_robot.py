"""A simulated robot on Zenoh: its topics, services and actions, and their liveliness tokens."""

import threading
from collections.abc import Iterator
from typing import Any

from app.dialect.endpoint import OwnEndpoint
from app.interfaces import Interfaces, names
from app.simulator.simulated import SimulatedRobot
from app.simulator.values.known_types import Moment
from app.simulator.zenoh_action import PlayedAction
from app.simulator.zenoh_wire import Answer, Wire


class SimulatedZenohRobot:
    """One robot, in its namespace."""

    def __init__(
        self,
        wire: Wire,
        namespace: str,
        robot: SimulatedRobot,
        interfaces: Interfaces,
        lock: threading.Lock,
        played: set[str],
    ) -> None:
        """`played` are the keys of what other robots publish and serve: names that are not below a
        namespace. It gets those of this one."""
        self._wire = wire
        self._namespace = namespace
        self._robot = robot
        self._lock = lock
        own = {name for name in (*robot.publishes, *robot.services, *robot.actions)
               if self._key(name) not in played}  # fmt: skip
        played |= {self._key(name) for name in own}
        self._publishes = {
            topic: simulated for topic, simulated in robot.publishes.items() if topic in own
        }
        self._services = {name: type_name for name, type_name in robot.services.items() if name in own}
        self._servers = {name: action for name, action in robot.actions.items() if name in own}
        self._publishers = {
            topic: wire.publisher(
                self._key(topic), simulated.type, latched=simulated.qos.transient_local
            )
            for topic, simulated in self._publishes.items()
        }
        self._actions = [
            PlayedAction(wire, self._key(name), action, interfaces, lock)
            for name, action in self._servers.items()
        ]
        self._declared = [
            *(self._subscriber(topic) for topic in robot.subscribes),
            *(
                wire.served(self._key(service), name, self._server(service))
                for service, name in self._services.items()
            ),
        ]

    def tokens(self) -> Iterator[str]:
        """The liveliness tokens of its endpoints."""
        return self._wire.tokens(self._namespace, self._endpoints())

    def _endpoints(self) -> Iterator[OwnEndpoint]:
        robot, key = self._robot, self._key
        for topic, simulated in robot.subscribes.items():
            yield OwnEndpoint("MS", key(topic), simulated.type, simulated.qos, simulated.type_hash)
        for topic, simulated in self._publishes.items():
            yield OwnEndpoint("MP", key(topic), simulated.type, simulated.qos, simulated.type_hash)
        for service, name in self._services.items():
            yield OwnEndpoint("SS", key(service), name)
        for action, server in self._servers.items():
            yield OwnEndpoint("AS", key(action), server.type)

    def step(self, moment: Moment) -> None:
        with self._lock:
            messages = list(self._robot.step(moment))
        for topic, payload in messages:
            if topic in self._publishers:
                self._publishers[topic](payload)
        for action in self._actions:
            action.step()

    def _key(self, topic: str) -> str:
        return names.key_of(topic, self._namespace)

    def _subscriber(self, topic: str) -> Any:
        def take(payload: bytes) -> None:
            with self._lock:
                self._robot.receive(topic, payload)

        return self._wire.subscriber(self._key(topic), self._robot.subscribes[topic].type, take)

    def _server(self, service: str) -> Answer:
        def answer(payload: bytes) -> bytes | None:
            with self._lock:
                return self._robot.serve(service, payload)

        return answer

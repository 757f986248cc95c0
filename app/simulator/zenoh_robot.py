"""A simulated robot on Zenoh: its topics, services and actions, and their liveliness tokens."""

import threading
from collections.abc import Iterator
from typing import Any

import zenoh
from zenoh.handlers import Callback

from app.dialect import bridge_dialect
from app.interfaces import Interfaces, names
from app.simulator.simulated import SimulatedRobot, SimulatedTopic
from app.simulator.values.known_types import Moment
from app.simulator.zenoh_action import Answer, PlayedAction, latched, served


class SimulatedZenohRobot:
    """One robot, in its namespace."""

    def __init__(
        self,
        session: zenoh.Session,
        namespace: str,
        robot: SimulatedRobot,
        interfaces: Interfaces,
        lock: threading.Lock,
        played: set[str],
    ) -> None:
        """`played` are the keys of what other robots publish and serve: names that are not below a
        namespace. It gets those of this one."""
        self._session = session
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
            topic: self._publisher(topic, simulated) for topic, simulated in self._publishes.items()
        }
        self._actions = [
            PlayedAction(session, self._key(name), action, interfaces, lock)
            for name, action in self._servers.items()
        ]
        self._declared = [
            *(self._subscriber(topic) for topic in robot.subscribes),
            *(served(session, self._key(service), self._server(service)) for service in self._services),
        ]

    def tokens(self, zid: str) -> Iterator[str]:
        """The liveliness tokens of its endpoints."""
        robot, key = self._robot, self._key
        for topic, simulated in robot.subscribes.items():
            yield bridge_dialect.token(
                zid, "MS", key(topic), simulated.type, simulated.qos, simulated.type_hash
            )
        for topic, simulated in self._publishes.items():
            yield bridge_dialect.token(
                zid, "MP", key(topic), simulated.type, simulated.qos, simulated.type_hash
            )
        for service, name in self._services.items():
            yield bridge_dialect.server_token(zid, "SS", key(service), name)
        for action, server in self._servers.items():
            yield bridge_dialect.server_token(zid, "AS", key(action), server.type)

    def step(self, moment: Moment) -> None:
        with self._lock:
            messages = list(self._robot.step(moment))
        for topic, payload in messages:
            if topic in self._publishers:
                self._publishers[topic].put(payload)
        for action in self._actions:
            action.step()

    def _key(self, topic: str) -> str:
        return names.key_of(topic, self._namespace)

    def _publisher(self, topic: str, about: SimulatedTopic) -> Any:
        """A publisher; a TRANSIENT_LOCAL one keeps its last message for late subscribers."""
        if about.qos.transient_local:
            return latched(self._session, self._key(topic))
        return self._session.declare_publisher(self._key(topic))

    def _subscriber(self, topic: str) -> Any:
        """A subscriber that ignores what the robot itself publishes."""

        def on_sample(sample: zenoh.Sample) -> None:
            with self._lock:
                self._robot.receive(topic, sample.payload.to_bytes())

        return self._session.declare_subscriber(
            self._key(topic), Callback(on_sample, indirect=False), allowed_origin=zenoh.Locality.REMOTE
        )

    def _server(self, service: str) -> Answer:
        def answer(payload: bytes) -> bytes | None:
            with self._lock:
                return self._robot.serve(service, payload)

        return answer

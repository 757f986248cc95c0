"""Simulated robots as a separate Zenoh peer: behind a bridge of their own, or nodes on rmw_zenoh.

It has the keys, CDR bytes, liveliness tokens and admin space that a real robot has, so that the panel
needs nothing special for it. It knows nothing of the server.
"""

import json
import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

from app.dialect import bridge_dialect
from app.dialect.endpoint import DEMO_VERSION
from app.errors import KioskError, LinkError
from app.interfaces import Interfaces
from app.simulator.simulated import SimulatedRobot
from app.simulator.values.known_types import Moment
from app.simulator.zenoh_robot import SimulatedZenohRobot
from app.simulator.zenoh_wire import Way, Wire

log = logging.getLogger("kiosk.simulator")

ENDPOINT: Final = "tcp/127.0.0.1:7447"
ANY_PORT: Final = "tcp/127.0.0.1:0"
# A signal that comes to a thread of Zenoh's wakes no wait of the main thread, where it is handled.
LOOK_S: Final = 0.2
BEHIND_A_BRIDGE: Final = Way()
NO_WAYS: Final[Mapping[str, Way]] = {}


class Simulator:
    """Robots on Zenoh, by their namespaces, at one endpoint; opened and closed as a context."""

    def __init__(
        self,
        endpoint: str,
        robots: Mapping[str, SimulatedRobot],
        interfaces: Interfaces,
        failed: Callable[[KioskError], None] = lambda error: log.error("%s", error),
        ways: Mapping[str, Way] = NO_WAYS,
    ) -> None:
        """`failed` is called when a robot ends with an error: then all of them stop. `ways` say by
        namespace how the robots are reached; those that it lacks are behind one bridge."""
        self._step_s = min(robot.step_s for robot in robots.values())
        self._failed = failed
        self._lock = threading.Lock()
        self._ends = threading.Event()
        self._session = zenoh.open(_listening(endpoint))
        way_of = {namespace: ways.get(namespace, BEHIND_A_BRIDGE) for namespace in robots}
        self._wires = {
            way: Wire(self._session, way, interfaces) for way in dict.fromkeys(way_of.values())
        }
        keys: set[str] = set()
        self.robots = [
            SimulatedZenohRobot(
                self._wires[way_of[namespace]], namespace, robot, interfaces, self._lock, keys
            )
            for namespace, robot in robots.items()
        ]
        bridged = [namespace for namespace, way in way_of.items() if way == BEHIND_A_BRIDGE]
        self._declared = list(self._graph(bridged))
        self._thread = threading.Thread(target=self._run, name="demo-robot", daemon=True)

    def __enter__(self) -> "Simulator":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._thread.join()
        self._session.close()

    @property
    def endpoint(self) -> str:
        """The endpoint that it listens on, with the port that the system chose for `ANY_PORT`."""
        for reply in self._session.get(f"@/{self._session.zid()}/peer"):
            if reply.ok is not None:
                return str(json.loads(reply.ok.payload.to_bytes())["locators"][0])
        raise zenoh.ZError("the session has no locator")

    def _graph(self, bridged: Sequence[str]) -> Iterator[Any]:
        """The tokens of the robots, and the admin space of a bridge for the namespaces behind one."""
        if bridged:
            yield from self._bridge(bridged)
        for played in self.robots:
            for token in played.tokens():
                yield self._session.liveliness().declare_token(token)
        for wire in self._wires.values():
            for token in wire.peer_tokens():
                yield self._session.liveliness().declare_token(token)

    def _bridge(self, namespaces: Sequence[str]) -> Iterator[Any]:
        """The admin space of a bridge. With one robot it has its namespace."""
        zid = str(self._session.zid())
        namespace = namespaces[0] if len(namespaces) == 1 else ""
        config = json.dumps({"namespace": namespace or "/"})
        yield _admin_value(self._session, bridge_dialect.version(zid), DEMO_VERSION)
        yield _admin_value(self._session, bridge_dialect.config(zid), config)

    def _run(self) -> None:
        while not self._ends.wait(self._step_s):
            moment = Moment(time.monotonic(), time.time_ns())
            try:
                for played in self.robots:
                    played.step(moment)
            except KioskError as error:
                self._failed(error)
                return


def _admin_value(session: zenoh.Session, key: str, text: str) -> Any:
    """A constant value in the admin space."""

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(key, text)

    return session.declare_queryable(key, Callback(answer, indirect=False), complete=True)


def _listening(endpoint: str) -> zenoh.Config:
    config = zenoh.Config()
    for place, value in {
        "mode": '"peer"',
        "listen/endpoints": f'["{endpoint}"]',
        "scouting/multicast/enabled": "false",
        "scouting/gossip/enabled": "false",
        "timestamping/enabled": "true",
        "transport/unicast/accept_timeout": "3000",  # who is at it holds up the session's end
        "transport/shared_memory/enabled": "false",  # its file stays when the process is killed
        "adminspace/enabled": "true",  # `endpoint` reads the port there
    }.items():
        config.insert_json5(place, value)
    return config


def serve(
    endpoint: str,
    robots: Mapping[str, SimulatedRobot],
    interfaces: Interfaces,
    ends: threading.Event,
    listening: Callable[[], None],
    ways: Mapping[str, Way] = NO_WAYS,
) -> None:
    """Robots at this endpoint until `ends` is set; calls `listening` when they are there.

    Raises LinkError where it can't listen there, and the error of a robot that fails.
    """
    errors: list[KioskError] = []

    def failed(error: KioskError) -> None:
        errors.append(error)
        ends.set()

    try:
        with Simulator(endpoint, robots, interfaces, failed, ways):
            listening()
            while not ends.wait(LOOK_S):
                pass
    except zenoh.ZError as error:
        raise LinkError(f"can't listen at {endpoint}: {error}") from error
    if errors:
        raise errors[0]

"""Simulated robots behind a bridge of their own, as a separate Zenoh peer.

It has the keys, CDR bytes, liveliness tokens and admin space that a real robot has behind
zenoh-bridge-ros2dds, so that the panel needs nothing special for it. It knows nothing of the server.
"""

import json
import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

import zenoh

from app.dialect import bridge_dialect
from app.dialect.endpoint import DEMO_VERSION
from app.errors import KioskError, LinkError
from app.interfaces import Interfaces
from app.simulator.simulated import SimulatedRobot
from app.simulator.values.known_types import Moment
from app.simulator.zenoh_action import served
from app.simulator.zenoh_robot import SimulatedZenohRobot

log = logging.getLogger("kiosk.simulator")

ENDPOINT: Final = "tcp/127.0.0.1:7447"
ANY_PORT: Final = "tcp/127.0.0.1:0"
# A signal that comes to a thread of Zenoh's wakes no wait of the main thread, where it is handled.
LOOK_S: Final = 0.2


class Simulator:
    """Robots on Zenoh, by their namespaces, at one endpoint; opened and closed as a context."""

    def __init__(
        self,
        endpoint: str,
        robots: Mapping[str, SimulatedRobot],
        interfaces: Interfaces,
        failed: Callable[[KioskError], None] = lambda error: log.error("%s", error),
    ) -> None:
        """`failed` is called when a robot ends with an error: then all of them stop."""
        self._step_s = min(robot.step_s for robot in robots.values())
        self._failed = failed
        self._lock = threading.Lock()
        self._ends = threading.Event()
        self._session = zenoh.open(_listening(endpoint))
        keys: set[str] = set()
        self.robots = [
            SimulatedZenohRobot(self._session, namespace, robot, interfaces, self._lock, keys)
            for namespace, robot in robots.items()
        ]
        self._declared = list(self._graph(robots))
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

    def _graph(self, robots: Mapping[str, SimulatedRobot]) -> Iterator[Any]:
        """The admin space and the tokens of a bridge. With one robot it has its namespace."""
        zid = str(self._session.zid())
        namespace = next(iter(robots)) if len(robots) == 1 else ""
        config = json.dumps({"namespace": namespace or "/"})
        yield _admin_value(self._session, bridge_dialect.version(zid), DEMO_VERSION)
        yield _admin_value(self._session, bridge_dialect.config(zid), config)
        for played in self.robots:
            for token in played.tokens(zid):
                yield self._session.liveliness().declare_token(token)
        yield self._session.liveliness().declare_token(bridge_dialect.bridge_token(zid))

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
    return served(session, key, lambda _: text.encode())


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
) -> None:
    """Robots at this endpoint until `ends` is set; calls `listening` when they are there.

    Raises LinkError where it can't listen there, and the error of a robot that fails.
    """
    errors: list[KioskError] = []

    def failed(error: KioskError) -> None:
        errors.append(error)
        ends.set()

    try:
        with Simulator(endpoint, robots, interfaces, failed):
            listening()
            while not ends.wait(LOOK_S):
                pass
    except zenoh.ZError as error:
        raise LinkError(f"can't listen at {endpoint}: {error}") from error
    if errors:
        raise errors[0]

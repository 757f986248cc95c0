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
from zenoh.ext import CacheConfig, declare_advanced_publisher
from zenoh.handlers import Callback

from app.dialect import bridge_dialect
from app.dialect.endpoint import DEMO_VERSION
from app.errors import DecodeError, KioskError, LinkError
from app.interfaces import Interfaces, names
from app.simulator.goals import ActionServer
from app.simulator.known_types import Moment
from app.simulator.simulated import SimulatedRobot, Topic

log = logging.getLogger("kiosk.simulator")

ENDPOINT: Final = "tcp/127.0.0.1:7447"
ANY_PORT: Final = "tcp/127.0.0.1:0"
Answer = Callable[[bytes], bytes | None]


class Simulator:
    """Robots on Zenoh, by their namespaces, at one endpoint; opened and closed as a context."""

    def __init__(
        self,
        endpoint: str,
        robots: Mapping[str, SimulatedRobot],
        interfaces: Interfaces,
        failed: Callable[[KioskError], None] = lambda error: log.error("%s", error),
    ) -> None:
        """`failed` is called when a robot ends with an error: then all stand still."""
        self._step_s = min(robot.step_s for robot in robots.values())
        self._failed = failed
        self._lock = threading.Lock()
        self._ends = threading.Event()
        self._session = zenoh.open(_listening(endpoint))
        self._played = [
            _Played(self._session, namespace, robot, interfaces, self._lock)
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
        """Where it listens, with the port that the system chose for `ANY_PORT`."""
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
        for played in self._played:
            for token in played.tokens(zid):
                yield self._session.liveliness().declare_token(token)
        yield self._session.liveliness().declare_token(bridge_dialect.bridge_token(zid))

    def _run(self) -> None:
        while not self._ends.wait(self._step_s):
            moment = Moment(time.monotonic(), time.time_ns())
            try:
                for played in self._played:
                    played.step(moment)
            except KioskError as error:
                self._failed(error)
                return


class _Played:
    """One robot, in its namespace."""

    def __init__(
        self,
        session: zenoh.Session,
        namespace: str,
        robot: SimulatedRobot,
        interfaces: Interfaces,
        lock: threading.Lock,
    ) -> None:
        self._session = session
        self._namespace = namespace
        self._robot = robot
        self._lock = lock
        self._publishers = {
            topic: self._publisher(topic, about) for topic, about in robot.publishes.items()
        }
        self._actions = [
            _PlayedAction(session, self._key(name), action, interfaces, lock)
            for name, action in robot.actions.items()
        ]
        self._declared = [
            *(self._subscriber(topic) for topic in robot.subscribes),
            *(_served(session, self._key(one), self._server(one)) for one in robot.services),
        ]

    def tokens(self, zid: str) -> Iterator[str]:
        """The liveliness tokens of its endpoints."""
        robot, key = self._robot, self._key
        for topic, of in robot.subscribes.items():
            yield bridge_dialect.token(zid, "MS", key(topic), of.type, of.qos, of.type_hash)
        for topic, of in robot.publishes.items():
            yield bridge_dialect.token(zid, "MP", key(topic), of.type, of.qos, of.type_hash)
        for service, name in robot.services.items():
            yield bridge_dialect.server_token(zid, "SS", key(service), name)
        for action, server in robot.actions.items():
            yield bridge_dialect.server_token(zid, "AS", key(action), server.type)

    def step(self, moment: Moment) -> None:
        with self._lock:
            messages = list(self._robot.step(moment))
        for topic, payload in messages:
            self._publishers[topic].put(payload)
        for action in self._actions:
            action.step()

    def _key(self, topic: str) -> str:
        return names.key_of(topic, self._namespace)

    def _publisher(self, topic: str, about: Topic) -> Any:
        """What is TRANSIENT_LOCAL is kept for subscribers that come late."""
        if about.qos.transient_local:
            return _latched(self._session, self._key(topic))
        return self._session.declare_publisher(self._key(topic))

    def _subscriber(self, topic: str) -> Any:
        """What the robot itself publishes is no press."""

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


class _PlayedAction:
    """One action of a robot: three services and two topics."""

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        server: ActionServer,
        interfaces: Interfaces,
        lock: threading.Lock,
    ) -> None:
        self._session = session
        self._key = key
        self._server = server
        self._interfaces = interfaces
        self._lock = lock
        self._types = interfaces.action_types(server.type)
        self._status = _latched(session, names.status(key))
        self._states: list[tuple[bytes, int]] = []
        self._results: list[tuple[bytes, zenoh.Query]] = []
        self._declared = [
            _served(session, names.of_action(key, "send_goal"), self._begin),
            _served(session, names.of_action(key, "cancel_goal"), self._cancel),
            session.declare_queryable(
                names.of_action(key, "get_result"),
                Callback(self._on_result, indirect=False),
                complete=True,
            ),
        ]

    def step(self) -> None:
        with self._lock:
            news = self._server.feedback()
            states = self._server.states()
            ended = [(q, end) for goal, q in self._results if (end := self._server.result(goal))]
            answered = {id(query) for query, _ in ended}
            self._results = [one for one in self._results if id(one[1]) not in answered]
        for goal_id, fields in news:
            message = {"goal_id": {"uuid": goal_id}, "feedback": fields}
            payload = self._interfaces.encode(self._types.feedback_message, message)
            self._session.put(names.feedback(self._key), payload)
        if states != self._states:
            self._states = states
            self._publish_states()
        for query, (status, result) in ended:
            response = {"status": status, "result": result}
            with query:
                query.reply(
                    names.of_action(self._key, "get_result"),
                    self._interfaces.encode(self._types.get_result_response, response),
                )

    def _begin(self, payload: bytes) -> bytes | None:
        try:
            request = self._interfaces.decode(self._types.send_goal_request, payload)
        except DecodeError:
            return None
        with self._lock:
            accepted = self._server.begin(bytes(request.goal_id.uuid), request.goal)
        return self._interfaces.encode(self._types.send_goal_response, {"accepted": accepted})

    def _cancel(self, payload: bytes) -> bytes | None:
        request_type, response_type = self._interfaces.service_types(self._types.cancel_goal)
        try:
            request = self._interfaces.decode(request_type, payload)
        except DecodeError:
            return None
        with self._lock:
            code, canceled = self._server.cancel(bytes(request.goal_info.goal_id.uuid))
        goals = [{"goal_id": {"uuid": one}} for one in canceled]
        fields = {"return_code": code, "goals_canceling": goals}
        return self._interfaces.encode(response_type, fields)

    def _on_result(self, query: zenoh.Query) -> None:
        try:
            request = self._interfaces.decode(self._types.get_result_request, _payload(query))
        except DecodeError:
            query.drop()
            return
        with self._lock:
            self._results.append((bytes(request.goal_id.uuid), query))

    def _publish_states(self) -> None:
        """As an action server does whenever a goal has another state."""
        known = [
            {"goal_info": {"goal_id": {"uuid": goal_id}}, "status": status}
            for goal_id, status in self._states
        ]
        self._status.put(self._interfaces.encode(self._types.status, {"status_list": known}))


def _latched(session: zenoh.Session, key: str) -> Any:
    """A publisher that keeps its last message for subscribers that come late."""
    cache = CacheConfig(max_samples=1)
    return declare_advanced_publisher(session, key, cache=cache, publisher_detection=True)


def _served(session: zenoh.Session, key: str, answer: Answer) -> Any:
    """A queryable that answers as a service server behind a bridge does."""

    def on_query(query: zenoh.Query) -> None:
        with query:
            response = answer(_payload(query))
            if response is not None:
                query.reply(key, response)

    return session.declare_queryable(key, Callback(on_query, indirect=False), complete=True)


def _admin_value(session: zenoh.Session, key: str, text: str) -> Any:
    """A constant value in the admin space."""
    return _served(session, key, lambda _: text.encode())


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


def _payload(query: zenoh.Query) -> bytes:
    return b"" if query.payload is None else query.payload.to_bytes()


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
            ends.wait()
    except zenoh.ZError as error:
        raise LinkError(f"can't listen at {endpoint}: {error}") from error
    if errors:
        raise errors[0]

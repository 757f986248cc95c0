"""The demo robot: a `system_controller` behind a bridge of its own, as a separate Zenoh peer.

It has the keys, CDR bytes, liveliness tokens and admin space that a real robot has behind
zenoh-bridge-ros2dds, so that the kiosk can't tell the difference; it knows nothing of the server.
`operator-panel simulate` runs it alone, where the shipped zenoh.json5 connects.
"""

import json
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

import zenoh
from zenoh.ext import CacheConfig, declare_advanced_publisher
from zenoh.handlers import Callback

from app.dialect import bridge_dialect
from app.dialect.endpoint import DEMO_VERSION, TopicRole
from app.errors import DecodeError, LinkError
from app.interfaces import Interfaces, load_interfaces, names
from app.interfaces.names import Qos
from app.simulator.parameters import EVENT_TYPE, EVENTS, SERVICES
from app.simulator.robot import COUNT, COUNT_TYPE, LISTENS, SERVES, SPEAKS, DemoRobot

ENDPOINT: Final = "tcp/127.0.0.1:7447"
ANY_PORT: Final = "tcp/127.0.0.1:0"
STEP_S: Final = 0.1
LATCHED: Final = Qos(transient_local=True, depth=1)
OF_EVENTS: Final = Qos(depth=1000)  # rmw_qos_profile_parameter_events
SAID: Final = {**SPEAKS, EVENTS: EVENT_TYPE}
SERVED: Final = {**SERVES, **SERVICES}


class Simulator:
    """The demo robot on Zenoh, listening at one endpoint; opened and closed as a context."""

    def __init__(self, endpoint: str, namespace: str = "", distro: str = "jazzy") -> None:
        self._interfaces: Interfaces = load_interfaces(distro)
        self._namespace = namespace
        self._robot = DemoRobot()
        self._lock = threading.Lock()
        self._ends = threading.Event()
        self._session = zenoh.open(_listening(endpoint))
        self._publishers = {topic: self._publisher(self._key(topic)) for topic in SPEAKS}
        self._publishers[EVENTS] = self._session.declare_publisher(self._key(EVENTS))
        self._status = self._publisher(names.status(self._key(COUNT)))
        self._states: list[tuple[bytes, int]] = []
        self._results: list[tuple[bytes, zenoh.Query]] = []
        self._types = self._interfaces.action_types(COUNT_TYPE)
        self._declared = [
            *self._subscribers(),
            *(self._served(self._key(one), kind, self._server(one)) for one, kind in SERVED.items()),
            *self._action(),
            *self._graph(),
        ]
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
        for told in self._session.get(f"@/{self._session.zid()}/peer"):
            if told.ok is not None:
                return str(json.loads(told.ok.payload.to_bytes())["locators"][0])
        raise zenoh.ZError("the session does not tell where it listens")

    def _key(self, topic: str) -> str:
        return names.key_of(topic, self._namespace)

    def _publisher(self, key: str) -> Any:
        return declare_advanced_publisher(
            self._session,
            key,
            cache=CacheConfig(max_samples=1),
            publisher_detection=True,
        )

    def _subscribers(self) -> Iterator[Any]:
        for topic, type_name in LISTENS.items():

            def on_sample(sample: zenoh.Sample, topic: str = topic, name: str = type_name) -> None:
                try:
                    message = self._interfaces.decode(name, sample.payload.to_bytes())
                except DecodeError:
                    return  # as a ROS node that can't read a message: nothing happens
                with self._lock:
                    self._robot.hear(topic, message.data)

            yield self._session.declare_subscriber(
                self._key(topic), Callback(on_sample, indirect=False)
            )

    def _served(self, key: str, type_name: str, serve: Callable[[Any], Mapping[str, Any]]) -> Any:
        """A queryable that answers as a service server behind a bridge does."""
        request_type, response_type = self._interfaces.service_types(type_name)

        def on_query(query: zenoh.Query) -> None:
            with query:
                try:
                    request = self._interfaces.decode(request_type, _payload(query))
                except DecodeError:
                    return
                with self._lock:
                    fields = serve(request)
                query.reply(key, self._interfaces.encode(response_type, fields))

        return self._session.declare_queryable(key, Callback(on_query, indirect=False), complete=True)

    def _server(self, service: str) -> Callable[[Any], Mapping[str, Any]]:
        robot = self._robot
        serve = robot.parameters.serve if service in SERVICES else robot.serve
        return lambda request: serve(service, request)

    def _action(self) -> Iterator[Any]:
        key = f"{self._key(COUNT)}/_action"

        def begin(request: Any) -> Mapping[str, Any]:
            accepted = self._robot.begin(bytes(request.goal_id.uuid), request.goal.order)
            return {"accepted": accepted, "stamp": {"sec": 0, "nanosec": 0}}

        def cancel(request: Any) -> Mapping[str, Any]:
            code, canceled = self._robot.cancel(bytes(request.goal_info.goal_id.uuid))
            never = {"sec": 0, "nanosec": 0}
            goals = [{"goal_id": {"uuid": one}, "stamp": never} for one in canceled]
            return {"return_code": code, "goals_canceling": goals}

        def on_result(query: zenoh.Query) -> None:
            try:
                request = self._interfaces.decode(self._types.get_result_request, _payload(query))
            except DecodeError:
                query.drop()
                return
            with self._lock:
                self._results.append((bytes(request.goal_id.uuid), query))

        yield self._served(f"{key}/send_goal", self._types.send_goal, begin)
        yield self._served(f"{key}/cancel_goal", self._types.cancel_goal, cancel)
        yield self._session.declare_queryable(
            f"{key}/get_result", Callback(on_result, indirect=False), complete=True
        )

    def _graph(self) -> Iterator[Any]:
        zid = str(self._session.zid())

        config = json.dumps({"namespace": self._namespace or "/"})
        yield self._told(bridge_dialect.version(zid), DEMO_VERSION)
        yield self._told(bridge_dialect.config(zid), config)
        liveliness = self._session.liveliness()
        ends: list[tuple[TopicRole, Mapping[str, str], Qos]] = [
            ("MS", LISTENS, Qos()),
            ("MP", SPEAKS, LATCHED),
            ("MP", {EVENTS: EVENT_TYPE}, OF_EVENTS),
        ]
        for role, topics, qos in ends:
            for topic, name in topics.items():
                type_hash = self._interfaces.type_hash(name)
                yield liveliness.declare_token(
                    bridge_dialect.token(zid, role, self._key(topic), name, qos, type_hash)
                )
        for service, name in SERVED.items():
            yield liveliness.declare_token(
                bridge_dialect.server_token(zid, "SS", self._key(service), name)
            )
        yield liveliness.declare_token(
            bridge_dialect.server_token(zid, "AS", self._key(COUNT), COUNT_TYPE)
        )
        yield liveliness.declare_token(bridge_dialect.bridge_token(zid))

    def _told(self, key: str, text: str) -> Any:
        """A part of the admin space, which always says the same."""

        def on_query(query: zenoh.Query) -> None:
            with query:
                query.reply(key, text.encode())

        return self._session.declare_queryable(key, Callback(on_query, indirect=False), complete=True)

    def _run(self) -> None:
        while not self._ends.wait(STEP_S):
            with self._lock:
                said = self._robot.step(time.monotonic())
                counted = self._robot.count()
                states = self._robot.states()
                ended = [(q, end) for goal, q in self._results if (end := self._robot.result(goal))]
                answered = {id(query) for query, _ in ended}
                self._results = [one for one in self._results if id(one[1]) not in answered]
            for topic, fields in said:
                self._publishers[topic].put(self._interfaces.encode(SAID[topic], fields))
            for goal_id, sequence in counted:
                self._tell(goal_id, sequence)
            if states != self._states:
                self._states = states
                self._tell_states()
            for query, (status, sequence) in ended:
                self._answer(query, status, sequence)

    def _tell(self, goal_id: bytes, sequence: list[int]) -> None:
        fields = {"goal_id": {"uuid": goal_id}, "feedback": {"sequence": sequence}}
        payload = self._interfaces.encode(self._types.feedback_message, fields)
        self._session.put(names.feedback(self._key(COUNT)), payload)

    def _tell_states(self) -> None:
        """As an action server does whenever a goal has another state."""
        never = {"sec": 0, "nanosec": 0}
        known = [
            {"goal_info": {"goal_id": {"uuid": goal_id}, "stamp": never}, "status": status}
            for goal_id, status in self._states
        ]
        self._status.put(self._interfaces.encode(self._types.status, {"status_list": known}))

    def _answer(self, query: zenoh.Query, status: int, sequence: list[int]) -> None:
        fields = {"status": status, "result": {"sequence": sequence}}
        with query:
            query.reply(
                f"{self._key(COUNT)}/_action/get_result",
                self._interfaces.encode(self._types.get_result_response, fields),
            )


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
        "adminspace/enabled": "true",  # it tells the port
    }.items():
        config.insert_json5(place, value)
    return config


def _payload(query: zenoh.Query) -> bytes:
    return b"" if query.payload is None else query.payload.to_bytes()


@contextmanager
def in_process(namespace: str, distro: str) -> Iterator[str]:
    """A demo robot of this process's own; yields the endpoint to connect to.

    That is a port, as a process that is killed leaves none: of a socket's file the folder would stay.
    """
    with Simulator(ANY_PORT, namespace, distro) as robot:
        yield robot.endpoint


def serve(endpoint: str, namespace: str, ends: threading.Event, listening: Callable[[], None]) -> None:
    """A demo robot at this endpoint until `ends` is set; calls `listening` when it is there.

    Raises LinkError where it can't listen there.
    """
    try:
        with Simulator(endpoint, namespace):
            listening()
            ends.wait()
    except zenoh.ZError as error:
        raise LinkError(f"can't listen at {endpoint}: {error}") from error

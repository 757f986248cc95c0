"""Simulated robots as a separate Zenoh peer: behind a bridge of their own, or nodes on rmw_zenoh.

It has the keys, CDR bytes, liveliness tokens and admin space that a real robot has, so that the panel
needs nothing special for it. It knows nothing of the server.
"""

import json
import logging
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import zenoh
from zenoh.ext import CacheConfig, declare_advanced_publisher
from zenoh.handlers import Callback

from app.panel.model import Panel, RobotEntry
from app.ros.dialects import bridge_dialect
from app.ros.dialects.bridge_dialect import BridgeDialect, bridge_token
from app.ros.dialects.dialect import (
    DEMO_NODE,
    DEMO_VERSION,
    Dialect,
    DialectName,
    PanelEndpoint,
    distribution_hashes,
)
from app.ros.dialects.rmw_zenoh import RmwZenohDialect, is_whole, parse_attachment
from app.ros.messages import Interfaces, names
from app.system.errors import DecodeError, KioskError, LinkError
from app.tools.simulator.known_types import Moment
from app.tools.simulator.robot import ActionServer, SimulatedRobot

# How simulated robots publish, subscribe and serve on Zenoh: behind a bridge of their own, or as nodes
# on rmw_zenoh. Such a node takes nothing without a whole attachment, as a real one would end by it.

log = logging.getLogger("kiosk.simulator")

NODE: Final = "system_controller"
# Where the panel file does not say how the robot is reached, the simulated one has a bridge.
BEHIND_BRIDGE: Final[frozenset[DialectName]] = frozenset({"auto", "bridge"})
NUMBERED: Final = zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.5)  # rmw_zenoh's
Answer = Callable[[bytes], bytes | None]
# (domain, interfaces, distribution) → the dialect of a robot.
MakeDialect = Callable[[int, Interfaces, str], Dialect]


@dataclass(frozen=True, slots=True)
class Way:
    """By which dialect simulated robots are reached; on rmw_zenoh in which ROS domain and of which
    distribution."""

    dialect: DialectName = "bridge"
    domain: int = 0
    distro: str = ""


def way_of(
    panel: Panel,
    robot: Panel | RobotEntry,
    dialect: DialectName | None = None,
    domain: int | None = None,
) -> Way:
    """As a panel file says of a robot, unless a dialect or a domain is given."""
    dialect = dialect or robot.dialect
    if dialect in BEHIND_BRIDGE:
        return Way()
    return Way(dialect, robot.domain if domain is None else domain, panel.distro)


class Wire:
    """What a session of simulated robots puts on Zenoh and takes from it."""

    def __init__(self, session: zenoh.Session, way: Way, interfaces: Interfaces) -> None:
        self._session = session
        self._zid = str(session.zid())
        self.has_bridge = way.dialect == "bridge"
        make, self._accepts, self._tokens = KINDS[way.dialect]
        self._dialect = make(way.domain, interfaces, way.distro)
        self._sent: Counter[str] = Counter()

    def tokens(self, namespace: str, endpoints: Iterable[PanelEndpoint]) -> Iterator[str]:
        """The liveliness tokens of a robot's endpoints."""
        yield from self._tokens(self._dialect, self._zid, f"{namespace}/{NODE}", endpoints)

    def peer_tokens(self) -> Iterator[str]:
        """Those of what all robots of the session have in common. Declare them last."""
        if self.has_bridge:
            yield bridge_token(self._zid)
        else:
            yield from self._tokens(self._dialect, self._zid, DEMO_NODE, ())

    def publisher(self, key: str, type_name: str, *, latched: bool = False) -> Callable[[bytes], None]:
        """A function that publishes. A latched publisher keeps its last message for subscribers that
        come late, and does not repeat it: Zenoh must not drop it where a connection is slow. A node on
        rmw_zenoh also numbers its messages, and says which was the last."""
        expression = self._dialect.topic(key, type_name)
        declared: Any = (
            declare_advanced_publisher(
                self._session,
                expression,
                cache=CacheConfig(max_samples=1),
                publisher_detection=True,
                sample_miss_detection=None if self.has_bridge else NUMBERED,
                congestion_control=zenoh.CongestionControl.BLOCK,
            )
            if latched
            else self._session.declare_publisher(expression)
        )

        def publish(payload: bytes) -> None:
            declared.put(payload, attachment=self._attachment(expression))

        return publish

    def subscriber(self, key: str, type_name: str, take: Callable[[bytes], None]) -> Any:
        """A subscriber that ignores what the session itself publishes."""

        def on_sample(sample: zenoh.Sample) -> None:
            payload = sample.payload.to_bytes()
            if self._takes(key, payload, sample.attachment):
                take(payload)

        return self._session.declare_subscriber(
            self._dialect.topic(key, type_name),
            Callback(on_sample, indirect=False),
            allowed_origin=zenoh.Locality.REMOTE,
        )

    def served(self, key: str, type_name: str, answer: Answer) -> Any:
        """A service server that answers at once."""

        def on_query(query: zenoh.Query) -> None:
            with query:
                response = answer(payload_of(query))
                if response is not None:
                    self.reply(query, key, type_name, response)

        return self.server(key, type_name, on_query)

    def server(self, key: str, type_name: str, on_query: Callable[[zenoh.Query], None]) -> Any:
        """A service server that answers when it wants to, by `reply`."""

        def handle(query: zenoh.Query) -> None:
            if self._takes(key, payload_of(query), query.attachment):
                on_query(query)
            else:
                query.drop()

        return self._session.declare_queryable(
            self._dialect.service(key, type_name), Callback(handle, indirect=False), complete=True
        )

    def reply(self, query: zenoh.Query, key: str, type_name: str, payload: bytes) -> None:
        """The response to a request. It has the request's attachment, if there is one."""
        query.reply(self._dialect.service(key, type_name), payload, attachment=query.attachment)

    def _attachment(self, expression: str) -> bytes | None:
        self._sent[expression] += 1
        return self._dialect.attachment(self._zid, expression, self._sent[expression], time.time_ns())

    def _takes(self, key: str, payload: bytes, attachment: zenoh.ZBytes | None) -> bool:
        """Whether a node would read this; one that would end by it says so."""
        taken = self._accepts(payload, b"" if attachment is None else attachment.to_bytes())
        if not taken:
            log.error("what came on %s is not whole: a node would end by it", key)
        return taken


def payload_of(query: zenoh.Query) -> bytes:
    return b"" if query.payload is None else query.payload.to_bytes()


def _bridge(domain: int, interfaces: Interfaces, distro: str) -> Dialect:
    return BridgeDialect()


def _nodes(domain: int, interfaces: Interfaces, distro: str) -> Dialect:
    return RmwZenohDialect(domain, distribution_hashes(distro, interfaces))


def _anything(payload: bytes, attachment: bytes) -> bool:
    return True


def _whole(payload: bytes, attachment: bytes) -> bool:
    return is_whole(payload) and parse_attachment(attachment) is not None


def _tokens_of_bridge(
    dialect: Dialect, zid: str, node: str, endpoints: Iterable[PanelEndpoint]
) -> Iterable[str]:
    return dialect.own_tokens(zid, endpoints)


def _tokens_of_node(
    dialect: Dialect, zid: str, node: str, endpoints: Iterable[PanelEndpoint]
) -> Iterable[str]:
    assert isinstance(dialect, RmwZenohDialect)
    return dialect.node_tokens(zid, node, endpoints)


Tokens = Callable[[Dialect, str, str, Iterable[PanelEndpoint]], Iterable[str]]
KINDS: Final[Mapping[DialectName, tuple[MakeDialect, Callable[[bytes, bytes], bool], Tokens]]] = {
    "bridge": (_bridge, _anything, _tokens_of_bridge),
    "rmw_zenoh": (_nodes, _whole, _tokens_of_node),
}


# A simulated action on Zenoh.


class PlayedAction:
    """One action of a robot: three services and two topics."""

    def __init__(
        self,
        wire: Wire,
        key: str,
        server: ActionServer,
        interfaces: Interfaces,
        lock: threading.Lock,
    ) -> None:
        self._wire = wire
        self._key = key
        self._server = server
        self._interfaces = interfaces
        self._lock = lock
        self._types = interfaces.action_types(server.type)
        types = self._types
        self._publish_status = wire.publisher(names.status(key), types.status, latched=True)
        self._publish_feedback = wire.publisher(names.feedback(key), types.feedback_message)
        self._states: list[tuple[bytes, int]] = []
        self._results: list[tuple[bytes, zenoh.Query]] = []
        self._result_key = names.of_action(key, "get_result")
        self._declared = [
            wire.served(names.of_action(key, "send_goal"), types.send_goal, self._begin),
            wire.served(names.of_action(key, "cancel_goal"), types.cancel_goal, self._cancel),
            wire.server(self._result_key, types.get_result, self._on_result),
        ]

    def step(self) -> None:
        with self._lock:
            news = self._server.feedback()
            states = self._server.states()
            ended = [(q, end) for goal, q in self._results if (end := self._server.result(goal))]
            answered = {id(query) for query, _ in ended}
            self._results = [result for result in self._results if id(result[1]) not in answered]
        for goal_id, fields in news:
            message = {"goal_id": {"uuid": goal_id}, "feedback": fields}
            self._publish_feedback(self._interfaces.encode(self._types.feedback_message, message))
        if states != self._states:
            self._states = states
            self._publish_states()
        for query, (status, result) in ended:
            response = self._interfaces.encode(
                self._types.get_result_response, {"status": status, "result": result}
            )
            with query:
                self._wire.reply(query, self._result_key, self._types.get_result, response)

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
        goals = [{"goal_id": {"uuid": goal_id}} for goal_id in canceled]
        fields = {"return_code": code, "goals_canceling": goals}
        return self._interfaces.encode(response_type, fields)

    def _on_result(self, query: zenoh.Query) -> None:
        try:
            request = self._interfaces.decode(self._types.get_result_request, payload_of(query))
        except DecodeError:
            query.drop()
            return
        with self._lock:
            self._results.append((bytes(request.goal_id.uuid), query))

    def _publish_states(self) -> None:
        """Publishes the status of all goals. Action servers do so at each change of a goal's state."""
        known = [
            {"goal_info": {"goal_id": {"uuid": goal_id}}, "status": status}
            for goal_id, status in self._states
        ]
        self._publish_status(self._interfaces.encode(self._types.status, {"status_list": known}))


# A simulated robot on Zenoh: its topics, services and actions, and their liveliness tokens.


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

    def publisher_tokens(self, topic: str, type_name: str = "") -> set[str]:
        """The liveliness tokens of its publisher of a topic, also as if it had another type; none for a
        topic that it does not publish."""
        published = self._publishes.get(topic)
        if published is None:
            return set()
        own_hash = "" if type_name else published.type_hash
        kind = type_name or published.type
        return self._own_tokens(PanelEndpoint("MP", self._key(topic), kind, published.qos, own_hash))

    def service_tokens(self, service: str) -> set[str]:
        """The liveliness tokens of a service; none for one that it does not serve."""
        name = self._services.get(service)
        return self._own_tokens(PanelEndpoint("SS", self._key(service), name)) if name else set()

    def _own_tokens(self, endpoint: PanelEndpoint) -> set[str]:
        """Those of an endpoint without those of its node."""
        of_node = {*self._wire.tokens(self._namespace, [])}
        return {*self._wire.tokens(self._namespace, [endpoint])} - of_node

    def _endpoints(self) -> Iterator[PanelEndpoint]:
        robot, key = self._robot, self._key
        for topic, simulated in robot.subscribes.items():
            yield PanelEndpoint("MS", key(topic), simulated.type, simulated.qos, simulated.type_hash)
        for topic, simulated in self._publishes.items():
            yield PanelEndpoint("MP", key(topic), simulated.type, simulated.qos, simulated.type_hash)
        for service, name in self._services.items():
            yield PanelEndpoint("SS", key(service), name)
        for action, server in self._servers.items():
            yield PanelEndpoint("AS", key(action), server.type)

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
        self._tokens: dict[str, Any] = {}
        self._announced: dict[tuple[SimulatedZenohRobot, str], set[str]] = {}  # other than at the start
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
                self._tokens[token] = self._session.liveliness().declare_token(token)
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

    def announce(self, topic: str, type_name: str = "", *, gone: bool = False) -> None:
        """The publishers of a topic are announced with another type than their own, or, if `gone`, not
        at all. Without both they are announced as they are."""
        for played in self.robots:
            wanted = set() if gone else played.publisher_tokens(topic, type_name)
            self._declare(played, topic, played.publisher_tokens(topic), wanted)

    def announce_service(self, service: str, *, gone: bool = False) -> None:
        """A service is announced, or, if `gone`, not any more."""
        for played in self.robots:
            own = played.service_tokens(service)
            self._declare(played, service, own, set() if gone else own)

    def _declare(self, played: SimulatedZenohRobot, name: str, own: set[str], wanted: set[str]) -> None:
        """Declares the wanted tokens of a name in place of those before, at the start its own."""
        shown = self._announced.get((played, name), own)
        self._announced[played, name] = wanted
        for token in shown - wanted:
            self._tokens.pop(token).undeclare()
        for token in wanted - shown:
            self._tokens[token] = self._session.liveliness().declare_token(token)

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

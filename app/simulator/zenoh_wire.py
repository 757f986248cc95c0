"""How simulated robots publish, subscribe and serve on Zenoh: behind a bridge of their own, or as nodes
on rmw_zenoh. Such a node takes nothing without a whole attachment, as a real one would end by it."""

import logging
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import zenoh
from zenoh.ext import CacheConfig, declare_advanced_publisher
from zenoh.handlers import Callback

from app.dialect.bridge_dialect import BridgeDialect, bridge_token
from app.dialect.dialect import Dialect, DialectName
from app.dialect.endpoint import DEMO_NODE, OwnEndpoint
from app.dialect.rmw_zenoh_attachment import is_whole, parse_attachment
from app.dialect.rmw_zenoh_dialect import RmwZenohDialect
from app.dialect.type_hashes import distribution_hashes
from app.interfaces import Interfaces
from app.panel.model import Panel, RobotEntry

log = logging.getLogger("kiosk.simulator")

NODE: Final = "system_controller"
# Where the panel file does not say how the robot is reached, the simulated one has a bridge.
BEHIND_BRIDGE: Final[frozenset[DialectName]] = frozenset({"auto", "bridge"})
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

    def tokens(self, namespace: str, endpoints: Iterable[OwnEndpoint]) -> Iterator[str]:
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
        come late."""
        expression = self._dialect.topic(key, type_name)
        declared: Any = (
            declare_advanced_publisher(
                self._session,
                expression,
                cache=CacheConfig(max_samples=1),
                publisher_detection=True,
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
    dialect: Dialect, zid: str, node: str, endpoints: Iterable[OwnEndpoint]
) -> Iterable[str]:
    return dialect.own_tokens(zid, endpoints)


def _tokens_of_node(
    dialect: Dialect, zid: str, node: str, endpoints: Iterable[OwnEndpoint]
) -> Iterable[str]:
    assert isinstance(dialect, RmwZenohDialect)
    return dialect.node_tokens(zid, node, endpoints)


Tokens = Callable[[Dialect, str, str, Iterable[OwnEndpoint]], Iterable[str]]
KINDS: Final[Mapping[DialectName, tuple[MakeDialect, Callable[[bytes, bytes], bool], Tokens]]] = {
    "bridge": (_bridge, _anything, _tokens_of_bridge),
    "rmw_zenoh": (_nodes, _whole, _tokens_of_node),
}

"""The protocol of a dialect, with its parts that are the same in every dialect: endpoints, caches of
latched topics, and type hashes. No I/O."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final, Literal, Protocol

from app.ros.messages import Interfaces
from app.ros.messages.names import Qos
from app.system.errors import InterfaceError

# Endpoints of the ROS graph: publishers, subscribers, servers of a robot or of the panel.

TopicRole = Literal["MP", "MS"]  # a publisher, a subscriber
ServerRole = Literal["SS", "AS"]  # a service's server, an action's
Role = TopicRole | ServerRole
# Of the panel and of the simulated robot: clients of services and actions, and servers, too.
OwnRole = TopicRole | ServerRole | Literal["SC", "AC"]
Direction = Literal["pub", "sub"]  # of a bridge's route: from ROS to Zenoh, from Zenoh to ROS

DEMO_VERSION: Final = '"demo robot"'  # how the demo robot answers for its version
DEMO_NODE: Final = "/operator_panel_demo_robot"  # a node of the demo robot without a bridge


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A publisher, subscriber or server, of a token or of a node. The role None means the peer that the
    robot is reached by: a bridge, or a Zenoh session of nodes. `reliable` is None if it is not known,
    `node` and `dds` are "".

    `hashes` are (message type, type hash) of the messages that it exchanges, as far as they are known:
    one of a topic, those of its requests and responses of a server.
    """

    zid: str
    role: Role | None = None
    key: str = ""
    type: str = ""
    transient_local: bool = False
    reliable: bool | None = None
    hashes: tuple[tuple[str, str], ...] = ()
    node: str = ""
    dds: str = ""


@dataclass(frozen=True, slots=True)
class PanelEndpoint:
    """A publisher, a subscriber, a client or a server in the ROS graph. Clients and servers have
    neither QoS nor hash."""

    role: OwnRole
    key: str
    type: str
    qos: Qos = field(default_factory=Qos)
    type_hash: str = ""


def within(namespace: str, outer: str) -> bool:
    """Whether a bridge with the namespace `outer` can have topics of `namespace`."""
    return f"{namespace}/".startswith(f"{outer}/")


# The protocol of a dialect: how the names of a robot's ROS graph are written in Zenoh.

DialectName = Literal["auto", "bridge", "rmw_zenoh"]
DEFAULT_DIALECT: Final[DialectName] = "auto"  # where the panel file does not say: what is there decides
# Those whose peers join a ROS domain by their own configuration.
WITH_OWN_DOMAIN: Final[frozenset[DialectName]] = frozenset({"bridge"})
WITHOUT_BRIDGE: Final[frozenset[DialectName]] = frozenset({"rmw_zenoh"})
WITHOUT_ROUTER: Final[frozenset[DialectName]] = frozenset({"bridge"})  # the bridge listens itself
DOMAIN_MOST: Final = 232  # the last ROS_DOMAIN_ID
ANY_HASH: Final = "*"
TypeHash = Callable[[str], str]  # the name of a type → its hash in key expressions


def any_hash(type_name: str) -> str:
    """For those who only read: whatever definition a topic has."""
    return ANY_HASH


class Dialect(Protocol):
    """Maps the ROS 2 names of a kind of robot to Zenoh key expressions, and its liveliness tokens to
    endpoints. Pure functions, without a session or state.

    A `key` is a ROS 2 name with its namespace, without the first slash (`interfaces.names.key_of`). The
    panel knows topics, services and actions by it; only `cell/link/` uses key expressions.
    """

    @property
    def tokens(self) -> tuple[str, ...]:
        """The key expressions of the liveliness tokens that show the ROS graph."""

    @property
    def as_client(self) -> bool:
        """Whether a session has to be a client of a router: routers pass on nothing between peers."""

    @property
    def keeps_log(self) -> bool:
        """Whether the session keeps the lines of its log for nodes that subscribe late: a bridge keeps
        them itself."""

    def topic(self, key: str, type_name: str) -> str:
        """The key expression on which a topic is published and subscribed to."""

    def service(self, key: str, type_name: str) -> str:
        """The key expression on which a service is queried."""

    def attachment(self, zid: str, expression: str, number: int, at_ns: int) -> bytes | None:
        """The attachment of a message or a query; None for none. `zid` is the sending session's,
        `number` counts what this session sends on `expression`, from 1, and `at_ns` is the time in
        nanoseconds since the epoch."""

    def is_whole(self, payload: bytes) -> bool:
        """Whether a payload may be sent: one that is cut off could end a node of the robot."""

    def accepts(self, attachment: bytes | None) -> bool:
        """Whether a message or response with this attachment is read; None is one without. What is not
        whole is not read, whatever its payload says."""

    def key_hash(self, type_name: str) -> str:
        """The type hash in the key expressions of a type; "" where they have none. The robot's must
        equal it, or nothing arrives."""

    def own_tokens(self, zid: str, endpoints: Iterable[PanelEndpoint]) -> list[str]:
        """The tokens by which a session has these endpoints in the ROS graph."""

    def endpoint(self, token: str) -> Endpoint | None:
        """The endpoint of a token; None for one that the panel does not need."""

    def panel_node(self, token: str) -> Endpoint | None:
        """The node of a token if it is that of a panel: another panel on the same robot, or its own."""

    def name_in(self, token: str) -> str:
        """The name in a token, as `in_token` writes it; "" for a peer's own token. It has to be fast:
        there may be ten thousand tokens of which the panel needs ten."""

    def in_token(self, key: str) -> str:
        """A key as it is written in a token."""


# The caches in which TRANSIENT_LOCAL publishers keep their last message for late subscribers. They are
# zenoh-ext's, the same in every dialect (source: zenoh-ext 1.10). No I/O.

_CACHES: Final = "/@adv/pub/"


def caches(expression: str) -> str:
    """The key expression of the tokens of a topic's caches. A cache answers queries of its token's
    name."""
    return f"{expression}{_CACHES}**"


def is_cache_of(token: str, zid: str) -> bool:
    """Whether a token is that of a cache of the session `zid`."""
    return f"{_CACHES}{zid}/" in token


def numbered_publisher(token: str) -> str:
    """The publisher (zid/entity id) of a cache whose messages are numbered; "" where they are not. One
    that numbers them says on the key of its token which was the last: what was lost is noticed."""
    zid, _, rest = token.partition(_CACHES)[2].partition("/")
    entity = rest.partition("/")[0]
    return f"{zid}/{entity}" if entity.isdecimal() else ""


def newest(token: str) -> str:
    """The query for the last message of a cache."""
    return f"{token}?_max=1"


# The type hashes of a distribution of ROS 2, as key expressions have them. Pure.

NO_HASH: Final = "TypeHashNotSupported"  # what ROS 2 before iron has in its place
WITHOUT_HASHES: Final = frozenset({"humble"})


def distribution_hashes(distro: str, interfaces: Interfaces) -> TypeHash:
    """The hashes of the nodes of a distribution: of its definitions, and of the panel's own."""

    def key_hash(type_name: str) -> str:
        if distro in WITHOUT_HASHES:
            return NO_HASH
        try:
            return interfaces.type_hash(type_name)
        except InterfaceError:
            return ANY_HASH

    return key_hash

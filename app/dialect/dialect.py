"""The protocol of a dialect: how the names of a robot's ROS graph are written in Zenoh."""

from collections.abc import Callable, Iterable
from typing import Final, Literal, Protocol

from app.dialect.endpoint import Endpoint, OwnEndpoint

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
    panel knows topics, services and actions by it; only `transport/` uses key expressions.
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

    def key_hash(self, type_name: str) -> str:
        """The type hash in the key expressions of a type; "" where they have none. The robot's must
        equal it, or nothing arrives."""

    def own_tokens(self, zid: str, endpoints: Iterable[OwnEndpoint]) -> list[str]:
        """The tokens by which a session has these endpoints in the ROS graph."""

    def endpoint(self, token: str) -> Endpoint | None:
        """The endpoint of a token; None for one that the panel does not need."""

    def name_in(self, token: str) -> str:
        """The name in a token, as `in_token` writes it; "" for a peer's own token. It has to be fast:
        there may be ten thousand tokens of which the panel needs ten."""

    def in_token(self, key: str) -> str:
        """A key as it is written in a token."""

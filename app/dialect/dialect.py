"""The seam between what the panel knows of a robot and how that is said in Zenoh."""

from collections.abc import Iterable
from typing import Protocol

from app.dialect.endpoint import Endpoint, OwnEndpoint


class Dialect(Protocol):
    """How the ROS 2 names of a kind of robot become Zenoh key expressions, and its liveliness tokens
    endpoints. Pure: it has no session and keeps nothing.

    A `key` is a ROS 2 name without its first slash (`interfaces.names.key_of`). By it the panel knows
    topics, services and actions; only `transport/` has to do with key expressions.
    """

    @property
    def tokens(self) -> str:
        """The key expression of every liveliness token that shows the ROS graph."""

    def topic(self, key: str, type_name: str) -> str:
        """The key expression on which a topic is published and subscribed to."""

    def service(self, key: str, type_name: str) -> str:
        """The key expression on which a service is queried."""

    def attachment(self, zid: str, expression: str, number: int, at_ns: int) -> bytes | None:
        """What goes with a message or a query, beside its payload; None for nothing. `zid` is of the
        session that sends it, `number` counts what this session sends on `expression`, from 1, and
        `at_ns` is the time (nanoseconds since the epoch)."""

    def own_tokens(self, zid: str, endpoints: Iterable[OwnEndpoint]) -> list[str]:
        """The tokens that a session holds to be in the ROS graph with these endpoints."""

    def endpoint(self, token: str) -> Endpoint | None:
        """What a token shows; None for what the panel needs not know."""

    def name_in(self, token: str) -> str:
        """The name that a token is about, as `in_token` writes it; "" for a peer's own. It has to be
        cheap: there may be ten thousand tokens of which the panel needs ten."""

    def in_token(self, key: str) -> str:
        """How a token writes a key."""

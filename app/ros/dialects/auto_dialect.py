"""The dialect of a robot of which the panel file does not say how it is reached. No I/O.

Until a peer is there, the panel listens for the tokens of each kind. What is found is chosen by
`cell/link/auto_peer.py`, until the session is lost.
"""

from collections.abc import Iterable
from typing import Final, Literal

from app.ros.dialects.bridge_dialect import BridgeDialect
from app.ros.dialects.dialect import Dialect, Endpoint, PanelEndpoint, TypeHash
from app.ros.dialects.rmw_zenoh import PREFIX, RmwZenohDialect

Kind = Literal["bridge", "rmw_zenoh"]

OF_NO_KEY: Final = "*"  # the name in a token that is not read: no key is written so


class AutoDialect:
    """The `Dialect` of the kind that was chosen; until then that of the bridge, with the peers of
    both kinds."""

    def __init__(self, domain: int, type_hash: TypeHash) -> None:
        self.bridge: Final = BridgeDialect()
        self.nodes: Final = RmwZenohDialect(domain, type_hash)
        self.choice: Kind | None = None

    @property
    def current(self) -> Dialect:
        return self.nodes if self.choice == "rmw_zenoh" else self.bridge

    @property
    def tokens(self) -> tuple[str, ...]:
        return (*self.bridge.tokens, *self.nodes.tokens)

    @property
    def as_client(self) -> bool:
        return self.current.as_client

    @property
    def keeps_log(self) -> bool:
        return self.current.keeps_log

    def topic(self, key: str, type_name: str) -> str:
        return self.current.topic(key, type_name)

    def service(self, key: str, type_name: str) -> str:
        return self.current.service(key, type_name)

    def attachment(self, zid: str, expression: str, number: int, at_ns: int) -> bytes | None:
        return self.current.attachment(zid, expression, number, at_ns)

    def is_whole(self, payload: bytes) -> bool:
        return self.current.is_whole(payload)

    def accepts(self, attachment: bytes | None) -> bool:
        return self.current.accepts(attachment)

    def key_hash(self, type_name: str) -> str:
        return self.current.key_hash(type_name)

    def own_tokens(self, zid: str, endpoints: Iterable[PanelEndpoint]) -> list[str]:
        return self.current.own_tokens(zid, endpoints)

    def node_tokens(self, zid: str, node: str, endpoints: Iterable[PanelEndpoint]) -> list[str]:
        """Of a robot on rmw_zenoh."""
        return self.nodes.node_tokens(zid, node, endpoints)

    def endpoint(self, token: str) -> Endpoint | None:
        dialect = self._dialect_of(token)
        return dialect.endpoint(token) if dialect else None

    def panel_node(self, token: str) -> Endpoint | None:
        dialect = self._dialect_of(token)
        return dialect.panel_node(token) if dialect else None

    def name_in(self, token: str) -> str:
        dialect = self._dialect_of(token)
        return dialect.name_in(token) if dialect else OF_NO_KEY

    def in_token(self, key: str) -> str:
        return self.current.in_token(key)

    def _dialect_of(self, token: str) -> Dialect | None:
        """The dialect of a token; None for a kind that was not chosen."""
        kind: Kind = "rmw_zenoh" if token.startswith(PREFIX) else "bridge"
        if self.choice not in (None, kind):
            return None
        return self.nodes if kind == "rmw_zenoh" else self.bridge

"""The dialect of a robot of which the panel file does not say how it is reached. No I/O.

Until a peer is there, the panel listens for the tokens of each kind. What is found is chosen by
`transport/auto_peer.py`, until the session is lost.
"""

from collections.abc import Iterable
from typing import Final, Literal

from app.dialect.bridge_dialect import BridgeDialect
from app.dialect.dialect import Dialect, TypeHash
from app.dialect.endpoint import Endpoint, OwnEndpoint
from app.dialect.rmw_zenoh_dialect import RmwZenohDialect
from app.dialect.rmw_zenoh_tokens import PREFIX

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
    def chosen(self) -> Dialect:
        return self.nodes if self.choice == "rmw_zenoh" else self.bridge

    @property
    def tokens(self) -> tuple[str, ...]:
        return (*self.bridge.tokens, *self.nodes.tokens)

    @property
    def as_client(self) -> bool:
        return self.chosen.as_client

    @property
    def keeps_log(self) -> bool:
        return self.chosen.keeps_log

    def topic(self, key: str, type_name: str) -> str:
        return self.chosen.topic(key, type_name)

    def service(self, key: str, type_name: str) -> str:
        return self.chosen.service(key, type_name)

    def attachment(self, zid: str, expression: str, number: int, at_ns: int) -> bytes | None:
        return self.chosen.attachment(zid, expression, number, at_ns)

    def is_whole(self, payload: bytes) -> bool:
        return self.chosen.is_whole(payload)

    def key_hash(self, type_name: str) -> str:
        return self.chosen.key_hash(type_name)

    def own_tokens(self, zid: str, endpoints: Iterable[OwnEndpoint]) -> list[str]:
        return self.chosen.own_tokens(zid, endpoints)

    def node_tokens(self, zid: str, node: str, endpoints: Iterable[OwnEndpoint]) -> list[str]:
        """Of a robot on rmw_zenoh."""
        return self.nodes.node_tokens(zid, node, endpoints)

    def endpoint(self, token: str) -> Endpoint | None:
        dialect = self._dialect_of(token)
        return dialect.endpoint(token) if dialect else None

    def name_in(self, token: str) -> str:
        dialect = self._dialect_of(token)
        return dialect.name_in(token) if dialect else OF_NO_KEY

    def in_token(self, key: str) -> str:
        return self.chosen.in_token(key)

    def _dialect_of(self, token: str) -> Dialect | None:
        """The dialect of a token; None for a kind that was not chosen."""
        kind: Kind = "rmw_zenoh" if token.startswith(PREFIX) else "bridge"
        if self.choice not in (None, kind):
            return None
        return self.nodes if kind == "rmw_zenoh" else self.bridge

"""The dialect of ROS 2 nodes that run on Zenoh themselves (rmw_zenoh_cpp, hiroz): ROS 2 names ↔ Zenoh
key expressions. No I/O.

Everything that knows rmw_zenoh's key expressions, tokens and attachments is in the modules of this
name. A topic or service has the key expression `<domain>/<name>/<type>/<hash>`.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

from app.dialect.dialect import ANY_HASH, TypeHash, any_hash
from app.dialect.endpoint import Endpoint, OwnEndpoint
from app.dialect.rmw_zenoh_attachment import attachment, gid_of, is_whole
from app.dialect.rmw_zenoh_names import ANY_TYPE, dds_type, mangled
from app.dialect.rmw_zenoh_tokens import (
    ACTION_SERVER,
    NAME_AT,
    PANEL_NODE,
    PARTS,
    action_parts,
    endpoint_of,
    endpoint_token,
    every_token,
    node_token,
    parse_token,
)


@dataclass(frozen=True)
class RmwZenohDialect:
    """The `Dialect` of a robot whose nodes run on rmw_zenoh, in one ROS domain."""

    domain: int = 0
    type_hash: TypeHash = any_hash

    @cached_property
    def tokens(self) -> tuple[str, ...]:
        return (every_token(self.domain),)

    @property
    def as_client(self) -> bool:
        """Nodes are peers of the router."""
        return True

    @property
    def keeps_log(self) -> bool:
        return True

    def topic(self, key: str, type_name: str) -> str:
        """The key expression; "" for any type."""
        kind = dds_type(type_name) if type_name else ANY_TYPE
        type_hash = self.type_hash(type_name) if type_name else ANY_HASH
        return f"{self.domain}/{key}/{kind}/{type_hash}"

    def service(self, key: str, type_name: str) -> str:
        return self.topic(key, type_name)

    def attachment(self, zid: str, expression: str, number: int, at_ns: int) -> bytes | None:
        return attachment(number, at_ns, gid_of(zid, expression))

    def is_whole(self, payload: bytes) -> bool:
        return is_whole(payload)

    def key_hash(self, type_name: str) -> str:
        known = self.type_hash(type_name)
        return "" if known == ANY_HASH else known

    def own_tokens(self, zid: str, endpoints: Iterable[OwnEndpoint]) -> list[str]:
        """Those of a command's session, whose node ends with it."""
        return self.node_tokens(zid, f"{PANEL_NODE}_{zid[:8]}", endpoints)

    def node_tokens(self, zid: str, node: str, endpoints: Iterable[OwnEndpoint]) -> list[str]:
        """The tokens of a node and of its endpoints: each once."""
        return list(dict.fromkeys(self._node_tokens(zid, node, endpoints)))

    def _node_tokens(self, zid: str, node: str, endpoints: Iterable[OwnEndpoint]) -> Iterator[str]:
        yield node_token(self.domain, zid, node)
        for endpoint in endpoints:
            of_action = endpoint.role in ("AC", "AS")
            for own in action_parts(endpoint) if of_action else (endpoint,):
                if own.role != "AC" and own.role != "AS":
                    type_hash = self.type_hash(own.type)
                    yield endpoint_token(
                        self.domain, zid, node, own.role, own.key, own.type, type_hash, own.qos
                    )

    def endpoint(self, token: str) -> Endpoint | None:
        parsed = parse_token(token)
        return None if parsed is None else endpoint_of(parsed)

    def name_in(self, token: str) -> str:
        parts = token.split("/", PARTS - 1)
        return parts[NAME_AT].removesuffix(mangled(ACTION_SERVER)) if len(parts) == PARTS else ""

    def in_token(self, key: str) -> str:
        return mangled(f"/{key}")

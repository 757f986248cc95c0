"""The dialect of ROS 2 nodes that run on Zenoh (rmw_zenoh_cpp, hiroz): key expressions, liveliness
tokens and attachments. No I/O."""

import re
import struct
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from typing import Final, Literal, NamedTuple
from zlib import crc32

from app.ros.dialects.dialect import ANY_HASH, Endpoint, PanelEndpoint, TopicRole, TypeHash, any_hash
from app.ros.messages.derived import action_types
from app.ros.messages.names import (
    MAX_NAME,
    NAMESPACE,
    NO_TYPE,
    TOPIC,
    Qos,
    feedback,
    is_valid_name,
    of_action,
    status,
    valid_type,
)

# How rmw_zenoh writes ROS 2 names, types and QoS in key expressions and tokens. Pure.
#
# Source: the design of rmw_zenoh (github.com/ros2/rmw_zenoh, docs/design.md), tried with rmw_zenoh_cpp.

ANY_TYPE: Final = "*"  # in place of a type of which any is meant
ROOT: Final = "%"  # an empty namespace or enclave
# By the names of rmw/types.h. 0 is the system's default, which is `RELIABLE`, `VOLATILE` and
# `KEEP_LAST` in rmw_zenoh; what equals the default may be left out.
BEST_EFFORT: Final = "2"
TRANSIENT_LOCAL: Final = "1"
KEEP_ALL: Final = "2"
_DDS_TYPE = re.compile(r"(?P<package>\w{1,255})::(?P<kind>msg|srv|action)::dds_::(?P<name>\w{1,255})_")
_QOS = re.compile(
    r"(?P<reliability>[0-4]?):(?P<durability>[0-4]?):(?P<history>[0-3]?),(?P<depth>\d{0,9})"
    r":\d*,\d*:\d*,\d*:\d*,\d*,\d*"
)


class TokenQos(NamedTuple):
    """The QoS in a token."""

    reliable: bool = True
    transient_local: bool = False
    keep_all: bool = False
    depth: int = 0


def dds_type(type_name: str) -> str:
    """The type as key expressions have it: "std_msgs/msg/String" → "std_msgs::msg::dds_::String_"."""
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_type(dds_name: str) -> str:
    """The same back; `NO_TYPE` for what is not a type."""
    match = _DDS_TYPE.fullmatch(dds_name)
    return valid_type("/".join(match.group("package", "kind", "name"))) if match else NO_TYPE


def mangled(name: str) -> str:
    """A name as a part of a token: "/arm/state" → "%arm%state", "" → "%"."""
    return name.replace("/", "%") or ROOT


def demangled(part: str) -> str:
    """The same back; "" for a root."""
    return "" if part == ROOT else part.replace("%", "/")


def qos_part(qos: Qos) -> str:
    """The QoS of a token: what is not the default, and the depth."""
    reliability = "" if qos.reliable else BEST_EFFORT
    durability = TRANSIENT_LOCAL if qos.transient_local else ""
    return f"{reliability}:{durability}:,{qos.depth}:,:,:,,"


def parse_qos(part: str) -> TokenQos | None:
    """The QoS of a token; None for what is none."""
    match = _QOS.fullmatch(part)
    if match is None:
        return None
    return TokenQos(
        match["reliability"] != BEST_EFFORT,
        match["durability"] == TRANSIENT_LOCAL,
        match["history"] == KEEP_ALL,
        int(match["depth"] or 0),
    )


# The attachments of rmw_zenoh's messages, requests and responses. Pure.
#
# A node ends when it receives one that is malformed, so all that leave are made here.

GID_BYTES: Final = 16
_FORM: Final = struct.Struct(f"<qqB{GID_BYTES}s")  # the byte is the length of what follows
HEADER_BYTES: Final = 4  # of a message: how the rest is encoded
ENCODINGS: Final = (b"\x00\x01", b"\x00\x00")  # its first bytes: CDR, little or big endian


class Attachment(NamedTuple):
    """`number` counts from 1 what `gid`, a publisher or client, has sent; `at_ns` is when it was sent,
    in nanoseconds since the epoch."""

    number: int
    at_ns: int
    gid: bytes


def attachment(number: int, at_ns: int, gid: bytes) -> bytes:
    """33 bytes. ValueError for what a node would not take: numbers below 1, a negative time, a gid of
    another length."""
    if number < 1 or at_ns < 0 or len(gid) != GID_BYTES:
        raise ValueError(f"no attachment has number {number}, time {at_ns} and {len(gid)} bytes of gid")
    return _FORM.pack(number, at_ns, GID_BYTES, gid)


def parse_attachment(data: bytes) -> Attachment | None:
    """The parts; None for what is malformed."""
    if len(data) != _FORM.size:
        return None
    number, at_ns, length, gid = _FORM.unpack(data)
    return Attachment(number, at_ns, gid) if length == GID_BYTES and number >= 0 <= at_ns else None


def gid_of(zid: str, expression: str) -> bytes:
    """The gid of a session's publisher or client on a key expression: no other one has it."""
    return blake2b(f"{zid}/{expression}".encode(), digest_size=GID_BYTES).digest()


def is_whole(payload: bytes) -> bool:
    """Whether a payload begins as CDR does and has something behind its header: a node that reads
    less ends."""
    return len(payload) > HEADER_BYTES and payload[:2] in ENCODINGS


# The liveliness tokens of rmw_zenoh's nodes, publishers, subscribers, services and clients. Pure.
#
# @ros2_lv/<domain>/<zid>/0/0/NN/<enclave>/<namespace>/<node>
# @ros2_lv/<domain>/<zid>/0/<id>/MP/<enclave>/<namespace>/<node>/<name>/<type>/<hash>/<QoS>

TokenKind = Literal["NN", "MP", "MS", "SS", "SC"]  # node, publisher, subscriber, service, client

PREFIX: Final = "@ros2_lv/"
PANEL_NODE: Final = "web_ui"
PARTS: Final = 13  # of a token of an endpoint; that of a node ends with its name
NODE_PARTS: Final = 9
NAME_AT: Final = 9
ACTION_SERVER: Final = "/_action/send_goal"  # the service by which an action is recognised
ACTION_SERVER_TYPE: Final = "_SendGoal"
STATUS_QOS: Final = Qos(transient_local=True, depth=1)  # rcl_action_qos_profile_status_default
_KINDS: Final[dict[str, TokenKind]] = {"NN": "NN", "MP": "MP", "MS": "MS", "SS": "SS", "SC": "SC"}
_ZID = re.compile(r"[0-9a-f]{1,32}")
_NODE = re.compile(r"[A-Za-z0-9_]+")  # a tool's may begin with a digit or "_"
_ID = re.compile(r"\d{1,20}")


class Token(NamedTuple):
    """A token. `node` is like "/arm/driver". Without the parts behind it, it is a node's own; `key` is
    the name without its first slash, `type` "std_msgs/msg/String", or `NO_TYPE`."""

    zid: str
    kind: TokenKind
    node: str
    key: str = ""
    type: str = ""
    type_hash: str = ""
    qos: TokenQos = TokenQos()


def every_token(domain: int) -> str:
    """The key expression of the tokens of a domain."""
    return f"@ros2_lv/{domain}/**"


def every_node(domain: int) -> str:
    """The key expression of the tokens of all nodes of a domain."""
    return f"@ros2_lv/{domain}/*/*/*/NN/**"


def parse_token(token: str) -> Token | None:
    """The parts of a token; None for what is none."""
    parts = token.split("/")
    if len(parts) not in (NODE_PARTS, PARTS) or parts[0] != "@ros2_lv":
        return None
    zid, kind = parts[2], _KINDS.get(parts[5])
    namespace = demangled(parts[7])
    node = f"{namespace}/{parts[8]}"
    well_formed = (
        _ZID.fullmatch(zid) is not None
        and all(map(_ID.fullmatch, (parts[1], parts[3], parts[4])))
        and NAMESPACE.fullmatch(namespace) is not None
        and _NODE.fullmatch(parts[8]) is not None
        and len(node) <= MAX_NAME
    )
    if kind is None or not well_formed or (kind == "NN") is not (len(parts) == NODE_PARTS):
        return None
    if kind == "NN":
        return Token(zid, kind, node)
    name, qos = demangled(parts[NAME_AT]), parse_qos(parts[12])
    if qos is None or not name.startswith("/") or not is_valid_name(name[1:]):
        return None
    return Token(zid, kind, node, name[1:], ros_type(parts[10]), parts[11], qos)


def endpoint_of(token: Token) -> Endpoint | None:
    """What a token means to the panel; None for clients, for the parts of an action and for the node
    of a panel. A node stands for the Zenoh session in which it is."""
    if token.kind == "SC" or is_panel(token):
        return None
    if token.kind == "NN":
        return Endpoint(token.zid, node=token.node)
    hashes = ((token.type, token.type_hash),)
    if token.kind == "SS":
        if "/_action/" not in token.key:
            return Endpoint(token.zid, "SS", token.key, token.type, hashes=hashes, node=token.node)
        if not token.key.endswith(ACTION_SERVER) or not token.type.endswith(ACTION_SERVER_TYPE):
            return None
        key, name = (
            token.key.removesuffix(ACTION_SERVER),
            token.type.removesuffix(ACTION_SERVER_TYPE),
        )
        return Endpoint(token.zid, "AS", key, name, hashes=hashes, node=token.node)
    role: TopicRole = "MP" if token.kind == "MP" else "MS"
    return Endpoint(
        token.zid,
        role,
        token.key,
        token.type,
        token.qos.transient_local,
        token.qos.reliable,
        hashes,
        token.node,
    )


def is_panel(token: Token) -> bool:
    """Whether it is the node of a panel server or of one of its commands."""
    name = token.node.removeprefix("/")
    return token.kind == "NN" and (name == PANEL_NODE or name.startswith(f"{PANEL_NODE}_"))


def free_name(taken: Collection[str]) -> str:
    """The first name for a panel's node that none of these nodes has."""
    number, name = 1, PANEL_NODE
    while f"/{name}" in taken:
        number += 1
        name = f"{PANEL_NODE}_{number}"
    return name


def node_token(domain: int, zid: str, node: str) -> str:
    """The token of a node in the root namespace, or of "/arm/driver" in its own."""
    return f"@ros2_lv/{domain}/{zid}/0/0/NN/{ROOT}/{_place(node)}"


def endpoint_token(
    domain: int,
    zid: str,
    node: str,
    kind: TokenKind,
    key: str,
    type_name: str,
    type_hash: str,
    qos: Qos,
) -> str:
    """The token of a publisher, subscriber, service or client of a node. ValueError for a name or type
    that can't be in a token: nodes read it."""
    if not TOPIC.fullmatch(f"/{key}") or ros_type(dds_type(type_name)) != type_name or not type_hash:
        raise ValueError(f'"{key}" with type "{type_name}" can not be a token')
    number = crc32(f"{kind}/{key}".encode()) & 0x7FFFFFFF
    return (
        f"@ros2_lv/{domain}/{zid}/0/{number}/{kind}/{ROOT}/{_place(node)}"
        f"/{mangled('/' + key)}/{dds_type(type_name)}/{type_hash}/{qos_part(qos)}"
    )


def _place(node: str) -> str:
    """<namespace>/<node>"""
    namespace, _, name = node.rpartition("/")
    if not _NODE.fullmatch(name) or not NAMESPACE.fullmatch(namespace):
        raise ValueError(f'"{node}" can not be a node')
    return f"{mangled(namespace)}/{name}"


def action_parts(own: PanelEndpoint) -> Iterator[PanelEndpoint]:
    """The three services and two topics of an action's client or server, without hashes. Of a client
    they are "SC" and "MS", of a server "SS" and "MP"."""
    types, key = action_types(own.type), own.key
    service: Literal["SC", "SS"] = "SC" if own.role == "AC" else "SS"
    topic: TopicRole = "MS" if own.role == "AC" else "MP"
    yield PanelEndpoint(service, of_action(key, "send_goal"), types.send_goal)
    yield PanelEndpoint(service, of_action(key, "cancel_goal"), types.cancel_goal)
    yield PanelEndpoint(service, of_action(key, "get_result"), types.get_result)
    yield PanelEndpoint(topic, feedback(key), types.feedback_message)
    yield PanelEndpoint(topic, status(key), types.status, STATUS_QOS)


# The dialect of ROS 2 nodes that run on Zenoh themselves (rmw_zenoh_cpp, hiroz): ROS 2 names ↔ Zenoh
# key expressions. No I/O.
#
# Everything that knows rmw_zenoh's key expressions, tokens and attachments is in the modules of this
# name. A topic or service has the key expression `<domain>/<name>/<type>/<hash>`.


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

    def accepts(self, attachment: bytes | None) -> bool:
        """Nodes send none without, and end at one that is not whole."""
        return attachment is not None and parse_attachment(attachment) is not None

    def key_hash(self, type_name: str) -> str:
        known = self.type_hash(type_name)
        return "" if known == ANY_HASH else known

    def own_tokens(self, zid: str, endpoints: Iterable[PanelEndpoint]) -> list[str]:
        """Those of a command's session, whose node ends with it."""
        return self.node_tokens(zid, f"{PANEL_NODE}_{zid[:8]}", endpoints)

    def node_tokens(self, zid: str, node: str, endpoints: Iterable[PanelEndpoint]) -> list[str]:
        """The tokens of a node and of its endpoints: each once."""
        return list(dict.fromkeys(self._node_tokens(zid, node, endpoints)))

    def _node_tokens(self, zid: str, node: str, endpoints: Iterable[PanelEndpoint]) -> Iterator[str]:
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

    def panel_node(self, token: str) -> Endpoint | None:
        parsed = parse_token(token)
        return (
            None if parsed is None or not is_panel(parsed) else Endpoint(parsed.zid, node=parsed.node)
        )

    def name_in(self, token: str) -> str:
        parts = token.split("/", PARTS - 1)
        return parts[NAME_AT].removesuffix(mangled(ACTION_SERVER)) if len(parts) == PARTS else ""

    def in_token(self, key: str) -> str:
        return mangled(f"/{key}")

"""The liveliness tokens of rmw_zenoh's nodes, publishers, subscribers, services and clients. Pure.

@ros2_lv/<domain>/<zid>/0/0/NN/<enclave>/<namespace>/<node>
@ros2_lv/<domain>/<zid>/0/<id>/MP/<enclave>/<namespace>/<node>/<name>/<type>/<hash>/<QoS>
"""

import re
from collections.abc import Iterable, Iterator
from typing import Final, Literal, NamedTuple
from zlib import crc32

from app.dialect.endpoint import Endpoint, OwnEndpoint, TopicRole
from app.dialect.rmw_zenoh_names import (
    ROOT,
    TokenQos,
    dds_type,
    demangled,
    mangled,
    parse_qos,
    qos_part,
    ros_type,
)
from app.interfaces.derived_types import action_types
from app.interfaces.names import (
    MAX_NAME,
    NAMESPACE,
    TOPIC,
    Qos,
    feedback,
    is_valid_name,
    of_action,
    status,
)

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


def free_name(tokens: Iterable[Token]) -> str:
    """The first name for a panel's node that none of these nodes has."""
    taken = {token.node for token in tokens if token.kind == "NN"}
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


def action_parts(own: OwnEndpoint) -> Iterator[OwnEndpoint]:
    """The three services and two topics of an action's client or server, without hashes. Of a client
    they are "SC" and "MS", of a server "SS" and "MP"."""
    types, key = action_types(own.type), own.key
    service: Literal["SC", "SS"] = "SC" if own.role == "AC" else "SS"
    topic: TopicRole = "MS" if own.role == "AC" else "MP"
    yield OwnEndpoint(service, of_action(key, "send_goal"), types.send_goal)
    yield OwnEndpoint(service, of_action(key, "cancel_goal"), types.cancel_goal)
    yield OwnEndpoint(service, of_action(key, "get_result"), types.get_result)
    yield OwnEndpoint(topic, feedback(key), types.feedback_message)
    yield OwnEndpoint(topic, status(key), types.status, STATUS_QOS)

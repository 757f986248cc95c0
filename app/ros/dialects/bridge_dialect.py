"""The dialect of zenoh-bridge-ros2dds: ROS 2 names ↔ Zenoh key expressions. No I/O.

What knows this bridge's key expressions and liveliness tokens is here, and in `bridge_entities.py` its
admin space and the QoS in a token; so a second dialect (rmw_zenoh) stands beside it.
Source: zenoh-plugin-ros2dds 1.10, tried.
"""

import re
from collections.abc import Iterable
from typing import Final

from app.ros.dialects.dialect import Direction, Endpoint, PanelEndpoint, ServerRole, TopicRole
from app.ros.messages.names import (
    ACTION_TYPE,
    MESSAGE_TYPE,
    TOPIC,
    Qos,
    is_valid_name,
    valid_type,
)

TOKENS: Final = "@/*/@ros2_lv/**"  # every liveliness token of every bridge and panel server
EVERY_BRIDGE: Final = "@/*/@ros2_lv"  # those of bridges themselves
VERSION: Final = "@/*/ros2/version"  # answered by a bridge whose main loop runs
ROUTES: Final = "@/*/ros2/route/topic/**"  # a bridge's routes: JSON with `ros2_type`
CONFIG: Final = "@/*/ros2/config"  # a bridge's configuration: JSON with its `namespace`
NODES: Final = "@/*/ros2/node/**"  # the nodes behind a bridge: JSON with their topics and types
_TOKEN = re.compile(
    r"@/(?P<zid>[^/]{1,64})/@ros2_lv"
    r"(?:/(?P<role>MP|MS)/(?P<key>[^/]+)/(?P<type>[^/]+)/"
    r"K?:(?P<reliability>[^:/]*):(?P<durability>[^:/]*):(?P<more>.*)"
    r"|/(?P<server>SS|AS)/(?P<name>[^/]+)/(?P<server_type>[^/]+))?"
)
_HASH = re.compile(r"typehash=(RIHS\d\d_[0-9a-f]{64});")
_ROUTE = re.compile(r"@/(?P<zid>[^/]+)/ros2/route/topic/(?P<direction>pub|sub)/(?P<key>.+)")


def token(zid: str, role: TopicRole, key: str, type_name: str, qos: Qos, type_hash: str) -> str:
    """The liveliness token that makes the bridge create the DDS reader or writer."""
    if not TOPIC.fullmatch("/" + key) or not MESSAGE_TYPE.fullmatch(type_name):
        raise ValueError(f'"{key}" with type "{type_name}" can not be a token')
    flags = f":{int(qos.reliable)}:{int(qos.transient_local)}:0,{qos.depth}"
    return (
        f"@/{zid}/@ros2_lv/{role}/{_escaped(key)}/{_escaped(type_name)}/{flags}:typehash={type_hash};"
    )


def server_token(zid: str, role: ServerRole, key: str, type_name: str) -> str:
    """The token of a service or action server."""
    return f"@/{zid}/@ros2_lv/{role}/{_escaped(key)}/{_escaped(type_name)}"


def action_client_token(zid: str, key: str, type_name: str) -> str:
    """The token of an action client. While it is held, the bridge keeps the route of the action, so
    that feedback arrives once."""
    if not TOPIC.fullmatch("/" + key) or not ACTION_TYPE.fullmatch(type_name):
        raise ValueError(f'"{key}" with type "{type_name}" can not be a token')
    return f"@/{zid}/@ros2_lv/AC/{_escaped(key)}/{_escaped(type_name)}"


def bridge_token(zid: str) -> str:
    """The token of a bridge itself."""
    return f"@/{zid}/@ros2_lv"


def parsed(token_key: str) -> Endpoint | None:
    """The endpoint of a token; None for clients and for what is not a token."""
    match = _TOKEN.fullmatch(token_key)
    if match is None:
        return None
    if match["server"] is not None:
        server: ServerRole = "SS" if match["server"] == "SS" else "AS"
        key, type_name = _unescaped(match["name"]), valid_type(_unescaped(match["server_type"]))
        return Endpoint(match["zid"], server, key, type_name) if is_valid_name(key) else None
    if match["role"] is None:
        return Endpoint(match["zid"])
    role: TopicRole = "MP" if match["role"] == "MP" else "MS"
    key, type_name = _unescaped(match["key"]), valid_type(_unescaped(match["type"]))
    if not is_valid_name(key):
        return None
    reliable = {"0": False, "1": True}.get(match["reliability"])
    type_hash = _HASH.search(match["more"])
    hashes = ((type_name, type_hash[1]),) if type_hash else ()
    return Endpoint(match["zid"], role, key, type_name, match["durability"] == "1", reliable, hashes)


def version(zid: str) -> str:
    """The key expression of one bridge's `VERSION`."""
    return f"@/{zid}/ros2/version"


def config(zid: str) -> str:
    """The key expression of one bridge's `CONFIG`."""
    return f"@/{zid}/ros2/config"


def zid_of(admin_key: str) -> str:
    """The zid of the bridge that gave an answer."""
    return admin_key.split("/")[1]


def route_of(admin_key: str) -> tuple[str, Direction, str] | None:
    """(zid, direction, topic key) of an answer to `ROUTES`."""
    match = _ROUTE.fullmatch(admin_key)
    if match is None:
        return None
    return match["zid"], "pub" if match["direction"] == "pub" else "sub", match["key"]


class BridgeDialect:
    """The `Dialect` of a robot behind zenoh-bridge-ros2dds."""

    tokens: Final = (TOKENS,)
    as_client: Final = False
    keeps_log: Final = False

    def topic(self, key: str, type_name: str) -> str:
        """The key: the bridge publishes a topic on its name."""
        return key

    def service(self, key: str, type_name: str) -> str:
        return key

    def attachment(self, zid: str, expression: str, number: int, at_ns: int) -> bytes | None:
        """The bridge needs none."""
        return None

    def is_whole(self, payload: bytes) -> bool:
        """The bridge reads every payload as one."""
        return True

    def accepts(self, attachment: bytes | None) -> bool:
        """A bridge sends none with messages."""
        return True

    def key_hash(self, type_name: str) -> str:
        return ""

    def own_tokens(self, zid: str, endpoints: Iterable[PanelEndpoint]) -> list[str]:
        """A bridge makes the clients of services by itself."""
        return [token for own in endpoints if (token := _own_token(zid, own))]

    def endpoint(self, token: str) -> Endpoint | None:
        return parsed(token)

    def panel_node(self, token: str) -> Endpoint | None:
        """A panel has no node of its own: the bridge's stands for it."""
        return None

    def name_in(self, token: str) -> str:
        parts = token.split("/", 5)
        return parts[4] if len(parts) > 4 else ""

    def in_token(self, key: str) -> str:
        return _escaped(key)


def _own_token(zid: str, endpoint: PanelEndpoint) -> str:
    if endpoint.role == "AC":
        return action_client_token(zid, endpoint.key, endpoint.type)
    if endpoint.role == "SC":
        return ""
    if endpoint.role == "SS" or endpoint.role == "AS":
        return server_token(zid, endpoint.role, endpoint.key, endpoint.type)
    return token(zid, endpoint.role, endpoint.key, endpoint.type, endpoint.qos, endpoint.type_hash)


def _escaped(name: str) -> str:
    return name.replace("/", "§")


def _unescaped(name: str) -> str:
    return name.replace("§", "/")

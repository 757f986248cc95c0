"""The dialect of zenoh-bridge-ros2dds: ROS 2 names ↔ Zenoh key expressions. No I/O.

Everything that knows this bridge's keys, liveliness tokens and admin space is here, so that a
second dialect (rmw_zenoh) can stand beside it. Source: zenoh-plugin-ros2dds 1.10, tried.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any, Final

from app.dialect.endpoint import Direction, Endpoint, ServerRole, TopicRole
from app.interfaces.names import (
    ACTION_TYPE,
    MAX_NAME,
    MESSAGE_TYPE,
    TOPIC,
    Qos,
    is_valid_name,
    valid_type,
)

TOKENS: Final = "@/*/@ros2_lv/**"  # every liveliness token of every bridge and kiosk
VERSION: Final = "@/*/ros2/version"  # answered by a bridge whose main loop runs
ROUTES: Final = "@/*/ros2/route/topic/**"  # a bridge's routes: JSON with `ros2_type`
CONFIG: Final = "@/*/ros2/config"  # a bridge's configuration: JSON with its `namespace`
NODES: Final = "@/*/ros2/node/**"  # the nodes behind a bridge: JSON with their topics and types
DEMO_VERSION: Final = '"demo robot"'  # how the demo robot answers for its version
_CACHES: Final = "/@adv/pub/"
_TOKEN = re.compile(
    r"@/(?P<zid>[^/]{1,64})/@ros2_lv"
    r"(?:/(?P<role>MP|MS)/(?P<key>[^/]+)/(?P<type>[^/]+)/"
    r"K?:(?P<reliability>[^:/]*):(?P<durability>[^:/]*):.*"
    r"|/(?P<server>SS|AS)/(?P<name>[^/]+)/(?P<server_type>[^/]+))?"
)
_ROUTE = re.compile(r"@/(?P<zid>[^/]+)/ros2/route/topic/(?P<direction>pub|sub)/(?P<key>.+)")


def key_of(topic: str, namespace: str = "") -> str:
    """The key expression of a topic, behind a bridge with this namespace ("" for none)."""
    whole = namespace + topic
    if not TOPIC.fullmatch(whole):
        raise ValueError(f'"{whole}" is not an absolute ROS 2 topic name')
    return whole[1:]


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
    """Keeps the bridge's route of an action for as long as it is held: feedback comes once."""
    if not TOPIC.fullmatch("/" + key) or not ACTION_TYPE.fullmatch(type_name):
        raise ValueError(f'"{key}" with type "{type_name}" can not be a token')
    return f"@/{zid}/@ros2_lv/AC/{_escaped(key)}/{_escaped(type_name)}"


def feedback(action_key: str) -> str:
    """Where an action's feedback comes."""
    return f"{action_key}/_action/feedback"


def status(action_key: str) -> str:
    """Where the states of an action's goals come."""
    return f"{action_key}/_action/status"


def caches(key: str) -> str:
    """The tokens of the caches that publishers of a topic have for subscribers that come late: of
    those that are TRANSIENT_LOCAL. Each answers to a query of its own name (source: zenoh-ext 1.10)."""
    return f"{key}{_CACHES}**"


def topic_of_cache(token_key: str) -> str:
    """The key of the topic that a cache is of."""
    return token_key.partition(_CACHES)[0]


def newest(token_key: str) -> str:
    """The query for the last message of a cache."""
    return f"{token_key}?_max=1"


def bridge_token(zid: str) -> str:
    """The token by which a bridge says that it is there."""
    return f"@/{zid}/@ros2_lv"


def name_in(token_key: str) -> str:
    """The name that a token is about, as `in_token` writes it; "" for a bridge's own token. There may
    be ten thousand tokens: this is what it costs to pass one over."""
    parts = token_key.split("/", 5)
    return parts[4] if len(parts) > 4 else ""


def in_token(key: str) -> str:
    """How a token writes a key expression."""
    return _escaped(key)


def parsed(token_key: str) -> Endpoint | None:
    """What a token shows; None for clients and for what is not a token."""
    found = _TOKEN.fullmatch(token_key)
    if found is None:
        return None
    if found["server"] is not None:
        server: ServerRole = "SS" if found["server"] == "SS" else "AS"
        key, type_name = _unescaped(found["name"]), valid_type(_unescaped(found["server_type"]))
        return Endpoint(found["zid"], server, key, type_name) if is_valid_name(key) else None
    if found["role"] is None:
        return Endpoint(found["zid"])
    role: TopicRole = "MP" if found["role"] == "MP" else "MS"
    key, type_name = _unescaped(found["key"]), valid_type(_unescaped(found["type"]))
    if not is_valid_name(key):
        return None
    reliable = {"0": False, "1": True}.get(found["reliability"])
    return Endpoint(found["zid"], role, key, type_name, found["durability"] == "1", reliable)


def version(zid: str) -> str:
    """Where one bridge answers for `VERSION`."""
    return f"@/{zid}/ros2/version"


def config(zid: str) -> str:
    """Where one bridge answers for `CONFIG`."""
    return f"@/{zid}/ros2/config"


def endpoints_of(admin_key: str, node: Mapping[str, Any], namespace: str) -> Iterator[Endpoint]:
    """The publishers and subscribers of one node, from what its bridge says of it (see `NODES`)."""
    roles: tuple[tuple[TopicRole, str], ...] = (("MP", "publishers"), ("MS", "subscribers"))
    for role, name in roles:
        for topic in node[name]:
            whole = namespace + topic["name"]
            if len(whole) <= MAX_NAME and TOPIC.fullmatch(whole):
                key = key_of(topic["name"], namespace)
                yield Endpoint(zid_of(admin_key), role, key, valid_type(topic["type"]))


def zid_of(admin_key: str) -> str:
    """Whose admin space an answer came from."""
    return admin_key.split("/")[1]


def route_of(admin_key: str) -> tuple[str, Direction, str] | None:
    """(bridge, direction, topic key) of an answer from the admin space."""
    found = _ROUTE.fullmatch(admin_key)
    if found is None:
        return None
    return found["zid"], "pub" if found["direction"] == "pub" else "sub", found["key"]


def _escaped(name: str) -> str:
    return name.replace("/", "§")


def _unescaped(name: str) -> str:
    return name.replace("§", "/")

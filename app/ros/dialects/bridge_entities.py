"""DDS readers and writers, routes and nodes, from the answers of a bridge's admin space. Pure.

Source: zenoh-plugin-ros2dds 1.10.2 (`@/<zid>/ros2/dds|route|node/…`), tried with nodes on Fast DDS and
on Cyclone DDS.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

from app.ros.dialects.dialect import Endpoint, Role
from app.ros.messages.names import is_valid_name, valid_type

DDS: Final = "@/*/ros2/dds/**"  # participants, readers and writers of a robot's nodes, not the bridge's
CALLS: Final[Mapping[str, str]] = {"rq": "Request", "rr": "Reply"}  # the endings of services' topics
ACTION_PART: Final = "/_action/"  # between the name of an action and those of its topics and services
EVERY_ROUTE: Final = "@/*/ros2/route/**"

CYCLONE: Final = "0110"
# How RTPS numbers the vendors of DDS: the first two bytes of a GUID (OMG DDSI-RTPS, vendor ids).
VENDORS: Final[Mapping[str, str]] = {
    "0101": "RTI Connext DDS",
    "0103": "OpenDDS",
    "010f": "Fast DDS",
    CYCLONE: "Cyclone DDS",
    "0111": "GurumDDS",
}
_ENTITY = re.compile(r"@/(?P<zid>[^/]+)/ros2/dds/(?P<participant>[^/]+)/(?P<role>reader|writer)/.+")
_ROUTE = re.compile(
    r"@/(?P<zid>[^/]+)/ros2/route/(?P<kind>topic|service|action)/(?P<direction>pub|sub|srv|cli)"
    r"/(?P<key>.+)"
)
_NODE = re.compile(r"@/(?P<zid>[^/]+)/ros2/node/(?P<participant>[^/]+)/(?P<name>.+)")
_DDS_TYPE = re.compile(r"(?P<package>\w+)::(?P<kind>msg|srv|action)::dds_::(?P<name>\w+)_")
_HASH = re.compile(r"typehash=(RIHS\d\d_[0-9a-f]+)")
_TOKEN_QOS = re.compile(
    r"K?:(?P<reliable>[01]?):(?P<durability>[^:]*):(?:(?P<all>[01]?),?(?P<depth>\d{0,9}))(?::(?P<data>.*))?"
)


_WRITER = re.compile(r"@/([^/]+)/ros2/dds/([^/]+)/writer/([^/]+)/.+")


class Writer(NamedTuple):
    """A DDS writer of a robot's node: its bridge, its participant and its own GUID."""

    zid: str
    participant: str
    guid: str


def writers(zid: str, name: str) -> str:
    """The key expression of a topic's DDS writers, by its name behind a bridge ("/speed")."""
    return f"@/{zid}/ros2/dds/*/writer/*/rt{name}"


def nodes_of(writer: Writer) -> str:
    """The key expression of the nodes in a writer's participant."""
    return f"@/{writer.zid}/ros2/node/{writer.participant}/**"


def writer_place(admin_key: str) -> Writer | None:
    """The writer of an answer to `writers`."""
    match = _WRITER.fullmatch(admin_key)
    return None if match is None else Writer(*match.groups())


@dataclass(frozen=True, slots=True, kw_only=True)
class DdsEntity:
    """A DDS reader or writer of a ROS 2 topic, or of a service's requests or responses if
    `of_service`; `name` is the topic's or the service's on the robot ("/speed")."""

    zid: str
    participant: str
    writer: bool
    name: str
    type: str
    reliable: bool
    transient_local: bool
    keep_all: bool
    depth: int | None
    type_hash: str
    of_service: bool = False

    @property
    def vendor(self) -> str:
        return vendor_of(self.participant)


def vendor_of(guid: str) -> str:
    """The DDS of a participant by its GUID; "" if it is none of the known ones."""
    return VENDORS.get(guid[:4], "")


def entity_of(admin_key: str, answer: Any) -> DdsEntity | None:
    """A reader or writer from an answer to `DDS`; None for participants and for what is not of
    ROS 2."""
    place = _ENTITY.fullmatch(admin_key)
    if place is None or not isinstance(answer, dict):
        return None
    topic, dds_type = answer.get("topic_name"), _DDS_TYPE.fullmatch(str(answer.get("type_name")))
    if not isinstance(topic, str) or dds_type is None:
        return None
    prefix, _, rest = topic.partition("/")
    ending = CALLS.get(prefix, "")
    if (not ending and prefix != "rt") or not rest.endswith(ending):
        return None
    if not is_valid_name(rest.removesuffix(ending)):
        return None
    qos = answer["qos"] if isinstance(answer.get("qos"), dict) else {}
    writer = place["role"] == "writer"
    return DdsEntity(
        zid=place["zid"],
        participant=place["participant"],
        writer=writer,
        name=f"/{rest.removesuffix(ending)}",
        type=valid_type("/".join(dds_type.group("package", "kind", "name"))),
        # Left out where it is DDS's default, which differs between readers and writers.
        reliable=_kind(qos, "reliability", "RELIABLE" if writer else "BEST_EFFORT") == "RELIABLE",
        transient_local=_kind(qos, "durability", "VOLATILE") != "VOLATILE",
        keep_all=_kind(qos, "history", "KEEP_LAST") == "KEEP_ALL",
        depth=_depth(qos, place["participant"]),
        type_hash=_type_hash(qos.get("user_data")),
        of_service=bool(ending),
    )


def _kind(qos: Mapping[str, Any], policy: str, default: str) -> str:
    setting = qos.get(policy)
    return str(setting.get("kind", default)) if isinstance(setting, dict) else default


def _depth(qos: Mapping[str, Any], participant: str) -> int | None:
    """Cyclone DDS leaves out the default of 1; Fast DDS does not announce its depth at all."""
    history = qos.get("history")
    if isinstance(history, dict) and isinstance(history.get("depth"), int):
        return int(history["depth"])
    return 1 if history is None and participant.startswith(CYCLONE) else None


def _type_hash(user_data: Any) -> str:
    try:
        text = bytes(user_data).decode("utf-8", "replace")
    except (TypeError, ValueError):
        return ""
    match = _HASH.search(text)
    return match[1] if match else ""


def of_participant(zid: str, participant: str) -> str:
    """The key expression of a participant's readers and writers."""
    return f"@/{zid}/ros2/dds/{participant}/**"


@dataclass(frozen=True, slots=True)
class TokenQos:
    """The QoS in a liveliness token of a publisher or subscriber; None: not in the token."""

    reliable: bool | None
    transient_local: bool
    keep_all: bool
    depth: int | None
    type_hash: str


def qos_of(token: str) -> TokenQos:
    """The QoS at the end of a token of a topic; all unknown for a malformed one."""
    match = _TOKEN_QOS.fullmatch(token.rpartition("/")[2])
    if match is None:
        return TokenQos(None, False, False, None, "")
    type_hash = _HASH.search(match["data"] or "")
    return TokenQos(
        {"0": False, "1": True}.get(match["reliable"]),
        match["durability"] == "1",
        match["all"] == "1",
        int(match["depth"]) if match["depth"] else None,
        type_hash[1] if type_hash else "",
    )


def route_place(admin_key: str) -> tuple[str, str, str, str] | None:
    """(bridge, kind, direction, key) of an answer to `EVERY_ROUTE`."""
    match = _ROUTE.fullmatch(admin_key)
    return None if match is None else (match["zid"], match["kind"], match["direction"], match["key"])


def node_place(admin_key: str) -> tuple[str, str, str] | None:
    """(bridge, participant, node name like "/arm/driver") of an answer for a node."""
    match = _NODE.fullmatch(admin_key)
    if match is None or not is_valid_name(match["name"]):
        return None
    return match["zid"], match["participant"], f"/{match['name']}"


def names_of(answer: Mapping[str, Any], part: str) -> Iterator[tuple[str, str]]:
    """(name, type) of each entry of a node's list, such as its "publishers"; malformed ones are left
    out."""
    listed = answer.get(part)
    for entry in listed if isinstance(listed, list) else ():
        name = str(entry.get("name")) if isinstance(entry, dict) else ""
        if name.startswith("/") and is_valid_name(name[1:]):
            yield name, valid_type(str(entry.get("type")))


# The lists of an answer for a node, by the roles of what is in them.
NODE_PARTS: Final[Mapping[Role, str]] = {
    "MP": "publishers",
    "MS": "subscribers",
    "SS": "service_servers",
    "AS": "action_servers",
}


def node_endpoints(admin_key: str, answer: Mapping[str, Any], namespace: str) -> Iterator[Endpoint]:
    """The publishers, subscribers and servers of one node, without QoS and hashes. `namespace` is its
    bridge's. Nothing for a malformed answer."""
    place = node_place(admin_key)
    if place is None:
        return
    zid, participant, node = place
    for role, part in NODE_PARTS.items():
        for name, type_name in names_of(answer, part):
            key = f"{namespace}{name}"[1:]
            if is_valid_name(key):
                yield Endpoint(zid, role, key, type_name, node=node, dds=vendor_of(participant))


def with_entities(endpoint: Endpoint, name: str, entities: Iterable[DdsEntity]) -> Endpoint:
    """An endpoint of a node with its QoS and hashes, from the readers and writers of the node's
    participant. `name` is the endpoint's on the robot."""
    own = [entity for entity in entities if _is_part(entity, endpoint.role, name)]
    hashes = tuple(dict.fromkeys((entity.type, entity.type_hash) for entity in own if entity.type_hash))
    if not own or endpoint.role in ("SS", "AS"):
        return replace(endpoint, hashes=hashes)
    return replace(
        endpoint,
        hashes=hashes,
        reliable=all(entity.reliable for entity in own),
        transient_local=all(entity.transient_local for entity in own),
    )


def _is_part(entity: DdsEntity, role: Role | None, name: str) -> bool:
    if role == "AS":
        return entity.name.startswith(f"{name}{ACTION_PART}")
    if role == "SS":
        return entity.of_service and entity.name == name
    return not entity.of_service and entity.name == name and entity.writer is (role == "MP")

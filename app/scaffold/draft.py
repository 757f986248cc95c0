"""A draft of a panel from a robot's graph: what is shown on which page, and what acts on it."""

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from app.errors import InterfaceError
from app.graph.model import Server, Topic
from app.graph.node_services import NodeParameter
from app.interfaces import Interfaces
from app.interfaces.names import GLOBAL
from app.scaffold import controls
from app.scaffold.displays import JOINTS, NODES_PAGE, displays
from app.scaffold.entry import Draft, Entry, InterlockCandidate
from app.scaffold.naming import GENERAL, NEGATIVE, id_of, permits

BOOL: Final = "std_msgs/msg/Bool"
LEFT_OUT: Final = frozenset(
    ("/parameter_events", "/clock", "/tf", "/tf_static", "/robot_description", "/diagnostics_agg")
)
# Services that each node has, by the last part of their names (rcl_interfaces and others).
SERVICES_OF_EVERY_NODE: Final = frozenset(
    (
        *("describe_parameters", "get_parameters", "get_parameter_types", "list_parameters"),
        *("set_parameters", "set_parameters_atomically", "get_type_description"),
        *("get_logger_levels", "set_logger_levels"),
    )
)
MOST_PENS: Final = 4
MOST_PAGES: Final = 8
TREND_GAP_S: Final = 5  # the max_age_s of a trend that has none
TREND_KEYS: Final = ("topic", "type", "qos", "field", "label", "unit", "scale", "format")


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """What was read of a robot: names without the panel's namespace. `samples` is a message of a topic,
    by its name, where one arrived; `periods` are seconds between messages of one that is published
    regularly. `unreadable` are nodes whose parameters can't be read. `denied` are the names of topics
    that the bridge's file holds back, `lost` those of topics and services that the bridge has lost."""

    topics: Sequence[Topic] = ()
    services: Sequence[Server] = ()
    actions: Sequence[Server] = ()
    parameters: Sequence[NodeParameter] = ()
    samples: Mapping[str, Any] = field(default_factory=dict)
    periods: Mapping[str, float] = field(default_factory=dict)
    unreadable: Sequence[str] = ()
    denied: Collection[str] = ()
    lost: Collection[str] = ()


def shown(topics: Iterable[Topic]) -> Iterator[Topic]:
    """The topics that a panel may have: not ROS's own, not hidden ones, none that is held back."""
    return (topic for topic in topics if topic.announced and _is_public(topic))


def _is_public(topic: Topic) -> bool:
    return _is_public_name(topic.name)


def _is_public_name(name: str) -> bool:
    own = name[1:] if name.startswith(GLOBAL) else name
    return own not in LEFT_OUT and "/_" not in own


def lost_names(known: Known) -> list[str]:
    """What a panel may have and the bridge has lost."""
    return [name for name in known.lost if _is_public_name(name) and not _is_of_every_node(name)]


def _is_of_every_node(service: str) -> bool:
    return service.rpartition("/")[2] in SERVICES_OF_EVERY_NODE


def make_draft(
    known: Known, interfaces: Interfaces, base: Draft, left_out: Mapping[tuple[str, str], str]
) -> Draft:
    """`base` with pages, interlock candidates and remarks, without the parts `left_out`: see
    `checked_draft`."""
    interlocks = [one for one in _interlocks(known.topics) if ("interlock", one.topic) not in left_out]
    entries: list[Entry] = []
    remarks: list[str] = []
    for topic in shown(known.topics):
        try:
            _check(topic, interfaces)
            found = _of_topic(topic, interfaces, known)
        except InterfaceError as error:
            remarks.append(f"{topic.name}: {error}")
            continue
        entries += found
        if not found:
            remarks.append(_why_not(topic))
    remarks += [f"{name}: {DENIED}" for name in known.denied if _is_public_name(name)]
    remarks += [f"{name}: {LOST}" for name in lost_names(known)]
    for server in (*known.services, *known.actions):
        entries += _of_server(server, interfaces, remarks)
    for one in known.parameters:
        entries += controls.parameter(one)
    remarks += [f"parameters of {node}: {CYCLONE_ONLY}" for node in known.unreadable]
    remarks += [f"{name} ({kind}): {why}" for (kind, name), why in left_out.items()]
    entries = [one for one in entries if (one.kind, one.name) not in left_out]
    return replace(base, interlocks=interlocks, pages=_pages(entries), remarks=remarks)


DENIED: Final = "`allow` or `deny` in the bridge's configuration holds it back"
LOST: Final = "the bridge does not forward it: restart its node, or else the bridge"
CYCLONE_ONLY: Final = "the bridge reaches services on Cyclone DDS only (RMW_IMPLEMENTATION)"


def _check(topic: Topic, interfaces: Interfaces) -> None:
    if len(topic.types) > 1:
        raise InterfaceError(f"it has several types: {', '.join(topic.types)}")
    interfaces.require(topic.type)
    hashes = {one.type_hash for one in (*topic.publishers, *topic.subscribers)} - {""}
    if hashes and interfaces.type_hash(topic.type) not in hashes:
        raise InterfaceError(
            f"the robot's {topic.type} has another definition than the one known here: give its package"
            " with --interfaces, or the robot's --distro"
        )


def _of_topic(topic: Topic, interfaces: Interfaces, known: Known) -> list[Entry]:
    if topic.publishers:
        sample, period_s = known.samples.get(topic.name), known.periods.get(topic.name)
        return list(displays(topic, interfaces, sample, period_s))
    return list(controls.publishers(topic, interfaces))


def _why_not(topic: Topic) -> str:
    if topic.type == JOINTS:
        return f"{topic.name}: no message arrived that names its joints"
    return f"{topic.name} ({topic.type})"


def _of_server(server: Server, interfaces: Interfaces, remarks: list[str]) -> list[Entry]:
    make = controls.goals if "/action/" in server.type else controls.calls
    try:
        found = list(make(server, interfaces))
    except InterfaceError as error:
        remarks.append(f"{server.name}: {error}")
        return []
    if not server.can_be_called and found:
        remarks.append(f"{server.name} ({server.type}), on {server.dds}: {CYCLONE_ONLY}")
        return []
    if not found and not server.type.startswith(controls.OF_EVERY_NODE):
        remarks.append(f"{server.name} ({server.type}): give its request")
    return found


def _interlocks(topics: Iterable[Topic]) -> Iterator[InterlockCandidate]:
    """Bools that look like permissions: those whose name permits first, of these the latched ones."""
    candidates = [
        topic
        for topic in shown(topics)
        if topic.publishers and topic.types == (BOOL,) and topic.reliable and _may_permit(topic)
    ]
    taken: set[str] = set()
    by_name = sorted(candidates, key=lambda one: (not permits(one.name), not one.latched, one.name))
    for topic in by_name:
        own_id = id_of(topic.name, taken)
        taken.add(own_id)
        yield InterlockCandidate(
            id=own_id, topic=topic.name, type=topic.type, kept=topic.latched, nodes=_several(topic)
        )


def _several(topic: Topic) -> str:
    """The names of the nodes if a topic has several publishers; "" if it has one."""
    if max(Counter(one.bridge for one in topic.publishers).values()) == 1:
        return ""
    return ", ".join(sorted({node for one in topic.publishers for node in one.nodes})) or "?"


def _may_permit(topic: Topic) -> bool:
    """A latched bool is a state that other nodes act on. That of a fault permits nothing."""
    return permits(topic.name) or (topic.latched and not NEGATIVE.search(topic.name))


def _pages(entries: Sequence[Entry]) -> dict[str, list[Entry]]:
    """Page → widgets, displays first, then their trend, then controls. Pages of one widget, and those
    beyond `MOST_PAGES`, are put together."""
    sizes = Counter(one.page for one in entries)
    kept = {page for page, count in sizes.most_common(MOST_PAGES) if count > 1} | {NODES_PAGE}
    found: defaultdict[str, list[Entry]] = defaultdict(list)
    for one in entries:
        found[one.page if one.page in kept else GENERAL].append(one)
    ordered = sorted(found, key=lambda page: (page == NODES_PAGE, page))
    return {page: _ordered(found[page], page) for page in ordered} or {GENERAL: []}


CONTROLS_ONLY: Final = "The controls of this page are in the panel file, commented out"
ORDER: Final = ("indicator", "gauge", "readout", "joints", "camera", "table", "log")


def _ordered(entries: Sequence[Entry], page: str) -> list[Entry]:
    shown = [one for one in entries if not one.control]
    shown.sort(key=lambda one: (ORDER.index(one.kind), one.name))
    if not shown:
        keys = {"label": CONTROLS_ONLY, "size": "small", "span": 12}
        shown = [Entry(kind="label", name=f"{page}/note", page=page, keys=keys)]
    acting = sorted((one for one in entries if one.control), key=lambda one: (one.kind, one.name))
    return [*shown, *_trend(shown, page), *acting]


def _trend(entries: Sequence[Entry], page: str) -> Iterator[Entry]:
    """A trend of the gauges of the unit that most of them have."""
    gauges = [one for one in entries if one.kind == "gauge"]
    units = Counter(one.keys.get("unit", "") for one in gauges)
    same = [one for one in gauges if one.keys.get("unit", "") == max(units, key=units.__getitem__)]
    pens = [{k: one.keys[k] for k in TREND_KEYS if k in one.keys} for one in same[:MOST_PENS]]
    if pens:
        keys = {"label": "Trend", "window": "5m", "keep": "8h", "pen": pens, "span": 12}
        longest = max(one.keys.get("max_age_s", 0) for one in same[:MOST_PENS])
        keys |= {"max_age_s": longest} if longest > TREND_GAP_S else {}
        comment = "Its history is kept in memory; disk = true keeps it over a restart."
        yield Entry(kind="trend", name=f"{page}/trend", page=page, keys=keys, comment=comment)

"""A draft of a panel from a robot's graph: what is shown on which page, and what acts on it."""

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from typing import Any, Final

from app.ros.graph.model import Server, SurveyedTopic
from app.ros.graph.node_services import NodeParameter
from app.ros.messages import Interfaces
from app.ros.messages.names import GLOBAL
from app.system.errors import InterfaceError
from app.tools.scaffold import widgets
from app.tools.scaffold.mobile import (
    MAP_PAGE,
    OF_NAV2,
    is_internal,
    map_widgets,
    of_map,
    on_map_page,
)
from app.tools.scaffold.parts import GENERAL, OF_NAMES, Draft, DraftWidget, Omission, with_own_labels
from app.tools.scaffold.widgets import (
    NODES_PAGE,
    diagnostic_alarms,
    displays,
    interlock_candidates,
    interlock_for,
)

# The pages of a draft: by namespace or node, none with more widgets than a screen has room for.

MOST_WIDGETS: Final = 16  # four rows of gauges, which 1280x800 has above a trend
MOST_PAGES: Final = 8  # tabs on that screen
MOST_PENS: Final = 4
TREND_GAP_S: Final = 5  # the max_age_s of a trend that has none
TREND_KEYS: Final = ("topic", "type", "qos", "field", "label", "unit", "scale", "format")
CONTROLS_ONLY: Final = "The controls of this page are in the panel file, commented out"
ORDER: Final = ("map", "indicator", "gauge", "readout", "joints", "camera", "table", "log")
OWN_PAGES: Final = (MAP_PAGE, NODES_PAGE)  # they are never left out
Place = tuple[str, ...]


def make_pages(
    entries: Sequence[DraftWidget], live: bool
) -> tuple[dict[str, Sequence[DraftWidget]], list[DraftWidget]]:
    """Page → widgets, and the widgets beyond the most pages. Displays come first, then their trend,
    then controls; `live`: controls take room too, as they are not comments."""
    arranged = (_arranged(entries, own, live) for own in range(MOST_PAGES, -1, -1))
    pages: dict[str, list[DraftWidget]] = {}
    for pages in arranged:
        if len(pages) <= MOST_PAGES:
            break
    fullest = sorted(pages, key=lambda page: (page not in OWN_PAGES, -len(pages[page])))[:MOST_PAGES]
    rest = [entry for page, part in pages.items() if page not in fullest for entry in part]
    kept: dict[str, Sequence[DraftWidget]] = {
        page: _whole(page, part) for page, part in pages.items() if page in fullest
    }
    return kept or {GENERAL: []}, rest


def _arranged(entries: Sequence[DraftWidget], own: int, live: bool) -> dict[str, list[DraftWidget]]:
    """The entries by the titles of pages: the `own` largest places have pages of their own."""
    pages: dict[str, list[DraftWidget]] = {}
    by_place = _by_place(entries, own)
    for place in sorted(by_place, key=_page_order):
        is_general = place == (GENERAL,)
        for part in _parts(by_place[place], 0 if is_general else 1, live):
            title = " ".join(place if is_general else _common(part))
            taken = sum(page == title or page.rpartition(" ")[0] == title for page in pages)
            pages[f"{title} {taken + 1}" if title in pages else title] = part
    return pages


def _page_order(place: Place) -> tuple[bool, bool, Place]:
    """The map comes first, the nodes last."""
    return place != (MAP_PAGE,), place == (NODES_PAGE,), place


def _by_place(entries: Sequence[DraftWidget], own: int) -> dict[Place, list[DraftWidget]]:
    """The entries by the first part of their places. Small places are put together."""
    sizes = Counter(entry.place[:1] for entry in entries)
    kept = {place for place, size in sizes.most_common(own) if size > 1}
    kept |= {(NODES_PAGE,), (MAP_PAGE,)}
    by_place: defaultdict[Place, list[DraftWidget]] = defaultdict(list)
    for entry in entries:
        place = entry.place[:1]
        by_place[place if place in kept else (GENERAL,)].append(entry)
    return by_place


def _parts(entries: Sequence[DraftWidget], depth: int, live: bool) -> list[list[DraftWidget]]:
    """The entries in parts with at most `MOST_WIDGETS`, those of one place together where they fit."""
    if _room(entries, live) <= MOST_WIDGETS:
        return [_in_order(entries)]
    if all(len(entry.place) <= depth for entry in entries):
        return _cut(entries, live)
    by_place: defaultdict[Place, list[DraftWidget]] = defaultdict(list)
    for entry in entries:
        by_place[entry.place[: depth + 1]].append(entry)
    parts: list[list[DraftWidget]] = []
    for place in sorted(by_place):
        for part in _parts(by_place[place], depth + 1, live):
            if parts and _room([*parts[-1], *part], live) <= MOST_WIDGETS:
                parts[-1] = _in_order([*parts[-1], *part])
            else:
                parts.append(part)
    return parts


def _room(entries: Sequence[DraftWidget], live: bool) -> int:
    return sum(live or not entry.control for entry in entries)


def _cut(entries: Sequence[DraftWidget], live: bool) -> list[list[DraftWidget]]:
    counted = [entry for entry in _in_order(entries) if live or not entry.control]
    comments = [entry for entry in _in_order(entries) if entry.control and not live]
    first, *others = (counted[n : n + MOST_WIDGETS] for n in range(0, len(counted), MOST_WIDGETS))
    return [[*first, *comments], *others]


def _in_order(entries: Sequence[DraftWidget]) -> list[DraftWidget]:
    shown = [entry for entry in entries if not entry.control]
    shown.sort(key=lambda entry: (ORDER.index(entry.kind), entry.name))
    controls = (entry for entry in entries if entry.control)
    acting = sorted(controls, key=lambda entry: (entry.kind, entry.name))
    return [*shown, *acting]


def _common(entries: Sequence[DraftWidget]) -> Place:
    """The first parts of the places that all have."""
    places = zip(*(entry.place for entry in entries), strict=False)
    return tuple(parts[0] for parts in takewhile(lambda parts: len({*parts}) == 1, places))


def _whole(page: str, entries: Sequence[DraftWidget]) -> list[DraftWidget]:
    shown = with_own_labels([entry for entry in entries if not entry.control])
    if not shown:
        keys = {"label": CONTROLS_ONLY, "size": "small", "span": 12}
        shown = [DraftWidget(kind="label", name=f"{page}/note", keys=keys)]
    return [*shown, *_trend(shown, page), *(entry for entry in entries if entry.control)]


def _trend(entries: Sequence[DraftWidget], page: str) -> Iterator[DraftWidget]:
    """A trend of the gauges of the unit that most of them have."""
    gauges = [entry for entry in entries if entry.kind == "gauge"]
    units = Counter(gauge.keys.get("unit", "") for gauge in gauges)
    same = [
        gauge for gauge in gauges if gauge.keys.get("unit", "") == max(units, key=units.__getitem__)
    ]
    pens = [{k: gauge.keys[k] for k in TREND_KEYS if k in gauge.keys} for gauge in same[:MOST_PENS]]
    if pens and page != MAP_PAGE:
        keys = {"label": "Trend", "window": "5m", "keep": "8h", "pen": pens, "span": 12}
        longest = max(gauge.keys.get("max_age_s", 0) for gauge in same[:MOST_PENS])
        keys |= {"max_age_s": longest} if longest > TREND_GAP_S else {}
        comment = "Its history is kept in memory; disk = true keeps it over a restart."
        yield DraftWidget(kind="trend", name=f"{page}/trend", keys=keys, comment=comment)


LEFT_OUT: Final = frozenset(("/parameter_events", "/clock", *OF_NAMES))
# Services that each node has, by the last part of their names (rcl_interfaces and others).
SERVICES_OF_EVERY_NODE: Final = frozenset(
    (
        *("describe_parameters", "get_parameters", "get_parameter_types", "list_parameters"),
        *("set_parameters", "set_parameters_atomically", "get_type_description"),
        *("get_logger_levels", "set_logger_levels"),
    )
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """What was read of a robot: names without the panel's namespace. `samples` is a message of a topic,
    by its name, where one arrived; `periods` are seconds between messages of one that is published
    regularly. `unreadable` are nodes whose parameters can't be read. `denied` are the names of topics
    that the bridge's file holds back, `lost` those of topics and services that the bridge has lost.
    `has_dds_qos`: a subscriber receives only what is published with a compatible QoS."""

    topics: Sequence[SurveyedTopic] = ()
    services: Sequence[Server] = ()
    actions: Sequence[Server] = ()
    parameters: Sequence[NodeParameter] = ()
    samples: Mapping[str, Any] = field(default_factory=dict)
    periods: Mapping[str, float] = field(default_factory=dict)
    unreadable: Sequence[str] = ()
    denied: Collection[str] = ()
    lost: Collection[str] = ()
    has_dds_qos: bool = True


def public_topics(topics: Iterable[SurveyedTopic]) -> Iterator[SurveyedTopic]:
    """The topics that a panel may have: not ROS's own, not hidden ones, none that is held back."""
    return (topic for topic in topics if topic.announced and _is_public(topic))


def _is_public(topic: SurveyedTopic) -> bool:
    return _is_public_name(topic.name)


def _is_public_name(name: str) -> bool:
    own = _own_name(name)
    return own not in LEFT_OUT and "/_" not in own


def _own_name(name: str) -> str:
    return name[1:] if name.startswith(GLOBAL) else name


def lost_names(known: Known) -> list[str]:
    """What a panel may have and the bridge has lost."""
    return [name for name in known.lost if _is_public_name(name) and not _is_of_every_node(name)]


def _is_of_every_node(service: str) -> bool:
    return service.rpartition("/")[2] in SERVICES_OF_EVERY_NODE


def make_draft(
    known: Known,
    interfaces: Interfaces,
    base: Draft,
    live: bool,
    left_out: Mapping[tuple[str, str], str],
) -> Draft:
    """`base` with pages, interlock candidates and remarks, without the parts `left_out`: see
    `checked_draft`. `live`: controls are no comments."""
    candidates = interlock_candidates(public_topics(known.topics))
    interlocks = [
        candidate for candidate in candidates if ("interlock", candidate.topic) not in left_out
    ]
    alarms = [
        row
        for row in diagnostic_alarms(public_topics(known.topics))
        if ("alarm", row.topic) not in left_out
    ]
    entries: list[DraftWidget] = []
    remarks: list[str] = []
    announced = [topic for topic in known.topics if topic.announced]
    mapped = of_map(announced)
    for topic in (topic for topic in announced if topic.name not in mapped):
        for item in _of_topic(topic, interfaces, known):
            if isinstance(item, DraftWidget):
                entries.append(item)
            else:
                remarks.append(f"{item.name}: {item.why}")
    entries += map_widgets(announced)
    remarks += [f"{name}: {DENIED}" for name in known.denied if _is_public_name(name)]
    remarks += [f"{name}: {LOST}" for name in lost_names(known)]
    for server in (*known.services, *known.actions):
        entries += _of_server(server, interfaces, remarks)
    for parameter in known.parameters:
        entries += widgets.parameter(parameter)
    remarks += [f"parameters of {node}: {CYCLONE_ONLY}" for node in known.unreadable]
    remarks += [f"{name} ({kind}): {why}" for (kind, name), why in left_out.items()]
    entries = [entry for entry in on_map_page(entries) if (entry.kind, entry.name) not in left_out]
    acting = [
        replace(label, interlock=interlock_for(label, interlocks))
        for label in with_own_labels([entry for entry in entries if entry.control])
    ]
    pages, rest = make_pages([*(entry for entry in entries if not entry.control), *acting], live)
    remarks += [f"{name}: {NO_ROOM}" for name in dict.fromkeys(entry.name for entry in rest)]
    return replace(base, interlocks=interlocks, alarms=alarms, pages=pages, remarks=remarks)


NO_ROOM: Final = f"the panel has {MOST_PAGES} pages; --namespace makes one of a part of the robot"
DENIED: Final = "`allow` or `deny` in the bridge's configuration holds it back"
LOST: Final = "the bridge does not forward it: restart its node, or else the bridge"
CYCLONE_ONLY: Final = "the bridge reaches services on Cyclone DDS only (RMW_IMPLEMENTATION)"


def _check(topic: SurveyedTopic, interfaces: Interfaces) -> None:
    if len(topic.types) > 1:
        raise InterfaceError(f"it has several types: {', '.join(topic.types)}")
    interfaces.require(topic.type)
    hashes = {endpoint.type_hash for endpoint in (*topic.publishers, *topic.subscribers)} - {""}
    if hashes and interfaces.type_hash(topic.type) not in hashes:
        raise InterfaceError(
            f"the robot's {topic.type} has another definition than the one known here: give its package"
            " with --interfaces, or the robot's --distro"
        )


def _of_topic(
    topic: SurveyedTopic, interfaces: Interfaces, known: Known
) -> Iterator[DraftWidget | Omission]:
    """The widgets of a topic, or why it has none. A hidden one, and one of ROS's own, has neither."""
    if not _is_public(topic):
        if why := OF_NAMES.get(_own_name(topic.name)):
            yield Omission(topic.name, why)
        return
    try:
        _check(topic, interfaces)
        if topic.publishers:
            sample, period_s = known.samples.get(topic.name), known.periods.get(topic.name)
            yield from displays(topic, interfaces, sample, period_s)
        else:
            yield from widgets.publishers(topic, interfaces, known.has_dds_qos)
    except InterfaceError as error:
        yield Omission(topic.name, str(error))


def _of_server(server: Server, interfaces: Interfaces, remarks: list[str]) -> list[DraftWidget]:
    if is_internal(server):
        remarks.append(f"{server.name} ({server.type}): {OF_NAV2}")
        return []
    make = widgets.goals if "/action/" in server.type else widgets.calls
    try:
        drafts = list(make(server, interfaces))
    except InterfaceError as error:
        remarks.append(f"{server.name}: {error}")
        return []
    if not server.can_be_called and drafts:
        remarks.append(f"{server.name} ({server.type}), on {server.dds}: {CYCLONE_ONLY}")
        return []
    if not drafts and not server.type.startswith(widgets.OF_EVERY_NODE):
        remarks.append(f"{server.name} ({server.type}): give its request")
    return drafts

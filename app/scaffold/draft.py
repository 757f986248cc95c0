"""A draft of a panel from a robot's graph: what is shown on which page, and what acts on it."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from app.errors import InterfaceError
from app.interfaces import Interfaces
from app.interfaces.names import GLOBAL
from app.scaffold import controls
from app.scaffold.displays import diagnostic_alarms, displays
from app.scaffold.draft_parts import Draft, DraftWidget, Omission
from app.scaffold.interlocks import interlock_candidates, interlock_for
from app.scaffold.labels import with_own_labels
from app.scaffold.pages import MOST_PAGES, make_pages
from app.scaffold.reasons import OF_NAMES
from app.survey.model import Server, SurveyedTopic
from app.survey.node_services import NodeParameter

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
    that the bridge's file holds back, `lost` those of topics and services that the bridge has lost."""

    topics: Sequence[SurveyedTopic] = ()
    services: Sequence[Server] = ()
    actions: Sequence[Server] = ()
    parameters: Sequence[NodeParameter] = ()
    samples: Mapping[str, Any] = field(default_factory=dict)
    periods: Mapping[str, float] = field(default_factory=dict)
    unreadable: Sequence[str] = ()
    denied: Collection[str] = ()
    lost: Collection[str] = ()


def shown(topics: Iterable[SurveyedTopic]) -> Iterator[SurveyedTopic]:
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
    candidates = interlock_candidates(shown(known.topics))
    interlocks = [
        candidate for candidate in candidates if ("interlock", candidate.topic) not in left_out
    ]
    alarms = [
        row for row in diagnostic_alarms(shown(known.topics)) if ("alarm", row.topic) not in left_out
    ]
    entries: list[DraftWidget] = []
    remarks: list[str] = []
    for topic in (topic for topic in known.topics if topic.announced):
        for item in _of_topic(topic, interfaces, known):
            if isinstance(item, DraftWidget):
                entries.append(item)
            else:
                remarks.append(f"{item.name}: {item.why}")
    remarks += [f"{name}: {DENIED}" for name in known.denied if _is_public_name(name)]
    remarks += [f"{name}: {LOST}" for name in lost_names(known)]
    for server in (*known.services, *known.actions):
        entries += _of_server(server, interfaces, remarks)
    for parameter in known.parameters:
        entries += controls.parameter(parameter)
    remarks += [f"parameters of {node}: {CYCLONE_ONLY}" for node in known.unreadable]
    remarks += [f"{name} ({kind}): {why}" for (kind, name), why in left_out.items()]
    entries = [entry for entry in entries if (entry.kind, entry.name) not in left_out]
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
            yield from controls.publishers(topic, interfaces)
    except InterfaceError as error:
        yield Omission(topic.name, str(error))


def _of_server(server: Server, interfaces: Interfaces, remarks: list[str]) -> list[DraftWidget]:
    make = controls.goals if "/action/" in server.type else controls.calls
    try:
        drafts = list(make(server, interfaces))
    except InterfaceError as error:
        remarks.append(f"{server.name}: {error}")
        return []
    if not server.can_be_called and drafts:
        remarks.append(f"{server.name} ({server.type}), on {server.dds}: {CYCLONE_ONLY}")
        return []
    if not drafts and not server.type.startswith(controls.OF_EVERY_NODE):
        remarks.append(f"{server.name} ({server.type}): give its request")
    return drafts

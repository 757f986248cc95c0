"""The widgets of a draft: those that show a topic, those that act on the robot, and the interlocks that
lock them."""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import takewhile
from math import ceil, degrees, pi
from textwrap import shorten
from typing import Any, Final

from app.ros.dialects.dialect import within
from app.ros.graph.model import Server, SurveyedTopic
from app.ros.graph.node_services import NodeParameter
from app.ros.messages import Interfaces
from app.ros.messages.definitions import FLOAT_TYPES
from app.tools.scaffold.mobile import nav2_goal
from app.tools.scaffold.parts import (
    NEGATIVE,
    NO_JOINTS,
    NO_MESSAGE,
    NUMBERS,
    DiagnosticAlarms,
    DraftWidget,
    FieldCandidate,
    InterlockCandidate,
    Omission,
    id_of,
    label_of,
    own_labels,
    permits,
    place_of,
    range_for,
    shown_fields,
    too_long,
    why_no_display,
    words_of,
)

# The widgets that show a topic.

JOINTS: Final = "sensor_msgs/msg/JointState"
DIAGNOSTICS: Final = "diagnostic_msgs/msg/DiagnosticArray"
DIAGNOSTICS_TOPIC: Final = "/diagnostics"
AGGREGATED: Final = "_agg"  # ends the topic of an aggregator, which repeats the statuses of others
LOG: Final = "rcl_interfaces/msg/Log"
PICTURES: Final = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
MAX_JOINTS: Final = 24
LONGEST_TEXT: Final = 500  # characters of a readout
NODES_PAGE: Final = "nodes"
LEAST_AGE_S: Final = 2
Place = tuple[str, ...]
MISSED: Final = 5  # messages, until a value looks old


def displays(
    topic: SurveyedTopic, interfaces: Interfaces, sample: Any = None, period_s: float | None = None
) -> Iterator[DraftWidget | Omission]:
    """The widgets of a topic that the robot publishes, or why it has none. `sample` is one of its
    messages, or None; `period_s` are the seconds between two, None if it is not published regularly."""
    nodes = {node for publisher in topic.publishers for node in publisher.nodes}
    about = {"topic": topic.name, "type": topic.type, **_qos(topic), **_max_age(topic, period_s)}
    place = place_of(topic.name, nodes)
    label = label_of(topic.name)
    match topic.type:
        case t if t in PICTURES:
            keys = {"label": label, "topic": topic.name, "type": topic.type, "span": 6}
            yield DraftWidget(kind="camera", name=topic.name, place=place, keys=keys)
        case t if t == JOINTS:
            yield from _joints(topic, label, place, about, sample)
        case t if t == DIAGNOSTICS:
            yield _diagnostics(topic, label, about)
        case t if t == LOG:
            keys = {"label": "Log of the nodes", "topic": topic.name}
            yield DraftWidget(kind="log", name=topic.name, place=(NODES_PAGE,), keys=keys)
        case _:
            fields = list(shown_fields(topic.type, interfaces))
            for shown in fields:
                yield _field(topic, place, about, shown, _value(sample, shown.field))
            if not fields:
                why = why_no_display(topic.type, interfaces)
                yield Omission(f"{topic.name} ({topic.type})", why)


def diagnostic_alarms(topics: Iterable[SurveyedTopic]) -> Iterator[DiagnosticAlarms]:
    """The alarms of the topics with diagnostics, without those that repeat others."""
    for topic in topics:
        aggregated = topic.name.endswith(AGGREGATED)
        if topic.type != DIAGNOSTICS or not topic.publishers or aggregated:
            continue
        named = {} if topic.name == DIAGNOSTICS_TOPIC else {"topic": topic.name}
        yield DiagnosticAlarms(topic=topic.name, keys={"diagnostics": "*", **named, **_qos(topic)})


def _qos(topic: SurveyedTopic) -> dict[str, Any]:
    """Reliable is the panel's default; a best-effort publisher does not match it."""
    return {} if topic.reliable else {"qos": {"reliability": "best_effort"}}


def _max_age(topic: SurveyedTopic, period_s: float | None) -> dict[str, Any]:
    """A value that is not refreshed any more looks old. A latched one stays valid."""
    if period_s is None or topic.latched:
        return {}
    return {"max_age_s": max(LEAST_AGE_S, ceil(MISSED * period_s))}


def _value(sample: Any, path: str) -> Any:
    value = sample
    for name in path.split("."):
        value = getattr(value, name, None)
    return value


def _field(
    topic: SurveyedTopic, place: Place, about: Mapping[str, Any], shown: FieldCandidate, value: Any
) -> DraftWidget | Omission:
    label = " ".join(filter(None, (label_of(topic.name), shown.word)))
    name = topic.name if not shown.word else f"{topic.name}/{shown.field.replace('.', '_')}"
    field = {} if shown.field == "data" else {"field": shown.field}
    keys: dict[str, Any] = {"label": label, **about, **field}
    if shown.kind == "bool":
        return _lamp(name, place, keys, label)
    if shown.constants:
        return _lamps(name, place, keys, shown.constants)
    if isinstance(value, str) and len(value) > LONGEST_TEXT:
        return Omission(name, too_long(len(value)))
    if shown.kind not in NUMBERS:
        return DraftWidget(kind="readout", name=name, place=place, keys={**keys, "span": 6})
    keys |= {"unit": shown.unit} if shown.unit else {}
    keys |= {"scale": shown.scale} if shown.scale != 1.0 else {}
    keys |= {"format": shown.format} if shown.format else {}
    if shown.low is None and shown.unit:
        return DraftWidget(kind="readout", name=name, place=place, keys={**keys, "span": 3})
    seen = float(value) * shown.scale if isinstance(value, int | float) else None
    ends = range_for(shown, (shown.field, topic.name), seen)
    if ends is None:
        return DraftWidget(kind="readout", name=name, place=place, keys={**keys, "span": 3})
    low, high = ends
    comment = "" if shown.low is not None else "The ends of the scale are a guess."
    keys |= {"min": _whole(low), "max": _whole(high), "span": 3}
    return DraftWidget(kind="gauge", name=name, place=place, keys=keys, comment=comment)


def _whole(value: float) -> float:
    return int(value) if float(value).is_integer() else value


def _lamp(name: str, place: Place, keys: dict[str, Any], label: str) -> DraftWidget:
    """A lamp; that of a fault is red where it is on."""
    on, off = {"value": True, "text": "On"}, {"value": False, "text": "Off"}
    if NEGATIVE.search(name):
        on |= {"text": label, "shape": "cross", "colour": "red"}
        off |= {"text": f"No {label.lower()}", "shape": "circle", "colour": "white"}
    else:
        on |= {"shape": "circle"}
        off |= {"shape": "cross", "colour": "white"}
    keys["states"] = [on, off]
    return DraftWidget(kind="indicator", name=name, place=place, keys={**keys, "span": 3})


def _lamps(name: str, place: Place, keys: dict[str, Any], constants: Sequence[str]) -> DraftWidget:
    """A lamp with a state for each constant; that of a fault is red."""
    begins = zip(*(constant.split("_")[:-1] for constant in constants), strict=False)
    begin = "".join(f"{words[0]}_" for words in takewhile(lambda words: len({*words}) == 1, begins))
    texts = own_labels(
        [(label_of(constant.removeprefix(begin).lower()), constant) for constant in constants]
    )
    states = [
        {"value": value, "text": text, "shape": "circle"}
        | ({"shape": "cross", "colour": "red"} if NEGATIVE.search(value) else {})
        for value, text in zip(constants, texts, strict=True)
    ]
    return DraftWidget(
        kind="indicator", name=name, place=place, keys={**keys, "states": states, "span": 3}
    )


def _joints(
    topic: SurveyedTopic, label: str, place: Place, about: Mapping[str, Any], sample: Any
) -> Iterator[DraftWidget | Omission]:
    names = [] if sample is None else list(sample.name)[:MAX_JOINTS]
    positions = [] if sample is None else list(sample.position)
    joints = [_joint(name, at) for name, at in zip(names, positions, strict=False) if name]
    if not joints or len({joint["name"] for joint in joints}) < len(joints):
        yield Omission(topic.name, NO_JOINTS)
    else:
        keys = {"label": label, **about, "joint": joints, "span": 6}
        yield DraftWidget(
            kind="joints",
            name=topic.name,
            place=place,
            keys=keys,
            comment='Give each joint its own limits: see its data sheet. Linear axes have unit = "mm".',
        )


def _joint(name: str, position: float) -> dict[str, Any]:
    turns = max(1, ceil(abs(position) / pi)) if abs(position) < 100 else 1
    end = round(degrees(pi)) * turns
    return {"name": name, "label": label_of(name), "min": -end, "max": end}


def _diagnostics(topic: SurveyedTopic, label: str, about: Mapping[str, Any]) -> DraftWidget:
    levels = (
        ("OK", "OK", "circle", ""),
        ("WARN", "Warning", "triangle", "yellow"),
        ("ERROR", "Error", "cross", "red"),
        ("STALE", "Stale", "bar", "yellow"),
    )
    states = [
        {"value": value, "text": text, "shape": shape, **({"colour": colour} if colour else {})}
        for value, text, shape, colour in levels
    ]
    keys = {
        "label": label,
        **about,
        "field": "status",
        "key": "name",
        "sort": {"first": "largest", "by": "level"},
        "rows_shown": 5,
        "column": [
            {"label": "Level", "field": "level", "width": 2, "states": states},
            {"label": "Part", "field": "name", "width": 3},
            {"label": "Message", "field": "message", "width": 4},
        ],
    }
    return DraftWidget(
        kind="table",
        name=topic.name,
        place=(NODES_PAGE,),
        keys=keys,
        comment="The worst parts come first.",
    )


# The widgets that act on the robot: keys for topics, services and actions, and parameters.

TWISTS: Final = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")
OF_EVERY_NODE: Final = (
    "rcl_interfaces/srv/",
    "type_description_interfaces/srv/",
    "logging_demo/srv/",
    "composition_interfaces/srv/",
    "lifecycle_msgs/srv/",
)
PARAMETER_TYPES: Final = ("bool", "integer", "double", "string")
MAX_COMMENT: Final = 200  # characters of a value, and of a description
LATCHED: Final = (
    "A node that starts later gets the last message too: its subscriber is transient local."
)
ROLES: Final = {"start": "start", "stop": "stop", "reset": "reset"}


def publishers(
    topic: SurveyedTopic, interfaces: Interfaces, has_dds_qos: bool
) -> Iterator[DraftWidget | Omission]:
    """Keys that publish on a topic that the robot listens to. `has_dds_qos`: with a QoS that its
    subscribers receive."""
    nodes = {node for subscriber in topic.subscribers for node in subscriber.nodes}
    about: dict[str, Any] = {"label": label_of(topic.name), "topic": topic.name, "type": topic.type}
    if has_dds_qos and all(subscriber.qos.transient_local for subscriber in topic.subscribers):
        about["qos"] = {"durability": "transient_local"}
    if topic.type in TWISTS:
        keys = {**about, "span": 6}
        yield _control("joystick", topic.name, nodes, keys, "Moves the robot while it is held.")
        return
    message = _message(topic.type, interfaces)
    if message is None:
        yield Omission(f"{topic.name} ({topic.type})", NO_MESSAGE)
        return
    keys = {**about, "message": message, **_role(topic.name)}
    comment = LATCHED if "qos" in about else ""
    yield _control("publish", topic.name, nodes, keys, comment)


def _message(type_name: str, interfaces: Interfaces) -> dict[str, Any] | None:
    """What a key of a type with one plain field sends; None for a type that needs thought."""
    fields = interfaces.structures[type_name].fields
    if not fields:
        return {}
    (field, *more) = fields
    if more or field.type.is_nested or field.type.container != "one":
        return None
    if field.type.name in NUMBERS:
        return {field.name: 0.0 if field.type.name in FLOAT_TYPES else 0}
    return {field.name: True if field.type.name == "bool" else "text"}


def calls(service: Server, interfaces: Interfaces) -> Iterator[DraftWidget]:
    """Keys that call a service whose request is empty or one bool."""
    if service.type.startswith(OF_EVERY_NODE):
        return
    request, _ = interfaces.service_types(service.type)
    fields = interfaces.structures[request].fields
    about = {"service": service.name, "type": service.type}
    label = label_of(service.name)
    if not fields:
        keys = {"label": label, **about, **_role(service.name)}
        yield _control("call", service.name, service.nodes, keys)
    elif [str(field.type) for field in fields] == ["bool"]:
        for value, word in ((True, "on"), (False, "off")):
            labelled: dict[str, Any] = {
                "label": f"{label} {word}",
                **about,
                "request": {fields[0].name: value},
            }
            yield _control("call", service.name, service.nodes, labelled, id_word=word)


def goals(action: Server, interfaces: Interfaces) -> Iterator[DraftWidget]:
    """A key that sends a goal with default values."""
    keys: dict[str, Any] = {"label": label_of(action.name)}
    keys |= {"action": action.name, "type": action.type}
    if (of_nav2 := nav2_goal(action, interfaces)) is not None:
        keys, comment = {**keys, **of_nav2[0]}, of_nav2[1]
    else:
        fields = interfaces.structures[interfaces.action_types(action.type).goal].fields
        plain = {field.name: field.default_value for field in fields if not field.type.is_nested}
        keys, comment = {**keys, "goal": plain}, "Fill in the goal." if fields else ""
    yield _control("action", action.name, action.nodes, keys, comment)


def parameter(declared: NodeParameter) -> Iterator[DraftWidget]:
    """An entry for a parameter that can be set."""
    kind = declared.type.removesuffix("[]")
    hidden = declared.name.startswith("qos_overrides.") or declared.name == "use_sim_time"
    if kind not in PARAMETER_TYPES or declared.read_only or hidden:
        return
    labelled: dict[str, Any] = {
        "label": label_of("/" + declared.name.replace(".", "/")),
        "node": declared.node,
        "parameter": declared.name,
        "type": declared.type,
        "span": 6,
    }
    now = shorten(repr(declared.value), MAX_COMMENT, placeholder=" …")
    about = shorten(declared.description, MAX_COMMENT, placeholder=" …")
    comment = f"Now {now}. {about}".strip() if declared.value is not None else ""
    yield _control("parameter", f"{declared.node}/{declared.name}", (declared.node,), labelled, comment)


def _role(name: str) -> Mapping[str, str]:
    last = words_of(name.rpartition("/")[2])
    return next(({"role": ROLES[word]} for word in last if word in ROLES), {})


def _control(
    kind: str,
    name: str,
    nodes: Collection[str],
    keys: Mapping[str, Any],
    comment: str = "",
    id_word: str = "",
) -> DraftWidget:
    own_name = f"{name}/{id_word}" if id_word else name
    scope = name.rpartition("/")[0]
    return DraftWidget(
        kind=kind,
        name=own_name,
        keys=keys,
        comment=comment,
        control=True,
        place=place_of(name, nodes),
        scope=f"/{scope.strip('/')}" if scope.strip("/") else "",
        nodes=tuple(sorted(nodes)),
    )


# Which topics may permit what the robot does, and which of them a control depends on. Pure.

BOOL: Final = "std_msgs/msg/Bool"


def interlock_candidates(topics: Iterable[SurveyedTopic]) -> list[InterlockCandidate]:
    """Bools that look like permissions: those whose name permits first, of these the latched ones."""
    likely = [
        topic
        for topic in topics
        if topic.publishers and topic.types == (BOOL,) and topic.reliable and _may_permit(topic)
    ]
    likely.sort(
        key=lambda candidate: (not permits(candidate.name), not candidate.latched, candidate.name)
    )
    labels = own_labels([(label_of(topic.name), topic.name) for topic in likely])
    taken: set[str] = set()
    candidates = []
    for topic, label in zip(likely, labels, strict=True):
        own_id = id_of(topic.name, taken)
        taken.add(own_id)
        candidates.append(
            InterlockCandidate(
                id=own_id,
                label=label.lower(),
                topic=topic.name,
                type=topic.type,
                is_latched=topic.latched,
                owners=tuple(node for publisher in topic.publishers for node in publisher.nodes),
                nodes=_several(topic),
            )
        )
    return candidates


def _several(topic: SurveyedTopic) -> str:
    """The names of the nodes if a topic has several publishers; "" if it has one."""
    if max(Counter(publisher.bridge for publisher in topic.publishers).values()) == 1:
        return ""
    return (
        ", ".join(sorted({node for publisher in topic.publishers for node in publisher.nodes})) or "?"
    )


def _may_permit(topic: SurveyedTopic) -> bool:
    """A latched bool is a state that other nodes act on. That of a fault permits nothing."""
    return permits(topic.name) or (topic.latched and not NEGATIVE.search(topic.name))


def interlock_for(control: DraftWidget, candidates: Sequence[InterlockCandidate]) -> str:
    """The id of the candidate for a control; "" for none. It is that of the nearest namespace around
    the control, there of the control's own node if there is one: the permission of another arm says
    nothing of this one. A control without a namespace may depend on those of a single namespace."""
    around = [candidate for candidate in candidates if within(control.scope, _namespace(candidate))]
    if around:
        depth = max(len(_namespace(candidate)) for candidate in around)
        nearest = [candidate for candidate in around if len(_namespace(candidate)) == depth]
        own = [candidate for candidate in nearest if {*candidate.owners} & {*control.nodes}]
        return (own or nearest)[0].id
    if not control.scope and len({_namespace(candidate) for candidate in candidates}) == 1:
        return candidates[0].id
    return ""


def _namespace(candidate: InterlockCandidate) -> str:
    return candidate.topic.rpartition("/")[0]

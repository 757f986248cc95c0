"""The widgets that show a topic."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import takewhile
from math import ceil, degrees, pi
from typing import Any, Final

from app.interfaces import Interfaces
from app.scaffold.draft_parts import DiagnosticAlarms, DraftWidget, Omission
from app.scaffold.fields import NUMBERS, Shown, range_for, shown_fields
from app.scaffold.labels import own_labels
from app.scaffold.naming import NEGATIVE, label_of, place_of
from app.scaffold.reasons import NO_JOINTS, too_long, why_no_display
from app.survey.model import SurveyedTopic

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
    topic: SurveyedTopic, place: Place, about: Mapping[str, Any], shown: Shown, value: Any
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

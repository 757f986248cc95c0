"""What a parameter shows: its value and how sure that is, what may be set: pure."""

import math
from typing import Any, Final

from app.cell.permission.verdict import parameters_offered
from app.cell.robot.parameter_state import (
    MAX_LIST_LENGTH,
    UNKNOWN,
    ParameterState,
    allowed_range,
    limits_text,
)
from app.cell.robot.state import RobotState
from app.cell.view.displays import LONGEST_TEXT, NOTHING, written
from app.panel.numbers import decimal_text
from app.panel.widgets.parameter import EVENT_TYPE, EVENTS, MAX_TEXT, Parameter, Scalar, Value
from app.system.clock import format_time
from app.system.printable import readable
from app.system.texts import Text, TextLike, say
from app.system.texts.text import numbers

# How each state looks: as those of a readout.
LOOKS: Final = {
    "waiting": "waiting",
    "live": "live",
    "cut": "old",
    "silent": "old",
    "missing": "missing",
    "undeclared": "missing",
    "mistyped": "unreadable",
    "unreadable": "unreadable",
}
LONGEST_HINT: Final = 200
ANY_STEP: Final = {False: "any", True: "1"}


def parameter(parameter: Parameter, robot: RobotState) -> dict[str, Any]:
    """Attributes: `state`, `text`, `note`, `hint`, `limits`, `settable`, `askable` (whether its node
    can be asked now), and of the input `entry` (the value to start from) and `bounds` (`min`, `max` and
    `step` as HTML has them)."""
    known = robot.parameters.get(parameter.id, UNKNOWN)
    limits = allowed_range(parameter, known)
    return {
        "state": "waiting" if never_received(known) else LOOKS[known.state],
        "text": NOTHING if known.value is None else _text(parameter, known.value),
        "note": _note(parameter, known, robot),
        "hint": readable(known.hint[:LONGEST_HINT])[:LONGEST_HINT],
        "limits": limits_text(parameter, limits),
        "settable": not known.read_only,
        "askable": parameter.id not in robot.querying
        and parameters_offered(parameter.node, robot) is None,
        "entry": _entry(parameter, known.value),
        "bounds": {
            "min": "" if limits.low is None else decimal_text(limits.low),
            "max": "" if limits.high is None else decimal_text(limits.high),
            "step": ANY_STEP[parameter.element_type == "integer"]
            if limits.step is None
            else decimal_text(limits.step),
        },
    }


def _text(parameter: Parameter, value: Value) -> TextLike:
    option = parameter.find_option(value)
    if option is None and value and isinstance(value, tuple) and parameter.has_numbers:
        return _numbers_text(parameter, value)
    text = parameter.unlisted_text(_beginning(value)) if option is None else option.label
    return text if isinstance(text, Text) else written(text)


def _numbers_text(parameter: Parameter, value: tuple[Scalar, ...]) -> Text:
    """As many numbers of a list as a readout can show."""
    texts: list[str] = []
    length = 0
    for text in map(parameter.element_text, value):
        length += len(text) + len(", ")
        if length > LONGEST_TEXT:
            return numbers([*texts, "…"], parameter.unit)
        texts.append(text)
    return numbers(texts, parameter.unit)


def _beginning(value: Value) -> Value:
    """The whole value, or as much of it as has more characters than are ever shown or entered: it is
    written again with every change, and a robot's texts may have megabytes."""
    if isinstance(value, str):
        return value[: MAX_TEXT + 1]
    if not isinstance(value, tuple):
        return value
    elements: list[Scalar] = []
    size = 0
    for element in value:
        elements.append(element[: MAX_TEXT + 1] if isinstance(element, str) else element)
        size += len(element) if isinstance(element, str) else 1
        if size > MAX_TEXT:
            break
    return tuple(elements)


def never_received(known: ParameterState) -> bool:
    return known.state in ("waiting", "silent") and known.value is None


def _note(parameter: Parameter, known: ParameterState, robot: RobotState) -> TextLike:
    time = format_time(known.wall)
    mismatch = parameters_offered(parameter.node, robot)
    never_queried = (robot.traits.sentences.uncallable, "topic_definition_differs")
    if mismatch is not None and mismatch.code in never_queried:
        return mismatch.reason or ""
    if never_received(known):
        silent = known.state == "silent" and parameter.id not in robot.querying
        return say(
            "parameter_no_response" if silent else "parameter_waiting_for_node", node=parameter.node
        )
    match known.state:
        case "cut":
            return say("parameter_read_before_disconnect", time=time)
        case "silent":
            return say("parameter_no_response_since", time=time)
        case "missing":
            return say("parameter_declared_without_value")
        case "undeclared":
            return say("parameter_not_declared", node=parameter.node)
        case "mistyped":
            name, robot_type = parameter.parameter, known.robot_type
            return say(
                "parameter_mistyped",
                name=name,
                node=parameter.node,
                found=robot_type,
                wanted=parameter.type,
            )
        case "unreadable":
            return say("parameter_unreadable", node=parameter.node, name=parameter.parameter)
    reports = reports_changes(robot)
    return say(
        "parameter_read" if reports else "parameter_read_without_events", time=time, node=parameter.node
    )


def reports_changes(robot: RobotState) -> bool:
    """Whether the panel receives changes by other clients, according to the graph."""
    key, graph = robot.key(EVENTS), robot.graph
    heard = graph.has_endpoint("MP", key) and not graph.is_unrouted(key)
    return heard and graph.mismatched_type("MS", key, EVENT_TYPE) is None


def _entry(parameter: Parameter, value: Value | None) -> bool | TextLike:
    """What the input starts from, exactly; "" where it can't hold the value as it is."""
    if parameter.options and value is not None:
        return "" if (option := parameter.find_option(value)) is None else option.key
    several = value if isinstance(value, tuple) else (value,)
    unusual = any(isinstance(element, float) and not math.isfinite(element) for element in several)
    if value is None or unusual or len(several) > MAX_LIST_LENGTH:
        return ""
    if isinstance(value, bool):
        return value
    text = parameter.entry_text(_beginning(value), clear=True)
    if isinstance(value, str | tuple):
        shown = str(text)
        return text if len(shown) <= MAX_TEXT and shown.isprintable() else ""
    return text

"""What a parameter shows: its value and how sure that is, what may be set: pure."""

import math
from typing import Any, Final

from app.clock import format_time
from app.i18n import Text, TextLike, say
from app.panel.number_range import decimal
from app.panel.widgets.parameter import EVENT_TYPE, EVENTS, LONGEST_TEXT, One, Parameter, Value
from app.permission.interlocks import parameters_offered
from app.printable import printable
from app.robot.parameter_state import LONGEST_LIST, UNKNOWN, ParameterState, allowed, limits_text
from app.robot.state import RobotState
from app.view.display_values import NOTHING, written

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


def parameter(of: Parameter, robot: RobotState) -> dict[str, Any]:
    """Attributes: `state`, `text`, `note`, `hint`, `limits`, `settable`, `askable` (whether its node
    can be asked now), and of the input `entry` (the value to start from) and `bounds` (`min`, `max` and
    `step` as HTML has them)."""
    known = robot.parameters.get(of.id, UNKNOWN)
    limits = allowed(of, known)
    return {
        "state": "waiting" if never_told(known) else LOOKS[known.state],
        "text": NOTHING if known.value is None else _text(of, known.value),
        "note": _note(of, known, robot),
        "hint": printable(known.hint[:LONGEST_HINT])[:LONGEST_HINT],
        "limits": limits_text(of, limits),
        "settable": not known.read_only,
        "askable": of.id not in robot.asking and parameters_offered(of.node, robot) is None,
        "entry": _entry(of, known.value),
        "bounds": {
            "min": "" if limits.low is None else decimal(limits.low),
            "max": "" if limits.high is None else decimal(limits.high),
            "step": ANY_STEP[of.element == "integer"] if limits.step is None else decimal(limits.step),
        },
    }


def _text(of: Parameter, value: Value) -> TextLike:
    option = of.option(value)
    text = of.unchosen(_beginning(value)) if option is None else option.label
    return text if isinstance(text, Text) else written(text)


def _beginning(value: Value) -> Value:
    """The whole value, or as much of it as has more characters than are ever shown or entered: it is
    written anew with every change, and a robot's texts may have megabytes."""
    if isinstance(value, str):
        return value[: LONGEST_TEXT + 1]
    if not isinstance(value, tuple):
        return value
    found: list[One] = []
    size = 0
    for one in value:
        found.append(one[: LONGEST_TEXT + 1] if isinstance(one, str) else one)
        size += len(one) if isinstance(one, str) else 1
        if size > LONGEST_TEXT:
            break
    return tuple(found)


def never_told(known: ParameterState) -> bool:
    return known.state in ("waiting", "silent") and known.value is None


def _note(of: Parameter, known: ParameterState, robot: RobotState) -> Text:
    time = format_time(known.wall)
    if never_told(known):
        silent = known.state == "silent" and of.id not in robot.asking
        return say("parameter_unanswered" if silent else "parameter_asking", node=of.node)
    match known.state:
        case "cut":
            return say("parameter_cut", time=time)
        case "silent":
            return say("parameter_no_answer", time=time)
        case "missing":
            return say("parameter_no_value")
        case "undeclared":
            return say("parameter_not_there", node=of.node)
        case "mistyped":
            name, found = of.parameter, known.found
            return say("parameter_mistyped", name=name, node=of.node, found=found, wanted=of.type)
        case "unreadable":
            return say("parameter_unreadable", node=of.node, name=of.parameter)
    told = tells(robot)
    return say("parameter_read" if told else "parameter_told", time=time, node=of.node)


def tells(robot: RobotState) -> bool:
    """Whether changes that others make are heard, by what the graph shows."""
    key, graph = robot.key(EVENTS), robot.graph
    heard = graph.on_robot("MP", key) and not graph.unheard(key)
    return heard and graph.wrong_type("MS", key, EVENT_TYPE) is None


def _entry(of: Parameter, value: Value | None) -> bool | str:
    """What the input starts from, exactly; "" where it can't hold the value as it is."""
    if of.options and value is not None:
        return "" if (option := of.option(value)) is None else option.key
    several = value if isinstance(value, tuple) else (value,)
    unusual = any(isinstance(one, float) and not math.isfinite(one) for one in several)
    if value is None or unusual or len(several) > LONGEST_LIST:
        return ""
    if isinstance(value, str | tuple):
        text = of.entered(_beginning(value))
        return text if len(text) <= LONGEST_TEXT and text.isprintable() else ""
    return value if isinstance(value, bool) else decimal(value)

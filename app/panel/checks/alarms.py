"""Checks of alarms: their sources, limits and fields, and the controls that they lock."""

import itertools
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, Final

from app.panel.alarm import (
    DIAGNOSTIC_ARRAY,
    EVERY_ROBOT,
    LIMIT_KEYS,
    Alarm,
    AlarmList,
    InhibitedName,
    SourceKind,
    inhibited_name,
)
from app.panel.checks.conditions import condition_faults
from app.panel.checks.types import entry_faults, field_faults, number_faults, type_fault
from app.panel.fault_catalogue import CatalogueError, read_catalogue
from app.panel.file.wording import closest_name, known_hint, list_names, no_such
from app.panel.model import Panel
from app.panel.robot_panels import widget_robots
from app.panel.rules import OeeRules, StateRules
from app.panel.shared_keys import number_key_faults
from app.panel.template import input_ids
from app.panel.values import number_text, same_value
from app.panel.widgets.displays import picture_faults
from app.panel.widgets.publish import Publish
from app.panel.widgets.service_action import Call
from app.ros.messages import Interfaces, has_key
from app.ros.messages.validation import format_value
from app.system.errors import Fault, InterfaceError

# Checks of `inhibits`: the controls that an alarm locks, and the robots that they are of.


def inhibit_faults(
    place: str, alarm: Alarm, panel: Panel, controls: Collection[str]
) -> Iterator[Fault]:
    """Faults of names of no control, of a stop button, and of robots that do not have the control.
    `controls` are the ids of all."""
    stops = {widget.id for widget in panel.stops}
    for i, written in enumerate(alarm.inhibits):
        at, name = f"{place}.inhibits[{i}]", inhibited_name(written)
        if name.control not in controls:
            message = no_such("control", name.control, controls)
            yield Fault(at, message, cause=f"control {name.control}")
        elif name.control in stops:
            yield Fault(at, f'"{name.control}" stops the machine: an alarm may not lock it')
        elif name.robot:
            yield from _robot_faults(at, name, panel)


def _robot_faults(at: str, name: InhibitedName, panel: Panel) -> Iterator[Fault]:
    robots = [str(robot.id) for robot in panel.robots]
    control, own = name.control, widget_robots(panel).get(name.control)
    if not robots:
        message = f'this panel has one robot, without an id: write "{control}"'
        yield Fault(at, message, cause=f"robot {name.robot}")
    elif len({*robots}) < len(robots):
        return  # one of them has another id
    elif name.robot != EVERY_ROBOT and name.robot not in robots:
        near = closest_name(name.robot, robots)
        hint = f'did you mean "{near}/{control}"?' if near else f"there is {list_names(robots)}"
        yield Fault(at, f'no robot "{name.robot}"; {hint}', cause=f"robot {name.robot}")
    elif own in robots and name.robot != own:
        message = f'"{control}" is a control of "{own}" alone: write "{control}" or "{own}/{control}"'
        yield Fault(at, message)


# Checks of alarms: one source each, with the keys, fields and limits that it needs.

RESERVED: Final = "panel_"  # begins the ids of the panel's own alarms
NO_SOURCE: Final = (
    "has no source: give it topic, type and a limit (low_low, low, high, high_high), or [alarm.when], "
    "stale_s, node, lost, diagnostics or [alarm.list]"
)
TOPIC: Final = ("topic", "type", "qos")
# The keys that only some sources read.
OWN_KEYS: Final[Mapping[SourceKind, tuple[str, ...]]] = {
    "limits": (
        *(*TOPIC, "field", "unit", "scale", "offset", "format", "max_age_s"),
        *("deadband", "critical_priority"),
        *LIMIT_KEYS,
    ),
    "condition": ("when",),
    "stale": (*TOPIC, "stale_s"),
    "node": ("node",),
    "lost": ("lost",),
    "diagnostics": (*TOPIC, "diagnostics", "max_age_s", "critical_priority"),
    "list": (*TOPIC, "listed", "max_age_s"),
}
KEYS: Final = frozenset(key for keys in OWN_KEYS.values() for key in keys)


def alarm_faults(panel: Panel, interfaces: Interfaces, faulty: Collection[str]) -> Iterator[Fault]:
    """The faults of all alarms. `faulty` are the ids of widgets whose faults are reported already."""
    commands = [*(widget.id for widget in panel.commands), *faulty]
    for i, alarm in enumerate(panel.alarms):
        place = f"alarm[{i}]"
        if alarm.id.startswith(RESERVED):
            message = f'ids that begin with "{RESERVED}" are those of the panel\'s own alarms'
            yield Fault(f"{place}.id", f"{message}: choose another id")
        yield from inhibit_faults(place, alarm, panel, commands)
        yield from _state_faults(place, alarm, panel)
        yield from _command_faults(place, alarm, panel, faulty)
        for key, condition in (("when", alarm.when), ("while", alarm.suppressed_while)):
            if condition is not None:
                yield from condition_faults(f"{place}.{key}", condition, interfaces)
        yield from picture_faults(f"{place}.picture", alarm.picture, panel.shown_pictures)
        yield from _source_faults(place, alarm, interfaces, panel.language)


def _state_faults(place: str, alarm: Alarm, panel: Panel) -> Iterator[Fault]:
    """The state that it shows is one of `[state]`."""
    if alarm.state is None:
        return
    if panel.state is None:
        message, cause = "is a state of the header: the panel has no [state]", f"state {alarm.state}"
        yield Fault(f"{place}.state", message, cause=cause)
    else:
        yield from _unknown_state(f"{place}.state", alarm.state, panel.state)


def _unknown_state(place: str, value: bool | int | str, rules: StateRules) -> Iterator[Fault]:
    """A value that is none of the states of `[state]`."""
    known = [state.value for state in rules.states]
    if not any(same_value(value, state) for state in known):
        hint = known_hint(str(value), map(str, known))
        yield Fault(place, f"no state {format_value(value)}; {hint}", cause=f"state {value}")


def stop_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of the keys of `[state]` that say what a stop is, and what follows from one."""
    if panel.state is None:
        return
    for n, value in enumerate(panel.state.stops or ()):
        yield from _unknown_state(f"state.stops[{n}]", value, panel.state)
    known = [*(each.id for each in panel.named_conditions), *(each.id for each in panel.alarms)]
    for n, name in enumerate(panel.state.effects):
        if name not in known:
            message = f'no interlock, condition or alarm "{name}"; {known_hint(name, known)}'
            yield Fault(f"state.effects[{n}]", message, cause=f"interlock {name}")


def oee_faults(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    """Faults of `[oee]`: what it counts is there, and is not said twice."""
    rules = panel.oee
    if rules is None:
        return
    if panel.state is None:
        yield Fault("oee", "counts the times of states: the panel has no [state]", cause="state oee")
    else:
        yield from _running_faults(rules, panel.state)
    for n, reason in enumerate(rules.reasons):
        if reason.id in [other.id for other in rules.reasons[:n]]:
            yield Fault(f"oee.reason[{n}].id", f'"{reason.id}" is already the id of a reason')
    if rules.reasons and not panel.log.enabled:
        message = "is kept in the operator's log: leave out enabled = false in [log]"
        yield Fault("oee.reason", message)
    for n, counter in enumerate(rules.counters):
        at = f"oee.counter[{n}]"
        yield from number_faults(at, counter.type, counter.field, "a counter", interfaces)
        if counter.parts in [other.parts for other in rules.counters[:n]]:
            yield Fault(f"{at}.parts", f'there is already a counter of "{counter.parts}"')
    if rules.ideal_cycle_s is not None and not rules.counters:
        message = "needs a count of parts: add a [[oee.counter]] with parts, topic and type"
        yield Fault("oee.ideal_cycle_s", message)


def _running_faults(rules: OeeRules, state: StateRules) -> Iterator[Fault]:
    """States with which the machine produces, and has not stopped."""
    for n, value in enumerate(rules.running or ()):
        yield from _unknown_state(f"oee.running[{n}]", value, state)
        if any(same_value(value, stop) for stop in state.stop_values):
            message = f"{format_value(value)} is a stop of [state]: a machine that stopped does not run"
            yield Fault(f"oee.running[{n}]", message)
    if not rules.running_values(state):
        message = 'no state has the shape "play": name those that produce, such as running = ["AUTO"]'
        yield Fault("oee" if rules.running is None else "oee.running", message)


def _command_faults(place: str, alarm: Alarm, panel: Panel, faulty: Collection[str]) -> Iterator[Fault]:
    """What is pressed at an acknowledgement is a button that publishes or calls."""
    if alarm.ack_command is None:
        if alarm.ack_input is not None:
            yield Fault(f"{place}.ack_input", "is an input of ack_command: name the control there")
        return
    if alarm.ack_command in faulty:
        return
    pressed = {w.id: w for w in panel.commands if isinstance(w, Publish | Call)}
    place_of = f"{place}.ack_command"
    yield from _reference_faults(place_of, "publish or call", alarm.ack_command, pressed, "control")
    widget = pressed.get(alarm.ack_command)
    if widget is None:
        return
    if alarm.ack != "required":
        yield Fault(place_of, 'is sent when it is acknowledged: leave out ack = "none"')
    if alarm.ack_input not in faulty:
        yield from _reference_faults(
            f"{place}.ack_input", f'input of "{widget.id}"', alarm.ack_input, input_ids(widget)
        )


def _reference_faults(
    place: str, kind: str, name: str | None, known: Collection[str], cause: str = ""
) -> Iterator[Fault]:
    """A fault of a name of something that the panel does not have. `cause` is its kind among the
    causes, `kind` by default."""
    if name is not None and name not in known:
        yield Fault(place, no_such(kind, name, known), cause=f"{cause or kind} {name}")


def _source_faults(place: str, alarm: Alarm, interfaces: Interfaces, language: str) -> Iterator[Fault]:
    source, keys = alarm.source, alarm.given_source_keys
    if source is None:
        yield Fault(place, NO_SOURCE, cause=f"source {place}")
        return
    other = next((key for key in keys if key not in _names(source)), None)
    if other is not None:
        message = f'is another source than "{keys[0]}": an alarm has one; write a second [[alarm]]'
        yield Fault(f"{place}.{other}", message, cause=f"source {place}")
        return
    for key in sorted(alarm.model_fields_set & KEYS - {*OWN_KEYS[source]}):
        yield Fault(f"{place}.{key}", f'has no meaning for "{keys[0]}": leave it out')
    if alarm.text is None and source not in ("diagnostics", "list"):
        yield Fault(f"{place}.text", "is missing: the text that an operator reads")
    yield from CHECKS[source](place, alarm, interfaces, language)


def _names(source: SourceKind) -> tuple[str, ...]:
    return ("list",) if source == "list" else OWN_KEYS[source]


def _topic_faults(place: str, alarm: Alarm, interfaces: Interfaces) -> Iterator[Fault]:
    for key in ("topic", "type"):
        if getattr(alarm, key) is None:
            yield Fault(f"{place}.{key}", f'is missing: "{alarm.given_source_keys[0]}" is of a topic')
    if alarm.type is not None:
        try:
            interfaces.require(alarm.type)
        except InterfaceError as error:
            yield type_fault(f"{place}.type", error)


def _limit_faults(place: str, alarm: Alarm, interfaces: Interfaces, _: str) -> Iterator[Fault]:
    faults = list(_topic_faults(place, alarm, interfaces))
    yield from faults
    if faults or alarm.type is None:
        return
    who = "a limit"
    faults = list(number_faults(place, alarm.type, alarm.field, who, interfaces))
    yield from faults
    if not faults:
        kind = interfaces.field_type(alarm.type, alarm.field)
        yield from number_key_faults(place, alarm, alarm.field, kind)
    for (below, low), (above, high) in itertools.pairwise(alarm.limits.items()):
        if low >= high:
            message = f"{number_text(high)} is not above {below} ({number_text(low)})"
            yield Fault(f"{place}.{above}", message)
    if "low" in alarm.limits and "high" in alarm.limits:
        room = alarm.limits["high"] - alarm.limits["low"]
        if 0 < room <= alarm.deadband:
            message = f"{number_text(alarm.deadband)} is more than there is between low and high"
            yield Fault(f"{place}.deadband", message)


def _stale_faults(place: str, alarm: Alarm, interfaces: Interfaces, _: str) -> Iterator[Fault]:
    yield from _topic_faults(place, alarm, interfaces)


def _diagnostic_faults(place: str, alarm: Alarm, _: Interfaces, __: str) -> Iterator[Fault]:
    if alarm.topic_type != DIAGNOSTIC_ARRAY:
        yield Fault(f"{place}.type", f"diagnostics are {DIAGNOSTIC_ARRAY}; see [alarm.list]")


def _list_faults(place: str, alarm: Alarm, interfaces: Interfaces, language: str) -> Iterator[Fault]:
    listed = alarm.listed
    faults = list(_topic_faults(place, alarm, interfaces))
    yield from faults
    if listed is None:
        return
    yield from _catalogue_faults(place, alarm, listed, language)
    if faults or alarm.type is None:
        return
    faults = list(field_faults("", alarm.type, listed.field, interfaces))
    yield from (Fault(f"{place}.list.field", fault.message) for fault in faults)
    if faults:
        return
    kind = interfaces.type_at(alarm.type, listed.field)
    if kind.container != "sequence":
        yield Fault(f"{place}.list.field", f'"{listed.field}" is {kind}: it must be a list')
        return
    for key in ("code", "text", "level", "active"):
        yield from _entry_faults(f"{place}.list.{key}", key, alarm.type, listed, interfaces)


def _entry_faults(
    place: str, key: str, type_name: str, listed: AlarmList, interfaces: Interfaces
) -> Iterator[Fault]:
    """Faults of a field of each entry, which must be a single value."""
    path = getattr(listed, key)
    if path is None:
        return
    faults = list(entry_faults(place, type_name, listed.field, path, "an alarm", interfaces))
    yield from faults
    if faults:
        return
    kind = interfaces.type_at(type_name, f"{listed.field}[0].{path}")
    if has_key(path):
        yield Fault(place, f'"{path}" of an entry is {kind}: it must be one value')
    elif key == "active" and kind.name != "bool":
        yield Fault(place, f'"{path}" of an entry is {kind}: it must be a bool')


def _catalogue_faults(place: str, alarm: Alarm, listed: AlarmList, language: str) -> Iterator[Fault]:
    if listed.catalogue is None:
        if listed.text is None and alarm.text is None:
            yield Fault(f"{place}.list.text", "is missing: the field with the text, or a catalogue")
        return
    try:
        read_catalogue(listed.catalogue, language)
    except CatalogueError as error:
        yield Fault(f"{place}.list.catalogue", f"{listed.catalogue.name}, {error}")


def _no_faults(*_: Any) -> Iterator[Fault]:
    yield from ()


CHECKS: Final[Mapping[SourceKind, Callable[[str, Alarm, Interfaces, str], Iterator[Fault]]]] = {
    "limits": _limit_faults,
    "condition": _no_faults,
    "stale": _stale_faults,
    "node": _no_faults,
    "lost": _no_faults,
    "diagnostics": _diagnostic_faults,
    "list": _list_faults,
}

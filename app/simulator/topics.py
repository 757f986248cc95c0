"""The topics that a panel listens to, as the simulated robot publishes them: pure."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from app.interfaces import INTEGER_RANGES, Interfaces, parent_path
from app.interfaces.definitions import FLOAT_TYPES
from app.interfaces.field_path import Key, field_name, path_steps
from app.panel.demo import NO_ENTRY, DemoEntry
from app.panel.interlock import Interlock
from app.panel.model import Panel
from app.simulator.guesses import Span, guessed, moving, span_of
from app.simulator.interlocks import offset_of, permitting
from app.simulator.kinds import Shown
from app.simulator.known_types import KNOWN, Moment
from app.simulator.messages import Message, field_constants, plausible
from app.simulator.paths import Fields, get, put
from app.simulator.signals import OTHER_S, Signal, cycle, fixed, phase_of

MOVING_HZ: Final = 5.0  # of numbers
OTHERS_HZ: Final = 1.0
EARLY: Final = 0.95  # of a period: a step may come a little too early
SLOW: Final = frozenset({
    "sensor_msgs/msg/BatteryState",
    "nav_msgs/msg/OccupancyGrid",
    "diagnostic_msgs/msg/DiagnosticArray",
    "rcl_interfaces/msg/Log",
})  # fmt: skip
SAMPLES_S: Final = (0.0, 40.0, 120.0, 230.0)  # times at which a field of a type has its values
TIMES_WITHIN_AGE: Final = 3  # messages within `max_age_s`
PRESS_SHOWN_S: Final = 20.0  # how long a press keeps an interlock's field


@dataclass(frozen=True, slots=True)
class _Field:
    path: str
    signal: Signal
    prompt: bool = False  # a change is published at once
    moving: bool = False


class SimulatedTopic:
    """One topic: `step` yields its messages as CDR."""

    def __init__(
        self,
        type_name: str,
        message: Message,
        fields: Iterable[_Field],
        hz: float,
        interfaces: Interfaces,
    ) -> None:
        self.type = type_name
        self._message = message
        self._fields = list(fields)
        self.period_s = 1 / hz
        self._interfaces = interfaces
        self._last: tuple[float, tuple[Any, ...]] | None = None
        self._effects: dict[str, tuple[Any, float | None]] = {}
        self._copied: tuple[bytes, float] | None = None
        self._changed = False

    def step(self, moment: Moment) -> bytes | None:
        """The message that is due, if one is."""
        prompt = tuple(self._value(one, moment) for one in self._fields if one.prompt)
        due = self._last is None or moment.t - self._last[0] >= self.period_s * EARLY
        if not due and not self._changed and self._last is not None and self._last[1] == prompt:
            return None
        self._last, self._changed = (moment.t, prompt), False
        if self._copied is not None and moment.t < self._copied[1]:
            return self._copied[0]
        return self._encoded(moment)

    def show(self, path: str, value: Any, t: float) -> None:
        """A press sets a field: for a while where it is an interlock's, else until the next one."""
        limited = any(one.prompt and one.path == path for one in self._fields)
        self._effects[path] = value, t + PRESS_SHOWN_S if limited else None
        self._copied, self._changed = None, True

    def copy(self, payload: bytes, t: float) -> None:
        """The topic has what a press published on it, for as long as a field of it would."""
        limited = any(one.prompt for one in self._fields)
        self._copied = payload, t + PRESS_SHOWN_S if limited else math.inf
        self._changed = True

    def _value(self, field: _Field, moment: Moment) -> Any:
        value, until = self._effects.get(field.path, (None, -1.0))
        return value if until is None or moment.t < until else field.signal(moment.t)

    def _encoded(self, moment: Moment) -> bytes:
        fields = self._message(moment)
        structures = self._interfaces.structures
        for one in self._fields:
            put(fields, self.type, one.path, self._value(one, moment), structures)
        own = {one.path for one in self._fields}
        for path, (value, _) in self._effects.items():
            if path not in own:
                put(fields, self.type, path, value, structures)
        return self._interfaces.encode(self.type, fields)


def simulated_topics(
    panel: Panel,
    shown: Iterable[Shown],
    interfaces: Interfaces,
    skipped: Mapping[str, str],
    phase: float,
) -> dict[str, SimulatedTopic]:
    """Each topic that the panel listens to, but those `skipped` (topic → type), which are simulated
    elsewhere. `phase` sets several robots apart."""
    by_topic: dict[str, list[Shown]] = {}
    for one in shown:
        by_topic.setdefault(one.topic, []).append(one)
    maker = _Maker(panel, interfaces, phase)
    found = {}
    for topic, type_name in panel.subscriptions().items():
        if topic in skipped or panel.demo.get(topic, NO_ENTRY).silent:
            continue
        found[topic] = maker.topic(topic, type_name, by_topic.get(topic, []))
    return found


class _Maker:
    """Makes the topics of one panel."""

    def __init__(self, panel: Panel, interfaces: Interfaces, phase: float) -> None:
        self._panel = panel
        self._interfaces = interfaces
        self._phase = phase
        self._paths = panel.subscribed_fields()
        fields = dict.fromkeys((one.topic, one.field) for one in panel.interlocks)
        self._confirmed = {(one.topic, one.field) for one in panel.confirmations()}
        self._offsets = {field: offset_of(number, len(fields)) for number, field in enumerate(fields)}

    def topic(self, topic: str, type_name: str, shown: list[Shown]) -> SimulatedTopic:
        entry = self._panel.demo.get(topic, NO_ENTRY)
        paths = list(dict.fromkeys(self._paths.get(topic, ())))
        message = self._message(type_name, paths, entry)
        fields = [
            self._field(topic, type_name, path, shown, entry, message)
            for path in paths
            if get(entry.message, path_steps(path)) is None  # else `[demo]` fixes it
        ]
        made = [self._still(topic, one) for one in fields if one is not None]
        hz = self._hz(topic, type_name, made, shown, entry)
        return SimulatedTopic(type_name, message, made, hz, self._interfaces)

    def _still(self, topic: str, field: _Field) -> _Field:
        """The field; one that confirms presses changes with them only."""
        entry = self._panel.demo.get(topic, NO_ENTRY)
        given = {"values", "range", "ranges"} & entry.model_fields_set
        if field.prompt or given or (topic, field.path) not in self._confirmed:
            return field
        first = field.signal(0.0)
        return replace(field, signal=fixed(False if isinstance(first, bool) else first))

    def _message(self, type_name: str, paths: list[str], entry: DemoEntry) -> Message:
        keys = [step for path in paths for step in path_steps(path) if isinstance(step, Key)]
        wanted = list(dict.fromkeys(key.value for key in keys if key.path == "name"))
        base = plausible(type_name, self._interfaces, wanted)
        if not entry.message:
            return base
        return lambda moment: merged(base(moment), entry.message)

    def _field(
        self,
        topic: str,
        type_name: str,
        path: str,
        shown: list[Shown],
        entry: DemoEntry,
        message: Message,
    ) -> _Field | None:
        """None where the message's own value is the best."""
        kind = self._interfaces.type_at(type_name, path)
        if kind.is_nested or kind.container != "one":
            return None
        mine = [one for one in shown if one.field == path]
        interlocks = [one for one in self._panel.interlocks if (one.topic, one.field) == (topic, path)]
        if interlocks:
            return _Field(
                path, self._permitting(topic, path, kind.name, interlocks, mine, entry), prompt=True
            )
        if entry.values:
            return _Field(path, cycle(entry.values, _round_s(entry)))
        phase = (phase_of(f"{topic} {path}") + self._phase) % 1
        values = next((one.values for one in mine if one.values), ())
        own = self._own(type_name, path, message)
        if values and not (entry.ranges.get(path) or entry.range):
            usual = [one for one in values if one in own] if len(own) == 1 else []
            rest = [one for one in values if one not in usual]
            return None if len(own) > 1 else _Field(path, cycle([*usual, *rest], entry.period_s, phase))
        if kind.name not in INTEGER_RANGES and kind.name not in FLOAT_TYPES:
            names = (path, *(one.label for one in mine), topic)
            return None if own else _Field(path, guessed(kind.name, kind.bound, *names))
        return self._number(topic, type_name, path, mine, entry, message, phase)

    def _number(
        self,
        topic: str,
        type_name: str,
        path: str,
        mine: list[Shown],
        entry: DemoEntry,
        message: Message,
        phase: float,
    ) -> _Field | None:
        kind = self._interfaces.type_at(type_name, path).name
        limits = entry.ranges.get(path) or entry.range
        given = next((one for one in mine if one.low is not None or one.high is not None), None)
        label = mine[0].label if mine else ""
        unit = next((one for one in mine if one.unit), None)
        guess = span_of(unit.unit if unit else "", field_name(path), label, topic)
        if limits is None and given is None:
            if self._own(type_name, path, message):
                return None
            constants = self._constants(type_name, path)
            if constants and kind in INTEGER_RANGES and unit is None:
                return _Field(path, cycle(constants, entry.period_s, phase))
        span = guess
        if limits is not None:
            span = Span(limits[0], limits[1], guess.shape)
        elif given is not None:
            span = _limited(given, guess)
        elif unit is not None:
            ends = sorted((end - unit.offset) / unit.scale for end in (guess.low, guess.high))
            span = Span(ends[0], ends[1], guess.shape)
        return _Field(path, moving(span, kind, entry.period_s, phase), moving=True)

    def _permitting(
        self,
        topic: str,
        path: str,
        kind: str,
        interlocks: list[Interlock],
        mine: list[Shown],
        entry: DemoEntry,
    ) -> Signal:
        if entry.values:
            return cycle(entry.values, _round_s(entry))
        limits = entry.ranges.get(path) or entry.range
        if limits and (kind in INTEGER_RANGES or kind in FLOAT_TYPES):
            return moving(Span(limits[0], limits[1]), kind, entry.period_s, 0.0)
        others = [value for one in mine for value in one.values]
        type_name = interlocks[0].type
        others += [*self._constants(type_name, path), *interlocks[0].constants]
        offset = self._offsets[topic, path]
        return permitting(interlocks, kind, others, offset, entry.period_s)

    def _constants(self, type_name: str, path: str) -> list[Any]:
        around = parent_path(path)
        name = self._interfaces.field_type(type_name, around) if around else type_name
        structure = self._interfaces.structures.get(name)
        return [] if structure is None else field_constants(field_name(path), structure)

    def _own(self, type_name: str, path: str, message: Message) -> list[Any]:
        """The values that a field has as one of a type whose fields belong together; none elsewhere."""
        around = parent_path(path)
        name = self._interfaces.field_type(type_name, around) if around else type_name
        if name not in KNOWN and type_name not in KNOWN:
            return []
        found = (get(message(Moment(t, 0)), path_steps(path)) for t in SAMPLES_S)
        return list(dict.fromkeys(value for value in found if value is not None))

    def _hz(
        self, topic: str, type_name: str, fields: list[_Field], shown: list[Shown], entry: DemoEntry
    ) -> float:
        if entry.hz is not None:
            return entry.hz
        still = fields and not any(one.moving for one in fields)
        hz = OTHERS_HZ if still or type_name in SLOW else MOVING_HZ
        locks = (one.max_age_s for one in self._panel.interlocks if one.topic == topic)
        ages = [age for age in (*locks, *(one.max_age_s for one in shown)) if age is not None]
        return max([hz, *(TIMES_WITHIN_AGE / age for age in ages)])


def _round_s(entry: DemoEntry) -> float:
    """How long the values of an entry take together."""
    return entry.period_s or OTHER_S * len(entry.values or ())


def _limited(given: Shown, guess: Span) -> Span:
    """The limits of a widget; one that it does not give is far from the other."""
    low, high = given.low, given.high
    if low is None:
        assert high is not None
        low = min(guess.low, high - 1)
    return Span(low, max(guess.high, low + 1) if high is None else high, guess.shape)


def merged(fields: Fields, over: Mapping[str, Any]) -> Fields:
    """Both; tables within tables are merged too."""
    for key, value in over.items():
        inner: Any = fields.get(key)
        tables = isinstance(value, Mapping) and isinstance(inner, dict)
        fields[key] = merged(inner, value) if tables else value
    return fields

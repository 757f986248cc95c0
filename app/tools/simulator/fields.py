"""How each field of a topic that a panel shows changes with time: pure."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

from app.panel.condition import Condition
from app.panel.demo import NO_ENTRY, DemoEntry
from app.panel.model import Panel
from app.ros.messages import INTEGER_RANGES, Interfaces, parent_path
from app.ros.messages.definitions import FLOAT_TYPES
from app.ros.messages.field_path import field_call, field_name, field_paths
from app.system.texts import render
from app.tools.simulator.known_types import GENERATORS, Message, Moment, field_constants
from app.tools.simulator.machine import Machine, offset_of, permitting
from app.tools.simulator.needs import DisplayedField
from app.tools.simulator.values import (
    OTHER_S,
    UNITS,
    Signal,
    Span,
    counted,
    cycle,
    fixed,
    get,
    guessed,
    moving,
    phase_of,
    span_of,
)

SAMPLES_S: Final = (0.0, 40.0, 120.0, 230.0)  # times at which a field of a type has its values


@dataclass(frozen=True, slots=True)
class FieldSignal:
    """A field and its value at a time. `prompt`: a change is published at once. While `forces`, no
    press counts."""

    path: str
    signal: Signal
    prompt: bool = False
    forces: Callable[[float], bool] | None = None
    moving: bool = False


class PanelFields:
    """What a panel says of the fields of its topics; `phase` sets several robots apart."""

    def __init__(self, panel: Panel, interfaces: Interfaces, phase: float, machine: Machine) -> None:
        self.panel = panel
        self.machine = machine
        self.interfaces = interfaces
        self.phase = phase
        self.paths = {
            topic: list(dict.fromkeys(paths)) for topic, paths in panel.subscribed_fields().items()
        }
        self.levels_below = {
            level.topic: [str(below.id) for below in view.levels[:number]]
            for view in panel.map_views.values()
            for number, level in enumerate(view.levels)
        }
        layers = (layer for view in panel.map_views.values() for layer in view.layers)
        self.levels_below |= {layer.topic: [layer.shows] for layer in layers if layer.row.is_mask}
        self.confirmed = {
            (confirmation.topic, confirmation.field) for confirmation in panel.confirmations()
        }
        locked = dict.fromkeys(cause.key for cause in machine.causes)
        self.offsets: Mapping[tuple[str, str], float] = {
            field: offset_of(number, len(locked)) for number, field in enumerate(locked)
        }

    def entry(self, topic: str) -> DemoEntry:
        return self.panel.demo.get(topic, NO_ENTRY)

    def signals(
        self, topic: str, type_name: str, shown: Sequence[DisplayedField], message: Message
    ) -> list[FieldSignal]:
        """The fields that have another value than `message` gives them."""
        fixed_by_table = self.entry(topic).message
        paths = (
            path
            for path in self.paths.get(topic, ())
            if all(
                get(fixed_by_table, self.interfaces.typed_steps(type_name, inner)) is None
                for inner in field_paths(path)
            )
        )
        made = (_Field(self, topic, type_name, path, shown, message).made() for path in paths)
        return [signal for signal in made if signal is not None]


class _Field:
    """One field of one topic."""

    def __init__(
        self,
        panel_fields: PanelFields,
        topic: str,
        type_name: str,
        path: str,
        shown: Sequence[DisplayedField],
        message: Message,
    ) -> None:
        self._panel_fields = panel_fields
        self._topic = topic
        self._type = type_name
        self._path = path
        self._shown = [shown_field for shown_field in shown if shown_field.field == path]
        self._message = message
        self._kind = panel_fields.interfaces.type_at(type_name, path)
        self._entry = panel_fields.entry(topic)
        self._limits = self._entry.ranges.get(path) or self._entry.range
        self._phase = (phase_of(f"{topic} {path}") + panel_fields.phase) % 1

    def made(self) -> FieldSignal | None:
        """None where the message's own value is the best."""
        if self._kind.is_nested or self._kind.container != "one":
            return None
        interlocks = [
            interlock
            for interlock in self._panel_fields.panel.named_conditions
            if (interlock.topic, interlock.field) == (self._topic, self._path)
        ]
        machine, key = self._panel_fields.machine, (self._topic, self._path)
        if key == machine.key and not self._entry.values:
            return FieldSignal(self._path, machine.state, prompt=True, forces=machine.fails)
        if interlocks:
            return FieldSignal(self._path, self._permitting(interlocks), prompt=True)
        if self._entry.values:
            return self._with(cycle(self._entry.values, self._round_s))
        if (counts_s := self._counts_s) and not self._limits:
            return self._with(counted(counts_s, self._kind.name))
        if (raising := machine.raising(key)) and not self._limits:
            return FieldSignal(self._path, self._permitting(raising, raising=True), prompt=True)
        if not self._limits and field_call(self._path) is not None:
            return None  # of what the message has
        fields = self._by_values() if self._values and not self._limits else self._by_type()
        return fields if fields is None or self._limits else self._still(fields)

    def _with(self, signal: Signal, *, is_moving: bool = False) -> FieldSignal:
        return FieldSignal(self._path, signal, moving=is_moving)

    def _still(self, field: FieldSignal) -> FieldSignal:
        """The field; one that confirms presses changes with them only."""
        if (self._topic, self._path) not in self._panel_fields.confirmed:
            return field
        first = field.signal(0.0)
        return replace(field, signal=fixed(False if isinstance(first, bool) else first), moving=False)

    @property
    def _counts_s(self) -> float | None:
        """In which time it rises by one; None for a field that is not a counter."""
        return next((field.counts_s for field in self._shown if field.counts_s), None)

    @property
    def _values(self) -> tuple[Any, ...]:
        """The values that a widget distinguishes."""
        return next((shown_field.values for shown_field in self._shown if shown_field.values), ())

    @property
    def _round_s(self) -> float:
        """How long the values of the entry take together."""
        return self._entry.period_s or OTHER_S * len(self._entry.values or ())

    def _by_values(self) -> FieldSignal | None:
        """Each of a widget's values; the usual one is that of the message, if it has one."""
        if len(self._own) > 1:
            return None
        usual = [values_field for values_field in self._values if values_field in self._own]
        others = [values_field for values_field in self._values if values_field not in usual]
        return self._with(cycle([*usual, *others], self._entry.period_s, self._phase))

    def _by_type(self) -> FieldSignal | None:
        if self._kind.name in INTEGER_RANGES or self._kind.name in FLOAT_TYPES:
            return self._number()
        if self._own:
            return None
        names = (self._path, *(shown_field.label for shown_field in self._shown), self._topic)
        return self._with(guessed(self._kind.name, self._kind.bound, *names))

    def _number(self) -> FieldSignal | None:
        unit = next((shown_field for shown_field in self._shown if shown_field.unit), None)
        limited = any(
            shown_field.low is not None or shown_field.high is not None for shown_field in self._shown
        )
        if not self._limits and not limited:
            if self._own:
                return None
            if self._constants and unit is None and self._kind.name in INTEGER_RANGES:
                return self._with(cycle(self._constants, self._entry.period_s, self._phase))
        span = self._span(unit)
        signal = moving(span, self._kind.name, self._entry.period_s, self._phase)
        return self._with(signal, is_moving=True)

    def _span(self, unit: DisplayedField | None) -> Span:
        """By the entry, else by a widget's limits, else by its unit, else by names."""
        label = self._shown[0].label if self._shown else ""
        guess = span_of(unit.unit if unit else "", field_name(self._path), label, self._topic)
        limits = (
            shown_field
            for shown_field in self._shown
            if shown_field.low is not None or shown_field.high is not None
        )
        if self._limits:
            return Span(self._limits[0], self._limits[1], guess.shape)
        if limit := next(limits, None):
            return _limited(limit, guess)
        if unit is None:
            return guess
        low, high = sorted((end - unit.offset) / unit.scale for end in (guess.low, guess.high))
        return Span(low, high, guess.shape)

    def _permitting(self, interlocks: Sequence[Condition], *, raising: bool = False) -> Signal:
        entry, kind = self._entry, self._kind.name
        if entry.values:
            return cycle(entry.values, self._round_s)
        if self._limits and (kind in INTEGER_RANGES or kind in FLOAT_TYPES):
            return moving(Span(self._limits[0], self._limits[1]), kind, entry.period_s, 0.0)
        others = [value for shown_field in self._shown for value in shown_field.values]
        others += [*self._constants, *interlocks[0].constants]
        offset = self._panel_fields.offsets[self._topic, self._path]
        usual = self._usual(interlocks)
        return permitting(interlocks, kind, others, offset, entry.period_s, usual, raising=raising)

    def _usual(self, interlocks: Sequence[Condition]) -> Span | None:
        """The span that the message, a widget or the unit says; None where none of them does."""
        numbers = [value for value in self._own if not isinstance(value, bool | str)]
        if numbers:
            return Span(min(numbers), max(numbers))
        shown = [(render(c.unit), c.scale, c.offset) for c in interlocks]
        shown += [(each.unit, each.scale, each.offset) for each in self._shown]
        for unit, scale, offset in shown:
            if unit in UNITS and scale:
                ends = (UNITS[unit].low, UNITS[unit].high)
                low, high = sorted((end - offset) / scale for end in ends)
                return Span(low, high)
        return None

    @cached_property
    def _parent(self) -> str:
        """The type of the message that the field is in."""
        around = parent_path(self._path)
        return self._panel_fields.interfaces.field_type(self._type, around) if around else self._type

    @property
    def _constants(self) -> list[Any]:
        structure = self._panel_fields.interfaces.structures.get(self._parent)
        return [] if structure is None else field_constants(field_name(self._path), structure)

    @cached_property
    def _own(self) -> list[Any]:
        """The values that it has as a field of a type whose fields belong together; none elsewhere."""
        is_call = field_call(self._path) is not None
        if is_call or (self._parent not in GENERATORS and self._type not in GENERATORS):
            return []
        steps = self._panel_fields.interfaces.typed_steps(self._type, self._path)
        values = (get(self._message(Moment(t, 0)), steps) for t in SAMPLES_S)
        return list(dict.fromkeys(value for value in values if value is not None))


def _limited(shown: DisplayedField, guess: Span) -> Span:
    """The limits of a widget; one that it does not give is far from the other."""
    low, high = shown.low, shown.high
    if low is None:
        assert high is not None
        low = min(guess.low, high - 1)
    return Span(low, max(guess.high, low + 1) if high is None else high, guess.shape)

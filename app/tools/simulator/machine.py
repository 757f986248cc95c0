"""The one machine behind a simulated robot without a story: its `[state]` follows from the values of
its interlocks, conditions and alarms. Pure."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, NamedTuple

from app.panel.condition import Condition
from app.panel.model import Panel
from app.panel.values import same_value
from app.panel.widgets.displays import LampState
from app.ros.messages import INTEGER_RANGES
from app.ros.messages.definitions import FLOAT_TYPES
from app.tools.simulator import robot
from app.tools.simulator.values import Signal, Span, as_type, cycle, swing

# Fields that permit operation and forbid it in turns, by the conditions of interlocks: pure.

APART_S: Final = 3.0  # by which each interlock drops later than the one before
SPREAD_S: Final = 8.0  # all of them together: so that there is time in which all permit
INSIDE: Final = 0.3  # of the limits' distance, to both sides of their middle


def offset_of(number: int, count: int) -> float:
    """By how many seconds the interlock `number` of `count` is behind the first."""
    return number * min(APART_S, SPREAD_S / max(count - 1, 1))


def permitted(t: float, offset: float, period_s: float | None) -> bool:
    """Whether an interlock permits: at first, then 20 s of 28, or the same part of a period."""
    whole = robot.PERMITTED_S + robot.FORBIDDEN_S
    since = t - offset if period_s is None else (t - offset) / period_s * whole
    return since < 0 or since % whole < robot.PERMITTED_S


def permitting(
    interlocks: Sequence[Condition],
    kind: str,
    others: Sequence[Any],
    offset: float,
    period_s: float | None,
    usual: Span | None = None,
    *,
    raising: bool = False,
) -> Signal:
    """A field of the base type `kind` that satisfies its interlocks, and then does not; `others` are
    further values that the field may have, and numbers stay in its `usual` span where the limits leave
    room in it. Where no value satisfies all, each has its turn. With `raising` they raise alarms: they
    are not satisfied at first."""
    values = (_as_kind(candidate, kind) for candidate in _candidates(interlocks, kind, others, usual))
    candidates = [choice for choice in values if _fits(choice, kind)]
    met = [sum(satisfies(interlock, candidate) for interlock in interlocks) for candidate in candidates]
    best, least = max(met), min(met)
    good = [candidate for candidate, count in zip(candidates, met, strict=True) if count == best]
    bad = [
        candidate for candidate, count in zip(candidates, met, strict=True) if count == least
    ] or good
    moving = _moving(interlocks, kind, usual) if best == len(interlocks) else None
    turn_s = period_s or robot.PERMITTED_S + robot.FORBIDDEN_S

    def value(t: float) -> Any:
        turn = math.floor((t - offset) / turn_s)
        if permitted(t, offset, period_s) is raising:
            return bad[turn % len(bad)]
        if moving is not None:
            return moving(t)
        return good[turn % len(good)] if best < len(interlocks) else good[0]

    return value


def candidates(conditions: Sequence[Condition], kind: str) -> Iterator[Any]:
    """Values of a field of the base type `kind`, of which each condition is met by some and not met by
    others, as far as its type has them."""
    values = (_as_kind(value, kind) for value in _candidates(conditions, kind, (), None))
    return (value for value in values if _fits(value, kind) or not kind)


def satisfies(interlock: Condition, value: Any) -> bool:
    """Whether a value meets all conditions; without any, whether it is true."""
    comparisons = interlock.comparisons
    if not comparisons:
        return value is True
    return (
        ("equals" not in comparisons or same_value(value, interlock.equals))
        and ("not_equals" not in comparisons or not same_value(value, interlock.not_equals))
        and (
            "one_of" not in comparisons
            or any(same_value(value, comparison) for comparison in comparisons["one_of"])
        )
        and ("min" not in comparisons or value >= comparisons["min"])
        and ("max" not in comparisons or value <= comparisons["max"])
    )


def _candidates(
    interlocks: Sequence[Condition], kind: str, others: Sequence[Any], usual: Span | None
) -> Iterator[Any]:
    """Values to choose from, the likeliest first."""
    if kind == "bool":
        yield from (True, False)
        return
    numeric = kind in INTEGER_RANGES or kind in FLOAT_TYPES
    for interlock in interlocks:
        comparisons = interlock.comparisons
        for value in (comparisons.get("equals"), *comparisons.get("one_of", ())):
            if value is not None:
                yield value
        if "min" in comparisons or "max" in comparisons:
            low, high = _limits(interlock, usual)
            span = high - low
            below, above = low - span / 4, high + span / 4
            if usual is not None and low > 0:
                below = max(below, low / 2)
            if usual is not None and usual.high > high:
                above = min(above, usual.high)
            yield from ((low + high) / 2, below, above, low, high)
    yield from others
    for interlock in interlocks if numeric else ():
        for key, comparison in interlock.comparisons.items():
            if usual is not None and key in ("min", "max"):
                continue
            near = comparison if isinstance(comparison, tuple) else (comparison,)
            for value in near:
                yield from (value + 1, value - 1)
    for interlock in interlocks:
        if "not_equals" in interlock.comparisons:
            yield interlock.not_equals
    if not numeric:
        yield from ("ready", "not ready")


def _limits(interlock: Condition, usual: Span | None) -> tuple[float, float]:
    """Both limits: one that is not given is the end of the usual span, else a fifth of the other
    away."""
    low, high = interlock.comparisons.get("min"), interlock.comparisons.get("max")
    if low is None:
        assert high is not None
        if usual is not None and usual.low < high:
            return usual.low, high
        return high - max(abs(high) / 5, 4), high
    if high is None:
        if usual is not None and usual.high > low:
            return low, usual.high
        return low, low + max(abs(low) / 5, 4)
    return low, high


def _moving(interlocks: Sequence[Condition], kind: str, usual: Span | None) -> Signal | None:
    """A number that moves inside the limits, if there are any."""
    limits = [
        _limits(interlock, usual)
        for interlock in interlocks
        if {"min", "max"} & interlock.comparisons.keys()
    ]
    if not limits:
        return None
    low, high = max(limit[0] for limit in limits), min(limit[1] for limit in limits)
    middle, part = (low + high) / 2, (high - low) * INSIDE
    ends = as_type(swing(middle - part, middle + part, 1), kind)
    if not all(satisfies(interlock, ends(t)) for interlock in interlocks for t in (0, 0.25, 0.5)):
        return None
    return as_type(swing(middle - part, middle + part), kind)


def _as_kind(value: Any, kind: str) -> Any:
    """A number as its field has it."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    return round(value) if kind in INTEGER_RANGES else float(value)


def _fits(value: Any, kind: str) -> bool:
    if kind == "bool":
        return isinstance(value, bool)
    if kind in FLOAT_TYPES:
        return isinstance(value, float)
    if kind in INTEGER_RANGES:
        low, high = INTEGER_RANGES[kind]
        return isinstance(value, int) and not isinstance(value, bool) and low <= value <= high
    return isinstance(value, str)


URGENT: Final = 2  # alarms of this priority or a more urgent one stop a machine
# Which states are those of a machine that is stopped by a fault: the first test that some of them pass.
ABNORMAL: Final[tuple[Callable[[LampState], bool], ...]] = (
    lambda state: state.colour == "red",
    lambda state: state.shape == "cross",
    lambda state: state.colour == "yellow",
    lambda state: state.shape in {"square", "pause", "bar"},
)
FieldKey = tuple[str, str]  # topic, field


class Cause(NamedTuple):
    """A field by which the machine fails: where an alarm's condition is met, or none of its interlocks
    and conditions. `state`: which one it has then."""

    key: FieldKey
    conditions: Sequence[Condition]
    is_alarm: bool = False
    state: Any = None

    def holds(self, value: Any) -> bool:
        return self.is_alarm is any(satisfies(condition, value) for condition in self.conditions)


class Machine:
    """The state of one robot; it reads the values that the simulated topics have."""

    def __init__(self, panel: Panel) -> None:
        rules = panel.state
        self.key: FieldKey | None = None if rules is None else (rules.topic, rules.field)
        self.causes = [cause for cause in _causes(panel) if cause.key != self.key]
        self._values: dict[FieldKey, Signal] = {}
        states = () if rules is None else rules.states
        abnormal = next((met for met in map(_met(states), ABNORMAL) if met), states[1:])
        usual = [state.value for state in states if state not in abnormal]
        self._abnormal = [state.value for state in abnormal]
        self._usual = cycle(usual or self._abnormal or [None])

    def read(self, key: FieldKey, value: Signal) -> None:
        """Reads a field's values from now on."""
        self._values[key] = value

    def raising(self, key: FieldKey) -> list[Condition]:
        """The conditions of a field by which alarms are raised."""
        return [c for cause in self.causes if cause.is_alarm and cause.key == key
                for c in cause.conditions]  # fmt: skip

    def fails(self, t: float) -> bool:
        return self._cause(t) is not None

    def state(self, t: float) -> Any:
        """The value of the field of `[state]`."""
        if (cause := self._cause(t)) is None or not self._abnormal:
            return self._usual(t)
        return self._abnormal[0] if cause.state is None else cause.state

    def _cause(self, t: float) -> Cause | None:
        """Why it fails; those that name a state come first."""
        held = (
            cause
            for cause in self.causes
            if (value := self._values.get(cause.key)) is not None and cause.holds(value(t))
        )
        return min(held, key=lambda cause: cause.state is None, default=None)


def _met(states: tuple[LampState, ...]) -> Callable[[Callable[[LampState], bool]], list[LampState]]:
    return lambda test: [state for state in states if test(state)]


def _causes(panel: Panel) -> Iterator[Cause]:
    by_field: dict[FieldKey, list[Condition]] = {}
    for condition in panel.named_conditions:
        by_field.setdefault((condition.topic, condition.field), []).append(condition)
    for key, conditions in by_field.items():
        yield Cause(key, conditions)
    for alarm in panel.alarms:
        if (when := alarm.when) and (alarm.state is not None or alarm.priority <= URGENT):
            yield Cause((when.topic, when.field), [when], is_alarm=True, state=alarm.state)

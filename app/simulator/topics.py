"""The topics that a panel listens to, as the simulated robot publishes them: pure."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from app.interfaces import Interfaces
from app.interfaces.field_path import Key, field_call, field_paths, path_steps
from app.panel.demo import NO_ENTRY
from app.panel.model import Panel
from app.simulator.needs import Shown
from app.simulator.values.fields import FieldSignal, PanelFields
from app.simulator.values.functions import put_result
from app.simulator.values.known_types import Moment
from app.simulator.values.messages import Message, plausible
from app.simulator.values.paths import Fields, merged, put

MOVING_HZ: Final = 5.0  # of numbers
OTHERS_HZ: Final = 1.0
EARLY: Final = 0.95  # of a period: a step may come a little too early
SLOW: Final = frozenset({
    "sensor_msgs/msg/BatteryState",
    "nav_msgs/msg/OccupancyGrid",
    "diagnostic_msgs/msg/DiagnosticArray",
    "rcl_interfaces/msg/Log",
})  # fmt: skip
TIMES_WITHIN_AGE: Final = 3  # messages within `max_age_s`
PRESS_SHOWN_S: Final = 20.0  # how long a press keeps an interlock's field


class SimulatedTopic:
    """One topic: `step` yields its messages as CDR."""

    def __init__(
        self,
        type_name: str,
        message: Message,
        fields: Iterable[FieldSignal],
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
        prompt = tuple(self._value(field, moment) for field in self._fields if field.prompt)
        due = self._last is None or moment.t - self._last[0] >= self.period_s * EARLY
        if not due and not self._changed and self._last is not None and self._last[1] == prompt:
            return None
        self._last, self._changed = (moment.t, prompt), False
        if self._copied is not None and moment.t < self._copied[1]:
            return self._copied[0]
        return self._encoded(moment)

    def show(self, path: str, value: Any, t: float) -> None:
        """A press sets a field: for a while where it is an interlock's, else until the next one."""
        limited = any(field.prompt and field.path == path for field in self._fields)
        self._effects[path] = value, t + PRESS_SHOWN_S if limited else None
        self._copied, self._changed = None, True

    def copy(self, payload: bytes, t: float) -> None:
        """The topic has what a press published on it, for as long as a field of it would."""
        limited = any(field.prompt for field in self._fields)
        self._copied = payload, t + PRESS_SHOWN_S if limited else math.inf
        self._changed = True

    def _value(self, field: FieldSignal, moment: Moment) -> Any:
        value, until = self._effects.get(field.path, (None, -1.0))
        return value if until is None or moment.t < until else field.signal(moment.t)

    def _encoded(self, moment: Moment) -> bytes:
        fields = self._message(moment)
        for field in self._fields:
            self._put(fields, field.path, self._value(field, moment), moment)
        own = {field.path for field in self._fields}
        for path, (value, _) in self._effects.items():
            if path not in own:
                self._put(fields, path, value, moment)
        return self._interfaces.encode(self.type, fields)

    def _put(self, fields: Fields, path: str, value: Any, moment: Moment) -> None:
        structures, call = self._interfaces.structures, field_call(path)
        if call is None:
            put(fields, self.type, path, value, structures)
        else:
            put_result(fields, self.type, call, value, structures, moment)


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
    for shown_field in shown:
        by_topic.setdefault(shown_field.topic, []).append(shown_field)
    fields = PanelFields(panel, interfaces, phase)
    topics = {}
    for topic, type_name in panel.listened().items():
        if topic in skipped or panel.demo.get(topic, NO_ENTRY).silent:
            continue
        topics[topic] = _topic(fields, topic, type_name, by_topic.get(topic, []))
    return topics


def _topic(fields: PanelFields, topic: str, type_name: str, shown: Sequence[Shown]) -> SimulatedTopic:
    message = _message(fields, topic, type_name)
    made = fields.signals(topic, type_name, shown, message)
    hz = _hz(fields, topic, type_name, made, shown)
    return SimulatedTopic(type_name, message, made, hz, fields.interfaces)


def _message(fields: PanelFields, topic: str, type_name: str) -> Message:
    """Messages with the names that the panel looks for, and what `[demo]` fixes."""
    paths = [path for named in fields.paths.get(topic, ()) for path in field_paths(named)]
    keys = [step for path in paths for step in path_steps(path)]
    wanted = [str(step.value) for step in keys if isinstance(step, Key) and step.path == "name"]
    base = plausible(type_name, fields.interfaces, dict.fromkeys(wanted))
    over = fields.entry(topic).message
    return (lambda moment: merged(base(moment), over)) if over else base


def _hz(
    fields: PanelFields,
    topic: str,
    type_name: str,
    made: Sequence[FieldSignal],
    shown: Sequence[Shown],
) -> float:
    """Messages per second: so many that no value gets too old."""
    rate_hz = fields.entry(topic).hz
    if rate_hz is not None:
        return rate_hz
    still = made and not any(signal.moving for signal in made)
    hz = OTHERS_HZ if still or type_name in SLOW else MOVING_HZ
    locks = (
        interlock.max_age_s for interlock in fields.panel.named_conditions if interlock.topic == topic
    )
    ages = [
        age for age in (*locks, *(shown_field.max_age_s for shown_field in shown)) if age is not None
    ]
    return max([hz, *(TIMES_WITHIN_AGE / age for age in ages)])

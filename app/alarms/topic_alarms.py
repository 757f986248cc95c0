"""Which alarms a message of a topic may change. An alarm with limits is not evaluated while the value
stays in the range in which none of its limits changes: thousands of them may listen to one topic."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from app.alarms.instance import AlarmInstance
from app.alarms.sources import read_source
from app.robot.state import RobotState

# What decides the value of an alarm with limits, beside its topic: the field, the scale and the age.
ValueKey = tuple[str, float, float | None]


class TopicAlarms:
    """The alarms of all robots by the topics that they listen to."""

    def __init__(self) -> None:
        self._ids: dict[tuple[str, str], list[str]] = {}  # by (robot, topic's key)
        self._limited: dict[tuple[str, str], dict[ValueKey, list[AlarmInstance]]] = {}  # by the same
        self._changed: dict[tuple[str, str], None] = {}  # the same, of messages that arrived

    def listen(self, alarm: AlarmInstance, keys: Iterable[str]) -> None:
        """Adds an alarm to the topics with these keys."""
        definition = alarm.definition
        described = definition.alarm
        for key in keys:
            place = definition.robot, key
            if described.source == "limits" and not described.conditions:
                value = described.field, described.scale, described.max_age_s
                self._limited.setdefault(place, {}).setdefault(value, []).append(alarm)
            else:
                self._ids.setdefault(place, []).append(definition.id)

    def note(self, robot: str, keys: Iterable[str]) -> None:
        """Messages arrived on topics of a robot."""
        self._changed.update(dict.fromkeys((robot, key) for key in keys))

    @property
    def has_changed(self) -> bool:
        """Whether messages arrived since `take` was called."""
        return bool(self._changed)

    def take(self, robots: Mapping[str, RobotState], now: float) -> Iterator[str]:
        """The ids of the alarms that these messages may change; `now` in monotonic seconds."""
        while self._changed:
            place, _ = self._changed.popitem()
            yield from self._ids.get(place, ())
            for alarms in self._limited.get(place, {}).values():
                yield from _unsteady(alarms, robots[place[0]], now)


def _unsteady(alarms: Sequence[AlarmInstance], robot: RobotState, now: float) -> Iterator[str]:
    """The ids of those of which the value leaves the range that changes nothing."""
    value = read_source(alarms[0].definition.alarm, robot, now, now).value
    for alarm in alarms:
        low, high = alarm.steady
        if value is not None and low <= value <= high:
            alarm.value = value
        else:
            yield alarm.definition.id

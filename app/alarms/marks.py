"""Which values of the robots have an active alarm, from the rows that pages show."""

import re
from collections.abc import Collection, Mapping
from typing import Final

from app.alarms.rows import AlarmRow
from app.panel.model import Panel
from app.robot.alarmed import AlarmedState, AlarmedValues

Value = tuple[str, str]  # topic and field
BEHIND_ID: Final = re.compile("[@:]")  # the robot, or the name of what it published


class AlarmMarks:
    """The marks of all robots. Alarms that are about no value cost nothing."""

    def __init__(self, panel: Panel) -> None:
        self._alarms = {
            alarm.id: alarm for alarm in panel.alarms if alarm.state is not None or alarm.marked_values
        }
        self._unmarked: dict[str, Mapping[Value, int]] = {}  # robot → 0 of each value
        self._state_topic = panel.state.topic if panel.state else None
        self._active: dict[str, dict[str, AlarmRow]] = {}  # robot → id → row
        self._changed: dict[str, set[str]] = {}  # robot → topics

    def update(self, before: AlarmRow | None, after: AlarmRow | None) -> None:
        """A row is shown in place of another; None for an alarm that is not listed."""
        row = after or before
        alarm = row and self._alarms.get(_alarm_id(row))
        if row is None or alarm is None:
            return
        active = self._active.setdefault(row["robot"], {})
        was_active = active.pop(row["id"], None) is not None
        if after is not None and after["state"] == "active":
            active[row["id"]] = after
        elif not was_active:
            return
        changed = self._changed.setdefault(row["robot"], set())
        changed.update(topic for topic, _ in alarm.marked_values)
        if alarm.state is not None and self._state_topic is not None:
            changed.add(self._state_topic)

    def take_changes(self) -> Mapping[str, Collection[str]]:
        """The topics of which the marks have changed since the last call, by robot."""
        changed, self._changed = self._changed, {}
        return changed

    def of_robot(self, robot: str) -> AlarmedValues:
        """The marks of a robot as they are now."""
        if robot not in self._unmarked:
            marked = (alarm for alarm in self._alarms.values() if alarm.is_for(robot or None))
            values = (value for alarm in marked for value in alarm.marked_values)
            self._unmarked[robot] = dict.fromkeys(values, 0)
        priorities = dict(self._unmarked[robot])
        state: AlarmedState | None = None
        for row in sorted(self._active.get(robot, {}).values(), key=lambda row: row["order"]):
            alarm = self._alarms[_alarm_id(row)]
            for value in alarm.marked_values:
                priorities[value] = min(row["priority"], priorities[value] or row["priority"])
            if state is None and alarm.state is not None:
                state = AlarmedState(alarm.state, -row["order"][-1])
        return AlarmedValues(state, priorities)


def _alarm_id(row: AlarmRow) -> str:
    """The id of the alarm in the panel file."""
    return BEHIND_ID.split(row["id"], 1)[0]

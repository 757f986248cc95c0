"""The curves of values around the raise of their alarms, from the histories of their robots."""

import asyncio
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

from app.cell.alarms.states import AlarmInstance, Moment
from app.cell.robot.history import Column
from app.cell.robot.state import RobotState
from app.panel.widgets.trend import RAW_S

BEFORE_S: Final = 8.0
AFTER_S: Final = 6.0
COLUMNS: Final = 140
WIDTH_S: Final = (BEFORE_S + AFTER_S) / COLUMNS
DECODED_S: Final = 0.5  # until the last samples are in the history
MAX_CURVES: Final = 500
MAX_PLANNED: Final = 200


class Curve(NamedTuple):
    """The columns of a field from `BEFORE_S` before to `AFTER_S` after a raise, in its own unit; their
    times are by the wall clock, as `raised_at` is."""

    occurrence: int
    raised_at: float
    columns: Sequence[Column]


class AlarmCurves:
    """The curves of the newest raises. In a flood, only those of its first alarms are kept; the others
    can be read as long as the history reaches back. Used on the event loop only."""

    def __init__(self, robots: Mapping[str, RobotState], now: Callable[[], Moment]) -> None:
        """`robots` are all robots, by their ids; `now` is the clock."""
        self._robots = robots
        self._now = now
        self._kept: dict[str, Curve] = {}
        self._planned: deque[tuple[float, AlarmInstance]] = deque()

    def plan(self, alarm: AlarmInstance) -> None:
        """An alarm was raised: its curve is kept when it is complete."""
        if alarm.definition.alarm.limited_value is None or len(self._planned) >= MAX_PLANNED:
            return
        self._planned.append((self._now().monotonic + AFTER_S + DECODED_S, alarm))
        if len(self._planned) == 1:
            self._wait()

    def of_alarm(self, alarm: AlarmInstance) -> Curve | None:
        """The curve around the last raise of an alarm, as far as it is there; None without one."""
        kept = self._kept.get(alarm.definition.id)
        if kept is not None and kept.occurrence == alarm.status.occurrence:
            return kept
        return self._read(alarm)

    def _wait(self) -> None:
        due, _ = self._planned[0]
        asyncio.get_running_loop().call_later(max(0.0, due - self._now().monotonic), self._keep)

    def _keep(self) -> None:
        """Keeps the first planned curve."""
        _, alarm = self._planned.popleft()
        if (curve := self._read(alarm)) is not None:
            self._kept.pop(alarm.definition.id, None)
            self._kept[alarm.definition.id] = curve
            if len(self._kept) > MAX_CURVES:
                del self._kept[next(iter(self._kept))]
        if self._planned:
            self._wait()

    def _read(self, alarm: AlarmInstance) -> Curve | None:
        """The curve from the robot's history."""
        value, raised_at = alarm.definition.alarm.limited_value, alarm.status.raised_at
        robot = self._robots.get(alarm.definition.robot)
        now, wall = self._now()
        if value is None or raised_at is None or robot is None:
            return None
        if now - raised_at.monotonic > RAW_S - BEFORE_S:
            return None
        topic, path = value
        field = robot.history.fields.get((robot.key(topic), path))
        if field is None:
            return None
        robot.history.set_clock(now, wall)
        raised = wall - (now - raised_at.monotonic)
        begin, end = raised - BEFORE_S, min(raised + AFTER_S, wall)
        columns = robot.history.columns(field, begin, end, WIDTH_S)
        return Curve(alarm.status.occurrence, raised, columns) if columns else None

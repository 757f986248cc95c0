"""The alarms as a robot's session has them: what its turn tells them, and which controls they lock."""

import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any

from app.alarms.engine import AlarmEngine
from app.alarms.entries import AlarmEntry
from app.alarms.instance import AlarmInstance
from app.alarms.rows import AlarmRow
from app.alarms.sources import link_state
from app.i18n import say
from app.permission.verdict import Verdict, locked
from app.robot.alarm_action import AlarmAction
from app.robot.alarmed import AlarmedValues, AlarmSelection
from app.robot.state import RobotState
from app.transport.robot_signals import Signal


class RobotAlarms:
    """The alarms of one robot. Used on the event loop only."""

    def __init__(
        self, engine: AlarmEngine, robot_id: str, robot: RobotState, evaluate: Callable[[], None]
    ) -> None:
        """`evaluate` is called when alarms may be due."""
        self.shown = Signal[[]]()  # the alarms that pages show have changed
        self.locks_changed = Signal[[]]()  # alarms lock other controls than before
        self.marks_changed = Signal[[Collection[str]]]()  # of values of topics with these keys
        self.robot_id = robot_id
        self._engine = engine
        self._robot = robot
        self._evaluate = evaluate
        self._link: tuple[Any, ...] = ()
        self._locks: Mapping[str, Verdict] = {}
        self._locks_version = -1

    def update(self, topics: Collection[str]) -> None:
        """Messages arrived on topics with these keys, or something else has changed."""
        self._engine.topics_changed(self.robot_id, topics)
        link = link_state(self._robot, time.monotonic())
        if link != self._link:
            self._link = link
            self._engine.robot_changed(self.robot_id)
        self._evaluate()

    def entries_received(
        self,
        alarm_id: str,
        entries: Sequence[AlarmEntry],
        at: float,
        is_whole: bool,
        earlier: Collection[str],
    ) -> None:
        """The robot published alarms itself: see the engine's function of this name."""
        self._engine.entries_received(self.robot_id, alarm_id, entries, at, is_whole, earlier)
        self._evaluate()

    def show(self, rows: Iterable[AlarmRow], selections: Mapping[str, AlarmSelection]) -> None:
        """The rows of all robots' alarms have changed, the most urgent first. `selections` are those
        that widgets show."""
        self._robot.alarm_selections = selections
        own = (row for row in rows if row["robot"] == self.robot_id and _stands(row))
        self._robot.alarm_actions = tuple(
            AlarmAction(panel_id(row["id"]), row["action"], row["picture"]) for row in own
        )
        self.shown.emit()

    def show_marks(self, marks: AlarmedValues, topics: Collection[str]) -> None:
        """The values of topics have other marks than before."""
        self._robot.alarmed = marks
        self.marks_changed.emit({key for topic in topics for key in self._robot.possible_keys(topic)})

    def inhibited(self) -> Mapping[str, Verdict]:
        """The locks by alarms, by the widgets' ids."""
        if self._locks_version != self._engine.lock_changes:
            self._locks_version = self._engine.lock_changes
            inhibited = self._engine.inhibited(self.robot_id)
            self._locks = {widget: self._lock(alarm) for widget, alarm in inhibited.items()}
        return self._locks

    def _lock(self, alarm: AlarmInstance) -> Verdict:
        """The lock with the alarm's text and what to do; of another robot's alarm with its robot."""
        name, action, robot = alarm.text, alarm.action, alarm.definition.robot
        if robot != self.robot_id:
            name = say("alarm_of_robot", name=name, robot=self._engine.robots[robot].title)
        _, is_unknown, _ = alarm.lock
        if is_unknown:
            return locked("alarm_inhibits_unknown", name=name)
        if not action:
            return locked("alarm_inhibits", name=name)
        reason = say("alarm_inhibits_action", name=name, action=action)
        return Verdict(False, "alarm_inhibits", reason)


def panel_id(alarm_id: str) -> str:
    """The id in the panel file of an alarm of a robot, or of one that the robot publishes."""
    return alarm_id.partition(":")[0].partition("@")[0]


def _stands(row: AlarmRow) -> bool:
    """Whether something is to be done about an alarm now."""
    return row["state"] in ("active", "latched")

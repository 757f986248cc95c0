"""Whether the robot still publishes the alarms of a source, diagnostics or a list, that lock controls:
before the first message, and after the last one has become too old, it is not known whether one of them
is active."""

import math
from collections.abc import Mapping

from app.alarms.instance import AlarmInstance, Definition
from app.robot.state import RobotState


class SourceWatch:
    """An instance for each source that locks controls. One that is not evaluated locks them as not
    known. `changes` counts how often that has changed."""

    def __init__(self) -> None:
        self._sources: dict[tuple[str, str], AlarmInstance] = {}  # by (robot, alarm's id)
        self.changes = 0

    def add(self, definition: Definition) -> AlarmInstance:
        """The instance of a source from which nothing was heard."""
        source = self._sources[definition.robot, definition.alarm.id] = AlarmInstance(definition)
        return source

    def heard(self, robot: str, alarm_id: str, at: float) -> None:
        """A message of a source arrived; `at` in monotonic seconds."""
        if (source := self._sources.get((robot, alarm_id))) is not None:
            source.heard_at = at
            self._set(source, True)

    def expire(self, robots: Mapping[str, RobotState], now: float) -> None:
        """Marks the sources of which the last message is too old, or whose robot can't be reached."""
        for (name, _), source in self._sources.items():
            robot = robots[name]
            if now >= _stale_at(source) or not robot.link_up or not robot.graph.peers:
                self._set(source, False)

    @property
    def due(self) -> float:
        """When the next source becomes too old (monotonic seconds)."""
        heard = (_stale_at(source) for source in self._sources.values() if source.is_evaluated)
        return min(heard, default=math.inf)

    def _set(self, source: AlarmInstance, is_known: bool) -> None:
        self.changes += source.is_evaluated != is_known
        source.is_evaluated = is_known


def _stale_at(source: AlarmInstance) -> float:
    max_age_s = source.definition.alarm.entry_max_age_s
    return math.inf if max_age_s is None else source.heard_at + max_age_s

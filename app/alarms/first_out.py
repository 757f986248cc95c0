"""First-out: which alarm of a group was raised first, and which ones followed it."""

from collections.abc import Mapping
from typing import NamedTuple

from app.alarms.instance import AlarmInstance, Leader
from app.alarms.status import AlarmStatus, Moment
from app.i18n import TextLike


class _Raise(NamedTuple):
    """A raise that others may follow, at `at` (monotonic seconds)."""

    id: str
    text: TextLike
    at: float


class FirstOut:
    """The first raise in each group of a robot. Alarms that are raised within `within_s` seconds after
    it follow it while it stands."""

    def __init__(self, within_s: float) -> None:
        self._within_s = within_s
        self._first: dict[tuple[str, str], _Raise] = {}  # by (robot, group)

    def update(
        self,
        alarm: AlarmInstance,
        before: AlarmStatus,
        now: Moment,
        alarms: Mapping[str, AlarmInstance],
    ) -> None:
        """Sets which of `alarms` an alarm follows, if it is raised now; None if it is the first."""
        if alarm.status.occurrence != before.occurrence:
            alarm.leader = self._leader(alarm, now.monotonic, alarms)

    def _leader(
        self, alarm: AlarmInstance, now: float, alarms: Mapping[str, AlarmInstance]
    ) -> Leader | None:
        definition = alarm.definition
        group = definition.robot, str(definition.alarm.group or "")
        if not group[1]:
            return None
        first = self._first.get(group)
        if first and first.id != definition.id and now - first.at <= self._within_s:
            leading = alarms.get(first.id)
            if leading is not None and not leading.status.is_normal:
                return Leader(first.id, first.text, now - first.at)
        self._first[group] = _Raise(definition.id, alarm.text, now)
        return None

"""How often alarms were raised and acknowledged since the start of the server."""

from collections import Counter, defaultdict

from app.alarms.instance import Transition
from app.alarms.status import AlarmRules, AlarmStatus


class AlarmCounts:
    """By priority: how many alarms were raised and acknowledged, and the seconds from the raises to the
    acknowledgements together."""

    def __init__(self) -> None:
        self.raised: Counter[int] = Counter()
        self.acknowledged: Counter[int] = Counter()
        self.acknowledge_s: defaultdict[int, float] = defaultdict(float)

    def count(self, transition: Transition, rules: AlarmRules) -> bool:
        """Counts a transition of an alarm with such rules; whether it raised it."""
        before, after = transition.before, transition.after
        is_raised = after.occurrence != before.occurrence
        if is_raised:
            self.raised[_priority(after, rules)] += 1
        if before.raised_at and after.is_acknowledged and transition.act == "acknowledge":
            priority = _priority(before, rules)
            self.acknowledged[priority] += 1
            self.acknowledge_s[priority] += transition.at.monotonic - before.raised_at.monotonic
        return is_raised


def _priority(status: AlarmStatus, rules: AlarmRules) -> int:
    return rules.priority(max(status.level, status.raised_level))

"""How often alarms were raised and acknowledged since the start of the server."""

from app.alarms.instance import Transition


class AlarmCounts:
    """`acknowledge_s` are the seconds from the raises to the acknowledgements together."""

    def __init__(self) -> None:
        self.raised = 0
        self.acknowledged = 0
        self.acknowledge_s = 0.0

    def count(self, transition: Transition) -> bool:
        """Counts a transition; whether it raised an alarm."""
        before, after = transition.before, transition.after
        is_raised = after.occurrence != before.occurrence
        self.raised += is_raised
        if before.raised_at and after.is_acknowledged and transition.act == "acknowledge":
            self.acknowledged += 1
            self.acknowledge_s += transition.at.monotonic - before.raised_at.monotonic
        return is_raised

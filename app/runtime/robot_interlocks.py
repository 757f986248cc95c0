"""Interlocks and conditions of one robot that widgets of another robot name.

A widget is judged in the session of its own robot. An interlock of another robot is judged there too,
by that robot's state: before a press its inbox is emptied, and a change of its verdict runs a turn,
which ends holds and shows the lock.
"""

import time
from collections.abc import Mapping

from app.panel.condition import NamedCondition
from app.permission.interlocks import link_verdict, state_of
from app.runtime.robot_session import RobotSession


def connect_robots(sessions: Mapping[str | None, RobotSession]) -> None:
    """Connects the sessions of a panel's robots; call it before they are started."""
    fleet = {name: session.robot for name, session in sessions.items() if name is not None}
    for session in sessions.values():
        session.robot.fleet = fleet
    for name, session in sessions.items():
        by_others = [
            (other, condition)
            for other in sessions.values()
            for condition in other.panel.of_others
            if condition.robot == name
        ]
        if by_others:
            _Watch(session, by_others).connect()


class _Watch:
    """The verdicts of a robot's conditions that widgets of other robots name."""

    def __init__(
        self, session: RobotSession, by_others: list[tuple[RobotSession, NamedCondition]]
    ) -> None:
        self._session = session
        self._by_others = by_others
        self._known = [self._shown(condition) for _, condition in by_others]

    def connect(self) -> None:
        signals = self._session.context.signals
        signals.ran.connect(self.update)
        for other in {id(other): other for other, _ in self._by_others}.values():
            other.context.signals.judging.connect(self._session.turn.run)
            other.context.awaited.append(self._session.link)

    def update(self) -> None:
        """Runs a turn of each robot whose widgets a change concerns."""
        now = [self._shown(condition) for _, condition in self._by_others]
        known, self._known = self._known, now
        pairs = zip(self._by_others, known, now, strict=True)
        changed = {id(other): other for (other, _), before, after in pairs if before != after}
        for other in changed.values():
            other.turn.changed()

    def _shown(self, condition: NamedCondition) -> object:
        """What others show of a condition, but for its deadline."""
        robot, now = self._session.robot, time.monotonic()
        state = state_of(condition, robot, now, link_verdict(robot, now))
        verdict = state.verdict
        return state.value, verdict.permitted, verdict.code, verdict.reason

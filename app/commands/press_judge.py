"""Decides whether a press may be sent, from everything that has arrived from the robot so far."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from app.audit.press_record import PendingEntry
from app.commands.press import Press
from app.commands.press_guard import PressGuard
from app.commands.receipts import MAX_FINAL_CHECKS, Refusal
from app.errors import PressRefused
from app.i18n import say
from app.panel.model import Panel
from app.panel.widgets.confirmed import confirmation_of
from app.panel.widgets.families import Command
from app.permission.press_permission import cause_of, judged, with_hint
from app.permission.verdict import Verdict
from app.robot.state import RobotState


@dataclass(frozen=True, slots=True)
class PendingSamples:
    """Data that has arrived from the robot: `ingest` applies it to the robot's state, `has_urgent`
    returns whether more has arrived that may change a permission."""

    ingest: Callable[[], None] = lambda: None
    has_urgent: Callable[[], bool] = lambda: False


@dataclass(frozen=True, slots=True)
class Judgement:
    """Whether a press may be sent: the verdict of the permission's checks, and the `refusal`, None if
    it may. A permitted press is refused if its page is outdated."""

    verdict: Verdict
    refusal: Refusal | None = None


class PressJudge:
    """Judges the presses and holds of one robot. Used on the event loop only. Callers must not await
    between the judgement and sending."""

    def __init__(
        self,
        panel: Panel,
        robot: RobotState,
        guard: PressGuard,
        arrivals: PendingSamples,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self.arrivals = arrivals
        self._panel = panel
        self._robot = robot
        self._guard = guard
        self._monotonic = monotonic
        self._closed = False

    def close(self) -> None:
        """Refuses every press from now on."""
        self._closed = True

    def verdict(self, press: Press[Command], now: float) -> Verdict:
        """The verdict of the permission's checks at `now` (monotonic seconds). Ingests nothing."""
        interlocks = self._panel.interlocks_of(press.widget)
        conditions = self._guard.conditions(press.principal)
        if confirmation_of(press.widget):
            conditions = replace(conditions, pressed=True, confirmed=press.confirmed)
        verdict = judged(press.widget, interlocks, self._robot, now, conditions)
        return with_hint(self._panel, press.widget, verdict)

    def judge_at(self, press: Press[Command], now: float) -> Judgement:
        """Whether a press or hold may be sent at `now` (monotonic seconds). Ingests nothing."""
        verdict = self.verdict(press, now)
        if not verdict.permitted:
            return Judgement(verdict, Refusal(verdict.reason or "", cause_of(verdict.code)))
        stale = self._guard.stale_reason(press)
        return Judgement(verdict, Refusal(stale, "interlock") if stale else None)

    def judge(self, press: Press[Command]) -> Judgement:
        """Whether a press may be sent now, after ingesting what has arrived."""
        self.arrivals.ingest()
        judgement = self.judge_at(press, self._monotonic())
        if self._closed and judgement.verdict.permitted:
            return replace(judgement, refusal=Refusal(say("press_during_shutdown"), "interlock"))
        return judgement

    def final_check(self, press: Press[Command], pending: PendingEntry) -> None:
        """Called right before sending: judges again if more has arrived since the judgement.
        PressRefused if the press may not be sent."""
        for _ in range(MAX_FINAL_CHECKS):
            if not self.arrivals.has_urgent():
                return
            judgement = self.judge(press)
            pending.set_verdict(judgement.verdict.code)
            if judgement.refusal:
                raise PressRefused(*judgement.refusal)
        raise PressRefused(say("link_catching_up"), "link")

"""Decides whether a press may be sent, from everything that has arrived from the robot so far."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from app.audit.press_record import PendingEntry
from app.commands.press_context import PressContext
from app.commands.receipts import MAX_FINAL_CHECKS
from app.errors import Cause, PressRefused
from app.i18n import TextLike, say
from app.panel.model import Panel
from app.panel.widgets.families import Command
from app.permission.press_permission import cause_of, judged
from app.permission.verdict import Verdict
from app.robot.state import RobotState


@dataclass(frozen=True, slots=True)
class PendingSamples:
    """Data that has arrived from the robot: `ingest` applies it to the robot's state, `has_urgent`
    returns whether more has arrived that may change a permission."""

    ingest: Callable[[], None] = lambda: None
    has_urgent: Callable[[], bool] = lambda: False


class PressJudge:
    """Checks the permission of one robot's presses. Used on the event loop only. Callers must not await
    between the check and sending."""

    def __init__(
        self,
        panel: Panel,
        robot: RobotState,
        latest: PendingSamples,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._panel = panel
        self._robot = robot
        self._arrivals = latest
        self._monotonic = monotonic
        self._closed = False

    def close(self) -> None:
        """Refuses every press from now on."""
        self._closed = True

    def verdict(self, widget: Command, context: PressContext) -> Verdict:
        """The current verdict, after ingesting what has arrived."""
        self._arrivals.ingest()
        interlocks = self._panel.interlocks_of(widget)
        return judged(widget, interlocks, self._robot, self._monotonic(), context.grounds())

    def judge(self, widget: Command, context: PressContext) -> tuple[Verdict, TextLike, Cause]:
        """The current verdict, why the press may not be sent ("" if it may), and its receipt's
        cause."""
        verdict = self.verdict(widget, context)
        if not verdict.permitted:
            return verdict, verdict.reason or "", cause_of(verdict.code)
        stale = say("press_during_shutdown") if self._closed else context.stale_reason()
        return verdict, stale, "interlock"

    def final_check(self, widget: Command, pending: PendingEntry, context: PressContext) -> None:
        """Called right before sending: checks again if more has arrived since the verdict. PressRefused
        if the press may not be sent."""
        for _ in range(MAX_FINAL_CHECKS):
            if not self._arrivals.has_urgent():
                return
            verdict, why, cause = self.judge(widget, context)
            pending.set_verdict(verdict.code)
            if why:
                raise PressRefused(why, cause)
        raise PressRefused(say("link_catching_up"), "link")

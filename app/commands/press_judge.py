"""Whether a press may be sent now, by all that has come from the robot until this moment."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from app.audit.press_record import PendingEntry
from app.commands.press_context import PressContext
from app.commands.receipts import MOST_LOOKS
from app.errors import Cause, PressRefused
from app.i18n import TextLike, say
from app.panel.model import Panel
from app.panel.widgets.families import Command
from app.permission.interlocks import Verdict
from app.permission.press_permission import cause_of, judged
from app.robot.state import RobotState


@dataclass(frozen=True, slots=True)
class Latest:
    """What has come from the robot: `take` takes all of it in, `news` tells whether more has come that
    may change what is permitted."""

    take: Callable[[], None] = lambda: None
    news: Callable[[], bool] = lambda: False


class PressJudge:
    """Of one robot; used on the event loop only. Between judging and sending nothing waits."""

    def __init__(
        self,
        panel: Panel,
        robot: RobotState,
        latest: Latest,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._panel = panel
        self._robot = robot
        self._latest = latest
        self._monotonic = monotonic
        self._closed = False

    def close(self) -> None:
        """From now on nothing may be sent."""
        self._closed = True

    def verdict(self, widget: Command, context: PressContext) -> Verdict:
        """The permission now, when all that has come is taken in."""
        self._latest.take()
        interlocks = self._panel.interlocks_of(widget)
        return judged(widget, interlocks, self._robot, self._monotonic(), context.grounds())

    def ground(self, widget: Command, context: PressContext) -> tuple[Verdict, TextLike, Cause]:
        """The verdict now, and why it may not be sent, "" if it may."""
        verdict = self.verdict(widget, context)
        if not verdict.permitted:
            return verdict, verdict.reason or "", cause_of(verdict.code)
        stale = say("press_by_stopping") if self._closed else context.stale_reason()
        return verdict, stale, "interlock"

    def last_look(self, widget: Command, pending: PendingEntry, context: PressContext) -> None:
        """Right before it is sent: what came while it was judged and encoded counts, too. PressRefused
        where it may not be sent."""
        for _ in range(MOST_LOOKS):
            if not self._latest.news():
                return
            verdict, why, cause = self.ground(widget, context)
            pending.judged(verdict.code)
            if why:
                raise PressRefused(why, cause)
        raise PressRefused(say("catching_up"), "link")

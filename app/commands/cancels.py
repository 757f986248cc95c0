"""Cancelling a goal. Every client may, with or without control, at any time."""

import asyncio
import time

from app.audit.press_record import PressLog
from app.clock import format_time
from app.commands.actions.goals import GoalTracker
from app.commands.press import Press
from app.commands.receipts import Receipt, close_entry, origin_text, receipt_of
from app.commands.refusals import EarlyRefusals
from app.concurrency import CancellableWaits
from app.errors import Cause, LinkError, NotFound
from app.i18n import say
from app.panel.widgets.families import PressCommand
from app.panel.widgets.service_action import Action
from app.robot.command_status import Outcome
from app.ros_logging import RobotLog


class Cancels:
    """The cancel requests of one robot's goals. Used on the event loop only."""

    def __init__(
        self,
        goals: GoalTracker,
        press_log: PressLog,
        early_refusals: EarlyRefusals,
        waits: CancellableWaits,
        log: RobotLog,
    ) -> None:
        self._goals = goals
        self._press_log = press_log
        self._early_refusals = early_refusals
        self._waits = waits
        self._log = log

    async def cancel(self, cancel: Press[PressCommand], press_id: str) -> Receipt:
        """Asks the robot to cancel the goal of a press; with the id "", the running goal. NotFound for
        widgets that are not actions."""
        widget, origin = cancel.widget, cancel.origin
        if not isinstance(widget, Action):
            raise NotFound(f'"{widget.id}" is not an action: there is nothing to cancel')
        if (why := self._goals.no_goal_reason(widget, press_id)) and not self._press_log.has_room(
            origin
        ):
            receipt = receipt_of(cancel, Outcome("refused", why), "interlock")
            return self._early_refusals.count_only(receipt, origin)
        writing = asyncio.ensure_future(self._press_log.canceled(cancel.logged("cancel")))
        try:
            # A slow or failing disk must not delay a cancel.
            answer, cause = await self._canceled(widget, press_id)
        except BaseException:
            (await writing).close_unknown("press_server_error")
            raise
        pending = await writing
        self._log.info(
            "cancel of %s by %s: %s: %s", widget.id, origin_text(origin), answer.outcome, answer.text
        )
        return await close_entry(pending, receipt_of(cancel, answer, cause))

    async def _canceled(self, widget: Action, press_id: str) -> tuple[Outcome, Cause]:
        try:
            async with self._waits.cancellable():
                answer = await self._goals.cancel(widget, press_id)
        except TimeoutError:
            return Outcome("unknown", say("press_unknown_at_shutdown")), ""
        except LinkError as error:
            text = say("press_not_encoded", why=error.text, time=format_time(time.time()))
            return Outcome("refused", text), "link"
        return answer, "interlock" if answer.outcome == "refused" else ""

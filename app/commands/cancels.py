"""Cancelling a goal: anyone may, with or without control, and however late."""

import asyncio
import time

from app.audit import Origin
from app.audit.press_record import PressLog
from app.clock import format_time
from app.commands.dispatch import Dispatcher
from app.commands.receipts import Receipt, closed, named, receipt_of
from app.commands.refusals import EarlyRefusals
from app.concurrency import CancellableWaits
from app.errors import Cause, LinkError, NotFound
from app.i18n import say
from app.panel.widgets.service_action import Action
from app.robot.command_status import Outcome
from app.ros_logging import RobotLog


class Cancels:
    """Of one panel; used on the event loop only."""

    def __init__(
        self,
        dispatcher: Dispatcher,
        press_log: PressLog,
        early_refusals: EarlyRefusals,
        waits: CancellableWaits,
        log: RobotLog,
    ) -> None:
        self._dispatcher = dispatcher
        self._press_log = press_log
        self._early_refusals = early_refusals
        self._waits = waits
        self._log = log

    async def cancel(self, widget_id: str, origin: Origin, press_id: str = "") -> Receipt:
        """Asks the robot to cancel the goal of one press or, without its id, the one under way."""
        widget = self._dispatcher.widget(widget_id)
        if not isinstance(widget, Action):
            raise NotFound(f'"{widget_id}" is not an action: there is nothing to cancel')
        if (why := self._dispatcher.over(widget, press_id)) and not self._press_log.room(origin):
            answer = Outcome("refused", why)
            return self._early_refusals.counted(receipt_of(widget, {}, "", answer, "interlock"), origin)
        noting = asyncio.ensure_future(self._press_log.canceled(widget_id, origin))
        try:
            # No disk keeps anyone from stopping a robot.
            answer, cause = await self._canceled(widget, press_id)
        except BaseException:
            (await noting).broke_off("log_broke_off")
            raise
        pending = await noting
        self._log.info(
            "cancel of %s by %s: %s: %s", widget_id, named(origin), answer.outcome, answer.text
        )
        receipt = receipt_of(widget, {}, "", answer, cause)
        return await closed(pending, receipt)

    async def _canceled(self, widget: Action, press_id: str) -> tuple[Outcome, Cause]:
        try:
            async with self._waits.cancellable():
                answer = await self._dispatcher.cancel(widget, press_id)
        except TimeoutError:
            return Outcome("unknown", say("server_ends")), ""
        except LinkError as error:
            text = say("not_encoded", why=error.text, time=format_time(time.time()))
            return Outcome("refused", text), "link"
        return answer, "interlock" if answer.outcome == "refused" else ""

"""Presses of stop buttons that are for several robots: one command to each, and one receipt of all."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace

from app.cell.commands.press import Press
from app.cell.commands.receipts import RECEIPTS_KEPT, Receipt, receipt_of
from app.cell.commands.stop_receipts import StopOutcome, id_of_robot, receipt_of_several
from app.cell.session.session import RobotSession
from app.panel.widgets.families import PressCommand
from app.records.entry import Outcome
from app.system.limits import BoundedDict
from app.system.texts import say

log = logging.getLogger("kiosk.presses")

Count = Callable[[Awaitable[Receipt]], Awaitable[Receipt]]


class GroupStops:
    """The receipts are kept as those of other presses are. The same id again is the same press."""

    def __init__(self) -> None:
        self._receipts = BoundedDict[str, Receipt](RECEIPTS_KEPT)

    def receipt(self, press_id: str) -> Receipt | None:
        """The receipt of a press; None for unknown ids."""
        return self._receipts.get(press_id)

    async def press(
        self, sessions: Sequence[RobotSession], press: Press[PressCommand], count: Count
    ) -> Receipt:
        """Stops each robot at once: none waits for another. `count` runs the command of one robot."""
        for session in sessions:
            session.press_guard.receive(press)
        receipts = await asyncio.gather(*(_stop(session, press, count) for session in sessions))
        stops = [
            StopOutcome(session.entry.id if session.entry else "", session.robot.title, receipt)
            for session, receipt in zip(sessions, receipts, strict=True)
        ]
        receipt = receipt_of_several(press.id, stops)
        self._receipts[press.id] = receipt
        return receipt


async def _stop(session: RobotSession, press: Press[PressCommand], count: Count) -> Receipt:
    """Stops one robot. What fails at one robot does not concern the others."""
    robot = session.entry.id if session.entry else ""
    own = replace(
        press, id=id_of_robot(press.id, robot), widget=session.presses.widget(press.widget.id)
    )
    try:
        return await count(session.presses.press(own))
    except Exception:
        log.exception("the stop of %s broke off", session.robot.name)
        return receipt_of(own, Outcome("unknown", say("press_server_error")))

"""What shows that a command took effect: a field of the robot's that comes to have a value.

Only what arrives after the command counts. A confirmation that comes after its time corrects the
receipt, as a late answer of a service does.
"""

import asyncio
import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from app.clock import format_time
from app.i18n import TextLike, joined, say
from app.panel.values import same_value
from app.panel.widgets.publish import Confirm, SinglePublish
from app.robot.command_status import CommandStatus, OnCorrection, Outcome
from app.robot.state import Reading, RobotState
from app.ros_logging import RobotLog

log = logging.getLogger("kiosk.confirmations")

LATE_S: Final = 60.0  # how long after its time a confirmation is still looked for
CLOSE: Final = 1e-6  # a float32 comes back as the nearest one


@dataclass(eq=False, slots=True)
class _Waiting:
    """A command that was sent at `since` (monotonic seconds) and is not confirmed yet."""

    widget: SinglePublish
    confirm: Confirm
    equals: Any
    press_id: str
    since: float
    confirmed: "asyncio.Future[float]"
    late: bool = False


class Confirmations:
    """The commands of one robot that wait for their effect; used on the event loop only."""

    def __init__(self, robot: RobotState, changed: Callable[[], None]) -> None:
        """`changed` is called when what the widgets show has changed."""
        self._robot = robot
        self._changed = changed
        self._log = RobotLog(log, robot.name)
        self._waiting: dict[str, list[_Waiting]] = {}
        self._latest: dict[str, str] = {}

    async def awaited(
        self,
        widget: SinglePublish,
        equals: Any,
        press_id: str,
        since: float,
        sent: TextLike,
        corrected: OnCorrection,
    ) -> Outcome:
        """The result of a command that went out at `since` (monotonic seconds), as `sent` says."""
        confirm = widget.confirm
        assert confirm is not None
        future: asyncio.Future[float] = asyncio.get_running_loop().create_future()
        waiting = _Waiting(widget, confirm, equals, press_id, since, future)
        for older in [w for w in self._waiting.get(self._robot.key(confirm.topic), []) if w.late]:
            self._forget(older)  # what comes now may be of this one
        self._waiting.setdefault(self._robot.key(confirm.topic), []).append(waiting)
        self._latest[widget.id] = press_id
        self._show(
            widget, CommandStatus(busy=True, text=say("waiting_for_effect", topic=confirm.topic))
        )
        try:
            await asyncio.wait({future}, timeout=confirm.within_s)
        except asyncio.CancelledError:
            self._forget(waiting)
            raise
        answer = self._confirmed(waiting) if future.done() else self._missed(waiting, sent, corrected)
        self._show_last(waiting, answer)
        return answer

    def _missed(self, waiting: _Waiting, sent: TextLike, corrected: OnCorrection) -> Outcome:
        confirm = waiting.confirm
        waiting.late = True
        waiting.confirmed.add_done_callback(lambda _: self._too_late(waiting, corrected))
        asyncio.get_running_loop().call_later(LATE_S, self._forget, waiting)
        limit = f"{confirm.within_s:g}"
        missed = say("no_effect", topic=confirm.topic, seconds=limit)
        return Outcome("unknown", joined([sent, missed]))

    def awaits(self, key: str) -> bool:
        """Whether what this topic says next may confirm something."""
        return any(not waiting.confirmed.done() for waiting in self._waiting.get(key, ()))

    def hear(self, key: str, reading: Reading) -> None:
        """After each message of a topic: of several presses of a widget it confirms the oldest, for
        one effect is no proof of two commands."""
        done: set[str] = set()
        for waiting in [w for w in self._waiting.get(key, []) if not w.confirmed.done()]:
            if waiting.widget.id in done or reading.status != "message" or reading.at < waiting.since:
                continue
            if equal(reading.value(waiting.confirm.field), waiting.equals):
                waiting.confirmed.set_result(reading.wall)
                done.add(waiting.widget.id)

    def _confirmed(self, waiting: _Waiting) -> Outcome:
        self._forget(waiting)
        at = format_time(waiting.confirmed.result())
        return Outcome("confirmed", say("confirmed", topic=waiting.confirm.topic, time=at))

    def _too_late(self, waiting: _Waiting, corrected: OnCorrection) -> None:
        if waiting.confirmed.cancelled():
            return
        answer = self._confirmed(waiting)
        self._log.warning("press %s: a late confirmation: %s", waiting.press_id, answer.text)
        corrected(waiting.press_id, answer)
        self._show_last(waiting, answer)

    def _forget(self, waiting: _Waiting) -> None:
        key = self._robot.key(waiting.confirm.topic)
        left = [one for one in self._waiting.get(key, []) if one is not waiting]
        self._waiting[key] = left
        waiting.confirmed.cancel()

    def _show_last(self, waiting: _Waiting, answer: Outcome) -> None:
        if self._latest.get(waiting.widget.id) == waiting.press_id:
            self._show(waiting.widget, CommandStatus(outcome=answer.outcome, text=answer.text))

    def _show(self, widget: SinglePublish, progress: CommandStatus) -> None:
        self._robot.command_status[widget.id] = progress
        self._changed()


def equal(value: Any, wanted: Any) -> bool:
    """Whether a field has the value; floats as near as the type has them."""
    if isinstance(value, float) and isinstance(wanted, int | float):
        return math.isclose(value, wanted, rel_tol=CLOSE, abs_tol=0.0)
    return same_value(value, wanted)

"""Confirmations: a field of a robot's topic has the expected value after a command.

Only messages that arrive after the command count. A confirmation after the time limit corrects the
receipt, as a late service response does.
"""

import asyncio
import logging
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Final

from app.clock import format_time
from app.i18n import TextLike, joined, number, say
from app.panel.values import same_value
from app.panel.widgets.publish import Confirm, PublishPress
from app.robot.command_status import CommandStatus, OnCorrection, Outcome
from app.robot.sample_handlers import SampleHandlers
from app.robot.state import Reading, RobotState
from app.ros_logging import RobotLog

log = logging.getLogger("kiosk.confirmations")

LATE_S: Final = 60.0  # after the time limit, a confirmation still corrects the receipt
FLOAT_TOLERANCE: Final = 1e-6  # relative: a float32 field holds the nearest float32


@dataclass(eq=False, slots=True)
class _Waiting:
    """An unconfirmed command, sent at `since` (monotonic seconds). `confirmed` is done with the wall
    time of the confirmation; `late` is true after the time limit."""

    widget: PublishPress
    confirm: Confirm
    equals: Any
    press_id: str
    since: float
    confirmed: "asyncio.Future[float]"
    late: bool = False


class Confirmations:
    """The unconfirmed commands of one robot. Used on the event loop only."""

    def __init__(self, robot: RobotState, changed: Callable[[], None]) -> None:
        """`changed` is called when the status of a command has changed."""
        self._robot = robot
        self._changed = changed
        self._log = RobotLog(log, robot.name)
        self._waiting: dict[str, list[_Waiting]] = {}
        self._latest: dict[str, str] = {}

    def register(self, handlers: SampleHandlers, confirms: Iterable[Confirm]) -> None:
        """Awaits readings of the topics of these confirmations from now on."""
        for confirm in confirms:
            for key in self._robot.possible_keys(confirm.topic):
                handlers.await_readings(key, self.is_awaited)

    async def wait(
        self,
        widget: PublishPress,
        equals: Any,
        press_id: str,
        since: float,
        sent: TextLike,
        corrected: OnCorrection,
    ) -> Outcome:
        """Waits for the confirmation of a command that was sent at `since` (monotonic seconds); `sent`
        is the sentence about the sending. `corrected` is called for a late confirmation."""
        confirm = widget.confirm
        assert confirm is not None
        future: asyncio.Future[float] = asyncio.get_running_loop().create_future()
        waiting = _Waiting(widget, confirm, equals, press_id, since, future)
        for older in [w for w in self._waiting.get(self._robot.key(confirm.topic), []) if w.late]:
            self._forget(older)  # a message from now on may be the effect of the new command
        self._waiting.setdefault(self._robot.key(confirm.topic), []).append(waiting)
        self._latest[widget.id] = press_id
        self._show(
            widget, CommandStatus(busy=True, text=say("confirmation_waiting", topic=confirm.topic))
        )
        try:
            await asyncio.wait({future}, timeout=confirm.within_s)
        except asyncio.CancelledError:
            self._forget(waiting)
            raise
        answer = self._confirmed(waiting) if future.done() else self._time_out(waiting, sent, corrected)
        self._show_last(waiting, answer)
        return answer

    def _time_out(self, waiting: _Waiting, sent: TextLike, corrected: OnCorrection) -> Outcome:
        confirm = waiting.confirm
        waiting.late = True
        waiting.confirmed.add_done_callback(lambda _: self._confirm_late(waiting, corrected))
        asyncio.get_running_loop().call_later(LATE_S, self._forget, waiting)
        limit = number(f"{confirm.within_s:g}")
        missed = say("confirmation_missing", topic=confirm.topic, seconds=limit)
        return Outcome("unknown", joined([sent, missed]))

    def is_awaited(self, key: str) -> bool:
        """Whether the next message of this topic may confirm a command."""
        return any(not waiting.confirmed.done() for waiting in self._waiting.get(key, ()))

    def update(self, key: str, reading: Reading) -> None:
        """Checks a new message of a topic. Of several presses of a widget it confirms only the oldest:
        one effect does not prove two commands."""
        done: set[str] = set()
        for waiting in [w for w in self._waiting.get(key, []) if not w.confirmed.done()]:
            field = waiting.confirm.field
            own = reading.of_field(field, math.inf)
            if waiting.widget.id in done or own.status != "message" or own.at < waiting.since:
                continue
            if equal(own.value(field), waiting.equals):
                waiting.confirmed.set_result(own.wall)
                done.add(waiting.widget.id)

    def _confirmed(self, waiting: _Waiting) -> Outcome:
        self._forget(waiting)
        at = format_time(waiting.confirmed.result())
        return Outcome("confirmed", say("confirmed", topic=waiting.confirm.topic, time=at))

    def _confirm_late(self, waiting: _Waiting, corrected: OnCorrection) -> None:
        if waiting.confirmed.cancelled():
            return
        answer = self._confirmed(waiting)
        self._log.warning("press %s: late confirmation: %s", waiting.press_id, answer.text)
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

    def _show(self, widget: PublishPress, progress: CommandStatus) -> None:
        self._robot.command_status[widget.id] = progress
        self._changed()


def equal(value: Any, wanted: Any) -> bool:
    """Whether a field has the value; floats are compared with `FLOAT_TOLERANCE`."""
    if isinstance(value, float) and isinstance(wanted, int | float):
        return math.isclose(value, wanted, rel_tol=FLOAT_TOLERANCE, abs_tol=0.0)
    return same_value(value, wanted)

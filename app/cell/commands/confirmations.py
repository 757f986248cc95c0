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

from app.cell.commands.press import PressHandle
from app.cell.robot.sample_handlers import SampleHandlers
from app.cell.robot.state import Reading, RobotState
from app.panel.values import same_value
from app.panel.widgets.families import PressCommand
from app.panel.widgets.publish import Confirm
from app.records.entry import CommandStatus, Outcome
from app.system.clock import format_time
from app.system.log import RobotLog
from app.system.texts import TextLike, joined, number, say

log = logging.getLogger("kiosk.confirmations")

LATE_S: Final = 60.0  # after the time limit, a confirmation still corrects the receipt
FLOAT_TOLERANCE: Final = 1e-6  # relative: a float32 field holds the nearest float32


@dataclass(frozen=True, slots=True)
class Unconfirmed:
    """A command that was sent at `since` (monotonic seconds) and has the effect that the field of
    `confirm` is `expected`. `sentence` is the sentence about the sending."""

    widget: PressCommand
    confirm: Confirm
    expected: Any
    since: float
    sentence: TextLike


@dataclass(eq=False, slots=True)
class _Waiting:
    """A command whose confirmation is awaited. `confirmed` is done with the wall time of the
    confirmation; `late` is true after the time limit."""

    command: Unconfirmed
    handle: PressHandle
    confirmed: "asyncio.Future[float]"
    late: bool = False

    @property
    def widget(self) -> PressCommand:
        return self.command.widget

    @property
    def confirm(self) -> Confirm:
        return self.command.confirm


class Confirmations:
    """The unconfirmed commands of one robot. Used on the event loop only."""

    def __init__(self, robot: RobotState, status_set: Callable[[str], None]) -> None:
        """`status_set` is called with the id of a widget of which the status has changed."""
        self._robot = robot
        self._status_set = status_set
        self._log = RobotLog(log, robot.name)
        self._waiting: dict[str, list[_Waiting]] = {}
        self._latest: dict[str, str] = {}

    def register(self, handlers: SampleHandlers, confirms: Iterable[Confirm]) -> None:
        """Awaits readings of the topics of these confirmations from now on."""
        for confirm in confirms:
            for key in self._robot.possible_keys(confirm.topic):
                handlers.await_readings(key, self.is_awaited)

    async def wait(self, command: Unconfirmed, handle: PressHandle) -> Outcome:
        """Waits for the confirmation of a command; a late one corrects the receipt."""
        widget, confirm = command.widget, command.confirm
        future: asyncio.Future[float] = asyncio.get_running_loop().create_future()
        waiting = _Waiting(command, handle, future)
        for older in [w for w in self._waiting.get(self._robot.key(confirm.topic), []) if w.late]:
            self._forget(older)  # a message from now on may be the effect of the new command
        self._waiting.setdefault(self._robot.key(confirm.topic), []).append(waiting)
        self._latest[widget.id] = handle.press_id
        self._show(
            widget, CommandStatus(busy=True, text=say("confirmation_waiting", topic=confirm.topic))
        )
        try:
            await asyncio.wait({future}, timeout=confirm.within_s)
        except asyncio.CancelledError:
            self._forget(waiting)
            raise
        answer = self._confirmed(waiting) if future.done() else self._time_out(waiting)
        self._show_last(waiting, answer)
        return answer

    def _time_out(self, waiting: _Waiting) -> Outcome:
        confirm = waiting.confirm
        waiting.late = True
        waiting.confirmed.add_done_callback(lambda _: self._confirm_late(waiting))
        asyncio.get_running_loop().call_later(LATE_S, self._forget, waiting)
        limit = number(f"{confirm.within_s:g}")
        missed = say("confirmation_missing", topic=confirm.topic, seconds=limit)
        return Outcome("unknown", joined([waiting.command.sentence, missed]))

    def confirmed_since(self, confirm: Confirm, expected: Any, since: float) -> Outcome | None:
        """The outcome if the field has the expected value since `since` (monotonic seconds)."""
        reading = self._robot.reading(confirm.topic).of_field(confirm.field, math.inf)
        is_known = reading.status == "message" and reading.at >= since
        if not is_known or not equal(reading.value(confirm.field), expected):
            return None
        return Outcome(
            "confirmed", say("confirmed", topic=confirm.topic, time=format_time(reading.wall))
        )

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
            if waiting.widget.id in done or own.status != "message" or own.at < waiting.command.since:
                continue
            if equal(own.value(field), waiting.command.expected):
                waiting.confirmed.set_result(own.wall)
                done.add(waiting.widget.id)

    def _confirmed(self, waiting: _Waiting) -> Outcome:
        self._forget(waiting)
        at = format_time(waiting.confirmed.result())
        return Outcome("confirmed", say("confirmed", topic=waiting.confirm.topic, time=at))

    def _confirm_late(self, waiting: _Waiting) -> None:
        if waiting.confirmed.cancelled():
            return
        answer = self._confirmed(waiting)
        press_id = waiting.handle.press_id
        self._log.warning("press %s: late confirmation: %s", press_id, answer.text)
        waiting.handle.correct(answer)
        self._show_last(waiting, answer)

    def _forget(self, waiting: _Waiting) -> None:
        key = self._robot.key(waiting.confirm.topic)
        self._waiting[key] = [other for other in self._waiting.get(key, []) if other is not waiting]
        waiting.confirmed.cancel()

    def _show_last(self, waiting: _Waiting, answer: Outcome) -> None:
        if self._latest.get(waiting.widget.id) == waiting.handle.press_id:
            self._show(waiting.widget, CommandStatus(outcome=answer.outcome, text=answer.text))

    def _show(self, widget: PressCommand, progress: CommandStatus) -> None:
        self._robot.command_status[widget.id] = progress
        self._status_set(str(widget.id))


def equal(value: Any, wanted: Any) -> bool:
    """Whether a field has the value; floats are compared with `FLOAT_TOLERANCE`."""
    if isinstance(value, float) and isinstance(wanted, int | float):
        return math.isclose(value, wanted, rel_tol=FLOAT_TOLERANCE, abs_tol=0.0)
    return same_value(value, wanted)

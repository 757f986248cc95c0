"""One press: log entry, permission, encoding, sending, log entry, receipt. No HTTP.

Permission is checked here, on the server's state after the press is in the operator's log; the
browser's state does not count. Nothing is awaited between the check and sending.
"""

import asyncio
import logging
from collections.abc import Coroutine, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from app.audit import Repeated
from app.audit.press_record import LoggedPress, PendingEntry, PressLog
from app.commands.cancels import Cancels
from app.commands.dispatch import Dispatcher
from app.commands.press import Press, PressHandle
from app.commands.press_judge import PressJudge
from app.commands.receipts import (
    GOOD_OUTCOMES,
    MAX_LOGGED_CHARS,
    PressRecorder,
    Receipt,
    Receipts,
    Refusal,
    close_entry,
    corrected,
    origin_text,
    outcome_text,
    receipt_of,
    refused_receipt,
    with_confirmation,
)
from app.commands.refusals import EarlyRefusals
from app.commands.repeated_after_restart import RepeatedPresses
from app.concurrency import CancellableWaits
from app.errors import FieldError, InputError, LinkError, LogError, PressRefused
from app.i18n import say
from app.panel.widgets.families import PressCommand
from app.robot.command_status import Outcome
from app.ros_logging import RobotLog, rosout_extra

log = logging.getLogger("kiosk.presses")


@dataclass(frozen=True, slots=True)
class _InFlightPress:
    """A press without a receipt yet."""

    press: Press[PressCommand]
    receipt: "asyncio.Future[Receipt]"

    @property
    def widget(self) -> str:
        return self.press.widget.id

    @property
    def fingerprint(self) -> str:
        return self.press.fingerprint


class Presses:
    """Presses of one panel, with their receipts by press id."""

    def __init__(
        self,
        judge: PressJudge,
        dispatcher: Dispatcher,
        press_log: PressLog,
        robot: str = "",
        recorder: PressRecorder | None = None,
    ) -> None:
        """`robot` is its name in the server's log, "" if there is only one."""
        self._log = RobotLog(log, robot)
        self._judge = judge
        self._dispatcher = dispatcher
        self._press_log = press_log
        self._in_flight: dict[str, _InFlightPress] = {}
        self._receipts = Receipts(recorder)
        self._waits = CancellableWaits()
        self.early_refusals = EarlyRefusals(judge, dispatcher, press_log, self._receipts, self._log)
        self._repeated = RepeatedPresses(dispatcher, self.early_refusals, self._log)
        self._cancels = Cancels(
            dispatcher.actions, press_log, self.early_refusals, self._waits, self._log
        )

    def close(self) -> None:
        """Refuses every press from now on. Goals can still be canceled."""
        self._judge.close()

    def widget(self, widget_id: str) -> PressCommand:
        """The command widget with this id; NotFound for every other id."""
        return self._dispatcher.widget(widget_id)

    def receipt(self, press_id: str) -> Receipt | None:
        """The current receipt of a press; None for unknown ids."""
        return self._receipts.get(press_id)

    async def press(self, press: Press[PressCommand]) -> Receipt:
        """Sends the widget's command, or refuses it. The same id again is the same press.

        Permission is checked at the moment of sending. Inputs with a default in the panel file may be
        left out.
        """
        press = self._dispatcher.with_defaults(press)
        known = self._in_flight.get(press.id) or self._receipts.get_own(press.id)
        if known is None and not self._receipts.is_past(press.id):
            if unlogged := self.early_refusals.unlogged_refusal(press):
                return unlogged
            return await self._run_once(press, self._press_logged(press))
        if known is None:
            return await self.early_refusals.refuse(press, say("press_already_made", id=press.id))
        if (known.widget, known.fingerprint) != (press.widget.id, press.fingerprint):
            return await self.early_refusals.refuse(press, say("press_id_reused", id=press.id))
        if isinstance(known, _InFlightPress):
            return await asyncio.shield(known.receipt)
        return known

    async def cancel(self, cancel: Press[PressCommand], press_id: str = "") -> Receipt:
        """Asks the robot to cancel the goal of a press; without a press id, the running goal. Every
        client may, with or without control, at any time."""
        return await self._cancels.cancel(cancel, press_id)

    def cancel_all(self) -> None:
        """Ends all waiting for the robot; the outcome of these presses is unknown."""
        self._waits.cancel_all()

    async def _run_once(
        self, press: Press[PressCommand], work: Coroutine[Any, Any, Receipt]
    ) -> Receipt:
        """Runs the work of a press; repetitions of the same id wait for its receipt."""
        in_flight = _InFlightPress(press, asyncio.get_running_loop().create_future())
        self._in_flight[press.id] = in_flight
        try:
            receipt = await work
        except BaseException as error:
            in_flight.receipt.set_exception(error)
            in_flight.receipt.exception()  # retrieved: there may be no repetition that waits
            raise
        finally:
            del self._in_flight[press.id]
        in_flight.receipt.set_result(receipt)
        if receipt.id == press.id:  # a refusal with an id of its own is kept already
            self._receipts.keep(receipt)
        return receipt

    async def _press_logged(self, press: Press[PressCommand]) -> Receipt:
        logged = press.logged()
        try:
            pending = await self._press_log.pressed(logged)
        except Repeated as known:
            return await self._repeated.receipt(press, known)
        except LogError as error:
            self._receipts.record_press(logged)
            receipt = refused_receipt(press, Refusal(error.text, "log"))
        else:
            self._receipts.record_press(logged)
            with _always_closed(pending):
                receipt = await self._judge_and_send(press, pending)
            receipt = await close_entry(pending, with_confirmation(receipt, press))
        self._log_receipt(press, logged, receipt)
        return receipt

    def _log_receipt(self, press: Press[PressCommand], logged: LoggedPress, receipt: Receipt) -> None:
        """Writes a receipt to the server's log and, without the inputs, to the robot's."""
        level = logging.INFO if receipt.outcome in GOOD_OUTCOMES else logging.WARNING
        who, outcome = origin_text(logged.origin), outcome_text(press.widget, receipt)
        extra = rosout_extra(f"press {press.id} of {press.widget.id} by {who}: {outcome}")
        self._log.log(level, "press %s of %s by %s with %.*s: %s: %s", press.id, press.widget.id, who,
                MAX_LOGGED_CHARS, logged.inputs, receipt.outcome, receipt.reason,
                extra=extra)  # fmt: skip

    def _correct(self, press_id: str, pending: PendingEntry, answer: Outcome) -> None:
        """Corrects the log entry and the receipt of a press."""
        pending.correct(answer)
        if old := self._receipts.get(press_id):
            self._receipts.keep(corrected(old, answer))

    async def _judge_and_send(self, press: Press[PressCommand], pending: PendingEntry) -> Receipt:
        judgement = self._judge.judge(press)
        pending.set_verdict(judgement.verdict.code)
        if judgement.refusal:
            return refused_receipt(press, judgement.refusal)
        correct = partial(self._correct, press.id, pending)
        final_check = partial(self._judge.final_check, press, pending)
        try:
            async with self._waits.cancellable():
                answer = await self._dispatcher.send(
                    press, PressHandle(press.id, correct, final_check, pending.hash)
                )
        except TimeoutError:
            return receipt_of(press, Outcome("unknown", say("press_unknown_at_shutdown")))
        except (FieldError, InputError) as error:
            return refused_receipt(press, Refusal(error.text, "input"), "press_not_encoded")
        except LinkError as error:
            return refused_receipt(press, Refusal(error.text, "link"), "press_not_encoded")
        except PressRefused as error:
            return refused_receipt(press, Refusal(error.reason, error.cause))
        if answer.outcome == "refused":
            return refused_receipt(press, Refusal(answer.text, "interlock"), "press_not_encoded")
        return receipt_of(press, answer, "time" if answer.outcome == "timed_out" else "")


@contextmanager
def _always_closed(pending: PendingEntry) -> Iterator[None]:
    """Closes the press's log entry as unknown if the block raises."""
    try:
        yield
    except asyncio.CancelledError:
        pending.close_unknown("press_unknown_server_ended")
        raise
    except BaseException:
        pending.close_unknown("press_server_error")
        raise

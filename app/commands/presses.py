"""One press: log entry, permission, encoding, sending, log entry, receipt. No HTTP.

Permission is checked here, on the server's state after the press is in the operator's log; the
browser's state does not count. Nothing is awaited between the check and sending.
"""

import asyncio
import logging
import time
from collections.abc import Coroutine, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from app.audit import Origin, Repeated
from app.audit.press_record import PendingEntry, PressLog
from app.clock import format_time
from app.commands.cancels import Cancels
from app.commands.dispatch import Dispatcher
from app.commands.press_context import PressContext
from app.commands.press_judge import PressJudge
from app.commands.receipts import (
    GOOD_OUTCOMES,
    MAX_LOGGED_CHARS,
    PressRecorder,
    Receipt,
    Receipts,
    close_entry,
    corrected,
    fingerprint,
    origin_text,
    outcome_text,
    receipt_of,
)
from app.commands.refusals import EarlyRefusals
from app.commands.repeated import RepeatedPresses
from app.concurrency import CancellableWaits
from app.errors import Cause, FieldError, InputError, LinkError, LogError, PressRefused
from app.i18n import TextLike, say
from app.panel.widgets.families import PressCommand
from app.robot.command_status import Outcome
from app.ros_logging import RobotLog, rosout_extra

log = logging.getLogger("kiosk.presses")


@dataclass(frozen=True, slots=True)
class _InFlightPress:
    """A press without a receipt yet."""

    widget: str
    inputs: Mapping[str, Any]
    receipt: "asyncio.Future[Receipt]"

    @property
    def fingerprint(self) -> str:
        return fingerprint(self.inputs)


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
            dispatcher.widget,
            dispatcher.actions,
            press_log,
            self.early_refusals,
            self._waits,
            self._log,
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

    async def press(
        self, widget_id: str, inputs: Mapping[str, Any], press_id: str, context: PressContext
    ) -> Receipt:
        """Sends the widget's command, or refuses it. The same id again is the same press.

        Permission is checked at the moment of sending. Inputs with a default in the panel file may be
        left out.
        """
        widget = self._dispatcher.widget(widget_id)
        inputs = self._dispatcher.with_defaults(widget, inputs)
        known = self._in_flight.get(press_id) or self._receipts.get_own(press_id)
        if known is None and not self._receipts.is_past(press_id):
            if left_out := self.early_refusals.unlogged_refusal(widget, inputs, press_id, context):
                return left_out
            work = self._press_logged(widget, inputs, press_id, context)
            return await self._run_once(widget, inputs, press_id, work)
        if known is None:
            why = say("press_already_made", id=press_id)
            return await self.early_refusals.refuse(widget, inputs, press_id, why, context.origin)
        if (known.widget, known.fingerprint) != (widget_id, fingerprint(inputs)):
            why = say("press_id_reused", id=press_id)
            return await self.early_refusals.refuse(widget, inputs, press_id, why, context.origin)
        if isinstance(known, _InFlightPress):
            return await asyncio.shield(known.receipt)
        return known

    async def cancel(self, widget_id: str, origin: Origin, press_id: str = "") -> Receipt:
        """Asks the robot to cancel the goal of a press; without a press id, the running goal. Every
        client may, with or without control, at any time."""
        return await self._cancels.cancel(widget_id, origin, press_id)

    def cancel_all(self) -> None:
        """Ends all waiting for the robot; the outcome of these presses is unknown."""
        self._waits.cancel_all()

    async def _run_once(
        self,
        widget: PressCommand,
        inputs: Mapping[str, Any],
        press_id: str,
        work: Coroutine[Any, Any, Receipt],
    ) -> Receipt:
        """Runs the work of a press; repetitions of the same id wait for its receipt."""
        loop = asyncio.get_running_loop()
        under_way = _InFlightPress(widget.id, inputs, loop.create_future())
        self._in_flight[press_id] = under_way
        try:
            receipt = await work
        except BaseException as error:
            under_way.receipt.set_exception(error)
            under_way.receipt.exception()  # retrieved: there may be no repetition that waits
            raise
        finally:
            del self._in_flight[press_id]
        under_way.receipt.set_result(receipt)
        if receipt.id == press_id:  # a refusal with an id of its own is kept already
            self._receipts.keep(receipt)
        return receipt

    async def _press_logged(
        self, widget: PressCommand, inputs: Mapping[str, Any], press_id: str, context: PressContext
    ) -> Receipt:
        own = self._dispatcher.needed_inputs(widget, inputs)
        try:
            pending = await self._press_log.pressed(widget.id, own, press_id, context.origin)
        except Repeated as known:
            return await self._repeated.receipt(widget, inputs, context.origin, known)
        except LogError as error:
            self._receipts.record_press(press_id, widget.id, context.origin, own)
            text = say("refused", why=error.text, time=format_time(time.time()))
            receipt = receipt_of(widget, inputs, press_id, Outcome("refused", text), "log")
        else:
            self._receipts.record_press(press_id, widget.id, context.origin, own)
            with _always_closed(pending):
                receipt = await self._judge_and_send(widget, inputs, press_id, pending, context)
            receipt = await close_entry(pending, receipt)
        level = logging.INFO if receipt.outcome in GOOD_OUTCOMES else logging.WARNING
        who = origin_text(context.origin)
        extra = rosout_extra(
            f"press {press_id} of {widget.id} by {who}: {outcome_text(widget, receipt)}"
        )
        self._log.log(level, "press %s of %s by %s with %.*s: %s: %s", press_id, widget.id, who,
                MAX_LOGGED_CHARS, own, receipt.outcome, receipt.reason, extra=extra)  # fmt: skip
        return receipt

    def _correct(self, pending: PendingEntry, press_id: str, answer: Outcome) -> None:
        """Corrects the log entry and the receipt of a press."""
        pending.correct(answer)
        if old := self._receipts.get(press_id):
            self._receipts.keep(corrected(old, answer))

    async def _judge_and_send(
        self,
        widget: PressCommand,
        inputs: Mapping[str, Any],
        press_id: str,
        pending: PendingEntry,
        context: PressContext,
    ) -> Receipt:
        def receipt(answer: Outcome, cause: Cause = "") -> Receipt:
            return receipt_of(widget, inputs, press_id, answer, cause)

        def refused(sentence: str, why: TextLike, cause: Cause) -> Receipt:
            now = format_time(time.time())
            return receipt(Outcome("refused", say(sentence, why=why, time=now)), cause)

        verdict, why, cause = self._judge.judge(widget, context)
        pending.set_verdict(verdict.code)
        if why:
            return refused("refused", why, cause)
        try:
            correct = partial(self._correct, pending)
            final_check = partial(self._judge.final_check, widget, pending, context)
            async with self._waits.cancellable():
                answer = await self._dispatcher.send(
                    widget, inputs, press_id, correct, pending.hash, final_check
                )
        except TimeoutError:
            return receipt(Outcome("unknown", say("press_unknown_at_shutdown")))
        except (FieldError, InputError) as error:
            return refused("press_not_encoded", error.text, "input")
        except LinkError as error:
            return refused("press_not_encoded", error.text, "link")
        except PressRefused as error:
            return refused("refused", error.reason, error.cause)
        if answer.outcome == "refused":
            return refused("press_not_encoded", answer.text, "interlock")
        return receipt(answer, "time" if answer.outcome == "timed_out" else "")


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

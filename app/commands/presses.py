"""One press: log, permission, encoding, put, log, receipt. Knows no HTTP.

The permission is judged here, by what the server knows when the press stands in the operator's log;
what the browser showed does not count. Between judging and sending nothing waits.
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
    FINE,
    LONGEST_LOGGED,
    Receipt,
    Receipts,
    Witness,
    closed,
    corrected,
    fingerprint,
    named,
    receipt_of,
    untyped,
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
class _UnderWay:
    """A press whose receipt is not there yet."""

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
        witness: Witness | None = None,
    ) -> None:
        """`robot` is its name in the server's log, "" where there is only one."""
        self._log = RobotLog(log, robot)
        self._judge = judge
        self._dispatcher = dispatcher
        self._press_log = press_log
        self._under_way: dict[str, _UnderWay] = {}
        self._receipts = Receipts(witness)
        self._waits = CancellableWaits()
        self.early_refusals = EarlyRefusals(judge, dispatcher, press_log, self._receipts, self._log)
        self._repeated = RepeatedPresses(dispatcher, self.early_refusals, self._log)
        self._cancels = Cancels(dispatcher, press_log, self.early_refusals, self._waits, self._log)

    def close(self) -> None:
        """Nothing more is sent; a goal can be canceled until the end."""
        self._judge.close()

    def widget(self, widget_id: str) -> PressCommand:
        """What can be pressed; NotFound for everything else."""
        return self._dispatcher.widget(widget_id)

    def receipt(self, press_id: str) -> Receipt | None:
        """The receipt of a press, as it is known now."""
        return self._receipts.get(press_id)

    async def press(
        self, widget_id: str, inputs: Mapping[str, Any], press_id: str, context: PressContext
    ) -> Receipt:
        """Sends what the widget is for, or refuses. The same id again is the same press.

        What it is judged by, is judged in the moment of sending. An input that has a default in the
        panel file may be left out.
        """
        widget = self._dispatcher.widget(widget_id)
        inputs = self._dispatcher.with_defaults(widget, inputs)
        known = self._under_way.get(press_id) or self._receipts.made(press_id)
        if known is None and not self._receipts.is_past(press_id):
            if left_out := self.early_refusals.left_out(widget, inputs, press_id, context):
                return left_out
            work = self._logged(widget, inputs, press_id, context)
            return await self._once(widget, inputs, press_id, work)
        if known is None:
            why = say("press_past", id=press_id)
            return await self.early_refusals.refuse(widget, inputs, press_id, why, context.origin)
        if (known.widget, known.fingerprint) != (widget_id, fingerprint(inputs)):
            why = say("press_reused", id=press_id)
            return await self.early_refusals.refuse(widget, inputs, press_id, why, context.origin)
        if isinstance(known, _UnderWay):
            return await asyncio.shield(known.receipt)
        return known

    async def cancel(self, widget_id: str, origin: Origin, press_id: str = "") -> Receipt:
        """Asks the robot to cancel the goal of one press or, without its id, the one under way: anyone
        may, with or without control, and however late."""
        return await self._cancels.cancel(widget_id, origin, press_id)

    def cancel_all(self) -> None:
        """Ends what waits for the robot: its outcome is unknown."""
        self._waits.cancel_all()

    async def _once(
        self,
        widget: PressCommand,
        inputs: Mapping[str, Any],
        press_id: str,
        work: Coroutine[Any, Any, Receipt],
    ) -> Receipt:
        """Does the work of a press, while others of the same id wait for its receipt."""
        loop = asyncio.get_running_loop()
        under_way = _UnderWay(widget.id, inputs, loop.create_future())
        self._under_way[press_id] = under_way
        try:
            receipt = await work
        except BaseException as error:
            under_way.receipt.set_exception(error)
            under_way.receipt.exception()  # who else waited is told; no one needs to have
            raise
        finally:
            del self._under_way[press_id]
        under_way.receipt.set_result(receipt)
        if receipt.id == press_id:  # a refusal's own is kept already
            self._receipts.keep(receipt)
        return receipt

    async def _logged(
        self, widget: PressCommand, inputs: Mapping[str, Any], press_id: str, context: PressContext
    ) -> Receipt:
        own = self._dispatcher.needed(widget, inputs)
        try:
            pending = await self._press_log.pressed(widget.id, own, press_id, context.origin)
        except Repeated as known:
            return await self._repeated.receipt(widget, inputs, context.origin, known)
        except LogError as error:
            self._receipts.begin(press_id, widget.id, context.origin, own)
            text = say("refused", why=error.text, time=format_time(time.time()))
            receipt = receipt_of(widget, inputs, press_id, Outcome("refused", text), "log")
        else:
            self._receipts.begin(press_id, widget.id, context.origin, own)
            with _closed_in_the_end(pending):
                receipt = await self._pressed(widget, inputs, press_id, pending, context)
            receipt = await closed(pending, receipt)
        level = logging.INFO if receipt.outcome in FINE else logging.WARNING
        who = named(context.origin)
        extra = rosout_extra(f"press {press_id} of {widget.id} by {who}: {untyped(widget, receipt)}")
        self._log.log(level, "press %s of %s by %s with %.*s: %s: %s", press_id, widget.id, who,
                LONGEST_LOGGED, own, receipt.outcome, receipt.reason, extra=extra)  # fmt: skip
        return receipt

    def _correct(self, pending: PendingEntry, press_id: str, answer: Outcome) -> None:
        """What is known of a press now is another thing than its receipt said."""
        pending.corrected(answer)
        if old := self._receipts.get(press_id):
            self._receipts.keep(corrected(old, answer))

    async def _pressed(
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

        verdict, why, cause = self._judge.ground(widget, context)
        pending.judged(verdict.code)
        if why:
            return refused("refused", why, cause)
        try:
            correct = partial(self._correct, pending)
            look = partial(self._judge.last_look, widget, pending, context)
            async with self._waits.cancellable():
                answer = await self._dispatcher.send(
                    widget, inputs, press_id, correct, pending.hash, look
                )
        except TimeoutError:
            return receipt(Outcome("unknown", say("server_ends")))
        except (FieldError, InputError) as error:
            return refused("not_encoded", error.text, "input")
        except LinkError as error:
            return refused("not_encoded", error.text, "link")
        except PressRefused as error:
            return refused("refused", error.reason, error.cause)
        if answer.outcome == "refused":
            return refused("not_encoded", answer.text, "interlock")
        return receipt(answer, "time" if answer.outcome == "timed_out" else "")


@contextmanager
def _closed_in_the_end(pending: PendingEntry) -> Iterator[None]:
    """What breaks off in here is said to have, in the log."""
    try:
        yield
    except asyncio.CancelledError:
        pending.broke_off("log_ended")
        raise
    except BaseException:
        pending.broke_off("log_broke_off")
        raise

"""One press: log entry, permission, encoding, sending, log entry, receipt. No HTTP.

Permission is checked here, on the server's state after the press is in the operator's log; the
browser's state does not count. Nothing is awaited between the check and sending.
"""

import asyncio
import logging
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

from app.cell.commands.dispatch import Dispatcher
from app.cell.commands.judge import PressJudge
from app.cell.commands.press import Press, PressHandle
from app.cell.commands.receipts import (
    GOOD_OUTCOMES,
    MAX_LOGGED_CHARS,
    PAST_IDS_KEPT,
    RECEIPTS_KEPT,
    PressRecorder,
    Receipt,
    Refusal,
    close_entry,
    corrected,
    origin_text,
    outcome_text,
    recalled_receipt,
    receipt_of,
    refused_receipt,
    with_confirmation,
    with_log_fault,
)
from app.cell.permission.press_permission import cause_of
from app.cell.permission.verdict import PERMITTED_CODES
from app.panel.widgets.families import PressCommand
from app.panel.widgets.service_action import Action
from app.records import Entry, Origin, Repeated, same_values
from app.records.entry import Outcome
from app.records.press_record import LoggedPress, PendingEntry, PressLog
from app.system.clock import format_time
from app.system.concurrency import CancellableWaits
from app.system.errors import Cause, FieldError, InputError, LinkError, LogError, NotFound, PressRefused
from app.system.limits import BoundedDict
from app.system.log import RobotLog, rosout_extra
from app.system.texts import BETWEEN, Text, TextLike, joined, say

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
    """The presses of one robot's panel: what was pressed under which id, the receipts of that, and
    cancels of goals. Used on the event loop only.

    A press is refused before it has a log entry if its id is used again, if it is a second tap, if it
    is over the rate limit, or if its client has used up the log's quota of refusals. Such a refusal
    displaces no receipt of a press that was judged.
    """

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
        self._recorder = recorder
        self._in_flight: dict[str, _InFlightPress] = {}
        self._receipts = BoundedDict[str, Receipt](RECEIPTS_KEPT)
        self._unlogged = BoundedDict[str, Receipt](RECEIPTS_KEPT)  # refusals that the log only counts
        # From the log, which is asked again each time, as its entries may change.
        self._recalled = BoundedDict[str, Receipt](RECEIPTS_KEPT)
        self._past_ids = BoundedDict[str, None](RECEIPTS_KEPT + PAST_IDS_KEPT)
        self._waits = CancellableWaits()

    def close(self) -> None:
        """Refuses every press from now on. Goals can still be canceled."""
        self._judge.close()

    def widget(self, widget_id: str) -> PressCommand:
        """The command widget with this id; NotFound for every other id."""
        return self._dispatcher.widget(widget_id)

    def receipt(self, press_id: str) -> Receipt | None:
        """The current receipt of a press; None for unknown ids."""
        return self._own_receipt(press_id) or self._recalled.get(press_id)

    def _own_receipt(self, press_id: str) -> Receipt | None:
        """The receipt of a press of this server's run."""
        return self._receipts.get(press_id) or self._unlogged.get(press_id)

    async def press(self, press: Press[PressCommand]) -> Receipt:
        """Sends the widget's command, or refuses it. The same id again is the same press.

        Permission is checked at the moment of sending. Inputs with a default in the panel file may be
        left out.
        """
        press = self._dispatcher.with_defaults(press)
        known = self._in_flight.get(press.id) or self._own_receipt(press.id)
        if known is None:
            if press.id in self._past_ids:
                return await self._refuse(press, say("press_already_made", id=press.id))
            return self._unlogged_refusal(press) or await self._run_once(press)
        if (known.widget, known.fingerprint) != (press.widget.id, press.fingerprint):
            return await self._refuse(press, say("press_id_reused", id=press.id))
        if isinstance(known, _InFlightPress):
            return await asyncio.shield(known.receipt)
        return known

    async def too_soon(self, press: Press[PressCommand], before: str) -> Receipt:
        """Refuses a press that may be the second tap of an earlier one. `before` is the id of that
        press, "" without one; the reason includes its result."""
        why: TextLike = say("press_too_soon")
        if (last := self.receipt(before)) is not None:
            result = say("press_last_result", label=self.widget(last.widget).label, said=last.reason)
            why = last.reason if ends_with(last.reason, why) else joined([result, why])
        return await self._refuse(press, why)

    def limited(
        self, press: Press[PressCommand], sentence: str = "press_too_often", *, shown: bool = False
    ) -> Receipt:
        """Refuses a press over the rate limit. The client may repeat it later with the same id.
        `shown`: the receipt is kept for a page without scripts."""
        receipt = refused_receipt(press, Refusal(say(sentence), "limit"))
        if shown:
            receipt = replace(receipt, id=_own_id(press.id))
            self._unlogged[receipt.id] = receipt
        return receipt

    async def cancel(self, cancel: Press[PressCommand], press_id: str = "") -> Receipt:
        """Asks the robot to cancel the goal of a press; without a press id, the running goal. Every
        client may, with or without control, at any time. NotFound for widgets that are not actions."""
        widget, origin = cancel.widget, cancel.origin
        if not isinstance(widget, Action):
            raise NotFound(f'"{widget.id}" is not an action: there is nothing to cancel')
        why = self._dispatcher.actions.no_goal_reason(widget, press_id)
        if why and not self._press_log.has_room(origin):
            return self._count_only(receipt_of(cancel, Outcome("refused", why), "interlock"), origin)
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
                answer = await self._dispatcher.actions.cancel(widget, press_id)
        except TimeoutError:
            return Outcome("unknown", say("press_unknown_at_shutdown")), ""
        except LinkError as error:
            text = say("press_not_encoded", why=error.text, time=format_time(time.time()))
            return Outcome("refused", text), "link"
        return answer, "interlock" if answer.outcome == "refused" else ""

    def cancel_all(self) -> None:
        """Ends all waiting for the robot; the outcome of these presses is unknown."""
        self._waits.cancel_all()

    async def _run_once(self, press: Press[PressCommand]) -> Receipt:
        """Logs, judges and sends a press; repetitions of the same id wait for its receipt."""
        in_flight = _InFlightPress(press, asyncio.get_running_loop().create_future())
        self._in_flight[press.id] = in_flight
        try:
            receipt = await self._press_logged(press)
        except BaseException as error:
            in_flight.receipt.set_exception(error)
            in_flight.receipt.exception()  # retrieved: there may be no repetition that waits
            raise
        finally:
            del self._in_flight[press.id]
        in_flight.receipt.set_result(receipt)
        if receipt.recalled:
            self._recalled[press.id] = receipt
        elif receipt.id == press.id:  # a refusal with an id of its own is kept already
            self._keep(receipt)
        return receipt

    async def _press_logged(self, press: Press[PressCommand]) -> Receipt:
        logged = press.logged()
        try:
            pending = await self._press_log.pressed(logged)
        except Repeated as known:
            return await self._recall(press, known)
        except LogError as error:
            self._record(logged)
            receipt = refused_receipt(press, Refusal(error.text, "log"))
        else:
            self._record(logged)
            with _always_closed(pending):
                receipt = await self._judge_and_send(press, pending)
            receipt = await close_entry(pending, with_confirmation(receipt, press))
        self._log_receipt(press, logged, receipt)
        return receipt

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

    def _keep(self, receipt: Receipt) -> None:
        """Keeps and records a receipt, a corrected one too."""
        if self._recorder is not None:
            self._recorder.record_receipt(receipt)
        self._receipts[receipt.id] = receipt
        self._past_ids[receipt.id] = None

    def _record(self, press: LoggedPress) -> None:
        if self._recorder is not None:
            who = origin_text(press.origin)
            self._recorder.record_press(press.id, press.widget, who, press.inputs)

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
            self._keep(corrected(old, answer))

    async def _recall(self, press: Press[PressCommand], known: Repeated) -> Receipt:
        """The receipt of a press that a client repeats after a restart, from the log; a refusal if the
        id belongs to a different press."""
        entry, last = known.press, known.last_entry
        if entry.widget != press.widget.id or not same_values(entry.values, press.needed_inputs):
            return await self._refuse(press, say("press_id_reused", id=press.id))
        receipt = recalled_receipt(press, entry, last, self._recalled_cause(press, last))
        self._log.info("press %s of %s by %s repeats entry %d: %s: %s", press.id, press.widget.id,
                origin_text(press.origin), entry.seq, receipt.outcome, receipt.reason)  # fmt: skip
        return receipt

    def _recalled_cause(self, press: Press[PressCommand], last: Entry | None) -> Cause:
        """The cause of a refusal, as far as the entry shows it. Inputs that are invalid now were
        invalid then."""
        if last is None or last.outcome not in ("refused", "timed_out"):
            return ""
        if last.outcome == "timed_out":
            return "time"
        if last.verdict not in PERMITTED_CODES:
            return cause_of(last.verdict or "log")
        not_encoded = self._not_encoded(press)
        return "input" if not_encoded and not_encoded.cause == "input" else "interlock"

    def _unlogged_refusal(self, press: Press[PressCommand]) -> Receipt | None:
        """The receipt of a refusal that the log only counts; None for every other press.

        Applies only to a client that has used up the log's quota of refusals. Its permitted presses are
        still sent; its refusals push no other entry out of the log.
        """
        if self._press_log.has_room(press.origin):
            return None
        if refusal := self._judge.judge(press).refusal:
            return self._count_only(refused_receipt(press, refusal), press.origin)
        if refusal := self._not_encoded(press):
            receipt = refused_receipt(press, refusal, "press_not_encoded")
            return self._count_only(receipt, press.origin)
        return None

    def _not_encoded(self, press: Press[PressCommand]) -> Refusal | None:
        """Why a permitted press would not be sent; None if it would."""
        try:
            reason = self._dispatcher.refusal(press)
        except (FieldError, InputError) as error:
            return Refusal(error.text, "input")
        except PressRefused as error:
            return Refusal(error.reason, error.cause)
        return Refusal(reason, "interlock") if reason else None

    def _count_only(self, receipt: Receipt, origin: Origin) -> Receipt:
        """Counts a refusal without writing a log entry."""
        self._press_log.count_unlogged(origin)
        self._unlogged[receipt.id] = receipt
        return receipt

    async def _refuse(self, press: Press[PressCommand], why: TextLike) -> Receipt:
        """Refuses a press. The receipt has an id of its own, because the press's id belongs to another
        press or may still be used for one."""
        press = replace(press, id=_own_id(press.id))
        receipt = receipt_of(press, Outcome("refused", why), "input")
        logged = press.logged()
        if not self._press_log.has_room(logged.origin):
            return self._count_only(receipt, logged.origin)
        self._record(logged)
        who, widget = origin_text(logged.origin), press.widget
        extra = rosout_extra(
            f"press {press.id} of {widget.id} by {who}: {outcome_text(widget, receipt)}"
        )
        self._log.warning("press %s of %s by %s: %s", press.id, widget.id, who, why, extra=extra)
        receipt = with_log_fault(receipt, await self._press_log.refused(logged, why))
        self._keep(receipt)
        return receipt


def ends_with(text: TextLike, last: TextLike) -> bool:
    """Whether a text equals another one, or its last sentence does."""
    if text == last or not isinstance(text, Text) or text.code not in BETWEEN:
        return text == last
    (_, parts) = text.params[0]
    return isinstance(parts, tuple) and ends_with(parts[-1], last)


def _own_id(press_id: str) -> str:
    """An id for a refusal, beginning with its press's id."""
    return f"{press_id:.40}.{secrets.token_hex(4)}"


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

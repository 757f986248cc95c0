"""Receipts of holds, written to the server's log and to recordings."""

import logging
import secrets
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

from app.clock import format_time
from app.commands.holds.deflection import CENTRE, Deflection
from app.commands.holds.lease import Lease
from app.commands.holds.messages import Values
from app.commands.press_context import PressContext
from app.commands.receipts import (
    MAX_LOGGED_CHARS,
    PressRecorder,
    Receipt,
    origin_text,
    outcome_text,
    receipt_of,
)
from app.dialect.peer_traits import PeerSentences
from app.errors import Cause
from app.i18n import Text, TextLike, joined, number, say
from app.panel.template import needed_inputs
from app.panel.widgets.hold import HoldCommand
from app.robot.command_status import Outcome, OutcomeCode
from app.ros_logging import RobotLog, rosout_extra

log = logging.getLogger("kiosk.holds")

RELEASED: Final = "hold_released"


@dataclass(slots=True, eq=False)
class ActiveHold:
    """An active hold. `on_end` is called with its receipt when it ends, for any reason."""

    widget: HoldCommand
    lease: Lease
    context: PressContext
    inputs: Mapping[str, Any]
    values: Values
    on_end: Callable[[Receipt], None]
    since: Text
    sent: int = 0
    deflection: Deflection = CENTRE
    moved: Deflection = CENTRE  # what was sent of it


class Refusal(NamedTuple):
    """Why a hold may not begin: a sentence, and its receipt's cause."""

    why: TextLike
    cause: Cause


def refused(
    widget: HoldCommand, inputs: Mapping[str, Any], refusal: Refusal, hold_id: str = ""
) -> Receipt:
    """The receipt of a hold that may not begin. A hold without an id gets one."""
    text = say("refused", why=refusal.why, time=format_time(time.time()))
    own = needed_inputs(widget, inputs)
    own_id = hold_id or secrets.token_hex(8)
    return receipt_of(widget, own, own_id, Outcome("refused", text), refusal.cause)


class HoldReceipts:
    """The hold receipts of one robot."""

    def __init__(self, robot: str, sentences: PeerSentences, recorder: PressRecorder | None) -> None:
        """`robot` is its name, `sentences` are those about its peer."""
        self._log = RobotLog(log, robot)
        self._sentences = sentences
        self._recorder = recorder

    def record_begin(self, holding: ActiveHold) -> None:
        widget, lease, by = holding.widget, holding.lease, holding.context
        if self._recorder is not None:
            self._recorder.record_press(lease.id, widget.id, origin_text(by.origin), holding.inputs)
        who = origin_text(by.origin)
        extra = rosout_extra(f"hold {lease.id} of {widget.id} by {who} begins")
        self._log.info("hold %s of %s by %s with %.*s begins", lease.id, widget.id, who,
                MAX_LOGGED_CHARS, holding.inputs, extra=extra)  # fmt: skip

    def record_end(
        self, holding: ActiveHold, seconds: float, code: str, why: TextLike, unsaid: TextLike
    ) -> Receipt:
        """The receipt of a hold that ended after `seconds`; `code` and `why` are the reason. `unsaid`
        is why its stop message was not sent, "" if it was."""
        widget, lease = holding.widget, holding.lease
        sentence = RELEASED if code == RELEASED else "hold_ended"
        end = say(sentence, time=format_time(time.time()), seconds=number(f"{seconds:.1f}"), why=why)
        text = joined([end, say("hold_stop_not_sent", why=unsaid) if unsaid else ""])
        outcome: OutcomeCode = "unknown" if unsaid else "published" if code == RELEASED else "aborted"
        level = logging.INFO if outcome == "published" else logging.WARNING
        self._log.log(level, "hold %s of %s by %s ended after %.3f s and %d messages (%s): %s",
                lease.id, widget.id, origin_text(holding.context.origin), seconds, holding.sent,
                code, text)  # fmt: skip
        return self._recorded(receipt_of(widget, holding.inputs, lease.id, Outcome(outcome, text)))

    def record_refusal(
        self,
        widget: HoldCommand,
        inputs: Mapping[str, Any],
        context: PressContext,
        refusal: Refusal,
        hold_id: str,
    ) -> Receipt:
        """The receipt of a hold that may not begin, logged and recorded."""
        receipt = refused(widget, inputs, refusal, hold_id)
        who = origin_text(context.origin)
        extra = rosout_extra(f"hold of {widget.id} by {who}: {outcome_text(widget, receipt)}")
        self._log.warning("hold of %s by %s with %.*s: %s", widget.id, who,
                MAX_LOGGED_CHARS, receipt.inputs, receipt.reason, extra=extra)  # fmt: skip
        if self._recorder is not None:
            self._recorder.record_press(
                receipt.id, widget.id, origin_text(context.origin), receipt.inputs
            )
        return self._recorded(receipt)

    def unconfirmed(self, receipt: Receipt) -> Receipt:
        """The receipt of a hold whose stop message may not have reached the peer."""
        unconfirmed = say(self._sentences.stop_unconfirmed)
        self._log.warning("hold %s of %s: %s", receipt.id, receipt.widget, unconfirmed)
        reason = joined([receipt.reason, unconfirmed])
        return self._recorded(replace(receipt, outcome="unknown", reason=reason))

    def _recorded(self, receipt: Receipt) -> Receipt:
        if self._recorder is not None:
            self._recorder.record_receipt(receipt)
        return receipt

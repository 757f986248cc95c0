"""Receipts of holds, written to the server's log and to recordings."""

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from app.clock import format_time
from app.commands.holds.deflection import CENTRE, Deflection
from app.commands.holds.lease import Lease
from app.commands.holds.messages import Values
from app.commands.press import Press
from app.commands.receipts import (
    MAX_LOGGED_CHARS,
    PressRecorder,
    Receipt,
    Refusal,
    origin_text,
    outcome_text,
    receipt_of,
    refused_receipt,
    with_confirmation,
)
from app.dialect.peer_traits import PeerSentences
from app.i18n import Text, TextLike, joined, number, say
from app.panel.widgets.hold import HoldCommand
from app.robot.command_status import Outcome, OutcomeCode
from app.ros_logging import RobotLog, rosout_extra

log = logging.getLogger("kiosk.holds")

RELEASED: Final = "hold_released"


@dataclass(slots=True, eq=False)
class ActiveHold:
    """An active hold; its press has only the inputs that its widget uses. `on_end` is called with its
    receipt when it ends, for any reason."""

    press: Press[HoldCommand]
    lease: Lease
    values: Values
    on_end: Callable[[Receipt], None]
    since: Text
    sent: int = 0
    deflection: Deflection = CENTRE
    moved: Deflection = CENTRE  # what was sent of it

    @property
    def widget(self) -> HoldCommand:
        return self.press.widget


class HoldReceipts:
    """The hold receipts of one robot."""

    def __init__(self, robot: str, sentences: PeerSentences, recorder: PressRecorder | None) -> None:
        """`robot` is its name, `sentences` are those about its peer."""
        self._log = RobotLog(log, robot)
        self._sentences = sentences
        self._recorder = recorder

    def record_begin(self, holding: ActiveHold) -> None:
        press, who = holding.press, origin_text(holding.press.origin)
        if self._recorder is not None:
            self._recorder.record_press(press.id, press.widget.id, who, press.inputs)
        extra = rosout_extra(f"hold {press.id} of {press.widget.id} by {who} begins")
        self._log.info("hold %s of %s by %s with %.*s begins", press.id, press.widget.id, who,
                MAX_LOGGED_CHARS, press.inputs, extra=extra)  # fmt: skip

    def record_end(
        self, holding: ActiveHold, seconds: float, code: str, why: TextLike, unsaid: TextLike
    ) -> Receipt:
        """The receipt of a hold that ended after `seconds`; `code` and `why` are the reason. `unsaid`
        is why its stop message was not sent, "" if it was."""
        press = holding.press
        sentence = RELEASED if code == RELEASED else "hold_ended"
        end = say(sentence, time=format_time(time.time()), seconds=number(f"{seconds:.1f}"), why=why)
        text = joined([end, say("hold_stop_not_sent", why=unsaid) if unsaid else ""])
        outcome: OutcomeCode = "unknown" if unsaid else "published" if code == RELEASED else "aborted"
        level = logging.INFO if outcome == "published" else logging.WARNING
        self._log.log(level, "hold %s of %s by %s ended after %.3f s and %d messages (%s): %s",
                press.id, press.widget.id, origin_text(press.origin), seconds, holding.sent,
                code, text)  # fmt: skip
        return self._recorded(with_confirmation(receipt_of(press, Outcome(outcome, text)), press))

    def record_refusal(self, press: Press[HoldCommand], refusal: Refusal) -> Receipt:
        """The receipt of a hold that may not begin, logged and recorded."""
        receipt = refused_receipt(press.with_needed_inputs(), refusal)
        widget, who = press.widget, origin_text(press.origin)
        extra = rosout_extra(f"hold of {widget.id} by {who}: {outcome_text(widget, receipt)}")
        self._log.warning("hold of %s by %s with %.*s: %s", widget.id, who,
                MAX_LOGGED_CHARS, receipt.inputs, receipt.reason, extra=extra)  # fmt: skip
        if self._recorder is not None:
            self._recorder.record_press(receipt.id, widget.id, who, receipt.inputs)
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

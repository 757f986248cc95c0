"""What is told of holds: their receipts, in the server's log and to who records."""

import logging
import secrets
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

from app.clock import format_time
from app.commands.holds.lease import Lease
from app.commands.holds.messages import Values
from app.commands.press_context import PressContext
from app.commands.receipts import (
    LONGEST_LOGGED,
    Receipt,
    Witness,
    named,
    receipt_of,
    untyped,
)
from app.errors import Cause
from app.i18n import Text, TextLike, joined, say
from app.panel.template import needed_inputs
from app.panel.widgets.hold import Hold
from app.robot.command_status import Outcome, OutcomeCode
from app.ros_logging import RobotLog, rosout_extra

log = logging.getLogger("kiosk.holds")

RELEASED: Final = "hold_released"


@dataclass(slots=True, eq=False)
class ActiveHold:
    """A hold that is going on; `told` gets its receipt when it ends, whatever ends it."""

    widget: Hold
    lease: Lease
    by: PressContext
    inputs: Mapping[str, Any]
    values: Values
    told: Callable[[Receipt], None]
    since: Text
    sent: int = 0


class Refusal(NamedTuple):
    """Why a hold may not begin: a sentence, and its receipt's cause."""

    why: TextLike
    cause: Cause


def refused(widget: Hold, inputs: Mapping[str, Any], refusal: Refusal, hold_id: str = "") -> Receipt:
    """The receipt of a hold that may not begin; without an id it gets one."""
    text = say("refused", why=refusal.why, time=format_time(time.time()))
    own = needed_inputs(widget, inputs)
    own_id = hold_id or secrets.token_hex(8)
    return receipt_of(widget, own, own_id, Outcome("refused", text), refusal.cause)


class HoldReceipts:
    """Those of one robot."""

    def __init__(self, robot: str, witness: Witness | None) -> None:
        self._log = RobotLog(log, robot)
        self._witness = witness

    def began(self, holding: ActiveHold) -> None:
        widget, lease, by = holding.widget, holding.lease, holding.by
        if self._witness is not None:
            self._witness.pressed(lease.id, widget.id, named(by.origin), holding.inputs)
        who = named(by.origin)
        extra = rosout_extra(f"hold {lease.id} of {widget.id} by {who} begins")
        self._log.info("hold %s of %s by %s with %.*s begins", lease.id, widget.id, who,
                LONGEST_LOGGED, holding.inputs, extra=extra)  # fmt: skip

    def ended(
        self, holding: ActiveHold, seconds: float, code: str, why: TextLike, unsaid: TextLike
    ) -> Receipt:
        """`code` and `why` it ended after so many seconds; `unsaid` is why its last message was not
        sent, "" where it was."""
        widget, lease = holding.widget, holding.lease
        sentence = RELEASED if code == RELEASED else "hold_ended"
        end = say(sentence, time=format_time(time.time()), seconds=f"{seconds:.1f}", why=why)
        text = joined([end, say("hold_unsaid", why=unsaid) if unsaid else ""])
        outcome: OutcomeCode = "unknown" if unsaid else "published" if code == RELEASED else "aborted"
        level = logging.INFO if outcome == "published" else logging.WARNING
        self._log.log(level, "hold %s of %s by %s ended after %.3f s and %d messages (%s): %s",
                lease.id, widget.id, named(holding.by.origin), seconds, holding.sent,
                code, text)  # fmt: skip
        return self._answered(receipt_of(widget, holding.inputs, lease.id, Outcome(outcome, text)))

    def refused(
        self,
        widget: Hold,
        inputs: Mapping[str, Any],
        context: PressContext,
        refusal: Refusal,
        hold_id: str,
    ) -> Receipt:
        """The same as the function, and told."""
        receipt = refused(widget, inputs, refusal, hold_id)
        who = named(context.origin)
        extra = rosout_extra(f"hold of {widget.id} by {who}: {untyped(widget, receipt)}")
        self._log.warning("hold of %s by %s with %.*s: %s", widget.id, who,
                LONGEST_LOGGED, receipt.inputs, receipt.reason, extra=extra)  # fmt: skip
        if self._witness is not None:
            self._witness.pressed(receipt.id, widget.id, named(context.origin), receipt.inputs)
        return self._answered(receipt)

    def doubted(self, receipt: Receipt) -> Receipt:
        """The receipt of a hold whose last message is not known to have reached the bridge."""
        doubt = say("hold_unanswered")
        self._log.warning("hold %s of %s: %s", receipt.id, receipt.widget, doubt)
        reason = joined([receipt.reason, doubt])
        return self._answered(replace(receipt, outcome="unknown", reason=reason))

    def _answered(self, receipt: Receipt) -> Receipt:
        if self._witness is not None:
            self._witness.answered(receipt)
        return receipt

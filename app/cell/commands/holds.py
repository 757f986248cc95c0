"""Hold-to-run: publishes a message at a rate while one browser holds a button, and a stop message at
the end.

Permission is checked for each message. A hold that has ended never resumes: the operator has to release
and press again. Nothing is sent late: if the stop message cannot be sent when a hold ends, it is not
sent at all.
"""

import asyncio
import logging
import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Protocol

from app.cell.commands.judge import PressJudge
from app.cell.commands.press import Press
from app.cell.commands.receipts import (
    MAX_FINAL_CHECKS,
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
from app.cell.commands.transport import Transport
from app.cell.permission.interlocks import link_verdict
from app.cell.robot.state import RobotState
from app.panel.model import Panel
from app.panel.template import fill_to_send, input_ids
from app.panel.widgets.hold import HoldCommand, Joystick, fill_own_fields
from app.records.entry import FinalCheck, Outcome, OutcomeCode, no_check
from app.ros.dialects.peer_traits import PeerSentences
from app.ros.messages import INTEGER_RANGES, Interfaces
from app.system.clock import format_time
from app.system.errors import FieldError, InputError, LinkError, NotFound, PressRefused
from app.system.log import RobotLog, rosout_extra
from app.system.texts import Text, TextLike, joined, number, say

# The lease of a hold, extended only by the heartbeats of its browser.
#
# Pure: times are arguments, in the server's monotonic seconds. The age of a heartbeat is computed
# without the browser's clock: it contains the last `stamp` of the server that the browser received, and
# how long ago that was. So the round trip counts as age.

LEASE_S: Final = 0.25  # from the sending of the last heartbeat to the end of the lease
MAX_AHEAD_S: Final = 0.02  # drift between two clocks over the life of one stamp
STALLED_S: Final = 0.1  # a lease whose end is noticed this late means that the server stalled


def sent_at(opened_at: float, stamp_ms: float, after_ms: float, now: float) -> float:
    """The latest time at which a message can have been sent; -inf if it is in the future.

    `stamp_ms` is the last stamp that the browser received, in ms since `opened_at`; `after_ms` is how
    many ms later it sent this message.
    """
    sent = opened_at + (stamp_ms + after_ms) / 1000
    return min(sent, now) if sent <= now + MAX_AHEAD_S else -math.inf


@dataclass(slots=True)
class Lease:
    """A lease; `until` is its end, `next_at` the time of the next message, `last` the number of the
    newest heartbeat."""

    id: str
    period_s: float
    begun_at: float
    until: float
    next_at: float
    last: int = 0

    @classmethod
    def begin(cls, lease_id: str, period_s: float, sent: float, now: float) -> "Lease":
        return cls(lease_id, period_s, now, sent + LEASE_S, now)

    def end_code(self, now: float) -> str:
        """The code of the reason if the lease has ended, else ""."""
        if now < self.until:
            return ""
        return "hold_by_stall" if now >= self.until + STALLED_S else "hold_by_heartbeat"

    def beat(self, number: int, sent: float, now: float) -> bool:
        """Processes a heartbeat sent at `sent`; returns whether the lease continues. A late or repeated
        heartbeat extends nothing, and a lease that has ended stays ended."""
        if self.end_code(now):
            return False
        if number > self.last:
            self.last = number
            self.until = max(self.until, sent + LEASE_S)
        return True

    def take_due(self, now: float) -> bool:
        """Whether a message is due; if so, schedules the next one. Missed messages are skipped."""
        if self.end_code(now) or now < self.next_at:
            return False
        self.next_at += self.period_s
        if self.next_at <= now:
            self.next_at = now + self.period_s
        return True


# The messages of a hold: one published repeatedly while it is active, and the stop message at its end.
# The server fills in a deadline and a counter if the panel file names fields for them.

Values = Mapping[str, Any]  # input values by input id, from the beginning of the hold
InputCheck = Callable[[Iterable[str], Values], dict[str, Any]]


class HoldMessages:
    """The hold messages of one robot. A widget's counter continues from hold to hold."""

    def __init__(
        self, interfaces: Interfaces, robot: RobotState, transport: Transport, check: InputCheck
    ) -> None:
        """`check` checks inputs and returns the values for the templates."""
        self._interfaces = interfaces
        self._robot = robot
        self._transport = transport
        self._check = check
        self._counts: dict[str, int] = {}

    def values(self, widget: HoldCommand, inputs: Mapping[str, Any]) -> Values:
        """The checked values for both messages; FieldError or InputError for bad input."""
        values = self._check(input_ids(widget), inputs)
        for template in widget.templates():
            fields = fill_to_send(template, values, self._robot.clock.stop_ns)
            self._interfaces.encode(widget.type, fill_own_fields(widget, fields, 0, 0))
        return values

    def put(
        self,
        widget: HoldCommand,
        values: Values,
        final_check: FinalCheck,
        axes: tuple[float, float],
    ) -> None:
        """Publishes one message, with the values of a joystick's axes; LinkError if it could not be
        sent, PressRefused from `final_check`."""
        now_ns = self._robot.clock.now_ns
        self._put(widget, widget.moving(*axes), values, widget.deadline_ms, final_check, now_ns)

    def put_last(self, widget: HoldCommand, values: Values, now: float) -> TextLike:
        """Publishes the stop message if the link is up, even without permission: an extra stop does no
        harm. Returns why it was not sent, else ""."""
        if not self._robot.link_up or not self._robot.graph.peers:
            return link_verdict(self._robot, now).reason or ""
        try:
            self._put(widget, widget.stopping(), values, 0, no_check, self._robot.clock.stop_ns)
        except LinkError as error:
            return say("with_stop", said=error.text)
        return ""

    def _put(
        self,
        widget: HoldCommand,
        template: Mapping[str, Any],
        values: Values,
        deadline_ms: int,
        final_check: FinalCheck,
        now_ns: Callable[[], int],
    ) -> None:
        count = self._counts.get(widget.id, 0) + 1
        if widget.counter_field is not None:
            kind = self._interfaces.field_type(widget.type, widget.counter_field)
            count %= INTEGER_RANGES[kind][1] + 1
        fields = fill_to_send(template, values, now_ns)
        whole = fill_own_fields(widget, fields, deadline_ms, count)
        payload = self._interfaces.encode(widget.type, whole)
        final_check()
        self._transport.put(self._robot.key(widget.topic), payload)
        self._counts[widget.id] = count


# Shapes a joystick's deflection for its messages: shape, dead zone, ramp. Pure.
#
# A deflection is (x, y), each from -1 to 1: x to the right, y to the front, as the finger is.

Deflection = tuple[float, float]

CENTRE: Final[Deflection] = (0.0, 0.0)


def moved(widget: HoldCommand, before: Deflection, deflection: Deflection) -> Deflection:
    """The deflection in the next message, if `before` was in the last one; none of a key."""
    if not isinstance(widget, Joystick):
        return CENTRE
    x, y = shaped(widget, deflection)
    step = widget.period_s / widget.ramp_s if widget.ramp_s else math.inf
    return ramped(before[0], x, step), ramped(before[1], y, step)


def shaped(joystick: Joystick, deflection: Deflection) -> Deflection:
    """The deflection limited to the shape. It is zero in the dead zone and begins with zero outside."""
    x, y = (max(-1.0, min(1.0, axis)) for axis in deflection)
    if joystick.shape == "square":
        return _beyond(x, joystick.dead_zone), _beyond(y, joystick.dead_zone)
    far = math.hypot(x, y)
    if far <= joystick.dead_zone:
        return CENTRE
    factor = _beyond(min(far, 1.0), joystick.dead_zone) / far
    return x * factor, y * factor


def ramped(before: float, wanted: float, step: float) -> float:
    """The next value on the way to `wanted`: faster by `step` at most, slower at once."""
    if before * wanted <= 0:
        before = 0.0
    if abs(wanted) <= abs(before) + step:
        return wanted
    return math.copysign(abs(before) + step, wanted)


def _beyond(axis: float, dead_zone: float) -> float:
    if abs(axis) <= dead_zone:
        return 0.0
    return math.copysign((abs(axis) - dead_zone) / (1 - dead_zone), axis)


# Receipts of holds, written to the server's log and to recordings.

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


class Clock(Protocol):
    """The part of the event loop that holds need; `time` is in monotonic seconds."""

    def time(self) -> float: ...
    def call_at(self, when: float, callback: Callable[[], object]) -> asyncio.TimerHandle: ...


class HoldController:
    """The holds of one robot, at most one per widget. Used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        robot: RobotState,
        judge: PressJudge,
        messages: HoldMessages,
        loop: Clock,
        *,
        changed: Callable[[], None],
        recorder: PressRecorder | None = None,
    ) -> None:
        """`changed` is called when a hold begins or ends."""
        self._robot = robot
        self._loop = loop
        self._messages = messages
        self._receipts = HoldReceipts(robot.name, robot.traits.sentences, recorder)
        self._judge = judge
        self._arrivals = judge.arrivals
        self._changed = changed
        self._widgets = {w.id: w for w in panel.widgets() if isinstance(w, HoldCommand)}
        self._held: dict[str, ActiveHold] = {}
        self._timer: asyncio.TimerHandle | None = None
        self._closed = False

    def unconfirmed(self, receipt: Receipt) -> Receipt:
        """The receipt of a hold whose stop message may not have reached the peer."""
        return self._receipts.unconfirmed(receipt)

    def widget(self, widget_id: str) -> HoldCommand:
        """The hold widget with this id; NotFound for every other id."""
        if widget_id not in self._widgets:
            raise NotFound(f'there is no widget "{widget_id}" that can be held')
        return self._widgets[widget_id]

    def begin(
        self, press: Press[HoldCommand], sent: float, on_end: Callable[[Receipt], None]
    ) -> Receipt | ActiveHold:
        """Begins a hold, or returns the receipt of a refusal. `sent` is the latest time at which the
        browser can have sent the request. `on_end` is called with the receipt when the hold ends."""
        self._arrivals.ingest()
        self.judge()
        widget, now = press.widget, self._loop.time()
        values = self._prepare(press, sent, now)
        if isinstance(values, Refusal):
            return self._receipts.record_refusal(press, values)
        lease = Lease.begin(press.id, widget.period_s, sent, now)
        since = say("hold_since", time=format_time(time.time()))
        holding = ActiveHold(press.with_needed_inputs(), lease, values, on_end, since)
        self._held[widget.id] = holding
        self._robot.held_since[widget.id] = since
        self._receipts.record_begin(holding)
        self._changed()
        self.step()
        return holding

    def refuse(self, press: Press[HoldCommand], refusal: Refusal, *, recorded: bool = True) -> Receipt:
        """Refuses a hold without checking permission; with `recorded`, the refusal is logged and
        recorded."""
        if recorded:
            return self._receipts.record_refusal(press, refusal)
        return refused_receipt(press.with_needed_inputs(), refusal)

    def refusal(self, press: Press[HoldCommand], sent: float) -> Receipt | None:
        """The receipt of the refusal if `begin` would refuse now, else None. Not logged or recorded."""
        self._arrivals.ingest()
        self.judge()
        values = self._prepare(press, sent, self._loop.time())
        return self.refuse(press, values, recorded=False) if isinstance(values, Refusal) else None

    def _prepare(self, press: Press[HoldCommand], sent: float, now: float) -> Values | Refusal:
        """The values to publish, or the reason why the hold may not begin now."""
        if refusal := self._not_permitted(press, sent, now):
            return refusal
        try:
            return self._messages.values(press.widget, press.inputs)
        except (FieldError, InputError) as error:
            return Refusal(say("with_stop", said=error.text), "input")

    def _not_permitted(self, press: Press[HoldCommand], sent: float, now: float) -> Refusal | None:
        """Why the hold may not begin now, None if it may."""
        if self._closed:
            return Refusal(say("hold_by_shutdown"), "interlock")
        topic = press.widget.topic
        others = (holding.widget for holding in self._held.values())
        if other := next((widget for widget in others if widget.topic == topic), None):
            code = "hold_elsewhere" if other is press.widget else "hold_same_topic"
            return Refusal(say(code, label=other.label, topic=topic), "interlock")
        if now >= sent + LEASE_S:
            return Refusal(say("hold_press_too_late"), "interlock")
        return self._judge.judge_at(press, now).refusal

    def beat(
        self, holding: ActiveHold, number: int, sent: float, deflection: Deflection | None = None
    ) -> bool:
        """Processes a heartbeat, with a joystick's deflection; returns whether the hold continues. A
        deflection that is older than another one, or than a lease, counts for nothing."""
        self.judge()
        now, newest = self._loop.time(), number > holding.lease.last
        if not self._is_active(holding) or not holding.lease.beat(number, sent, now):
            return False
        if deflection is not None and newest and now < sent + LEASE_S:
            holding.deflection = deflection
        self._schedule()
        return True

    def end(self, holding: ActiveHold, code: str) -> None:
        """Ends a hold if it is active; `code` is that of the sentence with the reason."""
        self.judge()
        if self._is_active(holding):
            self._end(holding, code, say(code) if code != RELEASED else "")

    def end_all(self, code: str) -> None:
        """Ends all active holds."""
        for holding in list(self._held.values()):
            self.end(holding, code)
        self._schedule()

    @property
    def has_active(self) -> bool:
        """Whether a hold is under way."""
        return bool(self._held)

    def close(self) -> None:
        """Ends all holds and refuses new ones from now on."""
        self._closed = True
        self.end_all("hold_by_shutdown")

    def judge(self) -> None:
        """Ends holds whose lease or permission has ended. Call it after every change, and before any
        hold continues."""
        for holding in list(self._held.values()):
            now = self._loop.time()
            if not self._is_active(holding):
                continue  # ended in the meantime: the end of another hold triggered this
            if code := holding.lease.end_code(now):
                self._end(holding, code, say(code))
            elif not (verdict := self._judge.verdict(holding.press, now)).permitted:
                self._end(holding, verdict.code, verdict.reason or "")

    def step(self) -> None:
        """Ingests what has arrived, sends the messages that are due, and schedules the next step."""
        self._arrivals.ingest()
        self.judge()
        for holding in list(self._held.values()):
            if self._is_active(holding) and holding.lease.take_due(self._loop.time()):
                self._send(holding)
        self._schedule()

    def _is_active(self, holding: ActiveHold) -> bool:
        return self._held.get(holding.widget.id) is holding

    def _schedule(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        now = self._loop.time()
        times = [
            min(
                holding.lease.next_at,
                holding.lease.until,
                self._judge.verdict(holding.press, now).until,
            )
            for holding in self._held.values()
        ]
        if times:
            self._timer = self._loop.call_at(min(times), self.step)

    def _send(self, holding: ActiveHold) -> None:
        widget = holding.widget
        holding.moved = moved(widget, holding.moved, holding.deflection)
        axes = widget.axes_at(*holding.moved)
        try:
            self._messages.put(widget, holding.values, lambda: self._final_check(holding), axes)
        except LinkError as error:
            self._end(holding, "link", say("with_stop", said=error.text))
        except PressRefused:
            return  # it has ended
        else:
            holding.sent += 1

    def _final_check(self, holding: ActiveHold) -> None:
        """Called right before a message is sent: checks again if more has arrived since the verdict."""
        for _ in range(MAX_FINAL_CHECKS):
            if not self._is_active(holding):
                raise PressRefused("", "interlock")
            if not self._arrivals.has_urgent():
                return
            self._arrivals.ingest()
            self.judge()
        self.end(holding, "link_catching_up")
        raise PressRefused("", "interlock")

    def _end(self, holding: ActiveHold, code: str, why: TextLike) -> None:
        widget, now = holding.widget, self._loop.time()
        del self._held[widget.id]
        del self._robot.held_since[widget.id]
        unsaid = self._messages.put_last(widget, holding.values, now)
        receipt = self._receipts.record_end(holding, now - holding.lease.begun_at, code, why, unsaid)
        holding.on_end(receipt)
        self._changed()

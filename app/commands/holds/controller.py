"""Hold-to-run: publishes a message at a rate while one browser holds a button, and a stop message at
the end.

Permission is checked for each message. A hold that has ended never resumes: the operator has to release
and press again. Nothing is sent late: if the stop message cannot be sent when a hold ends, it is not
sent at all.
"""

import asyncio
import secrets
import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from app.clock import format_time
from app.commands.holds.deflection import Deflection, moved
from app.commands.holds.lease import LEASE_S, Lease
from app.commands.holds.messages import HoldMessages, Values
from app.commands.holds.receipts import RELEASED, ActiveHold, HoldReceipts, Refusal, refused
from app.commands.press_context import PressContext
from app.commands.press_judge import PendingSamples
from app.commands.receipts import MAX_FINAL_CHECKS, PressRecorder, Receipt
from app.errors import Cause, FieldError, InputError, LinkError, NotFound, PressRefused
from app.i18n import TextLike, say
from app.panel.model import Panel
from app.panel.template import needed_inputs
from app.panel.widgets.hold import HoldCommand
from app.permission.press_permission import cause_of, judged
from app.permission.verdict import Verdict
from app.robot.state import RobotState


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
        messages: HoldMessages,
        loop: Clock,
        latest: PendingSamples,
        *,
        changed: Callable[[], None],
        recorder: PressRecorder | None = None,
    ) -> None:
        """`changed` is called when a hold begins or ends."""
        self._panel = panel
        self._robot = robot
        self._loop = loop
        self._messages = messages
        self._receipts = HoldReceipts(robot.name, robot.traits.sentences, recorder)
        self._arrivals = latest
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
        self,
        widget_id: str,
        inputs: Mapping[str, Any],
        sent: float,
        context: PressContext,
        on_end: Callable[[Receipt], None],
        hold_id: str = "",
    ) -> Receipt | ActiveHold:
        """Begins a hold, or returns the receipt of a refusal. `sent` is the latest time at which the
        browser can have sent the request. `on_end` is called with the receipt when the hold ends. A
        hold without an id gets one."""
        self._arrivals.ingest()
        self.judge()
        widget, now = self.widget(widget_id), self._loop.time()
        ready = self._prepare(widget, inputs, sent, context, now)
        if isinstance(ready, Refusal):
            return self._receipts.record_refusal(widget, inputs, context, ready, hold_id)
        lease = Lease.begun(hold_id or secrets.token_hex(8), widget.period_s, sent, now)
        since = say("hold_since", time=format_time(time.time()))
        own = needed_inputs(widget, inputs)
        holding = ActiveHold(widget, lease, context, own, ready, on_end, since)
        self._held[widget_id] = holding
        self._robot.held_since[widget_id] = since
        self._receipts.record_begin(holding)
        self._changed()
        self.step()
        return holding

    def refuse(
        self,
        widget_id: str,
        context: PressContext,
        why: TextLike,
        cause: Cause = "interlock",
        *,
        hold_id: str = "",
        trace: bool = True,
    ) -> Receipt:
        """Refuses a hold without checking permission; with `trace`, the refusal is logged and
        recorded."""
        widget = self.widget(widget_id)
        refusal = Refusal(why, cause)
        if trace:
            return self._receipts.record_refusal(widget, {}, context, refusal, hold_id)
        return refused(widget, {}, refusal, hold_id)

    def refusal(
        self, widget_id: str, inputs: Mapping[str, Any], sent: float, context: PressContext
    ) -> Receipt | None:
        """The receipt of the refusal if `begin` would refuse now, else None. Not logged or recorded."""
        self._arrivals.ingest()
        self.judge()
        widget = self.widget(widget_id)
        ready = self._prepare(widget, inputs, sent, context, self._loop.time())
        return refused(widget, inputs, ready) if isinstance(ready, Refusal) else None

    def _prepare(
        self,
        widget: HoldCommand,
        inputs: Mapping[str, Any],
        sent: float,
        context: PressContext,
        now: float,
    ) -> Values | Refusal:
        """The values to publish, or the reason why the hold may not begin now."""
        why, cause = self._refusal_reason(widget, sent, context, now)
        if why:
            return Refusal(why, cause)
        try:
            return self._messages.values(widget, inputs)
        except (FieldError, InputError) as error:
            return Refusal(say("with_stop", said=error.text), "input")

    def _refusal_reason(
        self, widget: HoldCommand, sent: float, context: PressContext, now: float
    ) -> tuple[TextLike, Cause]:
        """Why the hold may not begin now ("" if it may), and the receipt's cause."""
        if self._closed:
            return say("hold_by_shutdown"), "interlock"
        if other := next(
            (one for one in self._held.values() if one.widget.topic == widget.topic), None
        ):
            code = "hold_elsewhere" if other.widget is widget else "hold_same_topic"
            return say(code, label=other.widget.label, topic=widget.topic), "interlock"
        if now >= sent + LEASE_S:
            return say("hold_press_too_late"), "interlock"
        if not (verdict := self._verdict(widget, context, now)).permitted:
            return verdict.reason or "", cause_of(verdict.code)
        return context.stale_reason(), "interlock"

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
            elif not (verdict := self._verdict(holding.widget, holding.context, now)).permitted:
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

    def _verdict(self, widget: HoldCommand, context: PressContext, now: float) -> Verdict:
        interlocks = self._panel.interlocks_of(widget)
        return judged(widget, interlocks, self._robot, now, context.grounds())

    def _schedule(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        now = self._loop.time()
        whens = [
            min(one.lease.next_at, one.lease.until, self._verdict(one.widget, one.context, now).until)
            for one in self._held.values()
        ]
        if whens:
            self._timer = self._loop.call_at(min(whens), self.step)

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

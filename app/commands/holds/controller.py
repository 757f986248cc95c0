"""Hold-to-run: publishes a message at a rate while one browser holds a button, and a stop message at
the end.

Permission is checked for each message. A hold that has ended never resumes: the operator has to release
and press again. Nothing is sent late: if the stop message cannot be sent when a hold ends, it is not
sent at all.
"""

import asyncio
import time
from collections.abc import Callable
from typing import Protocol

from app.clock import format_time
from app.commands.holds.deflection import Deflection, moved
from app.commands.holds.lease import LEASE_S, Lease
from app.commands.holds.messages import HoldMessages, Values
from app.commands.holds.receipts import RELEASED, ActiveHold, HoldReceipts
from app.commands.press import Press
from app.commands.press_judge import PressJudge
from app.commands.receipts import (
    MAX_FINAL_CHECKS,
    PressRecorder,
    Receipt,
    Refusal,
    refused_receipt,
)
from app.errors import FieldError, InputError, LinkError, NotFound, PressRefused
from app.i18n import TextLike, say
from app.panel.model import Panel
from app.panel.widgets.hold import HoldCommand
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
        lease = Lease.begun(press.id, widget.period_s, sent, now)
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

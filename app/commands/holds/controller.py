"""Hold-to-run: a message at a rate while one browser holds a button, and one more when it ends.

Each message is judged as a press is. Whatever ends a hold ends it for good: to go on, the operator
has to let go and press again. Nothing is sent late: where there is no way for the last message when
a hold ends, it is not sent at all.
"""

import asyncio
import secrets
import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from app.clock import format_time
from app.commands.holds.lease import LEASE_S, Lease
from app.commands.holds.messages import HoldMessages, Values
from app.commands.holds.receipts import RELEASED, ActiveHold, HoldReceipts, Refusal, refused
from app.commands.press_context import PressContext
from app.commands.press_judge import Arrivals
from app.commands.receipts import MAX_FINAL_CHECKS, PressRecorder, Receipt
from app.errors import Cause, FieldError, InputError, LinkError, NotFound, PressRefused
from app.i18n import TextLike, say
from app.panel.model import Panel
from app.panel.template import needed_inputs
from app.panel.widgets.hold import Hold
from app.permission.interlocks import Verdict
from app.permission.press_permission import cause_of, judged
from app.robot.state import RobotState


class Clock(Protocol):
    """What a hold needs of the event loop; `time` is in monotonic seconds."""

    def time(self) -> float: ...
    def call_at(self, when: float, callback: Callable[[], object]) -> asyncio.TimerHandle: ...


class HoldController:
    """The holds of one robot, one for each widget at most; used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        robot: RobotState,
        messages: HoldMessages,
        loop: Clock,
        latest: Arrivals,
        *,
        changed: Callable[[], None],
        recorder: PressRecorder | None = None,
    ) -> None:
        """`changed` is called when what the widgets show has changed."""
        self._panel = panel
        self._robot = robot
        self._loop = loop
        self._messages = messages
        self._receipts = HoldReceipts(robot.name, recorder)
        self._arrivals = latest
        self._changed = changed
        self._widgets = {w.id: w for w in panel.widgets() if isinstance(w, Hold)}
        self._held: dict[str, ActiveHold] = {}
        self._timer: asyncio.TimerHandle | None = None
        self._closed = False

    def unconfirmed(self, receipt: Receipt) -> Receipt:
        """The receipt of a hold whose last message is not known to have reached the bridge."""
        return self._receipts.unconfirmed(receipt)

    def widget(self, widget_id: str) -> Hold:
        """What can be held; NotFound for everything else."""
        if widget_id not in self._widgets:
            raise NotFound(f'there is no widget "{widget_id}" that can be held')
        return self._widgets[widget_id]

    def begin(
        self,
        widget_id: str,
        inputs: Mapping[str, Any],
        sent: float,
        context: PressContext,
        told: Callable[[Receipt], None],
        hold_id: str = "",
    ) -> Receipt | ActiveHold:
        """Begins to publish, or says why not. `sent` is when the browser asked, at the latest; a hold
        without an id gets one."""
        self._arrivals.ingest()
        self.judge()
        widget, now = self.widget(widget_id), self._loop.time()
        ready = self._prepare(widget, inputs, sent, context, now)
        if isinstance(ready, Refusal):
            return self._receipts.record_refusal(widget, inputs, context, ready, hold_id)
        lease = Lease.begun(hold_id or secrets.token_hex(8), widget.period_s, sent, now)
        since = say("hold_since", time=format_time(time.time()))
        holding = ActiveHold(widget, lease, context, needed_inputs(widget, inputs), ready, told, since)
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
        """A hold that is not even judged; it may leave a trace or none."""
        widget = self.widget(widget_id)
        refusal = Refusal(why, cause)
        if trace:
            return self._receipts.record_refusal(widget, {}, context, refusal, hold_id)
        return refused(widget, {}, refusal, hold_id)

    def refusal(
        self, widget_id: str, inputs: Mapping[str, Any], sent: float, context: PressContext
    ) -> Receipt | None:
        """The receipt of a hold that `begin` would refuse now, without a trace; None for others."""
        self._arrivals.ingest()
        self.judge()
        widget = self.widget(widget_id)
        ready = self._prepare(widget, inputs, sent, context, self._loop.time())
        return refused(widget, inputs, ready) if isinstance(ready, Refusal) else None

    def _prepare(
        self, widget: Hold, inputs: Mapping[str, Any], sent: float, context: PressContext, now: float
    ) -> Values | Refusal:
        """What it would publish if it began now, or why it may not."""
        why, cause = self._refusal_reason(widget, sent, context, now)
        if why:
            return Refusal(why, cause)
        try:
            return self._messages.values(widget, inputs)
        except (FieldError, InputError) as error:
            return Refusal(say("with_stop", said=error.text), "input")

    def _refusal_reason(
        self, widget: Hold, sent: float, context: PressContext, now: float
    ) -> tuple[TextLike, Cause]:
        """Why it may not begin now, "" if it may."""
        if self._closed:
            return say("hold_by_stopping"), "interlock"
        if other := next(
            (one for one in self._held.values() if one.widget.topic == widget.topic), None
        ):
            code = "hold_elsewhere" if other.widget is widget else "hold_same_topic"
            return say(code, label=other.widget.label, topic=widget.topic), "interlock"
        if now >= sent + LEASE_S:
            return say("hold_late"), "interlock"
        if not (verdict := self._verdict(widget, context, now)).permitted:
            return verdict.reason or "", cause_of(verdict.code)
        return context.stale_reason(), "interlock"

    def beat(self, holding: ActiveHold, number: int, sent: float) -> bool:
        """A heartbeat; whether the hold goes on."""
        self.judge()
        if not self._is_active(holding) or not holding.lease.beat(number, sent, self._loop.time()):
            return False
        self._schedule()
        return True

    def end(self, holding: ActiveHold, code: str) -> None:
        """Ends a hold, if it is going on; `code` is of the sentence that says why."""
        self.judge()
        if self._is_active(holding):
            self._end(holding, code, say(code) if code != RELEASED else "")

    def end_all(self, code: str) -> None:
        """Ends all that is going on."""
        for holding in list(self._held.values()):
            self.end(holding, code)
        self._schedule()

    def close(self) -> None:
        """Ends all for good."""
        self._closed = True
        self.end_all("hold_by_stopping")

    def judge(self) -> None:
        """Ends what has lost its ground: after every change, and before anything goes on."""
        for holding in list(self._held.values()):
            now = self._loop.time()
            if not self._is_active(holding):
                continue  # ended in the meantime, by what the end of another one showed
            if code := holding.lease.end_code(now):
                self._end(holding, code, say(code))
            elif not (verdict := self._verdict(holding.widget, holding.context, now)).permitted:
                self._end(holding, verdict.code, verdict.reason or "")

    def step(self) -> None:
        """Sends what is due, by all that has come until now, and plans the next step."""
        self._arrivals.ingest()
        self.judge()
        for holding in list(self._held.values()):
            if self._is_active(holding) and holding.lease.take_due(self._loop.time()):
                self._send(holding)
        self._schedule()

    def _is_active(self, holding: ActiveHold) -> bool:
        return self._held.get(holding.widget.id) is holding

    def _verdict(self, widget: Hold, context: PressContext, now: float) -> Verdict:
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
        try:
            self._messages.put(holding.widget, holding.values, lambda: self._final_check(holding))
        except LinkError as error:
            self._end(holding, "link", say("with_stop", said=error.text))
        except PressRefused:
            return  # it has ended
        else:
            holding.sent += 1

    def _final_check(self, holding: ActiveHold) -> None:
        """Right before a message is sent: what came while it was judged and encoded counts, too."""
        for _ in range(MAX_FINAL_CHECKS):
            if not self._is_active(holding):
                raise PressRefused("", "interlock")
            if not self._arrivals.has_urgent():
                return
            self._arrivals.ingest()
            self.judge()
        self.end(holding, "catching_up")
        raise PressRefused("", "interlock")

    def _end(self, holding: ActiveHold, code: str, why: TextLike) -> None:
        widget, now = holding.widget, self._loop.time()
        del self._held[widget.id]
        del self._robot.held_since[widget.id]
        unsaid = self._messages.put_last(widget, holding.values, now)
        receipt = self._receipts.record_end(holding, now - holding.lease.begun_at, code, why, unsaid)
        holding.on_end(receipt)
        self._changed()

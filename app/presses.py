"""One press: permission, encoding, put, receipt. Knows no HTTP.

The permission is judged here, at the press, by what the server knows then; what the browser
showed does not count.
"""

import asyncio
import logging
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, Final, Literal, Protocol

from app.actions import Actions
from app.calls import Calls
from app.errors import FieldError, InputError, LinkError, NotFound
from app.inputs import checked, typed
from app.interfaces import Interfaces
from app.interlocks import press_verdict
from app.logs import RobotLog
from app.panel.model import Action, Call, Input, Panel, Pressed, Publish
from app.panel.template import filled, named
from app.progress import Answer, Outcome
from app.robot import Robot
from app.sentences import clock, say

log = logging.getLogger("kiosk.presses")

Cause = Literal["", "interlock", "input", "link", "time"]

RECEIPTS_KEPT: Final = 1000
LONGEST_LOGGED: Final = 300
NO_WAY: Final = frozenset(
    {"no_link", "no_bridge", "no_bridge_of", "bridge_silent", "joining", "no_service"}
)
FINE: Final = frozenset({"published", "accepted", "succeeded"})


class Way(Protocol):
    """What a press needs of the link."""

    def put(self, key: str, payload: bytes) -> None: ...
    def heard(self, key: str) -> bool: ...


@dataclass(frozen=True, slots=True)
class Receipt:
    """What came of a press; `reason` is a sentence for the operator, `cause` why it was refused.

    `inputs` are those that the press came with: a page without scripts shows them again.
    """

    id: str
    widget: str
    outcome: Outcome
    reason: str
    at: str
    cause: Cause
    inputs: Mapping[str, Any]

    def as_json(self) -> dict[str, str]:
        return {
            "id": self.id,
            "widget": self.widget,
            "outcome": self.outcome,
            "reason": self.reason,
            "at": self.at,
        }


class Witness(Protocol):
    """Who is told of each press when it is made, and of each receipt, also of a corrected one."""

    def pressed(self, press_id: str, widget: str, who: str, inputs: Mapping[str, Any]) -> None: ...
    def answered(self, receipt: Receipt) -> None: ...


@dataclass(frozen=True, slots=True)
class _UnderWay:
    """A press whose receipt is not there yet."""

    widget: str
    inputs: Mapping[str, Any]
    receipt: "asyncio.Future[Receipt]"


def no_doubt() -> str:
    """Of who does not say what was seen, and when it was pressed."""
    return ""


class Presses:
    """Presses of one panel, with their receipts by press id."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        robot: Robot,
        way: Way,
        calls: Calls,
        actions: Actions,
        monotonic: Callable[[], float] = time.monotonic,
        witness: Witness | None = None,
    ) -> None:
        self._widgets = {w.id: w for w in panel.widgets()}
        self._panel = panel
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._way = way
        self._calls = calls
        self._actions = actions
        self._under_way: dict[str, _UnderWay] = {}
        self._monotonic = monotonic
        self._receipts: OrderedDict[str, Receipt] = OrderedDict()
        self._witness = witness

    def widget(self, widget_id: str) -> Pressed:
        """What can be pressed; NotFound for everything else."""
        widget = self._widgets.get(widget_id)
        if not isinstance(widget, Pressed):
            raise NotFound(f'there is no widget "{widget_id}" that can be pressed')
        return widget

    def typed(self, form: Mapping[str, str]) -> dict[str, Any]:
        """A form's texts as values of the inputs that they are named by."""
        fields = {name: self._widgets.get(name) for name in form}
        return {
            name: typed(field, form[name]) if isinstance(field, Input) else form[name]
            for name, field in fields.items()
        }

    def receipt(self, press_id: str) -> Receipt | None:
        """The receipt of a press, as it is known now."""
        return self._receipts.get(press_id)

    async def press(
        self,
        widget_id: str,
        inputs: Mapping[str, Any],
        press_id: str,
        who: str,
        doubt: Callable[[], str] = no_doubt,
    ) -> Receipt:
        """Sends what the widget is for, or refuses. The same id again is the same press.

        `who` is whom the log names; `doubt` says why what the operator saw no longer holds, in the
        moment of sending. Until something is sent nothing here waits, so that no second
        press comes between.
        """
        widget = self.widget(widget_id)
        known = self._under_way.get(press_id) or self._receipts.get(press_id)
        if known is None:
            return await self._first(widget, inputs, press_id, who, doubt)
        if (known.widget, known.inputs) != (widget_id, inputs):
            reused = say("press_reused", id=press_id)
            self._log.warning("press %s of %s by %s: %s", press_id, widget_id, who, reused)
            own_id = f"{press_id:.40}.{secrets.token_hex(4)}"
            self._witnessed(own_id, widget_id, who, inputs)
            refusal = self._receipt(widget, inputs, own_id, "refused", reused, "input")
            self._keep(refusal)
            return refusal
        if isinstance(known, _UnderWay):
            return await asyncio.shield(known.receipt)
        return known

    def refuse(self, widget_id: str, inputs: Mapping[str, Any], press_id: str, code: str) -> Receipt:
        """A press that can't be judged by what its browser had seen, for the reason of this code."""
        if known := self._receipts.get(press_id):
            return known
        text = say("refused", why=say(code), time=clock(time.time()))
        receipt = self._receipt(self.widget(widget_id), inputs, press_id, "refused", text, "interlock")
        self._witnessed(press_id, widget_id, "", inputs)
        self._keep(receipt)
        self._log.warning("press %s of %s: %s", press_id, widget_id, text)
        return receipt

    async def cancel(self, widget_id: str, who: str) -> Receipt:
        """Asks the robot to cancel the goal of an action widget."""
        widget = self.widget(widget_id)
        if not isinstance(widget, Action):
            raise NotFound(f'"{widget_id}" is not an action: there is nothing to cancel')
        answer = await self._actions.cancel(widget)
        self._log.info("cancel of %s by %s: %s: %s", widget_id, who, answer.outcome, answer.text)
        cause: Cause = "interlock" if answer.outcome == "refused" else ""
        return self._receipt(widget, {}, "", answer.outcome, answer.text, cause)

    async def _first(
        self,
        widget: Pressed,
        inputs: Mapping[str, Any],
        press_id: str,
        who: str,
        doubt: Callable[[], str],
    ) -> Receipt:
        loop = asyncio.get_running_loop()
        under_way = _UnderWay(widget.id, dict(inputs), loop.create_future())
        self._under_way[press_id] = under_way
        self._witnessed(press_id, widget.id, who, inputs)
        try:
            receipt = await self._pressed(widget, inputs, press_id, doubt)
        except BaseException as error:
            under_way.receipt.set_exception(error)
            under_way.receipt.exception()  # who else waited is told; nobody needs to have
            raise
        finally:
            del self._under_way[press_id]
        self._keep(receipt)
        under_way.receipt.set_result(receipt)
        level = logging.INFO if receipt.outcome in FINE else logging.WARNING
        self._log.log(level, "press %s of %s by %s with %.*s: %s: %s", press_id, widget.id, who,
                LONGEST_LOGGED, inputs, receipt.outcome, receipt.reason)  # fmt: skip
        return receipt

    def _witnessed(self, press_id: str, widget: str, who: str, inputs: Mapping[str, Any]) -> None:
        if self._witness is not None:
            self._witness.pressed(press_id, widget, who, inputs)

    def _keep(self, receipt: Receipt) -> None:
        if self._witness is not None:
            self._witness.answered(receipt)
        self._receipts[receipt.id] = receipt
        while len(self._receipts) > RECEIPTS_KEPT:
            self._receipts.popitem(last=False)

    def _correct(self, press_id: str, answer: Answer) -> None:
        """What is known of a press now is another thing than its receipt said."""
        if old := self._receipts.get(press_id):
            self._keep(replace(old, outcome=answer.outcome, reason=answer.text, cause=""))

    async def _pressed(
        self,
        widget: Pressed,
        inputs: Mapping[str, Any],
        press_id: str,
        doubt: Callable[[], str],
    ) -> Receipt:
        def receipt(answer: Answer, cause: Cause = "") -> Receipt:
            return self._receipt(widget, inputs, press_id, answer.outcome, answer.text, cause)

        def refused(sentence: str, why: str, cause: Cause) -> Receipt:
            now = clock(time.time())
            return receipt(Answer("refused", say(sentence, why=why, time=now)), cause)

        interlock = self._panel.interlock(widget.interlock)
        verdict = press_verdict(widget, interlock, self._robot, self._monotonic())
        if not verdict.permitted:
            cause: Cause = "link" if verdict.code in NO_WAY else "interlock"
            return refused("refused", verdict.reason or "", cause)
        if why := doubt():
            return refused("refused", why, "interlock")
        try:
            values = self._checked(widget, inputs)
            answer = await self._sent(widget, filled(widget.template, values), press_id)
        except (FieldError, InputError) as error:
            return refused("not_encoded", str(error), "input")
        except LinkError as error:
            return refused("not_encoded", str(error), "link")
        if answer.outcome == "refused":
            return refused("not_encoded", answer.text, "interlock")
        return receipt(answer, "time" if answer.outcome == "timed_out" else "")

    async def _sent(self, widget: Pressed, fields: dict[str, Any], press_id: str) -> Answer:
        match widget:
            case Publish():
                return self._published(widget, fields)
            case Call():
                request, _ = self._interfaces.service(widget.type)
                payload = self._interfaces.encode(request, fields)
                return await self._calls.call(widget, payload, press_id, self._correct)
            case Action():
                return await self._actions.start(widget, fields, press_id, self._correct)

    def _published(self, widget: Publish, fields: dict[str, Any]) -> Answer:
        payload = self._interfaces.encode(widget.type, fields)
        key = self._robot.key(widget.topic)
        heard = self._way.heard(key)
        self._way.put(key, payload)
        sentence = "published" if heard else "sent_to_nobody"
        text = say(sentence, topic=widget.topic, time=clock(time.time()))
        return Answer("published" if heard else "unknown", text)

    def _checked(self, widget: Pressed, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """The values of the inputs that the widget's message names."""
        for name in inputs:
            if not isinstance(self._widgets.get(name), Input):
                raise InputError(f'there is no input "{name:.60}" on this panel')
        values: dict[str, Any] = {}
        for _, name in named(widget.template):
            field = self._widgets[name]
            if name not in inputs:
                raise InputError(f'the input "{name}" is missing')
            if isinstance(field, Input):
                values[name] = checked(field, inputs[name])
        return values

    def _receipt(
        self,
        widget: Pressed,
        inputs: Mapping[str, Any],
        press_id: str,
        outcome: Outcome,
        reason: str,
        cause: Cause = "",
    ) -> Receipt:
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        return Receipt(press_id, widget.id, outcome, reason, at, cause, dict(inputs))

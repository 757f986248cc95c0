"""One press: permission, encoding, put, receipt. Knows no HTTP.

The permission is judged here, at the press, by what the server knows then; what the browser
showed does not count.
"""

import logging
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Final, Literal, Protocol

from app.errors import FieldError, InputError, LinkError, NotFound
from app.inputs import checked, typed
from app.interfaces import Interfaces
from app.interlocks import publish_verdict
from app.panel.model import Input, Panel, Publish
from app.panel.template import filled, named
from app.robot import Robot
from app.sentences import clock, say

log = logging.getLogger("kiosk.presses")

Outcome = Literal["published", "refused", "unknown"]
Cause = Literal["", "interlock", "input", "link"]

RECEIPTS_KEPT: Final = 1000
LONGEST_LOGGED: Final = 300
NO_WAY: Final = frozenset({"no_link", "no_bridge", "bridge_silent", "joining"})


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


class Presses:
    """Presses of one panel, with their receipts by press id."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        robot: Robot,
        way: Way,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._widgets = {w.id: w for w in panel.widgets()}
        self._panel = panel
        self._interfaces = interfaces
        self._robot = robot
        self._way = way
        self._monotonic = monotonic
        self._receipts: OrderedDict[str, Receipt] = OrderedDict()

    def widget(self, widget_id: str) -> Publish:
        """What can be pressed; NotFound for everything else."""
        widget = self._widgets.get(widget_id)
        if not isinstance(widget, Publish):
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
        return self._receipts.get(press_id)

    def press(self, widget_id: str, inputs: Mapping[str, Any], press_id: str, who: str) -> Receipt:
        """Sends the widget's message, or refuses. The same id again is the same press.

        `who` is whom the log names. Nothing here waits, so that no second press comes between.
        """
        widget = self.widget(widget_id)
        known = self._receipts.get(press_id)
        if known is None:
            receipt = self._pressed(widget, inputs, press_id)
            self._receipts[press_id] = receipt
            while len(self._receipts) > RECEIPTS_KEPT:
                self._receipts.popitem(last=False)
            level = logging.INFO if receipt.outcome == "published" else logging.WARNING
            log.log(level, "press %s of %s by %s with %.*s: %s: %s", press_id, widget_id, who,
                    LONGEST_LOGGED, inputs, receipt.outcome, receipt.reason)  # fmt: skip
            return receipt
        if (known.widget, known.inputs) != (widget_id, inputs):
            reused = say("press_reused", id=press_id)
            log.warning("press %s of %s by %s: %s", press_id, widget_id, who, reused)
            return self._receipt(widget, inputs, press_id, "refused", reused, "input")
        return known

    def _pressed(self, widget: Publish, inputs: Mapping[str, Any], press_id: str) -> Receipt:
        def refused(sentence: str, why: str, cause: Cause) -> Receipt:
            text = say(sentence, why=why)
            return self._receipt(widget, inputs, press_id, "refused", text, cause)

        interlock = self._panel.interlock(widget.interlock)
        verdict = publish_verdict(widget, interlock, self._robot, self._monotonic())
        if not verdict.permitted:
            cause: Cause = "link" if verdict.code in NO_WAY else "interlock"
            return refused("refused", verdict.reason or "", cause)
        try:
            values = self._checked(widget, inputs)
            payload = self._interfaces.encode(widget.type, filled(widget.message, values))
        except (FieldError, InputError) as error:
            return refused("not_encoded", str(error), "input")
        key = self._robot.key(widget.topic)
        try:
            heard = self._way.heard(key)
            self._way.put(key, payload)
        except LinkError as error:
            return refused("not_encoded", str(error), "link")
        sentence = "published" if heard else "sent_to_nobody"
        text = say(sentence, topic=widget.topic, time=clock(time.time()))
        return self._receipt(widget, inputs, press_id, "published" if heard else "unknown", text)

    def _checked(self, widget: Publish, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """The values of the inputs that the widget's message names."""
        for name in inputs:
            if not isinstance(self._widgets.get(name), Input):
                raise InputError(f'there is no input "{name:.60}" on this panel')
        values: dict[str, Any] = {}
        for _, name in named(widget.message):
            field = self._widgets[name]
            if name not in inputs:
                raise InputError(f'the input "{name}" is missing')
            if isinstance(field, Input):
                values[name] = checked(field, inputs[name])
        return values

    def _receipt(
        self,
        widget: Publish,
        inputs: Mapping[str, Any],
        press_id: str,
        outcome: Outcome,
        reason: str,
        cause: Cause = "",
    ) -> Receipt:
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        return Receipt(press_id, widget.id, outcome, reason, at, cause, dict(inputs))

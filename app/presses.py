"""One press: log, permission, encoding, put, log, receipt. Knows no HTTP.

The permission is judged here, by what the server knows when the press stands in the operator's log;
what the browser showed does not count. Between judging and sending nothing waits.
"""

import asyncio
import logging
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable, Coroutine, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from typing import Any, Final, Literal, Protocol

from app import declared
from app.actions import Actions
from app.calls import Calls
from app.confirmations import Confirmations
from app.errors import FieldError, InputError, LinkError, LogError, NotFound
from app.inputs import checked, typed
from app.interfaces import Interfaces
from app.interlocks import PERMITTED, Verdict, press_verdict, way
from app.log import Origin
from app.logbook import Logbook, Noted
from app.logs import RobotLog
from app.panel.model import Action, Call, Input, Panel, Pressed, Publish
from app.panel.parameter import Parameter
from app.panel.template import filled, inputs_of
from app.parameters import Parameters
from app.progress import Answer, Outcome
from app.robot import Robot
from app.sentences import clock, say

log = logging.getLogger("kiosk.presses")

Cause = Literal["", "interlock", "input", "link", "log", "time"]

RECEIPTS_KEPT: Final = 1000
LONGEST_LOGGED: Final = 300
NO_WAY: Final = frozenset(
    {
        "no_link",
        "no_bridge",
        "no_bridge_of",
        "bridge_silent",
        "joining",
        "no_service",
        "no_parameters",
        "getting_ready",
    }
)
FINE: Final = frozenset({"published", "confirmed", "accepted", "succeeded"})


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


@dataclass(frozen=True, slots=True)
class By:
    """Who presses, and what has to hold beside the robot's permission when it is sent: `controls`
    judges who has control, `doubt` says why what the operator saw is no longer so."""

    origin: Origin
    controls: Callable[[], Verdict] = lambda: PERMITTED
    doubt: Callable[[], str] = no_doubt


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
        confirmations: Confirmations,
        parameters: Parameters,
        logbook: Logbook,
        monotonic: Callable[[], float] = time.monotonic,
        catch_up: Callable[[], None] = lambda: None,
        witness: Witness | None = None,
    ) -> None:
        """`catch_up` takes in all that has come from the robot, right before a press is judged."""
        self._widgets = {w.id: w for w in panel.widgets()}
        self._panel = panel
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._way = way
        self._calls = calls
        self._actions = actions
        self._confirmations = confirmations
        self._parameters = parameters
        self._logbook = logbook
        self._catch_up = catch_up
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
        return {name: self._typed(name, text) for name, text in form.items()}

    def _typed(self, name: str, text: str) -> Any:
        field = self._widgets.get(name)
        if isinstance(field, Parameter):
            return declared.typed(field, text)
        return typed(field, text) if isinstance(field, Input) else text

    def receipt(self, press_id: str) -> Receipt | None:
        """The receipt of a press, as it is known now."""
        return self._receipts.get(press_id)

    async def press(self, widget_id: str, inputs: Mapping[str, Any], press_id: str, by: By) -> Receipt:
        """Sends what the widget is for, or refuses. The same id again is the same press.

        What it is judged by, is judged in the moment of sending.
        """
        widget = self.widget(widget_id)
        known = self._under_way.get(press_id) or self._receipts.get(press_id)
        if known is None:
            work = self._logged(widget, inputs, press_id, by)
            return await self._once(widget, inputs, press_id, work)
        if (known.widget, known.inputs) != (widget_id, inputs):
            reused = say("press_reused", id=press_id)
            own_id = f"{press_id:.40}.{secrets.token_hex(4)}"
            work = self._refused(widget, inputs, own_id, by.origin, reused, "input")
            return await self._once(widget, inputs, own_id, work)
        if isinstance(known, _UnderWay):
            return await asyncio.shield(known.receipt)
        return known

    async def refuse(
        self, widget_id: str, inputs: Mapping[str, Any], press_id: str, origin: Origin, code: str
    ) -> Receipt:
        """A press that can't be judged by what its browser had seen, for the reason of this code."""
        known = self._under_way.get(press_id) or self._receipts.get(press_id)
        if isinstance(known, _UnderWay):
            return await asyncio.shield(known.receipt)
        if known is not None:
            return known
        text = say("refused", why=say(code), time=clock(time.time()))
        widget = self.widget(widget_id)
        work = self._refused(widget, inputs, press_id, origin, text, "interlock")
        return await self._once(widget, inputs, press_id, work)

    async def cancel(self, widget_id: str, origin: Origin) -> Receipt:
        """Asks the robot to cancel the goal of an action widget: anybody may, whoever has control."""
        widget = self.widget(widget_id)
        if not isinstance(widget, Action):
            raise NotFound(f'"{widget_id}" is not an action: there is nothing to cancel')
        noted = await self._logbook.canceled(widget_id, origin)
        with _noted_to_the_end(noted):
            answer = await self._actions.cancel(widget)
        self._log.info(
            "cancel of %s by %s: %s: %s", widget_id, named(origin), answer.outcome, answer.text
        )
        cause: Cause = "interlock" if answer.outcome == "refused" else ""
        receipt = self._receipt(widget, {}, "", answer.outcome, answer.text, cause)
        return await _closed(noted, receipt)

    async def _once(
        self,
        widget: Pressed,
        inputs: Mapping[str, Any],
        press_id: str,
        work: Coroutine[Any, Any, Receipt],
    ) -> Receipt:
        """Does the work of a press, while others of the same id wait for its receipt."""
        loop = asyncio.get_running_loop()
        under_way = _UnderWay(widget.id, dict(inputs), loop.create_future())
        self._under_way[press_id] = under_way
        try:
            receipt = await work
        except BaseException as error:
            under_way.receipt.set_exception(error)
            under_way.receipt.exception()  # who else waited is told; nobody needs to have
            raise
        finally:
            del self._under_way[press_id]
        self._keep(receipt)
        under_way.receipt.set_result(receipt)
        return receipt

    async def _logged(
        self,
        widget: Pressed,
        inputs: Mapping[str, Any],
        press_id: str,
        by: By,
    ) -> Receipt:
        self._witnessed(press_id, widget.id, by.origin, inputs)
        try:
            noted = await self._logbook.pressed(widget.id, inputs, press_id, by.origin)
        except LogError as error:
            text = say("refused", why=str(error), time=clock(time.time()))
            receipt = self._receipt(widget, inputs, press_id, "refused", text, "log")
        else:
            with _noted_to_the_end(noted):
                receipt = await self._pressed(widget, inputs, press_id, noted, by)
            receipt = await _closed(noted, receipt)
        level = logging.INFO if receipt.outcome in FINE else logging.WARNING
        self._log.log(level, "press %s of %s by %s with %.*s: %s: %s", press_id, widget.id,
                named(by.origin),
                LONGEST_LOGGED, inputs, receipt.outcome, receipt.reason)  # fmt: skip
        return receipt

    async def _refused(
        self,
        widget: Pressed,
        inputs: Mapping[str, Any],
        press_id: str,
        origin: Origin,
        text: str,
        cause: Cause,
    ) -> Receipt:
        """A press that is not even judged."""
        self._witnessed(press_id, widget.id, origin, inputs)
        receipt = self._receipt(widget, inputs, press_id, "refused", text, cause)
        self._log.warning("press %s of %s by %s: %s", press_id, widget.id, named(origin), text)
        return _with_doubt(
            receipt, await self._logbook.refused(widget.id, inputs, press_id, origin, text)
        )

    def _witnessed(self, press_id: str, widget: str, origin: Origin, inputs: Mapping[str, Any]) -> None:
        if self._witness is not None:
            self._witness.pressed(press_id, widget, named(origin), inputs)

    def _keep(self, receipt: Receipt) -> None:
        if self._witness is not None:
            self._witness.answered(receipt)
        self._receipts[receipt.id] = receipt
        while len(self._receipts) > RECEIPTS_KEPT:
            self._receipts.popitem(last=False)

    def _correct(self, noted: Noted, press_id: str, answer: Answer) -> None:
        """What is known of a press now is another thing than its receipt said."""
        noted.corrected(answer)
        if old := self._receipts.get(press_id):
            self._keep(_corrected(old, answer))

    def _judged(self, widget: Pressed, by: By) -> Verdict:
        """The first that locks: the way to the robot, who has control, the widget's interlock."""
        now = self._monotonic()
        for verdict in (way(self._robot, now), by.controls()):
            if not verdict.permitted:
                return verdict
        return press_verdict(widget, self._panel.interlock(widget.interlock), self._robot, now)

    async def _pressed(
        self, widget: Pressed, inputs: Mapping[str, Any], press_id: str, noted: Noted, by: By
    ) -> Receipt:
        def receipt(answer: Answer, cause: Cause = "") -> Receipt:
            return self._receipt(widget, inputs, press_id, answer.outcome, answer.text, cause)

        def refused(sentence: str, why: str, cause: Cause) -> Receipt:
            now = clock(time.time())
            return receipt(Answer("refused", say(sentence, why=why, time=now)), cause)

        self._catch_up()
        verdict = self._judged(widget, by)
        noted.judged(verdict.code)
        if not verdict.permitted:
            cause: Cause = "link" if verdict.code in NO_WAY else "interlock"
            return refused("refused", verdict.reason or "", cause)
        if why := by.doubt():
            return refused("refused", why, "interlock")
        try:
            values = self.checked(inputs_of(widget), inputs)
            answer = await self._sent(widget, values, press_id, noted)
        except (FieldError, InputError) as error:
            return refused("not_encoded", str(error), "input")
        except LinkError as error:
            return refused("not_encoded", str(error), "link")
        if answer.outcome == "refused":
            return refused("not_encoded", answer.text, "interlock")
        return receipt(answer, "time" if answer.outcome == "timed_out" else "")

    async def _sent(
        self, widget: Pressed, values: Mapping[str, Any], press_id: str, noted: Noted
    ) -> Answer:
        correct = partial(self._correct, noted)
        fields = filled(widget.template, values)
        match widget:
            case Publish():
                since = self._monotonic()
                answer = self._published(widget, fields)
                if widget.confirm is None:
                    return answer
                equals = filled(widget.confirm.equals, values)
                return await self._confirmations.awaited(
                    widget, equals, press_id, since, answer.text, correct
                )
            case Call():
                request, _ = self._interfaces.service(widget.type)
                payload = self._interfaces.encode(request, fields)
                return await self._calls.call(widget, payload, press_id, correct)
            case Action():
                return await self._actions.start(widget, fields, press_id, correct)
            case Parameter():
                return await self._parameters.set(widget, fields["value"], press_id, correct)

    def _published(self, widget: Publish, fields: dict[str, Any]) -> Answer:
        payload = self._interfaces.encode(widget.type, fields)
        key = self._robot.key(widget.topic)
        heard = self._way.heard(key)
        self._way.put(key, payload)
        sentence = "published" if heard else "sent_to_nobody"
        text = say(sentence, topic=widget.topic, time=clock(time.time()))
        return Answer("published" if heard else "unknown", text)

    def checked(self, names: Iterable[str], inputs: Mapping[str, Any]) -> dict[str, Any]:
        """The values of the inputs with these ids."""
        for name in inputs:
            if not isinstance(self._widgets.get(name), Input | Parameter):
                raise InputError(f'there is no input "{name:.60}" on this panel')
        values: dict[str, Any] = {}
        for name in names:
            field = self._widgets[name]
            if name not in inputs:
                raise InputError(f'the input "{name}" is missing')
            if isinstance(field, Input):
                values[name] = checked(field, inputs[name])
            elif isinstance(field, Parameter):
                values[name] = self._parameters.checked(field, inputs[name])
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


@contextmanager
def _noted_to_the_end(noted: Noted) -> Iterator[None]:
    """What breaks off in here is said to have, in the log."""
    try:
        yield
    except asyncio.CancelledError:
        noted.broke_off("log_ended")
        raise
    except BaseException:
        noted.broke_off("log_broke_off")
        raise


async def _closed(noted: Noted, receipt: Receipt) -> Receipt:
    """The receipt, when what it says is on the disk; where it is not, it says so."""
    doubt = await noted.closed(receipt.outcome, receipt.reason)
    if noted.corrected_to is not None:  # meanwhile
        receipt = _corrected(receipt, noted.corrected_to)
    return _with_doubt(receipt, doubt)


def _corrected(receipt: Receipt, answer: Answer) -> Receipt:
    return replace(receipt, outcome=answer.outcome, reason=answer.text, cause="")


def _with_doubt(receipt: Receipt, doubt: str) -> Receipt:
    if not doubt:
        return receipt
    return replace(receipt, reason=say("log_not_on_disk", said=receipt.reason, why=doubt))


def named(origin: Origin) -> str:
    return f"{origin.who} ({origin.address})" if origin.who else origin.address

"""What a press is for: its inputs checked, its message, request or goal encoded, and sent."""

import time
from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Any, NamedTuple, Protocol

from app.clock import format_time
from app.commands.actions.goals import GoalTracker
from app.commands.confirmations import Confirmations
from app.commands.parameters.sync import ParameterSync
from app.commands.service_calls import ServiceCalls
from app.errors import InputError, NotFound
from app.i18n import TextLike, say
from app.interfaces import Interfaces
from app.panel.model import Panel
from app.panel.template import add_now, fill, input_ids
from app.panel.widgets.families import Command, EntryWidget, Input, PressCommand
from app.panel.widgets.kinds import find_row
from app.panel.widgets.parameter import SET, Parameter
from app.panel.widgets.publish import SinglePublish
from app.panel.widgets.service_action import Action, Call
from app.robot.command_status import FinalCheck, OnCorrection, Outcome, no_check
from app.robot.state import RobotState


class Transport(Protocol):
    """What a press needs of the link."""

    def put(self, key: str, payload: bytes) -> None: ...
    def heard(self, key: str) -> bool: ...


async def taken_for_reached() -> bool:
    """Where no one asks whether something arrives."""
    return True


class Outgoing(NamedTuple):
    """What is sent by a press: the checked `values` of its inputs and the `fields` that they fill in,
    and what `Dispatcher.send` gets beside them."""

    values: dict[str, Any]
    fields: dict[str, Any]
    press_id: str
    correct: OnCorrection
    entry: str
    look: FinalCheck


class Trackers(NamedTuple):
    """What sends commands that the robot answers later, and knows each that has no answer yet."""

    calls: ServiceCalls
    actions: GoalTracker
    confirmations: Confirmations
    parameters: ParameterSync


class Dispatcher:
    """What the widgets of one panel send to one robot; judges nothing."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        robot: RobotState,
        transport: Transport,
        trackers: Trackers,
        monotonic: Callable[[], float] = time.monotonic,
        reached: Callable[[], Awaitable[bool]] = taken_for_reached,
    ) -> None:
        """`reached` tells, later, whether what was sent until now has reached the bridge."""
        self._reached = reached
        self._widgets = {w.id: w for w in panel.widgets()}
        self._needs = {
            id: input_ids(w) for id, w in self._widgets.items() if isinstance(w, PressCommand)
        }
        self._interfaces = interfaces
        self._robot = robot
        self._transport = transport
        self._calls = trackers.calls
        self._actions = trackers.actions
        self._confirmations = trackers.confirmations
        self._parameters = trackers.parameters
        self._monotonic = monotonic
        # How each kind, or family, is sent; why it would not be; and how what is entered is checked.
        self.senders: Mapping[type[PressCommand], Callable[[Any, Outgoing], Awaitable[Outcome]]] = {
            SinglePublish: self._publish,
            Call: self._call,
            Action: self._start,
            Parameter: self._set,
        }
        self.refusals: Mapping[type[PressCommand], Callable[[Any, dict[str, Any]], TextLike]] = {
            SinglePublish: self._unpublished,
            Call: self._uncalled,
            Action: lambda widget, _: self._actions.full(widget.action),
            Parameter: lambda widget, _: self._calls.full(f"{widget.node}/{SET[0]}"),
        }
        self.checks: Mapping[type[EntryWidget], Callable[[Any, Any], Any]] = {
            Input: lambda widget, given: widget.check_value(given),
            Parameter: self._parameters.checked,
        }

    def widget(self, widget_id: str) -> PressCommand:
        """What can be pressed; NotFound for everything else."""
        widget = self._widgets.get(widget_id)
        if not isinstance(widget, PressCommand):
            raise NotFound(f'there is no widget "{widget_id}" that can be pressed')
        return widget

    def typed(self, form: Mapping[str, str]) -> dict[str, Any]:
        """A form's texts as values of the inputs that they are named by."""
        return {name: self._typed(name, text) for name, text in form.items()}

    def _typed(self, name: str, text: str) -> Any:
        field = self._widgets.get(name)
        return field.parse_text(text) if isinstance(field, EntryWidget) else text

    def needed(self, widget: PressCommand, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """Of all that came with a press, the inputs that it needs."""
        return {name: inputs[name] for name in self._needs[widget.id] if name in inputs}

    def with_defaults(self, widget: Command, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """What came with a press, and the defaults of other inputs that it needs, where the panel file
        gives one."""
        fields = ((name, self._widgets[name]) for name in input_ids(widget) if name not in inputs)
        missing = {
            name: field.default_value for name, field in fields if isinstance(field, EntryWidget)
        }
        return {name: value for name, value in missing.items() if value is not None} | {**inputs}

    async def send(
        self,
        widget: PressCommand,
        inputs: Mapping[str, Any],
        press_id: str,
        correct: OnCorrection,
        entry: str = "",
        look: FinalCheck = no_check,
    ) -> Outcome:
        """Sends, and waits for what comes of it; `correct` gets what is known later. `entry` is the
        hash of the press's entry in the operator's log, `look` the last one at what permits it.

        Until it is sent nothing here waits. FieldError or InputError for bad input, LinkError where
        it could not be sent, PressRefused where `look` finds that it may not be.
        """
        values = self.checked(self._needs[widget.id], inputs)
        fields = fill(widget.template, add_now(values))
        send = find_row(self.senders, widget)
        return await send(widget, Outgoing(values, fields, press_id, correct, entry, look))

    def refusal(self, widget: PressCommand, inputs: Mapping[str, Any]) -> TextLike:
        """Why `send` would refuse it now, "" if it would not; FieldError or InputError as there."""
        values = self.checked(self._needs[widget.id], inputs)
        return find_row(self.refusals, widget)(widget, fill(widget.template, add_now(values)))

    async def _publish(self, widget: SinglePublish, going: Outgoing) -> Outcome:
        if widget.confirm is None:
            return await self._arrived(widget, self._published(widget, going.fields, going.look))
        equals = fill(widget.confirm.equals, going.values)
        since = self._monotonic()
        answer = self._published(widget, going.fields, going.look)
        return await self._confirmations.awaited(
            widget, equals, going.press_id, since, answer.text, going.correct
        )

    def _unpublished(self, widget: SinglePublish, fields: dict[str, Any]) -> str:
        self._interfaces.encode(widget.type, fields)
        return ""

    async def _call(self, widget: Call, going: Outgoing) -> Outcome:
        request, _ = self._interfaces.service_types(widget.type)
        payload = self._interfaces.encode(request, going.fields)
        return await self._calls.call(widget, payload, going.press_id, going.correct, going.look)

    def _uncalled(self, widget: Call, fields: dict[str, Any]) -> TextLike:
        self._interfaces.encode(self._interfaces.service_types(widget.type)[0], fields)
        return self._calls.full(widget.service)

    async def _start(self, widget: Action, going: Outgoing) -> Outcome:
        return await self._actions.start(
            widget, going.fields, going.press_id, going.correct, going.entry, going.look
        )

    async def _set(self, widget: Parameter, going: Outgoing) -> Outcome:
        value = going.fields["value"]
        return await self._parameters.set(widget, value, going.press_id, going.correct, going.look)

    def _published(self, widget: SinglePublish, fields: dict[str, Any], look: FinalCheck) -> Outcome:
        payload = self._interfaces.encode(widget.type, fields)
        key = self._robot.key(widget.topic)
        heard = self._transport.heard(key)
        look()
        self._transport.put(key, payload)
        sentence = "published" if heard else "sent_to_nobody"
        text = say(sentence, topic=widget.topic, time=format_time(time.time()))
        return Outcome("published" if heard else "unknown", text)

    async def _arrived(self, widget: SinglePublish, answer: Outcome) -> Outcome:
        """What was `published` is on its way until the bridge has answered."""
        at = format_time(time.time())
        if answer.outcome != "published" or await self._reached():
            return answer
        return Outcome("unknown", say("sent_unanswered", topic=widget.topic, time=at))

    def checked(self, names: Iterable[str], inputs: Mapping[str, Any]) -> dict[str, Any]:
        """The values of the inputs with these ids."""
        for name in inputs:
            if not isinstance(self._widgets.get(name), EntryWidget):
                raise InputError(f'there is no input "{name:.60}" on this panel')
        values: dict[str, Any] = {}
        for name in names:
            field = self._widgets[name]
            if name not in inputs:
                raise InputError(f'the input "{name}" is missing')
            values[name] = find_row(self.checks, field)(field, inputs[name])
        return values

    def over(self, widget: Action, press_id: str) -> TextLike:
        """Why there is no goal to cancel; "" where there is one."""
        return self._actions.over(widget, press_id)

    async def cancel(self, widget: Action, press_id: str) -> Outcome:
        """Asks the robot to cancel the goal of a press or, without its id, the one under way."""
        return await self._actions.cancel(widget, press_id)

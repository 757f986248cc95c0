"""What a press is for: its inputs checked, its message, request or goal encoded, and sent."""

import time
from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Any, Protocol

from app.clock import format_time
from app.commands.actions.goals import Actions
from app.commands.confirmations import Confirmations
from app.commands.parameters import values
from app.commands.parameters.sync import Parameters
from app.commands.service_calls import Calls
from app.errors import InputError, NotFound
from app.i18n import say
from app.interfaces import Interfaces
from app.panel.input_values import checked, default_of, typed
from app.panel.model import Input, Panel, Pressed
from app.panel.template import filled, inputs_of, with_now
from app.panel.widgets.hold import Hold
from app.panel.widgets.parameter import SET, Parameter
from app.panel.widgets.publish import Publish
from app.panel.widgets.service_action import Action, Call
from app.robot.command_status import Answer, Corrected, LastLook, no_look
from app.robot.state import Robot


class Way(Protocol):
    """What a press needs of the link."""

    def put(self, key: str, payload: bytes) -> None: ...
    def heard(self, key: str) -> bool: ...


async def taken_for_reached() -> bool:
    """Where nobody asks whether something arrives."""
    return True


class Sending:
    """What the widgets of one panel send to one robot; judges nothing."""

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
        monotonic: Callable[[], float] = time.monotonic,
        reached: Callable[[], Awaitable[bool]] = taken_for_reached,
    ) -> None:
        """`reached` tells, later, whether what was sent until now has reached the bridge."""
        self._reached = reached
        self._widgets = {w.id: w for w in panel.widgets()}
        self._needs = {id: inputs_of(w) for id, w in self._widgets.items() if isinstance(w, Pressed)}
        self._interfaces = interfaces
        self._robot = robot
        self._way = way
        self._calls = calls
        self._actions = actions
        self._confirmations = confirmations
        self._parameters = parameters
        self._monotonic = monotonic

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
            return values.typed(field, text)
        return typed(field, text) if isinstance(field, Input) else text

    def needed(self, widget: Pressed, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """Of all that came with a press, the inputs that it needs."""
        return {name: inputs[name] for name in self._needs[widget.id] if name in inputs}

    def with_defaults(self, widget: Pressed | Hold, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """What came with a press, and the defaults of other inputs that it needs, where the panel file
        gives one."""
        fields = ((name, self._widgets[name]) for name in inputs_of(widget) if name not in inputs)
        missing = {name: default_of(field) for name, field in fields if isinstance(field, Input)}
        return {name: value for name, value in missing.items() if value is not None} | {**inputs}

    async def send(
        self,
        widget: Pressed,
        inputs: Mapping[str, Any],
        press_id: str,
        correct: Corrected,
        entry: str = "",
        look: LastLook = no_look,
    ) -> Answer:
        """Sends, and waits for what comes of it; `correct` gets what is known later. `entry` is the
        hash of the press's entry in the operator's log, `look` the last one at what permits it.

        Until it is sent nothing here waits. FieldError or InputError for bad input, LinkError where
        it could not be sent, PressRefused where `look` finds that it may not be.
        """
        values = self.checked(self._needs[widget.id], inputs)
        fields = filled(widget.template, with_now(values))
        match widget:
            case Publish():
                if widget.confirm is None:
                    return await self._arrived(widget, self._published(widget, fields, look))
                equals = filled(widget.confirm.equals, values)
                since = self._monotonic()
                answer = self._published(widget, fields, look)
                return await self._confirmations.awaited(
                    widget, equals, press_id, since, answer.text, correct
                )
            case Call():
                request, _ = self._interfaces.service(widget.type)
                payload = self._interfaces.encode(request, fields)
                return await self._calls.call(widget, payload, press_id, correct, look)
            case Action():
                return await self._actions.start(widget, fields, press_id, correct, entry, look)
            case Parameter():
                return await self._parameters.set(widget, fields["value"], press_id, correct, look)

    def refusal(self, widget: Pressed, inputs: Mapping[str, Any]) -> str:
        """Why `send` would refuse it now, "" if it would not; FieldError or InputError as there."""
        values = self.checked(self._needs[widget.id], inputs)
        fields = filled(widget.template, with_now(values))
        match widget:
            case Publish():
                self._interfaces.encode(widget.type, fields)
            case Call():
                self._interfaces.encode(self._interfaces.service(widget.type)[0], fields)
                return self._calls.full(widget.service)
            case Action():
                return self._actions.full(widget.action)
            case Parameter():
                return self._calls.full(f"{widget.node}/{SET[0]}")
        return ""

    def _published(self, widget: Publish, fields: dict[str, Any], look: LastLook) -> Answer:
        payload = self._interfaces.encode(widget.type, fields)
        key = self._robot.key(widget.topic)
        heard = self._way.heard(key)
        look()
        self._way.put(key, payload)
        sentence = "published" if heard else "sent_to_nobody"
        text = say(sentence, topic=widget.topic, time=format_time(time.time()))
        return Answer("published" if heard else "unknown", text)

    async def _arrived(self, widget: Publish, answer: Answer) -> Answer:
        """What was `published` is on its way until the bridge has answered."""
        at = format_time(time.time())
        if answer.outcome != "published" or await self._reached():
            return answer
        return Answer("unknown", say("sent_unanswered", topic=widget.topic, time=at))

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

    def over(self, widget: Action, press_id: str) -> str:
        """Why there is no goal to cancel; "" where there is one."""
        return self._actions.over(widget, press_id)

    async def cancel(self, widget: Action, press_id: str) -> Answer:
        """Asks the robot to cancel the goal of a press or, without its id, the one under way."""
        return await self._actions.cancel(widget, press_id)

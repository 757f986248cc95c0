"""Dispatches a press: checks its inputs, encodes the message, request or goal, and sends it."""

import time
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from app.cell.commands.confirmations import Confirmations, Unconfirmed, equal
from app.cell.commands.goals import GoalTracker
from app.cell.commands.parameters import ParameterSync
from app.cell.commands.press import Press, PressHandle
from app.cell.commands.recipe_loads import RecipeLoader
from app.cell.commands.services import ServiceCalls
from app.cell.commands.transport import Transport
from app.cell.permission.interlocks import reported_value
from app.cell.permission.robot_options import options_now
from app.cell.robot.state import RobotState
from app.cell.view.displays import field_state
from app.panel.constants import resolve_at
from app.panel.model import Panel
from app.panel.template import fill, fill_to_send, input_ids
from app.panel.widgets.families import Command, EntryWidget, Input, PressCommand
from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.kinds import find_row, require_rows
from app.panel.widgets.parameter import SET, Parameter
from app.panel.widgets.place import MapInput, PlaceInput
from app.panel.widgets.publish import Confirm, Publish, PublishPress, Step
from app.panel.widgets.recipe_load import RecipeLoad
from app.panel.widgets.service_action import Action, Call
from app.panel.widgets.switch import Switch
from app.panel.widgets.templated import is_stop
from app.panel.widgets.tour import Tour
from app.records.entry import FinalCheck, Outcome
from app.ros.messages import Interfaces
from app.ros.messages.validation import format_value
from app.system.clock import format_time
from app.system.errors import InputError, NotFound, PressRefused
from app.system.texts import ENGLISH, TextLike, joined, number, say

AnyCommand = TypeVar("AnyCommand", bound=Command)


async def assume_flushed() -> bool:
    """For transports that cannot tell whether the peer received a message."""
    return True


if TYPE_CHECKING:
    from app.cell.permission.goal_places import Goal, TourGoal


class PreparedPress(NamedTuple):
    """A press to be sent: the `values` that its inputs send, and the `fields` of the filled-in
    template."""

    values: dict[str, Any]
    fields: dict[str, Any]
    handle: PressHandle


class Dispatch(NamedTuple):
    """Of a kind or family: `send` sends a press, `refusal` returns why that would be refused now, else
    ""."""

    send: Callable[[Any, PreparedPress], Awaitable[Outcome]]
    refusal: Callable[[Any, dict[str, Any]], TextLike]


class Trackers(NamedTuple):
    """The trackers of commands that the robot answers later."""

    calls: ServiceCalls
    actions: GoalTracker
    confirmations: Confirmations
    parameters: ParameterSync
    recipes: RecipeLoader


class Dispatcher:
    """Sends the commands of one panel's widgets to one robot. Does not check permission."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        robot: RobotState,
        transport: Transport,
        trackers: Trackers,
        monotonic: Callable[[], float] = time.monotonic,
        flushed: Callable[[], Awaitable[bool]] = assume_flushed,
    ) -> None:
        """`flushed` returns whether everything sent so far has reached the peer."""
        self._flushed = flushed
        self._widgets = {w.id: w for w in panel.widgets()}
        self._of_others = panel.inputs_of_others
        self._input_ids = {
            id: input_ids(w) for id, w in self._widgets.items() if isinstance(w, PressCommand)
        }
        self._interfaces = interfaces
        self._types = panel.subscriptions()
        self._robot = robot
        self._transport = transport
        self._calls = trackers.calls
        self.actions = trackers.actions
        self._confirmations = trackers.confirmations
        self._parameters = trackers.parameters
        self._recipes = trackers.recipes
        self._monotonic = monotonic
        # By kind or family of widgets: how to dispatch it, how to check an entry.
        self.dispatches: Mapping[type[Any], Dispatch] = {
            PublishPress: Dispatch(self._publish, self._check_message),
            Call: Dispatch(self._call, self._check_call),
            Switch: Dispatch(self._switch, self._check_switch),
            RecipeLoad: Dispatch(self._load, self._check_load),
            Action: Dispatch(self._start, lambda widget, _: self.actions.full(widget.action)),
            Parameter: Dispatch(
                self._set, lambda widget, _: self._calls.full(f"{widget.node}/{SET[0]}")
            ),
        }
        self.checks: Mapping[type[EntryWidget], Callable[[Any, Any], Any]] = {
            Input: lambda widget, value: widget.sent_value(widget.check_value(value)),
            SelectInput: self._check_option,
            MapInput: lambda widget, value: self._goal(widget, value).parts,
            Parameter: self._parameters.check_value,
            Step: self._check_step,
            Switch: lambda widget, value: widget.check_value(value),
            RecipeLoad: lambda widget, value: trackers.recipes.select(widget, value, self._check_value),
        }
        require_rows("dispatch", self.dispatches, PressCommand)
        require_rows("check of its entries", self.checks, EntryWidget)

    def _check_option(self, widget: SelectInput, value: Any) -> Any:
        """The chosen option; InputError for one that the robot no longer lists."""
        chosen = widget.sent_value(widget.check_value(value))
        source = widget.options_from
        if source is None:
            return chosen
        if str(chosen) in options_now(widget, source, self._robot, self._monotonic()).texts:
            return chosen
        raise InputError(say("input_option_gone", label=widget.label, given=format_value(chosen)))

    def _goal(self, widget: MapInput, value: Any) -> "Goal | TourGoal":
        """What a place sends; InputError for a value that chooses nothing, PressRefused with the reason
        why nothing is sent to it now. Imported only where a panel has places, for a faster start."""
        from app.cell.permission.goal_places import Goal, TourGoal, goal_of, tour_of

        now = self._monotonic()
        goal: Goal | TourGoal | TextLike = ""
        if isinstance(widget, PlaceInput):
            goal = goal_of(widget, value, self._robot, now)
        elif isinstance(widget, Tour):
            goal = tour_of(widget, value, self._robot, now)
        if not isinstance(goal, Goal | TourGoal):
            raise PressRefused(goal, "interlock")
        return goal

    def _with_goals(
        self, press: Press[PressCommand], handle: PressHandle
    ) -> tuple[TextLike, PressHandle]:
        """The names of the places of a press, "" without one; and its handle, whose final check judges
        the places again: no other pose is sent than the one that was checked first."""
        widgets = self._robot.place_inputs.get(press.widget.id, ())
        if not widgets:
            return "", handle
        goals = {widget.id: self._goal(widget, press.inputs[widget.id]) for widget in widgets}

        def final_check() -> None:
            handle.final_check()
            for widget in widgets:
                if self._goal(widget, press.inputs[widget.id]) != goals[widget.id]:
                    raise PressRefused(say("place_map_changed"), "interlock")

        names = joined([goal.name for goal in goals.values()], "between_names")
        return names, replace(handle, final_check=final_check)

    def _check_step(self, widget: Step, value: Any) -> float:
        """The value of a press, which is one step from the one that the robot reports now: what the
        operator saw has not changed. InputError otherwise."""
        base, _ = reported_value(widget, self._robot, self._monotonic())
        if isinstance(value, int | float) and not isinstance(value, bool) and base is not None:
            for target in (widget.target(base, 1), widget.target(base, -1)):
                if target is not None and equal(float(target), value):
                    return target
        known = "?" if base is None else number(f"{base:g}")
        raise InputError(say("step_value_changed", label=widget.label, value=known))

    def widget(self, widget_id: str) -> PressCommand:
        """The command widget with this id; NotFound for every other id."""
        widget = self._widgets.get(widget_id)
        if not isinstance(widget, PressCommand):
            raise NotFound(f'there is no widget "{widget_id}" that can be pressed')
        return widget

    def parse_form(self, form: Mapping[str, str], language: str = ENGLISH) -> dict[str, Any]:
        """The texts of a form as input values, by input id. Numbers are in the notation of the
        page's language."""
        return {name: self._parse_field(name, text, language) for name, text in form.items()}

    def _parse_field(self, name: str, text: str, language: str) -> Any:
        field = self._widgets.get(name)
        return field.parse_text(text, language) if isinstance(field, EntryWidget) else text

    def with_defaults(self, press: Press[AnyCommand]) -> Press[AnyCommand]:
        """The press, with the panel file's defaults for the inputs left out."""
        names = (name for name in input_ids(press.widget) if name not in press.inputs)
        fields = ((name, self._widgets[name]) for name in names)
        missing = {
            name: field.default_value for name, field in fields if isinstance(field, EntryWidget)
        }
        defaults = {name: value for name, value in missing.items() if value is not None}
        return replace(press, inputs=defaults | {**press.inputs})

    async def send(self, press: Press[PressCommand], handle: PressHandle) -> Outcome:
        """Sends a press and waits for its outcome, which names the places that were sent.

        Does not await before sending. FieldError or InputError for bad input, LinkError if it could not
        be sent, PressRefused from the handle's `final_check` or for a place.
        """
        values = self._checked_inputs(press)
        fields = self._filled(press.widget, values)
        dispatch = find_row(self.dispatches, press.widget)
        names, checked = self._with_goals(press, handle)
        answer = await dispatch.send(press.widget, PreparedPress(values, fields, checked))
        return (
            replace(answer, text=say("place_sent", place=names, said=answer.text)) if names else answer
        )

    def refusal(self, press: Press[PressCommand]) -> TextLike:
        """Why `send` would refuse the press now, else ""; FieldError or InputError for bad input,
        PressRefused for a place."""
        widget, values = press.widget, self._checked_inputs(press)
        dispatch = find_row(self.dispatches, widget)
        return dispatch.refusal(widget, self._filled(widget, values))

    def _filled(self, widget: PressCommand, values: Mapping[str, Any]) -> Any:
        clock = self._robot.clock
        now_ns = clock.stop_ns if is_stop(widget) else clock.now_ns
        return fill_to_send(widget.template, values, now_ns)

    def _checked_inputs(self, press: Press[PressCommand]) -> dict[str, Any]:
        return self.check_inputs(self._input_ids[press.widget.id], press.inputs)

    async def _publish(self, widget: PublishPress, prepared: PreparedPress) -> Outcome:
        fields, handle = prepared.fields, prepared.handle
        if widget.confirm is None:
            return await self._until_flushed(widget, self._put(widget, fields, handle.final_check))
        expected = self._expected(widget.confirm, prepared.values)
        since = self._monotonic()
        answer = self._put(widget, fields, handle.final_check)
        unconfirmed = Unconfirmed(widget, widget.confirm, expected, since, answer.text)
        return await self._confirmations.wait(unconfirmed, handle)

    def _expected(self, confirm: Confirm, values: Mapping[str, Any]) -> Any:
        """The value of the field that confirms a press with these inputs."""
        expected = fill(confirm.equals, values)
        return resolve_at(expected, self._types[confirm.topic], confirm.field, self._interfaces)

    def _check_message(self, widget: PublishPress, fields: dict[str, Any]) -> str:
        self._interfaces.encode(widget.type, fields)
        return ""

    async def _call(self, widget: Call, prepared: PreparedPress) -> Outcome:
        request, _ = self._interfaces.service_types(widget.type)
        payload = self._interfaces.encode(request, prepared.fields)
        return await self._calls.call(widget, payload, prepared.handle)

    def _check_call(self, widget: Call, fields: dict[str, Any]) -> TextLike:
        self._interfaces.encode(self._interfaces.service_types(widget.type)[0], fields)
        return self._calls.full(widget.service)

    async def _switch(self, widget: Switch, prepared: PreparedPress) -> Outcome:
        """Sends the command for the new position, and waits for the robot to report it. PressRefused
        for the position that it reports already."""
        field = field_state(widget.reported, self._robot, self._monotonic())
        on = prepared.fields["value"]
        if field.state == "live" and widget.position(field.value) == ("on" if on else "off"):
            position = widget.on if on else widget.off
            reason = say("switch_reported_already", label=widget.label, position=position)
            raise PressRefused(reason, "interlock")
        since = self._monotonic()
        self._robot.switched_to[widget.id] = on
        command = widget.command(on=on)
        sent = prepared._replace(fields=_sent_by(prepared.fields))
        if isinstance(command, Publish):
            return await self._publish(command, sent)
        answer = await self._call(command, sent)
        if answer.outcome != "succeeded":
            return answer
        confirm = widget.confirm(on=on)
        expected = self._expected(confirm, {})
        reported = self._confirmations.confirmed_since(confirm, expected, since)
        unconfirmed = Unconfirmed(command, confirm, expected, since, answer.text)
        return reported or await self._confirmations.wait(unconfirmed, prepared.handle)

    def _check_switch(self, widget: Switch, fields: dict[str, Any]) -> TextLike:
        command, sent = widget.command(on=fields["value"]), _sent_by(fields)
        if isinstance(command, Publish):
            return self._check_message(command, sent)
        return self._check_call(command, sent)

    async def _load(self, widget: RecipeLoad, prepared: PreparedPress) -> Outcome:
        def send(part: Publish | Call, fields: dict[str, Any], handle: PressHandle) -> Any:
            sent = PreparedPress(prepared.values, fields, handle)
            return self._publish(part, sent) if isinstance(part, Publish) else self._call(part, sent)

        return await self._recipes.load(widget, prepared, send)

    def _check_load(self, widget: RecipeLoad, fields: dict[str, Any]) -> TextLike:
        if widget.parts and isinstance(part := widget.parts[0], Publish):
            return self._check_message(part, self._recipes.message(widget, fields["value"]))
        return self._calls.full(self._recipes.service(widget))

    async def _start(self, widget: Action, prepared: PreparedPress) -> Outcome:
        return await self.actions.start(widget, prepared.fields, prepared.handle)

    async def _set(self, widget: Parameter, prepared: PreparedPress) -> Outcome:
        return await self._parameters.set(widget, prepared.fields["value"], prepared.handle)

    def _put(self, widget: PublishPress, fields: dict[str, Any], final_check: FinalCheck) -> Outcome:
        payload = self._interfaces.encode(widget.type, fields)
        key = self._robot.key(widget.topic)
        has_reader = self._transport.has_reader(key)
        final_check()
        self._transport.put(key, payload)
        sentence = "published" if has_reader else "press_no_subscriber"
        text = say(sentence, topic=widget.topic, time=format_time(time.time()))
        return Outcome("published" if has_reader else "unknown", text)

    async def _until_flushed(self, widget: PublishPress, answer: Outcome) -> Outcome:
        """Waits for the peer's response: until then a published message may still be lost."""
        at = format_time(time.time())
        if answer.outcome != "published" or await self._flushed():
            return answer
        return Outcome(
            "unknown", say(self._robot.traits.sentences.press_unconfirmed, topic=widget.topic, time=at)
        )

    def check_inputs(self, names: Iterable[str], inputs: Mapping[str, Any]) -> dict[str, Any]:
        """The values to be sent of the inputs with these ids, checked; InputError for bad or missing
        ones."""
        for name in inputs.keys() - self._of_others:
            if not isinstance(self._widgets.get(name), EntryWidget):
                raise InputError(f'there is no input "{name:.60}" on this panel')
        values: dict[str, Any] = {}
        for name in names:
            field = self._widgets[name]
            if name not in inputs:
                raise InputError(f'the input "{name}" is missing')
            values[name] = self._check_value(field, inputs[name])
        return values

    def _check_value(self, field: Any, value: Any) -> Any:
        return find_row(self.checks, field)(field, value)


def _sent_by(fields: Mapping[str, Any]) -> dict[str, Any]:
    """The fields that a switch sends for its new position, of its filled-in template."""
    sent: dict[str, Any] = fields["on" if fields["value"] else "off"]
    return sent

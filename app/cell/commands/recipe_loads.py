"""Loads a recipe into the robot, and reads back what the robot has then.

It is loaded if the robot reports every value; a value that it reports otherwise is named. Without a
report nothing is claimed. If a node refuses one of several parameters, those that it has taken are put
back.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable, Collection, Iterable, Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple, Protocol

from app.cell.commands.parameters import ParameterSync
from app.cell.commands.press import PressHandle
from app.cell.commands.services import reply_of
from app.cell.recipes.book import RecipeBook
from app.cell.recipes.recipe import Recipe, changes_text, checked_values, reported_text, value_text
from app.cell.recipes.reported import (
    ReportedFields,
    differing,
    is_same,
    reported_fields,
    unknown_reason,
)
from app.cell.robot.state import RobotState
from app.panel.template import fill_to_send
from app.panel.values import same_value
from app.panel.widgets.families import Input
from app.panel.widgets.parameter import Parameter, Value
from app.panel.widgets.recipe_load import RecipeLoad
from app.panel.widgets.service_action import Call
from app.records.entry import GOOD_OUTCOMES, CommandStatus, Outcome, no_check
from app.ros.messages import Interfaces
from app.system.errors import InputError, LinkError
from app.system.texts import TextLike, ended, joined, say

LOOK_S: Final = 0.05  # between two looks at what the robot reports


class Books(Protocol):
    """Where recipes are found."""

    def book(self, set_id: str) -> RecipeBook | None: ...


class Prepared(Protocol):
    """A press to be sent."""

    @property
    def fields(self) -> dict[str, Any]: ...
    @property
    def handle(self) -> PressHandle: ...


class ChosenRecipe(NamedTuple):
    """The recipe of a press, with its checked values."""

    recipe: Recipe
    values: Mapping[str, Any]


Old = Mapping[str, Value | None]  # by the fields' ids; None: not known

Send = Callable[[Any, dict[str, Any], PressHandle], Awaitable[Outcome]]


class RecipeLoader:
    """Loads recipes into one robot. Used on the event loop only."""

    def __init__(
        self,
        interfaces: Interfaces,
        robot: RobotState,
        parameters: ParameterSync,
        books: Books,
        status_set: Callable[[str], None],
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        """`status_set` is called with the id of a load of which the status has changed."""
        self._interfaces = interfaces
        self._robot = robot
        self._parameters = parameters
        self._books = books
        self._status_set = status_set
        self._monotonic = monotonic

    def select(
        self, widget: RecipeLoad, value: Any, check: Callable[[Input, Any], Any]
    ) -> ChosenRecipe:
        """The recipe that a press names; InputError if it is not what the operator saw, or has a value
        that its input does not take. `check` checks a value as that of a press."""
        recipe_id, version = widget.check_value(value)
        book = self._books.book(widget.id)
        recipe = book.recipe(recipe_id) if book else None
        if recipe is None:
            raise InputError(say("recipe_gone"))
        if recipe.now.number != version:
            raise InputError(say("recipe_changed_before_load", name=recipe.name, by=recipe.now.by))
        values = checked_values(widget.fields, recipe.values)
        for field in widget.fields:
            check(field, values[field.id])
        return ChosenRecipe(recipe, values)

    def message(self, widget: RecipeLoad, chosen: ChosenRecipe) -> dict[str, Any]:
        """The fields of the message or request that loads it."""
        sent = _sent_values(widget, chosen)
        filled: dict[str, Any] = fill_to_send(
            widget.parts[0].templates()[0], sent, self._robot.clock.now_ns
        )
        return filled

    async def load(self, widget: RecipeLoad, prepared: Prepared, send: Send) -> Outcome:
        """Sends the values, waits for the robot to report them, and returns what became of it. `send`
        sends a part of the widget. InputError, and nothing is sent, for a value beyond the range that a
        node has for its parameter."""
        chosen: ChosenRecipe = prepared.fields["value"]
        before, since = self._reported(widget), self._monotonic()
        old = self._values(widget)
        handle = replace(prepared.handle, correct=self._correcting(widget, prepared.handle))
        if widget.parts:
            sending = send(widget.parts[0], self.message(widget, chosen), handle)
        else:
            values = _parameter_values(widget, chosen)
            for parameter, value in values:  # nothing is sent if the node would refuse one by its range
                self._parameters.check_value(parameter, value)
            sending = self._parameters.set_all(widget.id, values, widget.set.timeout_s, handle)
        sent = await self._with_status(widget, sending)
        if sent.outcome == "rejected" and widget.parameters:
            outcome = await self._refused(widget, chosen, old, sent.text)
            self._show(widget, CommandStatus(outcome=outcome.outcome, text=outcome.text))
            return outcome
        if sent.outcome not in GOOD_OUTCOMES:
            return sent
        if widget.set.readback is None and not widget.reported:
            return Outcome(sent.outcome, say("recipe_sent", name=chosen.recipe.name, said=sent.text))
        self._show(widget, CommandStatus(busy=True, text=say("recipe_reading_back")))
        outcome = await self._read_back(widget, chosen, before, since)
        if reply := reply_of(sent.text):
            outcome = replace(outcome, text=joined([ended(outcome.text), reply]))
        self._show(widget, CommandStatus(outcome=outcome.outcome, text=outcome.text))
        return outcome

    async def _with_status(self, widget: RecipeLoad, sending: Awaitable[Outcome]) -> Outcome:
        """What is sent, with the status of the widget."""
        sent = await sending
        self._show(widget, CommandStatus(outcome=sent.outcome, text=sent.text))
        return sent

    async def _read_back(
        self, widget: RecipeLoad, chosen: ChosenRecipe, before: ReportedFields, since: float
    ) -> Outcome:
        nodes = {parameter.node for parameter in widget.reported.values()}
        self._parameters.query(nodes)
        asked, end = self._monotonic(), self._monotonic() + widget.set.confirm_s
        while True:
            reported = self._reported(widget)
            is_read = self._parameters.are_read_since(nodes, asked)
            wrong = differing(widget.fields, chosen.values, reported)
            unknown = unknown_reason(reported)
            if is_read and not wrong and not unknown:
                return Outcome("confirmed", _loaded_text(widget, chosen, before))
            if self._monotonic() >= end:
                break
            await asyncio.sleep(LOOK_S)
        if is_read and wrong:
            return Outcome("rejected", _not_taken_text(widget, chosen, reported, wrong))
        why = unknown or say("recipe_no_new_report")
        return Outcome("unknown", say("recipe_not_read_back", name=chosen.recipe.name, why=why))

    async def _refused(
        self, widget: RecipeLoad, chosen: ChosenRecipe, old: Old, said: TextLike
    ) -> Outcome:
        """What the robot has after its node has refused a value; what it took is put back first."""
        name, sentence = chosen.recipe.name, "recipe_kept"
        now = await self._read_now(widget)
        if changed := _changed(old, now):
            sentence = "recipe_put_back"
            await self._put_back(widget, old, changed)
            now = await self._read_now(widget)
            changed = _changed(old, now)
        if now is None:
            return Outcome("rejected", say("recipe_refused_unread", name=name, said=said))
        if changed:
            sentence, fields = "recipe_partly_loaded", _now_text(widget, old, now, changed)
            return Outcome("rejected", say(sentence, name=name, fields=fields, said=said))
        return Outcome("rejected", say(sentence, name=name, said=said))

    async def _put_back(self, widget: RecipeLoad, old: Old, changed: Iterable[str]) -> None:
        """Sets the old values of these fields, as part of the load that changed them: an interlock that
        has locked since must not leave half of a recipe."""
        known = ((widget.parameters[name], old[name]) for name in changed)
        values = [(parameter, value) for parameter, value in known if value is not None]
        if not values:
            return
        handle = PressHandle("", lambda _: None, no_check)
        try:
            status = f"{widget.id}.back"  # the load's own stays "reading back"
            await self._parameters.set_all(status, values, widget.set.timeout_s, handle)
        except LinkError:
            return  # the values that are read say what the robot has

    async def _read_now(self, widget: RecipeLoad) -> Old | None:
        """The values that the node answers with, None if it does not answer within `confirm_s`."""
        self._show(widget, CommandStatus(busy=True, text=say("recipe_reading_back")))
        nodes = {parameter.node for parameter in widget.parameters.values()}
        self._parameters.query(nodes)
        asked, end = self._monotonic(), self._monotonic() + widget.set.confirm_s
        while not self._parameters.are_read_since(nodes, asked):
            if self._monotonic() >= end:
                return None
            await asyncio.sleep(LOOK_S)
        return self._values(widget)

    def _values(self, widget: RecipeLoad) -> Old:
        values = widget.parameters.items()
        return {name: self._parameters.value(parameter) for name, parameter in values}

    def service(self, widget: RecipeLoad) -> str:
        """The service that a load calls now; "" for a message."""
        part = next(iter(widget.parts), None)
        if isinstance(part, Call):
            return part.service
        return "" if widget.set.node is None else self._parameters.set_service(widget.set.node)

    def _reported(self, widget: RecipeLoad) -> ReportedFields:
        return reported_fields(widget, self._robot, self._monotonic())

    def _correcting(self, widget: RecipeLoad, handle: PressHandle) -> Callable[[Outcome], None]:
        """A late response says that the values were taken or not; what the robot has is shown."""

        def correct(answer: Outcome) -> None:
            self._show(widget, CommandStatus(outcome=answer.outcome, text=answer.text))
            handle.correct(answer)

        return correct

    def _show(self, widget: RecipeLoad, status: CommandStatus) -> None:
        self._robot.command_status[widget.id] = status
        self._status_set(str(widget.id))


def _sent_values(widget: RecipeLoad, chosen: ChosenRecipe) -> dict[str, Any]:
    return {field.id: field.sent_value(chosen.values[field.id]) for field in widget.fields}


def _parameter_values(widget: RecipeLoad, chosen: ChosenRecipe) -> list[tuple[Parameter, Value]]:
    sent = _sent_values(widget, chosen)
    return [
        (parameter, float(sent[name]) if parameter.type == "double" else sent[name])
        for name, parameter in widget.parameters.items()
    ]


def _changed(old: Old, now: Old | None) -> list[str]:
    """The fields that are known to have another value now, and those whose old value is not known."""
    return [name for name, value in old.items() if now and not same_value(value, now[name])]


def _now_text(widget: RecipeLoad, old: Old, now: Old, changed: Collection[str]) -> TextLike:
    """The values of these fields before and now."""
    return changes_text(
        (field.label, _value_text(field, old[field.id]), _value_text(field, now[field.id]))
        for field in widget.fields
        if field.id in changed
    )


def _value_text(field: Input, value: Value | None) -> TextLike:
    return "?" if value is None else reported_text(field, value)


def _loaded_text(widget: RecipeLoad, chosen: ChosenRecipe, before: ReportedFields) -> TextLike:
    """What was loaded, with the values that changed in the robot."""

    def old(field: Input) -> TextLike:
        known = before[field.id]
        return reported_text(field, known.value) if known.is_known else "?"

    changed = [
        (field.label, old(field), value_text(field, chosen.values[field.id]))
        for field in widget.fields
        if not before[field.id].is_known
        or not is_same(field, chosen.values[field.id], before[field.id].value)
    ]
    name = chosen.recipe.name
    if not changed:
        return say("recipe_loaded_same", name=name)
    return say("recipe_loaded", name=name, changes=changes_text(changed))


def _not_taken_text(
    widget: RecipeLoad, chosen: ChosenRecipe, reported: ReportedFields, wrong: list[Input]
) -> TextLike:
    fields = changes_text(
        (
            field.label,
            value_text(field, chosen.values[field.id]),
            reported_text(field, reported[field.id].value),
        )
        for field in wrong
    )
    return say("recipe_not_taken", name=chosen.recipe.name, fields=fields)

"""The command that loads a recipe: a set of values of inputs, sent together and read back."""

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any, ClassVar, Literal

from app.panel.recipe import ParameterKind, RecipeSet
from app.panel.widgets.families import BaseWidget, Command, EntryWidget, Input, SentMessage, TopicSource
from app.panel.widgets.parameter import SET_ATOMICALLY, Parameter
from app.panel.widgets.parts import CompositeCommand
from app.panel.widgets.publish import Publish
from app.panel.widgets.service_action import Call
from app.ros.dialects.dialect import Role
from app.ros.messages import Interfaces
from app.ros.messages.validation import format_value
from app.system.errors import InputError
from app.system.texts import say


class RecipeLoad(EntryWidget, CompositeCommand):
    """Loads a recipe of one set: a press has "<recipe>@<version>" under the set's id. It is on the page
    of recipes, which no table of the panel file describes."""

    kind: Literal["recipe"]
    table: Any
    inputs: tuple[Any, ...]

    required_types: ClassVar[tuple[str, ...]] = (
        *Parameter.required_types,
        f"{SET_ATOMICALLY[1]}_Request",
    )

    @property
    def set(self) -> RecipeSet:
        """Its table in the panel file."""
        table: RecipeSet = self.table
        return table

    @property
    def fields(self) -> tuple[Input, ...]:
        """The inputs whose values are a recipe, in the order of the panel file."""
        return self.inputs

    @property
    def template(self) -> Mapping[str, Any]:
        return {"value": f"{{{self.id}}}"}

    @property
    def answer_s(self) -> float:
        """Within which a press has its receipt. Parameters may be put back, and read again."""
        sending = 0.0 if self.set.topic is not None else self.set.timeout_s
        return (sending + self.set.confirm_s) * (1 if self.parts else 2)

    @cached_property
    def parts(self) -> tuple[Command, ...]:
        """The message or the call by which it loads; nothing for parameters."""
        keys: dict[str, Any] = {"id": self.id, "label": self.label, "type": self.set.type}
        if self.set.topic is not None:
            keys |= {"topic": self.set.topic, "qos": self.set.qos, "message": self.set.message or {}}
            return (Publish.model_construct(None, kind="publish", **keys),)
        if self.set.service is not None:
            keys |= {"service": self.set.service, "request": self.set.request or {}}
            keys |= {"timeout_s": self.set.timeout_s}
            keys |= {"success": self.set.success, "answer": self.set.answer}
            return (Call.model_construct(None, kind="call", **keys),)
        return ()

    @cached_property
    def parameters(self) -> Mapping[str, Parameter]:
        """The parameters that are set, by the fields' ids; empty for another way to load."""
        if self.set.node is None or not self.set.parameters:
            return {}
        types = self.set.parameter_types
        return self._parameters("set", self.set.node, self.set.parameters, types)

    @cached_property
    def reported(self) -> Mapping[str, Parameter]:
        """The parameters that are read back, by the fields' ids; empty if a topic is."""
        readback = self.set.readback
        if readback is None:
            return self.parameters
        if readback.node is None:
            return {}
        return self._parameters("read", readback.node, readback.parameters, readback.parameter_types)

    @property
    def reads(self) -> tuple[Parameter, ...]:
        """All its parameters, each once."""
        return tuple({p.id: p for p in (*self.parameters.values(), *self.reported.values())}.values())

    def _parameters(
        self, use: str, node: str, names: Mapping[str, str], types: Mapping[str, ParameterKind]
    ) -> dict[str, Parameter]:
        def made(field: Input) -> Parameter:
            kind = types.get(field.id) or parameter_kind(field)
            keys: dict[str, Any] = {"label": field.label, "parameter": names[field.id], "type": kind}
            fixed = {"id": f"{self.id}.{use}.{field.id}", "kind": "parameter", "node": node}
            return Parameter.model_construct(None, **fixed, **keys)

        return {field.id: made(field) for field in self.fields if field.id in names}

    def sources(self) -> Iterator[TopicSource]:
        readback = self.set.readback
        if readback is not None and readback.topic is not None and readback.type is not None:
            paths = tuple(dict.fromkeys(readback.fields.values()))
            yield TopicSource(readback.topic, readback.type, readback.qos, paths, "readback")

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        for part in self.parts:
            yield from part.endpoints()
        for parameter in (*self.parameters.values(), *self.reported.values()):
            yield from parameter.endpoints()
        for source in self.sources():
            yield "MP", source.topic

    def sent_messages(self, interfaces: Interfaces) -> Iterator[SentMessage]:
        for part in self.parts:
            yield from part.sent_messages(interfaces)
        if self.parameters:
            names = ", ".join(parameter.parameter for parameter in self.parameters.values())
            yield SentMessage(f"sets {names} of {self.set.node} by {SET_ATOMICALLY[0]}")

    def check_value(self, value: Any) -> tuple[str, int]:
        """The id of the recipe and its version; InputError for anything else."""
        name, at, version = str(value).rpartition("@")
        if isinstance(value, str) and at and name and version.isdecimal() and version.isascii():
            return name, int(version[:9])
        raise InputError(say("recipe_not_named", label=self.label, given=format_value(value)))


def loads_of(tables: Iterable[RecipeSet], widgets: Iterable[BaseWidget]) -> tuple[RecipeLoad, ...]:
    """The commands that load a recipe of each set, with the inputs among `widgets`."""
    inputs = {widget.id: widget for widget in widgets if isinstance(widget, Input)}
    return tuple(_load_of(table, inputs) for table in tables)


def _load_of(table: RecipeSet, inputs: Mapping[str, Input]) -> RecipeLoad:
    keys: dict[str, Any] = {"id": table.id, "label": table.label, "interlocks": table.interlocks}
    if table.confirm_press:
        keys["confirm_press"] = table.confirm_press
    fields = tuple(inputs[name] for name in table.fields if name in inputs)
    return RecipeLoad.model_construct(None, kind="recipe", table=table, inputs=fields, **keys)


def parameter_kind(field: Input) -> ParameterKind:
    """The type of the parameter that takes the values of an input."""
    values = [field.sent_value(example) for example in field.examples()]
    if not values or any(isinstance(value, str) for value in values):
        return "string"
    if all(isinstance(value, bool) for value in values):
        return "bool"
    return "integer" if all(isinstance(value, int) for value in values) else "double"

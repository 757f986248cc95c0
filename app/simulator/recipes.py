"""What the simulated robot reports after a recipe was loaded into it by a message or a call: the values
that were sent. Pure."""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from app.interfaces import Interfaces, Type
from app.panel.constants import resolve_names
from app.panel.model import Panel
from app.panel.widgets.recipe_load import RecipeLoad
from app.panel.widgets.service_action import Call
from app.simulator.parameters import NodeParameters
from app.simulator.presses import learned
from app.simulator.topics import SimulatedTopic

DOUBLE: Final = "double"


class _Load(NamedTuple):
    """A load by the topic or service of this `name`, with its message or request."""

    name: str
    template: Any
    load: RecipeLoad


class LoadedRecipes:
    """The loads of a panel, and what is read back of them: topics, and parameters of nodes."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        topics: Mapping[str, SimulatedTopic],
        nodes: Mapping[str, NodeParameters],
    ) -> None:
        self._topics, self._nodes = topics, nodes
        self._loads = [_load_of(load, interfaces) for load in panel.recipe_loads if load.parts]

    def receive(self, name: str, message: Any, t: float) -> None:
        """A message on a topic, or a request of a service, at `t`."""
        for known in self._loads:
            values = learned(known.template, message) if known.name == name else None
            if values is not None:
                self._report(known.load, values, t)

    def _report(self, load: RecipeLoad, values: Mapping[str, Any], t: float) -> None:
        readback = load.set.readback
        topic = self._topics.get(readback.topic or "") if readback is not None else None
        if readback is not None and topic is not None:
            for name in readback.fields.keys() & values.keys():
                topic.show(readback.fields[name], values[name], t)
        for name in load.reported.keys() & values.keys():
            parameter = load.reported[name]
            value = float(values[name]) if parameter.type == DOUBLE else values[name]
            if parameter.node in self._nodes:
                self._nodes[parameter.node].show(parameter.parameter, value)


def _load_of(load: RecipeLoad, interfaces: Interfaces) -> _Load:
    part, type_name = load.parts[0], load.set.type
    name = load.set.topic or ""
    if isinstance(part, Call):
        name, type_name = part.service, interfaces.service_types(type_name)[0]
    return _Load(name, resolve_names(part.templates()[0], Type(type_name), interfaces), load)

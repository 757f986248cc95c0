"""The robot of any panel: it has everything that the panel listens to, publishes, calls and sets.

Pure: `step` it with the time. The names of the reference system's `system_controller` are played by
`DemoRobot`, as far as the panel has them with the same types, and those of its story by the story.
"""

import logging
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from typing import Any, Final, NamedTuple, TypeVar

from app.panel.constants import resolve_names
from app.panel.demo import NO_ENTRY, DemoEntry
from app.panel.model import Panel
from app.panel.numbers import Range
from app.panel.template import NOW, fill, placeholders
from app.panel.values import same_value
from app.panel.widgets import parameter as parameter_widgets
from app.panel.widgets.map_layers import UPDATE_TYPE
from app.panel.widgets.map_view import TF_TYPE
from app.panel.widgets.recipe_load import RecipeLoad
from app.panel.widgets.robot_options import EACH
from app.panel.widgets.service_action import Call
from app.ros.messages import Interfaces, Type, load_interfaces
from app.ros.messages.definitions import attribute_name
from app.ros.messages.field_path import Key, field_call, field_paths, path_steps
from app.ros.messages.names import Qos
from app.system.errors import DecodeError, FieldError
from app.system.texts import render
from app.tools.simulator.fields import FieldSignal, PanelFields
from app.tools.simulator.kinds import counters_of, needs_of
from app.tools.simulator.known_types import (
    Message,
    Moment,
    plausible,
    put_result,
    static_transforms,
)
from app.tools.simulator.machine import Machine
from app.tools.simulator.needs import Acted, Declared, DisplayedField, Need, Published, Served
from app.tools.simulator.parameters import EVENT_TYPE, EVENTS, NODE, SERVICES, NodeParameters, Parameter
from app.tools.simulator.robot import (
    CHOICES,
    COUNT,
    COUNT_TYPE,
    DONE,
    LISTENS,
    SERVES,
    SPEAKS,
    TEXT,
    ActionServer,
    CountAction,
    DemoRobot,
    SimulatedAction,
    SimulatedTopic,
    echoed,
    feedback_at,
    good_response,
    own_parameters,
)
from app.tools.simulator.stories import play
from app.tools.simulator.values import Fields, Signal, merged, put, span_of

# The topics that a panel listens to, as the simulated robot publishes them: pure.

MOVING_HZ: Final = 5.0  # of numbers
OTHERS_HZ: Final = 1.0
EARLY: Final = 0.95  # of a period: a step may come a little too early
SLOW: Final = frozenset({
    "sensor_msgs/msg/BatteryState",
    "nav_msgs/msg/OccupancyGrid",
    "diagnostic_msgs/msg/DiagnosticArray",
    "rcl_interfaces/msg/Log",
})  # fmt: skip
TIMES_WITHIN_AGE: Final = 3  # messages within `max_age_s`
PRESS_SHOWN_S: Final = 20.0  # how long a press keeps an interlock's field


class PanelTopic:
    """One topic: `step` yields its messages as CDR."""

    def __init__(
        self,
        type_name: str,
        message: Message,
        fields: Iterable[FieldSignal],
        hz: float,
        interfaces: Interfaces,
    ) -> None:
        self.type = type_name
        self._message = message
        self._fields = list(fields)
        self.period_s = 1 / hz
        self._interfaces = interfaces
        self._last: tuple[float, tuple[Any, ...]] | None = None
        self._effects: dict[str, tuple[Any, float | None]] = {}
        self._copied: tuple[bytes, float] | None = None
        self._changed = False

    def step(self, moment: Moment) -> bytes | None:
        """The message that is due, if one is."""
        prompt = tuple(self._value(field, moment) for field in self._fields if field.prompt)
        due = self._last is None or moment.t - self._last[0] >= self.period_s * EARLY
        if not due and not self._changed and self._last is not None and self._last[1] == prompt:
            return None
        self._last, self._changed = (moment.t, prompt), False
        if self._copied is not None and moment.t < self._copied[1]:
            return self._copied[0]
        return self._encoded(moment)

    def show(self, path: str, value: Any, t: float) -> None:
        """A press sets a field: for a while where it is an interlock's, else until the next one."""
        limited = any(f.prompt and f.forces is None and f.path == path for f in self._fields)
        self._effects[path] = value, t + PRESS_SHOWN_S if limited else None
        self._copied, self._changed = None, True

    def copy(self, payload: bytes, t: float) -> None:
        """The topic has what a press published on it, for as long as a field of it would."""
        limited = any(field.prompt for field in self._fields)
        self._copied = payload, t + PRESS_SHOWN_S if limited else math.inf
        self._changed = True

    def signals(self) -> Iterator[tuple[str, Signal]]:
        """Path → value of each field, as presses have set it."""
        for field in self._fields:
            yield field.path, partial(self._value_at, field)

    def _value(self, field: FieldSignal, moment: Moment) -> Any:
        return self._value_at(field, moment.t)

    def _value_at(self, field: FieldSignal, t: float) -> Any:
        value, until = self._effects.get(field.path, (None, -1.0))
        is_set = until is None or t < until
        return value if is_set and not (field.forces and field.forces(t)) else field.signal(t)

    def _encoded(self, moment: Moment) -> bytes:
        fields = self._message(moment)
        for field in self._fields:
            self._put(fields, field.path, self._value(field, moment), moment)
        own = {field.path for field in self._fields}
        for path, (value, _) in self._effects.items():
            if path not in own:
                self._put(fields, path, value, moment)
        return self._interfaces.encode(self.type, fields)

    def _put(self, fields: Fields, path: str, value: Any, moment: Moment) -> None:
        structures, call = self._interfaces.structures, field_call(path)
        if call is None:
            put(fields, self.type, path, value, structures)
        else:
            put_result(fields, self.type, call, value, structures, moment)


def simulated_topics(
    panel: Panel,
    shown: Iterable[DisplayedField],
    interfaces: Interfaces,
    skipped: Mapping[str, str],
    phase: float,
    machine: Machine,
) -> dict[str, PanelTopic]:
    """Each topic that the panel listens to, but those `skipped` (topic → type), which are simulated
    elsewhere. `phase` sets several robots apart; `machine` reads their values."""
    by_topic: dict[str, list[DisplayedField]] = {}
    for shown_field in shown:
        by_topic.setdefault(shown_field.topic, []).append(shown_field)
    fields = PanelFields(panel, interfaces, phase, machine)
    topics = {}
    for topic, type_name in panel.listened().items():
        if topic in skipped or type_name == UPDATE_TYPE or panel.demo.get(topic, NO_ENTRY).silent:
            continue  # a robot publishes whole maps, and updates only if one of its nodes does so
        topics[topic] = _topic(fields, topic, type_name, by_topic.get(topic, []))
        for path, value in topics[topic].signals():
            machine.read((topic, path), value)
    return topics


def _topic(
    fields: PanelFields, topic: str, type_name: str, shown: Sequence[DisplayedField]
) -> PanelTopic:
    message = _message(fields, topic, type_name)
    made = fields.signals(topic, type_name, shown, message)
    hz = _hz(fields, topic, type_name, made, shown)
    return PanelTopic(type_name, message, made, hz, fields.interfaces)


def _message(fields: PanelFields, topic: str, type_name: str) -> Message:
    """Messages with the names that the panel looks for, and what `[demo]` fixes."""
    paths = [path for named in fields.paths.get(topic, ()) for path in field_paths(named)]
    keys = [step for path in paths for step in path_steps(path)]
    wanted = [str(step.value) for step in keys if isinstance(step, Key) and step.path == "name"]
    wanted += fields.levels_below.get(topic, ())
    is_static = type_name == TF_TYPE and topic.endswith("/tf_static")
    base = (
        static_transforms
        if is_static
        else plausible(type_name, fields.interfaces, dict.fromkeys(wanted))
    )
    over = fields.entry(topic).message
    return (lambda moment: merged(base(moment), over)) if over else base


def _hz(
    fields: PanelFields,
    topic: str,
    type_name: str,
    made: Sequence[FieldSignal],
    shown: Sequence[DisplayedField],
) -> float:
    """Messages per second: so many that no value gets too old."""
    rate_hz = fields.entry(topic).hz
    if rate_hz is not None:
        return rate_hz
    still = made and not any(signal.moving for signal in made)
    hz = OTHERS_HZ if still or type_name in SLOW else MOVING_HZ
    locks = (
        interlock.max_age_s for interlock in fields.panel.named_conditions if interlock.topic == topic
    )
    ages = [
        age for age in (*locks, *(shown_field.max_age_s for shown_field in shown)) if age is not None
    ]
    return max([hz, *(TIMES_WITHIN_AGE / age for age in ages)])


# The parameters that a panel names, with plausible values, as their nodes declare them: pure.

# The numbers of rcl_interfaces/msg/ParameterType.
TYPES: Final[Mapping[str, int]] = {
    "bool": 1,
    "integer": 2,
    "double": 3,
    "string": 4,
    "bool[]": 6,
    "integer[]": 7,
    "double[]": 8,
    "string[]": 9,
}
LENGTH: Final = 3  # of a list without options


def declared_by(
    panels: Iterable[parameter_widgets.Parameter], demo: Mapping[str, DemoEntry]
) -> dict[str, dict[str, Parameter]]:
    """Node → name → parameter. Of several widgets for one parameter the limits are those that they
    all have."""
    parameters: dict[str, dict[str, list[parameter_widgets.Parameter]]] = {}
    for panel in panels:
        parameters.setdefault(panel.node, {}).setdefault(panel.parameter, []).append(panel)
    return {
        node: {
            name: _declared(several, demo.get(node, NO_ENTRY).parameters.get(name))
            for name, several in names.items()
        }
        for node, names in parameters.items()
    }


def _declared(several: list[parameter_widgets.Parameter], entry: Any) -> Parameter:
    first = several[0]
    alike = len({(limits.min, limits.max, limits.step) for limits in several}) == 1
    limits = _limits(first) if alike else None
    options = tuple(option.value for option in first.options) if len(several) == 1 else ()
    value = entry if entry is not None else _value(first, limits, options)
    if first.element_type == "double":
        value = [float(element) for element in value] if first.is_list else float(value)
    return Parameter(TYPES[first.type], value, limits=limits, options=options)


def _limits(widget: parameter_widgets.Parameter) -> Range | None:
    if not widget.has_numbers or widget.min is widget.max is None:
        return None
    limits = (widget.min, widget.max, widget.step)
    if widget.element_type == "integer":
        return Range(*(None if limit is None else int(limit) for limit in limits))
    return Range(*limits)


def _value(widget: parameter_widgets.Parameter, limits: Range | None, options: tuple[Any, ...]) -> Any:
    if options:
        return options[0]
    if widget.type == "string[]":
        return list(CHOICES)
    value = _single(widget, limits)
    return [value] * LENGTH if widget.is_list else value


def _single(widget: parameter_widgets.Parameter, limits: Range | None) -> Any:
    match widget.element_type:
        case "bool":
            return False
        case "string":
            return "demo"
    span = span_of(render(widget.unit), widget.parameter, render(widget.label))
    middle = (span.low + span.high) / 2
    if limits is not None:
        middle = _inside(limits, middle)
    return round(middle) if widget.element_type == "integer" else round(middle, 3)


def _inside(limits: Range, guess: float) -> float:
    """A value on a step of the limits, near their middle."""
    low, high, step = limits.low, limits.high, limits.step
    if low is None or high is None:
        near = guess if limits.contains(guess) else low if low is not None else high
        return guess if near is None else near
    middle = (low + high) / 2
    return low + round((middle - low) / step) * step if step else middle


# What a press shows: a message that fits a widget's template gives the values of its inputs, and with
# them the value of the field that confirms it. Pure.

CLOSE: Final = 1e-6  # a float32 comes back as the nearest one
PLACEHOLDER: Final = re.compile(r"\{\{|\}\}|\{([\w.]+)\}")


class Effect(NamedTuple):
    """A field that has a value by a press."""

    topic: str
    field: str
    value: Any


def effects(message: Any, publications: Iterable[Published]) -> list[Effect]:
    """The effects of a decoded message, by the widgets that may have sent it."""
    made = []
    for publication in publications:
        inputs: dict[str, Any] = {}
        if (
            publication.confirm is None
            or publication.template is None
            or not _fits(publication.template, message, inputs)
        ):
            continue
        needed = {name for _, name in placeholders(publication.confirm.equals)}
        if needed <= inputs.keys():
            value = fill(publication.confirm.equals, inputs)
            made.append(Effect(publication.confirm.topic, publication.confirm.field, value))
    return made


def learned(template: Any, message: Any) -> dict[str, Any] | None:
    """The values of the inputs of a template from a decoded message; None if it was not made from
    it."""
    inputs: dict[str, Any] = {}
    return inputs if _fits(template, message, inputs) else None


def _fits(template: Any, value: Any, inputs: dict[str, Any]) -> bool:
    """Whether a value may have been made from a template; adds the values of its inputs."""
    if isinstance(template, Mapping):
        return all(
            _fits(part, getattr(value, attribute_name(name), None), inputs)
            for name, part in template.items()
        )
    if isinstance(template, list | tuple):
        items = list(value) if value is not None else []
        return len(items) == len(template) and all(
            _fits(part, item, inputs) for part, item in zip(template, items, strict=True)
        )
    if isinstance(template, str):
        return _text_fits(template, value, inputs)
    return _equal(template, value)


def _text_fits(template: str, value: Any, inputs: dict[str, Any]) -> bool:
    names = [name for _, name in placeholders(template)]
    if template == f"{{{NOW}}}":
        return True
    if names and template == f"{{{names[0]}}}":
        return _learned(names[0], value, inputs)
    if names and template == f"-{{{names[0]}}}" and not isinstance(value, str):
        return _learned(names[0], -value, inputs)
    if not names:
        return bool(fill(template, {}) == value)
    match = re.fullmatch(_pattern(template), value, re.DOTALL) if isinstance(value, str) else None
    return match is not None and all(
        _learned(name, text, inputs) for name, text in zip(names, match.groups(), strict=True)
    )


def _pattern(template: str) -> str:
    """A regular expression of the texts that a template makes."""
    parts, at = [], 0
    for match in PLACEHOLDER.finditer(template):
        parts.append(re.escape(template[at : match.start()]))
        parts.append("(.*?)" if match[1] else re.escape(match[0][0]))
        at = match.end()
    return "".join([*parts, re.escape(template[at:])])


def _learned(name: str, value: Any, inputs: dict[str, Any]) -> bool:
    """Adds an input's value, unless it has another one elsewhere in the message."""
    return _equal(inputs.setdefault(name, value), value)


def _equal(value: Any, other: Any) -> bool:
    numbers = isinstance(value, int | float) and isinstance(other, float)
    if numbers and not isinstance(value, bool):
        return math.isclose(value, other, rel_tol=CLOSE)
    return same_value(value, other)


# What the simulated robot reports after a recipe was loaded into it by a message or a call: the values
# that were sent. Pure.

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
        topics: Mapping[str, PanelTopic],
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


log = logging.getLogger("kiosk.simulator")

STEP_S: Final = 0.1
ENABLED: Final = "/operation_enabled"
LATCHED: Final = Qos(transient_local=True, depth=1)
APART: Final = 0.37  # of a period, between one robot's numbers and the next one's
OF_EVENTS: Final = Qos(depth=1000)  # rmw_qos_profile_parameter_events

Response = Callable[[Moment], Mapping[str, Any]]
AnyNeed = TypeVar("AnyNeed", bound=Need)


class PanelRobot:
    """One robot of a panel; see `SimulatedRobot`. `number` is its place among several."""

    def __init__(self, panel: Panel, number: int = 0) -> None:
        self._interfaces = load_interfaces(panel.distro, panel.interfaces)
        self._panel = panel
        self._demo = DemoRobot()
        needs = [need for widget in panel.widgets() for need in needs_of(widget, self._interfaces)]
        self._story = play(panel, number, self._interfaces)
        of_story = {} if self._story is None else self._story.names.publishes
        self._own = {
            name: kind for name, kind in _reference_topics(panel).items() if name not in of_story
        }
        skipped = {**self._own, **of_story, EVENTS: EVENT_TYPE}
        shown = [*_needs_of(needs, DisplayedField), *counters_of(panel.oee)]
        machine = Machine(panel)
        for topic in self._own.keys() & {ENABLED}:
            machine.read((topic, "data"), lambda _: self._demo.permits)
        self._topics = simulated_topics(
            panel, shown, self._interfaces, skipped, APART * number, machine
        )
        self._published = _by_topic(_needs_of(needs, Published))
        self._nodes = self._declared(_needs_of(needs, Declared))
        self._recipes = LoadedRecipes(panel, self._interfaces, self._topics, self._nodes)
        self._responses = self._served(_needs_of(needs, Served))
        self._simulated = self._acted(_needs_of(needs, Acted))
        self._effects: list[tuple[str, Mapping[str, Any]]] = []  # on topics of `DemoRobot`
        self._moment = Moment(0.0, 0)
        self._began: float | None = None

    # What it has.

    @cached_property
    def step_s(self) -> float:
        return min([STEP_S, *(topic.period_s for topic in self._topics.values())])

    @cached_property
    def publishes(self) -> Mapping[str, SimulatedTopic]:
        own = {
            topic: SimulatedTopic(name, LATCHED, self._hash(name)) for topic, name in self._own.items()
        }
        simulated = {
            topic: SimulatedTopic(source.type, self._panel.qos(topic).wire_qos, self._hash(source.type))
            for topic, source in self._topics.items()
        }
        events = SimulatedTopic(EVENT_TYPE, OF_EVENTS, self._hash(EVENT_TYPE))
        return {**own, **dict(self._story_topics()), **simulated, EVENTS: events}

    def _story_topics(self) -> Iterator[tuple[str, SimulatedTopic]]:
        """The topics of the story. Those with states keep the last one for late subscribers."""
        if self._story is None:
            return
        for topic, kind in self._story.names.publishes.items():
            qos = LATCHED if self._story.is_latched(topic) else self._panel.qos(topic).wire_qos
            yield topic, SimulatedTopic(kind, qos, self._hash(kind))

    @cached_property
    def subscribes(self) -> Mapping[str, SimulatedTopic]:
        simulated = {
            topic: SimulatedTopic(name, Qos(), self._hash(name)) for topic, name in LISTENS.items()
        }
        for topic, several in self._published.items():
            published = several[0]
            simulated[topic] = SimulatedTopic(
                published.type, published.qos.wire_qos, self._hash(published.type)
            )
        return {
            topic: simulated_topic for topic, simulated_topic in simulated.items() if self._has(topic)
        }

    @cached_property
    def services(self) -> Mapping[str, str]:
        of_panel = {name: kind for name, (kind, _) in self._responses.items()}
        of_nodes = {f"{node}/{name}": kind for node in self._nodes for name, kind in SERVICES.items()}
        return {
            name: kind for name, kind in {**SERVES, **of_panel, **of_nodes}.items() if self._has(name)
        }

    @cached_property
    def actions(self) -> Mapping[str, ActionServer]:
        own = {COUNT: CountAction(COUNT_TYPE, self._demo)} if self._has(COUNT) else {}
        of_story = self._story.actions if self._story else {}
        return {**own, **self._simulated, **of_story}

    # What it receives and publishes.

    def receive(self, topic: str, payload: bytes) -> None:
        """A press: it is echoed where the panel shows it, and has its effect."""
        type_name = self.subscribes[topic].type
        try:
            message = self._interfaces.decode(type_name, payload)
        except DecodeError:
            return  # as a ROS node that can't read a message: nothing happens
        if self._story and topic in self._story.names.subscribes:
            self._story.receive(topic, message)
        echoes = topic in LISTENS and type_name == TEXT
        if echoes:
            self._demo.hear(topic, message.data)
        if topic in self._topics:
            self._topics[topic].copy(payload, self._moment.t)
        self._recipes.receive(topic, message, self._moment.t)
        for effect in effects(message, self._published.get(topic, ())):
            if effect.topic in self._topics:
                self._topics[effect.topic].show(effect.field, effect.value, self._moment.t)
            elif effect.topic in self._own and not (
                echoes and effect.value == echoed(topic, message.data)
            ):
                self._effects.append((effect.topic, {effect.field: effect.value}))

    def serve(self, service: str, payload: bytes) -> bytes | None:
        request_type, response_type = self._interfaces.service_types(self.services[service])
        try:
            request = self._interfaces.decode(request_type, payload)
        except DecodeError:
            return None
        self._recipes.receive(service, request, self._moment.t)
        return self._interfaces.encode(response_type, self._answer(service, request))

    def _answer(self, service: str, request: Any) -> Mapping[str, Any]:
        node, _, _ = service.rpartition("/")
        if self._story and service in self._story.names.services:
            return self._story.serve(service, request)
        if service in self._responses:
            return self._responses[service][1](self._moment)
        if node in self._nodes:
            return self._nodes[node].serve(service, request)
        return self._demo.serve(service, request)

    def step(self, moment: Moment) -> Iterator[tuple[str, bytes]]:
        if self._began is None:
            self._began = moment.t
        self._moment = Moment(moment.t - self._began, moment.wall_ns)
        for action in self._simulated.values():
            action.step(self._moment)
        of_presses, self._effects = self._effects, []
        for topic, fields in (*self._demo.step(moment.t), *of_presses):
            if topic in self._own:
                yield topic, self._interfaces.encode(self._own[topic], fields)
        yield from self._tell()
        for node in self._nodes.values():
            for event in node.news():
                yield EVENTS, self._interfaces.encode(EVENT_TYPE, event)
        for name, simulated in list(self._topics.items()):
            try:
                payload = simulated.step(self._moment)
            except FieldError as error:  # that one is silent, the others go on
                log.error("%s is not simulated any more: %s", name, error)
                del self._topics[name]
                continue
            if payload is not None:
                yield name, payload

    def _tell(self) -> Iterator[tuple[str, bytes]]:
        """The messages of the story."""
        if self._story is None:
            return
        self._story.configure(self._nodes)
        for topic, fields in self._story.step(self._moment):
            yield topic, self._interfaces.encode(self._story.names.publishes[topic], fields)

    # How it is made.

    def _has(self, name: str) -> bool:
        return not self._panel.demo.get(name, NO_ENTRY).silent

    def _hash(self, type_name: str) -> str:
        return self._interfaces.type_hash(type_name)

    def _declared(self, declared: Iterable[Declared]) -> dict[str, NodeParameters]:
        """The nodes. The `system_controller` keeps its own parameters, where the types are equal."""
        by_node = declared_by((parameter.widget for parameter in declared), self._panel.demo)
        in_table = self._panel.demo.get(NODE, NO_ENTRY).parameters
        own = {
            name: parameter
            for name, parameter in own_parameters().items()
            if name not in in_table
            and by_node.get(NODE, {}).get(name, parameter).type == parameter.type
        }
        by_node[NODE] = {**by_node.get(NODE, {}), **own}
        return {
            node: NodeParameters(node, parameters)
            for node, parameters in by_node.items()
            if self._has(node)
        }

    def _served(self, served: Iterable[Served]) -> dict[str, tuple[str, Response]]:
        """Service → (type, responses), without those of the `system_controller`."""
        responses: dict[str, tuple[str, Response]] = {}
        for need in served:
            entry = self._panel.demo.get(need.service, NO_ENTRY)
            if SERVES.get(need.service) == need.type and not entry.response and self._permits_known():
                continue
            response = self._interfaces.service_types(need.type)[1]
            paths = {need.success or "": True, need.message or "": DONE, **_choices(need.listed or "")}
            paths.pop("", None)
            made = good_response(response, self._interfaces, entry.response, paths)
            responses[need.service] = need.type, made
        return responses

    def _permits_known(self) -> bool:
        """Whether the panel shows why the `system_controller` refuses a reset."""
        return ENABLED in self._own and ENABLED in self._panel.subscriptions()

    def _acted(self, acted: Iterable[Acted]) -> dict[str, SimulatedAction]:
        """Action → its goals, without the count of the `system_controller`."""
        several: dict[str, list[Acted]] = {}
        for need in acted:
            several.setdefault(need.action, []).append(need)
        actions = {}
        for name, widgets in several.items():
            entry = self._panel.demo.get(name, NO_ENTRY)
            own = name == COUNT and widgets[0].type == COUNT_TYPE
            if self._story and name in self._story.actions:
                continue
            if (own and not {"result", "duration_s"} & entry.model_fields_set) or entry.silent:
                continue
            types = self._interfaces.action_types(widgets[0].type)
            progress = {
                widget.progress: widget.ends for widget in widgets if widget.progress is not None
            }
            actions[name] = SimulatedAction(
                widgets[0].type,
                feedback_at(types.feedback, self._interfaces, progress),
                good_response(types.result, self._interfaces, entry.result, {}),
                entry.duration_s,
            )
        return actions


def _reference_topics(panel: Panel) -> dict[str, str]:
    """The topics that the `system_controller` publishes, unless the panel has others of these names."""
    listened = panel.subscriptions()
    return {
        topic: name
        for topic, name in SPEAKS.items()
        if listened.get(topic, name) == name and topic not in panel.demo
    }


def _by_topic(published: Iterable[Published]) -> dict[str, list[Published]]:
    published_by_topic: dict[str, list[Published]] = {}
    for need in published:
        published_by_topic.setdefault(need.topic, []).append(need)
    return published_by_topic


def _needs_of(needs: Iterable[Need], kind: type[AnyNeed]) -> list[AnyNeed]:
    return [need for need in needs if isinstance(need, kind)]


def _choices(listed: str) -> dict[str, Any]:
    """What a service lists, by its path in the response: texts, or messages with a text each."""
    path, each, item = listed.partition(EACH)
    return {path: [{item: text} for text in CHOICES] if each else CHOICES}

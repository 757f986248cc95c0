"""The robot of any panel: it has everything that the panel listens to, publishes, calls and sets.

Pure: `step` it with the time. The names of the reference system's `system_controller` are played by
`DemoRobot`, as far as the panel has them with the same types, and those of its story by the story.
"""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any, Final, TypeVar

from app.errors import DecodeError, FieldError
from app.interfaces import load_interfaces
from app.interfaces.names import Qos
from app.panel.demo import NO_ENTRY
from app.panel.model import Panel
from app.panel.used_names import played_names
from app.simulator.answers import CHOICES, DONE, feedback_at, good_response
from app.simulator.declared import declared_by
from app.simulator.goals import ActionServer, CountAction, SimulatedAction
from app.simulator.kinds import needs_of
from app.simulator.needs import Acted, Declared, Need, Published, Served, Shown
from app.simulator.palletizing.cell import SPEED_MM_S
from app.simulator.palletizing.played import PlayedPalletizing
from app.simulator.parameters import EVENT_TYPE, EVENTS, NODE, SERVICES, NodeParameters
from app.simulator.presses import effects
from app.simulator.recipes import LoadedRecipes
from app.simulator.robot import (
    COUNT,
    COUNT_TYPE,
    LISTENS,
    SERVES,
    SPEAKS,
    TEXT,
    DemoRobot,
    echoed,
    own_parameters,
)
from app.simulator.simulated import SimulatedTopic
from app.simulator.topics import simulated_topics
from app.simulator.values.known_types import Moment

log = logging.getLogger("kiosk.simulator")

STEP_S: Final = 0.1
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
        names = played_names(panel)
        self._story = None if names is None else PlayedPalletizing(names, number)
        of_story = {} if names is None else names.publishes
        self._own = {
            name: kind for name, kind in _reference_topics(panel).items() if name not in of_story
        }
        skipped = {**self._own, **of_story, EVENTS: EVENT_TYPE}
        shown = _needs_of(needs, Shown)
        self._topics = simulated_topics(panel, shown, self._interfaces, skipped, APART * number)
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
        """The messages of the story. Its belt has the speed that the parameter of the node sets."""
        if self._story is None:
            return
        if NODE in self._nodes:
            self._story.cell.speed_mm_s = self._nodes[NODE].value("speed", SPEED_MM_S)
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
            paths = {need.success or "": True, need.message or "": DONE, need.listed or "": CHOICES}
            paths.pop("", None)
            made = good_response(response, self._interfaces, entry.response, paths)
            responses[need.service] = need.type, made
        return responses

    def _permits_known(self) -> bool:
        """Whether the panel shows why the `system_controller` refuses a reset."""
        return "/operation_enabled" in self._own and "/operation_enabled" in self._panel.subscriptions()

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

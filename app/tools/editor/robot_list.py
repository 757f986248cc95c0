"""What is on the robot, for the list beside the page that is edited: topics with their newest values,
services, actions and parameters, and where the panel uses each. It only reads from the robot."""

import asyncio
import logging
from collections import defaultdict, deque
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice, pairwise
from typing import Any, Final, Literal, TypeVar, get_args

from app.panel import Panel
from app.panel.demo import STORIES
from app.panel.widgets.families import BaseWidget, Command, DisplayWidget
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.parts import parts_of
from app.ros.graph.model import (
    EndpointQos,
    GraphSnapshot,
    Node,
    RobotGraph,
    Server,
    SurveyedTopic,
    TopicEndpoint,
)
from app.ros.graph.node_services import LIST, NodeParameter, NodeServices
from app.ros.messages import Interfaces, Type, load_interfaces
from app.ros.messages.definitions import attribute_name
from app.ros.messages.validation import format_value
from app.system.errors import DecodeError, InterfaceError, KioskError
from app.system.texts import TextLike, say
from app.tools.editor.suggestions import Item, Suggestions, suggestions_for
from app.tools.robot.link import Place, opened
from app.tools.robot.topic_reader import endpoint_for
from app.tools.scaffold.draft import SERVICES_OF_EVERY_NODE, public_topics
from app.tools.scaffold.parts import shown_fields
from app.tools.scaffold.widgets import DIAGNOSTICS, JOINTS, PICTURES

log = logging.getLogger("kiosk.editor")

READ_EVERY_S: Final = 2.0  # the graph
WATCHED_S: Final = 6.0  # after the last look of a browser
AGAIN_S: Final = 2.0  # after a link that was lost
PARAMETERS_EVERY_S: Final = 30.0
MOST_LISTENED: Final = 1_000
LARGEST: Final = 20_000  # bytes of a message whose value is shown
ARRIVALS: Final = 4  # of a topic, by which its period is known
MOST_FIELDS: Final = 60  # of a message whose values a form shows
MAX_TEXT: Final = 24  # characters of a value
# Types whose messages are large or have no value that a line can show.
NOT_LISTENED: Final = frozenset(
    (
        *PICTURES,
        *("sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/PointCloud", "sensor_msgs/msg/LaserScan"),
        *("nav_msgs/msg/OccupancyGrid", "map_msgs/msg/OccupancyGridUpdate", "nav_msgs/msg/Path"),
        *("tf2_msgs/msg/TFMessage", "visualization_msgs/msg/MarkerArray"),
    )
)
Named = TypeVar("Named", SurveyedTopic, Server)
Section = Literal["topics", "services", "actions", "parameters"]
SECTIONS: Final[Sequence[Section]] = get_args(Section)
# The key by which a command names what it acts on.
NAME_KEYS: Final[Mapping[Section, str]] = {
    "topics": "topic",
    "services": "service",
    "actions": "action",
}


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the list. `key` is its name in the list's section; `value` is what it is now, "" if
    that is not known. `used` says where the panel has it; empty: nowhere."""

    key: str
    name: str
    type: str
    nodes: str
    value: TextLike
    used: Sequence[TextLike]

    def matches(self, words: str) -> bool:
        """Whether each of the words is in its name, its type or its nodes."""
        text = f"{self.name} {self.type} {self.nodes}".lower()
        return all(word in text for word in words.lower().split())


@dataclass(slots=True)
class Latest:
    """The newest message of a topic, as bytes, and when the last ones arrived."""

    payload: bytes = b""
    arrivals: list[float] = field(default_factory=list)

    @property
    def period_s(self) -> float | None:
        """The longest time between the last messages; None of a topic with few of them."""
        if len(self.arrivals) < ARRIVALS:
            return None
        return max(after - before for before, after in pairwise(self.arrivals))


# What is recorded of the topics of alarms.

Sample = tuple[float, float]  # seconds, value
MOST_RECORDED: Final = 50  # topics
MOST_SAMPLES: Final = 6_000
EVERY_S: Final = 0.1
LARGEST_KEPT: Final = 4_096  # bytes of a message
MOST_BYTES: Final = 1_000_000


@dataclass(slots=True)
class Recording:
    """The newest messages of a topic, at most ten a second; `at` in monotonic seconds."""

    type: str
    payloads: deque[tuple[float, bytes]] = field(default_factory=lambda: deque(maxlen=MOST_SAMPLES))
    total: int = 0
    size: int = 0
    decoded: dict[str, tuple[int, deque[Sample]]] = field(default_factory=dict)

    def add(self, at: float, payload: bytes) -> None:
        if len(payload) > LARGEST_KEPT or (self.payloads and at - self.payloads[-1][0] < EVERY_S):
            return
        if len(self.payloads) == MOST_SAMPLES:
            self.size -= len(self.payloads[0][1])
        self.payloads.append((at, payload))
        self.total, self.size = self.total + 1, self.size + len(payload)
        while self.size > MOST_BYTES:
            self.size -= len(self.payloads.popleft()[1])

    def values(self, path: str, interfaces: Interfaces) -> Sequence[Sample]:
        """The values of a field; messages without a number there are left out."""
        total, values = self.decoded.get(path, (0, deque[Sample](maxlen=MOST_SAMPLES)))
        if total != self.total:
            new = min(self.total - total, len(self.payloads))
            values.extend(_values(list(self.payloads)[-new:], self.type, path, interfaces))
            self.decoded = {path: (self.total, values)}
        return values


def _values(
    payloads: Sequence[tuple[float, bytes]], type_name: str, path: str, interfaces: Interfaces
) -> Iterator[Sample]:
    try:
        reader = interfaces.field_reader(type_name, (path,))
    except InterfaceError:
        return
    for at, payload in payloads:
        try:
            value = reader.read(payload).get(path)
        except DecodeError:
            continue
        if isinstance(value, int | float) and not isinstance(value, bool):
            yield at, float(value)


class RobotList:
    """Reads the robot while a browser shows the list. Used on the event loop."""

    def __init__(self, place: Callable[[], Awaitable[Place | None]]) -> None:
        """`place`: where the robot is now; None while there is none."""
        self._place = place
        self._looked = -WATCHED_S
        self._wake = asyncio.Event()
        self.fault: str = ""  # why there is no robot
        self.version = 0  # of the rows: another number where there are others
        self._panel: Panel | None = None  # that was asked for last, and what it uses
        self._used: object = None
        self._names: object = None
        self.robot: RobotGraph | None = None
        self._latest: dict[str, Latest] = {}
        self._recordings: dict[str, Recording] = {}
        self._parameters: dict[str, NodeParameter] = {}

    def look(self) -> None:
        """A browser shows the list now."""
        self._count()
        self._looked = asyncio.get_running_loop().time()
        self._wake.set()

    @property
    def _is_watched(self) -> bool:
        return asyncio.get_running_loop().time() - self._looked < WATCHED_S

    async def run(self) -> None:
        """Until it is cancelled."""
        while True:
            self._wake.clear()
            if not self._is_watched:
                await self._wake.wait()
            try:
                place = await self._place()
                if place is not None:
                    await self._read(place)
            except KioskError as error:
                self.fault, self.robot = str(error), None
            with suppress(TimeoutError):
                async with asyncio.timeout(AGAIN_S):
                    await self._wake.wait()

    async def _read(self, place: Place) -> None:
        """Reads a place: its graph and topics, until no browser shows the list or the place changes."""
        interfaces = load_interfaces(place.distro, place.interfaces)
        self._latest.clear()  # of an earlier link: values of then are not those of now
        async with opened(place) as (observer, graph):
            services: asyncio.Task[None] | None = None
            topics: asyncio.Task[None] | None = None
            listened: frozenset[str] = frozenset()
            read_at = -PARAMETERS_EVERY_S
            try:
                while self._is_watched and await self._place() == place:
                    self.robot, self.fault = fullest(graph), ""
                    now = asyncio.get_running_loop().time()
                    if (services is None or services.done()) and now - read_at > PARAMETERS_EVERY_S:
                        read_at = now
                        nodes = NodeServices(self.robot, interfaces, observer)
                        services = asyncio.create_task(self._read_parameters(nodes, self.robot))
                    wanted = frozenset(topic.key for topic in self._listened(interfaces))
                    if wanted != listened or topics is None or topics.done():
                        if topics is not None:
                            topics.cancel()
                        listened = wanted
                        topics = asyncio.create_task(self._listen(place, interfaces))
                    await asyncio.sleep(READ_EVERY_S)
                    graph = await observer.observe()
            finally:
                for task in filter(None, (services, topics)):
                    task.cancel()
                await asyncio.gather(*filter(None, (services, topics)), return_exceptions=True)

    def _listened(self, interfaces: Interfaces) -> list[SurveyedTopic]:
        topics = self.robot.topics if self.robot else ()
        shown = (
            topic
            for topic in public_topics(topics)
            if topic.publishers
            and topic.type in interfaces.structures
            and topic.type not in NOT_LISTENED
        )
        return list(shown)[:MOST_LISTENED]

    async def _listen(self, place: Place, interfaces: Interfaces) -> None:
        """By a session of its own: its subscriptions are declared once."""
        wanted = {topic.key: topic for topic in self._listened(interfaces)}
        if not wanted:
            return
        async with opened(place) as (observer, _):
            own = [endpoint_for(topic, topic.type) for topic in wanted.values()]
            async for key, sample in observer.listen(own):
                latest = self._latest.setdefault(wanted[key].key, Latest())
                payload = bytes(sample.payload)
                latest.payload = payload if len(payload) <= LARGEST else b""
                if key in self._recordings:
                    self._recordings[key].add(sample.at, payload)
                if not sample.cached:
                    latest.arrivals = [*latest.arrivals[1 - ARRIVALS :], sample.at]

    async def _read_parameters(self, services: NodeServices, robot: RobotGraph) -> None:
        own = {bridge.node for bridge in robot.bridges}
        read: dict[str, NodeParameter] = {}
        for node in nodes_of(robot):
            if node.name in own:
                continue
            with suppress(KioskError):
                for parameter in await services.parameters(node) or ():
                    read[f"{parameter.node} {parameter.name}"] = parameter
        self._parameters = read

    def recording(self, name: str, panel: Panel | None) -> Recording | None:
        """What was recorded of a topic, from the first call on; None for a topic that is not there."""
        topic = self._items(panel).get(("topics", name))
        if not isinstance(topic, SurveyedTopic) or not topic.publishers:
            return None
        known = self._recordings.get(topic.key)
        if known is None or known.type != topic.type:
            if len(self._recordings) >= MOST_RECORDED:
                del self._recordings[next(iter(self._recordings))]
            known = self._recordings[topic.key] = Recording(topic.type)
        return known

    # The rows.

    def _count(self) -> None:
        """A new version where the robot has other names."""
        robot = self.robot
        names = robot and (robot.topics, robot.services, robot.actions)
        known = names, tuple(self._parameters), self.fault
        if known != self._names:
            self._names = known
            self.version += 1

    def version_for(self, panel: Panel | None) -> int:
        """The version of the rows, another one also where the panel uses others of them."""
        if panel is not self._panel:
            self._panel = panel
            used = (uses_of(panel), panel.demo_story) if panel else None
            if used != self._used:
                self._used = used
                self.version += 1
        return self.version

    def rows(self, panel: Panel | None) -> Mapping[Section, Sequence[Row]]:
        """All rows by section; of a panel with a story, also what its simulated robot can play."""
        interfaces = self.interfaces(panel)
        used = uses_of(panel) if panel else {}
        rows: dict[Section, list[Row]] = {name: [] for name in SECTIONS}
        for (section, key), item in self._items(panel).items():
            value: TextLike = ""
            if isinstance(item, NodeParameter):
                nodes, value = item.node, short(item.value)
            elif isinstance(item, Server):
                nodes = _names(item.nodes)
            else:
                ends = item.publishers or item.subscribers
                nodes = _names([node for end in ends for node in end.nodes])
                value = self.value(item, interfaces)
            places = used.get((section, key), ())
            rows[section].append(Row(key, item.name, item.type, nodes, value, places))
        return rows

    def values(self, panel: Panel | None) -> dict[str, TextLike]:
        """The newest values of topics by their names."""
        interfaces = self.interfaces(panel)
        return {
            item.name: self.value(item, interfaces)
            for item in self._items(panel).values()
            if isinstance(item, SurveyedTopic) and item.key in self._latest
        }

    def types(self, section: Section, panel: Panel | None) -> Mapping[str, str]:
        """Name → type of the items of a section."""
        items = self._items(panel).items()
        return {item.name: item.type for (name, _), item in items if name == section}

    @property
    def nodes(self) -> Sequence[str]:
        """The names of the robot's nodes."""
        return [node.name for node in nodes_of(self.robot)] if self.robot else []

    def field_values(self, name: str, panel: Panel | None) -> Mapping[str, str]:
        """The newest values of a topic's plain fields, by their paths."""
        interfaces = self.interfaces(panel)
        topic = self._items(panel).get(("topics", name))
        if not isinstance(topic, SurveyedTopic):
            return {}
        message = self.sample(topic, interfaces)
        if message is None:
            return {}
        values = fields_of(message, Type(topic.type), interfaces)
        return dict(islice(values, MOST_FIELDS))

    def value(self, topic: SurveyedTopic, interfaces: Interfaces) -> TextLike:
        """The newest value of a topic as a line shows it."""
        message = self.sample(topic, interfaces)
        return "" if message is None else value_text(message, topic.type, interfaces)

    def sample(self, topic: SurveyedTopic, interfaces: Interfaces) -> Any:
        """The newest message of a topic; None without one that can be read."""
        latest = self._latest.get(topic.key)
        if latest is None or not latest.payload:
            return None
        with suppress(DecodeError, KeyError):
            return interfaces.decode(topic.type, latest.payload)
        return None

    def suggestions(self, section: Section, key: str, panel: Panel | None) -> Suggestions | None:
        """What a panel can have of a row; None if it is gone."""
        item = self._items(panel).get((section, key))
        if item is None:
            return None
        interfaces = self.interfaces(panel)
        if not isinstance(item, SurveyedTopic):
            return suggestions_for(item, interfaces)
        latest = self._latest.get(item.key, Latest())
        return suggestions_for(item, interfaces, self.sample(item, interfaces), latest.period_s)

    def _items(self, panel: Panel | None) -> dict[tuple[Section, str], Item]:
        items: dict[tuple[Section, str], Item] = {}
        robot = self.robot
        if robot is not None:
            own = partial(_as_panel_names, namespace=_namespace(panel, robot))
            for topic in map(own, public_topics(robot.topics)):
                items["topics", topic.name] = topic
            for service in map(own, robot.services):
                if service.name.rpartition("/")[2] not in SERVICES_OF_EVERY_NODE:
                    items["services", service.name] = service
            items |= {("actions", action.name): action for action in map(own, robot.actions)}
            items |= {("parameters", key): parameter for key, parameter in self._parameters.items()}
        if panel is not None and panel.demo_story is not None:
            for section, item in story_items(panel):
                items.setdefault((section, item.name), item)
        return items

    def interfaces(self, panel: Panel | None) -> Interfaces:
        """The message types of a panel."""
        return (
            load_interfaces(panel.distro, panel.interfaces) if panel else load_interfaces("jazzy", ())
        )


def _namespace(panel: Panel | None, robot: RobotGraph) -> str:
    """The namespace that the panel puts before its names, if the nodes carry it themselves; else ""."""
    if panel is None:
        return ""
    namespace = (panel.robots[0] if panel.robots else panel).namespace.rstrip("/")
    return "" if namespace == robot.namespace else namespace


def _as_panel_names(item: Named, namespace: str) -> Named:
    """The item by the name that the panel file has for it."""
    if not namespace or not item.name.startswith(f"{namespace}/"):
        return item
    return replace(item, name=item.name.removeprefix(namespace))


def nodes_of(robot: RobotGraph) -> Sequence[Node]:
    """The nodes of a robot, with those that are known by their parameters' services alone: the
    simulated robot has no bridge that lists nodes."""
    known = {node.name: node for node in robot.nodes}
    for service in robot.services:
        name, _, own = service.name.rpartition("/")
        if own == LIST[0] and name:
            known.setdefault(name, Node(name=name))
    return list(known.values())


def fullest(graph: GraphSnapshot) -> RobotGraph:
    """The robot with the most topics: of several alike, panels have the pages of one."""
    return max(graph.robots, key=lambda robot: len(robot.topics))


def story_items(panel: Panel) -> Iterator[tuple[Section, SurveyedTopic | Server]]:
    """What the simulated robot plays once a panel uses it."""
    if panel.demo_story is None:
        return
    story = STORIES[panel.demo_story]
    reliable = EndpointQos(reliable=True)
    for name, kind in story.publishes.items():
        end = TopicEndpoint(type=kind, qos=reliable)
        yield "topics", SurveyedTopic(name=name, key=name.strip("/"), publishers=(end,))
    for name, kind in story.subscribes.items():
        end = TopicEndpoint(type=kind, qos=reliable)
        yield "topics", SurveyedTopic(name=name, key=name.strip("/"), subscribers=(end,))
    for name, kind in story.services.items():
        yield "services", Server(name=name, key=name.strip("/"), type=kind)
    for name, kind in story.actions.items():
        yield "actions", Server(name=name, key=name.strip("/"), type=kind)


def _names(nodes: Sequence[str]) -> str:
    return ", ".join(sorted({node.rpartition("/")[2] for node in nodes}))


# The value of a message in a line.


def value_text(message: Any, type_name: str, interfaces: Interfaces) -> TextLike:
    """ "5.68" of a FluidPressure, "6 joints" of a JointState."""
    if type_name == JOINTS:
        return say("editor_joints", count=len(message.name))
    if type_name == DIAGNOSTICS:
        return say("editor_entries", count=len(message.status))
    shown = next(iter(shown_fields(type_name, interfaces)), None)
    if shown is None:
        return ""
    value: Any = message
    for name in shown.field.split("."):
        value = getattr(value, name, None)
    if isinstance(value, float) and shown.scale != 1.0:
        value *= shown.scale
    return short(value)


def fields_of(
    message: Any, kind: Type, interfaces: Interfaces, place: str = ""
) -> Iterator[tuple[str, str]]:
    """(path, value) of each plain field of a message, those of messages in it too, but no lists."""
    for part in interfaces.structures[kind.name].fields:
        value = getattr(message, attribute_name(part.name), None)
        if part.type.container != "one":
            continue
        if part.type.is_nested and part.type.name in interfaces.structures:
            yield from fields_of(value, part.type, interfaces, f"{place}{part.name}.")
        else:
            yield f"{place}{part.name}", short(value)


def short(value: Any) -> str:
    """A value in few characters."""
    if value is None:
        return ""
    if isinstance(value, float):
        text = f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
    else:
        text = value if isinstance(value, str) else format_value(value)
    line = " ".join(text.split())
    return line if len(line) <= MAX_TEXT else f"{line[: MAX_TEXT - 1]}…"


# Where a panel uses what.


def uses_of(panel: Panel) -> dict[tuple[Section, str], Sequence[TextLike]]:
    """(section, name) → the pages that have it, "header", the interlocks."""
    used: defaultdict[tuple[Section, str], dict[Any, None]] = defaultdict(dict)

    def add(widget: BaseWidget, where: TextLike) -> None:
        for section, name in _names_of(widget):
            used[section, name][where] = None

    for page in panel.pages:
        for widget in page.widgets:
            add(widget, page.title)
    for widget in panel.frame.widgets:
        add(widget, say("editor_frame"))
    if panel.state:
        add(panel.state.display, say("editor_header"))
    locked = [name for widget in panel.commands for name in widget.interlocks]
    for interlock in panel.interlocks:
        count = locked.count(interlock.id)
        used["topics", interlock.topic][say("editor_lock_of", count=count)] = None
    for condition in panel.own_conditions:
        used["topics", condition.topic][say("editor_condition")] = None
    for alarm in panel.alarms:
        for source in alarm.sources():
            used["topics", source.topic][say("editor_alarm")] = None
        if alarm.when is not None:
            used["topics", alarm.when.topic][say("editor_alarm")] = None
    return {key: list(places) for key, places in used.items()}


def _names_of(widget: BaseWidget) -> Iterator[tuple[Section, str]]:
    if isinstance(widget, Parameter):
        yield "parameters", f"{widget.node} {widget.parameter}"
    if isinstance(widget, DisplayWidget | Command):
        for source in widget.sources():
            yield "topics", source.topic
    for part in parts_of(widget) if isinstance(widget, Command) else ():
        for section, key in NAME_KEYS.items():
            if isinstance(name := getattr(part, key, None), str):
                yield section, name

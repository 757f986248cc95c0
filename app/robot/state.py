"""What the kiosk knows of the robot at this moment; changed on the event loop only.

One latest sample per topic, as raw bytes, read when it is first asked for.
"""

import logging
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from app.dialect.bridge_dialect import key_of
from app.errors import DecodeError
from app.i18n import Text
from app.interfaces import Interfaces
from app.interfaces.names import ROSOUT_TOPIC
from app.panel.constants import parent_type
from app.panel.model import Panel, RobotEntry
from app.panel.widgets.families import Display
from app.robot.command_status import CommandStatus
from app.robot.graph import Graph
from app.robot.parameter_state import ParameterState
from app.robot.presence import EndpointPresence, required_endpoints
from app.robot.sample import Buffer as Buffer
from app.robot.sample import Sample as Sample
from app.robot.sample import SkippedPayload as SkippedPayload
from app.robot.silent_publishers import SilentPublishers
from app.robot.slices import Slices
from app.robot.topics import Reading as Reading
from app.robot.topics import Topic
from app.ros_logging import RobotLog

log = logging.getLogger("kiosk.robot")

UNREADABLE_LOG_S = 60.0  # one line per topic in this time, at most


class RobotState:
    """Latest samples, the graph, and the state of the link."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        own_zid: str = "",
        entry: RobotEntry | None = None,
        slices: Slices | None = None,
    ) -> None:
        """`entry` is which of the panel's robots this is, where it has several; `slices` is of all that
        is read on one event loop."""
        self.name = entry.name if entry else ""
        self.namespace = entry.namespace if entry else panel.namespace
        self.link_up = False
        self.endpoints: tuple[str, ...] = ()  # where its bridge is looked for, as Zenoh names it
        self.settled_at = math.inf  # monotonic: when a bridge that came has set up its routes
        self._keys: dict[str, str] = {}  # of what the panel names
        self._own_namespace = entry.namespace if entry else None
        needed = list(required_endpoints(panel))
        named = (*panel.subscriptions(), *panel.publications(), *(n for _, n in needed), ROSOUT_TOPIC)
        self._required_keys = frozenset(map(self.key, named))
        self.graph = Graph(own_zid, self._own_namespace, self._required_keys)
        self._interlock_keys = frozenset(self.key(interlock.topic) for interlock in panel.interlocks)
        self.silent_publishers = SilentPublishers(self._interlock_keys)
        self.command_status: dict[str, CommandStatus] = {}  # of what widgets have asked, by their ids
        self.parameters: dict[
            str, ParameterState
        ] = {}  # what nodes said of them, by their widgets' ids
        self.querying: set[str] = set()  # ids of parameter widgets whose nodes are being asked
        self.held_since: dict[str, Text] = {}  # by the ids of hold widgets: since when, in words
        self._log = RobotLog(log, self.name)
        self.is_responding = True  # False: its bridges are silent, though nobody knows yet why
        self.is_caught_up = (
            True  # False: the event loop stood still, and may not know what came meanwhile
        )
        self.presence = EndpointPresence(
            {(role, name): (role, self.key(name)) for role, name in needed}
        )
        self.undecodable: Counter[str] = Counter()
        self.slices = slices or Slices()
        # Gets what took more than one turn to read: the topic's key, and what it said.
        self.on_late_reading: Callable[[str, Reading], None] = lambda _key, _reading: None
        self._interfaces = interfaces
        self._publisher_required = [self.key(i.topic) for i in panel.interlocks if i.require_publisher]
        self._published: set[str] = set()
        self._topics = dict(self._make_topics(panel))
        self._logged_at: dict[str, float] = {}

    def _make_topics(self, panel: Panel) -> Iterator[tuple[str, Topic]]:
        """A topic for each that the panel listens to, by its key."""
        fields = panel.subscribed_fields()
        watched = {one.topic for one in panel.interlocks} | {one.topic for one in panel.confirmations()}
        for topic, type_name in panel.subscriptions().items():
            key = self.key(topic)
            made = Topic(
                self._interfaces.field_reader(type_name, fields.get(topic, ())),
                self.slices,
                watched=topic in watched,
                unreadable=partial(self.count_unreadable, key),
                read_later=partial(self._notify_late_reading, key),
            )
            yield key, made

    def _notify_late_reading(self, key: str, reading: Reading) -> None:
        self.on_late_reading(key, reading)

    def key(self, topic: str) -> str:
        """The key expression of a topic of this robot."""
        key = self._keys.get(topic)
        if key is None:
            key = self._keys[topic] = key_of(topic, self.namespace)
        return key

    def update(self, key: str, sample: Sample) -> None:
        """A newer sample of a topic."""
        self.silent_publishers.record_message(key, sample.source, sample.seq, sample.at)
        if (topic := self._topics.get(key)) is not None:
            topic.update(sample)

    def mark_bridge_lost(self, bridge: str, seq: int) -> None:
        """A bridge went away at `seq`: what came by it before no longer says what is so."""
        self.silent_publishers.remove_bridge(bridge)
        for topic in self._topics.values():
            sample = topic.sample
            if sample is not None and sample.seq < seq and sample.source in (bridge, None):
                topic.invalidate()

    def update_publishers(self, before: float = math.inf) -> None:
        """After every change of the graph: where a publisher is required, what it said (`before` this
        number of a sample) goes with it, and its successor has to say it again."""
        self.presence.update(self.graph)
        for key in self._publisher_required:
            if self.graph.has_endpoint("MP", key):
                self._published.add(key)
            elif key in self._published:
                self._published.discard(key)
                topic = self._topics[key]
                if topic.sample is not None and topic.sample.seq < before:
                    topic.invalidate()

    def invalidate(self, key: str) -> None:
        """It is not known what a topic said last."""
        self._topics[key].invalidate()

    def mark_link_lost(self) -> None:
        """The link is lost: nobody is known to be there, and nothing that came says what is so."""
        self.link_up = False
        self.settled_at = math.inf
        self.graph = Graph("", self._own_namespace, self._required_keys)
        self.silent_publishers = SilentPublishers(self._interlock_keys)
        self.presence.clear()
        for topic in self._topics.values():
            topic.invalidate()

    def reading(self, topic: str) -> Reading:
        """The latest of a topic that the panel listens to."""
        return self.reading_by_key(self.key(topic))

    def reading_by_key(self, key: str) -> Reading:
        """The same by the topic's key."""
        known = self._topics[key]
        found, sample = known.reading(), known.sample
        if sample is None or sample.source is None or sample.source in self.graph.bridges:
            return found
        return replace(found, status="cut")

    def constants(self, display: Display) -> Mapping[str, Any]:
        """Name → value of the constants of the message that a display's field is in."""
        return self._interfaces.constants(parent_type(display, self._interfaces))

    def count_unreadable(self, key: str, sample: Sample, error: DecodeError) -> None:
        """Counts a sample that can't be read; logs one of a topic in `UNREADABLE_LOG_S`."""
        self.undecodable[key] += 1
        if sample.at - self._logged_at.get(key, -math.inf) >= UNREADABLE_LOG_S:
            self._logged_at[key] = sample.at
            self._log.error("/%s: %s (%d so far)", key, error, self.undecodable[key])

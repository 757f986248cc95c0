"""The current state of one robot. Changed on the event loop only.

Keeps the latest sample of each topic as raw bytes, and decodes it at the first read.
"""

import logging
import math
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from app.cell.robot.alarmed import NO_ALARMED, AlarmAction, AlarmSelection
from app.cell.robot.clocks import CLOCK, LARGEST_BYTES, RobotClock
from app.cell.robot.definitions import DefinitionDifference, difference
from app.cell.robot.graph import EndpointPresence, LiveGraph, required_endpoints
from app.cell.robot.history import History
from app.cell.robot.log_lines import LogLines
from app.cell.robot.map_layers import LayerState
from app.cell.robot.maps import MapState
from app.cell.robot.option_list import OptionList
from app.cell.robot.parameter_state import ParameterState
from app.cell.robot.places import KeepOut
from app.cell.robot.publishers import (
    Publishers,
    ReplayedMessages,
    SilentPublishers,
    TopicPublishers,
    present_key,
)
from app.cell.robot.tables import TableEntries
from app.cell.robot.topics import CameraTopicState, Slices, Topic
from app.cell.robot.topics import Reading as Reading
from app.cell.robot.traffic import RoundTrips, Traffic
from app.cell.robot.transforms import TransformTree
from app.panel.constants import HasField, parent_type
from app.panel.model import Panel, RobotEntry
from app.panel.places import Place
from app.panel.used import actions_of_tours, places_by_command, selects_by_command
from app.panel.widgets.parameter import GET
from app.panel.widgets.robot_options import ListingService
from app.records.entry import CommandStatuses
from app.ros.cdr.stamped import begins_with_stamp, first_stamp
from app.ros.dialects.dialect import Dialect, Role
from app.ros.dialects.peer_traits import PeerTraits
from app.ros.messages import Interfaces, has_key
from app.ros.messages.names import GLOBAL, ROSOUT_TOPIC, SHARED_TOPICS, key_of, possible_keys
from app.ros.zenoh.sample import Buffer as Buffer
from app.ros.zenoh.sample import Sample as Sample
from app.ros.zenoh.sample import SkippedPayload as SkippedPayload
from app.system.log import RobotLog
from app.system.texts import Text, TextLike

if TYPE_CHECKING:
    from app.cell.robot.waypoints import WaypointGoal

log = logging.getLogger("kiosk.robot")


class RobotState:
    """The latest samples, the graph, parameters, and the state of the link."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        dialect: Dialect,
        traits: PeerTraits,
        own_zid: str = "",
        entry: RobotEntry | None = None,
        slices: Slices | None = None,
        *,
        endpoints: tuple[str, ...] = (),
        on_late_reading: Callable[[str, Reading], None] = lambda _key, _reading: None,
        on_entries_decoded: Callable[[str], None] = lambda _key: None,
    ) -> None:
        """`dialect` and `traits` are those of the peer that the robot is reached by. `own_zid` is that
        of the panel's session. `entry` is this robot's entry if the panel has several robots. `slices`
        is shared by everything that is decoded on one event loop. `endpoints` are the robot's, as Zenoh
        names them.

        `on_late_reading` is called with (key, reading) of a message that took more than one turn to
        decode, `on_entries_decoded` with the key of a topic of which the entries in tables changed."""
        self.dialect, self.traits = dialect, traits
        self.title: TextLike = entry.name if entry else ""
        self.name = str(self.title)  # for the server's log
        self.id = entry.id if entry else None
        self.fleet: Mapping[str, RobotState] = {}  # all robots of the panel, by their ids
        self.namespace = entry.namespace if entry else panel.namespace
        self.texts = panel.robot_texts
        self.link_up, self.endpoints = False, endpoints
        self.starting_until = (
            -math.inf
        )  # monotonic seconds: a link that is not up yet is no fault before
        self.settled_at = math.inf  # monotonic seconds: then a new peer has set up its routes
        self._keys: dict[str, str] = {}  # ROS name → key
        self._shared = {topic: possible_keys(topic, self.namespace) for topic in SHARED_TOPICS}
        self._keys |= {topic: keys[0] for topic, keys in self._shared.items()}
        self._own_namespace = entry.namespace if entry else None
        needed = list(required_endpoints(panel))
        # A node is there while its parameter services are.
        nodes = [f"{alarm.node}/{GET[0]}" for alarm in panel.alarms if alarm.node]
        listed = (*panel.listened(), *panel.publications(), *(name for _, name in needed))
        named = (*nodes, *listed, *panel.services(), ROSOUT_TOPIC, CLOCK)
        self.required_keys = frozenset(key for name in named for key in self.possible_keys(name))
        self._global_keys = frozenset(self.key(name) for name in named if name.startswith(GLOBAL))
        self.graph = LiveGraph(dialect, own_zid, self._own_namespace, self.required_keys)
        self.nodes_are_read = False  # True: its nodes are queried, so what a server is will be known
        self.selects = selects_by_command(panel)
        conditions = (*panel.named_conditions, *panel.of_others)
        self.conditions = {condition.id: condition for condition in conditions}
        self._condition_keys = frozenset(self.key(condition.topic) for condition in panel.conditions)
        self.silent_publishers = SilentPublishers(self._condition_keys, traits)
        self.topic_publishers, self.replayed = TopicPublishers(), ReplayedMessages()
        self._adaptive_keys = frozenset(map(self.key, panel.adaptive_topics))
        self.reliable_readers: set[str] = set()  # keys of subscriptions that began as reliable
        self.command_status = CommandStatuses()  # by widget id
        self.parameters: dict[str, ParameterState] = {}  # by widget id
        self.option_lists: dict[ListingService, OptionList] = {}
        self.querying: set[str] = set()  # ids of parameter widgets whose nodes are being queried
        self.camera_topics: dict[str, CameraTopicState] = {}  # by the key of a camera's topic
        self.switched_to: dict[str, bool] = {}  # by switch id: the position that was sent last
        self.alarm_actions: tuple[AlarmAction, ...] = ()
        self.held_since: dict[str, Text] = {}  # by hold widget id: the sentence with the time
        self.alarmed = NO_ALARMED
        self.alarm_selections: Mapping[str, AlarmSelection] = {}  # by widget id
        self._log = RobotLog(log, self.name)
        # False: its peers do not respond; the event loop stalled, and the inbox has not been read yet.
        self.is_responding = self.is_caught_up = True
        self.is_queryable = True  # False: its peers refuse queries, as their admin space is off
        self.presence = EndpointPresence(needed, self.key)
        self.traffic, self.round_trips = Traffic(self._log), RoundTrips()
        self.slices = slices or Slices()
        self._on_late_reading, self._interfaces = on_late_reading, interfaces
        self.clock = RobotClock()
        self._publisher_required = [self.key(i.topic) for i in panel.interlocks if i.require_publisher]
        self._published: set[str] = set()
        self._topics = dict(self._make_topics(panel))
        self._stamped = frozenset(
            key
            for topic, type_name in panel.subscriptions().items()
            if begins_with_stamp(type_name, interfaces.structures)
            for key in self.possible_keys(topic)
        )
        self.table_entries = TableEntries(panel, interfaces, self.key, self.slices, on_entries_decoded)
        self.log_lines = {
            key: lines
            for topic, keep in panel.logs().items()
            for lines in [LogLines(interfaces, keep)]
            for key in self.possible_keys(topic)
        }
        self.maps = {self.key(topic): MapState() for topic in panel.maps}
        self.map_layers = {self.key(topic): LayerState() for topic in panel.map_shapes}
        self.transforms = TransformTree()
        self.places, self.zones, self.map_views = panel.places, panel.zones, panel.map_views
        self.keep_out = KeepOut(panel.zones)
        self.saved_places: tuple[Place, ...] = ()  # by operators, beside those of the panel file
        self.place_inputs = places_by_command(panel)
        self.tour_actions = actions_of_tours(panel)
        self.waypoint_goals: dict[str, WaypointGoal] = {}  # the newest of each action that a tour shows
        self.history = History(time.monotonic(), time.time())

    def _make_topics(self, panel: Panel) -> Iterator[tuple[str, Topic]]:
        """(key, topic) of each topic that the panel subscribes to."""
        fields = panel.subscribed_fields()
        lossless = {condition.topic for condition in panel.conditions}
        lossless |= {confirm.topic for confirm in panel.confirmations()}
        subscribed = panel.subscriptions()
        for topic, key in ((name, key) for name in subscribed for key in self.possible_keys(name)):
            type_name, paths = subscribed[topic], fields.get(topic, ())
            made = Topic(
                self._interfaces.field_reader(type_name, paths),
                self.slices,
                lossless=topic in lossless,
                on_unreadable=partial(self.traffic.count_undecodable, key),
                on_late_reading=partial(self._on_late_reading, key),
                keyed=[path for path in dict.fromkeys(paths) if has_key(path)],
                timed=[panel.state.field] if panel.state and panel.state.topic == topic else (),
                time_at=self.clock.time_at,
            )
            yield key, made

    def named(self, robot_id: str | None) -> "RobotState | None":
        """The robot with this id, this one for None; None while the server has not begun it yet."""
        return self if robot_id in (None, self.id) else self.fleet.get(str(robot_id))

    def key(self, topic: str) -> str:
        """The key of a topic or service of this robot, see `key_of`."""
        key = self._keys.get(topic)
        if key is None:
            key = self._keys[topic] = key_of(topic, self.namespace)
        return key

    def possible_keys(self, topic: str) -> tuple[str, ...]:
        """All keys that `key` may return for a topic: several of a shared one, as its peer has it."""
        return self._shared.get(topic) or (self.key(topic),)

    def update_shared_topics(self) -> None:
        """Finds out under which keys the peers have the shared topics. Call it after a change of the
        graph."""
        for topic, keys in self._shared.items():
            self._keys[topic] = present_key(self.graph, topic, keys)

    def adapts_reliability(self, key: str) -> bool:
        """Whether a topic is read as its publisher offers it, best effort too. Not while the peer
        reads it as reliable for an earlier publisher."""
        return key in self._adaptive_keys and key not in self.reliable_readers

    def difference(self, role: Role, key: str) -> DefinitionDifference | None:
        """How the definition of an endpoint of the robot differs from the panel's; None if it is not
        known to differ."""
        return difference(self.graph, role, key, self._interfaces)

    def definition_source(self, type_name: str) -> str:
        """Where the panel's definition of a type comes from."""
        return self._interfaces.source(type_name)

    def is_misread(self, key: str) -> bool:
        """Whether a message of a topic would be decoded by a definition that is not its own."""
        return self.difference("MP", key) is not None

    def measure_clock(self, key: str, sample: Sample) -> None:
        """Compares the stamps of a topic's newest sample with the panel's clock, once a second."""
        source, clock = sample.source, self.clock
        if sample.sent is not None and source in self.graph.peers and source is not None:
            clock.record_peer(source, sample.sent, sample.wall, sample.at)
        if key not in self._stamped or sample.cached or len(sample.payload) > LARGEST_BYTES:
            return
        if self.is_foreign(source) or self.is_misread(key) or not clock.is_due(key, sample.at):
            return
        if (stamp := first_stamp(bytes(sample.payload))) is not None:
            clock.record_topic(key, stamp, sample.wall, sample.at)

    def restart_time(self) -> None:
        """The simulated time went back: what was received before is of another run of it."""
        self.clock.forget_stamps()
        self.transforms.restart()
        self.history.interrupt()

    def update(self, key: str, sample: Sample) -> None:
        """A newer sample of a topic."""
        if self.is_misread(key):
            return
        if key in self._condition_keys:
            self.silent_publishers.record_message(key, sample.source, sample.seq, sample.at)
            self.replayed.record_message(key, sample.at, self.settled_at, sample.cached)
        if (topic := self._topics.get(key)) is not None:
            topic.update(sample)

    def copy_readings(self, other: "RobotState") -> None:
        """Shows what another session with the same robot has received, without a link of its own: the
        graph, the newest samples and what was made of them."""
        self.graph, self.link_up = other.graph, other.link_up
        self.settled_at, self.starting_until = other.settled_at, other.starting_until
        self.is_responding, self.is_caught_up = other.is_responding, other.is_caught_up
        self.is_queryable, self.nodes_are_read = other.is_queryable, other.nodes_are_read
        self.clock, self.transforms, self.history = other.clock, other.transforms, other.history
        self.option_lists, self.switched_to = other.option_lists, other.switched_to
        self.silent_publishers, self.replayed = other.silent_publishers, other.replayed
        self.topic_publishers, self.saved_places = other.topic_publishers, other.saved_places
        states = other.parameters.items()
        self.parameters |= {name: known for name, known in states if name in self.parameters}
        self.maps |= {key: known for key, known in other.maps.items() if key in self.maps}
        layers = other.map_layers.items()
        self.map_layers |= {key: known for key, known in layers if key in self.map_layers}
        self.log_lines |= {
            key: lines for key, lines in other.log_lines.items() if key in self.log_lines
        }
        for key, topic in self._topics.items():
            known_topic = other._topics.get(key)
            if known_topic is not None and known_topic.sample is not None:
                topic.update(known_topic.sample)
        self.update_shared_topics()
        self.presence.update(self.graph)

    @property
    def topic_keys(self) -> Collection[str]:
        """The keys of the topics that the panel subscribes to."""
        return self._topics.keys()

    def received(self) -> Mapping[str, float]:
        """When (monotonic seconds) the newest message of each topic came, by the topic's key."""
        newest = ((key, topic.sample) for key, topic in self._topics.items())
        return {key: sample.at for key, sample in newest if sample is not None}

    def mark_peer_lost(self, peer: str, seq: int) -> None:
        """A peer was lost at `seq`: its earlier samples are no longer valid. Without a bridge it is a
        process of the robot's, which has ended."""
        self.silent_publishers.remove_peer(peer)
        self.clock.forget_peer(peer)
        status: Literal["cut", "ended"] = "cut" if self.traits.stamped_by_peer else "ended"
        if self.traits.stamped_by_peer:
            self._cut_maps()
        for key, topic in self._topics.items():
            topic.forget_source(peer)
            sample = topic.sample
            if sample is not None and sample.seq < seq and sample.source in (peer, None):
                topic.invalidate(status)
                self.replayed.begin(key)

    def _cut_maps(self) -> None:
        now = time.monotonic()
        self.transforms.cut(now)
        for state in (*self.maps.values(), *self.map_layers.values()):
            state.cut_at = now

    def update_publishers(self, before: float = math.inf) -> None:
        """Call after every change of the graph. If a required publisher has ended, its samples (before
        the sequence number `before`) become invalid, and a new publisher must republish the value."""
        self.update_shared_topics()
        self.presence.update(self.graph)
        self.drop_misread()
        for key in self._publisher_required:
            if self.graph.has_endpoint("MP", key):
                self._published.add(key)
            elif key in self._published:
                self._published.discard(key)
                topic = self._topics[key]
                if topic.sample is not None and topic.sample.seq < before:
                    topic.invalidate("ended")
                    self.replayed.begin(key)

    def update_nodes(self) -> None:
        """Call after the nodes of the graph have been read: what they are may be known now."""
        self.drop_misread()
        for key in self._condition_keys:
            is_known = self.graph.since("MP", key) <= self.graph.nodes_read_at
            if is_known and self.publishers(key).number == 1:
                self.silent_publishers.mark_single(key)

    def publishers(self, key: str) -> Publishers:
        """The publishers of a condition's topic, as they are known now."""
        known = self.topic_publishers.of_topic(key, self.graph)
        nodes = {endpoint.node for endpoint in self.graph.node_endpoints("MP", key)}
        return Publishers(max(known.number, len(nodes)), tuple(sorted({*known.nodes, *nodes})))

    def drop_misread(self) -> None:
        """Drops values that were decoded by a definition which turned out not to be the publisher's."""
        for key, topic in self._topics.items():
            if self.is_misread(key):
                topic.drop()

    def invalidate(self, key: str) -> None:
        self._topics[key].invalidate()  # the last value is unknown

    def mark_link_lost(self) -> None:
        """The link was lost: the graph is empty, and no sample is valid."""
        self.link_up, self.settled_at = False, math.inf
        self.clock.forget()
        self.graph = LiveGraph(self.dialect, "", self._own_namespace, self.required_keys)
        self.silent_publishers = SilentPublishers(self._condition_keys, self.traits)
        self.topic_publishers = TopicPublishers()
        self.replayed.begin_all()
        self.presence.clear()
        self._cut_maps()
        for topic in self._topics.values():
            topic.invalidate()

    def reading(self, topic: str) -> Reading:
        """The latest reading of a topic that the panel subscribes to."""
        return self.reading_by_key(self.key(topic))

    def reading_by_key(self, key: str) -> Reading:
        """The same by the topic's key."""
        known = self._topics[key]
        reading, sample = known.reading(), known.sample
        if sample is None or reading.status in ("cut", "ended") or self.is_from_peer(key, sample):
            return reading
        return replace(reading, status="foreign")

    def is_from_peer(self, key: str, sample: Sample) -> bool:
        """Whether a sample's source is a peer that is there: one of this robot, or any for a topic
        that is not below its namespace. What permits needs a known one, or a publisher's session."""
        source, sender, peers = sample.source, sample.sender, self.peers_of(key)
        if source is not None or sender is None or key not in self._condition_keys:
            return source is None or source in peers
        return sender in peers or self.graph.announces(sender, "MP", key)

    def is_foreign(self, source: str | None) -> bool:
        """Whether what came from the peer `source` is none of this robot's; not while its peers are not
        known."""
        peers = self.graph.every_peer
        return (
            self.traits.stamped_by_peer and source is not None and bool(peers) and source not in peers
        )

    def peers_of(self, key: str) -> Collection[str]:
        """The zids of the peers through which a topic may come."""
        return self.graph.every_peer if key in self._global_keys else self.graph.peers

    @property
    def keyed_topics(self) -> frozenset[str]:
        """The keys of topics of which fields with keys are read: each message counts."""
        return frozenset(key for key, topic in self._topics.items() if topic.is_keyed)

    def cuts(self, key: str) -> int:
        """How often a topic's last value was no longer valid: its peer, its publisher or the link was
        lost."""
        return self._topics[key].cuts

    def constants(self, display: HasField) -> Mapping[str, Any]:
        """Name → value of the constants of the message that contains a display's field."""
        return self._interfaces.constants(parent_type(display, self._interfaces))

"""Applies what has arrived since the last turn to the robot's state: samples first, then tokens.

Holds, confirmations and the view follow in `turn`.
"""

import logging
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Literal, Protocol

from app.cell.permission.interlocks import interlock_verdict
from app.cell.permission.verdict import Verdict
from app.cell.robot.sample_handlers import SampleHandlers
from app.cell.robot.state import Reading, RobotState, Sample
from app.panel.model import Panel
from app.ros.dialects.dialect import Endpoint
from app.ros.zenoh.inbox import Changes, Token
from app.system.log import RobotLog

log = logging.getLogger("kiosk")

Change = Literal["", "soon", "now"]


@dataclass(slots=True)
class Updates:
    """The changes of a turn. `urgent`: a permission or the graph has changed; `values`: the keys of
    topics with a new message that are only shown, `topics` those of all; `other`: another change that
    can wait for the next frame. `readings` are messages (topic's key, reading) that may confirm a
    command.

    `commands` are the ids of widgets of which the status was set. `graph`: tokens have changed;
    `peer_appeared`: there was no peer before. `peers_found` and `peers_lost` are zids.
    """

    urgent: bool = False
    other: bool = False
    values: set[str] = field(default_factory=set)
    topics: set[str] = field(default_factory=set)
    readings: list[tuple[str, Reading]] = field(default_factory=list)
    commands: set[str] = field(default_factory=set)
    graph: bool = False
    peer_appeared: bool = False
    peers_found: list[str] = field(default_factory=list)
    peers_lost: list[str] = field(default_factory=list)

    def step(self) -> "Updates":
        """The update for an intermediate permission. Each reading is returned once."""
        readings, self.readings = self.readings, []
        return Updates(urgent=True, topics=set(self.topics), readings=readings)


class SampleListener(Protocol):
    """Gets every sample of its topics in their order, also those that were replaced within one turn."""

    @property
    def keys(self) -> frozenset[str]:
        """The keys of its topics."""

    def record_sample(self, key: str, sample: Sample) -> None:
        """A sample was received. Called on the event loop; it must take microseconds."""


class Ingest:
    """Ingests the data of one robot. Used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        robot: RobotState,
        handlers: SampleHandlers,
        listeners: Collection[SampleListener] = (),
        observers: Collection[SampleListener] = (),
    ) -> None:
        """`observers` need only the samples that differ from the one before."""
        self._robot = robot
        self._handlers = handlers
        self._log = RobotLog(log, robot.name)
        self._interlocks = {
            robot.key(interlock.topic): [i for i in panel.interlocks if i.topic == interlock.topic]
            for interlock in panel.interlocks
        }
        sources = [source for widget in panel.commands for source in widget.sources()]
        choices = (select for selects in robot.selects.values() for select in selects)
        sources += (source for select in choices for source in select.sources())
        self._needed = frozenset(robot.key(source.topic) for source in sources)
        # Every message of these topics counts, also values that were replaced within one turn.
        permitting = self._interlocks.keys() | {
            robot.key(confirmation.topic) for confirmation in panel.confirmations()
        }
        self._conditions = frozenset(robot.key(condition.topic) for condition in panel.conditions)
        permitting |= self._conditions
        self.lossless = permitting | robot.keyed_topics
        published = (alarm for alarm in panel.alarms if alarm.diagnostics or alarm.listed)
        alarming = {key for alarm in published for key in robot.possible_keys(alarm.topic_name or "")}
        self.immediate = permitting | alarming | {*handlers.immediate}
        self._by_key: dict[str, list[SampleListener]] = {}
        for listener in listeners:
            for key in listener.keys:
                self._by_key.setdefault(key, []).append(listener)
        self.recorded = frozenset(self._by_key)
        for observer in observers:
            for key in observer.keys:
                self._by_key.setdefault(key, []).append(observer)
        self.changing = frozenset(self._by_key) - self.recorded
        self._clock_version = robot.clock.version
        judged = {topic for alarm in panel.alarms for topic in alarm.evaluated_topics}
        judged |= {topic for recipes in panel.recipes for topic in recipes.readback_topics}
        views = [panel.map_views[widget.map] for widget in panel.map_inputs]
        judged |= {topic for view in views for topic in view.deciding_topics}
        self._judged = frozenset(key for topic in judged for key in robot.possible_keys(topic))
        self._judged |= self._needed | self.immediate | self.lossless | self._by_key.keys()

    def only_shown(self, keys: Collection[str]) -> frozenset[str]:
        """Those of these keys by whose topics nothing is judged or recorded, and that no command
        needs."""
        return frozenset(key for key in keys if key not in self._judged and key not in self._handlers)

    def steps(self, changes: Changes) -> Iterator[Updates]:
        """Ingests changes step by step: yields after each intermediate value that changed a permission,
        and at the end. At each step the robot's state is up to date."""
        updates = Updates(urgent=bool(changes.tokens), graph=bool(changes.tokens))
        # Interlocks first: a failure in another topic must not delay them.
        ordered = sorted(
            changes.samples.items(), key=lambda arrived: arrived[0] not in self._interlocks
        )
        for key, sample in ordered:
            sample = self._with_peer(sample)
            updates.topics.add(key)
            self._robot.traffic.record(key, sample)
            self._robot.measure_clock(key, sample)
            if sample.overrun and key in self._interlocks:
                self._robot.invalidate(key)
                yield updates.step()
            for payload, at, wall in sample.skipped_payloads:
                passed = sample._replace(payload=payload, at=at, wall=wall, skipped_payloads=())
                if self._ingest(key, passed, updates) == "now":
                    yield updates.step()
                elif key in self._conditions:  # alarms see each value
                    yield Updates(topics={key})
            change = self._ingest(key, sample, updates)
            updates.urgent |= change == "now"
            updates.other |= change == "soon"
            if key in self._handlers or key in self._needed:
                updates.other = True
            else:
                updates.values.add(key)
        updates.urgent |= self._clock_version != self._robot.clock.version
        self._clock_version = self._robot.clock.version
        self._notify(changes)
        self._apply_tokens(changes.tokens, updates)
        yield updates

    def late_reading(self, key: str, reading: Reading) -> Updates:
        """The update for a message that took more than one turn to decode."""
        urgent, needed = key in self._interlocks, key in self._needed
        readings = [(key, reading)]
        return Updates(urgent, other=needed, values={key}, topics={key}, readings=readings)

    def _with_peer(self, sample: Sample) -> Sample:
        """A sample whose source is a peer, or not known: then it has a sender."""
        robot, source = self._robot, sample.source
        if source in robot.graph.every_peer or (robot.traits.stamped_by_peer and source is not None):
            return sample
        return sample._replace(source=None, sender=source or "")

    def _ingest(self, key: str, sample: Sample, updates: Updates) -> Change:
        """Ingests a sample; returns whether it changed a permission."""
        take = partial(self._apply, updates=updates)
        if key not in self._interlocks:
            self._guarded(key, sample, take)
            return ""
        now = time.monotonic()
        before = self._verdicts(key, now)
        self._guarded(key, sample, take)
        pairs = zip(before, self._verdicts(key, now), strict=True)
        changes = [_change(was, verdict) for was, verdict in pairs]
        return "now" if "now" in changes else "soon" if "soon" in changes else ""

    def _verdicts(self, key: str, now: float) -> list[Verdict]:
        """The verdicts of the interlocks on a topic."""
        return [
            interlock_verdict(interlock, self._robot, now)
            for interlock in self._interlocks.get(key, ())
        ]

    def _notify(self, changes: Changes) -> None:
        for key, sample in changes.recorded_samples:
            if self._robot.is_misread(key):
                continue
            for listener in self._by_key[key]:
                self._guarded(key, sample, listener.record_sample)

    def _guarded(self, key: str, sample: Sample, take: Callable[[str, Sample], None]) -> None:
        try:
            take(key, sample)
        except Exception:
            self._log.exception("a sample of %s was not processed completely", key)

    def _apply(self, key: str, sample: Sample, updates: Updates) -> None:
        if self._handlers.take(key, sample):
            self._robot.update(key, sample)
            if self._handlers.is_awaited(key):
                updates.readings.append((key, self._robot.reading_by_key(key)))

    def _apply_tokens(self, tokens: Mapping[str, Token], updates: Updates) -> None:
        """Applies token changes to the graph and to the robot's state."""
        now, graph = time.monotonic(), self._robot.graph
        had_peer = bool(tokens and graph.peers)
        for key, token in tokens.items():
            if not graph.is_relevant(key):
                continue
            if endpoint := self._robot.dialect.endpoint(key):
                self._track_publisher(key, token, endpoint)
                if token.lost_seq:
                    self._handlers.endpoint_lost(endpoint)
            if token.lost_seq and (zid := graph.apply_token(key, False)):
                self._robot.mark_peer_lost(zid, token.lost_seq)
                updates.peers_lost.append(zid)
                had_peer = had_peer and bool(graph.peers)
            if token.lost_seq and token.alive:
                self._robot.update_publishers(token.lost_seq)  # gone, possibly for a moment
            if token.alive and (zid := graph.apply_token(key, True, now)):
                updates.peers_found.append(zid)
        updates.peer_appeared = bool(updates.peers_found) and not had_peer

    def _track_publisher(self, key: str, token: Token, endpoint: Endpoint) -> None:
        """Tracks publishers that appear, possibly for a moment: until they publish, permissions on
        their topics are unknown."""
        graph, silent_publishers = self._robot.graph, self._robot.silent_publishers
        if endpoint.zid == graph.own_zid:
            return
        if token.came_seq and (
            token.lost_before or not graph.has_token(key)
        ):  # else the token was received twice
            silent_publishers.add_publisher(endpoint, token.came_seq, token.came_at, token.lost_before)
            if endpoint.role == "MP" and endpoint.transient_local:
                self._robot.replayed.begin(endpoint.key, token.came_at)
        if token.lost_seq:
            silent_publishers.remove_publisher(endpoint, token.lost_seq)


def _change(before: Verdict, verdict: Verdict) -> Change:
    """How urgent a change of a verdict is. A reason that contains the robot's value may change as often
    as a readout, so it waits for a frame as a readout does."""
    if (before.permitted, before.reason) == (verdict.permitted, verdict.reason):
        return ""
    return "soon" if verdict.code == "interlock_condition_unmet" and not before.permitted else "now"

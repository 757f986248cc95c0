"""What the link brought since the last turn, handed to who needs it: samples first, then tokens."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from app.commands.actions.goals import GoalTracker
from app.commands.confirmations import Confirmations
from app.commands.parameters.sync import ParameterSync
from app.dialect import bridge_dialect
from app.panel.interlock import Interlock
from app.panel.model import Panel
from app.panel.widgets.parameter import EVENTS
from app.permission.conditions import permits
from app.permission.interlocks import Verdict, interlock_verdict
from app.robot.state import Reading, RobotState, Sample
from app.ros_logging import RobotLog
from app.transport.inbox import Changes, Token
from app.view.kinds import Enabled, enabled

if TYPE_CHECKING:
    from app.recording import Recorder


Change = Literal["", "soon", "now"]


@dataclass(slots=True)
class Updates:
    """What has changed: `urgent` is a permission or the graph, `came` that there is a bridge where
    there was none; `values` are the topics (their keys) that said something, and `more` is whatever
    else can wait for the next frame."""

    urgent: bool = False
    came: bool = False
    more: bool = False
    values: set[str] = field(default_factory=set)


class Ingest:
    """Of one robot; on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        robot: RobotState,
        actions: GoalTracker,
        confirmations: Confirmations,
        parameters: ParameterSync,
        recorder: "Recorder | None",
        log: RobotLog,
    ) -> None:
        self._robot = robot
        self._actions = actions
        self._confirmations = confirmations
        self._parameters = parameters
        self._recorder = recorder
        self._log = log
        goals = {robot.key(one): one for one in panel.actions()}
        self._feedback = {bridge_dialect.feedback(key): one for key, one in goals.items()}
        self._status = {bridge_dialect.status(key): one for key, one in goals.items()}
        self._interlocks = {
            robot.key(of.topic): [i for i in panel.interlocks if i.topic == of.topic]
            for of in panel.interlocks
        }
        self._events = robot.key(EVENTS)
        # What is judged by them is judged by each value that they had, however short.
        self.watched = self._interlocks.keys() | {robot.key(one.topic) for one in panel.confirmations()}
        self.prompt = self.watched | self._status.keys() | {self._events}
        self.whole = frozenset() if recorder is None else recorder.keys
        topics = map(robot.key, panel.subscriptions())
        self.keys = [*topics, *self._feedback, *self._status]  # all that is listened to

    def take(
        self, changes: Changes, shown: Callable[[], Mapping[str, Enabled]], show: Callable[[], None]
    ) -> Updates:
        """Takes it in. `shown` are the permissions that are; `show` is called at each value in between
        that changed one."""
        news = Updates(urgent=bool(changes.tokens))
        # What permits and forbids comes first, and nothing that fails keeps it from being taken in.
        ordered = sorted(changes.samples.items(), key=lambda one: one[0] not in self._interlocks)
        for key, sample in ordered:
            if sample.overrun and key in self._interlocks:
                self._robot.invalidate(key)
                show()
            for payload, at, wall in sample.skipped_payloads:
                passed = sample._replace(payload=payload, at=at, wall=wall, skipped_payloads=())
                if self._changes(key, passed, shown()) == "now":
                    show()
            change = self._changes(key, sample, shown())
            news.urgent |= change == "now"
            news.more |= change == "soon"
            if key in self._feedback or key in self._status or key == self._events:
                news.more = True
            else:
                news.values.add(key)
        self._record(changes)
        news.came = self._tokens(changes.tokens)
        return news

    def _changes(self, key: str, sample: Sample, shown: Mapping[str, Enabled]) -> Change:
        """Takes a sample in; whether a permission may be another one by it than is shown. What says
        something else is not judged here: it will be, when all is looked at."""
        interlocks = self._interlocks.get(key, ())
        before = [self._said(one) for one in interlocks]
        self._guarded(key, sample, self._sample)
        if before != [self._said(one) for one in interlocks]:
            return "now"
        return self._change(key, shown)

    def _change(self, key: str, shown: Mapping[str, Enabled]) -> Change:
        now = time.monotonic()
        changes = [
            _change(interlock_verdict(one, self._robot, now), shown[one.id])
            for one in self._interlocks.get(key, ())
        ]
        return "now" if "now" in changes else "soon" if "soon" in changes else ""

    def _said(self, interlock: Interlock) -> bool:
        """Whether the last of a topic can be read, and permits."""
        reading = self._robot.reading(interlock.topic)
        if reading.status != "message":
            return False
        return permits(interlock, reading.value(interlock.field))

    def _record(self, changes: Changes) -> None:
        if self._recorder is not None:
            for key, sample in changes.kept:
                self._guarded(key, sample, self._recorder.record_sample)

    def _guarded(self, key: str, sample: Sample, take: Callable[[str, Sample], None]) -> None:
        try:
            take(key, sample)
        except Exception:
            self._log.exception("a sample of %s was not taken in whole", key)

    def _sample(self, key: str, sample: Sample) -> None:
        if key in self._feedback:
            self._actions.hear_feedback(self._feedback[key], sample)
        elif key in self._status:
            self._actions.hear_status(self._status[key], sample)
        else:
            if key == self._events:
                self._parameters.hear(sample)
            self._robot.update(key, sample)
            if self._confirmations.awaits(key):
                self._confirmations.hear(key, self._robot.reading_by_key(key))

    def read(self, key: str, reading: Reading, shown: Mapping[str, Enabled]) -> Change:
        """A message that took more than one turn is read: whether a permission may be another one by it
        than is shown."""
        self._confirmations.hear(key, reading)
        return self._change(key, shown)

    def _tokens(self, tokens: Mapping[str, Token]) -> bool:
        """Takes them in; whether there is a bridge where there was none."""
        if not tokens:
            return False
        came, now, robot = False, time.monotonic(), self._robot
        had_bridge = bool(robot.graph.bridges)
        for key, token in tokens.items():
            if not robot.graph.is_relevant(key):
                continue
            self._publisher(key, token)
            if token.lost_seq:
                self._parameters.lose(key)
            if token.lost_seq and (zid := robot.graph.apply_token(key, False)):
                robot.mark_bridge_lost(zid, token.lost_seq)
                self._log.warning("bridge %s lost", zid)
                had_bridge = had_bridge and bool(robot.graph.bridges)
            if token.lost_seq and token.alive:
                robot.update_publishers(token.lost_seq)  # gone, be it for a moment
            if token.alive and (zid := robot.graph.apply_token(key, True, now)):
                self._log.info("bridge %s found", zid)
                came = True
        return came and not had_bridge

    def _publisher(self, key: str, token: Token) -> None:
        """Whether a publisher has appeared, be it for a moment: until it says something, nobody knows
        what it permits."""
        graph, silent = self._robot.graph, self._robot.silent_publishers
        endpoint = bridge_dialect.parsed(key)
        if endpoint is None or endpoint.zid == graph.own_zid:
            return
        if token.came_seq and (token.lost_before or not graph.has_token(key)):  # else it is told twice
            silent.add_publisher(endpoint, token.came_seq, token.came_at, token.lost_before)
        if token.lost_seq:
            silent.remove_publisher(endpoint, token.lost_seq)


def _change(verdict: Verdict, shown: Enabled) -> Change:
    """A reason with the robot's value in it may change as often as a readout, and waits as one."""
    if enabled(verdict) == shown:
        return ""
    return "soon" if verdict.code == "unmet" and not shown["enabled"] else "now"

"""What the link brought since the last turn, handed to who needs it: samples first, then tokens."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace

from app import keys
from app.actions import Actions
from app.confirmations import Confirmations
from app.link import Changes, Token
from app.logs import RobotLog
from app.panel.model import Panel
from app.panel.parameter import EVENTS
from app.parameters import Parameters
from app.recording import Recorder
from app.robot import Robot, Sample


class Intake:
    """Of one robot; on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        robot: Robot,
        actions: Actions,
        confirmations: Confirmations,
        parameters: Parameters,
        recorder: Recorder | None,
        log: RobotLog,
    ) -> None:
        self._robot = robot
        self._actions = actions
        self._confirmations = confirmations
        self._parameters = parameters
        self._recorder = recorder
        self._log = log
        goals = {robot.key(one): one for one in panel.actions()}
        self._feedback = {keys.feedback(key): one for key, one in goals.items()}
        self._status = {keys.status(key): one for key, one in goals.items()}
        self._urgent = {robot.key(i.topic) for i in panel.interlocks}
        self._events = robot.key(EVENTS)
        # What is judged by them is judged by each value that they had, however short.
        self.watched = self._urgent | {robot.key(one.topic) for one in panel.confirms()}
        topics = map(robot.key, panel.subscriptions())
        self.keys = [*topics, *self._feedback, *self._status]  # all that is listened to

    def take(self, changes: Changes, show: Callable[[], None]) -> tuple[bool, bool]:
        """Takes it in; whether it is urgent (permissions, the graph), and whether there is a bridge
        where there was none. `show` is called at each value that a permission had in between."""
        urgent = bool(changes.tokens) or not self._urgent.isdisjoint(changes.samples)
        had_bridge = bool(self._robot.graph.bridges)
        # What permits and forbids comes first, and nothing that fails keeps it from being taken in.
        ordered = sorted(changes.samples.items(), key=lambda one: one[0] not in self._urgent)
        for key, sample in ordered:
            for payload in sample.between:
                self._guarded(key, replace(sample, payload=payload, between=()))
                if key in self._urgent:
                    show()
            self._guarded(key, sample)
        return urgent, self._tokens(changes.tokens, had_bridge)

    def _guarded(self, key: str, sample: Sample) -> None:
        try:
            self._sample(key, sample)
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
            self._robot.take(key, sample)
            self._confirmations.hear(key)
            if self._recorder is not None:
                self._recorder.hear(key, sample)

    def _tokens(self, tokens: Mapping[str, Token], had_bridge: bool) -> bool:
        came, now, graph = False, time.monotonic(), self._robot.graph
        for key, token in tokens.items():
            if token.lost_seq:
                self._parameters.lose(key)
            if token.lost_seq and (zid := graph.apply(key, False)):
                self._robot.cut(zid, token.lost_seq)
                self._log.warning("bridge %s lost", zid)
                had_bridge = had_bridge and bool(graph.bridges)
            if token.alive and (zid := graph.apply(key, True, now)):
                self._log.info("bridge %s found", zid)
                came = True
        return came and not had_bridge

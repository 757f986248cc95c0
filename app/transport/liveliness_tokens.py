"""The liveliness tokens that the panel server holds for its panel, by what the graph shows.

Who creates a route first fixes its type and QoS for all: a topic whose type differs gets no token, and
what the panel listens to gets one when its publisher is first seen, with that publisher's durability.
Held from the start, it would make a VOLATILE reader, which misses what a TRANSIENT_LOCAL publisher said
before they met. Where the panel gives a durability, the token has it and is held from the start. It
stays when the publisher goes: a route that ends and begins again delivers each sample twice (#700).
"""

import logging
from collections.abc import Iterator
from dataclasses import replace

from app.dialect.endpoint import OwnEndpoint, TopicRole
from app.interfaces import Interfaces
from app.interfaces.names import ROSOUT, ROSOUT_TOPIC, Qos
from app.panel.model import Panel
from app.robot.state import RobotState
from app.ros_logging import RobotLog
from app.transport.rosout import LOG_TYPE

log = logging.getLogger("kiosk.tokens")


class LivelinessTokens:
    """The tokens of one robot's panel, from a join to the next."""

    def __init__(self, panel: Panel, interfaces: Interfaces, robot: RobotState) -> None:
        self._panel = panel
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._wrongly_held: set[str] = set()
        self._reported: set[tuple[str, str]] = set()
        self._listened: set[str] = set()  # keys of subscriptions whose token was held
        self._held_as: dict[str, bool] = {}  # key → whether its token is TRANSIENT_LOCAL

    def forget(self) -> None:
        """What was held is held no more."""
        self._held_as.clear()
        self._listened.clear()

    def wanted(self, zid: str) -> list[str]:
        """The tokens of all topics, but for those whose type is another one on the robot."""
        wanted: list[tuple[TopicRole, str, str, Qos]] = [
            *(("MP", t, n, self._qos(t)) for t, n in self._panel.publications().items()),
            *(
                ("MS", topic, name, qos)
                for topic, name in self._listened_to()
                if (qos := self._listening(topic)) is not None
            ),
            ("MP", ROSOUT_TOPIC, LOG_TYPE, ROSOUT),
        ]
        own = []
        for role, topic, type_name, qos in wanted:
            key = self._robot.key(topic)
            if found := self._robot.graph.mismatched_type(role, key, type_name):
                if (topic, found) not in self._reported:
                    self._reported.add((topic, found))
                    self._log.error("%s is %s on the robot, %s in the panel", topic, found, type_name)
                continue
            type_hash = self._interfaces.type_hash(type_name)
            own.append(OwnEndpoint(role, key, type_name, qos, type_hash))
        for action, type_name in self._panel.actions().items():
            own.append(OwnEndpoint("AC", self._robot.key(action), type_name))
        return self._robot.dialect.own_tokens(zid, own)

    def _listened_to(self) -> Iterator[tuple[str, str]]:
        """(topic, type) of what the panel listens to now."""
        yield from self._panel.subscriptions().items()
        for topic, name in self._panel.on_demand().items():
            if self._robot.key(topic) in self._robot.camera_topics:
                yield topic, name

    def _qos(self, topic: str) -> Qos:
        return self._panel.qos(topic).wire_qos

    def _listening(self, topic: str) -> Qos | None:
        """The QoS of a subscription's token: the panel's, with the publisher's durability where the
        panel gives none; None for no token yet.

        A route that a publisher made with a QoS that is not the panel's ends with that publisher, if
        no token keeps it: so one that is not held yet waits for that.
        """
        key, qos = self._robot.key(topic), self._qos(topic)
        if self._panel.qos(topic).durability is None:
            latched = self._latched(key)
            if latched is None:
                return None
            qos = replace(qos, transient_local=latched)
        if key not in self._listened and self._robot.graph.mismatched_qos("MS", key, qos):
            return None
        self._listened.add(key)
        return qos

    def _latched(self, key: str) -> bool | None:
        """The durability that the token of a subscription is to have; None for no token yet.

        If a publisher came with another one, its route is the wrong one for as long as that
        publisher lives: the token goes with it, and the next publisher decides.
        """
        now = self._robot.graph.is_transient_local(key)
        if now is None and key in self._wrongly_held:
            self._wrongly_held.discard(key)
            self._held_as.pop(key, None)
        elif now is not None and self._held_as.setdefault(key, now) != now:
            self._wrongly_held.add(key)
        return self._held_as.get(key)

"""The liveliness tokens that the panel server holds for its panel, by what the graph shows.

The first to create a route of the bridge fixes its type and QoS for all. So a topic with another type
on the robot gets no token. A subscription gets one when its publisher is first seen, with that
publisher's durability: held from the start, the token would make a VOLATILE reader, which misses the
earlier messages of a TRANSIENT_LOCAL publisher. A topic that is only shown takes its publisher's
reliability too: a reader that asks for reliable gets nothing of a best-effort publisher. If the panel
file gives a durability, the token has it and is held from the start. It stays when the publisher ends:
a route that ends and begins again delivers each sample twice (#700).
"""

import logging
from collections.abc import Callable, Iterator

from app.dialect.endpoint import OwnEndpoint, TopicRole
from app.interfaces import Interfaces
from app.interfaces.names import ROSOUT, ROSOUT_TOPIC, Qos
from app.panel.model import Panel
from app.robot.state import RobotState
from app.ros_logging import RobotLog
from app.transport.rosout import LOG_TYPE

log = logging.getLogger("kiosk.tokens")


class LivelinessTokens:
    """The tokens of one robot's panel, from one join to the next."""

    def __init__(self, panel: Panel, interfaces: Interfaces, robot: RobotState) -> None:
        self._panel = panel
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._reported: set[tuple[str, str]] = set()
        self._subscribed: set[str] = set()  # keys of subscriptions whose token was held
        self._durabilities = FromPublisher(lambda held, offered: held == offered)
        # A best-effort reader takes what is published as reliable.
        self._reliabilities = FromPublisher(lambda held, offered: offered or not held)

    def forget(self) -> None:
        """Call it when the tokens have ended."""
        self._durabilities.forget()
        self._reliabilities.forget()
        self._robot.reliable_readers.clear()
        self._subscribed.clear()

    def wanted(self, zid: str) -> list[str]:
        """The tokens of all topics and actions, except topics with another type on the robot."""
        wanted: list[tuple[TopicRole, str, str, Qos]] = [
            *(("MP", t, n, self._qos(t)) for t, n in self._panel.publications().items()),
            *(
                ("MS", topic, name, qos)
                for topic, name in self._subscriptions()
                if (qos := self._subscription_qos(topic)) is not None
            ),
            ("MP", ROSOUT_TOPIC, LOG_TYPE, ROSOUT),
        ]
        own = []
        for role, topic, type_name, qos in wanted:
            key = self._robot.key(topic)
            if robot_type := self._robot.graph.mismatched_type(role, key, type_name):
                if (topic, robot_type) not in self._reported:
                    self._reported.add((topic, robot_type))
                    self._log.error(
                        "%s is %s on the robot, %s in the panel", topic, robot_type, type_name
                    )
                continue
            type_hash = self._interfaces.type_hash(type_name)
            own.append(OwnEndpoint(role, key, type_name, qos, type_hash))
        for action, type_name in self._panel.actions().items():
            own.append(OwnEndpoint("AC", self._robot.key(action), type_name))
        return self._robot.dialect.own_tokens(zid, own)

    def _subscriptions(self) -> Iterator[tuple[str, str]]:
        """(topic, type) of each topic that the panel subscribes to now."""
        yield from self._panel.subscriptions().items()
        for topic, name in self._panel.on_demand().items():
            if self._robot.key(topic) in self._robot.camera_topics:
                yield topic, name

    def _qos(self, topic: str) -> Qos:
        return self._panel.qos(topic).wire_qos

    def _subscription_qos(self, topic: str) -> Qos | None:
        """The QoS of a subscription's token: the panel's, with what it takes from the publisher; None
        for no token yet.

        A route that a publisher created with another QoS than the panel's ends with that publisher, if
        no token keeps it. So a token that is not held yet waits for that.
        """
        key, qos = self._robot.key(topic), self._qos(topic)
        if self._panel.qos(topic).durability is None:
            offered = self._robot.graph.is_transient_local(key)
            transient_local = self._durabilities.held(key, offered)
            if transient_local is None:
                return None
            qos = qos._replace(transient_local=transient_local)
        if topic in self._panel.adaptive_topics:
            reliable = self._reliability(key)
            if reliable is None:
                return None
            qos = qos._replace(reliable=reliable)
        if key not in self._subscribed and self._robot.graph.mismatched_qos("MS", key, qos):
            return None
        self._subscribed.add(key)
        return qos

    def _reliability(self, key: str) -> bool | None:
        """Whether the token of a topic that is only shown is reliable; None for no token yet."""
        reliable = self._reliabilities.held(key, self._robot.graph.is_reliable(key))
        if reliable:
            self._robot.reliable_readers.add(key)
        else:
            self._robot.reliable_readers.discard(key)
        return reliable


class FromPublisher:
    """A QoS policy of tokens that is taken from a topic's publisher.

    If a publisher appears whose policy does not fit, its route is wrong while that publisher exists.
    The token ends with it, and the next publisher decides.
    """

    def __init__(self, fits: Callable[[bool, bool], bool]) -> None:
        """`fits(held, offered)`: whether a token with `held` gets what is published with `offered`."""
        self._fits = fits
        self._held: dict[str, bool] = {}  # by key
        self._wrong: set[str] = set()

    def held(self, key: str, offered: bool | None) -> bool | None:
        """The policy of the token of a topic; None for no token yet. `offered` is that of its
        publishers, None without one."""
        if offered is None and key in self._wrong:
            self._wrong.discard(key)
            self._held.pop(key, None)
        elif offered is not None and not self._fits(self._held.setdefault(key, offered), offered):
            self._wrong.add(key)
        return self._held.get(key)

    def forget(self) -> None:
        self._held.clear()
        self._wrong.clear()

"""The topics and services that a panel uses of a robot: declarations of the Zenoh session, and
liveliness tokens."""

import logging
from collections.abc import Callable, Iterator
from typing import Final

from app.cell.link.rosout import LOG_TYPE
from app.cell.robot.clocks import CLOCK, CLOCK_TYPE
from app.cell.robot.state import RobotState
from app.panel.model import Panel
from app.panel.widgets.hold import HoldCommand
from app.ros.dialects.dialect import PanelEndpoint, TopicRole
from app.ros.messages import Interfaces
from app.ros.messages.names import ROSOUT, ROSOUT_TOPIC, Qos, feedback, of_action, status
from app.ros.zenoh.declarations import Declarations
from app.system.log import RobotLog

# The topics and services of one robot that a panel uses, as declarations of its Zenoh session.

Named = Iterator[tuple[str, str]]  # (key, type)


def declarations(panel: Panel, interfaces: Interfaces, robot: RobotState) -> Declarations:
    """The topics and services of one robot that a panel uses."""
    topic, service = robot.dialect.topic, robot.dialect.service
    return Declarations(
        subscribe={key: topic(key, name) for key, name in _subscribed(panel, interfaces, robot)},
        publish={key: topic(key, name) for key, name in _published(panel, robot)},
        query={key: service(key, name) for key, name in _queried(panel, interfaces, robot)},
        latched=dict(_latched(panel, robot)),
    )


def _subscribed(panel: Panel, interfaces: Interfaces, robot: RobotState) -> Named:
    for topic, name in panel.subscriptions().items():
        yield from ((key, name) for key in robot.possible_keys(topic))
    for action, name in panel.actions().items():
        types = interfaces.action_types(name)
        yield feedback(robot.key(action)), types.feedback_message
        yield status(robot.key(action)), types.status


def _published(panel: Panel, robot: RobotState) -> Named:
    for topic, name in {**panel.publications(), ROSOUT_TOPIC: LOG_TYPE}.items():
        yield from ((key, name) for key in robot.possible_keys(topic))


def _latched(panel: Panel, robot: RobotState) -> Iterator[tuple[str, int]]:
    """(key, messages that are kept). Not of holds: a subscriber that comes late must not begin to move.
    Of a command the last one only."""
    held = {w.topic for w in panel.widgets() if isinstance(w, HoldCommand)}
    for topic in panel.publications():
        if topic not in held and panel.qos(topic).wire_qos.transient_local:
            yield robot.key(topic), 1
    if robot.dialect.keeps_log:
        yield robot.key(ROSOUT_TOPIC), ROSOUT.depth


def _queried(panel: Panel, interfaces: Interfaces, robot: RobotState) -> Named:
    for service, name in panel.services().items():
        yield robot.key(service), name
    for action, name in panel.actions().items():
        types, key = interfaces.action_types(name), robot.key(action)
        yield of_action(key, "send_goal"), types.send_goal
        yield of_action(key, "cancel_goal"), types.cancel_goal
        yield of_action(key, "get_result"), types.get_result


# The liveliness tokens that the panel server holds for its panel, by what the graph shows.
#
# The first to create a route of the bridge fixes its type and QoS for all. So a topic with another type
# on the robot gets no token. A subscription gets one when its publisher is first seen, with that
# publisher's durability: held from the start, the token would make a VOLATILE reader, which misses the
# earlier messages of a TRANSIENT_LOCAL publisher. A topic that is only shown takes its publisher's
# reliability too: a reader that asks for reliable gets nothing of a best-effort publisher. If the panel
# file gives a durability, the token has it and is held from the start. It stays when the publisher
# ends: a route that ends and begins again delivers each sample twice (#700).

log = logging.getLogger("kiosk.tokens")

CLOCK_QOS: Final = Qos(reliable=False, depth=1)  # rclcpp's ClockQoS: it reads what any publisher offers


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

    def own_tokens(self, zid: str) -> list[str]:
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
        if self._robot.clock.simulated is not None and CLOCK not in self._panel.listened():
            wanted.append(("MS", CLOCK, CLOCK_TYPE, CLOCK_QOS))
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
            own.append(PanelEndpoint(role, key, type_name, qos, type_hash))
        for action, type_name in self._panel.actions().items():
            own.append(PanelEndpoint("AC", self._robot.key(action), type_name))
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
            transient_local = self._durabilities.policy(key, offered)
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
        reliable = self._reliabilities.policy(key, self._robot.graph.is_reliable(key))
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
        self._policies: dict[str, bool] = {}  # by key
        self._wrong: set[str] = set()

    def policy(self, key: str, offered: bool | None) -> bool | None:
        """The policy of the token of a topic; None for no token yet. `offered` is that of its
        publishers, None without one."""
        if offered is None and key in self._wrong:
            self._wrong.discard(key)
            self._policies.pop(key, None)
        elif offered is not None and not self._fits(self._policies.setdefault(key, offered), offered):
            self._wrong.add(key)
        return self._policies.get(key)

    def forget(self) -> None:
        self._policies.clear()
        self._wrong.clear()

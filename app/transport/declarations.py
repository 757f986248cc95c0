"""What a session subscribes to, publishes and queries: the panel's keys → Zenoh key expressions."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from app.interfaces import Interfaces
from app.interfaces.names import ROSOUT, ROSOUT_TOPIC, feedback, of_action, status
from app.panel.model import Panel
from app.panel.widgets.hold import HoldCommand
from app.panel.widgets.parameter import DESCRIBE, GET, SET
from app.panel.widgets.service_action import Call
from app.robot.state import RobotState
from app.transport.inbox import NO_KEYS
from app.transport.rosout import LOG_TYPE

Named = Iterator[tuple[str, str]]  # (key, type)


@dataclass(frozen=True, slots=True, kw_only=True)
class Declarations:
    """Key → key expression of each topic that is subscribed to or published, and of each service that
    is queried. `latched` are the published ones that keep their last messages, with how many.
    `immediate`, `lossless` and `recorded` are the keys of topics for `Inbox.expect`."""

    subscribe: Mapping[str, str] = field(default_factory=dict)
    publish: Mapping[str, str] = field(default_factory=dict)
    query: Mapping[str, str] = field(default_factory=dict)
    latched: Mapping[str, int] = field(default_factory=dict)
    immediate: Collection[str] = NO_KEYS
    lossless: Collection[str] = NO_KEYS
    recorded: Collection[str] = NO_KEYS


NOTHING: Final = Declarations()


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
    for widget in panel.senders():
        if isinstance(widget, Call):
            yield robot.key(widget.service), widget.type
    for action, name in panel.actions().items():
        types, key = interfaces.action_types(name), robot.key(action)
        yield of_action(key, "send_goal"), types.send_goal
        yield of_action(key, "cancel_goal"), types.cancel_goal
        yield of_action(key, "get_result"), types.get_result
    for node in {widget.node for widget in panel.parameters()}:
        for service, name in (GET, DESCRIBE, SET):
            yield robot.key(f"{node}/{service}"), name

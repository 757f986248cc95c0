"""Whether a robot's bridges forward a topic, service or action that its nodes have. Pure.

"denied": the `allow` or `deny` of the bridge's file holds it back. "lost": the file lets it through,
and the bridge does not announce it all the same. It may be new: a bridge knows a name some time before
it announces it. If it stays so, the bridge has lost it: this happens about 20 s after a node was killed
and restarted at once (its issue 702).
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, Literal

from app.survey.model import Bridge, Node, RobotGraph, SurveyedTopic

Forwarding = Literal["forwarded", "denied", "lost"]
# The lists of a bridge's `allow` and `deny`.
TopicList = Literal["publishers", "subscribers"]
ServerList = Literal["service_servers", "action_servers"]
BOTH: Final[tuple[TopicList, ...]] = ("publishers", "subscribers")
MOST_PATTERN: Final = 100_000  # characters
MOST_REPEATS: Final = 3  # in one alternative
_REPEAT: Final = re.compile(r"[*+{]")
_REPEATED: Final = re.compile(r"\)[*+{]")  # of a group
OF_ACTIONS: Final = "/_action/"  # the services that an action is made of


def topic_forwarding(
    robot: RobotGraph, topic: SurveyedTopic, lists: Sequence[TopicList] = BOTH
) -> Forwarding:
    """Of a topic's publishers, its subscribers, or both."""
    if topic.announced:
        return "forwarded"
    ends = {"publishers": topic.publishers, "subscribers": topic.subscribers}
    held = [_is_denied(robot, end.bridge, key, topic.name) for key in lists for end in ends[key]]
    return "denied" if all(held) else "lost"


def server_forwarding(robot: RobotGraph, kind: ServerList, name: str) -> Forwarding | None:
    """Of a service or an action; None if no node offers it."""
    servers = robot.services if kind == "service_servers" else robot.actions
    if any(server.name == name for server in servers):
        return "forwarded"
    held = [_is_denied(robot, n.bridge, kind, name) for n in robot.nodes if name in _offers(n, kind)]
    return ("denied" if all(held) else "lost") if held else None


def lost_topics(robot: RobotGraph) -> Iterator[SurveyedTopic]:
    """The topics that the bridge has lost."""
    return (topic for topic in robot.topics if topic_forwarding(robot, topic) == "lost")


def lost_servers(robot: RobotGraph) -> Iterator[str]:
    """The names of the services and actions that the bridge has lost, each once."""
    kinds: tuple[ServerList, ...] = ("service_servers", "action_servers")
    names = {
        (kind, name): None for node in robot.nodes for kind in kinds for name in _offers(node, kind)
    }
    for kind, name in sorted(names):
        if OF_ACTIONS not in name and server_forwarding(robot, kind, name) == "lost":
            yield name


def _offers(node: Node, kind: ServerList) -> tuple[str, ...]:
    return node.services if kind == "service_servers" else node.actions


def _is_denied(robot: RobotGraph, zid: str, kind: str, name: str) -> bool:
    return denies([bridge for bridge in robot.bridges if bridge.zid == zid], kind, name)


def denies(bridges: Sequence[Bridge], kind: str, name: str) -> bool:
    """Whether a bridge's file holds a name back: `kind` is "publishers", "service_servers" or another
    of its lists. The bridge gives each list as one regular expression."""
    return any(_denied(bridge.config, kind, name) for bridge in bridges)


def _denied(config: Mapping[str, Any], kind: str, name: str) -> bool:
    for key, is_denied in _lists(config):
        if not isinstance(key, dict):
            continue
        pattern = key.get(kind)
        listed = isinstance(pattern, str) and _matches(pattern, name)
        return listed if is_denied else not listed
    return False


def _lists(config: Mapping[str, Any]) -> Iterator[tuple[Any, bool]]:
    yield config.get("allow"), False
    yield config.get("deny"), True


def _matches(pattern: str, name: str) -> bool:
    if not _is_quick(pattern):
        return True
    try:
        return re.search(pattern, name) is not None
    except re.error:  # Rust knows some that Python does not: then it is not known
        return True


def _is_quick(pattern: str) -> bool:
    """Whether Python decides it in a short time: unlike Rust's, its expressions may take for ever. The
    others are not tried."""
    repeats = (len(_REPEAT.findall(alternative)) for alternative in pattern.split("|"))
    return (
        len(pattern) <= MOST_PATTERN and not _REPEATED.search(pattern) and max(repeats) <= MOST_REPEATS
    )

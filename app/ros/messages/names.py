"""ROS 2 names and QoS: the syntax of topics, namespaces and types."""

import re
from typing import Final, NamedTuple

# A liveliness token that the bridge can't parse ends its main loop while its process stays up. So a
# name that does not match these must never become a token.
TOPIC: Final = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
NAMESPACE: Final = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)*")
SERVICE_TYPE: Final = re.compile(r"[a-z][a-z0-9_]*/srv/[A-Z][A-Za-z0-9]*")
ACTION_TYPE: Final = re.compile(r"[a-z][a-z0-9_]*/action/[A-Z][A-Za-z0-9]*")
MESSAGE_TYPE: Final = re.compile(r"[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*")
# A name received from others that is malformed or longer is not used: it would be shown.
MAX_NAME: Final = 512  # ROS 2 has 255, and the bridge puts its namespace before that
NO_TYPE: Final = "(not a type)"
_ANY_TYPE = re.compile(r"[A-Za-z0-9_]+(/[A-Za-z0-9_]+)*")


class Qos(NamedTuple):
    """A topic's QoS; `depth` is that of KEEP_LAST."""

    reliable: bool = True
    transient_local: bool = False
    depth: int = 10


ROSOUT_TOPIC: Final = "/rosout"
PARAMETER_EVENTS: Final = "/parameter_events"
# Nodes publish these by their absolute names, in whatever namespace they are. A bridge's own namespace
# stands before them, as before every name.
SHARED_TOPICS: Final = (ROSOUT_TOPIC, PARAMETER_EVENTS)
GLOBAL: Final = "//"  # begins a name that is not below the panel's namespace
ROSOUT: Final = Qos(transient_local=True, depth=1000)  # rmw_qos_profile_rosout_default


def key_of(topic: str, namespace: str = "") -> str:
    """The key of a topic or service: its whole name behind `namespace` ("" for none), without the first
    slash. A name that begins with "//" is not below the namespace. By its key the panel knows it,
    whatever key expression it has in Zenoh."""
    whole = topic[1:] if topic.startswith(GLOBAL) else namespace + topic
    if not TOPIC.fullmatch(whole):
        raise ValueError(f'"{whole}" is not an absolute ROS 2 topic name')
    return whole[1:]


def possible_keys(topic: str, namespace: str) -> tuple[str, ...]:
    """The keys that a topic can have: one, or of a shared topic one for each namespace that a bridge of
    this robot can have, the longest first."""
    if topic not in SHARED_TOPICS:
        return (key_of(topic, namespace),)
    parts = namespace.split("/")
    return tuple(key_of(topic, "/".join(parts[:count])) for count in range(len(parts), 0, -1))


def of_action(action_key: str, part: str) -> str:
    """The key of a topic or service of an action (design.ros2.org, "Actions")."""
    return f"{action_key}/_action/{part}"


def feedback(action_key: str) -> str:
    """The key of an action's feedback."""
    return of_action(action_key, "feedback")


def status(action_key: str) -> str:
    """The key of the states of an action's goals."""
    return of_action(action_key, "status")


def valid_type(name: str) -> str:
    """The type that someone names; `NO_TYPE`, which no panel is made for, where that can't be one."""
    return name if len(name) <= MAX_NAME and _ANY_TYPE.fullmatch(name) else NO_TYPE


def is_valid_name(name: str) -> bool:
    """Whether a name without its leading slash is a valid ROS 2 name."""
    return len(name) <= MAX_NAME and TOPIC.fullmatch(f"/{name}") is not None

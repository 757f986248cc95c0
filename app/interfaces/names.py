"""ROS 2 names and QoS: the syntax of topics, namespaces and types."""

import re
from dataclasses import dataclass
from typing import Final

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


@dataclass(frozen=True, slots=True)
class Qos:
    """A topic's QoS; `depth` is that of KEEP_LAST."""

    reliable: bool = True
    transient_local: bool = False
    depth: int = 10


ROSOUT_TOPIC: Final = "/rosout"
ROSOUT: Final = Qos(transient_local=True, depth=1000)  # rmw_qos_profile_rosout_default


def valid_type(name: str) -> str:
    """A received type name, or `NO_TYPE` if it is malformed. `NO_TYPE` equals no type of a panel."""
    return name if len(name) <= MAX_NAME and _ANY_TYPE.fullmatch(name) else NO_TYPE


def is_valid_name(name: str) -> bool:
    """Whether a name without its leading slash is a valid ROS 2 name."""
    return len(name) <= MAX_NAME and TOPIC.fullmatch(f"/{name}") is not None

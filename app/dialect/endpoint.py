"""Endpoints of the ROS graph: publishers, subscribers, servers of a robot or of the panel."""

from dataclasses import dataclass, field
from typing import Final, Literal

from app.interfaces.names import Qos

TopicRole = Literal["MP", "MS"]  # a publisher, a subscriber
ServerRole = Literal["SS", "AS"]  # a service's server, an action's
Role = TopicRole | ServerRole
OwnRole = TopicRole | Literal["AC"]  # of the panel: an action's client, too
Direction = Literal["pub", "sub"]  # of a bridge's route: from ROS to Zenoh, from Zenoh to ROS

DEMO_VERSION: Final = '"demo robot"'  # how the demo robot answers for its version


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A publisher, subscriber or server, of a token or of a node. The role None means the peer that the
    robot is reached by. `reliable` is None if it is not known, `node` and `dds` are "".

    `hashes` are (message type, type hash) of the messages that it exchanges, as far as they are known:
    one of a topic, those of its requests and responses of a server.
    """

    zid: str
    role: Role | None = None
    key: str = ""
    type: str = ""
    transient_local: bool = False
    reliable: bool | None = None
    hashes: tuple[tuple[str, str], ...] = ()
    node: str = ""
    dds: str = ""


@dataclass(frozen=True, slots=True)
class OwnEndpoint:
    """A publisher, subscriber or action client of the panel in the ROS graph. An action client has
    neither QoS nor hash."""

    role: OwnRole
    key: str
    type: str
    qos: Qos = field(default_factory=Qos)
    type_hash: str = ""


def within(namespace: str, outer: str) -> bool:
    """Whether a bridge with the namespace `outer` can have topics of `namespace`."""
    return f"{namespace}/".startswith(f"{outer}/")

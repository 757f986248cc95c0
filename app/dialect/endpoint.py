"""Endpoints of the ROS graph: publishers, subscribers, servers of a robot or of the panel."""

from dataclasses import dataclass, field
from typing import Final, Literal

from app.interfaces.names import Qos

TopicRole = Literal["MP", "MS"]  # a publisher, a subscriber
ServerRole = Literal["SS", "AS"]  # a service's server, an action's
Role = TopicRole | ServerRole
# Of the panel and of the simulated robot: clients of services and actions, and servers, too.
OwnRole = TopicRole | ServerRole | Literal["SC", "AC"]
Direction = Literal["pub", "sub"]  # of a bridge's route: from ROS to Zenoh, from Zenoh to ROS

DEMO_VERSION: Final = '"demo robot"'  # how the demo robot answers for its version
DEMO_NODE: Final = "/operator_panel_demo_robot"  # a node of the demo robot without a bridge


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A publisher, subscriber or server, of a token or of a node. The role None means the peer that the
    robot is reached by: a bridge, or a Zenoh session of nodes. `reliable` is None if it is not known,
    `node` and `dds` are "".

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
    """A publisher, a subscriber, a client or a server in the ROS graph. Clients and servers have
    neither QoS nor hash."""

    role: OwnRole
    key: str
    type: str
    qos: Qos = field(default_factory=Qos)
    type_hash: str = ""


def within(namespace: str, outer: str) -> bool:
    """Whether a bridge with the namespace `outer` can have topics of `namespace`."""
    return f"{namespace}/".startswith(f"{outer}/")

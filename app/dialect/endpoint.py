"""A publisher, subscriber or server of a robot, as the graph knows it."""

from dataclasses import dataclass
from typing import Literal

TopicRole = Literal["MP", "MS"]  # a publisher, a subscriber
ServerRole = Literal["SS", "AS"]  # a service's server, an action's
Role = TopicRole | ServerRole
Direction = Literal["pub", "sub"]  # of a bridge's route: from ROS to Zenoh, from Zenoh to ROS


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A publisher, subscriber or server that a token shows; `role` is None for the bridge's own
    token, and `reliable` where the token does not say."""

    zid: str
    role: Role | None = None
    key: str = ""
    type: str = ""
    transient_local: bool = False
    reliable: bool | None = None


def within(namespace: str, outer: str) -> bool:
    """Whether a bridge with the namespace `outer` can have topics of `namespace`."""
    return f"{namespace}/".startswith(f"{outer}/")

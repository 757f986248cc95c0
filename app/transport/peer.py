"""The protocol of the peer that a robot is reached by: a bridge, or the robot's own nodes."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol

from app.dialect.dialect import Dialect, DialectName, TypeHash
from app.dialect.peer_traits import PeerTraits
from app.interfaces import Interfaces
from app.panel.model import Panel
from app.robot.state import RobotState
from app.survey.model import GraphSnapshot
from app.transport.admin_space import GraphLink
from app.transport.robot_signals import RobotSignals
from app.transport.zenoh_config import Config
from app.transport.zenoh_session import ZenohSession


class Peer(Protocol):
    """Whether the peer that a robot is reached by exists, responds and is ready. It sets the robot's
    `settled_at`, `is_responding` and `is_caught_up`, by which permission is judged. Used on the event
    loop only."""

    def start(self) -> None:
        """Begins to join and query it. Call it once the session has declared everything."""

    async def stop(self) -> None:
        """Ends its tasks. Waits for the replies that callers of `flushed` wait for."""

    def appeared(self, zids: Iterable[str]) -> None:
        """The liveliness tokens of these peers appeared."""

    def lost(self, zids: Iterable[str]) -> None:
        """The liveliness tokens of these peers were lost."""

    def on_graph_change(self, peer_appeared: bool) -> None:
        """Joins the ROS graph, updates its tokens, or leaves. `peer_appeared`: there was no peer
        before."""

    def check_stall(self) -> None:
        """Call it before data is ingested: sets `is_caught_up` to false if the event loop stalled, as
        more data may be on its way."""

    async def flushed(self) -> bool:
        """Whether everything sent so far has reached it."""

    async def answers(self) -> bool:
        """Whether it answers a query now. Takes a second at most."""


class Observe(Protocol):
    """Reads what is on the robots of a link, without a panel: nodes, topics, services and actions with
    their types. What only this kind of peer has, such as bridges and their routes, is in fields that
    are empty otherwise."""

    async def __call__(
        self, link: GraphLink, zid: str, earlier: GraphSnapshot | None = None
    ) -> GraphSnapshot:
        """The graph now; `zid` is that of the link's session. Waits, for some seconds at most, until a
        robot is there; with an `earlier` graph, until the peers that were in it have answered again.
        Empty without a robot. LinkError without a link."""


class KindsThere(Protocol):
    """Finds out which kinds of peers a configuration leads to now."""

    async def __call__(self, config: Config, domain: int) -> frozenset[DialectName]:
        """Takes a second at most; empty if nothing answers."""


@dataclass(frozen=True)
class RobotContext:
    """One robot of a panel, the link to it, what its parts signal to each other, and the configuration
    of the link."""

    panel: Panel
    interfaces: Interfaces
    robot: RobotState
    link: ZenohSession
    signals: RobotSignals
    config: Config
    # Of robots with interlocks that widgets of this one name: their data counts for a press too.
    awaited: list[ZenohSession] = field(default_factory=list)

    def another_session(self) -> ZenohSession:
        """A further session with the robot. Its data waits until it is drained."""
        return ZenohSession(self.config, lambda _: None, self.robot.dialect)


@dataclass(frozen=True, slots=True)
class RobotAccess:
    """How a kind of robot is reached: `dialect` makes the dialect for a ROS domain and the type hashes
    of a panel or of a command, `peer` the peer of one robot of a panel. `kinds` is for commands, where
    what is there decides how it is reached."""

    dialect: Callable[[int, TypeHash], Dialect]
    traits: PeerTraits
    peer: Callable[[RobotContext], Peer]
    observe: Observe
    kinds: KindsThere | None = None

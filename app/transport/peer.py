"""The seam between the panel and what stands before a robot: a bridge, or the robot's own nodes."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

from app.dialect.dialect import Dialect
from app.interfaces import Interfaces
from app.panel.model import Panel
from app.robot.state import RobotState
from app.transport.zenoh_session import ZenohSession


class Peer(Protocol):
    """Whether the peer that a robot is reached by exists, responds and is ready. It sets the robot's
    `settled_at`, `is_responding` and `is_caught_up`, by which permission is judged. Used on the event
    loop only."""

    def start(self) -> None:
        """Begins to watch it, once the session has declared everything."""

    async def stop(self) -> None:
        """Ends its tasks; what was sent to the end gets the time for an answer."""

    def found(self, zids: Iterable[str]) -> None:
        """Peers have announced themselves, by their tokens."""

    def lost(self, zids: Iterable[str]) -> None:
        """Tokens of peers have ended."""

    def follow(self, came: bool) -> None:
        """After every change of the graph: joins it, or leaves. `came`: there is a peer where there was
        none."""

    def look(self) -> None:
        """Before anything that arrived is taken in: whether more may be on its way, as the event loop
        stalled."""

    async def flushed(self) -> bool:
        """Whether all that was sent until now has reached it."""

    async def answers(self) -> bool:
        """Whether it answers a query now: a second at most."""


@dataclass(frozen=True, slots=True)
class RobotContext:
    """One robot of a panel and the link to it. `changed` is called when something has changed that
    permits, forbids or is shown. `renew` opens a new session after the link was lost, `reopen` although
    it is there."""

    panel: Panel
    interfaces: Interfaces
    robot: RobotState
    link: ZenohSession
    changed: Callable[[], None]
    renew: Callable[[], None]
    reopen: Callable[[], None]


@dataclass(frozen=True, slots=True)
class RobotAccess:
    """How a kind of robot is reached."""

    dialect: Dialect
    peer: Callable[[RobotContext], Peer]

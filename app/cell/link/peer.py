"""The protocol of the peer that a robot is reached by, and the signals of a robot."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from typing import Generic, ParamSpec, Protocol

from app.cell.permission.control import HandOver
from app.cell.robot.state import RobotState
from app.cell.robot.topics import Reading
from app.panel.model import Panel
from app.ros.dialects.dialect import Dialect, DialectName, TypeHash
from app.ros.dialects.peer_traits import PeerTraits
from app.ros.graph.model import GraphSnapshot
from app.ros.messages import Interfaces
from app.ros.zenoh.answers import GraphLink
from app.ros.zenoh.config import Config
from app.ros.zenoh.session import ZenohSession

# What happens to one robot, as named signals: made before the parts that emit and receive them.

Values = ParamSpec("Values")


class Signal(Generic[Values]):
    """Calls its receivers in the order in which they were connected, on the thread of the caller."""

    def __init__(self) -> None:
        self._receivers: list[Callable[Values, None]] = []

    def connect(self, receiver: Callable[Values, None]) -> None:
        self._receivers.append(receiver)

    def emit(self, *values: Values.args, **named: Values.kwargs) -> None:
        for receiver in self._receivers:
            receiver(*values, **named)


class RobotSignals:
    """The signals of one robot's session. All but `arrived` are emitted on the event loop."""

    def __init__(self) -> None:
        # Data is in the inbox; `True`: a permission may depend on it. Emitted on Zenoh's threads.
        self.arrived = Signal[[bool]]()
        # A permission is about to be checked: it needs everything that has arrived.
        self.judging = Signal[[]]()
        # A step of a turn was ingested: messages on topics with these keys, or anything else (True).
        self.stepped = Signal[[Collection[str], bool]]()
        # A turn has run: a permission may have changed.
        self.ran = Signal[[]]()
        # Something that permission or the view depends on has changed, but no data has arrived.
        self.changed = Signal[[]]()
        # The status of a command was set, by the widget's id; nothing else has changed.
        self.status_set = Signal[[str]]()
        # The nodes of the robot's graph were read: what they are may be known now.
        self.graph_read = Signal[[]]()
        # A message (topic's key, reading) took more than one turn to decode.
        self.late_reading = Signal[[str, Reading]]()
        # Entries of tables that show the topic with this key were decoded.
        self.entries_decoded = Signal[[str]]()
        # The machine has stopped: what happened has a story (`app/cell/session/stops.py`).
        self.stopped = Signal[[]]()
        # Control changed without an act.
        self.handed_over = Signal[[HandOver]]()
        # The Zenoh session lost its link.
        self.link_lost = Signal[[]]()
        # The peer does not pass on a subscribed topic to this Zenoh session, but would to a new one.
        self.route_lost = Signal[[]]()


# The protocol of the peer that a robot is reached by: a bridge, or the robot's own nodes.


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

"""What happens to one robot, as named signals: made before the parts that emit and receive them."""

from collections.abc import Callable
from typing import Generic, ParamSpec

from app.permission.control_parties import HandOver
from app.robot.topics import Reading

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
        # A turn has run: a permission may have changed.
        self.ran = Signal[[]]()
        # Something that permission or the view depends on has changed, but no data has arrived.
        self.changed = Signal[[]]()
        # The nodes of the robot's graph were read: what they are may be known now.
        self.graph_read = Signal[[]]()
        # A message (topic's key, reading) took more than one turn to decode.
        self.late_reading = Signal[[str, Reading]]()
        # Entries of tables that show the topic with this key were decoded.
        self.entries_decoded = Signal[[str]]()
        # Control changed without an act.
        self.handed_over = Signal[[HandOver]]()
        # The Zenoh session lost its link.
        self.link_lost = Signal[[]]()
        # The peer does not pass on a subscribed topic to this Zenoh session, but would to a new one.
        self.route_lost = Signal[[]]()

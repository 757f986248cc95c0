"""One widget of the gallery in one state, and the tables and states that several kinds share."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from app.commands.receipts import Receipt
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.kinds import KINDS
from app.robot.command_status import OutcomeCode

Table = dict[str, Any]
Texts = dict[str, str]

NOTHING: Final[Table] = {}
NO_MARKS: Final[Texts] = {}


class Example(NamedTuple):
    """A widget in one state: its table without id, its part of the view (`shown`), what is entered, and
    outcome and sentence of its receipt. `marks` are parts of its HTML and what scripts make of them."""

    title: str
    kind: str
    table: Table
    shown: Table = NOTHING
    entered: Any = None
    receipt: tuple[OutcomeCode, str] | None = None
    marks: Texts = NO_MARKS

    def widget(self, number: int) -> BaseWidget:
        """Its description; `number` makes its id."""
        table = {"label": "Print label", **self.table, "kind": self.kind, "id": f"example_{number}"}
        return KINDS[self.kind].model_validate(table)

    def receipt_of(self, widget: BaseWidget) -> Receipt | None:
        """Its receipt, as the page has that of the last press."""
        if self.receipt is None:
            return None
        return Receipt("p1", widget.id, *self.receipt, "14:31:58", "", NOTHING, "")


class Part(NamedTuple):
    """A group of the gallery."""

    title: str
    columns: int
    examples: Sequence[Example]


TOPIC: Final[Table] = {"topic": "/operation", "type": "std_msgs/msg/String"}
PUBLISH: Final[Table] = TOPIC | {"message": {"data": "print"}}
CALL: Final[Table] = {"service": "/reset", "type": "std_srvs/srv/Trigger"}
HOLD: Final[Table] = TOPIC | {
    "label": "X+",
    "icon": "arrow-up",
    "note": "forward",
    "message": {"data": "forward"},
    "release": {"data": "stop"},
    "interlock": "automatic",
}
ACTION: Final[Table] = {
    "label": "Pallet out",
    "icon": "forklift",
    "action": "/count",
    "type": "example_interfaces/action/Fibonacci",
    "goal": {"order": 12},
    "progress": "sequence[0]",
}
FREE: Final[Table] = {"enabled": True, "reason": None}
LOCKED: Final[Table] = {"enabled": False, "reason": "Close guard door 1"}
LOCKED_BY_TWO: Final[Table] = LOCKED | {
    "reasons": "Close guard door 1\nSwitch to automatic operation",
    "more": "+ 1 more",
}
REST: Final[Table] = {
    "busy": False,
    "outcome": "",
    "result": "",
    "progress": None,
    "stoppable": False,
    "goal": "",
    "doing": "",
    "press": "",
}
CALLED: Final[Table] = FREE | REST
RUNS: Final[Table] = {
    "busy": True,
    "goal": "EXECUTING",
    "doing": "Running, 60 %",
    "stoppable": True,
    "result": "Conveyor C3",
}
LONG: Final = "Rejected by the robot at 14:31:58: the gripper still holds a box of the last layer"
PRESSED: Final[Texts] = {'type="submit"': 'type="submit" aria-busy="true"'}
ENABLED: Final[Texts] = {" disabled>": ">"}
REQUESTED: Final[Texts] = ENABLED | {'data-kind="hold"': 'data-kind="hold" data-hold="asked"'}
HELD: Final[Texts] = ENABLED | {'data-kind="hold"': 'data-kind="hold" data-hold="held"'}
LET_GO: Final[Table] = {"held": False, "holding": ""}
NOT_LIVE: Final[Texts] = {
    "waiting": "Nothing received on /door",
    "old": "2 min old",
    "unreadable": "/door is not std_msgs/msg/Bool",
    "missing": "No field data at 14:31:52",
}

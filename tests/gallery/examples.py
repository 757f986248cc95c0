"""One widget of the gallery in one state, and the tables and states that several kinds share."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from app.cell.commands.receipts import Receipt
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.kinds import KINDS
from app.records.entry import OutcomeCode
from app.system.texts import TextLike, joined, say, time_of_day
from tests.gallery import texts

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
    receipt: tuple[OutcomeCode, TextLike] | None = None
    marks: Texts = NO_MARKS

    def widget(self, number: int) -> BaseWidget:
        """Its description; `number` makes its id."""
        table = {"label": texts.PRINT.table, **self.table, "kind": self.kind, "id": f"example_{number}"}
        return KINDS[self.kind].model.model_validate(table)

    def receipt_of(self, widget: BaseWidget) -> Receipt | None:
        """Its receipt, as the page has that of the last press."""
        if self.receipt is None:
            return None
        return Receipt("p1", widget.id, *self.receipt, "14:31:58", "", NOTHING, "")


class Part(NamedTuple):
    """A group of the gallery. Its title and those of its examples are a developer's: in English."""

    title: str
    columns: int
    examples: Sequence[Example]


AT: Final = time_of_day("14:31:58")
BEFORE: Final = time_of_day("14:31:52")
TOPIC: Final[Table] = {"topic": "/operation", "type": "std_msgs/msg/String"}
PUBLISH: Final[Table] = TOPIC | {"message": {"data": "print"}}
CALL: Final[Table] = {"service": "/reset", "type": "std_srvs/srv/Trigger"}
HOLD: Final[Table] = TOPIC | {
    "label": "X+",
    "icon": "arrow-up",
    "note": texts.FORWARD.table,
    "message": {"data": "forward"},
    "release": {"data": "stop"},
    "interlock": "automatic",
}
ACTION: Final[Table] = {
    "label": texts.PALLET_OUT.table,
    "icon": "forklift",
    "action": "/count",
    "type": "example_interfaces/action/Fibonacci",
    "goal": {"order": 12},
    "progress": "sequence[0]",
}
FREE: Final[Table] = {"enabled": True, "reason": None}
LOCKED: Final[Table] = {"enabled": False, "reason": texts.CLOSE_DOOR.shown}
LOCKED_BY_TWO: Final[Table] = LOCKED | {
    "reasons": joined([texts.CLOSE_DOOR.shown, texts.TO_AUTOMATIC.shown], "between_lines"),
    "more": say("more_reasons", number=1),
}
REST: Final[Table] = {
    "busy": False,
    "outcome": "",
    "aged": False,
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
    "doing": say("goal_state_executing"),
    "stoppable": True,
    "result": texts.CONVEYOR.shown,
}
LONG: Final = say("with_reply", said=say("call_rejected", time=AT), reply=texts.STILL_GRIPS.shown)
REFUSED: Final[tuple[OutcomeCode, TextLike]] = (
    "refused",
    say("refused", time=AT, why=say("press_too_often")),
)
PRESSED: Final[Texts] = {'type="submit"': 'type="submit" aria-busy="true"'}
ENABLED: Final[Texts] = {" disabled>": ">"}
REQUESTED: Final[Texts] = ENABLED | {'data-kind="hold"': 'data-kind="hold" data-hold="asked"'}
HELD: Final[Texts] = ENABLED | {'data-kind="hold"': 'data-kind="hold" data-hold="held"'}
LET_GO: Final[Table] = {"held": False, "holding": ""}
OLD: Final = say("readout_old", age=say("age_minutes", number=2))
NOT_LIVE: Final[Mapping[str, TextLike]] = {
    "waiting": say("readout_waiting"),
    "old": OLD,
    "unreadable": say("readout_unreadable", topic="/door", wanted="std_msgs/msg/Bool"),
    "missing": say("readout_missing", field="data", time=BEFORE),
}

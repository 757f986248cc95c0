"""What the gallery shows: each kind of widget in each of its states, with attributes made by hand."""

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
    "press": "",
}
CALLED: Final[Table] = FREE | REST
RUNS: Final[Table] = {"busy": True, "goal": "EXECUTING", "stoppable": True, "result": "Conveyor C3"}
LONG: Final = "Rejected by the robot at 14:31:58: the gripper still holds a box of the last layer"
PRESSED: Final[Texts] = {'type="submit"': 'type="submit" aria-busy="true"'}
ENABLED: Final[Texts] = {" disabled>": ">"}
ASKED: Final[Texts] = ENABLED | {'data-kind="hold"': 'data-kind="hold" data-hold="asked"'}
HELD: Final[Texts] = ENABLED | {'data-kind="hold"': 'data-kind="hold" data-hold="held"'}
LET_GO: Final[Table] = {"held": False, "holding": ""}

ROLES: Final = (
    Example("start", "publish", PUBLISH | {"label": "Start", "role": "start"}, FREE),
    Example("stop", "publish", PUBLISH | {"label": "Stop", "role": "stop"}, FREE),
    Example("reset", "publish", PUBLISH | {"label": "Reset", "role": "reset"}, FREE),
    Example(
        "toggle", "publish", PUBLISH | {"label": "Light", "role": "toggle", "icon": "lightbulb"}, FREE
    ),
    Example("neutral", "publish", PUBLISH, FREE),
    Example("hold", "hold", HOLD, FREE | LET_GO, marks=ENABLED),
)
KEYS: Final = (
    Example("pressed", "publish", PUBLISH, FREE, marks=PRESSED),
    Example("answered", "publish", PUBLISH, FREE, receipt=("published", "Sent at 14:31:58")),
    Example("refused", "publish", PUBLISH, FREE, receipt=("refused", "Refused: no ribbon")),
    Example("locked", "publish", PUBLISH, LOCKED),
    Example("locked by several", "publish", PUBLISH | {"interlock": ["door", "auto"]}, LOCKED_BY_TWO),
    Example("locked, black", "publish", PUBLISH | {"label": "Stop", "role": "stop"}, LOCKED),
    Example("called", "call", CALL, CALLED | {"busy": True, "result": "Calling /reset"}, marks=PRESSED),
    Example("succeeded", "call", CALL, CALLED | {"outcome": "succeeded", "result": "Done 14:31:58"}),
    Example("rejected, long", "call", CALL, CALLED | {"outcome": "rejected", "result": LONG}),
    Example("hold asked", "hold", HOLD, FREE | LET_GO, marks=ASKED),
    Example("held", "hold", HOLD, FREE | {"held": True, "holding": "held 0.8 s"}, marks=HELD),
    Example("hold locked", "hold", HOLD, LOCKED | LET_GO),
)
ACTIONS: Final = (
    Example("free", "action", ACTION, CALLED),
    Example("runs", "action", ACTION, LOCKED | REST | RUNS | {"progress": 0.62}),
    Example("runs, not known how far", "action", ACTION, LOCKED | REST | RUNS),
    Example(
        "canceled", "action", ACTION, CALLED | {"outcome": "canceled", "result": "Canceled 14:31:58"}
    ),
    Example("locked", "action", ACTION, LOCKED | REST),
    Example("refused", "action", ACTION, CALLED, receipt=("refused", "Refused: no pallet")),
)
DOUBTS: Final[Texts] = {
    "waiting": "Nothing received on /door",
    "old": "2 min old",
    "unreadable": "/door is not std_msgs/msg/Bool",
    "missing": "No field data at 14:31:52",
}
VALUE: Final[Table] = TOPIC | {"label": "Vacuum", "unit": "kPa"}
READOUTS: Final = (
    Example("live", "readout", VALUE, {"state": "live", "text": "−71 kPa", "note": ""}),
    Example("long", "readout", VALUE, {"state": "live", "text": "−1234567890.123456 kPa", "note": ""}),
    *(
        Example(
            state,
            "readout",
            VALUE,
            {"state": state, "text": "−71 kPa" if state == "old" else "—", "note": note},
        )
        for state, note in DOUBTS.items()
    ),
)
LAMP: Final[Table] = {
    "label": "Guard door 1",
    "topic": "/door",
    "type": "std_msgs/msg/Bool",
    "states": [{"value": True, "text": "Open", "shape": "circle"}],
}
LIVE: Final[Table] = {"state": "live", "text": "Locked", "note": "", "colour": "none"}
LAMPS: Final = (
    *(
        Example(shape, "indicator", LAMP, LIVE | {"shape": shape})
        for shape in ("circle", "square", "triangle", "diamond", "cross", "bar")
    ),
    *(
        Example(colour, "indicator", LAMP, LIVE | {"shape": "diamond", "colour": colour})
        for colour in ("grey", "white", "black", "blue", "yellow", "red")
    ),
    *(
        Example(
            state,
            "indicator",
            LAMP,
            {
                "state": state,
                "text": "Unknown",
                "note": note,
                "colour": "none",
                "shape": "waiting" if state == "missing" else state,
            },
        )
        for state, note in DOUBTS.items()
    ),
    Example("a value of no state", "indicator", LAMP, LIVE | {"text": "Value 3", "shape": "unknown"}),
)
NUMBER: Final[Table] = {"label": "Speed", "unit": "mm/s", "min": 10, "max": 250}
LIMITS: Final[Table] = {"limits": "10 to 250"}
SELECT: Final[Table] = {"label": "Program", "options": [{"value": 12, "label": "P12, boxes"}]}
INPUTS: Final = (
    Example("empty", "text", {"label": "Order"}),
    Example("filled", "text", {"label": "Order", "default": "4711"}),
    Example("select", "select", SELECT),
    Example("empty", "number", NUMBER, LIMITS),
    Example("filled", "number", NUMBER, LIMITS, entered=120),
    Example("out of limits", "number", NUMBER, LIMITS, entered=400),
    Example("slider", "slider", NUMBER, LIMITS, entered=120),
    Example("off", "toggle", {"label": "Wrapper"}),
    Example("on", "toggle", {"label": "Wrapper"}, entered=True),
)
PARAMETER: Final[Table] = {
    "label": "Belt speed",
    "node": "/controller",
    "parameter": "speed",
    "type": "double",
    "unit": "mm/s",
}
KNOWN: Final[Table] = CALLED | {
    "state": "live",
    "text": "120 mm/s",
    "note": "Read at 14:31:52",
    "hint": "",
    "limits": "10 to 250",
    "settable": True,
    "askable": True,
    "entry": "120",
    "bounds": {"min": "10", "max": "250", "step": "any"},
}
ABSENT: Final[Table] = KNOWN | LOCKED | {"text": "—", "entry": "", "askable": False}
PARAMETERS: Final = (
    Example("waiting", "parameter", PARAMETER, ABSENT | {"state": "waiting", "note": "Asking"}),
    Example("live", "parameter", PARAMETER, KNOWN),
    Example("old", "parameter", PARAMETER, KNOWN | {"state": "old", "note": "2 min old"}),
    Example("missing", "parameter", PARAMETER, ABSENT | {"state": "missing", "note": "No value"}),
    Example("locked", "parameter", PARAMETER, KNOWN | LOCKED),
    Example("refused", "parameter", PARAMETER, KNOWN, 300, ("refused", "Refused: 250 at most")),
    Example("set by another only", "parameter", PARAMETER, KNOWN | {"settable": False}),
)
STATIC: Final = (
    Example("label", "label", {"label": "Order 4711, carton 400 × 300"}),
    Example("large label", "label", {"label": "Palletizing", "size": "large"}),
    Example("small label", "label", {"label": "Lay in a new ribbon", "size": "small"}),
    Example("link", "link", {"label": "Setup", "page": "setup", "icon": "settings"}),
    Example("image", "image", {"label": "A box", "src": "box.svg"}),
)
PARTS: Final = (
    Part("Keys by role", 6, ROLES),
    Part("Keys by state", 6, KEYS),
    Part("Actions", 3, ACTIONS),
    Part("Readouts", 6, READOUTS),
    Part("Lamps", 6, LAMPS),
    Part("Inputs", 3, INPUTS),
    Part("Parameters", 3, PARAMETERS),
    Part("Static", 5, STATIC),
)
PICTURE: Final = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 40 24"><path fill="#b9a17c" stroke="#333" '
    'd="M2 2h36v20H2z"/></svg>'
)

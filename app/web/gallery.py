"""What the gallery shows: each kind of widget in each of its states, with attributes made by hand."""

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from app.commands.receipts import Receipt
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.kinds import KINDS
from app.panel.widgets.log_view import LEVELS as LOG_LEVELS
from app.panel.widgets.trend import Trend
from app.robot.command_status import OutcomeCode
from app.robot.history import Column
from app.view.trend_plot import COLUMNS, Plot, draw

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
GAUGE: Final[Table] = TOPIC | {
    "label": "Air inlet",
    "unit": "bar",
    "min": 3,
    "max": 8,
    "normal": [5, 6.5],
    "low_low": 4,
    "low": 4.5,
    "high": 7,
    "high_high": 7.5,
    "setpoint": 6,
}
AT_REST: Final[Table] = {
    "note": "",
    "beyond": "",
    "pointer": None,
    "setpoint": 60.0,
    "said": "",
    "target": "set 6",
}
IN_RANGE: Final[Table] = AT_REST | {
    "state": "live",
    "level": "normal",
    "text": "5.9",
    "pointer": 58.0,
}
BEYOND: Final[Table] = {
    "abnormal": {"text": "6.8", "pointer": 76.0, "said": "above normal 6.5"},
    "low": {"text": "4.4", "pointer": 28.0, "said": "below low 4.5"},
    "high": {"text": "7.2", "pointer": 84.0, "said": "above high 7"},
    "low_low": {"text": "3.1", "pointer": 2.0, "said": "below low-low 4"},
    "high_high": {
        "text": "11.25",
        "pointer": 100.0,
        "beyond": "above",
        "said": "above high-high 7.5",
    },
}
DOUBTFUL: Final[Table] = AT_REST | {"level": "", "text": "—"}
GAUGES: Final = tuple(
    Example(f"{title}, {orientation}", "gauge", GAUGE | {"orientation": orientation}, shown)
    for orientation in ("vertical", "horizontal")
    for title, shown in (
        ("normal", IN_RANGE),
        *((level, IN_RANGE | {"level": level} | shown) for level, shown in BEYOND.items()),
        *(
            (
                state,
                (IN_RANGE if state == "old" else DOUBTFUL)
                | {"state": state, "level": "", "note": note},
            )
            for state, note in DOUBTS.items()
        ),
    )
)
JOINTS: Final[Table] = {
    "label": "Joints",
    "joint": [
        {"name": name, "label": label, "min": -low, "max": high, "low": 10 - low, "high": high - 10}
        for name, label, low, high in (
            ("joint_1", "J1", 170, 170),
            ("joint_2", "J2", 65, 145),
            ("joint_3", "J3", 90, 75),
            ("joint_4", None, 190, 190),
        )
    ],
}
JOINTS_LIVE: Final[Table] = {
    "state": "live",
    "note": "",
    "said": "",
    "joint_values": ["+27.1", "+41.6", "−38.2", "−4.8"],
    "joint_bars": [58.0, 50.8, 31.4, 48.7],
    "joint_levels": ["normal"] * 4,
}
JOINTS_UNKNOWN: Final[Table] = JOINTS_LIVE | {
    "joint_values": ["—"] * 4,
    "joint_bars": [None] * 4,
    "joint_levels": [""] * 4,
}
JOINT_ROWS: Final = (
    Example("normal", "joints", JOINTS, JOINTS_LIVE),
    Example(
        "near and beyond limits",
        "joints",
        JOINTS,
        JOINTS_LIVE
        | {
            "said": "joint_4 beyond its range, which ends at 190 and 2 more",
            "joint_values": ["+158.1", "+140.2", "−38.2", "+195.0"],
            "joint_bars": [96.5, 97.7, 31.4, 100.0],
            "joint_levels": ["near", "high", "normal", "high_high"],
        },
    ),
    Example(
        "one is not there",
        "joints",
        JOINTS,
        JOINTS_LIVE
        | {
            "said": "J2 is missing in the message",
            "joint_values": ["+27.1", "missing", "−38.2", "−4.8"],
            "joint_bars": [58.0, None, 31.4, 48.7],
            "joint_levels": ["normal", "missing", "normal", "normal"],
        },
    ),
    *(
        Example(
            state,
            "joints",
            JOINTS,
            (JOINTS_LIVE | {"joint_levels": [""] * 4} if state == "old" else JOINTS_UNKNOWN)
            | {"state": state, "note": note},
        )
        for state, note in DOUBTS.items()
    ),
)
LEVELS: Final = (
    {"value": 0, "text": "OK", "shape": "circle"},
    {"value": 1, "text": "Warning", "shape": "triangle", "colour": "yellow"},
    {"value": 2, "text": "Error", "shape": "cross", "colour": "red"},
)
TABLE: Final[Table] = {
    "label": "Diagnostics",
    "topic": "/diagnostics",
    "type": "diagnostic_msgs/msg/DiagnosticArray",
    "field": "status",
    "key": "name",
    "rows_shown": 3,
    "column": [
        {"label": "Level", "field": "level", "states": list(LEVELS)},
        {"label": "Part", "field": "name"},
        {"label": "What", "field": "message", "width": 2},
    ],
}


def _row(level: int, name: str, message: str, age: str = "") -> Table:
    state = LEVELS[level]
    first = {"text": state["text"], "shape": state["shape"], "colour": state.get("colour", "grey")}
    others = ({"text": text, "shape": "", "colour": ""} for text in (name, message))
    return {"age": age, "cells": [first, *others]}


ROWS: Final = [
    _row(2, "gripper", "vacuum is lost"),
    _row(1, "drive: axis 2", "temperature is high, and this text is longer than its column"),
    _row(0, "safety controller", "ok", "2 min old"),
]
FILLED: Final[Table] = {"state": "live", "note": "", "said": "and 12 more", "table_rows": ROWS}
TABLES: Final = (
    Example("filled", "table", TABLE, FILLED),
    Example("one entry", "table", TABLE, FILLED | {"said": "", "table_rows": ROWS[:1]}),
    Example("empty", "table", TABLE, FILLED | {"said": "No entries", "table_rows": []}),
    *(
        Example(
            state,
            "table",
            TABLE,
            FILLED | {"state": state, "note": note, "table_rows": ROWS if state == "old" else []},
        )
        for state, note in DOUBTS.items()
        if state != "missing"
    ),
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
STEP: Final[Table] = PUBLISH | {
    "label": "Belt speed",
    "message": {"data": "{value}"},
    "value": {"topic": "/speed", "type": "std_msgs/msg/Float32"},
    "min": 0,
    "max": 250,
    "step": 10,
    "unit": "mm/s",
}
STEPPED: Final[Table] = CALLED | {
    "state": "live",
    "text": "120",
    "note": "",
    "step_up": "130",
    "step_down": "110",
}
STEPS: Final = (
    Example("free", "step", STEP, STEPPED),
    Example("at its limit", "step", STEP, STEPPED | {"text": "250", "step_up": ""}),
    Example("locked", "step", STEP, STEPPED | LOCKED),
    Example(
        "sent, waiting",
        "step",
        STEP,
        STEPPED | {"enabled": False, "reason": "In progress: waiting for the robot."},
    ),
    Example("done", "step", STEP, STEPPED | {"outcome": "confirmed", "result": "Done 14:31:58"}),
    Example("refused", "step", STEP, STEPPED, receipt=("refused", "Refused: it is 130 by now")),
    *(
        Example(
            state,
            "step",
            STEP,
            STEPPED
            | LOCKED
            | {"state": state, "reason": note, "note": note, "step_up": "", "step_down": ""}
            | ({} if state == "old" else {"text": "—"}),
        )
        for state, note in DOUBTS.items()
    ),
)
PENS: Final[Table] = {
    "label": "Air pressure, bar",
    "windows": ["1m", "10m", "1h"],
    "pen": [
        {"topic": "/inlet", "type": "std_msgs/msg/Float64", "label": "Inlet", "normal": [5.0, 6.5]}
        | {"low": 5.0, "high": 6.5},
        {"topic": "/gripper", "type": "std_msgs/msg/Float64", "label": "Gripper"},
    ],
}
PEN_VALUES: Final[Table] = {"note": "", "fault": "", "state0": "live", "state1": "live"}
DRAWN: Final[Table] = PEN_VALUES | {"state": "live", "text0": "5.9", "text1": "5.6"}
TRENDS: Final = (
    Example("live", "trend", PENS, DRAWN),
    Example(
        "below its limit", "trend", PENS | {"keys": False}, DRAWN | {"state0": "low", "text0": "4.9"}
    ),
    Example(
        "one is old",
        "trend",
        PENS | {"keys": False},
        DRAWN | {"state": "old", "state1": "old", "note": "Gripper: 2 min old"},
    ),
    Example(
        "waiting",
        "trend",
        PENS | {"keys": False},
        PEN_VALUES
        | {"state": "waiting", "state0": "waiting", "state1": "waiting", "text0": "—", "text1": "—"}
        | {"note": "Inlet: waiting for /inlet"},
    ),
    Example(
        "not kept",
        "trend",
        PENS | {"keys": False},
        DRAWN | {"fault": "Not kept on disk: no space left on device"},
    ),
    Example(
        "eight pens",
        "trend",
        {"label": "Temperatures", "keys": False, "max_age_s": 60}
        | {"pen": [PENS["pen"][1] | {"label": f"Zone {number}"} for number in range(1, 9)]},
        {"state": "live", "note": "", "fault": ""}
        | {f"text{number}": f"{5.6 - number / 5:.1f}" for number in range(8)}
        | {f"state{number}": "live" for number in range(8)},
    ),
)


def sample_plot(widget: BaseWidget) -> Plot | None:
    """The plot of a trend, of waves with a gap; None of other kinds."""
    if not isinstance(widget, Trend):
        return None
    width = widget.window_s / COLUMNS
    pens = [
        [
            Column(at, value - 0.05, value + 0.05, value, at in (0, 140))
            for at in range(COLUMNS)
            if not 120 < at < 140
            for value in (5.8 - pen / 5 + 0.4 * math.sin(at / 20 + pen) - at / COLUMNS / 2,)
        ]
        for pen in range(len(widget.pens))
    ]
    return draw(widget, pens, 0.0, width * COLUMNS)


STATIC: Final = (
    Example("label", "label", {"label": "Order 4711, carton 400 × 300"}),
    Example("large label", "label", {"label": "Palletizing", "size": "large"}),
    Example("small label", "label", {"label": "Lay in a new ribbon", "size": "small"}),
    Example("link", "link", {"label": "Setup", "page": "setup", "icon": "settings"}),
    Example("image", "image", {"label": "A box", "src": "box.svg"}),
)
JOYSTICK: Final[Table] = {
    "label": "Drive",
    "topic": "/cmd_vel",
    "type": "geometry_msgs/msg/Twist",
    "interlock": "automatic",
}
STICK: Final[Texts] = ENABLED | {'data-kind="joystick"': 'data-kind="joystick" data-hold="held"'}
MOVES: Final[Texts] = {
    'data-axis="y">': 'data-axis="y">0.25 m/s',
    'data-axis="x">': 'data-axis="x">−0.40 rad/s',
}
JOYSTICKS: Final = (
    Example("free", "joystick", JOYSTICK, FREE | LET_GO, marks=ENABLED),
    Example("held", "joystick", JOYSTICK, FREE | {"held": True, "holding": ""}, marks=STICK | MOVES),
    Example("square", "joystick", JOYSTICK | {"shape": "square"}, FREE | LET_GO, marks=ENABLED),
    Example("locked", "joystick", JOYSTICK, LOCKED | LET_GO),
)
CAMERA: Final[Table] = {"label": "Camera 1", "topic": "/camera"}
CAMERAS: Final = (
    Example("waiting", "camera", CAMERA, {"state": "waiting", "note": "waiting for /camera"}),
    Example("live", "camera", CAMERA, {"state": "live", "note": ""}),
    Example("old", "camera", CAMERA, {"state": "old", "note": "12 s old, received 14:31:52"}),
    Example(
        "unreadable",
        "camera",
        CAMERA,
        {"state": "unreadable", "note": "The encoding mono16 cannot be shown: it must have 8 bits"},
    ),
    Example(
        "none reaches this screen",
        "camera",
        CAMERA,
        {"state": "live", "note": ""},
        marks={'data-kind="camera"': 'data-kind="camera" data-late'},
    ),
)
LOG: Final[Table] = {"label": "Log of the robot", "lines": 10}
LOGS: Final = (
    Example("lines", "log", LOG, {"state": "live", "note": "", "count": "5"}),
    Example("waiting", "log", LOG, {"state": "waiting", "note": "waiting for /rosout", "count": "0"}),
    Example("cut off", "log", LOG, {"state": "old", "note": "The connection was lost", "count": "5"}),
)


class Everyones(dict[str, list[Texts]]):
    """The same lines, whoever asks."""

    def __missing__(self, _: str) -> list[Texts]:
        texts = ("moves", "cycle started", "the gripper is slow", "no part gripped", "axis 3 stands")
        return [
            {"time": "14:31:58", "level": level, "word": level.title(), "node": "cell", "text": text}
            for level, text in zip(LOG_LEVELS, texts, strict=True)
        ]


LINES: Final = Everyones()
PARTS: Final = (
    Part("Keys by role", 6, ROLES),
    Part("Keys by state", 6, KEYS),
    Part("Actions", 3, ACTIONS),
    Part("Readouts", 6, READOUTS),
    Part("Lamps", 6, LAMPS),
    Part("Gauges", 6, GAUGES),
    Part("Joints", 3, JOINT_ROWS),
    Part("Tables", 2, TABLES),
    Part("Inputs", 3, INPUTS),
    Part("Parameters", 3, PARAMETERS),
    Part("Steps", 3, STEPS),
    Part("Joysticks", 4, JOYSTICKS),
    Part("Cameras", 3, CAMERAS),
    Part("Logs", 2, LOGS),
    Part("Trends", 2, TRENDS),
    Part("Static", 5, STATIC),
)
PICTURE: Final = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 40 24"><path fill="#b9a17c" stroke="#333" '
    'd="M2 2h36v20H2z"/></svg>'
)

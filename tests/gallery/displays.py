"""Displays in each of their states: readouts, lamps, cameras, logs, gauges, tables, trends and
sequences."""

import math
from collections.abc import Mapping, Sequence
from typing import Final, get_args

from app.cell.robot.history import Column
from app.cell.view.displays import LAMP_WORDS
from app.cell.view.tour_values import STATE_WORDS
from app.cell.view.trend import COLUMNS, Plot, draw
from app.panel.widgets.displays import LEVELS as LOG_LEVELS
from app.panel.widgets.displays import LampState
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.trend import Trend
from app.system.texts import Text, TextLike, number, say
from app.system.texts.text import filled_in
from app.web.pages.log_lines import LEVEL_WORDS
from tests.gallery import texts
from tests.gallery.examples import AT, NOT_LIVE, OLD, TOPIC, Example, Table

# Readouts, lamps, cameras and logs in each of their states.

VALUE: Final[Table] = TOPIC | {"label": texts.VACUUM.table, "unit": "kPa"}
MEASURED: Final = number("-71", "kPa")
LONG_NUMBER: Final = number("-1234567890.123456", "kPa")
DURATION: Final[Table] = TOPIC | {"label": texts.VACUUM.table, "format": "duration"}
FOR: Final = say("duration_hours", hours=12, minutes="05")
READOUTS: Final = (
    Example("live", "readout", VALUE, {"state": "live", "text": MEASURED, "note": ""}),
    Example("a duration", "readout", DURATION, {"state": "live", "text": FOR, "note": ""}),
    Example("long", "readout", VALUE, {"state": "live", "text": LONG_NUMBER, "note": ""}),
    *(
        Example(
            state,
            "readout",
            VALUE,
            {"state": state, "text": MEASURED if state == "old" else "—", "note": note},
        )
        for state, note in NOT_LIVE.items()
    ),
)
LAMP: Final[Table] = {
    "label": texts.GUARD_DOOR.table,
    "topic": "/door",
    "type": "std_msgs/msg/Bool",
    "states": [{"value": True, "text": texts.OPEN.table, "shape": "circle"}],
}
LIVE: Final[Table] = {"state": "live", "text": texts.LOCKED.shown, "note": "", "colour": "none"}
LAMPS: Final = (
    *(
        Example(shape, "indicator", LAMP, LIVE | {"shape": shape})
        for shape in get_args(LampState.model_fields["shape"].annotation)
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
                "text": say(LAMP_WORDS[state]),
                "note": say("lamp_was", text=texts.LOCKED.shown, note=note) if state == "old" else note,
                "colour": "none",
                "shape": "waiting" if state == "missing" else state,
            },
        )
        for state, note in NOT_LIVE.items()
    ),
    Example(
        "a value of no state",
        "indicator",
        LAMP,
        LIVE | {"text": say("lamp_unknown", value="3"), "shape": "unknown"},
    ),
)
CAMERA: Final[Table] = {"label": texts.CAMERA.table, "topic": "/camera"}
AGED: Final = say("camera_old", age=say("age_seconds", number=12), time=AT)
CAMERAS: Final = (
    Example(
        "waiting",
        "camera",
        CAMERA,
        {"state": "waiting", "note": say("readout_waiting")},
    ),
    Example("live", "camera", CAMERA, {"state": "live", "note": ""}),
    Example("old", "camera", CAMERA, {"state": "old", "note": AGED}),
    Example(
        "unreadable",
        "camera",
        CAMERA,
        {"state": "unreadable", "note": say("camera_encoding", encoding="32FC1")},
    ),
    Example(
        "no new picture",
        "camera",
        CAMERA,
        {"state": "live", "note": ""},
        marks={'data-kind="camera"': 'data-kind="camera" data-late'},
    ),
)
MAP: Final[Table] = {"label": texts.HALL.table}
NOWHERE: Final = {"grid": None, "pose": None, "about": "", "detail": "", "layer_note": ""}
LAYER: Final = {"shows": "scan", "topic": "/scan"}
MAP_PLAN: Final = {"src": "box.svg", "resolution": 1.0}
NO_WAY: Final = say("transform_unknown", base="laser", fixed="map", name="laser")
NO_SCAN: Final = {"label": say("map_layer_scan"), "state": "unplaced", "note": NO_WAY}
ABSENT: Final = {"robot": "example_cell_1", "name": "Cell 1", "label": "Cell 1", "state": "absent"}
OTHERS: Final = {
    "robots": [ABSENT | {"pose": None, "note": say("map_robot_elsewhere")}],
    "robots_note": say("map_robot_note", name="Cell 1", note=say("map_robot_elsewhere")),
}
MAP_LEVELS: Final = [{"id": "ground", "label": texts.HALL.table, "topic": "/map"}]
NO_LEVEL: Final = {"level": "", "level_note": say("map_level_waiting"), "levels": []}
MAPS: Final = (
    Example("waiting", "map", MAP, {"state": "waiting", "note": say("map_waiting")} | NOWHERE),
    Example("unreadable", "map", MAP, {"state": "unreadable", "note": say("map_empty")} | NOWHERE),
    Example(
        "a layer without a place",
        "map",
        MAP | {"layer": [LAYER], "plan": MAP_PLAN},
        {"state": "live", "note": ""}
        | NOWHERE
        | {"layer_0": NO_SCAN}
        | {"layer_note": say("map_layer_note", layer=say("map_layer_scan"), note=NO_WAY)},
    ),
    Example(
        "another robot left out",
        "map",
        MAP | {"robots": "all"},
        {"state": "live", "note": ""} | NOWHERE | OTHERS,
    ),
    Example(
        "an unknown level",
        "map",
        {"label": texts.HALL.table, "level": MAP_LEVELS},
        {"state": "waiting", "note": say("map_level_waiting")} | NOWHERE | NO_LEVEL,
    ),
)
PLACE: Final[Table] = {"label": texts.PLACES.table, "map": "hall", "touch": True}
OFFERED: Final[Table] = {
    "radius": 0.3,
    "places": [
        {"id": "charger", "label": texts.CHARGER.shown, "icon": "zap"}
        | {"distance": number("4.2", "m"), "reason": ""},
        {"id": "gate", "label": texts.GATE.shown, "icon": "", "distance": ""}
        | {"reason": say("place_in_zone", zone=texts.GATE.shown)},
    ],
}
PLACES: Final = (
    Example("places", "place", PLACE, {"state": "live", "note": ""} | OFFERED),
    Example("saved", "place", PLACE | {"save": True}, {"state": "live", "note": ""} | OFFERED),
    Example(
        "locked",
        "place",
        PLACE,
        {"state": "missing", "note": say("place_pose_old", age=say("age_seconds", number=6))} | OFFERED,
    ),
)
TOUR: Final[Table] = {"label": texts.TOUR.table, "map": "hall", "places": ["charger", "gate"]}


def _tour_rows(*states: str, why: TextLike = "") -> list[dict[str, object]]:
    """A list of the two places in turn; `why` is said of what was missed."""
    names = (texts.CHARGER.shown, texts.GATE.shown)
    return [
        {"number": n + 1, "label": names[n % 2], "state": state, "pose": None}
        | {"word": say(STATE_WORDS[state]) if state in STATE_WORDS else number("4.2", "m")}
        | {"note": why if state == "missed" else ""}
        for n, state in enumerate(states)
    ]


BLOCKED: Final = say("nav2_blocked", error="105")
TOURS: Final = tuple(
    Example(name, "tour", TOUR, {"state": state, "note": note, "title": title, "rows": rows})
    for name, state, note, title, rows in (
        ("planned", "live", "", "", _tour_rows("planned", "planned")),
        ("locked", "missing", say("place_pose_unknown"), "", _tour_rows("planned", "planned")),
        (
            "under way",
            "live",
            "",
            say("tour_at", number=2, total=3),
            _tour_rows("passed", "current", "to_come"),
        ),
        (
            "old",
            "old",
            "",
            say("tour_old", age=say("age_seconds", number=12)),
            _tour_rows("passed", "current", "to_come"),
        ),
        (
            "one missed",
            "live",
            "",
            say("tour_missed_count", count=1, total=3),
            _tour_rows("reached", "missed", "reached", why=BLOCKED),
        ),
        ("canceled", "live", "", say("tour_canceled"), _tour_rows("passed", "left", "left")),
        ("of another program", "live", "", say("tour_other_program"), []),
    )
)
LOG: Final[Table] = {"label": texts.ROBOT_LOG.table, "lines": 10}
LOGS: Final = (
    Example("lines", "log", LOG, {"state": "live", "note": "", "count": "5"}),
    Example(
        "waiting",
        "log",
        LOG,
        {"state": "waiting", "note": say("readout_waiting"), "count": "0"},
    ),
    Example("cut off", "log", LOG, {"state": "old", "note": say("rosout_no_connection"), "count": "5"}),
)


MESSAGES: Final = ("moves", "cycle started", "the gripper is slow", "no part gripped", "axis 3 stands")
LINES: Final[Sequence[Mapping[str, TextLike]]] = [
    {
        "time": AT,
        "at": "2026-11-21T10:00:00+00:00",
        "level": level,
        "word": LEVEL_WORDS[level],
        "node": "cell",
        "text": text,
    }
    for level, text in zip(LOG_LEVELS, MESSAGES, strict=True)
]


# Figures, plans, check lists, gauges, joints and tables in each of their states.

FIGURE: Final[Table] = TOPIC | {
    "label": texts.BOXES_COUNT.table,
    "target": 144,
    "segments": 6,
    "line": [
        TOPIC | {"text": texts.MINUTES_LEFT.table},
        TOPIC | {"text": texts.LAYER.table},
    ],
}
COUNTED: Final[Table] = {
    "state": "live",
    "note": "",
    "text": "87",
    "rest": say("figure_target", target="144"),
    "part": 60.4,
    "line0": filled_in(texts.MINUTES_LEFT.shown, lambda text: text.replace("{value}", "11")),
    "line1": filled_in(texts.LAYER.shown, lambda text: text.replace("{value}", "4")),
}
FIGURES: Final = (
    Example("counted", "figure", FIGURE, COUNTED),
    Example("without a target", "figure", FIGURE | {"target": None}, COUNTED | {"rest": ""}),
    *(
        Example(
            state,
            "figure",
            FIGURE,
            COUNTED
            | {"state": state, "note": note}
            | ({} if state == "old" else {"text": "—", "part": None}),
        )
        for state, note in NOT_LIVE.items()
    ),
)
PLAN: Final[Table] = TOPIC | {"label": texts.BOXES_COUNT.table, "across": 6, "along": 4, "layers": 6}
PLANNED: Final[Table] = {
    "state": "live",
    "note": "",
    "text": say("pallet_layer", layer=4, layers=6, place=16, places=24),
    "filled": "M0 0H6V2H0zM0 2H3V3H0z",
    "next": "3 2",
}
EMPTY: Final[Table] = PLANNED | {"filled": "", "next": ""}
PALLETS: Final = (
    Example("partly filled", "pallet", PLAN, PLANNED),
    Example(
        "full",
        "pallet",
        PLAN,
        EMPTY | {"text": say("pallet_full"), "filled": "M0 0H6V4H0z"},
    ),
    *(
        Example(
            state,
            "pallet",
            PLAN,
            (PLANNED if state == "old" else EMPTY) | {"state": state, "note": note},
        )
        for state, note in NOT_LIVE.items()
    ),
)
CHECKED: Final[Table] = {
    "label": texts.CONDITIONS.table,
    "conditions": ["door", "vacuum", "air"],
    "rows_shown": 3,
}


def _checks(shape: str, text: TextLike, states: Sequence[str]) -> Table:
    order = ("unmet", "unknown", "met")
    return {
        "state": "live",
        "shape": shape,
        "text": text,
        "row_labels": [texts.GUARD_DOOR.shown, texts.VACUUM.shown, texts.AIR_INLET.shown],
        "row_states": states,
        "row_values": [
            say(f"condition_{states[0]}"),
            say("condition_unknown") if states[1] == "unknown" else number("-71", "kPa"),
            number("5.6", "bar"),
        ],
        "row_needs": [
            "",
            say("condition_needs", need=number("-60", "kPa")),
            say("condition_needs", need=number("5", "bar")),
        ],
        "order": sorted(range(3), key=lambda place: order.index(states[place])),
    }


CHECKS: Final = (
    Example("all met", "conditions", CHECKED, _checks("met", say("conditions_met"), ["met"] * 3)),
    Example(
        "some not met",
        "conditions",
        CHECKED,
        _checks("unmet", say("conditions_unmet", number=2, total=3), ["met", "unknown", "unmet"]),
    ),
    Example(
        "not known",
        "conditions",
        CHECKED,
        _checks("unknown", say("conditions_unmet", number=1, total=3), ["met", "unknown", "met"]),
    ),
)
GAUGE: Final[Table] = TOPIC | {
    "label": texts.AIR_INLET.table,
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
    "target": say("gauge_setpoint", value=number("6.0")),
}
IN_RANGE: Final[Table] = AT_REST | {
    "state": "live",
    "level": "normal",
    "text": number("5.9"),
    "pointer": 58.0,
}


def _beyond(code: str, limit: str) -> Text:
    return say(code, limit=number(limit))


BEYOND: Final[Table] = {
    "abnormal": {"text": number("6.8"), "pointer": 76.0, "said": _beyond("gauge_above_normal", "6.5")},
    "low": {"text": number("4.4"), "pointer": 28.0, "said": _beyond("gauge_low", "4.5")},
    "high": {"text": number("7.2"), "pointer": 84.0, "said": _beyond("gauge_high", "7.0")},
    "low_low": {"text": number("3.1"), "pointer": 2.0, "said": _beyond("gauge_low_low", "4.0")},
    "high_high": {
        "text": number("11.25"),
        "pointer": 100.0,
        "beyond": "above",
        "said": _beyond("gauge_high_high", "7.5"),
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
            for state, note in NOT_LIVE.items()
        ),
    )
)
JOINTS: Final[Table] = {
    "label": texts.JOINTS.table,
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
    "joint_values": [number(text) for text in ("+27.1", "+41.6", "-38.2", "-4.8")],
    "joint_bars": [58.0, 50.8, 31.4, 48.7],
    "joint_levels": ["normal"] * 4,
}
JOINTS_UNKNOWN: Final[Table] = JOINTS_LIVE | {
    "joint_values": ["—"] * 4,
    "joint_bars": [None] * 4,
    "joint_levels": [""] * 4,
}
BEYOND_RANGE: Final = say("joint_high_high", joint="joint_4", limit="190")
JOINT_ROWS: Final = (
    Example("normal", "joints", JOINTS, JOINTS_LIVE),
    Example(
        "near and beyond limits",
        "joints",
        JOINTS,
        JOINTS_LIVE
        | {
            "said": say("joint_more", first=BEYOND_RANGE, number=2),
            "joint_values": [number(text) for text in ("+158.1", "+140.2", "-38.2", "+195.0")],
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
            "said": say("joint_is_missing", joint="J2"),
            "joint_values": [number("+27.1"), say("joint_missing"), number("-38.2"), number("-4.8")],
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
        for state, note in NOT_LIVE.items()
    ),
)
LEVELS: Final = (
    (texts.OK, "circle", "grey"),
    (texts.WARNING, "triangle", "yellow"),
    (texts.ERROR, "cross", "red"),
)
STATES: Final = [
    {"value": value, "text": text.table, "shape": shape, "colour": colour}
    for value, (text, shape, colour) in enumerate(LEVELS)
]
TABLE: Final[Table] = {
    "label": texts.DIAGNOSTICS.table,
    "topic": "/diagnostics",
    "type": "diagnostic_msgs/msg/DiagnosticArray",
    "field": "status",
    "key": "name",
    "rows_shown": 3,
    "column": [
        {"label": texts.LEVEL.table, "field": "level", "states": STATES},
        {"label": texts.PART.table, "field": "name"},
        {"label": texts.WHAT.table, "field": "message", "width": 2},
    ],
}


def _row(level: int, name: str, message: str, age: TextLike = "") -> Table:
    text, shape, colour = LEVELS[level]
    first = {"text": text.shown, "shape": shape, "colour": colour}
    others = ({"text": text, "shape": "", "colour": ""} for text in (name, message))
    return {"age": age, "cells": [first, *others]}


ROWS: Final = [
    _row(2, "gripper", "vacuum is lost"),
    _row(1, "drive: axis 2", "temperature is high, and this text is longer than its column"),
    _row(0, "safety controller", "ok", OLD),
]
FILLED: Final[Table] = {
    "state": "live",
    "note": "",
    "said": say("table_more", number=12),
    "table_rows": ROWS,
}
TABLES: Final = (
    Example("filled", "table", TABLE, FILLED),
    Example("one entry", "table", TABLE, FILLED | {"said": "", "table_rows": ROWS[:1]}),
    Example("empty", "table", TABLE, FILLED | {"said": say("table_empty"), "table_rows": []}),
    *(
        Example(
            state,
            "table",
            TABLE,
            FILLED | {"state": state, "note": note, "table_rows": ROWS if state == "old" else []},
        )
        for state, note in NOT_LIVE.items()
        if state != "missing"
    ),
)


# Trends in each of their states, with lines made by hand.

PENS: Final[Table] = {
    "label": texts.PRESSURE.table,
    "windows": ["1m", "10m", "1h"],
    "pen": [
        {
            "topic": "/inlet",
            "type": "std_msgs/msg/Float64",
            "label": texts.INLET.table,
            "normal": [5.0, 6.5],
        }
        | {"low": 5.0, "high": 6.5},
        {"topic": "/gripper", "type": "std_msgs/msg/Float64", "label": texts.GRIPPER.table},
    ],
}
PEN_VALUES: Final[Table] = {"note": "", "fault": "", "state0": "live", "state1": "live"}
PLOTTED: Final[Table] = PEN_VALUES | {"state": "live", "text0": number("5.9"), "text1": number("5.6")}
TRENDS: Final = (
    Example("live", "trend", PENS, PLOTTED),
    Example(
        "below its limit",
        "trend",
        PENS | {"keys": False},
        PLOTTED | {"state0": "low", "text0": number("4.9")},
    ),
    Example(
        "one is old",
        "trend",
        PENS | {"keys": False},
        PLOTTED
        | {
            "state": "old",
            "state1": "old",
            "note": say("trend_pen", label=texts.GRIPPER.shown, note=OLD),
        },
    ),
    Example(
        "waiting",
        "trend",
        PENS | {"keys": False},
        PEN_VALUES
        | {"state": "waiting", "state0": "waiting", "state1": "waiting", "text0": "—", "text1": "—"}
        | {"note": say("trend_pen", label=texts.INLET.shown, note=say("readout_waiting"))},
    ),
    Example(
        "not kept",
        "trend",
        PENS | {"keys": False},
        PLOTTED | {"fault": say("trend_not_kept", why="no space left on device")},
    ),
    Example(
        "eight pens",
        "trend",
        {"label": texts.TEMPERATURES.table, "keys": False, "max_age_s": 60}
        | {"pen": [PENS["pen"][1] | {"label": texts.zone(zone).table} for zone in range(1, 9)]},
        {"state": "live", "note": "", "fault": ""}
        | {f"text{pen}": number(f"{5.6 - pen / 5:.1f}") for pen in range(8)}
        | {f"state{pen}": "live" for pen in range(8)},
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


# Sequences of steps in each of their states.

STEPS: Final[Table] = {
    "label": texts.LOADING.table,
    "current": {"topic": "/loading", "type": "std_msgs/msg/UInt8"},
    "steps": [{"text": step.table} for step in (texts.OPEN_CLAMP, texts.LAY_IN, texts.CLOSE_CLAMP)],
    "rows_shown": 3,
}
USUAL: Final = (texts.OPEN_CLAMP.shown, texts.LAY_IN.shown, texts.CLOSE_CLAMP.shown)
RECOVERY: Final = (texts.LOOK_IN.shown, texts.CLOSE_DOOR.shown, texts.TOUCH_RESET.shown)


def _shown(steps: Sequence[TextLike], states: Sequence[str], text: TextLike, mode: str) -> Table:
    notes = (texts.THROUGH_WINDOWS.shown, "", "") if mode == "recovery" else ("", "", "")
    return {
        "state": "live",
        "note": "",
        "mode": mode,
        "title": say("sequence_recovery") if mode == "recovery" else texts.LOADING.shown,
        "text": text,
        "rows": [
            {
                "number": str(number + 1),
                "text": step,
                "note": notes[number],
                "state": states[number],
                "word": say(f"sequence_{states[number]}"),
            }
            for number, step in enumerate(steps)
        ],
        "picture": "",
        "mark": [],
        "at": "",
    }


def _step(number: int) -> TextLike:
    return say("sequence_step", number=number, total=3)


SEQUENCES: Final = (
    Example("under way", "sequence", STEPS, _shown(USUAL, ("done", "now", "next"), _step(2), "usual")),
    Example(
        "all done", "sequence", STEPS, _shown(USUAL, ["done"] * 3, say("sequence_all_done"), "usual")
    ),
    Example(
        "under a fault",
        "sequence",
        STEPS,
        _shown(RECOVERY, ("now", "now", "next"), _step(1), "recovery"),
    ),
    Example(
        "the door is closed again",
        "sequence",
        STEPS,
        _shown(RECOVERY, ("past", "done", "now"), _step(3), "recovery"),
    ),
    *(
        Example(
            state,
            "sequence",
            STEPS,
            _shown(
                USUAL,
                ("done", "now", "next") if state == "old" else ["next"] * 3,
                _step(2) if state == "old" else "",
                "usual",
            )
            | {"state": state, "note": note},
        )
        for state, note in NOT_LIVE.items()
    ),
)

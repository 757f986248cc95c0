"""Gauges, joints and tables in each of their states."""

from typing import Final

from app.web.gallery.examples import NOT_LIVE, TOPIC, Example, Table

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
            for state, note in NOT_LIVE.items()
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
        for state, note in NOT_LIVE.items()
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
        for state, note in NOT_LIVE.items()
        if state != "missing"
    ),
)

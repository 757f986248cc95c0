"""Figures, plans, check lists, gauges, joints and tables in each of their states."""

from collections.abc import Sequence
from typing import Final

from app.i18n import Text, TextLike, number, say
from app.i18n.values import filled_in
from app.web.gallery import texts
from app.web.gallery.examples import NOT_LIVE, OLD, TOPIC, Example, Table

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
    return say(f"gauge_{code}", limit=number(limit))


BEYOND: Final[Table] = {
    "abnormal": {"text": number("6.8"), "pointer": 76.0, "said": _beyond("above_normal", "6.5")},
    "low": {"text": number("4.4"), "pointer": 28.0, "said": _beyond("low", "4.5")},
    "high": {"text": number("7.2"), "pointer": 84.0, "said": _beyond("high", "7.0")},
    "low_low": {"text": number("3.1"), "pointer": 2.0, "said": _beyond("low_low", "4.0")},
    "high_high": {
        "text": number("11.25"),
        "pointer": 100.0,
        "beyond": "above",
        "said": _beyond("high_high", "7.5"),
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

"""Trends in each of their states, with lines made by hand."""

import math
from typing import Final

from app.i18n import number, say
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.trend import Trend
from app.robot.history import Column
from app.view.trend_plot import COLUMNS, Plot, draw
from app.web.gallery import texts
from app.web.gallery.examples import OLD, Example, Table

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
DRAWN: Final[Table] = PEN_VALUES | {"state": "live", "text0": number("5.9"), "text1": number("5.6")}
TRENDS: Final = (
    Example("live", "trend", PENS, DRAWN),
    Example(
        "below its limit",
        "trend",
        PENS | {"keys": False},
        DRAWN | {"state0": "low", "text0": number("4.9")},
    ),
    Example(
        "one is old",
        "trend",
        PENS | {"keys": False},
        DRAWN
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
        | {
            "note": say(
                "trend_pen", label=texts.INLET.shown, note=say("readout_waiting", topic="/inlet")
            )
        },
    ),
    Example(
        "not kept",
        "trend",
        PENS | {"keys": False},
        DRAWN | {"fault": say("trend_not_kept", why="no space left on device")},
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

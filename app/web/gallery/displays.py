"""Readouts, lamps, cameras and logs in each of their states."""

from collections.abc import Mapping, Sequence
from typing import Final, get_args

from app.i18n import TextLike, number, say
from app.panel.widgets.displays import LampState
from app.panel.widgets.log_view import LEVELS as LOG_LEVELS
from app.web.gallery import texts
from app.web.gallery.examples import AT, NOT_LIVE, TOPIC, Example, Table

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
                "text": say(f"lamp_{state}"),
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
        {"state": "waiting", "note": say("camera_waiting", topic="/camera")},
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
LOG: Final[Table] = {"label": texts.ROBOT_LOG.table, "lines": 10}
LOGS: Final = (
    Example("lines", "log", LOG, {"state": "live", "note": "", "count": "5"}),
    Example(
        "waiting",
        "log",
        LOG,
        {"state": "waiting", "note": say("readout_waiting", topic="/rosout"), "count": "0"},
    ),
    Example("cut off", "log", LOG, {"state": "old", "note": say("rosout_no_connection"), "count": "5"}),
)


MESSAGES: Final = ("moves", "cycle started", "the gripper is slow", "no part gripped", "axis 3 stands")
LINES: Final[Sequence[Mapping[str, TextLike]]] = [
    {
        "time": AT,
        "at": "2026-11-21T10:00:00+00:00",
        "level": level,
        "word": say(f"rosout_{level}"),
        "node": "cell",
        "text": text,
    }
    for level, text in zip(LOG_LEVELS, MESSAGES, strict=True)
]

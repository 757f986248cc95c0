"""Readouts, lamps, cameras and logs in each of their states."""

from typing import Final

from app.panel.widgets.log_view import LEVELS as LOG_LEVELS
from app.web.gallery.examples import NOT_LIVE, TOPIC, Example, Table, Texts

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
        for state, note in NOT_LIVE.items()
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
        for state, note in NOT_LIVE.items()
    ),
    Example("a value of no state", "indicator", LAMP, LIVE | {"text": "Value 3", "shape": "unknown"}),
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
    """The same lines for every question."""

    def __missing__(self, _: str) -> list[Texts]:
        texts = ("moves", "cycle started", "the gripper is slow", "no part gripped", "axis 3 stands")
        return [
            {"time": "14:31:58", "level": level, "word": level.title(), "node": "cell", "text": text}
            for level, text in zip(LOG_LEVELS, texts, strict=True)
        ]


LINES: Final = Everyones()

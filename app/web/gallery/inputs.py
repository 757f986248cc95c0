"""Inputs, parameters and static parts in each of their states."""

from typing import Final

from app.i18n import TextLike, number, say
from app.robot.command_status import OutcomeCode
from app.web.gallery import texts
from app.web.gallery.examples import AT, BEFORE, CALLED, LOCKED, Example, Table

NUMBER: Final[Table] = {"label": texts.SPEED.table, "unit": "mm/s", "min": 10, "max": 250}
LIMITS: Final[Table] = {"limits": say("limits", low="10", high="250", unit=" mm/s", step="1")}
SELECT: Final[Table] = {
    "label": texts.PROGRAM.table,
    "options": [{"value": 12, "label": texts.BOXES.table}],
}
INPUTS: Final = (
    Example("empty", "text", {"label": texts.ORDER.table}),
    Example("filled", "text", {"label": texts.ORDER.table, "default": "4711"}),
    Example("select", "select", SELECT),
    Example("empty", "number", NUMBER, LIMITS),
    Example("filled", "number", NUMBER, LIMITS, entered=120),
    Example("out of limits", "number", NUMBER, LIMITS, entered=400),
    Example("slider", "slider", NUMBER, LIMITS, entered=120),
    Example("off", "toggle", {"label": texts.WRAPPER.table}),
    Example("on", "toggle", {"label": texts.WRAPPER.table}, entered=True),
)
PARAMETER: Final[Table] = {
    "label": texts.BELT_SPEED.table,
    "node": "/controller",
    "parameter": "speed",
    "type": "double",
    "unit": "mm/s",
}
KNOWN: Final[Table] = CALLED | {
    "state": "live",
    "text": number("120.5", "mm/s"),
    "note": say("parameter_read", time=BEFORE),
    "hint": "",
    "limits": say("limits_both", low="10", high="250", unit=" mm/s"),
    "settable": True,
    "askable": True,
    "entry": "120.5",
    "bounds": {"min": "10", "max": "250", "step": "any"},
}
ABSENT: Final[Table] = KNOWN | LOCKED | {"text": "—", "entry": "", "askable": False}
OFF_LIMITS: Final[tuple[OutcomeCode, TextLike]] = (
    "refused",
    say(
        "refused",
        time=AT,
        why=say(
            "input_outside_limits", label=texts.BELT_SPEED.shown, given="300", limits=KNOWN["limits"]
        ),
    ),
)
PARAMETERS: Final = (
    Example(
        "waiting",
        "parameter",
        PARAMETER,
        ABSENT | {"state": "waiting", "note": say("parameter_waiting_for_node", node="/controller")},
    ),
    Example("live", "parameter", PARAMETER, KNOWN),
    Example(
        "old",
        "parameter",
        PARAMETER,
        KNOWN | {"state": "old", "note": say("parameter_read_before_disconnect", time=BEFORE)},
    ),
    Example(
        "missing",
        "parameter",
        PARAMETER,
        ABSENT | {"state": "missing", "note": say("parameter_not_declared", node="/controller")},
    ),
    Example("locked", "parameter", PARAMETER, KNOWN | LOCKED),
    Example("refused", "parameter", PARAMETER, KNOWN, 300, OFF_LIMITS),
    Example("set by another only", "parameter", PARAMETER, KNOWN | {"settable": False}),
)
STATIC: Final = (
    Example("label", "label", {"label": texts.ORDER_NOTE.table}),
    Example("large label", "label", {"label": texts.PALLETIZING.table, "size": "large"}),
    Example("small label", "label", {"label": texts.RIBBON.table, "size": "small"}),
    Example("link", "link", {"label": texts.SETUP.table, "page": "setup", "icon": "settings"}),
    Example("image", "image", {"label": texts.BOX.table, "src": "box.svg"}),
)

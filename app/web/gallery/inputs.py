"""Inputs, parameters and static parts in each of their states."""

from typing import Final

from app.web.gallery.examples import CALLED, LOCKED, Example, Table

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

"""Names of constants in a panel file: what they stand for, by the message that a field is in."""

from collections.abc import Mapping
from typing import Any

from app.interfaces import INTEGERS, Interfaces
from app.panel.displays import Indicator, Readout
from app.panel.model import Panel


def holder(of: Readout | Indicator, interfaces: Interfaces) -> str:
    """The type whose constants a field's values have: that of the message around it."""
    around, _, _ = of.field.rpartition(".")
    return interfaces.field_type(of.type, around) if around else of.type


def value_of_state(given: bool | int | str, kind: str, constants: Mapping[str, Any]) -> Any:
    """What a lamp's state is for: a text is a constant's name where the field is a whole number.

    A name that there is no constant of stays what it is.
    """
    named = isinstance(given, str) and kind in INTEGERS
    return constants.get(str(given), given) if named else given


def resolved(panel: Panel, interfaces: Interfaces) -> Panel:
    """The checked panel, with the value of each constant that a lamp names."""
    pages = []
    for page in panel.pages:
        lamps = (_lamp(w, interfaces) if isinstance(w, Indicator) else w for w in page.widgets)
        pages.append(page.model_copy(update={"widgets": tuple(lamps)}))
    return panel.model_copy(update={"pages": tuple(pages)})


def _lamp(lamp: Indicator, interfaces: Interfaces) -> Indicator:
    kind = interfaces.field_type(lamp.type, lamp.field)
    constants = interfaces.constants(holder(lamp, interfaces))
    states = [
        one.model_copy(update={"value": value_of_state(one.value, kind, constants)})
        for one in lamp.states
    ]
    return lamp.model_copy(update={"states": tuple(states)})

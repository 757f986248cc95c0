"""Names of constants in a panel file: what they stand for, by the message that a field is in."""

from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Any

from app.interfaces import INTEGERS, TEXTS, Interfaces, Type, around, name_of
from app.panel.interlock import Interlock
from app.panel.model import Panel
from app.panel.number_range import single
from app.panel.widgets.displays import Indicator, Readout


def holder(of: Readout | Indicator | Interlock, interfaces: Interfaces) -> str:
    """The type whose constants a field's values have: that of the message around it."""
    where = around(of.field)
    return interfaces.field_type(of.type, where) if where else of.type


def value_of_state(given: bool | int | str, kind: str, constants: Mapping[str, Any]) -> Any:
    """What a lamp's state is for: a text is a constant's name where the field is a whole number.

    A name that there is no constant of stays what it is.
    """
    named = isinstance(given, str) and kind in INTEGERS
    return constants.get(str(given), given) if named else given


def meant(given: Any, kind: Type, constants: Mapping[str, Any]) -> Any:
    """What an interlock's condition means: a text is a constant's name where the field is none.

    A name that there is no constant of stays what it is.
    """
    named = isinstance(given, str) and kind.name not in TEXTS
    return constants.get(given, given) if named else given


def compared(given: Any, kind: Type, constants: Mapping[str, Any]) -> Any:
    """The same as the field's type has it: the float32 for 0.1 is another number than the float64."""
    value = meant(given, kind, constants)
    return single(value) if kind.name == "float32" else value


def resolved(panel: Panel, interfaces: Interfaces) -> Panel:
    """The checked panel, with the value of each constant that a lamp or an interlock names."""
    pages = []
    for page in panel.pages:
        lamps = (_lamp(w, interfaces) if isinstance(w, Indicator) else w for w in page.widgets)
        pages.append(page.model_copy(update={"widgets": tuple(lamps)}))
    interlocks = tuple(_interlock(one, interfaces) for one in panel.interlocks)
    return panel.model_copy(update={"pages": tuple(pages), "interlocks": interlocks})


def _interlock(of: Interlock, interfaces: Interfaces) -> Interlock:
    kind = interfaces.type_at(of.type, of.field)
    constants = interfaces.constants(holder(of, interfaces))
    values = {
        key: tuple(compared(one, kind, constants) for one in given)
        if key == "one_of"
        else compared(given, kind, constants)
        for key, given in of.conditions.items()
    }
    return of.resolved(values, _names(of, kind, constants))


def _names(of: Interlock, kind: Type, constants: Mapping[str, Any]) -> dict[Any, str]:
    """Value → name of the constants which are named as those that the conditions name; of several for
    one value none. Without what begins all of them, where that is the field's own name."""
    given = [one for key in of.conditions for one in _each(getattr(of, key))]
    named = [one for one in given if isinstance(one, str) and kind.name not in TEXTS]
    if not named:
        return {}
    own = f"{name_of(of.field)}_".upper()
    alike = own if all(name.startswith(own) for name in named) else _alike(named)
    found: dict[Any, list[str]] = {}
    for name, value in constants.items():
        if name.startswith(alike):
            found.setdefault(value, []).append(name.removeprefix(own))
    return {value: names[0] for value, names in found.items() if len(names) == 1}


def _alike(names: Sequence[str]) -> str:
    """The words that all begin with, each with its "_"."""
    begins = zip(*(name.split("_")[:-1] for name in names), strict=False)
    return "".join(f"{words[0]}_" for words in takewhile(lambda words: len({*words}) == 1, begins))


def _each(given: Any) -> tuple[Any, ...]:
    return given if isinstance(given, tuple) else (given,)


def _lamp(lamp: Indicator, interfaces: Interfaces) -> Indicator:
    kind = interfaces.field_type(lamp.type, lamp.field)
    constants = interfaces.constants(holder(lamp, interfaces))
    states = [
        one.model_copy(update={"value": value_of_state(one.value, kind, constants)})
        for one in lamp.states
    ]
    return lamp.model_copy(update={"states": tuple(states)})

"""The values of a recipe's fields: checked, and as a reader sees them. Pure."""

import json
from collections.abc import Iterable, Mapping
from typing import Any, Final

from app.errors import InputError
from app.i18n import Text, TextLike, joined, number, say
from app.panel.number_range import decimal_text
from app.panel.values import same_value
from app.panel.widgets.families import Input
from app.panel.widgets.inputs import SelectInput, ToggleInput
from app.panel.widgets.numbers import Numeric
from app.printable import printable
from app.recipes.recipe import Difference

NOTHING: Final = "—"
LONGEST: Final = 80  # characters of a text
DIGITS: Final = 9
REPORTED_DIGITS: Final = 7  # of a float32
MOST_CHANGES: Final = 8  # that a sentence names


def checked_values(fields: Iterable[Input], values: Mapping[str, Any]) -> dict[str, Any]:
    """The values of all fields, as they are kept; InputError for one that is missing or that its input
    refuses."""
    checked = {}
    for field in fields:
        if field.id not in values:
            raise InputError(say("recipe_field_missing", label=field.label))
        checked[field.id] = field.check_value(values[field.id])
    return checked


def value_text(field: Input, value: Any) -> TextLike:
    """A value of a recipe as text, with its unit."""
    if value is None:
        return NOTHING
    if isinstance(field, SelectInput):
        option = next((o for o in field.own_options if same_value(o.value, value)), None)
        if option is not None:
            return option.label
    if isinstance(field, ToggleInput) and isinstance(value, bool):
        return field.on if value else field.off
    if isinstance(field, Numeric) and isinstance(value, int | float) and not isinstance(value, bool):
        return number(number_of(value), field.unit)
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=str)
    return printable(text[:LONGEST])


def number_of(value: float) -> str:
    """A number as plain text; a float32's noise is left out."""
    return str(value) if isinstance(value, int) else decimal_text(float(f"{value:.{DIGITS}g}"))


def entered_value(field: Input, reported: Any) -> Any:
    """What the robot has, as it would be entered: in the unit of the input."""
    if not isinstance(field, Numeric) or isinstance(reported, bool):
        return reported
    if not isinstance(reported, int | float):
        return reported
    exact = float(f"{reported:.{REPORTED_DIGITS}g}") if isinstance(reported, float) else reported
    return field.entered_value(exact)


def reported_text(field: Input, reported: Any) -> TextLike:
    """The same as text, with its unit."""
    return value_text(field, entered_value(field, reported))


def changes_text(changes: Iterable[tuple[TextLike, TextLike, TextLike]]) -> TextLike:
    """(label, old, new) of some fields as one text: "Layers 5 → 6, Arm speed 100 → 80 %"."""
    every = [
        say("recipe_first", label=label, new=new)
        if old == NOTHING
        else say("recipe_change", label=label, old=old, new=new)
        for label, old, new in changes
    ]
    shown: list[Text] = every[:MOST_CHANGES]
    if len(every) > MOST_CHANGES:
        shown.append(say("recipe_more_changes", number=len(every) - MOST_CHANGES))
    return joined(shown, "between_names")


def differences_text(fields: Iterable[Input], changes: Iterable[Difference]) -> TextLike:
    """The changes of a recipe's values as one text."""
    known = {field.id: field for field in fields}
    return changes_text(
        (
            known[change.field].label,
            value_text(known[change.field], change.old),
            value_text(known[change.field], change.new),
        )
        for change in changes
        if change.field in known
    )

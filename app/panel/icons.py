"""The names of icons in a panel file."""

from typing import Annotated

from pydantic import AfterValidator

from app.icons import icons
from app.interfaces.validation import format_value
from app.panel.faults.wording import closest_name


def _check_icon(given: str) -> str:
    if given in icons():
        return given
    meant = closest_name(given.lower(), icons())
    hint = f'did you mean "{meant}"?' if meant else "docs/reference/icons.md lists them"
    raise ValueError(f"{format_value(given)} is not one of the shipped icons: {hint}")


Icon = Annotated[str, AfterValidator(_check_icon)]

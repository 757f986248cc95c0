"""What is shown as a time: formats of the panel file, and types of ROS 2."""

from collections.abc import Iterator, Mapping
from typing import Final

from app.panel.numbers import NUMBERS
from app.system.errors import Fault

TIME: Final = "builtin_interfaces/msg/Time"
DURATION: Final = "builtin_interfaces/msg/Duration"
DEFAULT_FORMATS: Final[Mapping[str, str]] = {TIME: "time", DURATION: "duration"}
TIME_FORMATS: Final = ("time", "age", "duration")


def time_faults(place: str, style: str | None, kind: str, unit: object) -> Iterator[Fault]:
    """Faults of a format, of a field of this type, that is one of times; or is none, where the field is
    a time."""
    if kind in DEFAULT_FORMATS and style is not None and style not in TIME_FORMATS:
        message = f'"{style}" is for numbers; this is {kind}: its formats are {", ".join(TIME_FORMATS)}'
        yield Fault(f"{place}.format", message)
    elif kind == DURATION and style in ("time", "age"):
        message = f'"{style}" is for a time; this is {kind}: its format is duration'
        yield Fault(f"{place}.format", message)
    elif style in TIME_FORMATS and kind not in NUMBERS and kind not in DEFAULT_FORMATS:
        yield Fault(
            f"{place}.format", f'"{style}" is for times and for numbers of seconds; this is {kind}'
        )
    elif unit and (style in TIME_FORMATS or kind in DEFAULT_FORMATS):
        yield Fault(f"{place}.unit", "is not for times: their texts have units")

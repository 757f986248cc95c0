"""Times as forms send them: `2026-11-21T10:00`, in the server's zone where they have none."""

from datetime import datetime
from typing import Annotated, Final

from pydantic import Field, JsonValue

from app.errors import InputError

# For who writes programs; what is no time of the calendar is refused with a sentence.
A_TIME: Final[dict[str, JsonValue]] = {
    "pattern": (
        r"^((19[7-9]\d|20\d\d)-(0[1-9]|1[0-2])-(0[1-9]|1\d|2[0-8])"
        r"(T([01]\d|2[0-3]):[0-5]\d(:[0-5]\d)?(Z|[+-](0\d|1[0-2]):00)?)?)?$"
    ),
    "examples": ["2026-11-21T10:00"],
}
TypedTime = Annotated[str, Field(max_length=40, json_schema_extra=A_TIME)]


def typed_ms(name: str, text: str, fold: int = 0) -> int | None:
    """Milliseconds since 1970, None for ""; InputError for what is no time. `fold` is which of two
    times, where the clock shows a time twice: 1 for the later."""
    if not text:
        return None
    try:
        return int(datetime.fromisoformat(text).replace(fold=fold).timestamp() * 1000)
    except (ValueError, OverflowError, OSError):
        raise InputError(f'{name}: "{text}" is no time: it must be like 2026-11-21T10:00') from None

"""What is said on the WebSocket of a hold.

The server speaks first. Every message of the server's has `stamp`, its own time in ms since the socket
opened; every message of the browser's has the last `stamp` that it got, and `after`, for how many ms it
had it: so each one's age is known. Without an answer no browser shows that something is held.

    server   {"stamp": 0.2}
    browser  {"do": "begin", "inputs": {…}, "seen": "<instance>-<version>", "stamp": 0.2, "after": 0.9}
    server   {"stamp": 2.1, "state": "held", "lease": "…", "reason": "Held since 10:00:00."}
    browser  {"do": "beat", "number": 1, "lease": "…", "stamp": 2.1, "after": 80}
    server   {"stamp": 83.0, "state": "held"}
    browser  {"do": "end", "why": "released", "lease": "…", "stamp": 83.0, "after": 12}
    server   {"stamp": 96.4, "state": "ended", "outcome": "published", "code": "hold_released", …}

A joystick's beats have its deflection, `x` to the right and `y` to the front, each from -1 to 1; the
answer has `moves`, what was sent of it. One out of these limits is no message, and ends the hold.

A begin may have a `confirmation`, for a widget whose press a person confirms.

An end without a lease is that of a browser which has no answer to its begin yet; it may come instead of
a begin, too, and is answered as any other.
"""

from collections.abc import Mapping
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue, TypeAdapter, ValidationError

from app.commands.holds.deflection import Deflection
from app.commands.holds.receipts import RELEASED
from app.commands.press import EVENT_ID
from app.errors import InputError
from app.web.confirmations import LONGEST_TOKEN
from app.web.request_body import json_of

# What a browser may say of why it ends a hold → the code of the sentence.
END_REASONS: Final[Mapping[str, str]] = {
    "released": RELEASED,
    "cancel": "hold_by_cancel",
    "sliding": "hold_by_sliding",
    "second": "hold_by_second_finger",
    "menu": "hold_by_menu",
    "blur": "hold_by_blur",
    "hiding": "hold_by_hiding",
    "leaving": "hold_by_leaving",
    "lock": "hold_by_lock",
    "escape": "hold_by_escape",
    "silence": "hold_by_no_response",
}
Deflected = Annotated[float, Field(ge=-1, le=1, allow_inf_nan=False)]
Milliseconds = Annotated[float, Field(ge=0, le=1e12, allow_inf_nan=False)]


class HoldMessage(BaseModel):
    """The fields of every message of a browser."""

    model_config = ConfigDict(extra="forbid")

    stamp: Milliseconds
    after: Milliseconds


class Begin(HoldMessage):
    do: Literal["begin"]
    inputs: dict[str, JsonValue]
    seen: Annotated[str, Field(pattern=EVENT_ID)]
    confirmation: Annotated[str, Field(max_length=LONGEST_TOKEN)] = ""


class Beat(HoldMessage):
    do: Literal["beat"]
    lease: str
    number: Annotated[int, Field(ge=1)]
    x: Deflected | None = None
    y: Deflected | None = None

    @property
    def deflection(self) -> Deflection | None:
        """The deflection of a joystick, if both axes are given."""
        return None if self.x is None or self.y is None else (self.x, self.y)


class End(HoldMessage):
    do: Literal["end"]
    lease: str = ""
    why: str


Message = Begin | Beat | End
_message: TypeAdapter[Message] = TypeAdapter(Annotated[Message, Field(discriminator="do")])


def read_message(text: str) -> Message | None:
    """The message in a browser's text; None if it is invalid."""
    try:
        return _message.validate_python(json_of(text))
    except (InputError, ValidationError):
        return None

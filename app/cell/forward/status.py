"""How the forwarding goes, as the forwarder's process tells the server."""

import json
from dataclasses import dataclass, field
from typing import Any

from app.system.texts import Text, TextLike, text_in


@dataclass(slots=True)
class ForwardStatus:
    """`fault`: why nothing is sent, "" if it is, and `since` when (seconds since the epoch; 0 before
    the first try). `note`: what is not as it should be though it is sent. `rows` are not sent, of
    which the oldest is of the time `oldest` (seconds since the epoch, None without one), `size` about
    how many bytes they have, `unsent` their number by stream. `sent` counts rows of this run,
    `sent_at` is when the last batch was sent, `took_s` how long its commit took."""

    address: str = ""
    connected: bool = False
    fault: TextLike = ""
    note: TextLike = ""
    since: float = 0.0
    rows: int = 0
    oldest: float | None = None
    size: int = 0
    sent: int = 0
    sent_at: float = 0.0
    took_s: float = 0.0
    unsent: dict[str, int] = field(default_factory=dict)

    def lag_s(self, now: float) -> float:
        """The age of the oldest row that is not sent, 0 without one; `now` is in seconds since the
        epoch."""
        return max(0.0, now - self.oldest) if self.oldest is not None else 0.0

    def as_json(self) -> str:
        values = {name: getattr(self, name) for name in ForwardStatus.__slots__}
        return json.dumps(values | {name: _as_json(values[name]) for name in ("fault", "note")})


def parse_status(text: str) -> ForwardStatus:
    """The status in the JSON of `as_json`."""
    values: dict[str, Any] = json.loads(text)
    return ForwardStatus(**(values | {name: _text(values[name]) for name in ("fault", "note")}))


def _as_json(text: TextLike) -> Any:
    return text.as_json() if isinstance(text, Text) else text


def _text(value: Any) -> TextLike:
    return text_in(json.dumps(value)) if isinstance(value, dict) else str(value)

"""What is known of the topic of a camera while a browser shows it."""

import math
from dataclasses import dataclass

from app.i18n import TextLike


@dataclass(slots=True)
class LookedAt:
    """`at` (monotonic seconds) and `wall` (seconds since the epoch) are those of the newest message,
    shown or not; `problem` is why the newest that was wanted can't be shown, "" if it can."""

    at: float = -math.inf
    wall: float = 0.0
    problem: TextLike = ""

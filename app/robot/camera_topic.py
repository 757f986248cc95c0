"""The state of a camera's topic while it is subscribed to: while a browser shows it."""

import math
from dataclasses import dataclass

from app.i18n import TextLike


@dataclass(slots=True)
class CameraTopicState:
    """`at` (monotonic seconds) and `wall` (seconds since the epoch) are those of the newest message,
    shown or not. `problem` is why the last frame that was requested can't be shown, "" if it can."""

    at: float = -math.inf
    wall: float = 0.0
    problem: TextLike = ""

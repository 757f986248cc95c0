"""Since when each link to the robot is as it is."""

import time
from collections.abc import Callable
from dataclasses import replace

from app.lamps import LinkLamp
from app.sentences import moment
from app.views import Sight

BROWSERS_OWN = "server"  # each browser knows for itself since when it is connected


class Since:
    """Remembers the state of each link and when it began."""

    def __init__(self, wall: Callable[[], float] = time.time) -> None:
        """`wall` gives seconds since the epoch."""
        self._wall = wall
        self._began: dict[str, tuple[tuple[str, str], str]] = {}

    def dated(self, seen: Sight) -> Sight:
        """The same, with `since` for the links that the server knows of."""
        link = {name: self._dated(name, lamp) for name, lamp in seen.view["link"].items()}
        return replace(seen, view={**seen.view, "link": link})

    def _dated(self, name: str, lamp: LinkLamp) -> LinkLamp:
        if name == BROWSERS_OWN:
            return lamp
        state = (lamp["state"], lamp["text"])
        known = self._began.get(name)
        if known is None or known[0] != state:
            known = self._began[name] = (state, moment(self._wall()))
        return {**lamp, "since": known[1]}

"""Since when each link to the robot is as it is."""

import time
from collections.abc import Callable, Mapping

from app.lamps import LinkLamp
from app.sentences import moment

BROWSERS_OWN = "server"  # each browser knows for itself since when it is connected


class Since:
    """Remembers the state of each link and when it began."""

    def __init__(self, wall: Callable[[], float] = time.time) -> None:
        """`wall` gives seconds since the epoch."""
        self._wall = wall
        self._began: dict[str, tuple[tuple[str, str], str]] = {}
        self._seen: Mapping[str, LinkLamp] = {}
        self._dated: dict[str, LinkLamp] = {}

    def dated(self, links: Mapping[str, LinkLamp]) -> dict[str, LinkLamp]:
        """The same, with `since` for those that the server knows of."""
        if links != self._seen:
            self._seen = links
            self._dated = {name: self._of(name, lamp) for name, lamp in links.items()}
        return self._dated

    def _of(self, name: str, lamp: LinkLamp) -> LinkLamp:
        if name == BROWSERS_OWN:
            return lamp
        state = (lamp["state"], lamp["text"])
        known = self._began.get(name)
        if known is None or known[0] != state:
            known = self._began[name] = (state, moment(self._wall()))
        return {**lamp, "since": known[1]}

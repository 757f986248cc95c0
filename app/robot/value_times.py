"""Since when fields have had their values, as the panel has heard it."""

from collections.abc import Collection, Mapping
from typing import Any, Final

from app.interfaces import Fields

NO_TIMES: Final[Mapping[str, float]] = {}


class ValueTimes:
    """The wall time of each field's last change, for some fields of one topic.

    The first value that is heard, and the first after a cut, may be older than its message: its time
    is not known.
    """

    def __init__(self, paths: Collection[str] = ()) -> None:
        self._paths = paths
        self._values: dict[str, Any] = {}
        self._times: Mapping[str, float] = NO_TIMES

    def update(self, fields: Fields, wall: float) -> Mapping[str, float]:
        """Path → seconds since the epoch of the fields whose change was heard, after a message that was
        received at `wall`."""
        for path in self._paths:
            value = fields.get(path)
            if path in self._values and value != self._values[path]:
                self._times = {**self._times, path: wall}
            self._values[path] = value
        return self._times

    def clear(self) -> None:
        """The last values are no longer valid."""
        self._values.clear()
        self._times = NO_TIMES

"""What the events of a page have said last, of a panel that is served here or elsewhere."""

import json
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple


class Event(NamedTuple):
    """A server-sent event with its JSON, and its id, "" without one."""

    name: str
    data: Any
    id: str


def read_events(lines: Iterable[bytes]) -> Iterator[Event]:
    """The events of a stream. ValueError for data that is no JSON."""
    name, data, event_id = "", "", ""
    for line in lines:
        key, _, value = line.decode().rstrip("\r\n").partition(": ")
        if key == "event":
            name = value
        elif key == "id":
            event_id = value
        elif key == "data":
            data = value
        elif not key and data:
            yield Event(name, json.loads(data), event_id)
            name, data, event_id = "", "", ""


@dataclass
class Shown:
    """The newest of each section. Changed by the thread that reads the events. `ahead_s` is what the
    server's clock shows more than this machine's monotonic one."""

    widgets: dict[str, dict[str, Any]] = field(default_factory=dict)
    interlocks: dict[str, dict[str, Any]] = field(default_factory=dict)
    alarms: dict[str, Any] = field(default_factory=dict)
    link: dict[str, dict[str, Any]] = field(default_factory=dict)
    control: dict[str, Any] = field(default_factory=dict)
    revision: str = ""
    event_id: str = ""
    ahead_s: float = 0.0
    changed_at: float = 0.0  # monotonic seconds
    changed: threading.Condition = field(default_factory=threading.Condition)

    def take(self, event: Event) -> None:
        name, data = event.name, event.data
        with self.changed:
            self.event_id = event.id or self.event_id
            if name == "snapshot":
                self._take_snapshot(data)
            elif name == "update":
                _update(self.widgets, data)
            elif name == "link":
                _update(self.link, data)
            elif name == "control":
                self.control = {**self.control, **data}
            elif name == "alarms":
                rows = {**self.alarms.get("rows", {}), **data.get("rows", {})}
                self.alarms = {**self.alarms, **data, "rows": rows}
            elif name == "beat":
                self.ahead_s = data["now"] / 1000 - time.monotonic()
            elif name.endswith("-enabled-updated"):
                _update(self.interlocks, {name.removesuffix("-enabled-updated"): data})
            self.changed_at = time.monotonic()
            self.changed.notify_all()

    def _take_snapshot(self, data: Mapping[str, Any]) -> None:
        self.widgets, self.interlocks, self.link = {}, {}, {}
        _update(self.widgets, data["widgets"])
        _update(self.interlocks, data["interlocks"])
        _update(self.link, data["link"])
        self.alarms, self.control = dict(data["alarms"]), dict(data["control"])
        self.revision = data["revision"]

    def wait(self, condition: Callable[[], bool], within_s: float) -> float | None:
        """When a condition was true (monotonic seconds); None if it was not in time."""
        end = time.monotonic() + within_s
        with self.changed:
            while not condition():
                if (left_s := end - time.monotonic()) <= 0:
                    return None
                self.changed.wait(left_s)
            return self.changed_at

    def is_locked(self, control: str) -> bool:
        """Whether a control is locked."""
        return self.widgets.get(control, {}).get("enabled") is False

    def reasons(self, control: str) -> str:
        """Why it is locked, as the page says it."""
        shown = self.widgets.get(control, {})
        return str(shown.get("reasons") or shown.get("reason") or "")

    def alarm(self, name: str) -> Mapping[str, Any]:
        """The row of an alarm; {} while it is normal."""
        return self.alarms.get("rows", {}).get(name) or {}


def _update(section: dict[str, dict[str, Any]], changes: Mapping[str, Mapping[str, Any]]) -> None:
    for name, values in changes.items():
        section.setdefault(name, {}).update(values)

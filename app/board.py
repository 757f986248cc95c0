"""The latest view with a version, and the events that bring a browser from one to another.

There is no queue: a stream remembers the view that it sent last and, whenever it can send, gets
the difference to the newest. What is sent is encoded once for all streams: those that are equally
far share the same bytes, the others those of each event that says all of something.
"""

import asyncio
import json
import secrets
from collections.abc import Mapping
from typing import Any, Final

from app.heartbeat import Heartbeat
from app.views import View

# Its text has no line break: it is one line of an event.
ENCODE: Final = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode


class Board:
    """Where the view is posted; changed on the event loop only."""

    def __init__(self, view: View, revision: str) -> None:
        """`revision` is of all that a page has loaded: one that differs makes it load anew."""
        self.boot = secrets.token_hex(4)
        self.version = 1
        self.view = view
        self.revision = revision
        self.heartbeat = Heartbeat(self._wake)
        self._changed = asyncio.Event()
        self._prepared: dict[int, bytes] = {}
        self._whole: dict[str, bytes] = {}
        self._turned: dict[str, int] = {}
        self.closed = False

    @property
    def id(self) -> str:
        """`<boot>-<version>`, the id of the events that lead here."""
        return f"{self.boot}-{self.version}"

    def post(self, view: View) -> None:
        """A view as of now; nothing happens if it is the same as before."""
        if view == self.view:
            return
        self.version += 1
        for name, attributes in view["widgets"].items():
            if attributes.get("enabled") != self.view["widgets"].get(name, {}).get("enabled"):
                self._turned[name] = self.version
        self.view = view
        self._prepared = {}
        self._whole = {}
        self.heartbeat.along()
        self._wake()

    def turned(self, widget: str) -> int:
        """The version in which a widget's lock has last closed or opened; 0 if it never has."""
        return self._turned.get(widget, 0)

    def close(self) -> None:
        """Ends every stream."""
        self.closed = True
        self._wake()

    def _wake(self) -> None:
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    async def news(self, version: int, beats: int) -> None:
        """Waits for a version after `version`, a heartbeat after `beats`, or the end."""
        if not self.closed and (self.version, self.heartbeat.count) == (version, beats):
            await self._changed.wait()

    def snapshot(self) -> bytes:
        """The `snapshot` event: everything that the page shows."""
        return self._all_of("snapshot", {"id": self.id, "revision": self.revision, **self.view})

    def since(self, version: int, view: View) -> bytes:
        """The events from a view that was posted as `version` to the newest one."""
        prepared = self._prepared.get(version)
        if prepared is None:
            prepared = self._prepared[version] = self._difference(view)
        return prepared

    def _difference(self, old: View) -> bytes:
        new = self.view
        events = [
            self._all_of(f"{name}-enabled-updated", state)
            for name, state in new["interlocks"].items()
            if old["interlocks"].get(name) != state
        ]
        widgets = {
            name: _changed(known, attributes)
            for name, attributes in new["widgets"].items()
            if (known := old["widgets"].get(name, {})) != attributes
        }
        if widgets:
            events.append(self._event("update", widgets))
        if old["link"] != new["link"]:
            events.append(self._all_of("link", new["link"]))
        if old["control"] != new["control"]:
            events.append(self._all_of("control", new["control"]))
        if old["notice"] != new["notice"]:
            events.append(self._all_of("notice", new["notice"]))
        if old["robots"] != new["robots"]:
            events.append(self._all_of("robots", new["robots"]))
        return b"".join(events)

    def _all_of(self, name: str, data: Mapping[str, Any]) -> bytes:
        """An event that is the same whatever was sent before."""
        whole = self._whole.get(name)
        if whole is None:
            whole = self._whole[name] = self._event(name, data)
        return whole

    def _event(self, name: str, data: Mapping[str, Any]) -> bytes:
        return f"event: {name}\ndata: {ENCODE(data)}\nid: {self.id}\n\n".encode()


def told(browser: str) -> bytes:
    """Tells a page the id of its browser: it knows by it what `control` means for it."""
    return f"event: browser\ndata: {ENCODE({'id': browser})}\n\n".encode()


def _changed(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in new.items() if key not in old or old[key] != value}

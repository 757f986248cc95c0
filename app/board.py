"""The latest view with a version, and the events that bring a browser from one to another.

There is no queue: a stream remembers the view that it sent last and, whenever it can send, gets
the difference to the newest. Streams that are equally far share the same prepared bytes.
"""

import asyncio
import json
import secrets
import time
from collections.abc import Mapping
from typing import Any

from fastapi.sse import format_sse_event

from app import moments
from app.sentences import clock
from app.views import View


class Board:
    """Where the view is posted; changed on the event loop only."""

    def __init__(self, view: View, revision: str) -> None:
        """`revision` is of all that a page has loaded: one that differs makes it load anew."""
        self.boot = secrets.token_hex(4)
        self.version = 1
        self.view = view
        self.revision = revision
        self._changed = asyncio.Event()
        self._prepared: dict[int, bytes] = {}
        self._snapshot: bytes | None = None
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
        self._snapshot = None
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

    async def newer(self, version: int, timeout_s: float) -> bool:
        """Waits for a version after `version` or the end; False if neither came in time."""
        if self.version > version or self.closed:
            return True
        try:
            async with asyncio.timeout(timeout_s):
                await self._changed.wait()
        except TimeoutError:
            return False
        return True

    def snapshot(self) -> bytes:
        """The `snapshot` event: everything that the page shows."""
        if self._snapshot is None:
            data = {"id": self.id, "revision": self.revision, **self.view}
            self._snapshot = self._event("snapshot", data)
        return self._snapshot

    def since(self, version: int, view: View) -> bytes:
        """The events from a view that was posted as `version` to the newest one."""
        prepared = self._prepared.get(version)
        if prepared is None:
            prepared = self._prepared[version] = self._difference(view)
        return prepared

    def _difference(self, old: View) -> bytes:
        new = self.view
        events = [
            self._event(f"{name}-enabled-updated", state)
            for name, state in new["interlocks"].items()
            if old["interlocks"].get(name) != state
        ]
        widgets = {
            name: changed
            for name, attributes in new["widgets"].items()
            if (changed := _changed(old["widgets"].get(name, {}), attributes))
        }
        if widgets:
            events.append(self._event("update", widgets))
        if old["link"] != new["link"]:
            events.append(self._event("link", new["link"]))
        if old["control"] != new["control"]:
            events.append(self._event("control", new["control"]))
        if old["notice"] != new["notice"]:
            events.append(self._event("notice", new["notice"]))
        if old["robots"] != new["robots"]:
            events.append(self._event("robots", new["robots"]))
        return b"".join(events)

    def _event(self, name: str, data: Mapping[str, Any]) -> bytes:
        text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
        return format_sse_event(event=name, data_str=text, id=self.id)


def beat() -> bytes:
    """The heartbeat: a page that misses it locks itself. It has no id: nothing has changed.

    `clock` is to be shown; `now` is the server's own time, in milliseconds.
    """
    data = {"clock": clock(time.time()), "now": round(moments.now() * 1000)}
    return format_sse_event(event="beat", data_str=json.dumps(data))


def told(browser: str) -> bytes:
    """Tells a page the id of its browser: it knows by it what `control` means for it."""
    return format_sse_event(event="browser", data_str=json.dumps({"id": browser}))


def _changed(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in new.items() if key not in old or old[key] != value}

"""The latest view with a version, and the events that bring a browser from one to another.

There is no queue: a stream remembers the view that it sent last and, whenever it can send, gets
the difference to the newest. What is sent is encoded once for all streams of a language: those that are
equally far share the same bytes, the others those of each event that says all of something.
"""

import asyncio
import secrets
from collections.abc import Mapping
from typing import Any, Final

from pydantic_core import to_json

from app.i18n import ENGLISH, render
from app.view.heartbeat import Heartbeat
from app.view.sections import Events, difference
from app.view.view import View

# What some readers take for the end of a line, and JSON leaves as it is.
SEPARATORS: Final = {c.encode(): b"\\u%04x" % ord(c) for c in "\x85\u2028\u2029"}


def encoded(data: Mapping[str, Any], language: str = ENGLISH) -> bytes:
    """JSON in one line, for whoever reads lines; what is no number is null, a text is rendered."""
    text = to_json(data, inf_nan_mode="null", fallback=lambda one: render(one, language))
    for separator, escaped in SEPARATORS.items():
        text = text.replace(separator, escaped)
    return text


class ViewPublisher:
    """Where the view is posted; changed on the event loop only."""

    def __init__(self, view: View, revision: str) -> None:
        """`revision` is of all that a page has loaded: one that differs makes it load anew."""
        self.boot = secrets.token_hex(4)
        self.version = 1
        self.view = view
        self.revision = revision
        self.heartbeat = Heartbeat(self._wake)
        self._changed = asyncio.Event()
        self._news: Events = {}  # from the view before to this one
        self._prepared: dict[tuple[str, int], bytes] = {}  # by the language and the version before
        self._whole: dict[tuple[str, str], bytes] = {}  # by the language and the event
        self._turned: dict[str, int] = {}
        self.closed = False

    @property
    def id(self) -> str:
        """`<boot>-<version>`, the id of the events that lead here."""
        return f"{self.boot}-{self.version}"

    def post(self, view: View) -> None:
        """A view as of now; nothing happens if it is the same as before."""
        news = difference(self.view, view)
        if not news:
            return
        self.version += 1
        for widget, changed in news.get("update", {}).items():
            if "enabled" in changed:
                self._turned[widget] = self.version
        self.view, self._news = view, news
        self._prepared = {}
        self._whole = {}
        self.heartbeat.along()
        self._wake()

    def lock_changed_at(self, widget: str) -> int:
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

    def snapshot(self, language: str = ENGLISH) -> bytes:
        """The `snapshot` event: everything that the page shows."""
        everything = {"id": self.id, "revision": self.revision, **self.view}
        return self._all_of("snapshot", everything, language)

    def since(self, version: int, view: View, language: str = ENGLISH) -> bytes:
        """The events from a view that was posted as `version` to the newest one."""
        prepared = self._prepared.get((language, version))
        if prepared is None:
            latest = version == self.version - 1
            news = self._news if latest else difference(view, self.view)
            prepared = self._prepared[language, version] = b"".join(
                self._event(name, data, language)
                if name == "update"
                else self._all_of(name, data, language)
                for name, data in news.items()
            )
        return prepared

    def _all_of(self, name: str, data: Mapping[str, Any], language: str) -> bytes:
        """An event that is the same whatever was sent before."""
        whole = self._whole.get((language, name))
        if whole is None:
            whole = self._whole[language, name] = self._event(name, data, language)
        return whole

    def _event(self, name: str, data: Mapping[str, Any], language: str) -> bytes:
        lines = (name.encode(), encoded(data, language), self.id.encode())
        return b"event: %b\ndata: %b\nid: %b\n\n" % lines


def client_id_event(browser: str) -> bytes:
    """Tells a page the id of its browser: it knows by it what `control` means for it."""
    return b"event: browser\ndata: %b\n\n" % encoded({"id": browser})

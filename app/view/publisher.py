"""The latest view with a version, and the events that bring a browser from one to another.

There is no queue: a stream remembers the view that it sent last and, whenever it can send, gets
the difference to the newest. A client's role in control decides which view that is: there is one for
each role. What is sent is encoded once for all streams of a language and a role: those that are equally
far share the same bytes, the others those of each event that says all of something.

A page gets what its own widgets show, and those of the frame: their locks, not the permissions behind
them. Who names no page gets everything.
"""

import asyncio
import secrets
from collections.abc import Callable, Collection, Mapping
from typing import Any, Final

from pydantic_core import to_json

from app.i18n import ENGLISH, localized
from app.permission.control_authority_view import Role
from app.view.heartbeat import Heartbeat
from app.view.kinds import Attributes
from app.view.sections import PERMISSION_EVENT, Events, difference
from app.view.view import View, for_role

NOTHING: Final[Mapping[str, Attributes]] = {}
NO_PAGES: Final[Mapping[str, Collection[str]]] = {}
# What some readers take for the end of a line, and JSON leaves as it is.
SEPARATORS: Final = {c.encode(): b"\\u%04x" % ord(c) for c in "\x85\u2028\u2029"}


def encoded(data: Mapping[str, Any], language: str = ENGLISH) -> bytes:
    """JSON in one line, for clients that read lines. NaN and infinity are null; a Text is rendered."""
    text = to_json(localized(data, language), inf_nan_mode="null")
    for separator, escaped in SEPARATORS.items():
        text = text.replace(separator, escaped)
    return text


class ViewPublisher:
    """Where the view is posted; changed on the event loop only."""

    def __init__(
        self,
        view: View,
        revision: str,
        without_control: Mapping[str, Attributes] = NOTHING,
        pages: Mapping[str, Collection[str]] = NO_PAGES,
    ) -> None:
        """`revision` is of all that a page has loaded: one that differs makes it load again.
        `without_control` has what is different for clients without control, `pages` the ids of the
        widgets that a page shows, by the page's."""
        self._pages = pages
        self.boot = secrets.token_hex(4)
        self.version = 1
        self.view = view
        self.revision = revision
        self.heartbeat = Heartbeat(self._wake)
        self._changed = asyncio.Event()
        self._news: Events = {}  # from the view before to this one
        self._without_control = without_control
        self._by_role: dict[tuple[Role, str], View] = {}
        # By the language, the version before, the roles then and now, and the page.
        self._prepared: dict[tuple[str, int, Role, Role, str], bytes] = {}
        self._whole: dict[tuple[str, str, int], bytes] = {}  # by the language, the event and its data
        self._lock_changes: dict[str, int] = {}
        self.closed = False

    @property
    def id(self) -> str:
        """`<boot>-<version>`, the id of the events that lead here."""
        return f"{self.boot}-{self.version}"

    def post(self, view: View, without_control: Mapping[str, Attributes] = NOTHING) -> None:
        """A view as of now; nothing happens if it is the same as before."""
        news = difference(self.view, view)
        if not news and without_control == self._without_control:
            return
        self.version += 1
        for widget, changed in news.get("update", {}).items():
            if "enabled" in changed:
                self._lock_changes[widget] = self.version
        self.view, self._news, self._without_control = view, news, without_control
        self._by_role, self._prepared, self._whole = {}, {}, {}
        self.heartbeat.along()
        self._wake()

    def lock_changed_at(self, widget: str) -> int:
        """The version in which a widget's lock has last closed or opened; 0 if it never has."""
        return self._lock_changes.get(widget, 0)

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

    def for_role(self, role: Role = "", page: str = "") -> View:
        """The newest view, as clients of this role get it on a page; of all pages with "", and with a
        page that the panel does not have (any more)."""
        key = role, page
        if key not in self._by_role:
            whole = for_role(self.view, self._without_control, role)
            own = self._of_page(whole["widgets"], page)
            self._by_role[key] = whole if own is whole["widgets"] else {**whole, "widgets": own}
        return self._by_role[key]

    def _of_page(self, widgets: dict[str, Any], page: str) -> dict[str, Any]:
        shown = self._pages.get(page)
        return widgets if shown is None else {k: v for k, v in widgets.items() if k in shown}

    def snapshot(self, language: str = ENGLISH, role: Role = "", page: str = "") -> bytes:
        """The `snapshot` event: everything that the page shows."""
        view = self.for_role(role, page)
        about = {"id": self.id, "revision": self.revision}
        return self._all_of("snapshot", view, language, lambda: {**about, **view})

    def events_since(
        self,
        version: int,
        view: View,
        language: str = ENGLISH,
        was: Role = "",
        role: Role = "",
        page: str = "",
    ) -> bytes:
        """The events from a view that was posted as `version`, and sent to those whose role it `was`,
        to the newest one; both as the page shows them."""
        key = language, version, was, role, page if page in self._pages else ""
        prepared = self._prepared.get(key)
        if prepared is None:
            latest = version == self.version - 1 and not (was or role)
            news = self._news if latest else difference(view, self.for_role(role, page))
            prepared = self._prepared[key] = b"".join(
                self._event(name, data, language)
                if name == "update"
                else self._all_of(name, data, language)
                for name, data in self._shown(news, page).items()
            )
        return prepared

    def _shown(self, news: Events, page: str) -> Events:
        """The events that a page gets, in their order: keys lock before the rest is shown."""
        if page not in self._pages:
            return news
        shown = {name: data for name, data in news.items() if not name.endswith(PERMISSION_EVENT)}
        if own := self._of_page(dict(shown.pop("update", {})), page):
            shown = {"update": own, **shown}
        return shown

    def _all_of(
        self,
        name: str,
        of: Mapping[str, Any],
        language: str,
        data: Callable[[], Mapping[str, Any]] | None = None,
    ) -> bytes:
        """An event that is the same whatever was sent before: with `of`, a part of one of the newest
        views, or `data` made of it."""
        key = language, name, id(of)
        whole = self._whole.get(key)
        if whole is None:
            whole = self._whole[key] = self._event(name, data() if data else of, language)
        return whole

    def _event(self, name: str, data: Mapping[str, Any], language: str) -> bytes:
        lines = (name.encode(), encoded(data, language), self.id.encode())
        return b"event: %b\ndata: %b\nid: %b\n\n" % lines


def client_id_event(browser: str) -> bytes:
    """The event with the id of a client's browser, by which it reads `control`."""
    return b"event: browser\ndata: %b\n\n" % encoded({"id": browser})

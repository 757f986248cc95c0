"""The latest view with a version, and the events that bring a browser from one to another.

There is no queue: a stream keeps the view that it sent last and, when it can send, gets the difference
to the newest. There is a view for each audience. Events are encoded once for all streams of an audience
that show the same page: streams at the same version share the bytes of the difference, all others those
of each event that carries a whole section.

A page gets the attributes of its own widgets and of the frame's, with their locks, but not the
interlocks behind them. A client that names no page gets everything.
"""

import asyncio
import secrets
from collections.abc import Collection, Mapping
from typing import Any, Final

from pydantic_core import to_json

from app.i18n import ENGLISH, localized
from app.panel.layout import FRAME_ONLY
from app.panel.needs import NO_NEEDS, PanelNeeds
from app.permission.control_authority_view import Role
from app.view.audience import EVERYONE, Audience
from app.view.heartbeat import Heartbeat
from app.view.kinds import Attributes
from app.view.rendered_rows import RenderedRows
from app.view.sections import CHANGES, PERMISSION_EVENT, Events, difference
from app.view.shared_widgets import NO_SHARED, SharedWidgets
from app.view.view import View, for_audience

NOTHING: Final[Mapping[str, Attributes]] = {}
# What is encoded for some streams: the version that they sent last, their audience, that before, and
# the page that they show, "" for the widgets of all pages. A plain tuple, as it is made for each stream
# and version: a named one takes a sixth of the time of the stream's loop.
Variant = tuple[int, Audience, Audience, str]
NO_PAGES: Final[Mapping[str, Collection[str]]] = {}
# Line ends for some readers, which JSON does not escape.
SEPARATORS: Final = {c.encode(): b"\\u%04x" % ord(c) for c in "\x85\u2028\u2029"}


def encoded(data: Mapping[str, Any], language: str = ENGLISH) -> bytes:
    """JSON in one line, for clients that read lines. NaN and infinity are null; a Text is rendered."""
    return _line(localized(data, language))


def _line(rendered: Any) -> bytes:
    text = to_json(rendered, inf_nan_mode="null")
    if not text.isascii():
        for separator, escaped in SEPARATORS.items():
            text = text.replace(separator, escaped)
    return text


class ViewPublisher:
    """The newest view, with its version; changed on the event loop only."""

    def __init__(
        self,
        view: View,
        revision: str,
        without_control: Mapping[str, Attributes] = NOTHING,
        pages: Mapping[str, Collection[str]] = NO_PAGES,
        needs: PanelNeeds = NO_NEEDS,
    ) -> None:
        """`revision` is of all files that a page has loaded: a page with another one reloads.
        `without_control` has what is different for clients without control, `pages` the ids of the
        widgets that a page shows, by the page's. `needs` are the roles and groups that pages and
        commands need."""
        self._pages = pages
        self.needs = needs
        self.instance_id = secrets.token_hex(4)
        self.version = 1
        self.view = view
        self.revision = revision
        self.heartbeat = Heartbeat(self._wake)
        self._changed = asyncio.Event()
        self._latest_events: Events = {}  # from the view before to this one
        self._without_control = without_control
        self.shared = NO_SHARED
        # By the audience without its language.
        self._views: dict[tuple[bool, Role, frozenset[str], frozenset[str]], View] = {}
        self._snapshots: dict[tuple[Audience, str], bytes] = {}  # by the audience and the page
        self._prepared: dict[Variant, bytes] = {}
        self._whole: dict[tuple[str, str, int], bytes] = {}  # by the language, the event and its data
        self._lock_changes: dict[str, int] = {}
        self._rows = RenderedRows()
        self.closed = False

    @property
    def id(self) -> str:
        """`<instance_id>-<version>`, the id of the events that lead here."""
        return f"{self.instance_id}-{self.version}"

    def post(
        self,
        view: View,
        without_control: Mapping[str, Attributes] = NOTHING,
        shared: SharedWidgets = NO_SHARED,
    ) -> None:
        """Publishes a view with a new version; does nothing if it is the same as the newest. `shared`
        are the widgets of other robots."""
        if shared.widgets:
            view = {**view, "widgets": {**view["widgets"], **shared.widgets}}
        events = difference(self.view, view)
        locks = without_control, shared.without_control, shared.controls
        if not events and locks == (self._without_control, *self.shared[1:]):
            return
        self.shared = shared
        self.version += 1
        for widget, changed in events.get("update", {}).items():
            if "enabled" in changed:
                self._lock_changes[widget] = self.version
        self.view, self._latest_events, self._without_control = view, events, without_control
        self._views, self._snapshots, self._prepared, self._whole = {}, {}, {}, {}
        self.heartbeat.beat_early()
        self._wake()

    def lock_changed_at(self, widget: str) -> int:
        """The version in which a widget's lock has last closed or opened; 0 if it never has."""
        return self._lock_changes.get(widget, 0)

    def renew_audiences(self) -> None:
        """A new version of the same view: what clients see of it may have changed, as their roles."""
        self.version += 1
        self._latest_events = {}
        self._snapshots, self._prepared, self._whole = {}, {}, {}
        self._wake()

    def close(self) -> None:
        """Ends every stream."""
        self.closed = True
        self._wake()

    def _wake(self) -> None:
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    async def wait_for_change(self, version: int, beats: int) -> None:
        """Waits until there is a later version, a later heartbeat, or the publisher is closed."""
        if not self.closed and (self.version, self.heartbeat.count) == (version, beats):
            await self._changed.wait()

    def shown_page(self, page: str) -> str:
        """The page whose widgets a client gets; "" for those of all if the panel does not have it."""
        return page if page in self._pages else ""

    def for_audience(self, audience: Audience = EVERYONE) -> View:
        """The newest view for an audience."""
        if audience.sees_all:
            return self.view
        key = audience.has_control, audience.role, audience.without, audience.lacks
        if key not in self._views:
            self._views[key] = for_audience(
                self.view, self._without_control, audience, self.shared.without_control, self.needs
            )
        return self._views[key]

    def snapshot(self, audience: Audience = EVERYONE, page: str = "") -> bytes:
        """The `snapshot` event: everything that the page shows."""
        key = audience, page
        if key not in self._snapshots:
            view = self.for_audience(audience)
            shown = {"widgets": self._of_page(view["widgets"], page)}
            whole = {**view, **shown, "alarms": alarms_of_page(view["alarms"], page)}
            about = {"id": self.id, "revision": self.revision}
            self._snapshots[key] = self._event("snapshot", {**about, **whole}, audience.language)
        return self._snapshots[key]

    def events_since(
        self,
        version: int,
        view: View,
        audience: Audience = EVERYONE,
        page: str = "",
        before: Audience | None = None,
    ) -> bytes:
        """The events that bring a page from `view`, which was posted as `version` and sent to a client
        of the audience `before` (None: the same), to the newest view for `audience`."""
        before = before or audience
        key = version, audience, before, page
        prepared = self._prepared.get(key)
        if prepared is None:
            latest = version == self.version - 1 and before.sees_all and audience.sees_all
            events = self._latest_events if latest else difference(view, self.for_audience(audience))
            prepared = self._prepared[key] = b"".join(
                self._event(name, data, audience.language)
                if name in CHANGES
                else self._shared_event(name, data, audience.language)
                for name, data in self._shown(events, page).items()
            )
        return prepared

    def _shown(self, events: Events, page: str) -> Events:
        """The events that a page gets, in their order: keys lock before the rest is shown."""
        if not page:
            return events
        shown = by_change(self._of_page(events.get("update", NOTHING), page))
        for name, data in events.items():
            if name != "update" and not name.endswith(PERMISSION_EVENT):
                shown[name] = alarms_of_page(data, page) if name == "alarms" else data
        return shown

    def _of_page(self, widgets: Mapping[str, Any], page: str) -> Mapping[str, Any]:
        if not page:
            return widgets
        shown = self._pages[page]
        return {name: attributes for name, attributes in widgets.items() if name in shown}

    def _shared_event(self, name: str, data: Mapping[str, Any], language: str) -> bytes:
        """An event that does not depend on what a stream sent before; encoded once. `data` is a part of
        one of the newest views."""
        key = language, name, id(data)
        whole = self._whole.get(key)
        if whole is None:
            whole = self._whole[key] = self._event(name, data, language)
        return whole

    def _with_rows(self, name: str, data: Mapping[str, Any], language: str) -> bytes:
        """The JSON of an event with rows of alarms, which are many; b"" for another event."""
        alarms = (
            data if name == "alarms" else data.get("alarms", NOTHING) if name == "snapshot" else NOTHING
        )
        if not alarms.get("rows"):
            return b""
        rest = localized({**alarms, "rows": {}}, language)
        rest["rows"] = self._rows.render(alarms["rows"], language)
        if name == "alarms":
            return _line(rest)
        others = {key: value for key, value in data.items() if key != "alarms"}
        return _line({**localized(others, language), "alarms": rest})

    def _event(self, name: str, data: Mapping[str, Any], language: str) -> bytes:
        line = self._with_rows(name, data, language)
        lines = (name.encode(), line or encoded(data, language), self.id.encode())
        return b"event: %b\ndata: %b\nid: %b\n\n" % lines


def alarms_of_page(alarms: Mapping[str, Any], page: str) -> Mapping[str, Any]:
    """The section of alarms for a page: only that of their list has the rows."""
    return alarms if page in ("", FRAME_ONLY) else {**alarms, "rows": {}}


def by_change(widgets: Mapping[str, Attributes]) -> Events:
    """The events of a page for the attributes that changed: `updates` has those that several widgets
    have in common, each once, as the lock of an interlock; `update` all others by the widget's id."""
    names: dict[int, list[str]] = {}
    for name, changes in widgets.items():
        names.setdefault(id(changes), []).append(name)
    groups = [
        {"widgets": alike, "attributes": widgets[alike[0]]}
        for alike in names.values()
        if len(alike) > 1
    ]
    single = {alike[0]: widgets[alike[0]] for alike in names.values() if len(alike) == 1}
    events: Events = {"updates": {"groups": groups}} if groups else {}
    return events | {"update": single} if single else events


def client_id_event(browser: str) -> bytes:
    """The event with the id of a client's browser, by which it reads `control`."""
    return b"event: browser\ndata: %b\n\n" % encoded({"id": browser})

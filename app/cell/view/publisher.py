"""The latest view with a version, and the events that bring a browser from one to another.

There is no queue: a stream keeps the view that it sent last and, when it can send, gets the difference
to the newest. There is a view for each audience. Events are encoded once for all streams of an audience
that show the same page: streams at the same version share the bytes of the difference, all others those
of each event that carries a whole section.

A page gets the attributes of its own widgets and of the frame's, with their locks, but not the
interlocks behind them. A client that names no page gets everything.
"""

import asyncio
import json
import secrets
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain
from typing import Any, Final, Literal, NamedTuple

from pydantic_core import to_json

from app.cell.alarms.shown import MAX_ROWS
from app.cell.permission.control import Role
from app.cell.view.kinds import Attributes
from app.cell.view.view import EVERYONE, NO_SHARED, Audience, SharedWidgets, View, for_audience
from app.panel.layout import FRAMES
from app.panel.needs import NO_NEEDS, PanelNeeds
from app.system import clock
from app.system.clock import format_day, format_time, iso_time
from app.system.texts import ENGLISH, localized, render

# The rows of alarms in the languages of the readers: each is rendered once, as a row never changes.

KEPT: Final = 4 * MAX_ROWS  # rows of a language


class RenderedRows:
    """Rows by their language and their alarm's id. One that is the same object is not rendered
    again."""

    def __init__(self) -> None:
        self._known: dict[str, dict[str, tuple[Any, Any]]] = {}  # language → id → row, rendered

    def render(self, rows: Mapping[str, Any], language: str) -> dict[str, Any]:
        """The rows in a language; None for one that is gone."""
        known = self._known.setdefault(language, {})
        if len(known) > KEPT:
            known.clear()
        return {alarm_id: self._row(known, alarm_id, row, language) for alarm_id, row in rows.items()}

    def _row(self, known: dict[str, tuple[Any, Any]], alarm_id: str, row: Any, language: str) -> Any:
        if row is None:
            known.pop(alarm_id, None)
            return None
        kept = known.get(alarm_id)
        if kept is None or kept[0] is not row:
            kept = known[alarm_id] = row, localized(row, language)
        return kept[1]


# The heartbeat of all streams of a publisher: one timer, one event for all streams of a language.

BEAT_S: Final = 0.5  # a page locks itself after 1.75 s without any event
# A beat that is so nearly due goes with what is sent anyway: more than the pause of what is sent ten
# times a second, where it would come to all streams just before that, and keep it waiting.
EARLY_S: Final = 0.15


class Heartbeat:
    """Beats while at least one stream is open; on the event loop only."""

    def __init__(self, wake: Callable[[], None]) -> None:
        """`wake` is called when a beat is due: the streams then send it."""
        self.count = 0
        self._events: dict[str, bytes] = {}
        self._wake = wake
        self._open_streams = 0
        self._timer: asyncio.TimerHandle | None = None

    @contextmanager
    def heard(self) -> Iterator[None]:
        """A context for as long as a stream is open."""
        self._open_streams += 1
        if self._timer is None:
            self._plan()
        try:
            yield
        finally:
            self._open_streams -= 1
            if not self._open_streams and self._timer is not None:
                self._timer.cancel()
                self._timer = None

    def beat_early(self) -> None:
        """Beats now if a beat is nearly due: it is sent with the event that is about to be sent."""
        timer = self._timer
        if timer is not None and timer.when() - asyncio.get_running_loop().time() <= EARLY_S:
            timer.cancel()
            self._beat()

    def event(self, language: str = ENGLISH) -> bytes:
        """The event of the last beat, the same for all readers of a language."""
        if language not in self._events:
            self._events[language] = beat(language)
        return self._events[language]

    def _due(self) -> None:
        self._beat()
        self._wake()

    def _beat(self) -> None:
        self._events.clear()
        self.count += 1
        self._plan()

    def _plan(self) -> None:
        self._timer = asyncio.get_running_loop().call_later(BEAT_S, self._due)


def beat(language: str = ENGLISH) -> bytes:
    """The `beat` event, without an id. A page that misses it locks itself.

    `clock` and `day` are the time as the page shows it, `at` the same as ISO 8601; `now` is the
    server's own time, in milliseconds.
    """
    wall = time.time()
    data = {
        "clock": render(format_time(wall), language),
        "day": render(format_day(wall), language),
        "at": iso_time(wall),
        "now": round(clock.server_now() * 1000),
    }
    return f"event: beat\ndata: {json.dumps(data)}\n\n".encode()


# The sections of a view: a row for each, the same for a page, a snapshot and the events after it.

Events = dict[str, Mapping[str, Any]]  # event name → its data, in the order of sending

NO_VALUES: Final[Mapping[str, Any]] = {}
# Attributes of a command: a press of a page that shows others is outdated.
JUDGED_BY: Final = frozenset({"enabled", "map_versions"})
# Events with what has changed since the last one that a stream sent, not with whole sections.
CHANGES: Final = frozenset({"update", "updates", "alarms"})
PERMISSION_EVENT: Final = "-enabled-updated"  # appended to an interlock's id; for programs


class Section(NamedTuple):
    """`name` is its key in a view and in a snapshot. `events` returns the events that update a page
    from the old to the new content. `template` is its part of a page, in the header or below it
    (`place`), "" if the page itself has it; `shown` returns whether a content is
    shown there. `on_page`: the scripts of a page show it; the others are for programs."""

    name: str
    events: Callable[[str, Any, Any], Events]
    template: str = ""
    shown: Callable[[Any], bool] = bool
    place: Literal["below", "header"] = "below"
    on_page: bool = True


def whole(name: str, old: Any, new: Any) -> Events:
    """One event with the whole section."""
    return {} if old == new else {name: new}


def _interlocks(_: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> Events:
    """One event for each permission."""
    return {name + PERMISSION_EVENT: state for name, state in new.items() if old.get(name) != state}


def _widgets(_: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> Events:
    """One event with the attributes that changed, of the widgets that did. Widgets whose attributes are
    the same objects, such as those of one lock, get the same changes as one object."""
    alike: dict[tuple[int, int], dict[str, Any]] = {}
    changed = {}
    for name, attributes in new.items():
        known = old.get(name, NO_VALUES)
        if known is attributes:
            continue
        pair = id(known), id(attributes)
        changes = alike.get(pair)
        if changes is None:
            changes = alike[pair] = _changed(known, attributes)
        if changes:
            changed[name] = changes
    return {"update": changed} if changed else {}


def _changed(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in new.items() if key not in old or old[key] != value}


def _alarms(name: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> Events:
    """One event with everything but of the rows only those that differ, null for one that is gone."""
    if old == new:
        return {}
    before, after = old["rows"], new["rows"]
    gone = dict.fromkeys(alarm_id for alarm_id in before if alarm_id not in after)
    changed = {alarm_id: row for alarm_id, row in after.items() if before.get(alarm_id) != row}
    return {name: {**new, "rows": gone | changed}}


SECTIONS: Final = (
    Section("interlocks", _interlocks, on_page=False),
    Section("widgets", _widgets),
    Section("link", whole, "sections/link.html"),
    Section("notice", whole, "sections/notice.html"),
    Section("robots", whole, "sections/robots.html"),
    Section("state", whole),
    Section(
        "control", whole, "sections/control.html", lambda control: control["required"], place="header"
    ),
    Section("alarms", _alarms, "sections/alarms.html", lambda _: True),
    Section("recipes", whole),
)


def difference(old: Mapping[str, Any], new: Mapping[str, Any]) -> Events:
    """The events that update a page from the old to the new view; none if they are the same."""
    events: Events = {}
    for section in SECTIONS:
        events |= section.events(section.name, old[section.name], new[section.name])
    return events


NOTHING: Final[Mapping[str, Attributes]] = {}
# What is encoded for some streams: the version that they sent last, their audience, that before, and
# the page that they show, "" for the widgets of all pages. A plain tuple, as it is made for each stream
# and version: a named one takes a sixth of the time of the stream's loop.
Variant = tuple[int, Audience, Audience, str]
NO_PAGES: Final[Mapping[str, Collection[str]]] = {}
Groups = Mapping[str, Sequence[str]]
NO_GROUPS: Final[Groups] = {}
NO_NAMES: Final[Mapping[str, str]] = {}
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
        names: Mapping[str, str] = NO_NAMES,
        alike: Collection[Sequence[str]] = (),
    ) -> None:
        """`revision` is of all files that a page has loaded: a page with another one reloads.
        `without_control` has what is different for clients without control, `pages` the ids of the
        widgets that a page shows, by the page's. `needs` are the roles and groups that pages and
        commands need. `names` has the id that a widget has on pages, where that differs. `alike` has
        the ids of widgets that usually change alike, such as the buttons of an interlock."""
        self._pages = pages
        self._names = names
        self._alike = alike
        self._groups_of_pages: dict[str, Groups] = {}
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
        self._streams: Counter[str] = Counter()  # that are open, by the page
        self.on_watched: Callable[[], None] = _nothing  # set by who builds the views

    @contextmanager
    def watching(self, page: str) -> Iterator[None]:
        """A context for as long as a client sees a page, which is up to date at its beginning; "" for
        the widgets of all pages."""
        self._streams[page] += 1
        if self._streams[page] == 1:
            self.on_watched()
        try:
            yield
        finally:
            self._streams[page] -= 1
            if not self._streams[page]:
                del self._streams[page]
                self.on_watched()

    def watched(self, widgets: Collection[str]) -> frozenset[str]:
        """Those of these widgets that clients see now."""
        if "" in self._streams:
            return frozenset(widgets)
        shown = (self._pages[page] for page in self._streams)
        return frozenset(widgets).intersection(chain.from_iterable(shown))

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
            if not JUDGED_BY.isdisjoint(changed):
                self._lock_changes[widget] = self.version
        self.view, self._latest_events, self._without_control = view, events, without_control
        self._views, self._snapshots, self._prepared, self._whole = {}, {}, {}, {}
        self.heartbeat.beat_early()
        self._wake()

    def lock_changed_at(self, widget: str) -> int:
        """The version in which a widget's lock has last closed or opened, or the map of its places was
        another one; 0 if it never has."""
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
            about: dict[str, Any] = {"id": self.id, "revision": self.revision}
            if groups := self._groups(page, audience):
                about["groups"] = groups
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
                for name, data in self._shown(events, page, audience).items()
            )
        return prepared

    def _shown(self, events: Events, page: str, audience: Audience) -> Events:
        """The events that a page gets, in their order: keys lock before the rest is shown."""
        if not page:
            return events
        changed = self._of_page(events.get("update", NOTHING), page)
        shown = by_change(changed, self._groups(page, audience))
        for name, data in events.items():
            if name != "update" and not name.endswith(PERMISSION_EVENT):
                shown[name] = alarms_of_page(data, page) if name == "alarms" else data
        return shown

    def _groups(self, page: str, audience: Audience) -> Groups:
        """The ids of a page's widgets that usually change alike, by the name of their group: those
        that the audience sees. A snapshot of the page has them, and later events name the group."""
        if page not in self._groups_of_pages:
            on_page = (
                [self._names.get(name, name) for name in group if name in self._pages[page]]
                for group in (self._alike if page else ())
            )
            several = (group for group in on_page if len(group) > 1)
            self._groups_of_pages[page] = {str(number): group for number, group in enumerate(several)}
        groups = self._groups_of_pages[page]
        if not audience.lacks:
            return groups
        seen = self._of_page(self.for_audience(audience)["widgets"], page)
        return {name: [each for each in group if each in seen] for name, group in groups.items()}

    def _of_page(self, widgets: Mapping[str, Any], page: str) -> Mapping[str, Any]:
        if not page:
            return widgets
        shown, names = self._pages[page], self._names
        return {names.get(name, name): each for name, each in widgets.items() if name in shown}

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


def _nothing() -> None:
    """Until a refresher has its own."""


def alarms_of_page(alarms: Mapping[str, Any], page: str) -> Mapping[str, Any]:
    """The section of alarms for a page: only that of their list has the rows."""
    return alarms if page in ("", *FRAMES) else {**alarms, "rows": {}}


def by_change(widgets: Mapping[str, Attributes], known: Groups = NO_GROUPS) -> Events:
    """The events of a page for the attributes that changed: `updates` has those that several widgets
    have in common, each once, as the lock of an interlock; `update` all others by the widget's id. A
    known group is named in place of its widgets."""
    by_first = {group[0]: (name, group) for name, group in known.items() if group}

    def target(alike: Sequence[str]) -> Mapping[str, Any]:
        name, group = by_first.get(alike[0], ("", ()))
        return {"group": name} if {*group} == {*alike} else {"widgets": alike}

    names: dict[int, list[str]] = {}
    for name, changes in widgets.items():
        names.setdefault(id(changes), []).append(name)
    groups = [
        {**target(alike), "attributes": widgets[alike[0]]} for alike in names.values() if len(alike) > 1
    ]
    single = {alike[0]: widgets[alike[0]] for alike in names.values() if len(alike) == 1}
    events: Events = {"updates": {"groups": groups}} if groups else {}
    return events | {"update": single} if single else events


def client_id_event(browser: str) -> bytes:
    """The event with the id of a client's browser, by which it reads `control`."""
    return b"event: browser\ndata: %b\n\n" % encoded({"id": browser})

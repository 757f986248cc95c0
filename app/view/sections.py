"""The sections of a view: a row for each, the same for a page, a snapshot and the events after it."""

from collections.abc import Callable, Mapping
from typing import Any, Final, Literal, NamedTuple

Events = dict[str, Mapping[str, Any]]  # event name → its data, in the order of sending

NOTHING: Final[Mapping[str, Any]] = {}
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
        known = old.get(name, NOTHING)
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

"""Widgets that stand on several pages: `same = "start"` in place of a further table of the widget."""

from collections.abc import Iterable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any, Final

from app.panel.base import Description, Id, Rows, Span
from app.panel.file.wording import closest_name, list_names
from app.ros.messages.validation import format_value
from app.system.errors import Fault

NAME: Final = "same"


class SameWidget(Description):
    """A widget of another page. Its place is its own; without it that of the other page."""

    same: Id
    span: Span | None = None
    rows: Rows | None = None
    grow: bool | None = None


LISTS: Final = ("widget", "group")
PLACING: Final = tuple(key for key in SameWidget.model_fields if key != NAME)


@dataclass(frozen=True, slots=True)
class WithCopies:
    """The tables of a panel file with the whole table of each widget in place of `same`. `origins` has
    the place of the widget's own table by the place of each copy."""

    tables: dict[str, Any]
    faults: list[Fault] = field(default_factory=list)
    origins: dict[str, str] = field(default_factory=dict)

    def own_faults(self, faults: Iterable[Fault]) -> Iterator[Fault]:
        """The faults without those that a copy has because its widget has them. Others of a copy, such
        as an input that its page lacks, are reported at its `same`."""
        every = list(faults)
        known = {(fault.place, fault.message) for fault in every}
        for fault in every:
            copy, rest = self._in_copy(fault.place)
            if not copy or rest[1:] in PLACING:
                yield fault
            elif (self.origins[copy] + rest, fault.message) not in known:
                yield fault.at(f"{copy}.{NAME}")

    def _in_copy(self, place: str) -> tuple[str, str]:
        """(place of the copy, the rest) of a place; ("", "") if it is in none."""
        for copy in self.origins:
            if place == copy or place.startswith((f"{copy}.", f"{copy}[")):
                return copy, place[len(copy) :]
        return "", ""


def names_same(tables: Mapping[str, Any]) -> bool:
    """Whether a widget of a page is one of another page."""
    return any(NAME in table for _, _, table in _widgets(tables))


def with_copies(tables: dict[str, Any]) -> WithCopies:
    """The tables of a panel file whose copies are whole."""
    origins, chains = _origins(tables)
    frame = {table["id"] for table in _tables_at(tables, "frame") if _has_id(table)}
    made = WithCopies({**tables, "page": deepcopy(tables["page"])})
    unnamed = list(_unnamed(tables))
    whole = [each for each in _widgets(tables) if NAME not in each[2]]
    seen = {(page, table["id"]): place for page, place, table in reversed(whole) if _has_id(table)}
    for (page, place, table), (_, _, copy) in zip(
        _widgets(tables), list(_widgets(made.tables)), strict=True
    ):
        if NAME not in table:
            continue
        name = table[NAME]
        fault = _fault(table, place, origins, chains, frame) or _twice(name, place, page, seen)
        if fault is not None:
            made.faults.append(fault)
            if isinstance(name, str) and name not in chains.keys() | origins.keys() and unnamed:
                made.faults[-1:] = unnamed  # it may be one of these widgets
                unnamed = []
            continue
        at, origin = origins[name]
        copy.clear()
        copy.update({**origin, **{key: table[key] for key in PLACING if key in table}})
        made.origins[place] = at
    return made


def _fault(
    table: Mapping[str, Any],
    place: str,
    origins: Mapping[str, tuple[str, Mapping[str, Any]]],
    chains: Mapping[str, Any],
    frame: Iterable[str],
) -> Fault | None:
    """What is wrong with a copy's own table."""
    name = table[NAME]
    if not isinstance(name, str):
        return Fault(f"{place}.{NAME}", f"must be the id of a widget, not {format_value(name)}")
    if name in chains and name not in origins:
        message = (
            f'"{name}" is itself the same as another widget: write same = {format_value(chains[name])}'
        )
        return Fault(f"{place}.{NAME}", message)
    if name in frame:
        return Fault(f"{place}.{NAME}", f'"{name}" is in the frame: it is on every page already')
    if name not in origins:
        meant = closest_name(name, origins)
        hint = f'did you mean "{meant}"?' if meant else f"there is {list_names(sorted(origins))}"
        return Fault(f"{place}.{NAME}", f"no widget {format_value(name)} on a page; {hint}")
    for key in table:
        near = closest_name(key, PLACING) if key not in (NAME, *PLACING) else None
        if near:
            return Fault(f"{place}.{key}", f'unknown key; did you mean "{near}"?')
        if key not in (NAME, *PLACING):
            message = (
                f'stands beside same: "{name}" has its keys in its own table; only its place may '
                f"differ ({', '.join(PLACING)})"
            )
            return Fault(f"{place}.{key}", message)
    return None


def _twice(name: str, place: str, page: int, seen: dict[tuple[int, str], str]) -> Fault | None:
    """A fault of a widget that is on a page already."""
    already = seen.setdefault((page, name), place)
    if already == place:
        return None
    return Fault(f"{place}.{NAME}", f'"{name}" is on this page already, as {already}')


def _origins(
    tables: Mapping[str, Any],
) -> tuple[dict[str, tuple[str, Mapping[str, Any]]], dict[str, Any]]:
    """(place, table) of the widgets of pages by their ids; and the `same` of copies that have an id."""
    origins: dict[str, tuple[str, Mapping[str, Any]]] = {}
    chains: dict[str, Any] = {}
    for _, place, table in _widgets(tables):
        if _has_id(table):
            if NAME in table:
                chains[table["id"]] = table[NAME]
            else:
                origins.setdefault(table["id"], (place, table))
    return origins, chains


def _unnamed(tables: Mapping[str, Any]) -> Iterator[Fault]:
    """The faults of widgets without an id: their list or the key `id` is misspelt, or it is no text."""
    for p, page in enumerate(_list(tables.get("page"))):
        for key in page:
            if key not in LISTS and isinstance(page[key], list) and (near := closest_name(key, LISTS)):
                yield Fault(f"page[{p}].{key}", f'unknown key; did you mean "{near}"?')
    for _, place, table in _widgets(tables):
        if "id" in table and not _has_id(table):
            yield Fault(f"{place}.id", f"must be text, not {format_value(table['id'])}")
        elif "id" not in table and NAME not in table:
            misspelt = next((key for key in table if closest_name(key, ("id",))), None)
            message = 'unknown key; did you mean "id"?' if misspelt else "is missing"
            yield Fault(f"{place}.{misspelt or 'id'}", message)


def _has_id(table: Mapping[str, Any]) -> bool:
    return isinstance(table.get("id"), str)


def _widgets(tables: Mapping[str, Any]) -> Iterator[tuple[int, str, dict[str, Any]]]:
    """(number of its page, place, table) of each widget of a page."""
    for p, page in enumerate(_list(tables.get("page"))):
        for w, table in enumerate(_list(page.get("widget"))):
            yield p, f"page[{p}].widget[{w}]", table
        for g, group in enumerate(_list(page.get("group"))):
            for w, table in enumerate(_list(group.get("widget"))):
                yield p, f"page[{p}].group[{g}].widget[{w}]", table


def _tables_at(tables: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    around = tables.get(name)
    return _list(around.get("widget")) if isinstance(around, dict) else []


def _list(value: Any) -> list[dict[str, Any]]:
    """The tables of a list of tables; none where it is something else, which is a fault of its own."""
    return value if isinstance(value, list) and all(isinstance(each, dict) for each in value) else []

"""Where in its file something of a panel stands: its line, and the id of what it is in."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, Final, TypeVar

from app.errors import Remark
from app.panel.faults.toml_lines import Path, lines_of

MAX_ID: Final = 64
_OWNER: Final = re.compile(r"(?:page\[(?P<page>[0-9]+)\]\.)?(?P<key>[a-z]+)\[(?P<index>[0-9]+)\]")
_LAST: Final = re.compile(r"(?:\[[0-9]+\]|\.?[^.\[\]]*)$")

AnyRemark = TypeVar("AnyRemark", bound=Remark)


def place_of(path: Path) -> str:
    """("page", 0, "widget", 2, "topic") → `page[0].widget[2].topic`."""
    place = ""
    for step in path:
        place += f"[{step}]" if isinstance(step, int) else f".{step}" if place else step
    return place


def add_locations(remarks: Iterable[AnyRemark], text: str, tables: Any) -> Iterator[AnyRemark]:
    """Remarks about a TOML text and the tables that it is, with their ids and lines."""
    lines: dict[str, int] = {}
    for path, line in _lines(text).items():
        lines.setdefault(place_of(path), line)
    for remark in remarks:
        place = remark.place
        known = remark.line or _nearest_line(place, lines)
        yield replace(remark, id=remark.id or id_at(place, tables), line=known)


def id_at(place: str, tables: Any) -> str:
    """The id of the widget, page, interlock or robot that a place is in; "" where it has none."""
    owner = _OWNER.match(place)
    try:
        around = tables["page"][int(owner["page"])] if owner and owner["page"] else tables
        known = around[owner["key"]][int(owner["index"])]["id"] if owner else ""
    except (LookupError, TypeError):
        return ""
    tells = isinstance(known, str) and known.isprintable() and '"' not in known
    return known[:MAX_ID] if tells else ""


def _lines(text: str) -> dict[Path, int]:
    try:
        return lines_of(text)
    except RecursionError:  # brackets in brackets in …: it is told without lines
        return {}


def _nearest_line(place: str, lines: dict[str, int]) -> int:
    """That of a place or, where it is not there, of what it should be in; 0 where there is none."""
    while place and place not in lines:
        place = _LAST.sub("", place)
    return lines.get(place, 0)

"""Adds line numbers and ids to places of a panel file."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Final, TypeVar

from app.errors import Remark
from app.panel.faults.toml_lines import Path, lines_of

MAX_ID: Final = 64
SAME: Final = "same"  # in place of an id: the widget is one of another page
_OWNER: Final = re.compile(
    r"(?:^|\.)(page|group|frame|widget|interlock|alarm|robot|source)(?:\[([0-9]+)\])?(?=\.|$)"
)
_WITH_ID: Final = ("page", "widget", "interlock", "alarm", "robot", "source")
_QUOTED: Final = re.compile(r"[/\[]")
_LAST: Final = re.compile(r"(?:\[[0-9]+\]|\.?[^.\[\]]*)$")

# Ends a message about a second table with an id or a name; (1) is the place of the first.
_FIRST: Final = re.compile(r"is already the (?:id|name) of ([a-z_.]+(?:\[[0-9]+\][a-z_.]*)*)$")

AnyRemark = TypeVar("AnyRemark", bound=Remark)


def place_of(path: Path) -> str:
    """("page", 0, "widget", 2, "topic") → `page[0].widget[2].topic`."""
    place = ""
    for step in path:
        if isinstance(step, int):
            place += f"[{step}]"
            continue
        key = f'"{step}"' if _QUOTED.search(step) else step  # a topic or a path, as TOML writes it
        place += f".{key}" if place else key
    return place


def add_locations(remarks: Iterable[AnyRemark], text: str, tables: Any) -> Iterator[AnyRemark]:
    """The remarks with their ids and lines; `tables` is the parsed `text`."""
    lines: dict[str, int] = {}
    for path, line in _lines(text).items():
        lines.setdefault(place_of(path), line)
    for remark in remarks:
        place = remark.place
        known = remark.line or _nearest_line(place, lines)
        message = _FIRST.sub(lambda first: _with_line(first, lines), remark.message)
        yield replace(remark, message=message, id=remark.id or id_at(place, tables), line=known)


def _with_line(first: re.Match[str], lines: Mapping[str, int]) -> str:
    """The place of the first of two tables, with its line."""
    line = _nearest_line(first[1], lines)
    return f"{first[0]}, line {line}" if line else first[0]


def id_at(place: str, tables: Any) -> str:
    """The id of the widget, page, interlock, alarm or robot around a place; "" without one."""
    known: Any = ""
    around = tables
    for name, index in _OWNER.findall(place):
        if name == "robot" and not index:  # a key of the table
            break
        try:
            around = around[name][int(index)] if index else around[name]
            known = around[SAME if SAME in around else "id"] if name in _WITH_ID else known
        except (LookupError, TypeError):
            return ""
        if name in ("widget", "alarm"):
            break
    is_valid = isinstance(known, str) and known.isprintable() and '"' not in known
    return known[:MAX_ID] if is_valid else ""


def _lines(text: str) -> dict[Path, int]:
    try:
        return lines_of(text)
    except RecursionError:  # too many nested brackets: reported without lines
        return {}


def _nearest_line(place: str, lines: Mapping[str, int]) -> int:
    """The line of a place, or of the nearest place around it; 0 without one."""
    while place and place not in lines:
        shorter = _LAST.sub("", place)
        place = shorter if shorter != place else place[:-1]  # in a quoted name
    return lines.get(place, 0)

"""Adds line numbers and ids to places of a panel file."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, Final, TypeVar

from app.errors import Remark
from app.panel.faults.toml_lines import Path, lines_of

MAX_ID: Final = 64
_OWNER: Final = re.compile(
    r"(?:^|\.)(page|group|frame|widget|interlock|alarm|robot|source)(?:\[([0-9]+)\])?(?=\.|$)"
)
_WITH_ID: Final = ("page", "widget", "interlock", "alarm", "robot", "source")
_QUOTED: Final = re.compile(r"[/\[]")
_LAST: Final = re.compile(r"(?:\[[0-9]+\]|\.?[^.\[\]]*)$")

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
        yield replace(remark, id=remark.id or id_at(place, tables), line=known)


def id_at(place: str, tables: Any) -> str:
    """The id of the widget, page, interlock, alarm or robot around a place; "" without one."""
    known: Any = ""
    around = tables
    for name, index in _OWNER.findall(place):
        try:
            around = around[name][int(index)] if index else around[name]
            known = around["id"] if name in _WITH_ID else known
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


def _nearest_line(place: str, lines: dict[str, int]) -> int:
    """The line of a place, or of the nearest place around it; 0 without one."""
    while place and place not in lines:
        shorter = _LAST.sub("", place)
        place = shorter if shorter != place else place[:-1]  # in a quoted name
    return lines.get(place, 0)

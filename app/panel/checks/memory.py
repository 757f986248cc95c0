"""What the checks of a panel file found, kept while an editor changes the file elsewhere."""

from collections.abc import Callable, Iterable, Mapping
from itertools import zip_longest
from typing import Any, Final

from pydantic import BaseModel

from app.panel.base import FileContext
from app.panel.model import Panel

# The lists of tables that are read one by one, and the fields of a panel that they become.
LISTS: Final = {
    "page": "pages",
    "interlock": "interlocks",
    "condition": "own_conditions",
    "alarm": "alarms",
}


class CheckMemory:
    """The descriptions of tables until their tables change, and the results of checks until what they
    depend on changes.

    Tables are compared as texts: for Python, 0, 0.0 and False are equal.
    """

    def __init__(self) -> None:
        self._context = FileContext()
        self._known: dict[str, list[tuple[str, Any]]] = {}  # table as text, description
        self._kept: dict[tuple[str, int], tuple[Any, tuple[Any, ...], tuple[Any, ...]]] = {}

    def known(self, tables: Mapping[str, Any], context: FileContext) -> dict[str, Any]:
        """The lists of a file with descriptions in place of the tables that did not change."""
        if context != self._context:
            self._known.clear()
        known = {}
        for key in LISTS:
            if isinstance(listed := tables.get(key), list):
                rows = zip_longest(listed, self._known.get(key, ())[: len(listed)])
                known[key] = [row[1] if row and row[0] == repr(table) else table for table, row in rows]
        return known

    def keep(self, tables: Mapping[str, Any], panel: Panel, context: FileContext) -> None:
        """Keeps what the tables have become."""
        self._context = context
        for key, name in LISTS.items():
            rows = zip(map(repr, tables.get(key, ())), getattr(panel, name), strict=True)
            self._known[key] = list(rows)

    def results(
        self,
        check: str,
        number: int,
        described: object,
        depends: tuple[Any, ...],
        compute: Callable[[], Iterable[Any]],
    ) -> tuple[Any, ...]:
        """The results of a check of a description, such as the page with this number."""
        kept = self._kept.get((check, number))
        if kept is not None and kept[0] is described and _same(kept[1], depends):
            return kept[2]
        made = tuple(compute())
        self._kept[check, number] = described, depends, made
        return made


def _same(before: Any, now: Any) -> bool:
    """Whether nothing differs; descriptions are the same objects as long as their tables are."""
    if isinstance(now, tuple | list):
        return len(before) == len(now) and all(map(_same, before, now))
    if before is now or isinstance(now, BaseModel):
        return before is now
    return type(before) is type(now) and bool(before == now)


class NoMemory(CheckMemory):
    """For a file that is checked once."""

    def known(self, tables: Mapping[str, Any], context: FileContext) -> dict[str, Any]:
        return {}

    def keep(self, tables: Mapping[str, Any], panel: Panel, context: FileContext) -> None:
        pass

    def results(
        self,
        check: str,
        number: int,
        described: object,
        depends: tuple[Any, ...],
        compute: Callable[[], Iterable[Any]],
    ) -> tuple[Any, ...]:
        return tuple(compute())


NO_MEMORY: Final = NoMemory()

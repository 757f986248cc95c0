"""The rows of alarms in the languages of the readers: each is rendered once, as a row never changes."""

from collections.abc import Mapping
from typing import Any, Final

from app.alarms.shown import MAX_ROWS
from app.i18n import localized

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

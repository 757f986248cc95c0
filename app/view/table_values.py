"""What a table shows: pure, from (widget, robot, time)."""

import math
from collections.abc import Mapping
from typing import Any

from app.clock import age_changes_at, format_age
from app.i18n import TextLike, say
from app.panel.widgets.table import Column, ColumnField, Table
from app.robot.keyed_entries import Entry
from app.robot.state import Reading, RobotState
from app.view.display_values import NOTHING, cell_text, lamp_of, topic_state


def table(widget: Table, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a table, and when they change: `state`, `note`; `table_rows`, of which each has its
    `age` ("" while it is not old) and `cells`, which have `text`, `shape` and `colour` ("" without
    states); and `said`, how many entries more there are, or that there are none."""
    whole = topic_state(widget, robot, now)
    if whole.state in ("waiting", "unreadable"):
        return {"state": whole.state, "note": whole.note, "said": "", "table_rows": []}, whole.until
    entries, is_full = _entries(widget, robot, robot.reading(widget.topic))
    shown = _sorted(widget, entries)[: widget.rows_shown]
    constants = _constants(widget, robot)
    ages = [_age(widget, entry, now) for entry in shown]
    attributes = {
        "state": whole.state,
        "note": whole.note,
        "said": _said(len(entries), len(shown), is_full=is_full),
        "table_rows": [
            {"age": age, "cells": _cells(widget, entry, constants)}
            for entry, (age, _) in zip(shown, ages, strict=True)
        ],
    }
    return attributes, min([whole.until, *(at for _, at in ages)])


def _entries(widget: Table, robot: RobotState, reading: Reading) -> tuple[list[Entry], bool]:
    """The entries, and whether more may be in the message, unread."""
    if widget.key is not None:
        return robot.keyed_entries.entries(widget.id), False
    found: list[Entry] = []
    for number in range(widget.entries_read):
        values = tuple(reading.value(widget.path(number, of)) for of in widget.own_fields)
        if all(value is None for value in values):
            return found, False
        found.append(Entry(values, reading.at))
    return found, True


def _sorted(widget: Table, entries: list[Entry]) -> list[Entry]:
    sort = widget.sort
    if sort is None:
        return entries
    if sort.by is None:
        newest_last = sorted(entries, key=lambda entry: entry.at)
        return newest_last[::-1]
    at = widget.own_fields.index(sort.by)
    known = [entry for entry in entries if not _is_unknown(entry.values[at])]
    unknown = [entry for entry in entries if _is_unknown(entry.values[at])]
    largest = sort.first == "largest"
    return [*sorted(known, key=lambda entry: entry.values[at], reverse=largest), *unknown]


def _is_unknown(value: Any) -> bool:
    return value is None or (isinstance(value, float) and math.isnan(value))


def _said(count: int, shown: int, *, is_full: bool) -> TextLike:
    if not count:
        return say("table_empty")
    if is_full:
        return say("table_more_at_least", number=count - shown)
    return say("table_more", number=count - shown) if count > shown else ""


def _age(widget: Table, entry: Entry, now: float) -> tuple[TextLike, float]:
    """How old an entry with a key is, and when that changes; of others the message has an age."""
    if widget.key is None or widget.max_age_s is None:
        return "", math.inf
    if now - entry.at < widget.max_age_s:
        return "", entry.at + widget.max_age_s
    text = say("readout_old", age=format_age(now - entry.at))
    return text, age_changes_at(entry.at, now)


def _constants(widget: Table, robot: RobotState) -> list[tuple[Column, ColumnField, Mapping[str, Any]]]:
    """The columns with their fields and the constants of these."""
    fields = ((column, widget.column_field(column)) for column in widget.columns)
    return [(column, of, {} if of.constants is None else robot.constants(of)) for column, of in fields]


def _cells(
    widget: Table, entry: Entry, columns: list[tuple[Column, ColumnField, Mapping[str, Any]]]
) -> list[dict[str, TextLike]]:
    cells = []
    for column, of, constants in columns:
        value = entry.values[widget.own_fields.index(column.field)]
        text, shape, colour = (
            (NOTHING, "", "")
            if value is None
            else lamp_of(of.states, value)
            if of.states
            else (cell_text(of, value, constants), "", "")
        )
        cells.append({"text": text, "shape": shape, "colour": colour})
    return cells

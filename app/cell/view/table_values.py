"""What a table shows: pure, from (widget, robot, time)."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from app.cell.robot.state import RobotState
from app.cell.robot.tables import TableEntry, TableRows, states_of
from app.cell.view.displays import NOTHING, cell_text, lamp_of, shown_time, topic_state
from app.cell.view.times import time_style
from app.panel.robot_texts import RobotTexts
from app.panel.shared_keys import stale_at
from app.panel.widgets.table import Column, ColumnField, Table
from app.system.clock import age_changes_at, format_age
from app.system.texts import TextLike, say


def table(widget: Table, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a table, and when they change: `state`, `note`; `table_rows`, of which each has its
    `age` ("" while it is not old) and `cells`, which have `text`, `shape` and `colour` ("" without
    states); and `said`, how many entries more there are, or that there are none."""
    whole = topic_state(widget, robot, now)
    if whole.state in ("waiting", "unreadable"):
        return {"state": whole.state, "note": whole.note, "said": "", "table_rows": []}, whole.until
    rows = robot.table_entries.rows(widget.id)
    constants = _constants(widget, robot)
    ages = [_age(widget, entry, now) for entry in rows.first]
    time_at = robot.clock.time_at
    cells = [_cells(widget, entry, constants, robot.texts, time_at, now) for entry in rows.first]
    attributes = {
        "state": whole.state,
        "note": whole.note,
        "said": _said(widget, rows),
        "table_rows": [
            {"age": age, "cells": shown} for (age, _), (shown, _) in zip(ages, cells, strict=True)
        ],
    }
    return attributes, min([whole.until, *(at for _, at in (*ages, *cells))])


def _said(widget: Table, rows: TableRows) -> TextLike:
    """What is not in the rows: how many entries more, with their abnormal states, and how many were not
    read."""
    more = _hidden(widget, rows)
    if not rows.unread:
        return more or ("" if rows.first else say("table_empty"))
    if not more:
        return say("table_unread", number=rows.unread)
    return say("table_more_unread", more=more, number=rows.unread)


def _hidden(widget: Table, rows: TableRows) -> TextLike:
    if not rows.hidden:
        return ""
    if not rows.abnormal:
        return say("table_more", number=rows.hidden)
    _, states = states_of(widget)
    named = tuple(
        say("table_state", number=number, state=states[state].text)
        for state, number in rows.abnormal.items()
    )
    return say("table_more_abnormal", number=rows.hidden, states=named)


def _age(widget: Table, entry: TableEntry, now: float) -> tuple[TextLike, float]:
    """How old an entry with a key is, and when that changes; of others the message has an age."""
    if widget.key is None:
        return "", math.inf
    until = stale_at(entry.at, widget.max_age_s)
    if now < until:
        return "", until
    text = say("readout_old", age=format_age(now - entry.at))
    return text, age_changes_at(entry.at, now)


def _constants(widget: Table, robot: RobotState) -> list[tuple[Column, ColumnField, Mapping[str, Any]]]:
    """The columns with their fields and the constants of these."""
    fields = ((column, widget.column_field(column)) for column in widget.columns)
    return [
        (column, field, {} if field.constants is None else robot.constants(field))
        for column, field in fields
    ]


def _cells(
    widget: Table,
    entry: TableEntry,
    columns: list[tuple[Column, ColumnField, Mapping[str, Any]]],
    texts: RobotTexts,
    time_at: Callable[[float], float],
    now: float,
) -> tuple[list[dict[str, TextLike]], float]:
    """The cells of a row, and when they change. `time_at` is that of the robot's clock."""
    cells: list[dict[str, TextLike]] = []
    until = math.inf
    for column, field, constants in columns:
        value = entry.values[widget.own_fields.index(column.field)]
        cell: tuple[TextLike, str, str] = (NOTHING, "", "")
        if value is not None and field.states:
            cell = lamp_of(field.states, value, texts)
        elif style := time_style(field.format, value):
            wall = time_at(entry.wall + now - entry.at)
            text, changes_in = shown_time(field, style, value, wall)
            cell, until = (text, "", ""), min(until, now + changes_in)
        elif value is not None:
            cell = (cell_text(field, value, constants, texts), "", "")
        cells.append(dict(zip(("text", "shape", "colour"), cell, strict=True)))
    return cells, until

"""How the values of alarms and gauges are written."""

import csv
import io
import json
from pathlib import Path
from typing import Any

import pytest

from app.cell.alarms.export import export
from app.cell.alarms.history import HistoryFilter, HistoryRow
from app.cell.alarms.records import record_of
from app.cell.alarms.shown import limit_text, row_of, value_text
from app.cell.alarms.states import AlarmInstance, Moment, define
from app.cell.alarms.store import AlarmStore
from app.panel.model import Panel
from app.panel.numbers import brief
from app.system.texts import TextLike, render
from app.web.routes.alarm_history import shown_events
from tests.support.builders import panel_of


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (3.50925, "3.509 bar"),
        (64.0021, "64 bar"),
        (0.000123456, "0.0001235 bar"),
        (123456.7, "123457 bar"),
        (-1013.25, "-1013 bar"),
        (0.0, "0 bar"),
    ],
)
def test_a_value_has_four_significant_digits(value: float, text: str) -> None:
    assert render(value_text(value, "bar")).replace("\u2212", "-").replace("\u00a0", " ") == text


def test_a_limit_is_that_of_the_panel_file() -> None:
    assert render(limit_text(1013.25, "hPa")).replace("\u00a0", " ") == "1013.25 hPa"
    assert (value_text(None, "bar"), limit_text(None, "bar")) == ("", "")


@pytest.mark.parametrize("value", [float("inf"), float("-inf")])
def test_what_is_no_number_stays(value: float) -> None:
    assert brief(value) == value


def plain(text: TextLike, language: str = "en") -> str:
    return render(text, language).replace("\u00a0", " ")


def air_panel(style: str, limit: float) -> Panel:
    about = {"topic": "/air", "type": "std_msgs/msg/Float64", "unit": "bar", "high": limit}
    written = {"format": style} if style else {}
    return panel_of(alarm=[{"id": "air", "text": "Air", **about, **written}])


@pytest.mark.parametrize(
    ("style", "value", "limit", "shown", "shown_limit"),
    [
        ("", 3.50925, 3.0, "3.509 bar", "3 bar"),
        (".1f", 3.50925, 3.25, "3.5 bar", "3.25 bar"),
        (".3f", 3.5, 3.0, "3.500 bar", "3 bar"),
        (",.0f", 12345.6, 9000.0, "12,346 bar", "9000 bar"),
        (".0%", 0.914, 0.855, "91% bar", "85.5% bar"),
    ],
)
def test_an_alarms_format_is_that_of_its_row_its_history_and_its_csv(
    tmp_path: Path, style: str, value: float, limit: float, shown: str, shown_limit: str
) -> None:
    panel = air_panel(style, limit)
    alarm = AlarmInstance(next(define(panel, "")), value=value, limit=limit)
    now = Moment(10.0, 1_700_000_000.0)
    shown_row = row_of(alarm, now)
    assert (plain(shown_row["value_text"]), plain(shown_row["limit_text"])) == (shown, shown_limit)
    record = record_of(alarm, now)
    row = HistoryRow(now.wall, "air", "active", 1, "", "", record, "raised", 3)
    assert plain(shown_events([row])[0].event).endswith(f"{shown}, limit {shown_limit}")
    assert csv_row(tmp_path, row)["value_text"].replace("\u00a0", " ") == shown


def test_a_record_of_an_earlier_version_has_four_significant_digits(tmp_path: Path) -> None:
    record = json.dumps({"about": {"text": "Air", "unit": "bar"}, "value": 3.50925, "limit": 3.0})
    row = HistoryRow(1.7e9, "air", "active", 1, "", "", record, "raised", 3)
    assert plain(shown_events([row])[0].event, "de").endswith("3,509 bar, Grenze 3 bar")
    assert csv_row(tmp_path, row)["value_text"].replace("\u00a0", " ") == "3.509 bar"


def csv_row(folder: Path, row: HistoryRow) -> Any:
    store = AlarmStore(folder / "alarms.sqlite", days=1000, size_mb=64)
    store.write([row], {})
    store.close()
    text = b"".join(export(folder / "alarms.sqlite", HistoryFilter(), False, "en")).decode()
    return next(csv.DictReader(io.StringIO(text.removeprefix("\ufeff"))))

"""Times of day as a reader sees them, also in the hour that the clock shows twice."""

from collections.abc import Callable
from datetime import UTC, datetime
from typing import Final

import pytest

from app.system.clock import format_datetime, format_time, iso_time
from app.system.texts import render
from app.web.pages.log_words import iso_of, time_of
from app.web.routes.audit_log import LogQuery

SetZone = Callable[[str], None]
BERLIN: Final = "Europe/Berlin"
DAY_S: Final = 86_400


def at(text: str) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()


@pytest.mark.parametrize(
    ("zone", "wall", "shown"),
    [
        (BERLIN, "2026-10-24T23:59:59", "01:59:59"),
        (BERLIN, "2026-10-25T00:30:07", "02:30:07 +02:00"),
        (BERLIN, "2026-10-25T01:30:07", "02:30:07 +01:00"),
        (BERLIN, "2026-10-25T02:00:00", "03:00:00"),
        (BERLIN, "2026-03-29T00:59:59", "01:59:59"),
        (BERLIN, "2026-03-29T01:00:00", "03:00:00"),
        ("America/New_York", "2026-11-01T06:30:00", "01:30:00 −05:00"),
        ("Australia/Lord_Howe", "2026-04-04T14:45:00", "01:45:00 +11:00"),
        ("Asia/Tokyo", "2026-10-25T01:30:07", "10:30:07"),
        ("UTC", "2026-10-25T01:30:07", "01:30:07"),
    ],
)
def test_a_time_of_day_has_its_offset_where_it_comes_twice(
    time_zone: SetZone, zone: str, wall: str, shown: str
) -> None:
    time_zone(zone)
    assert render(format_time(at(wall))) == shown
    clock, _, offset = shown.partition(" ")
    assert time_of(round(at(wall) * 1000) + 123, "en") == f"{clock} {offset}".rstrip()
    assert time_of(round(at(wall) * 1000) + 123, "de") == f"{clock} {offset}".rstrip()


def test_the_notation_of_a_language_is_that_of_the_time_only(time_zone: SetZone) -> None:
    time_zone(BERLIN)
    wall = at("2026-10-25T01:30:07")
    assert render(format_time(wall), "fi") == "02.30.07 +01:00"
    assert render(format_datetime(wall), "de") == "25.10.2026 02:30:07 +01:00"


@pytest.mark.parametrize("zone", [BERLIN, "America/New_York", "Australia/Lord_Howe", "UTC"])
def test_no_two_times_of_a_year_read_the_same(time_zone: SetZone, zone: str) -> None:
    time_zone(zone)
    first = int(at("2026-01-01T00:00:00"))
    walls = range(first, first + 365 * DAY_S, 900)
    assert len({render(format_datetime(wall)) for wall in walls}) == len(walls)


def test_programs_read_the_time_with_its_offset(time_zone: SetZone) -> None:
    time_zone(BERLIN)
    assert iso_time(at("2026-10-25T01:30:07.25")) == "2026-10-25T02:30:07.250+01:00"
    assert iso_of(round(at("2026-10-25T00:30:07") * 1000)) == "2026-10-25T02:30:07.000+02:00"


def test_a_filter_has_both_of_the_hours_that_the_clock_shows_twice(time_zone: SetZone) -> None:
    time_zone(BERLIN)
    twice = LogQuery(since="2026-10-25T02:15", until="2026-10-25T02:45").filter()
    assert twice.since == round(at("2026-10-25T00:15:00") * 1000)
    assert twice.until == round(at("2026-10-25T01:45:00") * 1000)
    wanted = LogQuery(since="2026-10-25T02:15+01:00", until="2026-10-25T02:45+01:00").filter()
    assert wanted.since == round(at("2026-10-25T01:15:00") * 1000)

"""The panel's own alarms, from what the server sees of its log, its disk and its clock."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from app.cell.alarms.shown import outdated, row_of
from app.cell.alarms.sources import (
    broker_entry,
    certificate_entry,
    clock_entry,
    disk_entry,
    full_entry,
    log_entry,
    own_definitions,
    sign_in_entry,
    users_entry,
)
from app.cell.alarms.states import Moment
from app.system.texts import render, say
from tests.cell.alarms.test_engine import Cell


def test_the_disk_is_low_below_the_limit_until_there_is_a_tenth_more() -> None:
    assert disk_entry(499.0, 500.0, was_low=False).level == 1
    assert disk_entry(501.0, 500.0, was_low=False).level == 0
    assert disk_entry(501.0, 500.0, was_low=True).level == 1
    assert disk_entry(551.0, 500.0, was_low=True).level == 0
    assert (
        render(disk_entry(99.4, 500.0, was_low=False).cause) == "99 MB are free. The limit is 500 MB."
    )


@pytest.mark.parametrize(("by_s", "level"), [(0.0, 0), (4.9, 0), (-4.9, 0), (5.1, 1), (-3600.0, 1)])
def test_a_step_of_the_clock_is_raised_and_drift_is_not(by_s: float, level: int) -> None:
    assert clock_entry(by_s, 1_700_000_000.0).level == level


def test_a_step_of_the_clock_says_by_how_much_and_in_which_direction() -> None:
    back = render(clock_entry(-3600.0, 1_700_000_000.0).cause)
    ahead = render(clock_entry(90.0, 1_700_000_000.0).cause)
    assert back.startswith("It was set back by 1 h, from ")
    assert ahead.startswith("It was set ahead by 1 min, from ")


def test_a_log_that_locks_says_so() -> None:
    why = say("log_unwritable", why="disk full")
    assert log_entry("", is_required=False).level == 0
    required, free = log_entry(why, is_required=True), log_entry(why, is_required=False)
    assert (required.level, free.level) == (1, 1)
    assert required.consequence != free.consequence
    assert "disk full" in render(required.cause)


def test_the_panels_own_alarms_are_of_no_robot_and_never_of_high_priority() -> None:
    definitions = dict(own_definitions())
    assert set(definitions) == {
        "panel_log",
        "panel_disk",
        "panel_clock",
        "panel_certificate",
        "panel_mqtt",
        "panel_forward",
        "panel_site",
        "panel_users",
        "panel_sign_in",
        "panel_alarms_lost",
        "panel_alarms_full",
    }
    assert not any(definition.is_of_robot for definition in definitions.values())
    assert all(definition.rules.priority(1) > 1 for definition in definitions.values())


@pytest.mark.parametrize(("lost_s", "level"), [(0.0, 0), (29.0, 0), (30.0, 1)])
def test_a_broker_is_raised_after_half_a_minute_without_a_connection(lost_s: float, level: int) -> None:
    entry = broker_entry("broker.plant:8883", "not trusted", lost_s)
    assert (entry.level, entry.priorities) == (level, (3,))
    assert "broker.plant:8883 has had no connection for 30 s: not trusted." in render(entry.cause)


@pytest.mark.parametrize(("days", "level"), [(31, 0), (29, 1), (-1, 1)])
def test_a_certificate_is_raised_thirty_days_before_its_end(days: int, level: int) -> None:
    now = datetime(2026, 11, 27, 12, tzinfo=UTC)
    entry = certificate_entry("panel.pem", now + timedelta(days=days), now)
    assert entry.level == level
    assert ("was valid" in render(entry.cause)) == (days < 0)


def test_users_that_are_lost_and_sign_ins_that_are_tried_are_raised() -> None:
    assert users_entry("").level == sign_in_entry("", ()).level == 0
    assert users_entry(say("users_lost", path="users.json")).level == 1
    of_user = sign_in_entry("M. Sato", ("10.0.0.1", "10.0.0.2", "10.0.0.3", "10.0.0.4"))
    assert (of_user.level, of_user.priorities) == (1, (2,))
    assert "M. Sato from 4 addresses, last from 10.0.0.4, 10.0.0.3, 10.0.0.2." in render(of_user.cause)
    assert sign_in_entry("", ("10.0.0.1",)).level == 1


def test_what_a_standing_alarm_of_the_panel_says_is_shown_when_it_changes(tmp_path: Path) -> None:
    cell = Cell(tmp_path, "")
    engine, at = cell.engine, Moment(cell.now, cell.now)
    engine.add_own(dict(own_definitions())["panel_alarms_full"])
    for left_out in (100, 1000):
        engine.own_changed("panel_alarms_full", full_entry(left_out))
        engine.evaluate()
        rows = {"panel_alarms_full": row_of(engine.alarms["panel_alarms_full"], at)}
        assert outdated(engine.alarms, rows, 10) == []
        engine.own_changed("panel_alarms_full", full_entry(left_out + 1))
        assert outdated(engine.alarms, rows, 10) == ["panel_alarms_full"]

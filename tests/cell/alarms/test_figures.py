"""Figures of the history: rates, the most frequent, alarms that chatter and delays that calm them."""

import json
import math
import time
from pathlib import Path

import pytest

from app.cell.alarms.figures import (
    Activation,
    Figures,
    activations,
    count_raises,
    read_figures,
    worst_burst,
)
from app.cell.alarms.history import HistoryRow
from app.cell.alarms.states import Delays
from app.cell.alarms.store import AlarmStore

NOON = 1_700_000_000.0 // 3600 * 3600
DAY_S = 86_400.0
MANY = 100_000


def event(at: float, alarm: str, name: str = "raised", lasted: float | None = None) -> HistoryRow:
    state = "normal" if name == "returned" else "active"
    record = json.dumps({"about": {"text": alarm}, "raised_at": NOON + at - (lasted or 0.0)})
    return HistoryRow(NOON + at, alarm, state, 1, "", "", record, name, 2, "", "Air", lasted)


def figures_of(folder: Path, rows: list[HistoryRow], hours: float = 24.0, **delays: Delays) -> Figures:
    store = AlarmStore(folder / "alarms.sqlite3", days=1000, size_mb=512)
    store.write(rows, {row.id: "{}" for row in rows})
    store.close()
    until = NOON + hours * 3600
    return read_figures(folder / "alarms.sqlite3", NOON, until, until, delays)


def test_rates_are_those_of_the_chosen_time(tmp_path: Path) -> None:
    rows = [event(60.0 * n, "a") for n in range(12)] + [event(7200.0 + n, "b") for n in range(3)]
    rows += [event(-10.0, "before"), event(DAY_S, "after")]
    figures = figures_of(tmp_path, rows)
    assert (figures.raised, figures.hours, figures.per_hour) == (15, 24.0, 15 / 24)
    assert (figures.worst_hour, figures.hours_over, figures.per_10_min) == (12, 1, 15 / 144)
    assert list(figures.by_hour.values()) == [12, 3]
    assert figures.worst_10_min == 10
    assert figures.by_priority == {2: 15}
    assert [(row.id, raises) for row, raises in figures.top] == [("a", 12), ("b", 3)]


def test_the_worst_ten_minutes_may_begin_at_any_time(tmp_path: Path) -> None:
    figures = figures_of(tmp_path, [event(550.0 + 20 * n, "a") for n in range(5)])
    assert figures.worst_10_min == 5


def test_the_time_until_acknowledged_is_the_median(tmp_path: Path) -> None:
    rows = [event(10.0 + n, "a", "acknowledged", lasted) for n, lasted in enumerate((5, 38, 4000))]
    assert figures_of(tmp_path, rows).acknowledge_s == 38


def test_alarms_that_stand_for_a_day_are_counted(tmp_path: Path) -> None:
    rows = [
        event(-DAY_S, "stands"),
        event(-DAY_S, "returned"),
        event(60.0, "returned", "returned", DAY_S + 60),
        event(60.0, "young"),
        event(-DAY_S, "shelved"),
        event(60.0, "shelved", "shelved", DAY_S)._replace(state="shelved"),
    ]
    assert figures_of(tmp_path, rows, hours=1).standing == 1


def test_an_alarm_that_the_panel_no_longer_has_does_not_stand_now(tmp_path: Path) -> None:
    store = AlarmStore(tmp_path / "alarms.sqlite3", days=1000, size_mb=8)
    store.write([event(0.0, "gone")], {"gone": None})
    store.close()
    path, until = tmp_path / "alarms.sqlite3", NOON + 2 * DAY_S
    assert read_figures(path, NOON, until, until, {}).standing == 0
    assert read_figures(path, NOON, until, until + 1, {}).standing == 1


TIMES = [(0.0, 3.0), (10.0, 12.5), (21.0, 24.0), (36.0, 38.0), (55.0, 58.0)]


def chattering(times: list[tuple[float, float]], alarm: str = "infeed") -> list[HistoryRow]:
    rows = []
    for raised, returned in times:
        rows += [event(raised, alarm), event(returned, alarm, "returned", returned - raised)]
    return rows


def test_an_alarm_that_chatters_is_named_with_the_delays_that_calm_it(tmp_path: Path) -> None:
    calm = [event(31.0 * n, "calm") for n in range(20)]
    figures = figures_of(tmp_path, chattering(TIMES) + calm + chattering([(900.0, 901.0)]))
    (named,) = figures.chattering
    assert (named.row.id, named.raises) == ("infeed", 6)
    burst = named.burst
    assert (burst.first, burst.span_s, burst.raises) == (NOON, 55.0, 5)
    assert burst.on_delay == (4.0, 0)
    assert burst.off_delay == (18.0, 1)


@pytest.mark.parametrize("name", ["on_s", "off_s"])
def test_the_delay_is_the_least_that_calms(name: str) -> None:
    heard = [Activation(*times) for times in TIMES]
    burst = worst_burst(heard)
    assert burst is not None
    suggested = burst.on_delay if name == "on_s" else burst.off_delay
    assert suggested is not None
    assert count_raises(heard, Delays()._replace(**{name: suggested.delay_s})) == suggested.raises
    assert count_raises(heard, Delays()._replace(**{name: suggested.delay_s - 1})) > 1
    assert count_raises(heard, Delays()) == 5


def test_the_delays_that_an_alarm_has_are_counted_with() -> None:
    burst = worst_burst([Activation(*times) for times in TIMES], Delays(1.0, 2.0))
    assert burst is not None
    assert burst.on_delay == (3.0, 0)  # it was active for 2 s in fact
    assert burst.off_delay == (19.0, 1)


def test_no_delay_calms_an_alarm_whose_level_rises() -> None:
    burst = worst_burst(activations([(0, "raised"), (5, "raised"), (9, "raised"), (9.5, "returned")]))
    assert burst is not None
    assert (burst.raises, burst.on_delay, burst.off_delay) == (3, None, None)


def test_three_raises_in_more_than_a_minute_do_not_chatter() -> None:
    assert worst_burst([Activation(31.0 * n, 31.0 * n + 1) for n in range(10)]) is None
    assert worst_burst([Activation(30.0 * n, math.inf) for n in range(3)]) is not None


@pytest.mark.long("real time")
def test_the_figures_of_100_000_rows_are_read_at_once(tmp_path: Path) -> None:
    rows = [event(DAY_S * n / MANY, f"a{n % 300}") for n in range(MANY)]
    figures = figures_of(tmp_path, rows)
    begun = time.monotonic()
    path = tmp_path / "alarms.sqlite3"
    assert read_figures(path, NOON, NOON + DAY_S, NOON + DAY_S, {}) == figures
    assert time.monotonic() - begun < 5
    assert (figures.raised, len(figures.top)) == (MANY, 10)


def test_without_a_history_the_figures_are_zero() -> None:
    figures = read_figures(None, -math.inf, NOON, NOON, {})
    assert (figures.raised, figures.per_hour, figures.top, figures.chattering) == (0, 0.0, [], [])

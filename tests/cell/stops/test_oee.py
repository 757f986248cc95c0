"""The figures of a shift by tables: states, breaks, counters and reasons in, figures out."""

import json
import os
import time
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.alarms.report import CountRow, StatePeriod, StateRow, read_counts, write_states
from app.cell.stops.changes import Change
from app.cell.stops.oee import (
    MOST_OPEN,
    NOT_ANSWERED,
    SHORT,
    Answer,
    AnsweredStop,
    Plan,
    Quantities,
    ShiftFigures,
    Span,
    Standstill,
    answered,
    break_spans,
    counted,
    is_short_stop,
    open_stops,
    quantities,
    shift_figures,
    spells,
    standstills,
    stop_key,
    without,
)

SHIFT = Span(0.0, 1000.0)
NO_COUNT = Quantities(None, None, None, [])


@pytest.fixture(autouse=True)
def berlin() -> Iterator[None]:
    before = os.environ.get("TZ")
    os.environ["TZ"] = "Europe/Berlin"
    time.tzset()
    yield
    if before is None:
        del os.environ["TZ"]
    else:
        os.environ["TZ"] = before
    time.tzset()


def state(value: Any, colour: str = "none") -> str:
    return json.dumps({"text": str(value), "shape": "play", "colour": colour, "value": value})


RUN, WAIT, FAULT, GONE = state("RUN"), state("WAIT"), state("FAULT", "red"), state(None)
PLAN = Plan(("RUN",), reason_after_s=60.0, ideal_cycle_s=2.0, planned=frozenset({"break"}))


def figures(
    periods: Sequence[tuple[float, float, str]],
    reasons: Sequence[str] = (),
    quantity: Quantities = NO_COUNT,
    plan: Plan = PLAN,
    shift: Span = SHIFT,
) -> ShiftFigures:
    """Of a shift with these states; `reasons` are those of its stops, in turn."""
    recorded = spells((StatePeriod(*period) for period in periods), plan.running)
    stood = standstills(recorded)
    padded = [*reasons, *[NOT_ANSWERED] * len(stood)]
    stops = [
        AnsweredStop(stop, f"state-{n}", Answer("", 0.0, reason, "", 0.0) if reason else None)
        for n, (stop, reason) in enumerate(zip(stood, padded, strict=False))
    ]
    return shift_figures(shift, recorded, stops, quantity, plan)


# States and reasons → running, down, planned and not recorded seconds, and availability.
AVAILABILITY: dict[str, tuple[Any, Any, tuple[float, float, float, float], float | None]] = {
    "runs all the time": ([(0, 1000, RUN)], (), (1000, 0, 0, 0), 1.0),
    "a stop": ([(0, 600, RUN), (600, 800, WAIT), (800, 1000, RUN)], (), (800, 200, 0, 0), 0.8),
    "two states are one stop": (
        [(0, 600, RUN), (600, 700, WAIT), (700, 1000, FAULT)], (), (600, 400, 0, 0), 0.6
    ),
    "a planned stop": ([(0, 500, RUN), (500, 1000, WAIT)], ("break",), (500, 0, 500, 0), 1.0),
    "not recorded": ([(0, 400, RUN), (600, 1000, RUN)], (), (800, 0, 0, 200), 1.0),
    "the state is not known": (
        [(0, 400, RUN), (400, 600, GONE), (600, 800, WAIT)], (), (400, 200, 0, 400), 2 / 3
    ),
    "stops before and after it": (
        [(-500, 100, WAIT), (100, 900, RUN), (900, 1500, WAIT)], (), (800, 200, 0, 0), 0.8
    ),
    "nothing is recorded": ([], (), (0, 0, 0, 1000), None),
    "stands all the time": ([(0, 1000, FAULT)], (), (0, 1000, 0, 0), 0.0),
}  # fmt: skip


@pytest.mark.parametrize("case", AVAILABILITY)
def test_availability_is_of_the_planned_busy_time(case: str) -> None:
    periods, reasons, seconds, availability = AVAILABILITY[case]
    shift = figures(periods, reasons)
    assert (shift.running_s, shift.down_s, shift.planned_s, shift.unknown_s) == seconds
    assert shift.availability == (None if availability is None else pytest.approx(availability))
    assert sum(band.until - band.since for band in shift.bands) == pytest.approx(1000.0)


# Times of day of breaks → the hours that they have in a day, in winter, and when clocks are set.
BREAKS = {
    "none": ((), "2026-06-01T06:00", "2026-06-01T14:00", 0.0),
    "one": (("09:30-09:45",), "2026-06-01T06:00", "2026-06-01T14:00", 0.25),
    "over midnight": (("23:50-00:10",), "2026-06-01T22:00", "2026-06-02T06:00", 1 / 3),
    "over the beginning of the shift": (("05:30-06:30",), "2026-06-01T06:00", "2026-06-01T14:00", 0.5),
    "overlapping": (("09:00-10:00", "09:30-10:30"), "2026-06-01T06:00", "2026-06-01T14:00", 1.5),
    "in the hour that is left out": (("02:00-03:30",), "2026-03-28T22:00", "2026-03-29T06:00", 0.5),
    "over the hour that comes twice": (("01:30-03:30",), "2026-10-24T22:00", "2026-10-25T06:00", 3.0),
    "each day of two": (("09:30-09:45",), "2026-06-01T06:00", "2026-06-03T06:00", 0.5),
}


@pytest.mark.parametrize("case", BREAKS)
def test_breaks_are_times_of_day(case: str) -> None:
    breaks, since, until, hours = BREAKS[case]
    span = Span(*(datetime.fromisoformat(text).timestamp() for text in (since, until)))
    spans = break_spans(span, breaks)
    assert sum(each.seconds for each in spans) / 3600 == pytest.approx(hours)
    rest = sum(each.seconds for each in without(span, spans))
    assert rest + sum(each.seconds for each in spans) == pytest.approx(span.seconds)


def test_a_break_in_which_the_machine_runs_is_worked() -> None:
    begin = datetime(2026, 6, 1, 9, 0).timestamp()
    shift = Span(begin, begin + 3600)
    plan = PLAN._replace(breaks=("09:30-09:45",))
    half = begin + 1800 + 450
    worked = figures([(begin, half, RUN), (half, begin + 3600, WAIT)], (), NO_COUNT, plan, shift)
    assert (worked.running_s, worked.planned_s, worked.down_s) == (2250.0, 450.0, 900.0)


# From when to when a machine stood still, in minutes after 9 o'clock → whether its reason is asked.
# There is a break from 9:30 to 9:45; a stop is short below a minute.
ASKED: Final[dict[str, tuple[list[tuple[float, float]], bool]]] = {
    "short": ([(10.0, 10.9)], False),
    "a minute": ([(10.0, 11.0)], True),
    "in the break": ([(31.0, 44.0)], False),
    "the break": ([(30.0, 45.0)], False),
    "ends soon after the break": ([(30.0, 45.5)], False),
    "begins soon before it": ([(29.5, 45.0)], False),
    "soon before and soon after it": ([(29.5, 45.5)], True),
    "goes on after it": ([(30.0, 46.0)], True),
    "in two parts, one in the break": ([(29.5, 40.0), (42.0, 45.4)], False),
    "in two parts": ([(10.0, 10.5), (11.0, 11.5)], True),
}


@pytest.mark.parametrize("case", ASKED)
def test_one_rule_says_whether_the_reason_of_a_stop_is_asked(case: str) -> None:
    """The list of open stops, and the question that follows a stop."""
    minutes, is_asked = ASKED[case]
    nine, breaks = datetime(2026, 6, 1, 9, 0).timestamp(), ("09:30-09:45",)
    spans = [Span(*(nine + 60 * minute for minute in each)) for each in minutes]
    assert is_short_stop(spans, breaks, 60.0) is not is_asked
    periods = [(*span, WAIT) for span in spans]
    shift = Span(nine, nine + 3600)
    runs = (spans[-1].until, shift.until, RUN)
    plan = PLAN._replace(breaks=breaks)
    of_shift = figures([*periods, runs], (), NO_COUNT, plan, shift)
    assert bool(of_shift.open) is is_asked
    answered_too = figures([*periods, runs], ("material",), NO_COUNT, plan, shift)
    assert [stop.is_short for stop in answered_too.stops] == [False] * len(answered_too.stops)


# Values of a counter each minute → how many parts they are; None: not recorded.
COUNTERS: dict[str, tuple[list[float | None], float | None]] = {
    "counts": ([5, 7, 10], 5.0),
    "begins at zero again": ([98, 99, 2, 4], 5.0),
    "twice": ([9, 0, 3, 1], 4.0),
    "stands": ([5, 5, 5], 0.0),
    "one value": ([5], None),
    "no value": ([None, None], None),
    "a gap of three minutes": ([5, None, None, 50, 52], 2.0),
    "a gap of two": ([5, None, 7], 2.0),
}


@pytest.mark.parametrize("case", COUNTERS)
def test_a_counter_is_summed_over_its_resets(case: str) -> None:
    values, parts = COUNTERS[case]
    rows = [CountRow(60.0 * n, "", 0.0, count=value) for n, value in enumerate(values)]
    result = counted(rows, "all", Span(0.0, 1000.0))
    assert (None if result is None else result.parts) == parts


def test_what_is_counted_before_a_record_begins_does_not_count() -> None:
    values = ((0.0, 5.0), (30.0, None), (40.0, 1.0), (50.0, 3.0))
    rows = [CountRow(at, "", value) for at, value in values]
    result = counted(rows, "good", SHIFT)
    assert result is not None
    assert (result.parts, result.spans) == (2.0, [Span(40.0, 50.0)])


def test_a_rise_belongs_to_the_time_of_its_row() -> None:
    rows = [CountRow(at, "", good=value) for at, value in ((-30.0, 1.0), (30.0, 4.0), (90.0, 9.0))]
    result = counted(rows, "good", Span(0.0, 60.0))
    assert result is not None
    assert (result.parts, result.spans) == (3.0, [Span(0.0, 30.0)])


# Which counters the panel has → produced, good, and the parts that performance is of.
QUANTITIES: dict[tuple[str, ...], tuple[float | None, float | None, float | None]] = {
    ("good", "bad"): (12.0, 10.0, 12.0),
    ("all", "bad"): (13.0, 11.0, 13.0),
    ("good", "all"): (13.0, 10.0, 13.0),
    ("good", "bad", "all"): (13.0, 10.0, 13.0),
    ("good",): (None, 10.0, 10.0),
    ("all",): (13.0, None, 13.0),
    ("bad",): (None, None, None),
    (): (None, None, None),
}


@pytest.mark.parametrize("names", QUANTITIES, ids=" and ".join)
def test_two_counters_give_the_third(names: tuple[str, ...]) -> None:
    rows = [CountRow(0.0, "", 0.0, 0.0, 0.0), CountRow(60.0, "", 10.0, 2.0, 13.0)]
    quantity = quantities(rows, names, SHIFT)
    assert quantity[:3] == QUANTITIES[names]


def test_what_one_counter_lacks_is_not_known() -> None:
    rows = [CountRow(0.0, "", 0.0, None), CountRow(60.0, "", 10.0, None)]
    assert quantities(rows, ("good", "bad"), SHIFT)[:3] == (None, 10.0, None)


def test_the_index_is_the_product_of_its_parts() -> None:
    quantity = Quantities(300.0, 270.0, 300.0, [Span(0.0, 1000.0)])
    shift = figures([(0, 800, RUN), (800, 1000, WAIT)], (), quantity)
    assert (shift.availability, shift.performance, shift.quality) == (0.8, 0.75, 0.9)
    assert shift.oee == pytest.approx(0.54)


def test_performance_is_of_the_time_in_which_the_counters_were_recorded() -> None:
    quantity = Quantities(100.0, 100.0, 100.0, [Span(0.0, 400.0)])
    shift = figures([(0, 1000, RUN)], (), quantity)
    assert (shift.counted_s, shift.performance) == (400.0, 0.5)


@pytest.mark.parametrize(
    ("quantity", "plan"),
    [
        (NO_COUNT, PLAN),
        (Quantities(None, 5.0, 5.0, [SHIFT]), PLAN),
        (Quantities(5.0, 5.0, 5.0, [SHIFT]), PLAN._replace(ideal_cycle_s=None)),
        (Quantities(0.0, 0.0, 0.0, [SHIFT]), PLAN),
    ],
)
def test_without_a_part_the_index_is_not_known(quantity: Quantities, plan: Plan) -> None:
    assert figures([(0, 1000, RUN)], (), quantity, plan).oee is None


def test_the_reasons_are_sorted_and_summed() -> None:
    periods = [
        (0, 100, WAIT), (100, 200, RUN), (200, 500, FAULT), (500, 600, RUN), (600, 800, WAIT),
        (800, 900, RUN), (900, 930, WAIT), (930, 1000, RUN),
    ]  # fmt: skip
    shift = figures(periods, ("tool", "material", NOT_ANSWERED))
    rows = [(row.reason, row.seconds, row.stops, round(row.share, 3)) for row in shift.reasons]
    assert rows == [
        ("material", 300.0, 1, 0.476),
        (NOT_ANSWERED, 200.0, 1, 0.794),
        ("tool", 100.0, 1, 0.952),
        (SHORT, 30.0, 1, 1.0),
    ]
    assert [stop.seconds for stop in shift.longest] == [300.0, 200.0, 100.0, 30.0]


def test_the_bands_show_what_is_planned_and_what_is_not_recorded() -> None:
    periods = [
        (0, 300, RUN), (300, 400, FAULT), (400, 500, RUN), (500, 700, WAIT), (800, 1000, RUN)
    ]  # fmt: skip
    shift = figures(periods, ("", "break"))
    assert [(band.kind, band.since, band.until) for band in shift.bands] == [
        ("running", 0, 300),
        ("fault", 300, 400),
        ("running", 400, 500),
        ("planned", 500, 700),
        ("unknown", 700, 800),
        ("running", 800, 1000),
    ]


def test_the_open_stops_of_all_robots_are_listed_by_their_begin() -> None:
    left = figures([(0, 100, WAIT), (100, 500, RUN), (500, 600, WAIT), (600, 1000, RUN)])
    right = figures(
        [(0, 200, RUN), (200, 300, WAIT), (300, 700, RUN), (700, 730, WAIT), (730, 900, RUN)]
    )
    stops = open_stops({"left": left, "right": right})
    begun = [(stop.robot, stop.time.stop.standstill.since) for stop in stops]
    assert begun == [("left", 0), ("right", 200), ("left", 500)]


def test_of_many_open_stops_the_newest_of_all_robots_are_listed() -> None:
    plan = PLAN._replace(reason_after_s=1.0)
    often = figures([(at, at + 20, (RUN, WAIT)[at // 20 % 2]) for at in range(0, 1000, 20)], plan=plan)
    late = figures([(800, 890, WAIT), (890, 1000, RUN)])
    stops = open_stops({"late": late, "often": often})
    assert len(stops) == MOST_OPEN
    assert [stop.robot for stop in stops].count("late") == 1
    assert stops[-1].time.stop.standstill.since == 940


def test_a_stop_goes_on_over_a_time_without_a_record() -> None:
    recorded = spells(
        [StatePeriod(0, 100, WAIT), StatePeriod(300, 400, FAULT), StatePeriod(400, 500, RUN)], ("RUN",)
    )
    assert standstills(recorded) == [Standstill((Span(0, 100), Span(300, 400)), WAIT, True)]
    assert not standstills(recorded[:2])[0].is_over


def test_a_stop_has_the_name_of_the_change_by_which_it_began() -> None:
    def change(at: float, value: str, seq: int) -> Change:
        return Change(at, None, "", "state", value, False, False, seq=seq)

    changes = [change(99.8, "WAIT", 7), change(130.0, "FAULT", 8), change(99.9, "RUN", 9)]
    stop = Standstill((Span(100.0, 200.0),), WAIT, True)
    assert stop_key(stop, changes, (), frozenset({"RUN"})) == "state-7"
    assert stop_key(stop, changes[1:], (), frozenset({"RUN"})) == ""


def test_the_newest_answer_about_a_stop_counts() -> None:
    stop = Standstill((Span(100.0, 200.0),), WAIT, True)
    answers = [
        Answer("state-7", 9_000.0, "of_another_file", "", 3.0),
        Answer("state-7", 100.0, "tool", "Kim", 2.0),
        Answer("state-7", 100.0, "material", "Kim", 1.0),
    ]
    assert [each.reason for each in answered([stop], lambda _: "state-7", answers)] == ["tool"]
    assert [each.reason for each in answered([stop], lambda _: "", answers)] == [NOT_ANSWERED]


def test_counters_are_kept_beside_the_states(tmp_path: Path) -> None:
    path = tmp_path / "states.sqlite3"
    assert read_counts(path, "", 0.0, 100.0) == []
    rows = [CountRow(at, "", good=at) for at in (10.0, 70.0, 130.0)]
    write_states(path, [StateRow(10.0, "", RUN)], [], [*rows, CountRow(70.0, "right", good=1.0)])
    assert read_counts(path, "", 80.0, 140.0) == rows[1:]
    assert read_counts(path, "", 0.0, 70.0) == rows[:1]

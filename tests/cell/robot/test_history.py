"""Histories: no peak is lost at any zoom, memory has an end, gaps stay gaps, clocks are set."""

import math
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.cell.robot.history import Bucket, Column, FieldHistory, History, Level
from app.panel.widgets.trend import RAW_SAMPLES, bucket_counts, history_bytes

START = 1_795_000_000.0
DAY = 86_400.0
MAX_AGE = 5.0

values = st.floats(-1e6, 1e6) | st.sampled_from([math.nan, math.inf, 0.0])
samples = st.lists(st.tuples(st.floats(0.0, 90.0), values), min_size=1, max_size=300)


Steps = list[tuple[float, float]]


def recorded(steps: Steps, keep_s: float = DAY) -> tuple[FieldHistory, Steps]:
    """A history, and the (time, value) that are in it."""
    history, at = FieldHistory(keep_s, MAX_AGE), START
    known: Steps = []
    for step, value in steps:
        at += step
        history.add(at, value)
        if math.isfinite(value):
            known.append((at, value))
    return history, known


def sine(seconds: int, hz: float, keep_s: float = DAY) -> FieldHistory:
    history = FieldHistory(keep_s, MAX_AGE)
    for number in range(round(seconds * hz)):
        history.add(START + number / hz, math.sin(number / hz))
    return history


@given(samples, st.floats(10.0, DAY), st.integers(10, 600), st.floats(0.0, 1.0))
def test_no_peak_is_lost_at_any_zoom(
    steps: list[tuple[float, float]], span: float, points: int, place: float
) -> None:
    """Each value of the time that is asked for is in a column at its place."""
    history, known = recorded(steps)
    last = max((at for at, _ in known), default=START)
    end = START + place * (last - START) + 1.0
    width = span / points
    columns = list(history.columns(end - span, end, width))
    reach = max(width, next((w for w, _ in bucket_counts(DAY) if w > width), width))
    for at, value in known:
        if end - span <= at < end:
            near = [
                column for column in columns if abs((column.number + 0.5) * width - at) <= width + reach
            ]
            assert any(column.low <= value <= column.high for column in near), (at, value, columns)
    numbers = [column.number for column in columns]
    assert numbers == sorted(set(numbers))
    assert len(columns) <= points + 3
    for column in columns:
        assert column.low <= column.last <= column.high
        assert {column.low, column.high} <= {value for _, value in known}


@given(samples)
def test_added_samples_are_in_the_next_columns(
    steps: list[tuple[float, float]],
) -> None:
    """Who follows a history and asks for the newest columns only, has the same as who asks for all."""
    width, span = 0.5, 60.0
    history, at, since = FieldHistory(DAY, MAX_AGE), START, 0
    kept: dict[int, Column] = {}
    for step, value in steps:
        at += step / 10
        history.add(at, value)
        columns = list(history.columns(max(at - span, since * width), at + 0.001, width))
        kept = {number: column for number, column in kept.items() if number < since}
        kept |= {column.number: column for column in columns if column.number >= since}
        since = math.floor((at - 1.0) / width) - 1
    begin = math.ceil((at - span) / width) + 1
    whole = {column.number: column for column in history.columns(at - span, at + 0.001, width)}
    assert [column for number, column in kept.items() if number >= begin] == [
        column for number, column in whole.items() if number >= begin
    ]


def test_single_peak_of_a_day_shows_in_every_window() -> None:
    """A single peak of 10 ms in a day of 2 Hz."""
    history = FieldHistory(DAY, MAX_AGE)
    for number in range(round(DAY * 2)):
        history.add(START + number / 2, 1.0)
        if number == 20_000:
            history.add(START + 10_000.01, 99.0)
    end = START + DAY
    for span in (DAY, DAY * 0.95, DAY * 0.9):
        columns = list(history.columns(end - span, end, span / 300))
        assert max(column.high for column in columns) == 99.0, span
    near = list(history.columns(START + 9_000, START + 11_000, 2_000 / 300))
    assert max(column.high for column in near) == 99.0


def test_memory_has_an_end() -> None:
    """Two days of 2 Hz, and a burst: no more than what `history_bytes` says, in every list."""
    history = FieldHistory(3_600.0, MAX_AGE)
    for number in range(round(2 * DAY)):
        history.add(START + number, float(number))
    for number in range(3 * RAW_SAMPLES):
        history.add(START + 2 * DAY + number / 10_000, 1.0)
    lists = {id(values): values for level in (history.raw, *history.levels)
             for values in (level.at, level.low, level.high, level.last, level.gaps)}  # fmt: skip
    assert sum(map(sys.getsizeof, lists.values())) <= history_bytes(3_600.0)
    for level in history.levels:
        assert len(level.at) <= level.most * 9 // 8 + 1


def test_a_week_of_a_field_is_a_megabyte_and_a_half() -> None:
    assert history_bytes(7 * DAY) < 1_500_000


def test_old_values_are_removed() -> None:
    history = sine(1_000, 10.0, keep_s=60.0)
    history.forget_old(START + 5_000)
    assert not history.raw.at
    assert not [level for level in history.levels if len(level.at) > level.most // 8]


@pytest.mark.parametrize("silence", [MAX_AGE + 0.1, 600.0, 40_000.0])
def test_no_line_is_drawn_over_a_silence(silence: float) -> None:
    history = FieldHistory(DAY, MAX_AGE)
    for begin in (START, START + 60.0 + silence):
        for number in range(600):
            history.add(begin + number / 10, 1.0)
    end = START + 120.0 + silence
    for points in (50, 500):
        width = (end - START) / points
        columns = list(history.columns(START, end, width))
        begins = [column.number for column in columns[1:] if column.gap]
        if width < silence / 2:
            assert [number * width - START for number in begins] == pytest.approx(
                [60.0 + silence], abs=width + 1
            )


@pytest.mark.parametrize("gap", ["nan", "interrupted"])
def test_no_line_is_drawn_over_a_gap(gap: str) -> None:
    history = FieldHistory(DAY, MAX_AGE)
    for number in range(20):
        if number == 10:
            if gap == "nan":
                history.add(START + number - 0.5, math.nan)
            else:
                history.interrupt()
        history.add(START + number, 1.0)
    columns = list(history.columns(START, START + 20, 0.1))
    assert [round(column.number * 0.1 - START) for column in columns if column.gap] == [0, 10]


def test_a_line_comes_in_from_before_the_window() -> None:
    history = FieldHistory(DAY, 60.0)
    for number in range(10):
        history.add(START + 30.0 * number, float(number))
    (before, *inside) = history.columns(START + 100, START + 200, 1.0)
    assert before.last == 3.0
    assert [column.last for column in inside] == [4.0, 5.0, 6.0]


def test_a_level_drops_the_oldest_only() -> None:
    level = Level(1.0, 80)
    for number in range(1_000):
        level.add(START + number, float(number), gap=False)
    assert list(level.last)[-80:] == [float(number) for number in range(920, 1_000)]
    assert len(level.at) == len(level.low) == len(level.high) == len(level.gaps) <= 90


def test_a_time_that_goes_back_is_no_time_before() -> None:
    history = FieldHistory(DAY, MAX_AGE)
    history.add(START, 1.0)
    history.add(START - 100.0, 2.0)
    assert list(history.raw.at) == [START, START]


def buckets(*ats: float) -> list[Bucket]:
    return [Bucket(at, 1.0, 2.0, 1.5, gap=False) for at in ats]


def history_of(wall: float) -> tuple[History, FieldHistory]:
    whole = History(1_000.0, wall)
    field = whole.fields["speed", "data"] = FieldHistory(DAY, MAX_AGE)
    return whole, field


def places(columns: list[Column], width: float) -> list[float]:
    return [column.number * width for column in columns]


@pytest.mark.parametrize("jump", [-7_200.0, 7_200.0])
def test_history_moves_with_a_clock_that_is_set(jump: float) -> None:
    """A kiosk without a battery for its clock gets the time by the network some minutes later."""
    whole, field = history_of(START)
    for number in range(10):
        field.add(whole.time(1_000.0 + number), float(number))
    whole.set_clock(1_010.0, START + 10.0 + jump)
    for number in range(10, 20):
        field.add(whole.time(1_000.0 + number), float(number))
    columns = list(whole.columns(field, START + jump, START + jump + 20, 1.0))
    assert [column.last for column in columns] == [float(number) for number in range(20)]
    assert places(columns, 1.0) == [START + jump + number for number in range(20)]
    assert not [column for column in columns[1:] if column.gap]


def test_a_clock_that_drifts_moves_nothing() -> None:
    whole, _ = history_of(START)
    whole.set_clock(2_000.0, START + 1_000.2)
    assert whole.shift == 0.0


def test_samples_of_earlier_runs_keep_their_time() -> None:
    whole, field = history_of(START)
    field.levels[0].put_before(buckets(START - 20, START - 10))
    field.add(whole.time(1_001.0), 3.0)
    whole.set_clock(1_002.0, START + 2 + 3_600)
    columns = list(whole.columns(field, START - 30, START + 3_700, 1.0))
    assert places(columns, 1.0) == [START - 20, START - 10, START + 3_601]


def test_a_run_with_a_clock_behind_the_one_before_comes_after_it() -> None:
    """The clock is behind until the network sets it: what is recorded has its order all the same."""
    whole, field = history_of(START)
    whole.begin_after(START + 500.0)
    field.levels[0].put_before(buckets(START + 400, START + 500))
    whole.set_clock(1_000.0, START)
    field.add(whole.time(1_001.0), 3.0)
    assert list(field.levels[0].at) == sorted(field.levels[0].at)
    behind = list(whole.columns(field, START - 10, START + 10, 1.0))
    assert (places(behind, 1.0), [column.last for column in behind]) == ([START + 1], [3.0])
    whole.set_clock(1_002.0, START + 1_002.0)
    put_right = list(whole.columns(field, START + 300, START + 1_010, 1.0))
    assert places(put_right, 1.0) == [START + 400, START + 500, START + 1_001]

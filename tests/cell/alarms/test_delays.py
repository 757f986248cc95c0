"""Delays, deadbands and limits."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.cell.alarms.states import AlarmLimit, DelayedCondition, Delays, LimitName, level_of

HIGH, HIGH_HIGH = AlarmLimit("high", 80.0, deadband=5.0), AlarmLimit("high_high", 95.0)
LOW, LOW_LOW = AlarmLimit("low", 5.0, deadband=0.5), AlarmLimit("low_low", 2.0)


@pytest.mark.parametrize(
    ("limit", "value", "before", "exceeded"),
    [
        (HIGH, 80.0, False, False),
        (HIGH, 80.1, False, True),
        (HIGH, 75.1, True, True),
        (HIGH, 75.0, True, False),
        (LOW, 5.0, False, False),
        (LOW, 4.9, False, True),
        (LOW, 5.4, True, True),
        (LOW, 5.5, True, False),
        (HIGH_HIGH, math.inf, False, True),
        (LOW, math.nan, False, True),
    ],
)
def test_limit_stays_exceeded_until_the_value_is_past_the_deadband(
    limit: AlarmLimit, value: float, before: bool, exceeded: bool
) -> None:
    assert limit.is_exceeded(value, before) is exceeded


@given(
    st.sampled_from(["low", "high", "low_low", "high_high"]),
    st.floats(-1e6, 1e6),
    st.floats(0, 100),
    st.booleans(),
    st.floats(allow_nan=False) | st.floats(-0.01, 0.01),
)
def test_only_a_value_within_the_range_leaves_a_limit_as_it_is(
    name: LimitName, value: float, deadband: float, before: bool, heard: float
) -> None:
    limit = AlarmLimit(name, value, deadband)
    lowest, highest = limit.range_as(before)
    edge = next(edge for edge in (lowest, highest) if not math.isinf(edge))
    for value in (heard, edge, math.nextafter(edge, math.inf), math.nextafter(edge, -math.inf)):
        assert (limit.is_exceeded(value, before) is before) is (lowest <= value <= highest)


def test_the_level_is_that_of_the_limit_farthest_out() -> None:
    assert level_of([(HIGH, False), (HIGH_HIGH, False)]) == 0
    assert level_of([(HIGH, True), (HIGH_HIGH, False), (LOW, False)]) == 1
    assert level_of([(LOW, True), (LOW_LOW, True)]) == 2


def test_a_condition_counts_after_its_delay() -> None:
    delays = Delays(on_s=2.0, off_s=5.0)
    met = DelayedCondition().observe(True, 10.0, delays)
    assert (met.active, met.due(delays)) == (False, 12.0)
    active = met.at(12.0, delays)
    assert (active.active, active.due(delays)) == (True, math.inf)
    cleared = active.observe(False, 13.0, delays)
    assert cleared.at(17.9, delays).active
    assert not cleared.at(18.0, delays).active


def test_a_condition_that_is_met_for_less_than_its_delay_never_counts() -> None:
    delays = Delays(on_s=2.0)
    gone = DelayedCondition().observe(True, 10.0, delays).observe(False, 11.9, delays)
    assert gone.observe(True, 11.9, delays).due(delays) == 13.9
    assert not gone.at(1000.0, delays).active


def test_a_condition_that_is_heard_again_keeps_its_time() -> None:
    delays = Delays(on_s=2.0)
    met = DelayedCondition().observe(True, 10.0, delays).observe(True, 11.0, delays)
    assert met.due(delays) == 12.0


@given(st.lists(st.tuples(st.floats(0.01, 10), st.booleans()), max_size=30))
def test_without_delays_a_condition_counts_at_once(heard: list[tuple[float, bool]]) -> None:
    now, condition = 0.0, DelayedCondition()
    for seconds, met in heard:
        now += seconds
        condition = condition.observe(met, now, Delays())
        assert condition.active is met

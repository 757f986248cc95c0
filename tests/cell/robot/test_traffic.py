"""How often topics arrive, from counts: regular, slow and stopped ones, and what can't be decoded."""

import logging

import pytest

from app.cell.robot.traffic import (
    EVERY_S,
    MAX_COLUMNS,
    MOST_IN_COLUMN,
    MOST_MARKS,
    RoundTrips,
    TopicTraffic,
    Traffic,
)
from app.ros.zenoh.sample import Sample
from app.system.errors import DecodeError
from app.system.log import RobotLog

BEGAN = 1000.0


def sample(at: float, size: int = 8, skipped: int = 0, cached: bool = False) -> Sample:
    return Sample(b"x" * size, 1, at, at, None, skipped, cached=cached)


def arrived(hz: float, seconds: float, per_drain: int = 1) -> TopicTraffic:
    """A topic that arrived regularly until `BEGAN + seconds`, `per_drain` messages at a time."""
    topic = TopicTraffic()
    for number in range(per_drain, round(hz * seconds) + 1, per_drain):
        topic.record(sample(BEGAN + number / hz, skipped=per_drain - 1))
    return topic


@pytest.mark.parametrize("hz", [0.1, 0.5, 2.0, 10.0, 125.0])
@pytest.mark.parametrize("per_drain", [1, 5])
def test_regular_rate(hz: float, per_drain: int) -> None:
    if hz < 1 and per_drain > 1:
        return
    assert arrived(hz, 55.0, per_drain).rate(BEGAN + 55.0) == pytest.approx(hz, rel=0.02)


def test_messages_that_no_drain_has_read_count() -> None:
    topic = arrived(1000.0, 20.0, per_drain=50)
    assert topic.count == 20_000
    assert topic.rate(BEGAN + 20.0) == pytest.approx(1000, rel=0.02)


def test_a_topic_that_stopped_falls_to_no_rate() -> None:
    topic = arrived(10.0, 30.0)
    rates = [topic.rate(BEGAN + 30.0 + pause) or 0.0 for pause in (0.0, 1.0, 5.0, 9.0, 55.0, 70.0)]
    assert rates == sorted(rates, reverse=True)
    assert rates[0] == pytest.approx(10, rel=0.02)
    assert topic.rate(BEGAN + 100.0) is None


def test_one_message_and_one_from_a_cache_have_no_rate() -> None:
    topic = TopicTraffic()
    topic.record(sample(BEGAN, size=64, cached=True))
    assert (topic.count, topic.size, topic.rate(BEGAN + 1)) == (0, 64, None)
    topic.record(sample(BEGAN + 2))
    assert (topic.count, topic.rate(BEGAN + 3)) == (1, None)


def test_marks_are_bounded() -> None:
    topic = arrived(100.0, 600.0)
    assert len(topic._marks) == MOST_MARKS


def test_undecodable_message_has_its_first_bytes_and_size() -> None:
    traffic = Traffic(RobotLog(logging.getLogger("test"), ""))
    traffic.count_undecodable("speed", sample(BEGAN, size=5000), DecodeError("too short"))
    undecodable = traffic.topics["speed"].undecodable
    assert undecodable is not None
    assert (undecodable.first, undecodable.size, undecodable.reason) == (b"x" * 32, 5000, "too short")


def test_round_trips_are_summed_up_over_five_minutes_in_bounded_memory() -> None:
    trips = RoundTrips()
    assert trips.summary(BEGAN) is None
    for number in range(30_000):
        trips.record(0.001 * (1 + number % 3), BEGAN + number * 0.1)
    now = BEGAN + 3000.0
    summary = trips.summary(now)
    assert summary is not None
    assert (summary.least, summary.median, summary.most) == (0.001, 0.002, 0.003)
    assert len(summary.medians) <= MAX_COLUMNS
    assert all(len(times) <= MOST_IN_COLUMN for _, times in trips._columns)
    assert trips.summary(now + MAX_COLUMNS * EVERY_S + EVERY_S) is None

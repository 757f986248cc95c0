"""How far a robot's clock is from the panel's, by stamps; and its simulated time."""

import math
from itertools import product

import pytest

from app.cell.robot.clocks import COLUMN_S, COLUMNS, PAUSED_S, Offsets, RobotClock, SimulatedTime
from app.ros.cdr.stamped import begins_with_stamp, first_stamp
from app.ros.messages import load_interfaces
from app.system.errors import LinkError
from app.system.texts import say

JAZZY = load_interfaces("jazzy")
WALL = 1_800_000_000.0  # when the monotonic clock was 0
DAY_S = 86_400.0


def offsets_of(*stamped: tuple[float, float]) -> Offsets:
    """Of (stamp, when it came), both in seconds after `WALL`."""
    offsets = Offsets()
    for stamp, at in stamped:
        offsets.add(WALL + stamp, WALL + at, at)
    return offsets


@pytest.mark.parametrize(
    ("stamped", "expected"),
    [
        ([], None),
        ([(-41.0, 0.0)], None),  # one stamp may be a repeated one
        ([(-41.0, 0.0), (-41.0, 1.0), (-41.0, 2.0)], None),  # a message that is repeated
        ([(-41.2, 0.0), (-40.1, 1.0), (-39.5, 2.0)], -41.1),  # delays of 0.2, 0.1, 0.5 s
        ([(3.0, 0.0), (4.0, 1.0)], 3.0),
        ([(0.0, 0.0), (1.0, 1.0), (1.5, 10.0)], 0.0),  # a message that waited says nothing
        ([(0.0, 0.0), (1.0, 1.0), (-58.0, 2.0), (-57.0, 3.0)], -60.0),  # its clock was set back
        ([(0.0, 0.0), (1.0, 1.0), (62.0, 2.0)], 60.0),  # and ahead
    ],
)
def test_the_least_delayed_stamp_counts(
    stamped: list[tuple[float, float]], expected: float | None
) -> None:
    greatest = offsets_of(*stamped).greatest
    assert greatest == (None if expected is None else pytest.approx(expected, abs=1e-5))


def test_offsets_are_of_the_last_hour_and_have_a_fixed_size() -> None:
    offsets = offsets_of((-0.1, 0.0), (1.0, 1.0))
    for number in range(1, 5 * COLUMNS):
        at = number * COLUMN_S
        offsets.add(WALL + at - 0.5, WALL + at, at)
        assert len(offsets._columns) <= COLUMNS
        if abs(number - COLUMNS) > 1:
            assert offsets.greatest == (0.0 if number < COLUMNS else -0.5)


def record(clock: RobotClock, key: str, skew_s: float, begin: float = 0.0) -> None:
    """Three messages of a topic whose node's clock is ahead by so much."""
    for at in (begin, begin + 1.0, begin + 2.0):
        clock.record_topic(key, WALL + at + skew_s, WALL + at, at)


def record_peer(clock: RobotClock, skew_s: float, zid: str = "b1") -> None:
    for at in (0.0, 1.0, 2.0):
        clock.record_peer(zid, WALL + at + skew_s, WALL + at, at)


def test_the_clock_of_the_peer_counts_before_stamps_in_messages() -> None:
    clock = RobotClock()
    assert clock.skew is None
    assert clock.time_at(WALL) == WALL
    record(clock, "odom", -41.0)
    assert clock.skew is not None
    assert (clock.skew.seconds, clock.skew.witness, clock.skew.state) == (-41.0, "stamps", "apart")
    assert clock.time_at(WALL) == WALL - 41.0
    record_peer(clock, 0.25)
    assert (clock.skew.seconds, clock.skew.witness, clock.skew.state) == (0.25, "peer", "even")
    assert clock.time_at(WALL) == WALL + 0.25  # the messages are old, or of another computer
    assert clock.topics_apart == {"odom": -41.0}
    clock.forget_peer("b1")
    assert clock.skew.witness == "stamps"
    clock.forget()
    assert clock.skew is None


def test_of_several_topics_the_middle_one_counts() -> None:
    clock = RobotClock()
    for key, skew_s in {"stuck": -600.0, "odom": -41.1, "scan": -41.0, "ahead": 1.0}.items():
        record(clock, key, skew_s)
    assert clock.skew is not None
    assert clock.skew.seconds == -41.0
    assert clock.topics_apart == {"stuck": -600.0, "ahead": 1.0}


def test_a_change_of_the_panels_own_clock_begins_again() -> None:
    clock = RobotClock()
    record(clock, "odom", 0.0)
    for at in (3.0, 4.0):
        clock.record_topic("odom", WALL + at, WALL + at - 600.0, at)
    assert clock.skew is not None
    assert clock.skew.seconds == 600.0


@pytest.mark.parametrize("skew_s", [-WALL, -200 * DAY_S, 2 * DAY_S])
def test_stamps_of_another_time_correct_nothing(skew_s: float) -> None:
    clock = RobotClock()
    record(clock, "odom", skew_s)
    assert clock.skew is not None
    assert clock.skew.state == "other_time"
    assert math.isnan(clock.time_at(WALL))
    record_peer(clock, 0.0)
    assert clock.skew.witness == "peer"
    assert math.isnan(clock.time_at(WALL))


def test_what_is_said_changes_with_whole_seconds_only() -> None:
    clock = RobotClock()
    record(clock, "odom", -41.0)
    version = clock.version
    record(clock, "odom", -40.9, begin=10.0)
    assert clock.version == version
    record(clock, "odom", -30.0, begin=20.0)
    assert clock.version == version + 1


def test_a_topic_is_read_once_a_second() -> None:
    clock = RobotClock()
    assert [clock.is_due("odom", at) for at in (0.0, 0.5, 1.0, 1.9, 2.0)] == [1, 0, 1, 0, 1]


# The stamps of messages.


@pytest.mark.parametrize("sec", [0, 12, 1_800_000_000, -1])
def test_the_stamp_stands_before_all_else(sec: int) -> None:
    stamp = {"sec": sec, "nanosec": 250_000_000}
    data = JAZZY.encode("sensor_msgs/msg/JointState", {"header": {"stamp": stamp, "frame_id": "a"}})
    assert first_stamp(data) == sec + 0.25
    big_endian = bytes([0, 0, 0, 0]) + data[4:8][::-1] + data[8:12][::-1]
    assert first_stamp(big_endian) == sec + 0.25


@pytest.mark.parametrize(
    "data",
    [b"", bytes(11), bytes(12), bytes([0, 1, 0, 0]) + b"\xff" * 8],
    ids=["", "short", "unset", "ns"],
)
def test_what_is_no_stamp(data: bytes) -> None:
    assert first_stamp(data) is None


@pytest.mark.parametrize(
    ("type_name", "expected"),
    [
        ("nav_msgs/msg/Odometry", True),
        ("rcl_interfaces/msg/Log", True),
        ("builtin_interfaces/msg/Time", False),
        ("tf2_msgs/msg/TFMessage", False),
        ("std_msgs/msg/String", False),
        ("std_msgs/msg/Empty", False),
        ("no_such/msg/Type", False),
    ],
)
def test_types_that_begin_with_a_stamp(type_name: str, expected: bool) -> None:
    assert begins_with_stamp(type_name, JAZZY.structures) is expected


# Simulated time.


def clock_message(seconds: float) -> bytes:
    whole = math.floor(seconds)
    stamp = {"sec": whole, "nanosec": round((seconds - whole) * 1e9)}
    return JAZZY.encode("rosgraph_msgs/msg/Clock", {"clock": stamp})


def test_simulated_time_goes_on_pauses_and_begins_again() -> None:
    simulated = SimulatedTime()
    assert simulated.state(0.0) == "unknown"
    assert math.isnan(simulated.seconds)
    steps: list[tuple[float, float, str, int]] = [
        (0.0, 0.0, "running", 0),  # a simulation's time may begin at 0
        (1.0, 0.5, "running", 0),
        (1.0, 0.5 + PAUSED_S, "paused", 0),  # it repeats its time
        (1.001, 3.0, "running", 0),
        (0.95, 3.1, "running", 0),  # two messages in another order
        (0.2, 3.2, "running", 1),  # a recording of a second begins again
    ]
    for seconds, at, state, jumps in steps:
        simulated.put(clock_message(seconds), at)
        assert (simulated.state(at), simulated.jumps) == (state, jumps)
    assert simulated.ns == 200_000_000
    simulated.put(b"", 4.0)
    assert simulated.ns == 200_000_000


def test_ages_are_by_the_simulated_time_while_there_is_one() -> None:
    clock = RobotClock()
    record(clock, "odom", -41.0)
    record_peer(clock, 0.0)
    simulated = clock.begin_simulated()
    assert clock.is_awaited
    assert math.isnan(clock.time_at(WALL))
    with pytest.raises(LinkError) as refused:
        clock.now_ns()
    assert refused.value.text == say("clock_awaited_lock")
    assert clock.stop_ns() == 0
    record(clock, "odom", -WALL)  # nothing to compare them with
    assert clock.stamps_s is None
    for at in (0.0, 1.0, 2.0):
        simulated.put(clock_message(100.0 + at), at)
        clock.record_topic("odom", 99.9 + at, WALL + at, at)
        clock.record_topic("wall", WALL + at, WALL + at, at)
    assert clock.time_at(WALL + 2.0) == 102.0
    assert clock.now_ns() == clock.stop_ns() == 102_000_000_000
    assert [*clock.topics_apart] == ["wall"]  # a node without use_sim_time
    clock.end_simulated()
    assert clock.time_at(WALL) == WALL
    assert clock.stamps_s is None


def test_a_robot_on_rmw_zenoh_has_no_stamps_of_a_peer() -> None:
    clock = RobotClock()
    for key, at in product(("a", "b", "c"), (0.0, 1.0)):
        clock.record_topic(key, WALL + at + 2.0, WALL + at, at)
    assert clock.skew is not None
    assert (clock.skew.seconds, clock.skew.witness) == (2.0, "stamps")

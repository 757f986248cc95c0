"""Joysticks: holds whose heartbeats have a deflection. What is sent of it, and each end with zeros."""

import math
from collections.abc import Callable
from typing import Any, Final

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.cell.commands.holds import LEASE_S, RELEASED, ActiveHold, moved, ramped, shaped
from app.panel.widgets.hold import Joystick
from app.web.routes.holds import END_REASONS
from tests.cell.commands.test_holds import POINT, STOPS, Bench
from tests.support.builders import BRIDGE, TEXT, endpoint, permits

STICK: Final[dict[str, Any]] = {
    "id": "stick",
    "kind": "joystick",
    "label": "Stick",
    "topic": "/jog",
    "type": POINT,
    "message": {"x": "{x}", "y": "{y}", "z": 0},
    "interlock": "operation",
    "x_axis": {"max": 2.0},
    "y_axis": {"max": -4.0},
    "shape": "square",
    "dead_zone": 0.0,
}
UNIT = st.floats(-1, 1)


def bench_of(**more: Any) -> Bench:
    return Bench(STICK | more)


def held(bench: Bench, x: float = 1.0, y: float = 0.5) -> ActiveHold:
    """A hold that has sent its deflection."""
    holding = bench.begun("stick")
    assert bench.holds.beat(holding, 1, bench.loop.now, (x, y))
    bench.loop.pass_time(0.06)
    return holding


def stick(**more: Any) -> Joystick:
    return Joystick.model_validate(STICK | more)


def test_joystick_begins_with_zeros_and_sends_the_newest_deflection() -> None:
    bench = bench_of()
    holding = held(bench)
    assert bench.points == [STOPS, (2.0, -2.0, 0.0)]
    bench.holds.beat(holding, 3, bench.loop.now, (-1.0, 0.0))
    bench.holds.beat(holding, 2, bench.loop.now, (0.3, 0.3))  # it was overtaken
    bench.loop.pass_time(0.05)
    assert bench.points[-1] == (-2.0, 0.0, 0.0)
    bench.holds.beat(holding, 4, bench.loop.now)  # a program that says nothing of it
    bench.loop.pass_time(0.05)
    assert bench.points[-1] == (-2.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "code", sorted({*END_REASONS.values(), "hold_by_closing", "hold_by_reconnect"})
)
def test_every_end_of_a_joystick_hold_sends_zeros(code: str) -> None:
    bench = bench_of()
    holding = held(bench)
    bench.holds.end(holding, code)
    sent = list(bench.points)
    assert sent[-2:] == [(2.0, -2.0, 0.0), STOPS]
    assert bench.receipts[0].outcome == ("published" if code == RELEASED else "aborted")
    assert bench.holds.beat(holding, 9, bench.loop.now, (1.0, 1.0)) is False
    bench.loop.pass_time(10)
    assert bench.points == sent


def forbidden(bench: Bench) -> None:
    permits(bench.robot, False, at=bench.loop.now)
    bench.holds.judge()


def other_type(bench: Bench) -> None:
    endpoint(bench.robot, "MS", "/jog", TEXT)
    bench.holds.judge()


def stalled(bench: Bench) -> None:
    bench.loop.stall(1.0)
    bench.holds.judge()


ENDS: Final[dict[str, Callable[[Bench], None]]] = {
    "the interlock forbids": forbidden,
    "the topic gets another type": other_type,
    "no beat comes": lambda bench: bench.loop.pass_time(LEASE_S),
    "the server stalls": stalled,
    "the server ends": lambda bench: bench.holds.close(),
}


@pytest.mark.parametrize("cause", ENDS)
def test_lost_certainty_ends_the_joystick_with_zeros(cause: str) -> None:
    bench = bench_of()
    held(bench)
    ENDS[cause](bench)
    assert bench.points[-1] == STOPS
    count = len(bench.points)
    bench.loop.pass_time(10)
    assert (len(bench.points), len(bench.receipts)) == (count, 1)


def test_zenoh_error_ends_a_joystick_hold_and_no_message_follows() -> None:
    bench = bench_of()
    held(bench)
    bench.way.fails = "gone"
    bench.loop.pass_time(0.1)
    assert bench.receipts[0].outcome == "unknown"
    bench.way.fails = ""
    bench.loop.pass_time(10)
    assert bench.points[-1] == (2.0, -2.0, 0.0)  # the robot's own deadline has to act


def test_without_a_bridge_nothing_is_said() -> None:
    bench = bench_of()
    held(bench)
    bench.robot.graph.apply_token(f"@/{BRIDGE}/@ros2_lv", False)
    bench.holds.judge()
    assert bench.receipts[0].outcome == "unknown"


def test_a_deflection_as_old_as_a_lease_counts_for_nothing() -> None:
    bench = bench_of()
    holding = held(bench)
    bench.holds.beat(holding, 2, bench.loop.now - LEASE_S, (-1.0, -1.0))
    bench.loop.pass_time(0.05)
    assert bench.points[-1] == (2.0, -2.0, 0.0)


def test_no_two_holds_send_on_its_topic() -> None:
    bench = Bench(STICK, STICK | {"id": "other", "label": "Other"})
    held(bench)
    assert bench.refused("other")[0] == "interlock"


@given(UNIT, UNIT, st.floats(0, 0.9), st.sampled_from(["circle", "square"]))
def test_sent_value_is_within_the_limits(x: float, y: float, dead: float, shape: str) -> None:
    shaped_position = shaped(stick(dead_zone=dead, shape=shape), (x, y))
    assert all(
        abs(sent) <= abs(axis) + 1e-12 for sent, axis in zip(shaped_position, (x, y), strict=True)
    )
    assert all(sent * axis >= 0 for sent, axis in zip(shaped_position, (x, y), strict=True))
    if shape == "circle":
        assert math.hypot(*shaped_position) <= 1 + 1e-9
        if math.hypot(x, y) <= dead:
            assert shaped_position == (0.0, 0.0)


@pytest.mark.parametrize(
    ("shape", "position", "sent"),
    [
        ("square", (1.0, 1.0), (1.0, 1.0)),
        ("square", (0.2, -0.6), (0.0, -0.5)),
        ("circle", (0.2, 0.0), (0.0, 0.0)),
        ("circle", (0.6, 0.0), (0.5, 0.0)),
        ("circle", (0.0, -1.0), (0.0, -1.0)),
        ("square", (2.0, -3.0), (1.0, -1.0)),  # more than a joystick has
        ("circle", (-3.0, 0.0), (-1.0, 0.0)),
    ],
)
def test_the_dead_zone_is_zero_and_begins_with_zero(
    shape: str, position: tuple[float, float], sent: tuple[float, float]
) -> None:
    assert shaped(stick(dead_zone=0.2, shape=shape), position) == pytest.approx(sent)


def test_ramp_limits_acceleration_but_not_stopping() -> None:
    joystick = stick(ramp_s=0.5, rate_hz=20)  # a tenth with each message
    assert moved(joystick, (0.0, 0.0), (1.0, -1.0)) == pytest.approx((0.1, -0.1))
    assert moved(joystick, (0.8, -0.8), (0.2, 0.0)) == (0.2, 0.0)
    assert moved(joystick, (0.8, 0.0), (-1.0, 0.0)) == pytest.approx((-0.1, 0.0))


@given(UNIT, UNIT, st.floats(0.001, 1))
def test_ramp_never_exceeds_the_target(before: float, wanted: float, step: float) -> None:
    next_value = ramped(before, wanted, step)
    assert abs(next_value) <= max(abs(wanted), 0.0) + 1e-12
    assert next_value * wanted >= 0

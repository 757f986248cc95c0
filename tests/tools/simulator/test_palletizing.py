"""The palletizing cell, stepped by hand."""

import itertools
from collections.abc import Callable, Iterator
from random import Random
from typing import Final

import pytest

from app.tools.simulator.palletizing import (
    AIR_IS_LOW,
    BOXES,
    CYCLE_S,
    DOOR_OPEN,
    ENOUGH_BAR,
    FIRST_BOXES,
    FIRST_DIP_S,
    FIRST_DOOR_S,
    HELD_ON,
    JOG_S,
    LIGHT_S,
    LOW_BAR,
    NO_FAULT,
    NOT_FULL,
    OPEN_S,
    OUT_S,
    REFUSED,
    ROWS,
    SPEED_MM_S,
    PalletizingCell,
    Reason,
    State,
    joints_at,
    vacuum_kpa,
)

STEP_S: Final = 0.1
HOUR_S: Final = 3600
STATES: Final = ("state", "reason", "boxes", "pallet", "part", "out_s", "belt_mm_s")


@pytest.fixture
def cell() -> PalletizingCell:
    return PalletizingCell()


def run(cell: PalletizingCell, seconds: float) -> Iterator[PalletizingCell]:
    """The cell at each step."""
    end = cell.t + seconds
    while cell.t < end - STEP_S / 2:
        cell.step(cell.t + STEP_S)
        yield cell


def run_until(cell: PalletizingCell, condition: Callable[[], bool], within_s: float = 600) -> None:
    assert any(condition() for _ in run(cell, within_s)), "it never happens"


def pass_time(cell: PalletizingCell, seconds: float) -> PalletizingCell:
    for _ in run(cell, seconds):
        pass
    return cell


def visit(cell: PalletizingCell) -> None:
    """What a visitor presses to go on."""
    cell.reset()
    cell.start()
    cell.move_pallet_out()


def snapshot(cell: PalletizingCell) -> tuple[object, ...]:
    return tuple(getattr(cell, name) for name in STATES)


def open_door(cell: PalletizingCell) -> None:
    cell.door.move(opened=True)
    pass_time(cell, STEP_S)


def close_door(cell: PalletizingCell) -> None:
    cell.door.move(opened=False)
    pass_time(cell, STEP_S)


def fill_pallet(cell: PalletizingCell) -> None:
    cell.boxes = BOXES - 1
    run_until(cell, lambda: cell.reason is Reason.PALLET_FULL)


def test_an_hour_keeps_the_rules_of_the_cell(cell: PalletizingCell) -> None:
    """With a visitor who opens the door, jogs, stops and goes on at random."""
    random = Random(1)
    seen: set[State] = set()
    before = cell.boxes, cell.pallet, cell.part, cell.state
    for at, _ in enumerate(run(cell, HOUR_S)):
        boxes, pallet, part, state = before
        assert cell.boxes in ((boxes, boxes + 1) if pallet == cell.pallet else (0,))
        assert cell.pallet in ((pallet,) if boxes < BOXES else (pallet, pallet + 1))
        assert state is not State.FAULT or cell.state is State.FAULT  # time alone clears none
        if cell.door.is_open:
            assert (cell.state, cell.moves) == (State.FAULT, False)
            assert (cell.boxes, cell.part) == (boxes, part)
        assert cell.arm_moves == (cell.state is State.RUNNING)
        if cell.state is not State.MANUAL:
            assert bool(cell.reason) == (cell.state in (State.WAITING, State.FAULT))
        seen.add(cell.state)
        if at % 50 == 0:
            visit(cell)
        if at % 37 == 0:
            random.choice((cell.stop, cell.pause, lambda: cell.jog(1), cell.start, cell.reset))()
        if at % 1501 == 0:
            cell.door.move(opened=random.random() < 0.5)
        before = cell.boxes, cell.pallet, cell.part, cell.state
    assert seen == set(State)
    assert cell.pallet > 12


def test_the_same_seed_and_clock_give_the_same_hour() -> None:
    def hour(seed: int) -> list[tuple[object, ...]]:
        cell, snapshots = PalletizingCell(seed), []
        for at, _ in enumerate(run(cell, HOUR_S)):
            if at % 100 == 0:
                visit(cell)
                snapshots.append(snapshot(cell))
        return snapshots

    assert hour(3) == hour(3) != hour(4)


def test_one_late_step_equals_many_small_steps(cell: PalletizingCell) -> None:
    late = PalletizingCell()
    pass_time(cell, 4)
    late.step(cell.t)
    assert snapshot(late) == pytest.approx(snapshot(cell))


def test_a_machine_that_slept_goes_on_where_it_was(cell: PalletizingCell) -> None:
    cell.step(HOUR_S)
    assert cell.boxes - FIRST_BOXES <= 2


def test_a_box_takes_a_cycle_and_the_numbers_agree(cell: PalletizingCell) -> None:
    rate, shift = cell.rate, cell.shift_boxes
    pass_time(cell, 10 * CYCLE_S)
    assert cell.boxes == pytest.approx(FIRST_BOXES + 10, abs=1)
    assert cell.shift_boxes - shift == cell.boxes - FIRST_BOXES
    assert cell.rate == pytest.approx(rate, abs=2)
    assert cell.last_cycle_s == pytest.approx(CYCLE_S, rel=0.05)
    assert cell.left_s == (BOXES - cell.boxes) * cell.last_cycle_s
    assert cell.layer == cell.boxes // 24 + 1


def test_the_vacuum_holds_the_box(cell: PalletizingCell) -> None:
    for _ in run(cell, CYCLE_S):
        assert vacuum_kpa(cell) == pytest.approx(-71 if cell.holds_box else -64.5, abs=2)


def test_the_arm_moves_without_a_jump(cell: PalletizingCell) -> None:
    poses = [joints_at(cell.part, cell.layer) for _ in run(cell, 3 * CYCLE_S)]
    jumps = (
        abs(b - a) for old, new in itertools.pairwise(poses) for a, b in zip(old, new, strict=True)
    )
    assert max(jumps) < 0.6


def test_an_open_door_stops_all_motion_until_it_is_closed_and_reset(cell: PalletizingCell) -> None:
    run_until(cell, lambda: cell.holds_box)
    box, part = cell.boxes, cell.part
    open_door(cell)
    assert (cell.state, cell.reason, cell.moves) == (State.FAULT, Reason.GUARD_DOOR, False)
    assert cell.reset() == DOOR_OPEN
    assert cell.start() == cell.pause() == cell.jog(1) == REFUSED[State.FAULT]
    close_door(cell)
    pass_time(cell, 30)
    assert cell.state is State.FAULT
    assert cell.start() == REFUSED[State.FAULT]
    assert cell.stop() == ""
    assert cell.state is State.FAULT
    assert cell.reset() == ""
    assert (cell.state, cell.moves) == (State.STOPPED, False)
    assert cell.reset() == NO_FAULT
    assert cell.start() == ""
    assert (cell.state, cell.boxes) == (State.RUNNING, box)
    assert cell.part == pytest.approx(part, abs=STEP_S / CYCLE_S)
    run_until(cell, lambda: cell.boxes == box + 1, CYCLE_S)


def test_someone_opens_the_door_now_and_then_and_closes_it(cell: PalletizingCell) -> None:
    run_until(cell, lambda: cell.door.is_open, FIRST_DOOR_S + 60)
    opened = cell.t
    run_until(cell, lambda: not cell.door.is_open)
    assert cell.t - opened == pytest.approx(OPEN_S, abs=2 * STEP_S)
    assert cell.state is State.FAULT


def test_a_door_that_was_opened_by_command_stays_open(cell: PalletizingCell) -> None:
    open_door(cell)
    pass_time(cell, 5 * OPEN_S)
    assert cell.door.is_open


def test_a_pause_is_after_this_box(cell: PalletizingCell) -> None:
    box = cell.boxes
    assert cell.pause() == ""
    assert cell.state is State.RUNNING
    run_until(cell, lambda: cell.state is State.PAUSED, 2 * CYCLE_S)
    assert (cell.boxes, cell.part, cell.moves) == (box + 1, 0, False)
    assert cell.pause() == REFUSED[State.PAUSED]
    assert cell.start() == ""
    assert cell.state is State.RUNNING


def test_stop_is_at_once_and_start_goes_on(cell: PalletizingCell) -> None:
    pass_time(cell, 1)
    part = cell.part
    assert cell.stop() == ""
    assert (cell.state, cell.moves) == (State.STOPPED, False)
    assert cell.start() == ""
    assert (cell.state, cell.part) == (State.RUNNING, part)
    assert cell.start() == REFUSED[State.RUNNING]


def test_a_full_pallet_waits_until_it_is_out(cell: PalletizingCell) -> None:
    assert cell.move_pallet_out() == NOT_FULL
    fill_pallet(cell)
    pallet, shift = cell.pallet, cell.shift_boxes
    pass_time(cell, 60)
    assert (cell.state, cell.boxes) == (State.WAITING, BOXES)
    cell.load_order("4712")
    assert cell.move_pallet_out() == ""
    pass_time(cell, OUT_S / 2)
    assert (cell.boxes, cell.moves, cell.order) == (BOXES, True, "4711")
    run_until(cell, lambda: cell.state is State.RUNNING, OUT_S)
    assert (cell.boxes, cell.pallet, cell.order) == (0, pallet + 1, "4712")
    assert cell.shift_boxes == shift


@pytest.mark.parametrize("ended", [PalletizingCell.stop, open_door, PalletizingCell.keep_pallet])
def test_a_pallet_stays_if_its_way_out_is_ended(
    cell: PalletizingCell, ended: Callable[[PalletizingCell], object]
) -> None:
    fill_pallet(cell)
    cell.move_pallet_out()
    pass_time(cell, OUT_S / 2)
    ended(cell)
    pass_time(cell, 2 * OUT_S)
    assert (cell.boxes, cell.out_s) == (BOXES, None)


def test_air_that_falls_is_waited_for_with_a_deadband(cell: PalletizingCell) -> None:
    cell.step(FIRST_DIP_S)
    before = None
    for _ in run(pass_time(cell, FIRST_DIP_S - cell.t), 60):
        if before is not None and before != cell.air.is_enough:
            limit = ENOUGH_BAR if cell.air.is_enough else LOW_BAR
            assert cell.air.bar == pytest.approx(limit, abs=0.1)
        before = cell.air.is_enough
        if cell.state is State.WAITING:
            assert cell.reason is Reason.AIR_LOW
            assert cell.part == 0
    run_until(cell, lambda: cell.state is State.RUNNING, STEP_S * 2)


def test_start_needs_air(cell: PalletizingCell) -> None:
    run_until(cell, lambda: not cell.air.is_enough)
    cell.stop()
    assert (cell.start(), cell.may_start) == (AIR_IS_LOW, False)
    run_until(cell, lambda: cell.air.is_enough)
    assert (cell.start(), cell.state) == ("", State.RUNNING)


def test_the_belt_is_jogged_only_while_nothing_runs(cell: PalletizingCell) -> None:
    assert cell.jog(1) == REFUSED[State.RUNNING]
    pass_time(cell, JOG_S + STEP_S)
    cell.stop()
    assert cell.jog(-1) == ""
    assert (cell.state, cell.belt_mm_s, cell.may_jog) == (State.MANUAL, -SPEED_MM_S, True)
    assert cell.start() == REFUSED[State.MANUAL]
    pass_time(cell, JOG_S / 2)
    assert cell.belt_mm_s == -SPEED_MM_S
    cell.jog(0)
    assert (cell.state, cell.belt_mm_s) == (State.STOPPED, 0)


def test_the_belt_stops_when_its_messages_stop(cell: PalletizingCell) -> None:
    run_until(cell, lambda: cell.part == 0)
    cell.pause()
    run_until(cell, lambda: cell.state is State.PAUSED)
    cell.jog(1)
    pass_time(cell, JOG_S + STEP_S)
    assert (cell.state, cell.belt_mm_s) == (State.PAUSED, 0)


def test_a_stop_ends_a_jog_until_the_button_is_released(cell: PalletizingCell) -> None:
    cell.stop()
    cell.jog(1)
    cell.stop()
    for _ in range(20):
        assert cell.jog(1) == HELD_ON
        pass_time(cell, STEP_S)
        assert (cell.state, cell.belt_mm_s) == (State.STOPPED, 0)
    cell.jog(0)
    assert (cell.jog(1), cell.state) == ("", State.MANUAL)


@pytest.mark.parametrize("on", [True, False])
def test_the_light_reports_its_state_after_a_while(cell: PalletizingCell, on: bool) -> None:
    cell.light = not on
    cell.switch_light(on=not on)
    cell.switch_light(on=on)
    assert cell.light is not on
    pass_time(cell, LIGHT_S + STEP_S)
    assert cell.light is on


def jog(cell: PalletizingCell) -> str:
    return cell.jog(1)


def stop_and_jog(cell: PalletizingCell) -> None:
    cell.stop()
    cell.jog(1)


def open_and_close_door(cell: PalletizingCell) -> None:
    open_door(cell)
    close_door(cell)


def move_full_pallet(cell: PalletizingCell) -> None:
    fill_pallet(cell)
    cell.move_pallet_out()


def stop_when_full(cell: PalletizingCell) -> None:
    fill_pallet(cell)
    cell.stop()


COMMANDS: Final[dict[str, Callable[[PalletizingCell], str]]] = {
    "/cell/start_permitted": PalletizingCell.start,
    "/cell/pause_permitted": PalletizingCell.pause,
    "/cell/reset_permitted": PalletizingCell.reset,
    "/cell/jog_permitted": jog,
    "/cell/pallet_permitted": PalletizingCell.move_pallet_out,
}
SITUATIONS: Final[tuple[Callable[[PalletizingCell], object], ...]] = (
    lambda cell: None,
    PalletizingCell.stop,
    open_door,
    open_and_close_door,
    fill_pallet,
    move_full_pallet,
    stop_when_full,
    stop_and_jog,
)


@pytest.mark.parametrize("topic", COMMANDS)
def test_a_published_permission_is_the_answer_to_the_command(topic: str) -> None:
    verdicts = set()
    for arrange in SITUATIONS:
        cell = PalletizingCell()
        arrange(cell)
        permitted = ROWS[topic].value(cell)
        verdicts.add((permitted, COMMANDS[topic](cell) == ""))
    assert verdicts == {(True, True), (False, False)}


def test_the_gripper_warns_while_air_is_low(cell: PalletizingCell) -> None:
    def level() -> int:
        statuses = ROWS["/diagnostics"].value(cell)
        return next(int(status["level"]) for status in statuses if status["name"] == "Gripper")

    assert level() == 0
    run_until(cell, lambda: not cell.air.is_enough)
    assert level() == 1
    run_until(cell, lambda: cell.air.is_enough)
    assert level() == 0

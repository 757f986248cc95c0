"""Controls of the shipped panel lock as its simulated cell refuses, by texts that fit its state."""

import math
from collections.abc import Callable, Mapping
from typing import Final

import pytest

from app.cell.permission.conditions import permits
from app.panel import Panel, load_panel
from app.tools.simulator.known_types import Moment
from app.tools.simulator.palletizing import (
    BOXES,
    CYCLE_S,
    OK,
    OUT_S,
    ROWS,
    PalletizingCell,
    Reason,
    State,
)
from tests.support.parts import SHIPPED

pytestmark = pytest.mark.promise("demo")

STEP_S: Final = 0.1


def pass_time(cell: PalletizingCell, seconds: float) -> None:
    for _ in range(round(seconds / STEP_S)):
        cell.step(cell.t + STEP_S)


def pause(cell: PalletizingCell) -> None:
    cell.pause()
    pass_time(cell, 2 * CYCLE_S)


def open_door(cell: PalletizingCell) -> None:
    cell.move_door(opened=True)
    pass_time(cell, STEP_S)


def close_door_again(cell: PalletizingCell) -> None:
    open_door(cell)
    cell.move_door(opened=False)


def fault_for_long(cell: PalletizingCell) -> None:
    close_door_again(cell)
    pass_time(cell, 27 * 60)


def lose_air(cell: PalletizingCell) -> None:
    while cell.air.is_enough or cell.state is not State.WAITING:
        pass_time(cell, STEP_S)


def stop_without_air(cell: PalletizingCell) -> None:
    lose_air(cell)
    cell.stop()


def jog(cell: PalletizingCell) -> str:
    return cell.jog(1)


def move_by_hand(cell: PalletizingCell) -> None:
    cell.stop()
    pass_time(cell, 1)
    jog(cell)


def fill_pallet(cell: PalletizingCell) -> None:
    cell.boxes = BOXES - 1
    while cell.reason is not Reason.PALLET_FULL:
        pass_time(cell, STEP_S)


def move_pallet_out(cell: PalletizingCell) -> None:
    fill_pallet(cell)
    cell.move_pallet_out()
    pass_time(cell, OUT_S / 2)


def stop_when_full(cell: PalletizingCell) -> None:
    fill_pallet(cell)
    cell.stop()


def move_pallet_out_when_stopped(cell: PalletizingCell) -> None:
    stop_when_full(cell)
    cell.move_pallet_out()
    pass_time(cell, 1)


def fail_when_full(cell: PalletizingCell) -> None:
    fill_pallet(cell)
    close_door_again(cell)


# Situation → the ids of the interlocks that lock Start, Pause, Reset, the belt and Pallet out.
SITUATIONS: Final[Mapping[Callable[[PalletizingCell], object], tuple[str, str, str, str, str]]] = {
    lambda cell: None: ("start", "", "reset", "jog", "full"),
    pause: ("", "pause", "reset", "", "full"),
    PalletizingCell.stop: ("", "pause", "reset", "", "full"),
    open_door: ("guard fault", "pause", "guard", "guard fault", "guard fault full"),
    close_door_again: ("fault", "pause", "", "fault", "fault full"),
    fault_for_long: ("fault", "pause", "", "fault", "fault full"),
    fail_when_full: ("fault", "pause", "", "fault", "fault"),
    lose_air: ("air start", "pause", "reset", "", "full"),
    stop_without_air: ("air", "pause", "reset", "", "full"),
    move_by_hand: ("hand", "pause", "reset", "", "hand full"),
    fill_pallet: ("start", "pause", "reset", "", ""),
    stop_when_full: ("", "pause", "reset", "", ""),
    move_pallet_out: ("place start", "pause", "reset", "place", "place"),
    move_pallet_out_when_stopped: ("place", "pause", "reset", "place", "place"),
}
COMMANDS: Final[Mapping[str, Callable[[PalletizingCell], str]]] = {
    "start": PalletizingCell.start,
    "pause": PalletizingCell.pause,
    "reset": PalletizingCell.reset,
    "belt_forward": jog,
    "pallet": PalletizingCell.move_pallet_out,
}


@pytest.fixture(scope="module")
def panel() -> Panel:
    return load_panel(SHIPPED)


@pytest.mark.parametrize("arrange", SITUATIONS)
def test_each_control_is_locked_by_what_the_state_says_and_only_then_refused(
    panel: Panel, arrange: Callable[[PalletizingCell], object]
) -> None:
    interlocks = {interlock.id: interlock for interlock in panel.interlocks}
    widgets = {widget.id: widget for widget in panel.commands}
    locked = []
    for name, command in COMMANDS.items():
        cell = PalletizingCell()
        arrange(cell)
        unmet = [
            known
            for known in widgets[name].interlocks
            if not permits(interlocks[known], ROWS[interlocks[known].topic].value(cell))
        ]
        locked.append(" ".join(unmet))
        assert bool(unmet) == bool(command(cell)), name
    assert tuple(locked) == SITUATIONS[arrange]


@pytest.mark.parametrize("arrange", SITUATIONS)
def test_parts_and_the_remaining_time_are_those_of_the_state(
    arrange: Callable[[PalletizingCell], object],
) -> None:
    cell = PalletizingCell()
    arrange(cell)
    parts = {part["name"]: part for part in ROWS["/diagnostics"].value(cell)}
    failed = cell.state is State.FAULT
    assert (parts["Guard door 1"]["level"] != OK) == failed
    assert not [part for part in parts.values() if part["level"] == OK and "fault" in part["message"]]
    assert (parts["Arm"]["message"] == "moves") == cell.arm_moves
    row = ROWS["/cell/minutes_left"]
    left = row.fields(row.value(cell), Moment(0, 0))["data"]
    assert math.isnan(left) == (cell.state not in {State.RUNNING, State.WAITING})


def test_a_fault_stays_until_a_person_ends_it() -> None:
    cell = PalletizingCell()
    fault_for_long(cell)
    assert cell.state is State.FAULT
    pass_time(cell, 3600)
    assert cell.state is State.FAULT


@pytest.mark.parametrize("arrange", [open_door, close_door_again])
def test_a_panel_file_may_have_the_fault_ended_some_time_after_the_last_command(
    arrange: Callable[[PalletizingCell], object],
) -> None:
    cell = PalletizingCell(heals_s=120)
    arrange(cell)
    pass_time(cell, 100)
    cell.reset() if cell.door.is_open else cell.move_door(opened=False)
    pass_time(cell, 119)
    assert cell.state is State.FAULT
    pass_time(cell, 1.2)
    assert (cell.state, cell.door.is_open) == (State.RUNNING, False)

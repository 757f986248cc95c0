"""The hall of the simulated mobile robot: ways, beams and distances."""

import math
from itertools import pairwise
from typing import Final

import pytest

from app.tools.simulator.hall import COARSE, COLUMNS, FREE, MACHINES, ROWS, STRIDE, cell_at, hall
from app.tools.simulator.mobile_robot import PLACES, RADIUS, START

INSIDE_A_MACHINE: Final = (-3.4, 9.0)


def is_free(x: float, y: float) -> bool:
    column, row = cell_at(x, y)
    return hall().cells[row * COLUMNS + column] == FREE


def test_map_has_a_cell_for_each_place() -> None:
    assert len(hall().cells) == COLUMNS * ROWS
    assert set(hall().cells) == {0, 100, 255}
    assert not is_free(*INSIDE_A_MACHINE)


@pytest.mark.parametrize("name", PLACES)
def test_each_place_is_reached_without_touching_anything(name: str) -> None:
    way = hall().way(START[:2], PLACES[name][:2], RADIUS)
    assert way[0] == START[:2]
    assert way[-1] == pytest.approx(PLACES[name][:2])
    assert max(math.dist(a, b) for a, b in pairwise(way)) <= STRIDE + 1e-9
    assert min(hall().clearance(*point) for point in way) >= RADIUS
    assert all(is_free(*point) for point in way)


def test_no_way_leads_into_a_closed_room() -> None:
    assert hall().way(START[:2], (14.5, -8.0), RADIUS) == []


def test_clearance_is_about_the_distance_to_a_machine() -> None:
    left, bottom, right, top = MACHINES[0]
    for x, y in ((-6.0, 9.0), (-3.0, 12.0), (0.0, 8.0), (-2.0, 10.2)):
        true = math.hypot(max(left - x, 0, x - right), max(bottom - y, 0, y - top))
        assert true - 0.4 <= hall().clearance(x, y) <= true + COARSE / 2


def test_beam_ends_at_the_wall_or_at_its_range() -> None:
    assert hall().beam(5.0, 5.0, 0.0, 12.0) == 12.0
    assert hall().beam(32.0, 5.0, 0.0, 12.0) == pytest.approx(34.1 - 32.0, abs=0.25)
    assert hall().beam(-1.0, 9.0, math.pi, 12.0) == pytest.approx(1.4, abs=0.25)


def test_outside_the_map_nothing_is_free() -> None:
    assert hall().clearance(100.0, 0.0) == 0.0
    assert not hall().contains(100.0, 0.0)

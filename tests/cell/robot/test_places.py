"""The floor around a point of a map, and the zones that it is in."""

import math
from typing import Any, Final

import pytest

from app.cell.robot import places
from app.cell.robot.maps import GRID_TYPE, Grid, read_grid
from app.cell.robot.places import MAX_KEPT, KeepOut, floor_at, values_of
from app.panel.places import Zone
from tests.support.builders import INTERFACES

pytestmark = pytest.mark.promise("places")

# 10 x 8 cells of 0.5 m: a wall in column 8, unknown cells in row 7, grey ones in row 0.
WIDTH, HEIGHT, SIZE = 10, 8, 0.5
WALL: Final = 8


def cell(column: int, row: int) -> int:
    return 100 if column == WALL else -1 if row == HEIGHT - 1 else 40 if row == 0 else 0


def grid_of(x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Grid:
    turned = {"z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    info = {"width": WIDTH, "height": HEIGHT, "resolution": SIZE}
    message = {
        "header": {"frame_id": "map"},
        "info": {**info, "origin": {"position": {"x": x, "y": y}, "orientation": turned}},
        "data": [cell(column, row) for row in range(HEIGHT) for column in range(WIDTH)],
    }
    return read_grid(INTERFACES, INTERFACES.encode(GRID_TYPE, message))


@pytest.mark.parametrize(
    ("x", "y", "radius", "floor"),
    [
        (2.0, 2.0, 0.4, "free"),
        (3.55, 2.0, 0.4, "free"),
        (3.65, 2.0, 0.4, "occupied"),  # the wall begins at 4.0
        (4.9, 2.0, 0.35, "unknown"),  # beyond the edge nothing is known
        (4.2, 2.0, 0.01, "occupied"),
        (2.0, 3.2, 0.4, "unknown"),
        (2.0, 3.05, 0.4, "free"),
        (2.0, 0.7, 0.4, "unknown"),  # grey is neither free nor occupied
        (0.3, 2.0, 0.4, "unknown"),
        (-0.1, 2.0, 0.4, "outside"),
        (2.0, 4.0, 0.4, "outside"),
        (5.0, 2.0, 0.4, "outside"),
        (3.65, 3.6, 0.4, "occupied"),  # the worst counts
        (2.0, 2.0, 1e6, "unknown"),
    ],
)
def test_the_worst_cell_within_the_radius_counts(x: float, y: float, radius: float, floor: str) -> None:
    assert floor_at(grid_of(), x, y, radius) == floor


@pytest.mark.parametrize(
    ("column", "row", "floor"), [(2, 3, "free"), (8, 3, "occupied"), (2, 7, "unknown")]
)
def test_an_origin_that_is_turned_and_moved_is_followed(column: int, row: int, floor: str) -> None:
    yaw, x, y = 0.7, -3.0, 2.0
    dx, dy = (column + 0.5) * SIZE, (row + 0.5) * SIZE
    at = (
        x + math.cos(yaw) * dx - math.sin(yaw) * dy,
        y + math.sin(yaw) * dx + math.cos(yaw) * dy,
    )
    assert floor_at(grid_of(x, y, yaw), *at, 0.1) == floor


def test_what_is_kept_of_a_map_is_bounded() -> None:
    grid = grid_of()
    for number in range(MAX_KEPT + 10):
        floor_at(grid, number / 1e5, 2.0, 0.1)
    assert 0 < len(grid.floors) <= MAX_KEPT


def zone(**more: Any) -> Zone:
    table = {
        "id": "z",
        "label": "Z",
        "kind": "keep_out",
        "points": [[0, 0], [4, 0], [4, 2], [2, 1], [0, 2]],
    }
    return Zone.model_validate({**table, **more})


@pytest.mark.parametrize(
    ("x", "y", "is_in"),
    [
        (1.0, 0.5, True),
        (2.0, 0.5, True),
        (2.0, 1.9, False),  # in the notch, and far enough from its edges
        (2.0, 1.2, True),  # in the notch, too near
        (4.2, 1.0, True),
        (4.4, 1.0, False),
        (-0.2, -0.2, True),  # near a corner
        (-0.3, -0.3, False),
    ],
)
def test_a_circle_that_touches_a_keep_out_zone_is_in_it(x: float, y: float, is_in: bool) -> None:
    assert (KeepOut([zone()]).at("a" * 16, "", x, y, 0.3) is not None) == is_in


@pytest.mark.parametrize(
    ("x", "y", "is_in"),
    [
        (0.4, 0.4, True),
        (1.5, 1.0, False),  # in the hole
        (1.1, 1.0, True),  # in the hole, too near to the zone
        (0.9, 1.0, True),
    ],
)
def test_a_hole_is_not_of_the_zone(x: float, y: float, is_in: bool) -> None:
    square = [[0, 0], [3, 0], [3, 3], [0, 3]]
    with_hole = zone(points=square, holes=[[[1, 0.5], [2, 0.5], [2, 2], [1, 2]]])
    assert (KeepOut([with_hole]).at("a" * 16, "", x, y, 0.3) is not None) == is_in


def test_the_bytes_of_a_grid_are_found_once() -> None:
    grid = grid_of()
    assert values_of(grid) == {0, 40, 100, 255}
    assert values_of(grid) is values_of(grid)


def test_other_zones_and_those_of_other_maps_are_only_shown() -> None:
    others = [zone(kind="speed"), zone(kind="label"), zone(map_version="b" * 16)]
    assert KeepOut(others).at("a" * 16, "", 1.0, 0.5, 0.3) is None
    assert KeepOut(others).at("b" * 16, "", 1.0, 0.5, 0.3) is others[-1]


@pytest.mark.parametrize(
    ("level", "on", "is_in"),
    [(None, "", True), (None, "upper", True), ("upper", "upper", True), ("upper", "ground", False)],
)
def test_a_zone_counts_on_its_level_or_on_each(level: str | None, on: str, is_in: bool) -> None:
    hit = KeepOut([zone(level=level)]).at("a" * 16, on, 1.0, 0.5, 0.3)
    assert (hit is not None) == is_in


def test_corners_are_looked_at_once_for_a_circle_and_only_of_zones_near_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looked: list[Any] = []
    contains = places._contains

    def counted(points: Any, x: float, y: float) -> bool:
        looked.append(points)
        return contains(points, x, y)

    monkeypatch.setattr(places, "_contains", counted)
    far = [[100, 0], [104, 0], [104, 2]]
    keep_out = KeepOut([zone(id="far", points=far), zone()])
    for _ in range(3):
        hit = keep_out.at("a" * 16, "", 1.0, 0.5, 0.3)
        assert hit is not None
        assert hit.id == "z"
    assert len(looked) == 1

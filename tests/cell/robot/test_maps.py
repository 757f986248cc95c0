"""Maps of messages, and their pictures."""

import io
import math
from typing import Any, Final

import pytest
from PIL import Image

from app.cell.robot.maps import (
    GRID_TYPE,
    MAX_CELLS,
    TILE,
    Grid,
    NoMap,
    is_repeated,
    overview,
    read_grid,
    reduced,
    tile,
    updated,
)
from app.cell.robot.transforms import Pose
from app.ros.messages import load_interfaces
from app.system.texts import Text

INTERFACES: Final = load_interfaces("jazzy", ())
FREE, DOUBT, WALL = (247, 249, 250), (176, 184, 192), (18, 23, 27)  # of the light theme
UPRIGHT: Final = {"orientation": {"w": 1.0}}


def payload(
    cells: list[int], width: int, height: int, resolution: float = 0.05, **origin: Any
) -> bytes:
    info = {"width": width, "height": height, "resolution": resolution, "origin": UPRIGHT | origin}
    message = {"header": {"frame_id": "map"}, "info": info, "data": cells}
    return INTERFACES.encode(GRID_TYPE, message)


def grid_of(cells: list[int], width: int, height: int, **more: Any) -> Grid:
    return read_grid(INTERFACES, payload(cells, width, height, **more))


def pixels(png: bytes) -> Image.Image:
    return Image.open(io.BytesIO(png)).convert("RGBA")


def colour(image: Image.Image, x: int, y: int) -> tuple[int, ...] | None:
    """None where it is transparent."""
    pixel = image.getpixel((x, y))
    assert isinstance(pixel, tuple)
    return pixel[:3] if pixel[3] else None


def test_the_first_row_of_a_map_is_its_lowest() -> None:
    grid = grid_of([0, 100, -1, 50], 2, 2)
    shown = pixels(tile(grid, 0, 0, "light"))
    assert [colour(shown, x, y) for y in (0, 1) for x in (0, 1)] == [None, DOUBT, FREE, WALL]
    assert (grid.geometry.frame, grid.geometry.width, grid.geometry.height) == ("map", 2, 2)


def test_tiles_cover_a_map_from_its_upper_left() -> None:
    width, height = TILE + 2, TILE + 1
    cells = [0] * (width * height)
    cells[0] = 100  # lower left
    cells[-1] = 100  # upper right
    grid = grid_of(cells, width, height)
    assert (grid.columns, grid.rows) == (2, 2)
    sizes = {(c, r): pixels(tile(grid, c, r, "light")).size for c in (0, 1) for r in (0, 1)}
    assert sizes == {(0, 0): (TILE, TILE), (1, 0): (2, TILE), (0, 1): (TILE, 1), (1, 1): (2, 1)}
    assert colour(pixels(tile(grid, 1, 0, "light")), 1, 0) == WALL
    assert colour(pixels(tile(grid, 0, 1, "light")), 0, 0) == WALL


def test_themes_have_colours_of_their_own_and_unknown_is_transparent_in_each() -> None:
    grid = grid_of([-1, 0, 100], 3, 1)
    shown = [pixels(tile(grid, 0, 0, theme)) for theme in ("light", "dark", "contrast")]
    assert [colour(image, 0, 0) for image in shown] == [None] * 3
    assert len({(colour(image, 1, 0), colour(image, 2, 0)) for image in shown}) == 3


def test_the_picture_of_a_large_map_loses_no_wall_and_has_the_robot() -> None:
    side = 3000
    cells = [0] * (side * side)
    cells[1500 * side : 1501 * side] = [100] * side  # one cell thick
    grid = grid_of(cells, side, side, position={"x": -75.0, "y": -75.0})
    image = pixels(overview(reduced(grid), grid, "light", None, 0.0))
    assert image.size == (1000, 1000)
    assert {colour(image, x, 499) for x in range(0, 1000, 50)} == {WALL}
    assert colour(image, 500, 250) == FREE
    with_robot = pixels(overview(reduced(grid), grid, "light", Pose(0.0, 37.5, 0.0), 2.0))
    assert colour(with_robot, 500, 250) == WALL


def test_the_robot_stands_where_a_turned_map_has_it() -> None:
    grid = grid_of([0] * 2500, 50, 50, resolution=0.1, position={"x": 5.0, "y": 0.0},
                   orientation={"z": math.sin(math.pi / 4), "w": math.cos(math.pi / 4)})  # fmt: skip
    assert grid.geometry.origin.yaw == pytest.approx(math.pi / 2)
    image = pixels(overview(reduced(grid), grid, "light", Pose(4.0, 3.0, 0.0), 0.1))
    assert colour(image, 30, 39) == WALL  # 3 m along the map's first row, 1 m above it


def test_the_same_map_has_the_same_version_and_another_place_another() -> None:
    first = grid_of([0, 100], 2, 1)
    assert first.version == grid_of([0, 100], 2, 1).version
    assert first.version != grid_of([100, 0], 2, 1).version
    assert first.version != grid_of([0, 100], 2, 1, position={"x": 1.0}).version


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"\0\1\0\0", "map_incomplete"),
        (payload([0, 0], 2, 1)[:-1], "map_incomplete"),
        (payload([], 0, 0), "map_empty"),
        (payload([0], 2, 1), "map_cells"),
        (payload([0, 0, 0], 2, 1), "map_cells"),
        (payload([], 2**31, 1), "map_large"),
        (payload([], 2**32 - 1, 2**32 - 1), "map_large"),
        (payload([0], 1, 1, resolution=0.0), "map_resolution"),
        (payload([0], 1, 1, resolution=math.nan), "map_resolution"),
        (payload([0], 1, 1, position={"x": math.inf}), "map_origin"),
        (payload([0], 1, 1, orientation={"w": 0.0}), "map_origin"),
    ],
)
def test_a_message_without_a_map_says_why(data: bytes, code: str) -> None:
    with pytest.raises(NoMap) as raised:
        read_grid(INTERFACES, data)
    assert isinstance(raised.value.reason, Text)
    assert raised.value.reason.code == code
    assert MAX_CELLS < 2**31


UPDATE: Final = "map_msgs/msg/OccupancyGridUpdate"


def update_of(cells: list[int], frame: str = "map", **keys: int) -> bytes:
    return INTERFACES.encode(UPDATE, {"header": {"frame_id": frame}, "data": cells, **keys})


def test_an_update_changes_its_part_of_the_map() -> None:
    grid = grid_of([0] * 12, 4, 3)
    changed, problem = updated(
        INTERFACES, grid, [update_of([1, 2, 3, -1], x=1, y=1, width=2, height=2)]
    )
    assert problem == ""
    assert [*changed.cells] == [0, 0, 0, 0, 0, 1, 2, 0, 0, 3, 255, 0]
    assert changed.version != grid.version
    assert [*grid.cells] == [0] * 12
    same, _ = updated(INTERFACES, changed, [update_of([])])
    assert same.version == changed.version


@pytest.mark.parametrize(
    ("payload", "code"),
    [
        (update_of([1], x=4, y=0, width=1, height=1), "map_update_outside"),
        (update_of([1], x=-1, y=0, width=1, height=1), "map_update_outside"),
        (update_of([1], x=2**31 - 1, y=2**31 - 1, width=1, height=1), "map_update_outside"),
        (update_of([1] * 5, x=0, y=0, width=5, height=1), "map_update_outside"),
        (update_of([1], x=0, y=0, width=2, height=2), "map_update_cells"),
        (update_of([], x=0, y=0, width=2**32 - 1, height=2**32 - 1), "map_update_cells"),
        (update_of([1], frame="odom", x=0, y=0, width=1, height=1), "map_update_frame"),
        (b"\0\1\0\0", "map_update_incomplete"),
    ],
)
def test_an_update_that_does_not_fit_changes_nothing_and_is_named(payload: bytes, code: str) -> None:
    grid = grid_of([0] * 12, 4, 3)
    good = update_of([7], x=0, y=0, width=1, height=1)
    changed, problem = updated(INTERFACES, grid, [payload, good])
    assert isinstance(problem, Text)
    assert problem.code == code
    assert [*changed.cells] == [7] + [0] * 11


def test_a_costmap_is_transparent_where_nothing_costs() -> None:
    grid = grid_of([0, -1, 20, 70, 99, 100], 6, 1)
    opacity = [*pixels(tile(grid, 0, 0, "light", costs=True)).getchannel("A").tobytes()]
    assert opacity[:2] == [0, 0]
    assert 0 < opacity[2] < opacity[3] < opacity[4] == opacity[5] < 255


def dated(frame: str, sec: int = 1, **more: Any) -> bytes:
    info = {
        "width": 2,
        "height": 2,
        "resolution": 0.5,
        "origin": UPRIGHT,
        "map_load_time": {"sec": sec},
    }
    header = {"frame_id": frame, "stamp": {"sec": sec}}
    message = {"header": header, "info": info | more, "data": [0, 1, 2, 3]}
    return INTERFACES.encode(GRID_TYPE, message)


@pytest.mark.parametrize("frame", ["m", "ma", "map", "another_map"])
def test_a_map_that_is_published_again_is_recognised_by_its_bytes(frame: str) -> None:
    grid = read_grid(INTERFACES, dated(frame))
    assert is_repeated(grid, dated(frame, sec=77))
    for other in (
        dated(frame + "x"),
        dated(frame, resolution=0.6),
        dated(frame, width=4, height=1),
        dated(frame)[:-1] + b"\x04",
        dated(frame)[:-1],
        dated(frame)[:14],
        b"\0\1\0\0" + b"\xff" * 40,
        b"",
    ):
        assert not is_repeated(grid, other)
    changed = updated(INTERFACES, grid, [])[0]
    assert not is_repeated(changed, dated(frame))

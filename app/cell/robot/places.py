"""The floor around a place, and the zones that it is in: pure, from a map's cells and polygons.

Metres and radians in the map's frame.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, Literal

from app.cell.robot.maps import COLOURS, FREE_COLOUR, OCCUPIED_COLOUR, Grid
from app.panel.places import Zone
from app.system.limits import BoundedDict

Floor = Literal["outside", "occupied", "unknown", "free"]
MAX_ROWS: Final = 400  # of cells that are looked at: a millisecond, however small the cells
VALUES: Final = "values"  # a key of what is kept with a grid
MAX_KEPT: Final = 2_000  # floors of one map, and circles with the zones that they touch


def floor_at(grid: Grid, x: float, y: float, radius: float) -> Floor:
    """The floor within `radius` of a point: "outside" if the point is not on the map, else the worst of
    its cells. What is beyond the map's edge is unknown. Kept with the map."""
    asked = (x, y, radius)
    known = grid.floors.get(asked)
    if known is None:
        if len(grid.floors) >= MAX_KEPT:
            grid.floors.clear()
        known = grid.floors[asked] = _floor(grid, x, y, radius)
    return known


def is_marked_near(grid: Grid, x: float, y: float, radius: float, marked: bytes) -> bool:
    """Whether a cell within `radius` of a point has a byte that `marked` has as 1. What is beyond the
    grid's edge is not marked; a circle that is too large to be looked at is. Kept with the grid."""
    asked = (x, y, radius, marked)
    known = grid.floors.get(asked)
    if known is None:
        if len(grid.floors) >= MAX_KEPT:
            grid.floors.clear()
        lines = _circle(grid, x, y, radius)
        known = radius / grid.geometry.resolution * 2 > MAX_ROWS or any(
            1 in line.translate(marked) for line in lines
        )
        grid.floors[asked] = known
    return bool(known)


def values_of(grid: Grid) -> frozenset[int]:
    """The bytes that its cells have. Kept with the grid: each view asks for them."""
    known = grid.floors.get(VALUES)
    if known is None:
        values, rest = set(), bytes(grid.cells)
        while rest:
            values.add(rest[0])
            rest = rest.translate(None, rest[:1])
        known = grid.floors[VALUES] = frozenset(values)
    return frozenset(known)


def _floor(grid: Grid, x: float, y: float, radius: float) -> Floor:
    width, height = grid.geometry.width, grid.geometry.height
    column, row = _cell(grid, x, y)
    reach = radius / grid.geometry.resolution
    if not (0 <= column < width and 0 <= row < height):
        return "outside"
    if reach * 2 > MAX_ROWS:
        return "unknown"
    is_known = reach <= min(column, width - column, row, height - row)
    for line in _circle(grid, x, y, radius):
        colours = line.translate(COLOURS)
        if OCCUPIED_COLOUR in colours:
            return "occupied"
        is_known = is_known and not colours.strip(bytes((FREE_COLOUR,)))
    return "free" if is_known else "unknown"


def _circle(grid: Grid, x: float, y: float, radius: float) -> Iterator[bytes]:
    """The cells that a circle touches, line by line."""
    width, height = grid.geometry.width, grid.geometry.height
    column, row = _cell(grid, x, y)
    reach = radius / grid.geometry.resolution
    for line in range(max(math.floor(row - reach), 0), min(math.floor(row + reach) + 1, height)):
        # The nearest edge of this line of cells decides how wide the circle is there.
        away = max(line - row, row - line - 1, 0.0)
        half = math.sqrt(max(reach * reach - away * away, 0.0))
        left, right = max(math.floor(column - half), 0), min(math.floor(column + half) + 1, width)
        if left < right:
            yield bytes(grid.cells[line * width + left : line * width + right])


def _cell(grid: Grid, x: float, y: float) -> tuple[float, float]:
    """(column, row) of a point, with parts of cells; the origin may be turned."""
    origin, size = grid.geometry.origin, grid.geometry.resolution
    dx, dy = x - origin.x, y - origin.y
    cos, sin = math.cos(origin.yaw), math.sin(origin.yaw)
    return (cos * dx + sin * dy) / size, (cos * dy - sin * dx) / size


class KeepOut:
    """The keep-out zones of one robot. Which of them a circle touches is kept: each view asks it of
    each place, and 50 places with 20 zones took 60 ms."""

    def __init__(self, zones: Iterable[Zone]) -> None:
        self._zones = [(_box(zone.rings), zone) for zone in zones if zone.kind == "keep_out"]
        self._touched = BoundedDict[tuple[float, float, float], tuple[Zone, ...]](MAX_KEPT)

    def at(self, version: str, level: str, x: float, y: float, radius: float) -> Zone | None:
        """The first zone of the map with this version, of this level, that a circle touches."""
        circle = x, y, radius
        touched = self._touched.get(circle)
        if touched is None:
            touched = self._touched[circle] = tuple(self._touching(x, y, radius))
        return next((zone for zone in touched if zone.counts_on(version, level)), None)

    def _touching(self, x: float, y: float, radius: float) -> Iterator[Zone]:
        for (left, bottom, right, top), zone in self._zones:
            if not (left - radius <= x <= right + radius and bottom - radius <= y <= top + radius):
                continue
            if _is_in(zone, x, y) or any(_distance(ring, x, y) < radius for ring in zone.rings):
                yield zone


def _box(rings: Iterable[Sequence[tuple[float, float]]]) -> tuple[float, float, float, float]:
    """(left, bottom, right, top) around polygons."""
    corners = [corner for ring in rings for corner in ring]
    xs, ys = [x for x, _ in corners], [y for _, y in corners]
    return min(xs), min(ys), max(xs), max(ys)


def _is_in(zone: Zone, x: float, y: float) -> bool:
    return _contains(zone.points, x, y) and not any(_contains(hole, x, y) for hole in zone.holes)


def _contains(points: Sequence[tuple[float, float]], x: float, y: float) -> bool:
    """Whether a polygon has the point in it, by the number of edges to its right."""
    inside = False
    for (ax, ay), (bx, by) in zip(points, (*points[1:], points[0]), strict=True):
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            inside = not inside
    return inside


def _distance(points: Sequence[tuple[float, float]], x: float, y: float) -> float:
    """The distance to the nearest edge of a polygon."""
    return min(
        _to_edge(first, second, x, y)
        for first, second in zip(points, (*points[1:], points[0]), strict=True)
    )


def _to_edge(first: tuple[float, float], second: tuple[float, float], x: float, y: float) -> float:
    (ax, ay), (bx, by) = first, second
    dx, dy = bx - ax, by - ay
    length = dx * dx + dy * dy
    part = 0.0 if not length else min(max(((x - ax) * dx + (y - ay) * dy) / length, 0.0), 1.0)
    return math.hypot(ax + part * dx - x, ay + part * dy - y)

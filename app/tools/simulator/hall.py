"""The hall that the simulated mobile robot drives in: its map, how far each place is from what stands
there, ways through it, and the beams of a lidar. Pure."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from heapq import heappop, heappush
from itertools import pairwise
from typing import Final

Point = tuple[float, float]  # metres in the frame of the map
Cell = tuple[int, int]  # column, row of the coarse grid

RESOLUTION: Final = 0.1  # metres a cell of the map
COARSE: Final = 0.2  # metres a cell of the grid for ways and beams
COARSER: Final = 2  # cells of the map in one of these, along each side
ORIGIN: Final = (-13.4, -11.0)  # the lower left corner of the map
COLUMNS, ROWS = 486, 344
UNKNOWN, FREE, OCCUPIED = 255, 0, 100  # -1 of nav_msgs/msg/OccupancyGrid as a byte is 255

# Left, bottom, right, top in metres.
Box = tuple[float, float, float, float]
FLOOR: Final[Box] = (-12.5, -9.1, 34.1, 21.5)
NOTCH: Final[Box] = (12.1, -9.1, 17.0, -5.5)  # a room that does not belong to the hall
WALL: Final = 0.3
SHELVES_X: Final = ((-11.0, -7.1), (-6.6, -2.7), (-2.2, 1.7), (20.7, 24.7), (25.2, 29.1), (29.6, 33.5))
SHELVES_Y: Final = ((18.3, 19.8), (14.6, 16.1), (-2.2, -0.7), (-5.9, -4.4))
# Machines, and the cabinet of the charger.
MACHINES: Final[Sequence[Box]] = (
    (-4.4, 8.2, -2.4, 9.8),
    (-4.4, 3.1, -2.4, 4.7),
    (8.3, 18.9, 10.3, 20.3),
)
CHARGER: Final[Box] = (4.9, -9.1, 5.7, -8.9)
# Gates are shut: a curtain of which a lidar and the map see every other strip.
GATES: Final[Sequence[Box]] = (
    (14.5, 21.5, 19.4, 21.8),
    (-12.8, 7.4, -12.5, 11.1),
    (34.1, 7.4, 34.4, 11.1),
)
STRIP: Final = 3  # cells


def cell_at(x: float, y: float) -> Cell:
    """The cell of the map at a place; it may be outside."""
    return math.floor((x - ORIGIN[0]) / RESOLUTION), math.floor((y - ORIGIN[1]) / RESOLUTION)


@dataclass(frozen=True, slots=True)
class Hall:
    """`cells` are those of the map, row by row from its origin. `near` has for each coarse cell how far
    it is to what is not free, in metres, to about half a coarse cell."""

    cells: bytes
    near: Sequence[float]
    columns: int  # of the coarse grid
    rows: int

    def contains(self, x: float, y: float) -> bool:
        column, row = cell_at(x, y)
        return 0 <= column < COLUMNS and 0 <= row < ROWS

    def clearance(self, x: float, y: float) -> float:
        """Metres to what is not free, to about half a coarse cell; 0 there, and outside."""
        column, row = self._coarse(x, y)
        inside = 0 <= column < self.columns and 0 <= row < self.rows
        return self.near[row * self.columns + column] if inside else 0.0

    def beam(self, x: float, y: float, angle: float, most: float) -> float:
        """How far a beam of light goes from a place, `most` metres at most."""
        dx, dy = math.cos(angle), math.sin(angle)
        gone = 0.0
        while gone < most:
            free = self.clearance(x + gone * dx, y + gone * dy)
            if free <= 0:
                return gone
            gone += max(free, COARSE / 2)
        return most

    def way(self, start: Point, end: Point, radius: float) -> list[Point]:
        """A way that keeps a distance from what stands there; empty if there is none. It has a point at
        least each `STRIDE` metres."""
        cells = self._search(self._coarse(*start), self._coarse(*end), radius)
        if not cells:
            return []
        points = [start, *(self._middle(cell) for cell in cells[1:-1]), end]
        return resampled(rounded(self._pulled(points, radius)))

    def _coarse(self, x: float, y: float) -> Cell:
        return math.floor((x - ORIGIN[0]) / COARSE), math.floor((y - ORIGIN[1]) / COARSE)

    def _middle(self, cell: Cell) -> Point:
        return ORIGIN[0] + (cell[0] + 0.5) * COARSE, ORIGIN[1] + (cell[1] + 0.5) * COARSE

    def _search(self, start: Cell, end: Cell, radius: float) -> list[Cell]:
        """The cells of a shortest way (A*), from start to end. The start may be nearer to a wall."""
        waiting: list[tuple[float, float, Cell]] = [(0.0, 0.0, start)]
        came: dict[Cell, Cell] = {}
        known = {start: 0.0}
        while waiting:
            _, cost, cell = heappop(waiting)
            if cell == end:
                return [*_back(came, end)][::-1]
            if cost > known[cell]:
                continue
            for step, length in STEPS:
                to = cell[0] + step[0], cell[1] + step[1]
                if not (0 <= to[0] < self.columns and 0 <= to[1] < self.rows):
                    continue
                free = self.near[to[1] * self.columns + to[0]]
                if free < radius and to != end and free <= self.near[cell[1] * self.columns + cell[0]]:
                    continue
                total = cost + length * (1 + CLOSE_COSTS * max(0.0, 2 * radius - free))
                if total < known.get(to, math.inf):
                    known[to], came[to] = total, cell
                    rest = math.hypot(end[0] - to[0], end[1] - to[1])
                    heappush(waiting, (total + rest, total, to))
        return []

    def _pulled(self, points: Sequence[Point], radius: float) -> list[Point]:
        """The same way with straight lines where nothing is near."""
        kept, at = [points[0]], 0
        while at < len(points) - 1:
            reach = next(
                (
                    n
                    for n in range(min(len(points) - 1, at + LONGEST_PULL), at + 1, -1)
                    if self._is_clear(points[at], points[n], radius)
                ),
                at + 1,
            )
            kept.append(points[reach])
            at = reach
        return kept

    def _is_clear(self, start: Point, end: Point, radius: float) -> bool:
        return all(
            self.clearance(*between(start, end, gone)) >= 1.4 * radius
            for gone in _marks(math.dist(start, end), COARSE)
        )


STEPS: Final = tuple(
    ((dx, dy), math.hypot(dx, dy)) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy
)
CLOSE_COSTS: Final = 3.0  # of a metre nearer to a wall than twice the radius
LONGEST_PULL: Final = 60  # points
STRIDE: Final = 0.25  # metres
ROUNDINGS: Final = 3


def _back(came: dict[Cell, Cell], cell: Cell) -> Iterator[Cell]:
    yield cell
    while cell in came:
        cell = came[cell]
        yield cell


def between(start: Point, end: Point, part: float) -> Point:
    """The point at a part (0 to 1) of a line."""
    return start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1])


def _marks(length: float, stride: float) -> list[float]:
    """Parts of a line, evenly, at most `stride` apart, without its start."""
    count = max(1, math.ceil(length / stride))
    return [(n + 1) / count for n in range(count)]


def rounded(points: Sequence[Point]) -> list[Point]:
    """Corners cut, again and again (Chaikin); the ends stay."""
    points = list(points)
    for _ in range(ROUNDINGS):
        cut = [points[0]]
        for start, end in pairwise(points):
            near = min(0.25, 0.8 / max(math.dist(start, end), 1e-6))  # long lines stay straight
            cut += [between(start, end, near), between(start, end, 1 - near)]
        points = [*cut, points[-1]]
    return points


def resampled(points: Sequence[Point]) -> list[Point]:
    """The same line with points at most `STRIDE` apart."""
    made = [points[0]]
    for start, end in pairwise(points):
        if (length := math.dist(start, end)) > 1e-6:
            made += [between(start, end, part) for part in _marks(length, STRIDE)]
    return made


@cache
def hall() -> Hall:
    """The hall; it takes some hundredths of a second to build."""
    cells = bytearray([UNKNOWN]) * (COLUMNS * ROWS)
    left, bottom, right, top = FLOOR
    _fill(cells, (left - WALL, bottom - WALL, right + WALL, top + WALL), OCCUPIED)
    _fill(cells, FLOOR, FREE)
    _fill(cells, NOTCH, OCCUPIED)
    x0, y0, x1, y1 = NOTCH
    _fill(cells, (x0 + WALL, y0 - WALL, x1 - WALL, y1 - WALL), UNKNOWN)
    shelves: Iterable[Box] = (
        (left, bottom, right, top) for left, right in SHELVES_X for bottom, top in SHELVES_Y
    )
    for box in (*shelves, *MACHINES, CHARGER):
        _fill(cells, box, OCCUPIED)
    for gate in GATES:
        _hang(cells, gate)
    columns, rows = COLUMNS // COARSER, ROWS // COARSER
    return Hall(bytes(cells), _distances(cells, columns, rows), columns, rows)


def _fill(cells: bytearray, box: Box, value: int) -> None:
    left, bottom = (round((box[n] - ORIGIN[n]) / RESOLUTION) for n in (0, 1))
    right, top = (round((box[n + 2] - ORIGIN[n]) / RESOLUTION) for n in (0, 1))
    for row in range(bottom, top):
        cells[row * COLUMNS + left : row * COLUMNS + right] = bytes([value]) * (right - left)


def _hang(cells: bytearray, gate: Box) -> None:
    """Strips across a gate."""
    left, bottom, right, top = gate
    lies = right - left > top - bottom
    for number in range(round(max(right - left, top - bottom) / RESOLUTION / STRIP)):
        at = number * STRIP * RESOLUTION
        strip = (left + at, bottom, left + at + STRIP * RESOLUTION, top)
        if not lies:
            strip = (left, bottom + at, right, bottom + at + STRIP * RESOLUTION)
        _fill(cells, strip, UNKNOWN if number % 2 else OCCUPIED)


def _distances(cells: bytearray, columns: int, rows: int) -> list[float]:
    """Metres from each coarse cell to the nearest that is not free: two passes over the grid (a chamfer
    transform)."""
    near = [distance for row in range(rows) for distance in _taken(cells, row)]
    straight, oblique = COARSE, COARSE * math.sqrt(2)
    for backwards in (False, True):
        sign = 1 if backwards else -1
        for row in range(rows)[::-sign]:
            for column in range(columns)[::-sign]:
                at = row * columns + column
                if near[at] == 0:
                    continue
                if row in (0, rows - 1) or column in (0, columns - 1):
                    near[at] = 0.0  # the map ends here
                    continue
                up = at + sign * columns
                near[at] = min(
                    near[at],
                    near[at + sign] + straight,
                    near[up] + straight,
                    near[up - 1] + oblique,
                    near[up + 1] + oblique,
                )
    shorter = 0.92  # a chamfer's way is up to 8 % longer than the straight one
    return [max(0.0, shorter * distance - COARSE / 2) if distance else 0.0 for distance in near]


def _taken(cells: bytearray, row: int) -> Iterator[float]:
    """0 for each coarse cell of a row that has a cell of the map which is not free, else infinite."""
    first = row * COARSER * COLUMNS
    low, high = cells[first : first + COLUMNS], cells[first + COLUMNS : first + 2 * COLUMNS]
    for corners in zip(low[::2], low[1::2], high[::2], high[1::2], strict=True):
        yield 0.0 if any(corners) else math.inf

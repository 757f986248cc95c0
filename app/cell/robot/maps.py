"""Maps of `nav_msgs/msg/OccupancyGrid`, and their pictures: pure.

A map's cells stay the bytes of its message: they are never a list. Its picture is cut into tiles, and a
tile is made when a browser asks for it. The tiles of 4000 x 4000 cells have 0.2 MB.
"""

import hashlib
import io
import math
from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from app.cell.robot.transforms import Pose, yaw_of
from app.panel.widgets.map_layers import GRID_TYPE as GRID_TYPE
from app.panel.widgets.map_layers import UPDATE_TYPE
from app.ros.messages import Interfaces
from app.system.errors import DecodeError
from app.system.texts import TextLike, number, say

if TYPE_CHECKING:
    from PIL.Image import Image  # takes 60 ms to load, and few panels show maps

TILE: Final = 512  # cells a side
MAX_CELLS: Final = 64_000_000  # 8000 x 8000
COMPARED: Final = 2_000_000  # bytes of a message that are compared on the event loop: a millisecond
FRAME_AT: Final = 12  # in a message: after the encapsulation and the stamp
TIME_BYTES: Final = 8
OCCUPIED: Final = 65  # percent and more, as Nav2's map server has it
FREE: Final = 25  # percent and less
TOO_FAST: Final = 5  # maps that were replaced before they were read
MAX_OVERVIEW: Final = 1_000  # pixels a side of the picture of the whole map

# The picture's colours are numbers of a palette. Unknown cells are transparent: the page draws dots
# there, so they differ from free ones without colour.
UNKNOWN_COLOUR, FREE_COLOUR, DOUBT_COLOUR, OCCUPIED_COLOUR = range(4)
COLOURS: Final = bytes(
    FREE_COLOUR if cell <= FREE
    else DOUBT_COLOUR if cell < OCCUPIED
    else OCCUPIED_COLOUR if cell <= 100
    else UNKNOWN_COLOUR  # -1, and what has no meaning
    for cell in range(256)
)  # fmt: skip
# A costmap is drawn over the map: what costs nothing, or is unknown, is transparent. Nav2 publishes 99
# where the robot's middle may not be, and 100 for an obstacle.
NO_COST, LOW_COST, HIGH_COST, LETHAL = range(4)
COSTS: Final = bytes(
    NO_COST if cell == 0 or cell > 100
    else LOW_COST if cell < 50
    else HIGH_COST if cell < 99
    else LETHAL
    for cell in range(256)
)  # fmt: skip
COST_ALPHA: Final = bytes((0, 50, 90, 150))
COST_PALETTES: Final = {
    "light": (0, 0, 0, *3 * (130, 80, 20)),
    "dark": (0, 0, 0, *3 * (240, 190, 110)),
    "contrast": (0, 0, 0, *3 * (130, 60, 0)),
}
# A mask is drawn in the colour of texts, hatched or dotted, so it is seen without colour.
FAINT, LINE, MARKED = 1, 3, 3
HATCH_CELLS: Final = 8
MASK_ALPHA: Final = bytes((0, 40, 0, 200))
MASK_PALETTES: Final = {
    "light": (0, 0, 0, *3 * (18, 23, 27)),
    "dark": (0, 0, 0, *3 * (222, 228, 232)),
    "contrast": (0, 0, 0, *3 * (0, 0, 0)),
}
PALETTES: Final = {
    "light": (0, 0, 0, 247, 249, 250, 176, 184, 192, 18, 23, 27),
    "dark": (0, 0, 0, 56, 64, 72, 112, 122, 132, 222, 228, 232),
    "contrast": (0, 0, 0, 255, 255, 255, 150, 150, 150, 0, 0, 0),
}


@dataclass(frozen=True, slots=True)
class NoMap(Exception):
    """Why a message has no map that can be shown."""

    reason: TextLike


class Geometry(NamedTuple):
    """Where a map's cells are. `width` and `height` are in cells, `resolution` in metres, `origin` is
    the lower left corner of its first cell in the frame `frame`."""

    frame: str
    width: int
    height: int
    resolution: float
    origin: Pose


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """A map: `cells` row by row from its origin, a byte each, with -1 as 255. Maps with the same
    `digest` are the same. `head` is what its message has before the cells, without times; b"" after
    updates."""

    geometry: Geometry
    cells: memoryview
    digest: str
    head: bytes = b""
    floors: dict[Hashable, Any] = field(default_factory=dict)  # by circle, see `places.py`

    @property
    def version(self) -> str:
        """A short name of this map."""
        return self.digest[:16]

    @property
    def columns(self) -> int:
        """The number of tiles in a row."""
        return math.ceil(self.geometry.width / TILE)

    @property
    def rows(self) -> int:
        return math.ceil(self.geometry.height / TILE)


@dataclass(slots=True)
class Arrival:
    """When the newest message of a topic came, and what is wrong with it.

    `wall` (seconds since the epoch) is when it arrived; `problem` is why it can't be shown, "" if it
    can. `source` is the zid of the peer that sent it, None if unknown. `at` is when it arrived,
    `cut_at` when the link was lost last (monotonic seconds).
    """

    wall: float = 0.0
    problem: TextLike = ""
    source: str | None = None
    at: float = -math.inf
    cut_at: float = -math.inf

    @property
    def is_cut(self) -> bool:
        """Whether it is from before the link was lost."""
        return self.at < self.cut_at


@dataclass(slots=True)
class MapState(Arrival):
    """The newest map of a topic. `updated_at` (monotonic seconds) is when its newest update arrived,
    `doubt` why cells may not be the robot's of now although the map is: updates were lost. `is_behind`:
    a newer map has arrived that is not read yet, and is not known to be the same; `overtaken` is how
    many such were replaced by a newer one, since all were read last."""

    grid: Grid | None = None
    is_behind: bool = False
    overtaken: int = 0
    updated_at: float = -math.inf
    doubt: TextLike = ""

    @property
    def is_too_fast(self) -> bool:
        """Whether the map changes faster than it can be read."""
        return self.overtaken >= TOO_FAST


def read_grid(interfaces: Interfaces, payload: bytes) -> Grid:
    """The map of a message; NoMap says what is wrong with it."""
    try:
        message = interfaces.decode(GRID_TYPE, payload)
    except DecodeError:
        raise NoMap(say("map_incomplete")) from None
    info = message.info
    width, height, resolution = info.width, info.height, info.resolution
    if not width or not height:
        raise NoMap(say("map_empty"))
    if width * height > MAX_CELLS:
        raise NoMap(say("map_large", width=width, height=height, most=MAX_CELLS))
    if len(message.data) != width * height:
        raise NoMap(say("map_cells", cells=len(message.data), width=width, height=height))
    if not (math.isfinite(resolution) and resolution > 0):
        raise NoMap(say("map_resolution", resolution=number(f"{resolution:g}")))
    origin = _origin(info.origin)
    if origin is None:
        raise NoMap(say("map_origin"))
    geometry = Geometry(message.header.frame_id.lstrip("/"), width, height, float(resolution), origin)
    return _grid_of(geometry, memoryview(message.data).cast("B"), _head(payload, width * height))


def _grid_of(geometry: Geometry, cells: memoryview, head: bytes = b"") -> Grid:
    digest = hashlib.sha256(repr(geometry).encode())
    digest.update(cells)
    return Grid(geometry, cells, digest.hexdigest(), head)


def is_repeated(grid: Grid | None, payload: bytes) -> bool:
    """Whether a message is this map again, at any time."""
    if grid is None or not grid.head:
        return False
    cells = len(grid.cells)
    if len(payload) <= cells + FRAME_AT:
        return False
    return _head(payload, cells) == grid.head and payload[-cells:] == bytes(grid.cells)


def _head(payload: bytes, cells: int) -> bytes:
    """What the message of a map has before its cells, without its stamp and the time of its loading."""
    size = int.from_bytes(payload[FRAME_AT : FRAME_AT + 4], "little" if payload[1] & 1 else "big")
    loaded_at = FRAME_AT + 4 + size
    loaded_at += -loaded_at % 4
    return payload[FRAME_AT:loaded_at] + payload[loaded_at + TIME_BYTES : -cells]


def updated(interfaces: Interfaces, grid: Grid, payloads: Iterable[bytes]) -> tuple[Grid, TextLike]:
    """A map after updates (`map_msgs/msg/OccupancyGridUpdate`), in their order; and what was wrong with
    the last that could not be applied, "" if all were. An update is applied whole or not at all."""
    cells = bytearray(grid.cells)
    problem: TextLike = ""
    for payload in payloads:
        try:
            _apply(interfaces, grid.geometry, cells, payload)
        except NoMap as error:
            problem = error.reason
    return _grid_of(grid.geometry, memoryview(bytes(cells))), problem


def _apply(interfaces: Interfaces, geometry: Geometry, cells: bytearray, payload: bytes) -> None:
    try:
        update = interfaces.decode(UPDATE_TYPE, payload)
    except DecodeError:
        raise NoMap(say("map_update_incomplete")) from None
    frame = update.header.frame_id.lstrip("/")
    if frame != geometry.frame:
        raise NoMap(say("map_update_frame", frame=frame, map=geometry.frame))
    left, bottom, width, height = update.x, update.y, update.width, update.height
    if len(update.data) != width * height:
        raise NoMap(say("map_update_cells", cells=len(update.data), width=width, height=height))
    if min(left, bottom) < 0 or left + width > geometry.width or bottom + height > geometry.height:
        raise NoMap(say("map_update_outside"))
    data = memoryview(update.data).cast("B")
    for row in range(height):
        start = (bottom + row) * geometry.width + left
        cells[start : start + width] = data[row * width : (row + 1) * width]


def _origin(pose: Any) -> Pose | None:
    """None for one that is no place."""
    yaw = yaw_of(pose.orientation)
    x, y = pose.position.x, pose.position.y
    return Pose(x, y, yaw) if yaw is not None and math.isfinite(x) and math.isfinite(y) else None


def tile(grid: Grid, column: int, row: int, theme: str, *, costs: bool = False) -> bytes:
    """A tile as a PNG file with the colours of a theme: `TILE` cells a side, fewer at the map's end.
    Column 0 begins at the map's origin, and row 0 at its upper edge. `costs`: as a costmap."""
    lines = _lines(grid, column, row)
    cells, width = b"".join(lines), len(lines[0])
    if costs:
        return _png(cells.translate(COSTS), width, len(lines), COST_PALETTES[theme], COST_ALPHA)
    return _png(cells.translate(COLOURS), width, len(lines), PALETTES[theme])


def _lines(grid: Grid, column: int, row: int) -> list[memoryview]:
    """The cells of a tile, the upper row first."""
    width, height = grid.geometry.width, grid.geometry.height
    left, right = column * TILE, min((column + 1) * TILE, width)
    top, bottom = height - row * TILE, max(height - (row + 1) * TILE, 0)
    return [grid.cells[y * width + left : y * width + right] for y in range(top - 1, bottom - 1, -1)]


def mask_tile(
    grid: Grid, column: int, row: int, theme: str, marked: bytes, *, is_hatched: bool
) -> bytes:
    """A tile of a mask: cells whose byte `marked` has as 1 are hatched or dotted, the others
    transparent."""
    lines = _lines(grid, column, row)
    width, period = len(lines[0]), HATCH_CELLS
    mark = bytes(MARKED * each for each in marked)
    pixels = bytearray()
    for y, line in enumerate(lines):
        pattern = bytes(LINE if _is_line(x, y, is_hatched=is_hatched) else FAINT for x in range(period))
        drawn = int.from_bytes(bytes(line).translate(mark)) & int.from_bytes(
            (pattern * (width // period + 1))[:width]
        )
        pixels += drawn.to_bytes(width)
    return _png(bytes(pixels), width, len(lines), MASK_PALETTES[theme], MASK_ALPHA)


def _is_line(column: int, row: int, *, is_hatched: bool) -> bool:
    """Whether a cell is of the lines of a hatch, or of the dots of another mask."""
    if is_hatched:
        return (column + row) % HATCH_CELLS < HATCH_CELLS // 4
    return column % HATCH_CELLS < 2 and row % HATCH_CELLS < 2


def reduced(grid: Grid) -> bytes:
    """The whole map in at most `MAX_OVERVIEW` pixels a side, a byte each with the number of its colour,
    the upper row first: a pixel is occupied if a cell of its square is."""
    from PIL import Image

    width, height = grid.geometry.width, grid.geometry.height
    image = Image.frombytes("L", (width, height), bytes(grid.cells).translate(COLOURS))
    image = image.transpose(Image.Transpose.FLIP_TOP_BOTTOM)
    factor = _reduction(grid)
    if factor > 1:
        walls = image.point([255 * (colour == OCCUPIED_COLOUR) for colour in range(256)]).reduce(factor)
        image = image.resize(walls.size, Image.Resampling.NEAREST)
        image.paste(OCCUPIED_COLOUR, mask=walls.point([0] + 255 * [255]))  # no wall gets lost
    return image.tobytes()


def _reduction(grid: Grid) -> int:
    """How many cells of the map a pixel of its reduced picture is wide."""
    return math.ceil(max(grid.geometry.width, grid.geometry.height) / MAX_OVERVIEW)


def overview(pixels: bytes, grid: Grid, theme: str, pose: Pose | None, radius: float) -> bytes:
    """A map's reduced picture as a PNG file, with the robot at `pose`, of this radius in metres, if
    that is known."""
    from PIL import Image

    factor = _reduction(grid)
    size = math.ceil(grid.geometry.width / factor), math.ceil(grid.geometry.height / factor)
    image = Image.frombytes("L", size, pixels)
    if pose is not None:
        _draw_robot(image, grid.geometry, pose, radius, factor)
    return _png(image.tobytes(), *size, PALETTES[theme])


def _draw_robot(image: "Image", geometry: Geometry, pose: Pose, radius: float, factor: int) -> None:
    """A triangle that points where the robot looks."""
    from PIL import ImageDraw

    origin, size = geometry.origin, geometry.resolution * factor
    turn = math.cos(-origin.yaw), math.sin(-origin.yaw)
    dx, dy = pose.x - origin.x, pose.y - origin.y
    x, y = (turn[0] * dx - turn[1] * dy) / size, (turn[1] * dx + turn[0] * dy) / size
    length, ahead = max(radius / size, 6.0), pose.yaw - origin.yaw
    corners = [
        (x + length * math.cos(ahead + part), image.height - y - length * math.sin(ahead + part))
        for part in (0.0, 2.5, -2.5)
    ]
    ImageDraw.Draw(image).polygon(corners, fill=OCCUPIED_COLOUR)


def _png(
    pixels: bytes,
    width: int,
    height: int,
    palette: tuple[int, ...],
    transparency: int | bytes = UNKNOWN_COLOUR,
) -> bytes:
    """`pixels` are numbers of colours of the palette. `transparency` is the colour that is transparent,
    or how opaque each is."""
    from PIL import Image

    image = Image.frombytes("P", (width, height), pixels)
    image.putpalette(palette)
    file = io.BytesIO()
    image.save(file, "PNG", bits=2, transparency=transparency, optimize=False, compress_level=6)
    return file.getvalue()

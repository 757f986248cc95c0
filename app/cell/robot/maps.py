"""Maps of `nav_msgs/msg/OccupancyGrid`, and their pictures: pure.

A map's cells stay the bytes of its message: they are never a list. Its picture is cut into tiles, and a
tile is made when a browser asks for it. The tiles of 4000 x 4000 cells have 0.2 MB.
"""

import hashlib
import io
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from app.cell.robot.transforms import Pose, yaw_of
from app.ros.messages import Interfaces
from app.system.errors import DecodeError
from app.system.texts import TextLike, number, say

if TYPE_CHECKING:
    from PIL.Image import Image  # takes 60 ms to load, and few panels show maps

GRID_TYPE: Final = "nav_msgs/msg/OccupancyGrid"
TILE: Final = 512  # cells a side
MAX_CELLS: Final = 64_000_000  # 8000 x 8000
OCCUPIED: Final = 65  # percent and more, as Nav2's map server has it
FREE: Final = 25  # percent and less
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
    `digest` are the same."""

    geometry: Geometry
    cells: memoryview
    digest: str

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
class MapState:
    """The newest map of a topic.

    `wall` (seconds since the epoch) is when the newest message arrived; `problem` is why that has no
    map, "" if it has one. `source` is the zid of the peer that sent it, None if unknown. `at` is when
    it arrived, `cut_at` when the link was lost last (monotonic seconds).
    """

    grid: Grid | None = None
    wall: float = 0.0
    problem: TextLike = ""
    source: str | None = None
    at: float = -math.inf
    cut_at: float = -math.inf

    @property
    def is_cut(self) -> bool:
        """Whether the map is from before the link was lost."""
        return self.at < self.cut_at


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
    cells = memoryview(message.data).cast("B")
    digest = hashlib.sha256(repr(geometry).encode())
    digest.update(cells)
    return Grid(geometry, cells, digest.hexdigest())


def _origin(pose: Any) -> Pose | None:
    """None for one that is no place."""
    yaw = yaw_of(pose.orientation)
    x, y = pose.position.x, pose.position.y
    return Pose(x, y, yaw) if yaw is not None and math.isfinite(x) and math.isfinite(y) else None


def tile(grid: Grid, column: int, row: int, theme: str) -> bytes:
    """A tile as a PNG file with the colours of a theme: `TILE` cells a side, fewer at the map's end.
    Column 0 begins at the map's origin, and row 0 at its upper edge."""
    width, height = grid.geometry.width, grid.geometry.height
    left, right = column * TILE, min((column + 1) * TILE, width)
    top, bottom = height - row * TILE, max(height - (row + 1) * TILE, 0)
    lines = (grid.cells[y * width + left : y * width + right] for y in range(top - 1, bottom - 1, -1))
    return _png(b"".join(lines), right - left, top - bottom, theme)


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
    return _png(image.tobytes(), *size, theme, is_translated=True)


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


def _png(cells: bytes, width: int, height: int, theme: str, is_translated: bool = False) -> bytes:
    from PIL import Image

    pixels = cells if is_translated else cells.translate(COLOURS)
    image = Image.frombytes("P", (width, height), pixels)
    image.putpalette(PALETTES[theme])
    file = io.BytesIO()
    image.save(file, "PNG", bits=2, transparency=UNKNOWN_COLOUR, optimize=False, compress_level=6)
    return file.getvalue()

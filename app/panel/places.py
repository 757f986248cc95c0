"""The tables `[[place]]` and `[[zone]]` of a panel file: named poses and areas on a map.

Metres and radians, as in ROS (REP 103): x to the east and y to the north of the map, yaw from x to y.
"""

from functools import cached_property
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from app.panel.base import File, FiniteNumber, Icon, Id, Label
from app.panel.shared_keys import RobotKey
from app.ros.messages.validation import format_value

FULL_TURN: Final = 6.2832  # radians
MAX_PLACES: Final = 500
MAX_ZONES: Final = 200
MAX_CORNERS: Final = 200
MAX_HOLES: Final = 20
MAX_FILES: Final = 20
LEAST_CORNERS: Final = 3
FAR_M: Final = 1e6
PAIR: Final = 2

FrameName = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^/\s][^\s]*$")]
MapVersion = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
Metres = Annotated[FiniteNumber, Field(ge=-FAR_M, le=FAR_M)]
ZoneKind = Literal["keep_out", "one_way", "speed", "label"]


def _check_yaw(yaw: float) -> float:
    if not -FULL_TURN <= yaw <= FULL_TURN:
        raise ValueError(f"{yaw:g} is not an angle in radians, from -6.2832 to 6.2832: 90° is 1.5708")
    return yaw


def _check_corner(value: Any) -> Any:
    is_point = isinstance(value, list | tuple) and len(value) == PAIR
    if not is_point or not all(_is_length(part) for part in value):
        raise ValueError(f"must be a point like [2.0, 1.5], in metres, not {format_value(value)}")
    return tuple(map(float, value))


def _is_length(part: Any) -> bool:
    is_number = isinstance(part, int | float) and not isinstance(part, bool)
    return is_number and -FAR_M <= part <= FAR_M


def _check_corners(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    if len(points) < LEAST_CORNERS:
        raise ValueError(
            f"has {len(points)} points: an area has three or more, as in [[0, 0], [2, 0], [2, 1]]"
        )
    return points


def _check_holes(value: Any) -> Any:
    first = value[0] if isinstance(value, list) and value else None
    if isinstance(first, list) and first and not isinstance(first[0], list | tuple):
        raise ValueError(
            "must be a list of holes, each a list of points: write [[[0, 0], [2, 0], [2, 1]]]"
        )
    return value


Yaw = Annotated[FiniteNumber, AfterValidator(_check_yaw)]
CORNER: Final = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
Corner = Annotated[tuple[float, float], BeforeValidator(_check_corner), WithJsonSchema(CORNER)]
Corners = Annotated[
    tuple[Corner, ...], Field(strict=False, max_length=MAX_CORNERS), AfterValidator(_check_corners)
]


class OnMapKeys(RobotKey):
    """The map that the table is of: by its version, or by the level whose map it is."""

    level: Id | None = None
    map_version: MapVersion | None = None


class Place(OnMapKeys):
    """A named pose: `x` and `y` in metres, `yaw` in radians, in `frame`, by default the map's. With
    `map_version` it is a place of that map only, with `level` one of that level."""

    id: Id
    label: Label
    x: Metres
    y: Metres
    yaw: Yaw = 0.0
    icon: Icon | None = None
    frame: FrameName | None = None


class Zone(OnMapKeys):
    """An area of the map, by its corners in metres in the map's frame; `holes` are not of it. No goal
    may be in a `keep_out` zone; the others are only shown. `yaw` is where a `one_way` zone leads, in
    radians."""

    id: Id
    label: Label
    kind: ZoneKind
    points: Corners
    holes: Annotated[
        tuple[Corners, ...], Field(strict=False, max_length=MAX_HOLES), BeforeValidator(_check_holes)
    ] = ()
    yaw: Yaw | None = None

    def counts_on(self, version: str, level: str) -> bool:
        """Whether it is a zone of the map with this version, which is that of this level ("" for a map
        without levels)."""
        return self.map_version in (None, version) and self.level in (None, level)

    @cached_property
    def rings(self) -> tuple[Corners, ...]:
        """Its outline, then its holes."""
        return (self.points, *self.holes)

    @property
    def yaw_fault(self) -> str:
        """What is wrong with `yaw`, "" if nothing is."""
        if self.kind == "one_way" and self.yaw is None:
            return "is missing: where the zone leads, in radians"
        if self.kind != "one_way" and self.yaw is not None:
            return f'is of a zone of the kind "one_way"; this is {self.kind}'
        return ""


class ZoneFile(OnMapKeys):
    """A GeoJSON file with zones of the map, in metres in the map's frame."""

    file: File


Places = Annotated[tuple[Place, ...], Field(strict=False, max_length=MAX_PLACES)]
Zones = Annotated[tuple[Zone, ...], Field(strict=False, max_length=MAX_ZONES)]
ZoneFiles = Annotated[tuple[ZoneFile, ...], Field(strict=False, max_length=MAX_FILES)]

"""GeoJSON files (RFC 7946) of a map: its zones, and the route graph of Nav2's route server.

Coordinates are metres in the map's frame, whatever coordinate system a file declares: programs that
draw on a map of ROS declare one that is not true, such as EPSG:3857. Faults are texts that name the
file and the feature, a few of them.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple, NoReturn

from pydantic import ValidationError

from app.panel.base import FileContext
from app.panel.file.wording import describe_error
from app.panel.places import FAR_M, PAIR, Zone
from app.ros.messages.validation import format_value

MAX_BYTES: Final = 4_000_000
MAX_FEATURES: Final = 20_000
MAX_NODES: Final = 2_000
MAX_EDGES: Final = 8_000
MAX_FAULTS: Final = 10  # that are named of a file
MAX_POINTS: Final = 10_000  # of all zones of a file
MAX_ID: Final = 2**53
LEAST_RING: Final = 4  # positions, of which the last is the first
COLLECTION: Final = '{"type": "FeatureCollection", "features": […]}'
ZONE_KEYS: Final = ("label", "kind", "yaw", "level", "map_version")  # properties of a feature
LINES: Final = ("LineString", "MultiLineString")

Point = tuple[float, float]


class FileZones(NamedTuple):
    """The zones of a file, and what is wrong with it."""

    zones: tuple[Zone, ...] = ()
    faults: tuple[str, ...] = ()


class RouteGraph(NamedTuple):
    """`nodes` in metres in `frame`, "" for the map's; `edges` lead from a node to another, by their
    indexes. `faults` say what is wrong with its file. Graphs with the same `version` are the same."""

    frame: str = ""
    nodes: tuple[Point, ...] = ()
    edges: tuple[tuple[int, int], ...] = ()
    version: str = ""
    faults: tuple[str, ...] = ()


class _Feature(NamedTuple):
    """`place` is where it is in the file."""

    place: str
    type: str
    coordinates: Any
    properties: Mapping[str, Any]


class _Faults(list[str]):
    """Faults of a file, of which the first are named."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self._name = file.name
        self._more = 0

    def add(self, place: str, words: str) -> None:
        """`place` is "" for a fault of the whole file."""
        if len(self) < MAX_FAULTS:
            self.append(f"{self._name}: {place} {words}" if place else f"{self._name} {words}")
        else:
            self._more += 1

    def named(self) -> tuple[str, ...]:
        more = (f"{self._name}: {self._more} more mistakes",) if self._more else ()
        return (*self, *more)


def read_zones(file: Path, context: FileContext, beside: Mapping[str, Any]) -> FileZones:
    """The zones of a file: features that are a Polygon or a MultiPolygon, with `label` and `kind` among
    their properties. `beside` are keys of each zone that its table has."""
    faults = _Faults(file)
    zones: list[Zone] = []
    points = 0
    for number, feature in enumerate(_features(file, faults)):
        for part, rings in enumerate(_polygons(feature, faults)):
            if (outlines := _open_rings(feature, rings, faults)) is None:
                continue
            points += sum(map(len, outlines))
            own = {key: feature.properties[key] for key in ZONE_KEYS if key in feature.properties}
            keys = {"id": f"zone_{number}_{part}", "points": outlines[0], "holes": outlines[1:]}
            if zone := _zone({**beside, **own, **keys}, feature, context, faults):
                zones.append(zone)
    if points > MAX_POINTS:
        faults.add("", f"has zones with {points} corners: {MAX_POINTS} at most")
    return FileZones(() if faults else tuple(zones), faults.named())


def read_route_graph(file: Path) -> RouteGraph:
    """The route graph of a file, as Nav2's route server reads it: points with `id`, lines with
    `startid` and `endid` among their properties. A line leads from node to node, whatever its
    geometry."""
    faults = _Faults(file)
    nodes: dict[int, Point] = {}
    frames: dict[str, str] = {}
    lines: list[_Feature] = []
    for feature in _features(file, faults):
        if feature.type in LINES:
            lines.append(feature)
        elif feature.type != "Point":
            words = f"is a {feature.type}: a route graph has points and lines"
            faults.add(f"{feature.place}.geometry", words)
        elif node := _node(feature, nodes, faults):
            nodes[node[0]] = node[1]
            if (frame := feature.properties.get("frame")) is not None:
                frames.setdefault(f"{frame:.100}" if isinstance(frame, str) else "", feature.place)
    if len(frames) > 1:
        first, second = list(frames)[:2]
        words = f'is in the frame "{second}", and {frames[first]} in "{first}": a graph is in one frame'
        faults.add(frames[second], words)
    indexes = {name: index for index, name in enumerate(nodes)}
    edges = [edge for line in lines if (edge := _edge(line, indexes, faults))]
    for noun, number, most in (("nodes", len(nodes), MAX_NODES), ("edges", len(edges), MAX_EDGES)):
        if number > most:
            faults.add("", f"has {number} {noun}: {most} at most")
    if not (nodes or faults):
        faults.add("", 'has no node: a node is a Point with "id" among its properties')
    if faults:
        return RouteGraph(faults=faults.named())
    graph = RouteGraph(next(iter(frames), ""), tuple(nodes.values()), tuple(dict.fromkeys(edges)))
    return graph._replace(version=hashlib.sha256(repr(graph).encode()).hexdigest()[:16])


def _features(file: Path, faults: _Faults) -> Iterator[_Feature]:
    """The features that have a geometry."""
    try:
        features = _collection(file)
    except ValueError as error:
        faults.add("", str(error))
        return
    for number, raw in enumerate(features):
        place = f"features[{number}]"
        if not isinstance(raw, dict) or raw.get("type") != "Feature":
            faults.add(place, f'must be like {{"type": "Feature", …}}, not {_short(raw)}')
            continue
        geometry, properties = raw.get("geometry"), raw.get("properties") or {}
        if not isinstance(geometry, dict) or not isinstance(geometry.get("type"), str):
            words = f'must be like {{"type": "Polygon", "coordinates": […]}}, not {_short(geometry)}'
            faults.add(f"{place}.geometry", words)
        elif not isinstance(properties, dict):
            faults.add(f"{place}.properties", f"must be an object, not {_short(properties)}")
        else:
            kind = geometry["type"]
            yield _Feature(place, f"{kind:.40}", geometry.get("coordinates"), properties)


def _collection(file: Path) -> list[Any]:
    """The features as they are written; ValueError says what is wrong with the file as a whole."""
    with file.open("rb") as opened:
        data = opened.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise ValueError(f"has more than {MAX_BYTES // 1_000_000} MB, which is the most that is read")
    try:
        whole = json.loads(data, parse_constant=_refuse_constant)
    except RecursionError:
        raise ValueError("is nested too deeply") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"is not JSON: {error}") from None
    except UnicodeDecodeError:
        raise ValueError("is not JSON: it is not UTF-8") from None
    except ValueError as error:
        raise ValueError(f"is not JSON: {error}"[:200]) from None
    features = whole.get("features") if isinstance(whole, dict) else None
    if not isinstance(features, list) or whole.get("type") != "FeatureCollection":
        raise ValueError(f"is not a collection of features: it must be like {COLLECTION}")
    if len(features) > MAX_FEATURES:
        raise ValueError(f"has {len(features)} features: {MAX_FEATURES} at most")
    return features


def _refuse_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number")


def _polygons(feature: _Feature, faults: _Faults) -> list[Any]:
    """The polygons of a feature, each as a list of rings."""
    match feature.type, feature.coordinates:
        case "Polygon", list() as rings:
            return [rings]
        case "MultiPolygon", list() as polygons:
            return polygons
        case (("Polygon" | "MultiPolygon"), other):
            faults.add(f"{feature.place}.geometry.coordinates", f"must be a list, not {_short(other)}")
        case other, _:
            words = f'is a "{other}": a zone is a "Polygon" or a "MultiPolygon"'
            faults.add(f"{feature.place}.geometry", words)
    return []


def _open_rings(feature: _Feature, rings: Any, faults: _Faults) -> list[list[Point]] | None:
    """The rings without their last corner, which is the first again; None if one has a fault."""
    place = f"{feature.place}.geometry.coordinates"
    if not isinstance(rings, list) or not rings:
        faults.add(place, f"must be a list of rings, not {_short(rings)}")
        return None
    opened = []
    for number, ring in enumerate(rings):
        points = [_position(each) for each in ring] if isinstance(ring, list) else []
        if None in points:
            words = "must be a position like [2.0, 1.5], in metres"
            at = f"{place}[{number}][{points.index(None)}]"
            faults.add(at, f"{words}, not {_short(ring[points.index(None)])}")
            return None
        if len(points) < LEAST_RING or points[0] != points[-1]:
            words = "is not a ring: it has four positions or more, and the last is the first again"
            faults.add(f"{place}[{number}]", words)
            return None
        opened.append([point for point in points[:-1] if point is not None])
    return opened


def _position(value: Any) -> Point | None:
    """x and y in metres; a height is left out."""
    if not isinstance(value, list) or len(value) not in (PAIR, PAIR + 1):
        return None
    if not all(isinstance(part, int | float) and not isinstance(part, bool) for part in value):
        return None
    x, y = value[:PAIR]
    return (float(x), float(y)) if -FAR_M <= x <= FAR_M and -FAR_M <= y <= FAR_M else None


def _zone(
    keys: Mapping[str, Any], feature: _Feature, context: FileContext, faults: _Faults
) -> Zone | None:
    try:
        zone = Zone.model_validate(keys, context=context)
    except ValidationError as error:
        for detail in error.errors():
            key = str(detail["loc"][0])
            parent = "properties" if key in ZONE_KEYS else "geometry"
            words = "is missing" if detail["type"] == "missing" else describe_error(detail, key)
            faults.add(f"{feature.place}.{parent}.{key}", words)
        return None
    if words := zone.yaw_fault:
        faults.add(f"{feature.place}.properties.yaw", words)
    return zone


def _node(feature: _Feature, known: Mapping[int, Point], faults: _Faults) -> tuple[int, Point] | None:
    """The id and the position of a node."""
    name, point = _id_of(feature, "id", faults), _position(feature.coordinates)
    if name is None:
        return None
    if name in known:
        faults.add(f"{feature.place}.properties.id", f"{name} is already the id of another node")
    elif point is None:
        words = f"must be a position like [2.0, 1.5], in metres, not {_short(feature.coordinates)}"
        faults.add(f"{feature.place}.geometry.coordinates", words)
    else:
        return name, point
    return None


def _edge(line: _Feature, nodes: Mapping[int, int], faults: _Faults) -> tuple[int, int] | None:
    """The indexes of the nodes of an edge. Edges may have the same id."""
    ends = []
    for key in ("startid", "endid"):
        name = _id_of(line, key, faults)
        if name is None:
            continue
        if name not in nodes:
            faults.add(f"{line.place}.properties.{key}", f"there is no node with the id {name}")
        else:
            ends.append(nodes[name])
    return (ends[0], ends[1]) if len(ends) == PAIR else None


def _id_of(feature: _Feature, key: str, faults: _Faults) -> int | None:
    """The id of a node; None if it is none."""
    value = feature.properties.get(key)
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MAX_ID:
        return value
    words = "is missing: the id of a node"
    if value is not None:
        words = f"must be the id of a node, a whole number, not {_short(value)}"
    faults.add(f"{feature.place}.properties.{key}", words)
    return None


def _short(value: Any) -> str:
    """A value of a file in a message."""
    return format_value(value, 1)[:80]

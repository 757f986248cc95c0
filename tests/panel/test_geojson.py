"""GeoJSON files of zones and route graphs: what is read, and each fault with its file and feature."""

import json
from pathlib import Path
from typing import Any, Final

import pytest

from app.panel.base import FileContext
from app.panel.file.load import load_panel
from app.panel.geojson import (
    MAX_BYTES,
    MAX_EDGES,
    MAX_FAULTS,
    MAX_FEATURES,
    MAX_NODES,
    FileZones,
    RouteGraph,
    read_route_graph,
    read_zones,
)
from app.panel.places import MAX_ZONES
from app.system.texts import render
from tests.panel.test_map_places import CORNERS, HALL, PIT, faults
from tests.panel.test_shared_keys import text_of
from tests.support.beside_panel import feature, put_geojson

pytestmark = pytest.mark.promise("panel file")

SQUARE: Final = [[0, 0], [4, 0], [4, 3], [0, 3], [0, 0]]
HOLE: Final = [[1, 1], [2, 1], [2, 2], [1, 1]]
ZONE: Final = {"label": "Pit", "kind": "keep_out"}
AREA: Final = feature("Polygon", [SQUARE], **ZONE)
NODES: Final = (feature("Point", [0, 1], id=3), feature("Point", [2.5, 1, 0.0], id=7))


def zones(folder: Path, *features: Any, **beside: Any) -> FileZones:
    file = put_geojson(folder / "hall.geojson", *features)
    return read_zones(file, FileContext(folder, "en"), beside)


def graph(folder: Path, *features: Any) -> RouteGraph:
    return read_route_graph(put_geojson(folder / "ways.geojson", *features))


def edge(start: Any, end: Any, **more: Any) -> dict[str, Any]:
    geometry = [[[0.0, 0.0], [1e7, 1e7]]]  # not where its nodes are: the nodes count
    return feature("MultiLineString", geometry, id=1, startid=start, endid=end, **more)


def test_zones_have_the_keys_of_their_features_and_of_their_table(tmp_path: Path) -> None:
    way = feature("Polygon", [SQUARE], label="Way", kind="one_way", yaw=1.5, fid=12, width=None)
    both = feature(
        "MultiPolygon", [[SQUARE], [SQUARE, HOLE]], label={"en": "A", "de": "B"}, kind="speed"
    )
    read = zones(tmp_path, AREA, way, both, robot="r1", map_version="0" * 16)
    assert read.faults == ()
    assert [(str(zone.label), zone.kind, zone.yaw, len(zone.rings)) for zone in read.zones] == [
        ("Pit", "keep_out", None, 1),
        ("Way", "one_way", 1.5, 1),
        ("A", "speed", None, 1),
        ("A", "speed", None, 2),
    ]
    assert {(zone.robot, zone.map_version) for zone in read.zones} == {("r1", "0" * 16)}
    assert read.zones[3].rings == (
        ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)),
        ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0)),
    )
    assert render(read.zones[2].label, "de") == "B"
    assert len({zone.id for zone in read.zones}) == 4


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (feature("Polygon", [SQUARE], kind="keep_out"), "features[1].properties.label is missing"),
        (feature("Polygon", [SQUARE], label="Pit"), "features[1].properties.kind is missing"),
        (
            feature("Polygon", [SQUARE], label="Pit", kind="keepout"),
            'features[1].properties.kind must be "keep_out", "one_way", "speed" or "label", not'
            ' "keepout": did you mean "keep_out"?',
        ),
        (
            feature("Polygon", [SQUARE], label=5, kind="label"),
            "features[1].properties.label must be text, not 5",
        ),
        (
            feature("Polygon", [SQUARE], label="Way", kind="one_way"),
            "features[1].properties.yaw is missing: where the zone leads, in radians",
        ),
        (
            feature("Polygon", [SQUARE], label="Way", kind="one_way", yaw=90),
            "features[1].properties.yaw 90 is not an angle in radians, from -6.2832 to 6.2832: 90° is"
            " 1.5708",
        ),
        (
            feature("Point", [1, 2], **ZONE),
            'features[1].geometry is a "Point": a zone is a "Polygon" or a "MultiPolygon"',
        ),
        (
            feature("Polygon", [SQUARE[:-1]], **ZONE),
            "features[1].geometry.coordinates[0] is not a ring: it has four positions or more, and the"
            " last is the first again",
        ),
        (
            feature("Polygon", [[[0, 0], [1, 1], [0, 0]]], **ZONE),
            "features[1].geometry.coordinates[0] is not a ring: it has four positions or more, and the"
            " last is the first again",
        ),
        (
            feature("Polygon", [SQUARE, [[0, 0], ["1", 1]]], **ZONE),
            "features[1].geometry.coordinates[1][1] must be a position like [2.0, 1.5], in metres, not"
            ' ["1", 1]',
        ),
        (
            feature("Polygon", [[*SQUARE[:2], [1e300, 0], SQUARE[0]]], **ZONE),
            "features[1].geometry.coordinates[0][2] must be a position like [2.0, 1.5], in metres, not"
            " [1e+300, 0]",
        ),
        (
            feature("Polygon", 5, **ZONE),
            "features[1].geometry.coordinates must be a list, not 5",
        ),
        (
            feature("MultiPolygon", [{}], **ZONE),
            "features[1].geometry.coordinates must be a list of rings, not {}",
        ),
        ([], 'features[1] must be like {"type": "Feature", …}, not []'),
        (
            {"type": "Feature", "geometry": None, "properties": ZONE},
            'features[1].geometry must be like {"type": "Polygon", "coordinates": […]}, not null',
        ),
        (
            AREA | {"properties": [1]},
            "features[1].properties must be an object, not [1]",
        ),
    ],
)
def test_a_fault_of_a_zone_names_its_file_and_its_feature(
    tmp_path: Path, wrong: Any, message: str
) -> None:
    assert zones(tmp_path, AREA, wrong, AREA) == FileZones((), (f"hall.geojson: {message}",))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is not JSON: Expecting value: line 1 column 1 (char 0)"),
        (b"[" * 100_000, "is nested too deeply"),
        (b'{"type": "FeatureCollection", "features": [NaN]}', "is not JSON: NaN is not a number"),
        (b'{"features": [' + b"9" * 5000 + b"]}", "is not JSON: Exceeds the limit"),
        (b'"\xff"', "is not JSON: it is not UTF-8"),
        (b"[]", "is not a collection of features"),
        (b'{"type": "FeatureCollection", "features": {}}', "is not a collection of features"),
        (b'{"type": "Feature", "features": []}', "is not a collection of features"),
        (
            b'{"type": "FeatureCollection", "features": [' + b"{}," * MAX_FEATURES + b"{}]}",
            f"has {MAX_FEATURES + 1} features: {MAX_FEATURES} at most",
        ),
        (b" " * MAX_BYTES + b"{}", "has more than 4 MB, which is the most that is read"),
    ],
    ids=range(10),
)
def test_a_file_that_is_none_has_one_fault(tmp_path: Path, data: bytes, message: str) -> None:
    file = tmp_path / "hall.geojson"
    file.write_bytes(data)
    for named in (read_zones(file, FileContext(), {}).faults, read_route_graph(file).faults):
        assert len(named) == 1
        assert named[0].startswith(f"hall.geojson {message}")


def test_of_many_faults_the_first_are_named(tmp_path: Path) -> None:
    named = zones(tmp_path, *[feature("Polygon", [SQUARE])] * 5000).faults
    assert (len(named), named[-1]) == (MAX_FAULTS + 1, "hall.geojson: 9991 more mistakes")
    assert max(map(len, named)) < 200
    deep: Any = []
    for _ in range(200):
        deep = [deep]
    assert max(map(len, zones(tmp_path, feature("Polygon", deep, **ZONE), deep).faults)) < 300


def test_zones_of_files_count_as_those_of_the_panel_file(tmp_path: Path) -> None:
    put_geojson(tmp_path / "hall.geojson", AREA)
    page = {"id": "one", "title": "One", "widget": [HALL]}
    file = {"file": "hall.geojson"}
    tables = {"title": "Cell", "page": [page], "zone": [PIT | {"points": CORNERS}], "zone_file": [file]}
    path = tmp_path / "panel.toml"
    path.write_text(text_of(tables))
    panel = load_panel(path)
    assert [len(zone.points) for zone in panel.zones] == [3, 4]
    assert panel.geojson_files == (tmp_path / "hall.geojson",)


def test_the_panel_file_names_the_faults_of_its_files(tmp_path: Path) -> None:
    put_geojson(tmp_path / "hall.geojson", feature("Polygon", [SQUARE], label="Pit"))
    put_geojson(tmp_path / "many.geojson", *[AREA] * MAX_ZONES)
    put_geojson(tmp_path / "ways.geojson", *NODES, edge(3, 8))
    view = HALL | {"routes": {"file": "ways.geojson"}, "plan": {"src": "hall.png", "resolution": 0.1}}
    files = [{"file": "hall.geojson"}, {"file": "many.geojson"}]
    by_place = faults(tmp_path, view, zone=[PIT | {"points": CORNERS}], zone_file=files)
    assert by_place.pop("page[0].widget[0].plan.src").startswith('no picture "hall.png"')
    assert by_place == {
        "zone_file[0].file": "hall.geojson: features[0].properties.kind is missing",
        "zone_file[1].file": "the panel has 201 zones with those of this file: 200 at most",
        "page[0].widget[0].routes.file": "ways.geojson: features[2].properties.endid there is no node"
        " with the id 8",
    }
    outside = faults(tmp_path, HALL, zone_file=[{"file": "other.geojson"}])
    assert "is not a file" in outside["zone_file[0].file"]


def test_a_route_graph_is_its_nodes_and_the_edges_between_them(tmp_path: Path) -> None:
    read = graph(tmp_path, *NODES, edge(3, 7), edge(7, 3), edge(3, 7))
    assert read._replace(version="") == RouteGraph("", ((0.0, 1.0), (2.5, 1.0)), ((0, 1), (1, 0)))
    assert len(read.version) == 16
    assert graph(tmp_path, *NODES, edge(7, 3)).version != read.version
    named = feature("Point", [0, 1], id=3, frame="map")
    assert graph(tmp_path, named, NODES[1]).frame == "map"


@pytest.mark.parametrize(
    ("features", "message"),
    [
        ([*NODES, edge(3, 8)], ": features[2].properties.endid there is no node with the id 8"),
        ([*NODES, edge(None, 3)], ": features[2].properties.startid is missing: the id of a node"),
        (
            [*NODES, edge(3, "7")],
            ': features[2].properties.endid must be the id of a node, a whole number, not "7"',
        ),
        (
            [*NODES, feature("Point", [1, 1])],
            ": features[2].properties.id is missing: the id of a node",
        ),
        (
            [*NODES, feature("Point", [1, 1], id=7)],
            ": features[2].properties.id 7 is already the id of another node",
        ),
        (
            [*NODES, feature("Point", [1], id=8)],
            ": features[2].geometry.coordinates must be a position like [2.0, 1.5], in metres, not [1]",
        ),
        (
            [*NODES, AREA],
            ": features[2].geometry is a Polygon: a route graph has points and lines",
        ),
        (
            [feature("Point", [0, 1], id=1, frame="a"), feature("Point", [1, 1], id=2, frame="b")],
            ': features[1] is in the frame "b", and features[0] in "a": a graph is in one frame',
        ),
        ([], ' has no node: a node is a Point with "id" among its properties'),
    ],
    ids=range(9),
)
def test_a_fault_of_a_route_graph_names_its_file_and_its_feature(
    tmp_path: Path, features: list[Any], message: str
) -> None:
    assert graph(tmp_path, *features) == RouteGraph(faults=(f"ways.geojson{message}",))


def test_a_route_graph_has_so_many_nodes_and_edges_at_most(tmp_path: Path) -> None:
    nodes = [feature("Point", [name, 0], id=name) for name in range(MAX_NODES + 1)]
    assert graph(tmp_path, *nodes).faults == ("ways.geojson has 2001 nodes: 2000 at most",)
    edges = [feature("LineString", [], startid=0, endid=1)] * (MAX_EDGES + 1)
    few = graph(tmp_path, *nodes[:2], *edges).faults
    assert few == ("ways.geojson has 8001 edges: 8000 at most",)
    assert len(json.dumps(edges)) < MAX_BYTES

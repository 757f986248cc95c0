"""Zones, routes and a plan of files, on a server: the map's attributes, the graph, a goal at a zone."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.beside_panel import feature, put_geojson
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.web.test_map import grid_of
from tests.web.test_places import PANEL as PLACES

pytestmark = pytest.mark.promise("places")

ROUTES: Final = (
    feature("Point", [-2.0, -1.2], id=10),
    feature("Point", [1.25, 0.5], id=20),
    feature("Point", [1.25, -1.0], id=30),
    *(
        feature("MultiLineString", [], id=1, startid=start, endid=end)
        for start, end in ((10, 20), (20, 10), (20, 30))
    ),
)
RING: Final = [[1.0, 0.5], [3.0, 0.5], [3.0, 2.5], [1.0, 2.5], [1.0, 0.5]]
HOLE: Final = [[1.1, 0.6], [1.3, 0.6], [1.3, 0.8], [1.1, 0.6]]


def put_files(folder: Path) -> str:
    """Zones, routes and a plan in the folder, and the text of a panel with them."""
    pit = feature("Polygon", [RING, HOLE], label="Pit of the file", kind="keep_out")
    put_geojson(folder / "hall.geojson", pit)
    put_geojson(folder / "ways.geojson", *ROUTES)
    (folder / "pictures").mkdir()
    svg = '<svg xmlns="http://www.w3.org/2000/svg" width="40" height="20"><path d="M0 0h40v20z"/></svg>'
    (folder / "pictures/hall.svg").write_text(svg)
    of_map = """kind = "map"
routes = { file = "ways.geojson" }
plan = { src = "hall.svg", resolution = 0.1, origin = [-2.0, -1.0, 0.5] }
"""
    panel = PLACES.replace('kind = "map"\n', of_map)
    panel = panel.replace("language =", 'pictures = "pictures"\nlanguage =')
    return panel.replace("[[zone]]", '[[zone_file]]\nfile = "hall.geojson"\n[[zone]]')


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("hall")
    with demo_server(folder, put_files(folder)) as server:
        yield server


def test_the_graph_of_a_map_is_read_once_and_kept(hall: Server) -> None:
    grid_of(hall)
    version = hall.widget("hall")["routes"]["version"]
    answer = hall.http.get(f"/widgets/hall/map/routes/{version}.json")
    assert answer.json() == {
        "nodes": [-200, -120, 125, 50, 125, -100],
        "edges": [0, 1, 1, 0, 1, 2],
    }
    assert "immutable" in answer.headers["cache-control"]
    for path in ("hall/map/routes/0123456789abcdef", "other/map/routes/0123456789abcdef"):
        assert hall.http.get(f"/widgets/{path}.json").status_code == 404


def test_a_goal_at_a_zone_of_a_file_is_refused(hall: Server) -> None:
    grid_of(hall)
    zones: list[Any] = hall.widget("hall")["zones"]
    assert [(zone["label"], len(zone["rings"])) for zone in zones] == [
        ("Stairs", 1),
        ("Pit of the file", 2),
    ]
    until(lambda: hall.widget("hall")["state"] == "live", "the robot is known")
    card = hall.http.get("/widgets/goal/place", params={"value": "dock"}).json()
    assert "Pit of the file" in card["reason"]


def test_the_page_has_the_plan_at_its_place(hall: Server) -> None:
    text = hall.http.get("/").text
    assert 'data-resolution="0.1" data-origin="[-2.0, -1.0, 0.5]"' in text
    assert "/pictures/hall.svg" in text

"""A map on a server: its tiles, the picture for a page without scripts, a robot that is not heard."""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest
from PIL import Image

from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("values")

PANEL: Final = """
title = "Shuttle"
language = "en"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "hall"
kind = "map"
label = "Hall"
"""
SILENT: Final = '[demo]\n"/tf" = { silent = true }\n"/tf_static" = { silent = true }\n'


@pytest.fixture(scope="module")
def shuttle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("shuttle"), PANEL) as server:
        yield server


def grid_of(server: Server) -> dict[str, Any]:
    return dict(until(lambda: server.widget("hall")["grid"], "the map is read"))


def test_a_tile_is_a_picture_of_its_own_and_is_kept_for_good(shuttle: Server) -> None:
    grid = grid_of(shuttle)
    path = f"/widgets/hall/map/{grid['version']}/0-0.png"
    answer = shuttle.http.get(path)
    image = Image.open(io.BytesIO(answer.content))
    assert (answer.headers["content-type"], image.size) == (
        "image/png",
        (grid["width"], grid["height"]),
    )
    assert "immutable" in answer.headers["cache-control"]
    assert shuttle.http.get(path, params={"theme": "dark"}).content != answer.content


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("hall/map/0123456789abcdef/0-0.png", 404),
        ("hall/map/{version}/1-0.png", 404),
        ("hall/map/{version}/0-999999999999.png", 404),
        ("hall/map/{version}/0--1.png", 422),
        ("hall/map/{version}/0-0.png?theme=pink", 422),
        ("other/map/{version}/0-0.png", 404),
        ("other/map.png", 404),
    ],
)
def test_a_tile_that_is_none_is_refused(shuttle: Server, path: str, status: int) -> None:
    version = grid_of(shuttle)["version"]
    assert shuttle.http.get(f"/widgets/{path.format(version=version)}").status_code == status


def test_a_page_without_scripts_shows_the_map_with_the_robot(shuttle: Server) -> None:
    grid_of(shuttle)
    assert 'src="/widgets/hall/map.png"' in shuttle.http.get("/").text
    first = shuttle.http.get("/widgets/hall/map.png")
    assert (first.headers["content-type"], first.headers["cache-control"]) == ("image/png", "no-store")
    until(lambda: shuttle.http.get("/widgets/hall/map.png").content != first.content, "the robot moves")


def test_the_robot_moves_on_the_map(shuttle: Server) -> None:
    first = until(lambda: shuttle.widget("hall")["pose"], "the robot is seen")
    until(lambda: shuttle.widget("hall")["pose"] != first, "it moves")
    assert shuttle.widget("hall")["state"] == "live"


def test_a_robot_without_transforms_is_not_drawn_and_the_map_says_why(tmp_path: Path) -> None:
    with demo_server(tmp_path, PANEL + SILENT) as server:
        grid_of(server)
        widget = server.widget("hall")
        assert (widget["state"], widget["pose"]) == ("old", None)
        assert widget["note"].startswith("No transform from map to base_link: ")

"""The other robots on a map of each robot's page: they move, and lead to their own pages."""

from collections.abc import Iterator
from typing import Any, Final

import pytest

from tests.support.parts import Server, Stream, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("values")

ROBOTS: Final = """
title = "Hall 3"
language = "en"
[[robot]]
id = "left"
name = "Shuttle 1"
namespace = "/left"
[[robot]]
id = "right"
name = "Shuttle 2"
namespace = "/right"
"""
MAP: Final = """
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "hall"
kind = "map"
label = "Hall"
robots = "all"
[[page]]
id = "other"
title = "Other"
[[page.widget]]
id = "greeting"
kind = "text"
label = "Greeting"
"""


@pytest.fixture(scope="module")
def shuttles(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("shuttles"), ROBOTS + MAP) as server:
        yield server


def robots(server: Server, name: str) -> list[dict[str, Any]]:
    return list(server.robot(name).widget("hall")["robots"])


@pytest.mark.parametrize(
    ("own", "other", "name"), [("left", "right", "Shuttle 2"), ("right", "left", "Shuttle 1")]
)
def test_each_robots_map_has_the_other_one(shuttles: Server, own: str, other: str, name: str) -> None:
    def row() -> dict[str, Any] | None:
        rows = robots(shuttles, own)
        return rows[0] if rows and rows[0]["state"] == "live" else None

    shown: Any = until(row, "the other robot is there")
    assert (shown["robot"], shown["name"], shown["label"], shown["note"]) == (other, name, name, "")
    assert len(shown["pose"]) == 3
    assert shuttles.robot(own).widget("hall")["robots_note"] == ""


def test_a_page_shows_how_the_other_robot_moves_though_no_page_of_that_one_is_open(
    shuttles: Server,
) -> None:
    path = "/robots/left/events?page=main"
    with shuttles.http.stream("GET", path, timeout=60) as response:
        stream = Stream(response)
        poses: list[Any] = []
        while len(poses) < 3:
            name, data, _ = stream.next("snapshot", "update")
            widgets = data["widgets"] if name == "snapshot" else data
            poses += [row["pose"] for row in widgets.get("hall", {}).get("robots", []) if row["pose"]]
        assert len({*map(tuple, poses)}) == len(poses)


def test_the_list_leads_to_the_same_page_of_the_other_robot(shuttles: Server) -> None:
    until(lambda: robots(shuttles, "left"), "the other robot is there")
    page = shuttles.http.get("/robots/left/pages/main").text
    assert '<a href="/robots/right/pages/main" data-on-map="right"' in page
    assert 'data-on-map="left"' not in page

"""The live look of the page Diagnostics into topics of a robot on rmw_zenoh: the real server, a router
and a node as processes."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.session.looks import LINGER_S
from tests.support.parts import Server, live, until
from tests.support.rmw import RmwNode, Router
from tests.support.servers import panel_file, ready

INT: Final = "std_msgs/msg/Int32"
PANEL: Final = f"""
title = "Cell"
dialect = "rmw_zenoh"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "count"
kind = "readout"
label = "Count"
topic = "/count"
type = "{INT}"
"""


@pytest.fixture
def robot(router: Router) -> Iterator[RmwNode]:
    """A node with a topic that the panel shows and another one."""
    mine = RmwNode(router, "arm")
    for topic, number in (("/count", 5), ("/other", 7)):
        mine.advertise(topic, INT)
        mine.every(topic, {"data": number}, 0.1)
    yield mine
    mine.end()


def look(server: Server, key: str) -> dict[str, Any]:
    answer = server.http.get("/diagnostics/look", params={"topic": key})
    assert answer.status_code == 200, answer.text
    content: dict[str, Any] = answer.json()
    return content


def looks(server: Server) -> Any:
    return server.http.get("/diagnostics").json()["looks"]


@pytest.mark.parametrize(
    ("key", "line"),
    [("other", "data: 7"), pytest.param("count", "data: 5", marks=pytest.mark.long("detail"))],
)
def test_a_look_shows_messages_and_leaves_nothing_behind(
    router: Router, robot: RmwNode, tmp_path: Path, key: str, line: str
) -> None:
    path = str(panel_file(tmp_path, PANEL))
    with ready(live(router.endpoint, tmp_path, KIOSK_PANEL=path)) as server:
        until(lambda: server.widget("count")["text"] == "5", "the panel reads its topic")
        until(lambda: looks(server) == [], "no one looks")
        nodes, readers = robot.nodes(), robot.subscribers(f"/{key}")
        until(lambda: look(server, key)["messages"], "a message is shown")
        message = look(server, key)["messages"][0]
        assert (message["lines"], message["reason"]) == ([line], "")
        assert server.widget("count")["text"] == "5"
        until(lambda: not looks(server), "no one looks any more", within_s=LINGER_S + 60)
        until(lambda: robot.subscribers(f"/{key}") == readers, "its reader is gone")
        assert robot.nodes() == nodes
        assert robot.broken() == []

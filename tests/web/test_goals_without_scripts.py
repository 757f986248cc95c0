"""A goal by the form of a page without scripts: what its page showed is sent with it, so a goal is
refused if the map or the lock has changed since, also after a question."""

import html
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import pytest

from tests.cell.session.test_map_on_rmw_zenoh import GRID, POSE, TF, UPRIGHT, transform
from tests.cell.session.test_rmw_zenoh import LATCHED
from tests.support.parts import Server, until
from tests.support.rmw import RmwNode, SessionRouter
from tests.support.servers import live_server
from tests.web.test_places import PANEL

pytestmark = pytest.mark.promise("places")

SIDE: Final = 60
ASKS: Final = """
[[page.widget]]
id = "ask_first"
kind = "publish"
label = "Drive there"
topic = "/goal_pose"
type = "geometry_msgs/msg/PoseStamped"
message = { header = { frame_id = "{goal.frame}", stamp = "{now}" }, pose = "{goal.pose}" }
confirm_press = true
"""


class Shuttle:
    """A robot on a map, and the panel's server with it."""

    def __init__(self, node: RmwNode, server: Server) -> None:
        self.node = node
        self.server = server

    def show_map(self, walls: int) -> None:
        """Publishes a map that no other call has made, and waits until it is shown."""
        known = (self.server.widget("hall")["grid"] or {}).get("version")
        origin = {"position": {"x": -3.0, "y": -3.0, "z": 0.0}, "orientation": UPRIGHT}
        info = {"resolution": 0.1, "width": SIDE, "height": SIDE, "origin": origin}
        cells = [100] * walls + [0] * (SIDE**2 - walls)
        self.node.publish("/map", {"header": {"frame_id": "map"}, "info": info, "data": cells})
        until(lambda: self._grid()["version"] not in ("", known), "the map is shown")

    def _grid(self) -> Any:
        return self.server.widget("hall")["grid"] or {"version": ""}

    def page(self) -> dict[str, str]:
        """The hidden fields of the page as it is now."""
        until(self.is_permitted, "a goal is permitted")
        return hidden(self.server.http.get("/", headers={"accept": "text/html"}).text)

    def is_permitted(self) -> bool:
        """Whether a goal may be sent; the robot says where it is."""
        self.node.publish("/tf", transform("odom", "base_link", 0.0))
        return bool(self.server.widget("drive")["enabled"])

    def send(self, widget: str, fields: dict[str, str]) -> httpx.Response:
        self.node.publish("/tf", transform("odom", "base_link", 0.0))
        return self.server.http.post(f"/widgets/{widget}", data={**fields, "goal": "dock"})

    def said(self, answer: httpx.Response) -> str:
        """The page after a press."""
        assert answer.status_code == 303, answer.text
        return html.unescape(self.server.http.get(answer.headers["location"]).text)

    def goals(self) -> int:
        return len(self.node.heard("/goal_pose"))


def hidden(page: str) -> dict[str, str]:
    """The hidden fields of the page's form, or of that of a question; without the time of the page, as
    if it was read."""
    form = re.search(r'<form class="(?:page|card ask)".*?</form>', page, re.DOTALL)
    assert form, page
    fields = dict(re.findall(r'<input type="hidden" name="([^"]+)" value="([^"]*)">', form[0]))
    assert {"_id", "_seen", "_until"} <= fields.keys()
    return {name: value for name, value in fields.items() if name != "_since"}


@pytest.fixture
def shuttle(tmp_path: Path) -> Iterator[Shuttle]:
    router = SessionRouter()
    router.start()
    node = RmwNode(router, "shuttle")
    try:
        node.subscribe("/goal_pose", POSE)
        node.advertise("/map", GRID, **LATCHED)
        node.advertise("/tf_static", TF, **LATCHED)
        node.advertise("/tf", TF)
        node.publish("/tf_static", transform("map", "odom", 0.0))
        panel = PANEL.replace('title = "Shuttle"', 'title = "Shuttle"\ndialect = "rmw_zenoh"') + ASKS
        panel = panel.replace('kind = "map"', 'kind = "map"\nmax_age_s = 60')
        with live_server(router, tmp_path, panel) as server:
            mine = Shuttle(node, server)
            mine.show_map(1)
            yield mine
    finally:
        node.end()
        router.end()


def test_a_goal_of_a_page_is_sent_while_the_page_is_true(shuttle: Shuttle) -> None:
    fields = shuttle.page()
    assert "Dock: " in shuttle.said(shuttle.send("drive", fields))
    until(lambda: shuttle.goals() == 1, "the goal is received")
    asks = shuttle.send("ask_first", shuttle.page())
    assert asks.status_code == 200
    assert "Dock: " in shuttle.said(shuttle.send("ask_first", hidden(asks.text)))
    until(lambda: shuttle.goals() == 2, "the goal is received")


def test_a_goal_of_a_page_that_shows_another_map_is_refused(shuttle: Shuttle) -> None:
    fields = shuttle.page()
    asks = shuttle.send("ask_first", {**shuttle.page(), "_id": "asked"})
    shuttle.show_map(2)
    until(shuttle.is_permitted, "a goal is permitted again")
    late = shuttle.send("ask_first", {**fields, "_id": "late"})  # the question comes after the map
    old = (fields, hidden(asks.text), hidden(late.text))
    for widget, sent in zip(("drive", "ask_first", "ask_first"), old, strict=True):
        said = shuttle.said(shuttle.send(widget, sent))
        assert "the state changed while you pressed" in said, said
    assert "Dock: " in shuttle.said(shuttle.send("drive", shuttle.page()))
    until(lambda: shuttle.goals() == 1, "only the new page's goal is received")

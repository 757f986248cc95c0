"""A stop button of the frame stops every robot that its page shows, with one command and one receipt
for each; a button of the frame says for which robots it is."""

import re
from collections.abc import Iterator, Sequence
from typing import Any, Final

import pytest

from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("stop")

ROBOTS: Final = ("left", "right", "rear")
PANEL: Final = """
title = "Cell"
mode = "demo"
languages = ["en", "de", "ja"]

[[frame.widget]]
id = "stop"
kind = "publish"
role = "stop"
label = "Stop"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "stop" }

[[frame.widget]]
id = "lamp"
kind = "publish"
label = "Lamp"
topic = "/operation1"
type = "std_msgs/msg/String"
message = { data = "lamp" }

[[frame.widget]]
id = "stop_rear"
kind = "publish"
role = "stop"
label = "Stop rear"
robot = "rear"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "stop" }

[[page]]
id = "own"
title = "Own"

[[page.widget]]
id = "heard"
kind = "readout"
label = "Heard"
topic = "/last_heard"
type = "std_msgs/msg/String"

[[page]]
id = "robots"
title = "Robots"
overview = true

[[page]]
id = "both"
title = "Both"

[[page.widget]]
id = "heard_left"
kind = "readout"
label = "Left"
robot = "left"
topic = "/last_heard"
type = "std_msgs/msg/String"

[[page.widget]]
id = "heard_right"
kind = "readout"
label = "Right"
robot = "right"
topic = "/last_heard"
type = "std_msgs/msg/String"
""" + "".join(
    f'\n[[robot]]\nid = "{name}"\nname = "{name.capitalize()} arm"\nnamespace = "/{name}"\n'
    for name in ROBOTS
)
EVERY: Final = ",".join(ROBOTS)
# The page, the query of its stop button, and what that says of its robots.
PAGES: Final = (
    ("/robots/left/pages/own", "", "Left arm"),
    ("/robots/right/pages/own", "", "Right arm"),
    ("/robots/right/pages/robots", EVERY, "All 3 robots"),
    ("/robots/left/pages/both", "left,right", "Left arm, Right arm"),
    ("/robots/rear/pages/both", EVERY, "All 3 robots"),
    ("/alarms", EVERY, "All 3 robots"),
    ("/log", EVERY, "All 3 robots"),
    ("/log?robot=right", "", "Right arm"),
)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    mine = demo_server(tmp_path_factory.mktemp("cell"), PANEL)
    yield mine
    mine.end()


def commands(server: Server) -> dict[str, int]:
    """How many stops each robot was sent."""
    lines = [line for line in server.process.text.splitlines() if " of stop by " in line]
    return {name: sum(f"{name.capitalize()} arm" in line for line in lines) for name in ROBOTS}


def sent(server: Server, before: dict[str, int], names: Sequence[str]) -> None:
    """Each of these robots was sent one stop since, and no other robot."""
    expected = {name: count + (name in names) for name, count in before.items()}
    until(lambda: sum(commands(server).values()) >= sum(expected.values()), "the stops are sent")
    assert commands(server) == expected


def button(html: str, widget: str) -> str:
    match = re.search(
        rf'<button type="submit" formaction="[^"]*/widgets/{widget}[?"].*?</button>', html
    )
    assert match, widget
    return match[0]


@pytest.mark.parametrize(("path", "robots", "said"), PAGES)
def test_a_button_of_the_frame_says_which_robots_it_is_for(
    server: Server, path: str, robots: str, said: str
) -> None:
    html = server.http.get(path, headers={"accept": "text/html"}).text
    stop = button(html, "stop")
    assert f">Stop {said}</span>" in stop
    assert (f"?robots={robots}" in stop) is bool(robots)
    assert ">Stop rear Rear arm</span>" in button(html, "stop_rear")
    assert "robots=" not in button(html, "lamp")


@pytest.mark.parametrize(
    ("language", "said"), [("de", "Alle 3 Roboter"), ("ja", "全 3 台"), ("en", "All 3 robots")]
)
def test_a_stop_of_all_says_so_in_each_language(server: Server, language: str, said: str) -> None:
    html = server.http.get("/robots/left/pages/robots", headers={"accept-language": language}).text
    assert said in button(html, "stop")


def press(server: Server, robots: str, press_id: str, way: str = "post") -> dict[str, Any]:
    if way == "socket":
        with server.robot("left").socket() as socket:
            return dict(socket.press(widget="stop", inputs={}, id=press_id, robots=robots).json())
    answer = server.http.post(
        f"/robots/left/widgets/stop?robots={robots}", json={"inputs": {}, "id": press_id}
    )
    assert answer.status_code == 200, answer.text
    return dict(answer.json())


@pytest.mark.parametrize("way", ["post", "socket"])
@pytest.mark.parametrize("robots", ["left,right", EVERY])
def test_one_press_is_one_command_and_one_receipt_for_each_robot(
    server: Server, robots: str, way: str
) -> None:
    names, before = robots.split(","), commands(server)
    receipt = press(server, robots, f"{way}.{len(names)}", way)
    assert [part["robot"] for part in receipt["receipts"]] == names
    assert {part["outcome"] for part in receipt["receipts"]} == {"published"}
    assert receipt["outcome"] == "published"
    sent(server, before, names)
    again = press(server, robots, f"{way}.{len(names)}")  # the same press
    assert [part["at"] for part in again["receipts"]] == [part["at"] for part in receipt["receipts"]]
    sent(server, before, names)


def test_a_form_stops_all_robots_and_its_page_has_the_receipt(server: Server) -> None:
    before, path = commands(server), "/robots/left/pages/robots"
    html = server.http.get(path).text
    # At once, as by a finger that waits for no page.
    fields = dict(re.findall(r'<input type="hidden" name="(_\w+)" value="([^"]*)">', html))
    answer = server.http.post(f"/robots/left/widgets/stop?robots={EVERY}", data=fields)
    assert answer.status_code == 303
    assert answer.headers["location"].startswith(path)
    sent(server, before, ROBOTS)
    shown = server.http.get(answer.headers["location"]).text
    assert re.search(r'id="receipt-stop"[^>]* data-outcome="published"[^>]*>Sent to all \d', shown)


def test_a_press_for_several_is_for_a_stop_of_the_frame_only(server: Server) -> None:
    for widget, robots, status in (
        ("lamp", EVERY, 422),
        ("stop", "left,nowhere", 404),
        ("stop_rear", EVERY, 422),
    ):
        path = f"/robots/left/widgets/{widget}?robots={robots}"
        assert server.http.post(path, json={"inputs": {}}).status_code == status


def test_events_of_a_page_of_several_have_the_lock_of_them_all(server: Server) -> None:
    for page, names in (("robots", {"stop", "stop_rear", "lamp"}), ("own", {"stop", "stop_rear"})):
        snapshot = server.http.get(f"/robots/left/events?once=1&page={page}").text
        for name in names:
            assert f'"{name}":{{"enabled":true' in snapshot
        assert "-stops-" not in snapshot

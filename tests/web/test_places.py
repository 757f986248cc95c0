"""Places over HTTP: the list, the card of what is chosen, presses, and a page without scripts."""

import re
from collections.abc import Iterator
from typing import Any, Final

import pytest

from tests.support.parts import ROOT, Server, until
from tests.support.servers import demo_server
from tests.web.test_map import SILENT

pytestmark = pytest.mark.promise("places")

PANEL: Final = """
title = "Shuttle"
language = "en"

[[place]]
id = "dock"
label = "Dock"
x = 2.0
y = 1.5

[[place]]
id = "table"
label = "Table"
x = -0.3
y = -0.2

[[place]]
id = "pit"
label = "Pit"
x = -2.0
y = -1.2

[[zone]]
id = "stairs"
label = "Stairs"
kind = "keep_out"
points = [[-2.5, -1.7], [-1.5, -1.7], [-1.5, -0.7], [-2.5, -0.7]]

[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "hall"
kind = "map"
label = "Hall"
[[page.widget]]
id = "goal"
kind = "place"
label = "Places"
map = "hall"
touch = true
[[page.widget]]
id = "drive"
kind = "publish"
label = "Drive"
topic = "/goal_pose"
type = "geometry_msgs/msg/PoseStamped"
message = { header = { frame_id = "{goal.frame}", stamp = "{now}" }, pose = "{goal.pose}" }
[[page.widget]]
id = "here"
kind = "publish"
label = "Robot is here"
topic = "/initialpose"
type = "geometry_msgs/msg/PoseWithCovarianceStamped"
message = { header = { frame_id = "{goal.frame}", stamp = "{now}" }, pose = { pose = "{goal.pose}" } }
"""


@pytest.fixture(scope="module")
def shuttle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("shuttle"), PANEL) as server:
        until(lambda: server.widget("hall")["state"] == "live", "the map is there")
        yield server


def version(server: Server) -> str:
    return str(until(lambda: server.widget("hall")["grid"], "the map is read")["version"])


def press(server: Server, value: Any, widget: str = "drive") -> tuple[int, str, str]:
    answer = server.http.post(f"/widgets/{widget}", json={"inputs": {"goal": value}})
    receipt = answer.json()
    return answer.status_code, receipt["outcome"], receipt["reason"]


def card(server: Server, value: str, **headers: str) -> Any:
    return server.http.get("/widgets/goal/place", params={"value": value}, headers=headers).json()


def test_the_list_has_each_place_with_its_distance_or_why_it_is_locked(shuttle: Server) -> None:
    shown = shuttle.widget("goal")
    assert (shown["state"], shown["note"]) == ("live", "")
    assert sorted(shown["commands"]) == ["drive", "here"]
    places = {place["id"]: place for place in shown["places"]}
    assert list(places) == ["dock", "table", "pit"]
    assert re.fullmatch(r"\d\.\d m", places["dock"]["distance"])
    assert places["dock"]["reason"] == ""
    assert "obstacle" in places["table"]["reason"]
    assert "Stairs" in places["pit"]["reason"]


def test_the_map_has_the_zones(shuttle: Server) -> None:
    (zone,) = shuttle.widget("hall")["zones"]
    assert (zone["label"], zone["kind"], zone["rings"][0][0]) == ("Stairs", "keep_out", [-2.5, -1.7])


def test_the_card_says_what_a_press_would_send(shuttle: Server) -> None:
    shown = card(shuttle, f"x=1.50 y=1.00 yaw=1.57 map={version(shuttle)}")
    assert shown["pose"] == [1.5, 1.0, 1.57]
    assert (shown["name"], shown["reason"]) == ("x 1.50 m, y 1.00 m", "")
    texts = {row["name"]: row["text"] for row in shown["rows"]}
    assert texts["Turned"] == "90°, to the north"
    assert {"Place", "Way", "Floor"} < texts.keys()
    german = card(shuttle, "dock", **{"Accept-Language": "de"})
    assert [row["text"] for row in german["rows"]][:2] == ["Dock", "x 2,00 m, y 1,50 m"]


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("table", "obstacle"),
        ("pit", "Stairs"),
        ("x=1.50 y=1.00 yaw=0.00 map=0123456789abcdef", "map has changed"),
        ("x=99.00 y=1.00 yaw=0.00 map={version}", "outside the map"),
    ],
)
def test_what_is_refused_is_refused_on_the_card_and_at_the_press(
    shuttle: Server, value: str, words: str
) -> None:
    value = value.format(version=version(shuttle))
    assert words in card(shuttle, value)["reason"]
    status, outcome, reason = press(shuttle, value)
    assert (status, outcome) == (409, "refused")
    assert words in reason


@pytest.mark.parametrize("value", ["", "gone", "x=1 y=2 yaw=3", "a" * 200])
def test_what_chooses_nothing_has_no_card_and_sends_nothing(shuttle: Server, value: str) -> None:
    answer = shuttle.http.get("/widgets/goal/place", params={"value": value})
    assert answer.status_code == 422
    status, outcome, _ = press(shuttle, value)
    assert (status, outcome) == (422, "refused")


def test_a_place_and_a_pose_are_sent_and_named_and_so_is_the_start_of_a_localization(
    shuttle: Server,
) -> None:
    status, _, reason = press(shuttle, "dock")
    assert (status, reason.partition(":")[0]) == (200, "Dock")
    touched = f"x=1.50 y=1.00 yaw=1.57 map={version(shuttle)}"
    for widget in ("drive", "here"):
        status, _, reason = press(shuttle, touched, widget)
        assert (status, reason.partition(":")[0]) == (200, "x 1.50 m, y 1.00 m")


def test_another_widget_has_no_card(shuttle: Server) -> None:
    assert shuttle.http.get("/widgets/hall/place", params={"value": "dock"}).status_code == 404


def test_the_list_works_without_scripts(shuttle: Server) -> None:
    page = shuttle.http.get("/").text
    assert re.search(r'<select id="input-goal" name="goal"', page)
    assert '<option value="dock">Dock</option>' in page
    answer = shuttle.http.post("/widgets/drive", data={"goal": "dock"})
    assert answer.status_code == 303
    shown = shuttle.http.get(answer.headers["location"]).text
    assert "Dock: " in shown
    assert '<option value="dock" selected>Dock</option>' in shown


def test_a_robot_that_is_not_heard_locks_the_buttons(tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("silent")
    with demo_server(folder, PANEL + SILENT) as server:
        known = version(server)
        until(lambda: not server.widget("drive")["enabled"], "it is locked")
        assert "not known where the robot is" in server.widget("drive")["reason"]
        shown = server.widget("goal")
        assert (shown["state"], shown["places"][0]["distance"]) == ("missing", "")
        for value in ("dock", f"x=1.50 y=1.00 yaw=0.00 map={known}"):
            status, outcome, reason = press(server, value)
            assert (status, outcome) == (409, "refused")
            assert "not known where the robot is" in reason


NAVIGATE: Final = """
[[page.widget]]
id = "navigate"
kind = "action"
label = "Send"
action = "/navigate_to_pose"
type = "nav2_msgs/action/NavigateToPose"
goal = { pose = { header = { frame_id = "{goal.frame}", stamp = "{now}" }, pose = "{goal.pose}" } }
[demo."/navigate_to_pose"]
duration_s = 60.0
"""


def test_a_goal_of_an_action_is_named_and_can_be_canceled(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    interfaces = ROOT / "docs/examples/mobile-robot/interfaces"
    panel = PANEL.replace('title = "Shuttle"', f'title = "Shuttle"\ninterfaces = ["{interfaces}"]')
    with demo_server(tmp_path_factory.mktemp("nav"), panel + NAVIGATE) as server:
        until(lambda: server.widget("navigate")["enabled"], "it is permitted")
        status, outcome, reason = press(server, "pit", "navigate")
        assert (status, outcome) == (409, "refused")
        status, outcome, reason = press(server, "dock", "navigate")
        assert (status, outcome, reason.partition(":")[0]) == (200, "accepted", "Dock")
        until(lambda: server.widget("navigate")["stoppable"], "it is under way")
        server.http.post("/widgets/navigate/cancel", json={})
        until(lambda: server.widget("navigate")["outcome"] == "canceled", "it is canceled")

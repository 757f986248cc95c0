"""A robot that nobody here wrote: a node on hiroz, by the makers of Zenoh. Its keys, tokens,
attachments and type hashes are its own (`tests/rmw_crate/`)."""

import asyncio
import io
import math
import signal
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest
from PIL import Image

from app.cell.session.session import RobotSession
from tests.bridge.test_goals_on_bridge import press
from tests.cell.session.test_rmw_zenoh import asked, enabled, link, session_with
from tests.support.builders import ENABLED, GUARDED, MESSAGE, panel_of, press_widget
from tests.support.cyclone import NAV2
from tests.support.parts import Process, Server, until
from tests.support.rmw import RmwNode, Router
from tests.support.servers import live_server
from tests.support.waiting import when

pytestmark = pytest.mark.promise("dialects")

NUMBER = {"id": "number", "kind": "number", "label": "Number", "min": 0, "max": 20}
SAY = {**GUARDED, "id": "say", "topic": "/operation"}
LAST = {
    "id": "last",
    "kind": "readout",
    "label": "Heard",
    "topic": "/last_heard",
    "type": "std_msgs/msg/String",
    "field": "data",
}
ADD = {
    "id": "add",
    "kind": "call",
    "label": "Add",
    "service": "/add",
    "type": "example_interfaces/srv/AddTwoInts",
    "request": {"a": "{number}", "b": 2},
    "answer": "{sum}",
}
COUNT = {
    "id": "count",
    "kind": "action",
    "label": "Count",
    "action": "/count",
    "type": "example_interfaces/action/Fibonacci",
    "goal": {"order": "{number}"},
}
SPEED = {
    "id": "speed",
    "kind": "parameter",
    "label": "Speed",
    "node": "/system_controller",
    "parameter": "max_speed",
    "type": "integer",
    "min": 0,
    "max": 60,
}
PANEL = panel_of(MESSAGE, NUMBER, SAY, LAST, ADD, COUNT, SPEED)


@pytest.fixture
def router(zenohd: None) -> Iterator[Router]:
    mine = Router()
    mine.start()
    yield mine
    mine.end()


@pytest.fixture
def robot(hiroz: Path, router: Router) -> Iterator[Process]:
    mine = Process([str(hiroz), router.endpoint], {})
    until(lambda: "running" in mine.text or not mine.running, "it runs")
    assert mine.running, mine.text
    yield mine
    mine.end(signal.SIGKILL)


DRIVEN: Final = """
title = "Shuttle"
dialect = "rmw_zenoh"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "hall"
kind = "map"
label = "Hall"
max_age_s = 1.0
[[page.widget.layer]]
shows = "scan"
topic = "/scan"
max_age_s = 1.0
"""
CELL_M: Final = 0.1
LEFT, TOP = -2.0, 2.0  # of the map, in metres


ON_LEVELS: Final = f"""
interfaces = ["{NAV2}"]
{DRIVEN.split("[[page.widget.layer]]", maxsplit=1)[0]}
radius = 0.1
robot_level = {{ topic = "/level", type = "std_msgs/msg/String" }}
level = [
  {{ id = "ground", label = "Ground floor", topic = "/map" }},
  {{ id = "upper", label = "Upper floor", topic = "/upper/map" }},
]
layer = [
  {{ shows = "keep_out", topic = "/keepout_mask", info = "/keepout_info" }},
  {{ shows = "speed", topic = "/speed_mask", info = "/speed_info" }},
]
[[page.widget]]
id = "goal"
kind = "place"
label = "Places"
map = "hall"
[[page.widget]]
id = "drive"
kind = "publish"
label = "Drive"
topic = "/goal_pose"
type = "geometry_msgs/msg/PoseStamped"
message = {{ header = {{ frame_id = "{{goal.frame}}", stamp = "{{now}}" }}, pose = "{{goal.pose}}" }}
[[page.widget]]
id = "word"
kind = "text"
label = "Word"
[[page.widget]]
id = "order"
kind = "publish"
label = "Order"
topic = "/operation"
type = "std_msgs/msg/String"
message = {{ data = "{{word}}" }}
""" + "".join(
    f'[[place]]\nid = "{name}"\nlabel = "{name.title()}"\nx = {x}\ny = 0.0\nlevel = "{level}"\n'
    for name, x, level in (
        ("dock", 0.5, "ground"),
        ("closed", -1.5, "ground"),
        ("archive", 0.5, "upper"),
    )
)


def shown(session: RobotSession, widget: str) -> Any:
    return session.publisher.view["widgets"][widget]


def test_everything_of_a_robot_on_hiroz_works(router: Router, robot: Process) -> None:
    """Nobody said that it is on rmw_zenoh."""

    async def scene() -> None:
        async with session_with(router, PANEL) as session:
            await when(partial(enabled, session, "say"), "the latched permission came")
            said = await press_widget(session.presses, "say", {"message": "hello"}, "n1")
            assert said.outcome == "published", said.reason
            await when(lambda: "heard hello" in robot.text, "it heard the press")
            await when(lambda: "hello" in str(shown(session, "last")), "it says it back")

            await when(partial(enabled, session, "add"))
            added = await press_widget(session.presses, "add", {"number": 40}, "n2")
            assert added.outcome == "refused", added.reason  # beyond the input's limits
            added = await press_widget(session.presses, "add", {"number": 5}, "n3")
            assert added.outcome == "succeeded", added.reason
            assert "7" in str(added.reason)

            await when(partial(enabled, session, "speed"), "the parameter was read")
            assert "50" in str(shown(session, "speed"))
            set_to = await press_widget(session.presses, "speed", {"speed": 33}, "n4")
            assert set_to.outcome == "succeeded", set_to.reason
            await when(lambda: "33" in str(shown(session, "speed")), "it is read back")

            await when(partial(enabled, session, "count"))
            goal = await press_widget(session.presses, "count", {"number": 6}, "n5")
            assert goal.outcome == "accepted", goal.reason
            await when(lambda: shown(session, "count")["outcome"] == "succeeded", "a result")

    asyncio.run(scene())


def test_it_sees_the_panel_and_its_death_is_seen(router: Router, robot: Process) -> None:
    async def scene() -> None:
        other = await asked(RmwNode, router, "other")
        try:
            async with session_with(router, PANEL) as session:
                await when(partial(enabled, session, "say"))
                assert {"/system_controller", "/web_ui", "/other"} == set(await asked(other.nodes))
                robot.send(signal.SIGKILL)
                await when(lambda: not enabled(session, "say"), "locked")
                await when(lambda: link(session, "node")["state"] == "bad")
                assert "Node /system_controller has ended" in str(link(session, "node")["reason"])
                assert ENABLED in str(shown(session, "say")["reason"])
        finally:
            await asked(other.end)

    asyncio.run(scene())


def test_its_map_transforms_at_50_hz_and_scan_at_10_hz_fit_each_other(
    router: Router, robot: Process, tmp_path: Path
) -> None:
    """Where the robot stands, and where its beams end, are the cells that it says."""
    with live_server(router, tmp_path, DRIVEN) as kiosk:

        def is_placed() -> bool:
            hall = kiosk.widget("hall")
            return (
                hall["state"] == "live" and bool(hall["grid"]) and bool(hall["layer_0"].get("points"))
            )

        until(is_placed, "the robot and its scan are on the map")
        hall = kiosk.widget("hall")
        x, y, yaw = hall["pose"]
        assert (x, y) == (1.25, -0.5)
        assert yaw == pytest.approx(math.pi / 2, abs=0.01)
        assert hall["layer_note"] == ""
        ends = sorted(zip(*[iter(hall["layer_0"]["points"])] * 2, strict=True))
        assert ends == [(25, -50), (125, -150), (125, 50), (225, -50)]  # cm
        grid = hall["grid"]
        assert (grid["width"], grid["height"], grid["x"], grid["y"]) == (40, 40, LEFT, -2.0)
        picture = kiosk.http.get(f"/widgets/hall/map/{grid['version']}/0-0.png").content
        tile = Image.open(io.BytesIO(picture)).convert("RGB")

        def colour_at(x_m: float, y_m: float) -> Any:
            return tile.getpixel((int((x_m - LEFT) / CELL_M), int((TOP - y_m) / CELL_M)))

        assert colour_at(x, y) == colour_at(0.0, 0.0)  # free floor
        assert colour_at(1.95, y) != colour_at(x, y)  # the wall, seven cells to the right
        assert colour_at(1.85, y) == colour_at(x, y)
        robot.send(signal.SIGKILL)
        until(lambda: kiosk.widget("hall")["state"] == "old", "without transforms it is old")
        assert kiosk.widget("hall")["pose"] == [x, y, yaw]


@pytest.fixture
def driver(router: Router) -> Iterator[RmwNode]:
    mine = RmwNode(router, "driver")
    yield mine
    mine.end()


def test_its_levels_and_masks_decide_about_goals(
    router: Router, robot: Process, driver: RmwNode, tmp_path: Path
) -> None:
    with live_server(router, tmp_path, ON_LEVELS) as kiosk:
        driver.subscribe("/goal_pose", "geometry_msgs/msg/PoseStamped")
        until(lambda: all(row["grid"] for row in kiosk.widget("hall")["levels"]), "both maps are read")
        assert press(kiosk, "drive", "dock")[0] == 409  # it is not known where the robot is
        order(kiosk, robot, "level ground")
        until(lambda: kiosk.widget("hall")["level"] == "ground", "the robot is there")
        until(lambda: kiosk.widget("hall")["layer_1"]["note"] == "Limits: 40 %", "the limit is named")
        until(lambda: press(kiosk, "drive", "dock")[0] == 200, "a goal on its level is sent")
        status, reason = press(kiosk, "drive", "archive")
        assert (status, "The robot is on" in reason) == (409, True), reason
        status, reason = press(kiosk, "drive", "closed")
        assert (status, "may not enter Keep-out mask" in reason) == (409, True), reason
        order(kiosk, robot, "clear")
        until(lambda: press(kiosk, "drive", "closed")[0] == 200, "the zone is free")
        order(kiosk, robot, "level upper")
        until(lambda: press(kiosk, "drive", "archive")[0] == 200, "it is on the other level")
        assert press(kiosk, "drive", "dock")[0] == 409
        until(lambda: len(driver.heard("/goal_pose")) == 3, "what was sent has arrived, once")


def order(kiosk: Server, robot: Process, word: str) -> None:
    answer = kiosk.http.post("/widgets/order", json={"inputs": {"word": word}})
    assert answer.status_code == 200, answer.text
    until(lambda: f"heard {word}" in robot.text, "the robot has it")

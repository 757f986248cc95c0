"""A bridge, or the router of nodes on rmw_zenoh, is killed while a hold, a trend, a camera, a recording
and the alarms of a list run, and started again."""

import re
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, Final, NamedTuple

import pytest
from mcap.reader import make_reader

from app.tools.simulator.known_types import grey_pixels, png
from tests.bridge.test_cameras_on_bridge import PACKED, ask, looking
from tests.bridge.test_recording_on_bridge import files, record, records
from tests.cell.history.test_on_server import columns
from tests.support.holds import PANEL as JOG
from tests.support.holds import PATIENT, TOPIC, permit
from tests.support.parts import Bridge, RosNode, Server, live, publish_until, until
from tests.support.rmw import RmwNode, Router
from tests.web.test_hold_socket import held
from tests.web.test_stops import story

pytestmark = pytest.mark.promise("hold")

POINT: Final = "geometry_msgs/msg/Point"
SPEED: Final = "std_msgs/msg/Float64"
PNG: Final = png(grey_pixels(0, 0))
PICTURE: Final = {"format": "png", "data": [*PNG]}
MORE: Final = f"""
[[page.widget]]
id = "course"
kind = "trend"
label = "Speed"
window = "1m"
[[page.widget.pen]]
topic = "/speed"
type = "{SPEED}"
label = "Speed"
[[page.widget]]
id = "eye"
kind = "camera"
label = "Eye"
topic = "/eye"
type = "{PACKED}"
"""
STATE: Final = """
[state]
topic = "/mode"
type = "std_msgs/msg/String"
states = [{ value = "RUN", text = "Run", shape = "play" }]
"""
ARRAY: Final = "diagnostic_msgs/msg/DiagnosticArray"
FAULTS: Final = f"""
title = "Cell"
mode = "live"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Bool"
message = {{ data = true }}
[[alarm]]
id = "faults"
topic = "/faults"
type = "{ARRAY}"
priority = 2
inhibits = ["go"]
list = {{ field = "status", code = "name", text = "message" }}
"""


class Way(NamedTuple):
    """How the robot is reached, and the robot."""

    link: Bridge
    node: RosNode


@pytest.fixture(params=["bridge", "rmw_zenoh"])
def way(domain: int, request: pytest.FixtureRequest) -> Iterator[Way]:
    on_bridge = request.param == "bridge"
    link: Bridge = Bridge(domain + 1) if on_bridge else Router()
    link.start()
    node = RosNode(link.domain) if on_bridge else RmwNode(link)
    yield Way(link, node)
    link.end()
    node.end()


def readings(kiosk: Server) -> int:
    return len(columns(kiosk, window="1m"))


def test_a_lost_link_ends_a_hold_and_the_rest_goes_on_after_it(
    way: Way, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    panel = tmp_path / "panel.toml"
    panel.write_text(JOG + MORE + record(2))
    data = str(tmp_path / "data")
    kiosk = servers(
        live(way.link.endpoint, tmp_path, KIOSK_PANEL=str(panel), KIOSK_DATA=data, app=PATIENT)
    )
    way.node.subscribe(TOPIC, POINT)
    for topic, type_name in (
        ("/operation_enabled", "std_msgs/msg/Bool"),
        ("/speed", SPEED),
        ("/eye", PACKED),
    ):
        way.node.advertise(topic, type_name)
    way.node.every("/speed", {"data": 1.5}, 0.1)
    way.node.every("/eye", PICTURE, 0.1)
    permit(kiosk, way.node, True)
    until(lambda: readings(kiosk) > 0, "the trend has values")
    with looking(kiosk, "eye") as eye, held(kiosk) as jog:
        assert ask(eye)["bytes"] == PNG
        until(lambda: way.node.heard(TOPIC), "it moves")
        way.link.kill()
        said = jog.beat_until_it_ends()
        assert said["state"] == "ended"
        assert not kiosk.widget("jog")["enabled"]
        before = columns(kiosk)[-1]
        way.link.start()
        permit(kiosk, way.node, True)
        moved = len(way.node.heard(TOPIC))
        until(lambda: columns(kiosk)[-1] != before, "the trend goes on")
        until(lambda: ask(eye)["bytes"] == PNG, "the camera goes on")
        assert len(way.node.heard(TOPIC)) == moved  # nothing of the hold is sent again
    until(lambda: files(tmp_path), "the recording is finished")
    by_topic = records(files(tmp_path)[0])
    assert {"/speed", "/web_ui/presses"} <= by_topic.keys()


def test_the_story_of_a_lost_link_leads_to_its_recording(
    way: Way, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    panel = tmp_path / "panel.toml"
    panel.write_text(JOG + MORE + STATE + record(1))
    kiosk = servers(live(way.link.endpoint, tmp_path, KIOSK_PANEL=str(panel)))
    for topic, type_name in (("/operation_enabled", "std_msgs/msg/Bool"), ("/speed", SPEED)):
        way.node.advertise(topic, type_name)
    way.node.every("/speed", {"data": 1.5}, 0.1)
    permit(kiosk, way.node, True)
    until(lambda: readings(kiosk) > 0, "the trend has values")
    way.link.kill()

    def told() -> dict[str, Any] | None:
        keys = re.findall(r'href="/stops/(link-[0-9]+)"', kiosk.http.get("/stops").text)
        stories = (story(kiosk, key) for key in keys)
        return next((each for each in stories if each["recording"]), None)

    lost = dict(until(told, "the lost link is recorded", within_s=60))
    assert lost["stop"]["sort"] == "link"
    content = kiosk.http.get(lost["recording"]["path"]).content
    topics = {channel.topic for _, channel, _ in make_reader(BytesIO(content)).iter_messages()}
    assert "/speed" in topics


def test_an_alarm_that_ends_during_a_cut_is_ended_by_the_next_list(
    way: Way, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    panel = tmp_path / "panel.toml"
    panel.write_text(FAULTS)
    kiosk = servers(live(way.link.endpoint, tmp_path, KIOSK_PANEL=str(panel)))
    until(kiosk.ready, "ready")

    def states() -> dict[str, str]:
        return {a["id"]: a["state"] for a in kiosk.http.get("/alarms").json()["alarms"]}

    way.node.advertise("/faults", ARRAY)
    hot, belt = ({"level": 2, "name": name, "message": "Hot"} for name in ("E1", "E2"))
    publish_until(way.node, "/faults", {"status": [hot, belt]}, lambda: len(states()) == 2)
    assert not kiosk.widget("go")["enabled"]
    way.link.kill()
    until(lambda: set(states().values()) == {"unknown"}, "neither is known")
    way.link.start()
    publish_until(way.node, "/faults", {"status": []}, lambda: "unknown" not in states().values())
    assert set(states().values()) == {"returned"}
    until(lambda: kiosk.widget("go")["enabled"], "nothing inhibits it")

"""Cameras: rclpy nodes, the real bridge, Chromium. Each browser gets as many pictures as it takes."""

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import zenoh
from playwright.sync_api import Page, expect
from websockets.sync.client import ClientConnection, connect

from app.tools.simulator.known_types import SIZE, grey_pixels, png
from tests.support.browser.pages import HIDE, widget
from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import live_server

pytestmark = pytest.mark.long("detail")

PANEL = """
title = "Robot cell 1"

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "packed"
kind = "camera"
label = "Packed"
topic = "/test_packed"

[[page.widget]]
id = "raw"
kind = "camera"
label = "Raw"
topic = "/test_raw"
type = "sensor_msgs/msg/Image"
max_bytes = 50000

[[page]]
id = "two"
title = "Two"

[[page.widget]]
id = "note"
kind = "label"
label = "Nothing to see"
"""
PACKED, RAW = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"
BEST_EFFORT = {"reliability": "best_effort", "depth": 1}


@pytest.fixture(scope="module")
def kiosk(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    node.advertise("/test_packed", PACKED, **BEST_EFFORT)
    node.every("/test_packed", {"format": "png", "data": [*png(grey_pixels(0, 0))]}, 0.1)
    node.advertise("/test_raw", RAW, **BEST_EFFORT)
    node.every("/test_raw", image("rgb8", 3), 0.1)
    with live_server(bridge, tmp_path_factory.mktemp("cell"), PANEL) as mine:
        yield mine
    for topic in ("/test_packed", "/test_raw"):
        node.withdraw(topic)


def image(encoding: str, size: int, width: int = 20, height: int = 10) -> dict[str, Any]:
    data = [90, 200, 40, 255][:size] * (width * height)
    shape = {"width": width, "height": height, "step": width * size}
    return {**shape, "encoding": encoding, "data": data}


@contextmanager
def looking(kiosk: Server, name: str) -> Iterator[ClientConnection]:
    url = kiosk.url.replace("http", "ws")
    with connect(f"{url}/widgets/{name}/frames", proxy=None, max_size=None) as socket:
        yield socket


@pytest.fixture(scope="module")
def session(bridge: Bridge) -> Iterator[zenoh.Session]:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([bridge.endpoint]))
    with zenoh.open(config) as opened:
        yield opened


def is_read(session: zenoh.Session, topic: str) -> bool:
    """Whether the bridge has a DDS reader of a topic."""
    replies = session.get(f"@/*/ros2/route/topic/pub{topic}")
    routes = [json.loads(reply.ok.payload.to_string()) for reply in replies if reply.ok]
    return any(route["dds_reader"] for route in routes)


def ask(socket: ClientConnection) -> dict[str, Any]:
    socket.send('{"next": true}')
    about: dict[str, Any] = json.loads(socket.recv(30))
    about["bytes"] = socket.recv(30)
    return about


@pytest.mark.long(None)
def test_both_kinds_of_pictures_are_drawn(kiosk: Server, page: Page) -> None:
    page.goto(kiosk.url)
    for name, size in (("packed", list(SIZE)), ("raw", [20, 10])):
        expect(widget(page, name)).to_have_attribute("data-state", "live", timeout=20_000)
        canvas = widget(page, name).locator("canvas")
        expect(canvas).to_have_attribute("width", str(size[0]), timeout=20_000)
        expect(canvas).to_have_attribute("height", str(size[1]))
        expect(widget(page, name).locator(".sign")).to_be_hidden()
    pixel = "(c) => [...c.getContext('2d').getImageData(2, 2, 1, 1).data]"
    nearly_green = pytest.approx([90, 200, 40, 255], abs=3)  # a JPEG keeps colours nearly
    assert widget(page, "raw").locator("canvas").evaluate(pixel) == nearly_green


def test_a_camera_that_no_page_shows_is_not_subscribed_to(
    kiosk: Server, session: zenoh.Session, page: Page
) -> None:
    """Neither a hidden page nor one without the camera: then the bridge reads nothing of it."""
    page.goto(kiosk.url)
    expect(widget(page, "packed")).to_have_attribute("data-state", "live", timeout=20_000)
    assert is_read(session, "/test_packed")
    page.evaluate(HIDE, True)
    until(lambda: not is_read(session, "/test_packed"), "no node reads it")
    assert kiosk.widget("packed")["state"] == "waiting"
    page.evaluate(HIDE, False)
    expect(widget(page, "packed")).to_have_attribute("data-state", "live", timeout=20_000)
    page.goto(f"{kiosk.url}/pages/two")
    until(lambda: not is_read(session, "/test_packed"), "no node reads it")


@pytest.mark.long(None)
def test_a_slow_browser_gets_the_newest_and_delays_no_other(kiosk: Server) -> None:
    with looking(kiosk, "packed") as slow, looking(kiosk, "packed") as quick:
        first = ask(slow)
        for _ in range(10):
            last = ask(quick)
        assert last["number"] >= first["number"] + 9
        assert last["type"] == "image/png"
        after = ask(slow)
        assert after["number"] >= last["number"]
        with pytest.raises(TimeoutError):
            slow.recv(0.3)  # nothing that was not asked for


def test_the_page_of_diagnostics_has_the_rate_of_a_camera_that_is_looked_at(kiosk: Server) -> None:
    def packed() -> dict[str, Any]:
        topics = kiosk.http.get("/diagnostics").json()["topics"]
        return next(row for row in topics if row["name"] == "/test_packed")

    counted = packed()["count"]
    with looking(kiosk, "packed") as socket, looking(kiosk, "packed") as other:
        first = ask(socket)["number"]
        ask(other)
        last = first
        while last < first + 20:
            last = ask(socket)["number"]
    known = packed()
    assert 20 < known["count"] - counted <= last  # those between that nobody took too, each once
    assert known["size"] > 0
    assert 0 < known["rate_hz"] < 20


@pytest.mark.long(None)
def test_a_picture_that_stays_out_is_old_and_says_so(kiosk: Server, node: RosNode, page: Page) -> None:
    page.goto(kiosk.url)
    expect(widget(page, "packed")).to_have_attribute("data-state", "live", timeout=20_000)
    node.withdraw("/test_packed")
    expect(widget(page, "packed")).to_have_attribute("data-state", "old", timeout=20_000)
    expect(widget(page, "packed").locator(".sign")).to_contain_text(" s old, received ")
    node.advertise("/test_packed", PACKED, **BEST_EFFORT)
    node.every("/test_packed", {"format": "png", "data": [*png(grey_pixels(0, 0))]}, 0.1)
    expect(widget(page, "packed")).to_have_attribute("data-state", "live", timeout=40_000)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        (image("32FC1", 4), "The encoding 32FC1 cannot be shown"),
        (
            image("mono8", 1, 1, 1) | {"step": 2**32 - 1, "height": 2},
            "not a complete sensor_msgs/msg/Image",
        ),
        (
            image("mono8", 1, 5000, 1),
            "The picture has 5000 × 1 pixels; at most 4096 each way are shown",
        ),
        (image("rgb8", 3, 200, 100), "The picture has 600"),
        (image("rgb8", 3) | {"height": 11}, "not a complete sensor_msgs/msg/Image"),
    ],
)
def test_picture_that_cannot_be_shown_says_why(
    kiosk: Server, node: RosNode, page: Page, fields: dict[str, Any], said: str
) -> None:
    node.advertise("/test_raw", RAW, **BEST_EFFORT)
    node.every("/test_raw", fields, 0.1)
    page.goto(kiosk.url)
    expect(widget(page, "raw").locator(".sign")).to_contain_text(said, timeout=40_000)
    node.advertise("/test_raw", RAW, **BEST_EFFORT)
    node.every("/test_raw", image("rgb8", 3), 0.1)
    expect(widget(page, "raw")).to_have_attribute("data-state", "live", timeout=40_000)


def test_without_scripts_the_newest_picture_is_on_the_page(
    kiosk: Server, without_scripts: Page
) -> None:
    without_scripts.goto(kiosk.url)
    picture = widget(without_scripts, "packed").locator("img")
    expect(picture).to_be_visible()
    with without_scripts.expect_response(re.compile("/packed/frame$")) as loaded:
        without_scripts.reload()
    assert loaded.value.headers["content-type"] == "image/png"
    assert loaded.value.headers["x-content-type-options"] == "nosniff"


def test_a_picture_is_for_the_panels_own_pages(kiosk: Server) -> None:
    picture = kiosk.http.get("/widgets/packed/frame")
    assert picture.content == png(grey_pixels(0, 0))
    later = kiosk.http.get("/widgets/packed/frame", params={"after": picture.headers["x-frame"]})
    assert int(later.headers["x-frame"]) > int(picture.headers["x-frame"])
    other = kiosk.http.get("/widgets/packed/frame", headers={"Sec-Fetch-Site": "cross-site"})
    assert other.status_code == 403
    assert kiosk.http.get("/widgets/note/frame").status_code == 404

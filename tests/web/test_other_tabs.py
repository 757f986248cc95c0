"""Streams and sockets of a browser's other tabs, when somebody signs in or out in one."""

from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from websockets.sync.client import connect

from tests.support.confirmed import PANEL, add_users
from tests.support.parts import ENOUGH_S, PressSocket, Server, Stream, until
from tests.support.servers import demo_server
from tests.support.users import Browsers

CAMERA = """
[[page.group.widget]]
id = "view"
kind = "camera"
label = "Camera"
topic = "/camera"
type = "sensor_msgs/msg/CompressedImage"
"""
SATO: dict[str, Any] = {"user": "M. Sato", "pin": "2580"}


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_users(data)
    panel = PANEL.replace("[demo.", f"{CAMERA}\n[demo.", 1)
    with demo_server(tmp_path_factory.mktemp("panel"), panel, KIOSK_DATA=str(data)) as mine:
        until(lambda: mine.snapshot()["interlocks"]["operation"]["enabled"], "the robot permits")
        yield mine


def started(stream: Stream) -> bool:
    """Whether "Heat up" can be pressed by the next snapshot of a stream."""
    enabled: bool = stream.next("snapshot")[1]["widgets"]["start"]["enabled"]
    return enabled


def test_a_sign_in_ends_the_streams_of_other_tabs_which_begin_again_with_it(
    browsers: Browsers, kiosk: Server
) -> None:
    tab = browsers.opened(kiosk.url)
    with tab.stream("GET", "/events", timeout=ENOUGH_S) as response:
        stream = Stream(response)
        assert not started(stream)
        tab.post("/session", json=SATO).raise_for_status()
        with pytest.raises(StopIteration):
            stream.next("no event has this name")
    with tab.stream("GET", "/events", timeout=ENOUGH_S) as response:
        assert started(Stream(response))


def test_a_sign_out_locks_the_other_tabs_at_once(browsers: Browsers, kiosk: Server) -> None:
    tab = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    with tab.stream("GET", "/events", timeout=ENOUGH_S) as response:
        stream = Stream(response)
        assert started(stream)
        tab.delete("/session").raise_for_status()
        while (change := stream.next("update")[1].get("start")) is None or change.get("enabled"):
            pass
        assert change["reason"] == "Sign in as Operator."


@pytest.mark.parametrize("end", ["sign out", "hand over"])
def test_a_camera_is_no_longer_sent_to_a_session_that_has_ended(
    browsers: Browsers, kiosk: Server, end: str
) -> None:
    tab = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    with connect(camera(kiosk), additional_headers=cookies(tab), open_timeout=ENOUGH_S) as socket:
        socket.send('{"next": true}')
        socket.recv(ENOUGH_S)
        if end == "sign out":
            tab.delete("/session").raise_for_status()
        else:
            tab.post("/session", json={"user": "J. Brandt", "pin": "3691"}).raise_for_status()
        assert PressSocket(socket).closed() == 4403


def camera(server: Server) -> str:
    return f"ws://127.0.0.1:{server.port}/widgets/view/frames"


def cookies(client: httpx.Client) -> dict[str, str]:
    return {"cookie": "; ".join(f"{name}={value}" for name, value in client.cookies.items())}

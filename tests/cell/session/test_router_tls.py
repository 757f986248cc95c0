"""The real router over TLS, with what `operator-panel pki` and `router-config --tls` write. The robot
is on hiroz."""

import asyncio
import json
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import zenoh

from app.cell.session.fleet import Fleet
from app.panel import load_panel
from app.records import NullLog
from app.ros.zenoh.config import config_from
from app.tools.cli.command import main
from tests.cell.session.test_rmw_zenoh import enabled
from tests.cell.session.test_router_config import ATTACHMENT, PANEL, TEXT, TOLD_OF_ALL
from tests.support.builders import press_widget
from tests.support.certificates import tls_session
from tests.support.parts import Process, free_port, until
from tests.support.rmw import Router, configured_router
from tests.support.waiting import when

pytestmark = pytest.mark.promise("neighbours")


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    path = tmp_path / "cell1.toml"
    path.write_text(PANEL)
    return path


@pytest.fixture
def door() -> str:
    return f"tls/127.0.0.1:{free_port()}"


@pytest.fixture
def router(zenohd: None, panel: Path, door: str, tmp_path: Path) -> Iterator[Router]:
    """It tells everyone of all subscribers, so that a stranger tries."""
    file, folder = tmp_path / "router.json5", tmp_path / "pki"
    assert main(["pki", "new", str(folder), "--panel", str(panel), "--connect", door]) == 0
    assert main(["pki", "add", str(folder), "other", "--client"]) == 0
    mine = configured_router(panel, file, door, "--tls", str(folder))
    config = zenoh.Config.from_file(file)
    access = json.loads(config.get_json("access_control"))
    access["rules"].append(TOLD_OF_ALL)
    access["subjects"].append({"id": "everyone"})
    access["policies"].append({"rules": ["told"], "subjects": ["everyone"]})
    config.insert_json5("access_control", json.dumps(access))
    file.write_text(str(config))
    mine.start()
    yield mine
    mine.end()


def test_the_panel_works_over_tls(hiroz: Path, router: Router, panel: Path, tmp_path: Path) -> None:
    robot = Process([str(hiroz), router.endpoint], {})

    async def scene() -> None:
        config = config_from(tmp_path / "pki/zenoh.json5")
        fleet = Fleet(load_panel(panel), lambda _: config, "r1", NullLog())
        await fleet.start()
        try:
            for name in ("say", "add", "count", "speed"):
                await when(partial(enabled, fleet.first, name), f"{name} is open")
            presses = fleet.first.presses
            said = await press_widget(presses, "say", {"message": "hi"}, "say")
            added = await press_widget(presses, "add", {}, "add")
            assert (said.outcome, added.outcome) == ("published", "succeeded")
            await when(lambda: "heard hi" in robot.text, "the robot has it")
        finally:
            await fleet.stop()

    try:
        until(lambda: "running" in robot.text or not robot.running, "it runs")
        asyncio.run(scene())
    finally:
        robot.kill()


def test_who_has_no_certificate_does_not_get_in(router: Router, door: str, tmp_path: Path) -> None:
    with pytest.raises(zenoh.ZError):
        tls_session(door, tmp_path / "pki").close()
    with closing(tls_session(door, tmp_path / "pki", "kiosk")) as mine:
        assert list(mine.info.routers_zid()) != []


def test_another_certificate_forges_neither_a_permission_nor_a_press(
    router: Router, door: str, tmp_path: Path
) -> None:
    """In the order of the wire: what the panel's own session sends last arrives, and nothing before."""
    folder = tmp_path / "pki"
    nodes = tls_session(router.endpoint, folder)
    permission, command = "0/operation_enabled/std_msgs::msg::dds_::Bool_/H", f"0/operation/{TEXT}/H"
    received: list[tuple[str, bytes]] = []
    heard: list[str] = []

    def hear(sample: zenoh.Sample) -> None:
        heard.append(str(sample.key_expr))

    def receive(sample: zenoh.Sample) -> None:
        received.append((str(sample.key_expr), sample.payload.to_bytes()))

    held = [nodes.declare_subscriber(key, receive) for key in (permission, command)]
    try:
        with closing(tls_session(door, folder, "other")) as other:
            read = other.declare_subscriber("**", hear, allowed_origin=zenoh.Locality.REMOTE)
            put(other, permission, b"other")
            put(other, command, b"other")
            nodes.put("0/secret/std_msgs::msg::dds_::String_/H", b"x")
            nodes.put(f"0/last_heard/{TEXT}/H", b"x")
            del read
        with closing(tls_session(door, folder, "kiosk")) as mine:
            put(mine, permission, b"kiosk")
            put(mine, command, b"kiosk")
            until(lambda: received, "what the panel may send arrives")
        assert received == [(command, b"kiosk")]
        assert heard == []
    finally:
        del held
        nodes.close()


def put(session: zenoh.Session, key: str, payload: bytes) -> None:
    """Puts when the session knows of a subscriber: else Zenoh would not send it."""
    publisher: Any = session.declare_publisher(key)
    until(lambda: publisher.matching_status.matching, "it sees a subscriber")
    publisher.put(payload, attachment=ATTACHMENT)

"""The three links as an operator sees them when a part breaks: real bridge, node, server, Chromium."""

import re
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from app.web.pages.display_choice import FONTS
from tests.support.browser.pages import place
from tests.support.parts import ENOUGH_S, REFERENCE, Bridge, RosNode, Server, live, until
from tests.support.servers import ready

pytestmark = pytest.mark.long("detail")

Keep = Callable[[Server], Server]

MOMENT = re.compile(r"^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d$")
CLOCK = re.compile(r"^\d\d:\d\d:\d\d$")
SINCE = re.compile(f"{MOMENT.pattern}|{CLOCK.pattern}")
AGE_S = 1.5
AGED = f"max_age_s = {AGE_S}"
DDS_LEASE_S = 20  # after which a killed node is no longer thought to be there
SIZES = [(1280, 800), (1024, 600)]


def first_page(folder: Path, rule: str = "") -> str:
    """The reference system's panel, which needs only its node; `rule` is a further key of its
    interlock."""
    path = folder / "first.toml"
    path.write_text(REFERENCE.read_text().replace("[[interlock]]\n", f"[[interlock]]\n{rule}\n"))
    return str(path)


def speaking(node: RosNode) -> None:
    node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    node.every("/operation_enabled", {"data": True}, AGE_S / 5)


def opened(page: Page, server: Server) -> Page:
    page.goto(server.url)
    page.locator(".lamps").click()
    expect(page.locator("#links")).to_be_visible()
    return page


def said(page: Page, link: str, text: str) -> Locator:
    return page.locator(f'[data-link="{link}"] [data-text="{text}"]')


def row(page: Page, link: str) -> Locator:
    return page.locator(f'[data-link="{link}"]')


def lamp(page: Page, link: str) -> Locator:
    return page.locator(f'[data-lamp="{link}"]')


@pytest.mark.long(None)
def test_killed_bridge_is_shown_with_the_controls_that_it_locks(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Keep, page: Page
) -> None:
    speaking(own_node)
    kiosk = servers(ready(live(own_bridge.endpoint, tmp_path, KIOSK_PANEL=first_page(tmp_path))))
    opened(page, kiosk)
    for link in ("server", "bridge", "node"):
        expect(row(page, link)).to_have_attribute("data-state", "ok")
        expect(said(page, link, "locks")).to_have_text("Locks nothing.")
        expect(said(page, link, "reason")).to_have_text("")
        # A page that lost its server for a moment shows since when it has it again.
        expect(said(page, link, "since")).to_have_text(SINCE if link == "server" else MOMENT)
    joined_at = said(page, "bridge", "since").text_content() or ""
    until(lambda: time.strftime("%Y-%m-%d %H:%M:%S") > joined_at, "the next state's second is another")
    own_bridge.kill()
    expect(said(page, "bridge", "locks")).to_have_text("Locks Publish, Publish1, Publish2.")
    expect(said(page, "bridge", "reason")).to_contain_text(
        f"bridge cannot be reached at {own_bridge.endpoint}."
    )
    expect(said(page, "bridge", "since")).not_to_have_text(joined_at)
    expect(said(page, "bridge", "since")).to_have_text(MOMENT)
    expect(said(page, "node", "text")).to_have_text("no connection")
    expect(said(page, "node", "locks")).to_have_text("Locks nothing.")
    expect(row(page, "server")).to_have_attribute("data-state", "ok")
    expect(lamp(page, "bridge")).to_have_attribute("data-state", "bad")
    own_bridge.start()
    expect(said(page, "bridge", "locks")).to_have_text("Locks nothing.")
    expect(said(page, "node", "locks")).to_have_text("Locks nothing.")


def test_hung_node_is_silent_and_killed_node_is_lost(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Keep, page: Page
) -> None:
    speaking(own_node)
    panel = first_page(tmp_path, AGED)
    kiosk = servers(ready(live(own_bridge.endpoint, tmp_path, KIOSK_PANEL=panel)))
    opened(page, kiosk)
    expect(said(page, "node", "text")).to_have_text("ok")
    expect(said(page, "node", "locks")).to_have_text("Locks nothing.")
    own_node.freeze()
    expect(said(page, "node", "text")).to_have_text("silent")
    expect(said(page, "node", "locks")).to_have_text("Locks Publish1, Publish2.")
    expect(said(page, "node", "reason")).to_contain_text("No new data on operation for 1.5 s")
    expect(said(page, "node", "since")).to_have_text(MOMENT)
    expect(said(page, "bridge", "locks")).to_have_text("Locks nothing.")
    expect(lamp(page, "node")).to_have_attribute("data-state", "bad")
    own_node.thaw()
    expect(said(page, "node", "text")).to_have_text("ok")
    expect(said(page, "node", "reason")).to_have_text("")
    own_node.kill()
    expect(said(page, "node", "text")).to_have_text("silent")
    expect(said(page, "node", "text")).to_have_text(
        "no node found", timeout=1000 * (DDS_LEASE_S + ENOUGH_S)
    )
    expect(said(page, "node", "reason")).to_contain_text(
        "has disappeared, though the bridge is running"
    )
    expect(row(page, "bridge")).to_have_attribute("data-state", "ok")


def test_a_frozen_server_is_lost_since_its_last_heartbeat(
    bridge: Bridge, node: RosNode, tmp_path: Path, page: Page
) -> None:
    mine = ready(live(bridge.endpoint, tmp_path))
    try:
        opened(page, mine)
        expect(said(page, "bridge", "text")).to_have_text("ok")
        mine.process.send(signal.SIGSTOP)
        expect(said(page, "server", "text")).to_have_text("no connection")
        last_beat = page.locator("#clock").text_content() or ""
        assert CLOCK.match(last_beat)
        expect(said(page, "server", "since")).to_have_text(last_beat)
        expect(said(page, "server", "locks")).to_have_text("Locks every control.")
        expect(said(page, "server", "reason")).to_have_text("No connection to the panel server.")
        for link in ("bridge", "node"):
            expect(said(page, link, "text")).to_have_text("unknown")
            for text in ("since", "locks", "reason"):
                expect(said(page, link, text)).to_have_text("")
        until(lambda: time.strftime("%H:%M:%S") != last_beat, "the next beat's second is another")
        mine.process.send(signal.SIGCONT)
        expect(said(page, "server", "text")).to_have_text("ok")
        expect(said(page, "server", "since")).not_to_have_text(last_beat)
        expect(said(page, "server", "since")).to_have_text(CLOCK)
        expect(said(page, "server", "locks")).to_have_text("Locks nothing.")
        expect(said(page, "bridge", "since")).to_have_text(MOMENT)
    finally:
        mine.process.send(signal.SIGCONT)
        mine.end()


@pytest.mark.parametrize("scripts", [True, False])
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_links_open_under_a_finger_and_move_nothing(
    server: Server, chromium: Browser, scripts: bool, width: int, height: int
) -> None:
    context = chromium.new_context(
        java_script_enabled=scripts, viewport={"width": width, "height": height}
    )
    context.add_cookies([{"name": FONTS[0], "value": FONTS[1], "url": server.url}])
    page = context.new_page()
    page.goto(server.url)
    expect(page.locator("#links")).to_be_hidden()
    if scripts:
        page.evaluate("document.fonts.ready")
    else:
        page.wait_for_load_state("networkidle")
    lamps = place(page.locator(".lamps"))
    assert lamps["height"] >= 44
    assert lamps["width"] * 0.22 >= 20
    publish = page.get_by_role("button", name="Publish", exact=True)
    before = publish.bounding_box()
    page.locator(".lamps").click()
    expect(page.locator("#links")).to_be_visible()
    expect(said(page, "bridge", "locks")).to_be_visible()
    assert page.locator(".lamps").bounding_box() == lamps
    assert publish.bounding_box() == before
    page.locator(".lamps").click()
    expect(page.locator("#links")).to_be_hidden()
    context.close()

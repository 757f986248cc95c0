"""A panel of one's own for a live rclpy robot over the real bridge: a lamp, a locked button and an
alarm by drops, saved and served, and a press that arrives at the node."""

import tomllib
from pathlib import Path
from typing import Final

from playwright.sync_api import Browser, FloatRect, Locator, expect

from tests.browser.editor.hands import Hands
from tests.support.browser.browsers import opened
from tests.support.editor import box_of, editing, middle, preview
from tests.support.parts import Bridge, RosNode, until, zenoh_file
from tests.support.processes import command
from tests.support.processes.command import COMMAND
from tests.support.servers import live_server

OPEN: Final = "/tool/open"
TOPICS: Final = ("/tool/ready", "/tool/guard_locked")


def test_a_panel_is_made_from_a_live_robot(
    chromium: Browser, bridge: Bridge, node: RosNode, tmp_path: Path
) -> None:
    node.subscribe(OPEN, "std_msgs/msg/Empty")
    for topic in TOPICS:
        node.advertise(topic, "std_msgs/msg/Bool")
        node.every(topic, {"data": True}, 0.2)
    zenoh = str(zenoh_file(tmp_path, bridge.endpoint))
    try:
        with (
            editing(tmp_path, "", "--live", KIOSK_ZENOH=zenoh) as editor,
            opened(chromium, locale="en") as context,
        ):
            page = context.new_page()
            page.set_viewport_size({"width": 1440, "height": 900})
            page.goto(editor.address)
            expect(preview(page).locator("main")).to_be_attached()
            make(Hands(page, editor))
        saved = tomllib.loads(editor.file.read_text())
        lamp, button = saved["page"][0]["widget"]
        assert (lamp["kind"], lamp["topic"]) == ("indicator", "/tool/ready")
        assert (button["kind"], button["topic"]) == ("publish", OPEN)
        assert [lock["id"] for lock in saved["interlock"]] == [button["interlock"]]
        assert [alarm["when"]["topic"] for alarm in saved["alarm"]] == ["/tool/ready"]
        checked = command.run(COMMAND, "check", str(editor.file))
        assert checked.returncode == 0, checked.stderr
        with (
            live_server(bridge, tmp_path, editor.file.read_text()) as kiosk,
            opened(chromium, locale="en") as context,
        ):
            page = context.new_page()
            page.goto(kiosk.url)
            key = page.locator(f"#at-{button['id']} button[type=submit]").first
            expect(page.locator(f"#at-{lamp['id']}")).to_contain_text(lamp["states"][0]["text"])
            # What is sent before the node has discovered the bridge's writer never arrives.
            until(lambda: presses(key) and node.heard(OPEN), "a press arrives", every_s=0.5)
            for topic in TOPICS:
                node.withdraw(topic)
                node.advertise(topic, "std_msgs/msg/Bool")
                node.every(topic, {"data": False}, 0.2)
            expect(key).to_be_disabled()
            expect(page.locator("body")).to_contain_text(saved["alarm"][0]["text"])
    finally:
        for topic in TOPICS:
            node.withdraw(topic)


def presses(key: Locator) -> bool:
    key.click()
    return True


def below(box: FloatRect) -> tuple[float, float]:
    return box["x"] + box["width"] / 2, box["y"] + box["height"] * 0.9


def make(hands: Hands) -> None:
    page = hands.page
    ready = hands.line("robot", "/tool/ready")
    expect(ready.locator(".value")).to_have_text("true")
    hands.drop(ready, *middle(box_of(page, "main")))  # on a page with nothing on it
    hands.pick("Lamp")
    hands.added(("page", 0, "widget", 0))
    lamp = hands.at(("page", 0, "widget", 0))["id"]
    expect(preview(page).locator(f"#at-{lamp}")).to_be_visible()
    hands.drop(hands.line("robot", OPEN), *below(box_of(page, f"#at-{lamp}")))
    hands.pick("Topic button")
    hands.added(("page", 0, "widget", 1))
    button = hands.at(("page", 0, "widget", 1))["id"]
    hands.drop(hands.line("robot", "/tool/guard_locked"), *middle(box_of(page, f"#at-{button}")))
    hands.pick("Interlock")
    hands.added(("interlock", 0))
    hands.drop(hands.line("robot", "/tool/ready"), *middle(box_of(page, f"#at-{lamp}")))
    hands.pick("Alarm")
    hands.added(("alarm", 0))
    page.keyboard.press("Control+s")
    expect(page.locator("#status")).to_have_text("Saved")

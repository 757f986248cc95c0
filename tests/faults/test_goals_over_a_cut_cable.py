"""A goal that is touched on the map, and a cable that is pulled before Send: it is refused, and does
not arrive when the cable is plugged in again. In the half second before the cut is noticed, its result
is unknown."""

import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Page, expect, sync_playwright

from tests.bridge.test_goals_on_bridge import GOALS, publish_map, publish_pose
from tests.bridge.test_map_on_bridge import GRID, PANEL, POSE, WITH_TOPIC
from tests.browser.test_places_in_browser import card, receipt, send, touch_and_drag
from tests.faults import fixtures
from tests.faults.net import ROBOT_IP, Cable
from tests.faults.rig import kiosk
from tests.support.browser.browsers import opened
from tests.support.browser.pages import DRAWN, widget
from tests.support.parts import CHROMIUM_FLAGS, HEADLESS, Bridge, RosNode, Server, until

pytestmark = pytest.mark.promise("places")

cable = fixtures.cable

NOT_SENT: Final = re.compile("refused|unknown")


class Robot:
    """A bridge and a node at the far end of a cable: a map, a pose each 0.1 s, and who hears goals."""

    def __init__(self, domain: int) -> None:
        self.bridge = Bridge(domain)
        self.bridge.endpoint = f"tcp/{ROBOT_IP}:{self.bridge.port}"
        self.bridge.start()
        self.node = RosNode(domain, "navigator")
        self.node.subscribe("/goal_pose", POSE, depth=100)
        self.node.advertise("/map", GRID, durability="transient_local", depth=1)
        self.node.advertise("/pose", POSE)
        publish_map(self.node)
        publish_pose(self.node)

    def goals(self) -> int:
        return len(self.node.heard("/goal_pose"))

    def end(self) -> None:
        self.node.end()
        self.bridge.end()


@pytest.fixture
def robot(domain: int, cable: Cable) -> Iterator[Robot]:
    with cable.robot.inside():
        mine = Robot(domain + 3)
    yield mine
    mine.end()


@contextmanager
def own_browser(url: str) -> Iterator[Page]:
    """A page in a browser at this end of the cable."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=HEADLESS, args=CHROMIUM_FLAGS)
        page = opened(browser, has_touch=True).new_page()
        page.goto(url)
        yield page
        browser.close()


def test_a_goal_pressed_over_a_pulled_cable_is_refused_and_never_arrives(
    cable: Cable, robot: Robot, chromium: Browser, tmp_path: Path
) -> None:
    panel = PANEL.replace("max_age_s = 1.0", "max_age_s = 60.0") + WITH_TOPIC + GOALS
    with kiosk(robot.bridge.endpoint, tmp_path, panel=panel) as server, ThreadPoolExecutor(1) as pool:
        until(server.ready, "ready")
        # In a thread: that of the tests may have another browser, outside of the namespace.
        pool.submit(_scene, cable, robot, server).result()


def _scene(cable: Cable, robot: Robot, server: Server) -> None:
    with own_browser(server.url) as page:
        until(lambda: _is_permitted(robot, server), "a goal is permitted")
        _choose(page)
        cable.cut()
        button = widget(page, "drive").locator("button[type=submit]")
        expect(button).to_be_disabled()
        button.tap(force=True)
        assert _press(server)["outcome"] == "refused"  # of another client
        until(lambda: "No connection" in server.widget("drive")["reason"], "the link is lost")
        assert _press(server)["outcome"] == "refused"
        cable.restore()
        until(lambda: _is_permitted(robot, server), "the cable is plugged in again")
        assert robot.goals() == 0
        expect(card(page)).to_be_visible()  # what was chosen is still there, and is sent by a new press
        send(page)
        until(lambda: robot.goals() > 0, "the goal arrives")
        page.reload()
        _choose(page)
        cable.cut()
        send(page)  # sooner than anyone can notice: the server does not say that it was sent
        expect(receipt(page)).to_have_attribute("data-outcome", NOT_SENT)
        assert robot.goals() == 1
        cable.restore()


def _is_permitted(robot: Robot, server: Server) -> bool:
    publish_pose(robot.node)
    return bool(server.widget("drive")["enabled"])


def _choose(page: Page) -> None:
    """Touches the map; the card shows the pose."""
    expect(widget(page, "hall")).to_have_attribute("data-version", re.compile(".+"))
    expect(page.locator(".map-goal")).to_be_attached()  # the map takes touches
    expect(widget(page, "drive").locator("button[type=submit]")).to_be_enabled()
    page.evaluate(DRAWN)
    touch_and_drag(page, 0.5, 0.5)
    expect(card(page)).to_be_visible()
    expect(card(page).locator(".refusal")).to_be_empty()


def _press(server: Server) -> Any:
    """The receipt of a press of another client."""
    value = f"x=1.25 y=0.75 yaw=0.00 map={server.widget('hall')['grid']['version']}"
    return server.http.post("/widgets/drive", json={"inputs": {"goal": value}}).json()

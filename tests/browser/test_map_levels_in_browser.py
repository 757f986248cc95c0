"""The levels of a building as operators use them: by fingers, by keys, and what follows the robot."""

from collections.abc import Iterator
from typing import Any, Final

import pytest
from playwright.sync_api import Page, expect

from tests.browser.test_accessibility import violations
from tests.support.browser.pages import DRAWN, place, widget
from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("places")

PANEL: Final = """
title = "Shuttle"
language = "en"
[[place]]
id = "dock"
label = "Dock"
level = "ground"
x = 2.0
y = 1.5
[[place]]
id = "attic"
label = "Attic"
level = "upper"
x = 2.0
y = 1.5
[[zone]]
id = "hole"
label = "Hole"
kind = "keep_out"
level = "upper"
points = [[-2.0, -1.0], [-1.0, -1.0], [-1.0, 0.0], [-2.0, 0.0]]
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "hall"
kind = "map"
label = "Building"
span = 8
robot_level = { topic = "/level", type = "std_msgs/msg/String" }
level = [
  { id = "ground", label = "Ground floor", topic = "/ground/map" },
  { id = "upper", label = "Upper floor", topic = "/upper/map" },
]
layer = [{ shows = "path", topic = "/plan" }]
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
message = { header = { frame_id = "{goal.frame}" }, pose = "{goal.pose}" }
[[page.widget]]
id = "up"
kind = "publish"
label = "Lift up"
topic = "/level"
type = "std_msgs/msg/String"
message = { data = "upper" }
[[page.widget]]
id = "down"
kind = "publish"
label = "Lift down"
topic = "/level"
type = "std_msgs/msg/String"
message = { data = "ground" }
[demo."/level"]
values = ["ground"]
"""


@pytest.fixture(scope="module")
def building(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("building"), PANEL) as server:
        yield server


def robot_on(server: Server, command: str, level: str) -> dict[str, str]:
    """The robot takes the lift; the versions of the maps by level."""
    server.http.post(f"/widgets/{command}", json={"inputs": {}})
    shown = until(
        lambda: (each := server.widget("hall"))["level"] == level and each["grid"] and each,
        "the robot is there",
    )
    versions = {row["id"]: (row["grid"] or {}).get("version", "") for row in shown["levels"]}
    assert all(versions.values())
    return versions


def opened(page: Page, server: Server, version: str) -> Any:
    page.goto(server.url)
    hall = widget(page, "hall")
    expect(hall).to_have_attribute("data-version", version)
    page.evaluate(DRAWN)
    return hall


def test_a_finger_looks_at_another_level_and_gives_it_back(building: Server, touchscreen: Page) -> None:
    versions = robot_on(building, "down", "ground")
    page = touchscreen
    hall = opened(page, building, versions["ground"])
    key = hall.get_by_role("button", name="Levels")
    expect(key).to_have_text("Ground floor")
    expect(hall.locator(".map-robot")).to_be_visible()
    expect(page.locator(".map-places > g:not([hidden]) text")).to_have_text(["Dock"])
    key.tap()
    upper = hall.get_by_role("group", name="Levels").get_by_role("button", name="Upper floor")
    assert place(upper)["height"] >= 44
    assert violations(page) == []
    upper.tap()
    expect(hall).to_have_attribute("data-version", versions["upper"])
    expect(key).to_have_text("Upper floorchosen by hand")
    expect(hall.locator(".map-robot")).to_be_hidden()
    expect(hall.locator(".map-shapes")).to_be_hidden()
    expect(hall.locator(".map-level-note")).to_have_text("The robot is on another level: Ground floor")
    expect(page.locator(".map-places > g:not([hidden]) text")).to_have_text(["Attic"])
    expect(hall.locator(".map-zones text")).to_have_text("Hole")
    assert violations(page) == []
    key.tap()
    hall.get_by_role("button", name="Level of the robot").tap()
    expect(hall).to_have_attribute("data-version", versions["ground"])
    expect(key).to_have_text("Ground floor")
    expect(hall.locator(".map-level-note")).to_have_text("")
    expect(hall.locator(".map-robot")).to_be_visible()


def test_the_map_follows_the_robot_but_not_from_a_level_chosen_by_hand(
    building: Server, page: Page
) -> None:
    versions = robot_on(building, "down", "ground")
    hall = opened(page, building, versions["ground"])
    robot_on(building, "up", "upper")
    expect(hall).to_have_attribute("data-version", versions["upper"])
    key = hall.get_by_role("button", name="Levels")
    key.focus()
    page.keyboard.press("Enter")
    expect(key).to_have_attribute("aria-expanded", "true")
    page.keyboard.press("Tab")
    expect(hall.get_by_role("button", name="Level of the robot")).to_be_focused()
    page.keyboard.press("Escape")
    expect(key).to_be_focused()
    page.keyboard.press("Enter")
    expect(key).to_have_attribute("aria-expanded", "true")
    for _ in range(2):
        page.keyboard.press("Tab")
    expect(hall.get_by_role("button", name="Upper floor")).to_be_focused()
    page.keyboard.press("Space")  # the robot's own level, by hand
    expect(key).to_have_text("Upper floorchosen by hand")
    expect(hall.locator(".map-robot")).to_be_visible()
    robot_on(building, "down", "ground")
    expect(hall.locator(".map-level-note")).to_have_text("The robot is on another level: Ground floor")
    expect(hall).to_have_attribute("data-version", versions["upper"])
    page.reload()
    expect(hall).to_have_attribute("data-version", versions["ground"])


def test_a_goal_that_is_touched_on_another_level_is_refused_with_the_reason(
    building: Server, page: Page
) -> None:
    versions = robot_on(building, "down", "ground")
    hall = opened(page, building, versions["ground"])
    hall.get_by_role("button", name="Levels").click()
    hall.get_by_role("button", name="Upper floor").click()
    expect(hall).to_have_attribute("data-version", versions["upper"])
    page.evaluate(DRAWN)
    view = place(page.locator(".map-view"))
    page.mouse.click(view["x"] + 0.6 * view["width"], view["y"] + 0.35 * view["height"])
    card = widget(page, "goal").locator(".place-card")
    expect(card.locator(".refusal")).to_have_text(
        "This is on Upper floor. The robot is on Ground floor."
    )
    expect(hall.locator(".map-goal")).to_be_visible()
    widget(page, "drive").locator("button[type=submit]").click()
    receipt = widget(page, "drive").locator(".receipt")
    expect(receipt).to_have_attribute("data-outcome", "refused")
    expect(receipt).to_contain_text("The robot is on Ground floor")
    robot_on(building, "up", "upper")
    expect(card.locator(".refusal")).to_have_text("")

"""Masks of Nav2's filters on a map: drawn, named in the list of layers, and obeyed by goals."""

import shutil
from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from tests.support.browser.pages import DRAWN, place, widget
from tests.support.parts import ROOT, Server, until
from tests.support.servers import demo_server
from tests.web.test_places import PANEL

pytestmark = pytest.mark.promise("places")

MASKS: Final = """label = "Hall"
layer = [
  { shows = "keep_out", topic = "/keepout_mask", info = "/keepout_info" },
  { shows = "speed", topic = "/speed_mask", info = "/speed_info", label = "Slow" },
]
"""
RESTS: Final = '[demo."/speed_mask"]\nsilent = true\n'
CLOSED: Final = "The robot may not enter Keep-out mask. Choose a place outside it."


@pytest.fixture(scope="module")
def masked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("masked")
    shutil.copytree(ROOT / "docs/examples/mobile-robot/interfaces", folder / "interfaces")
    text = PANEL.replace('label = "Hall"\n', MASKS, 1)
    text = text.replace('language = "en"\n', 'language = "en"\ninterfaces = ["interfaces"]\n') + RESTS
    with demo_server(folder, text) as server:
        until(lambda: server.widget("hall")["layer_0"]["state"] == "live", "the mask is there")
        yield server


def test_a_mask_is_drawn_and_a_goal_on_it_is_refused(masked: Server, page: Page) -> None:
    page.goto(masked.url)
    hall = widget(page, "hall")
    expect(hall.locator(".map-costs img")).to_have_count(1)
    expect(hall.locator(".map-note")).to_have_text("Slow: waiting for data")
    hall.get_by_role("button", name="Layers").click()
    row = hall.get_by_role("group", name="Layers").get_by_role("button", name="Keep-out mask")
    expect(row).to_have_attribute("aria-pressed", "true")
    page.keyboard.press("Escape")
    page.evaluate(DRAWN)
    view, tile = place(page.locator(".map-view")), place(hall.locator(".map-costs img"))
    assert tile["x"] >= view["x"]
    # The simulated mask has a table where the map has free floor, from 13 of its 48 columns on.
    x = tile["x"] + tile["width"] * 15 / 48
    y = tile["y"] + tile["height"] * (1 - 15 / 32)
    page.mouse.click(x, y)
    card = widget(page, "goal").locator(".place-card")
    expect(card.locator(".refusal")).to_have_text(CLOSED)
    widget(page, "drive").locator("button[type=submit]").click()
    receipt = widget(page, "drive").locator(".receipt")
    expect(receipt).to_have_attribute("data-outcome", "refused")
    expect(receipt).to_contain_text(CLOSED)
    version = masked.widget("hall")["layer_0"]["grid"]["version"]
    path = f"/widgets/hall/map/{version}"
    assert masked.http.get(f"{path}/0-0.png").status_code == 200
    assert masked.http.get(f"{path}/1-0.png").status_code == 404
    assert masked.http.get(f"{path}0/0-0.png").status_code == 404

"""The sound of alarms: tones by priority, silenced for a time, and a sign where the browser permits
none."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.test_alarm_line import started
from tests.support.parts import CHROMIUM_FLAGS, HEADLESS, Server, until
from tests.web.test_alarms import act, listed, server_with

pytestmark = pytest.mark.long("detail")

SOUND: Final = "\n[alarms]\nsound = true\nsound_priorities = [1, 2]\n"
SILENCE: Final = ".alarm-line .silence"
# The tones that the page plays, by their frequency.
TONES: Final = """
globalThis.tones = [];
const start = OscillatorNode.prototype.start;
OscillatorNode.prototype.start = function (at) {
  if (this.context.state === "running") tones.push(this.frequency.value);
  return start.call(this, at);
};
"""
HIGH, MEDIUM = [988, 784, 988, 784, 988], [659, 659, 659]


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Server]:
    """An alarm of high and one of medium priority are active."""
    with server_with(tmp_path, more=SOUND) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        yield server


@pytest.fixture
def kiosk(chromium: Browser) -> Iterator[Page]:
    """A page that may sound without a touch."""
    launched = chromium.browser_type.launch(
        executable_path=HEADLESS,
        args=[*CHROMIUM_FLAGS, "--autoplay-policy=no-user-gesture-required"],
    )
    page = launched.new_page()
    page.add_init_script(TONES)
    yield page
    launched.close()


def heard(page: Page) -> list[float]:
    return [round(tone) for tone in page.evaluate("tones")]


def test_each_priority_has_its_tones_and_a_page_of_the_same_alarms_is_quiet_at_first(
    cell: Server, kiosk: Page
) -> None:
    started(kiosk, cell.url)
    expect(kiosk.locator(SILENCE)).to_have_attribute("data-state", "on")
    until(lambda: heard(kiosk)[:5] == HIGH, "the high alarm sounds")
    until(lambda: heard(kiosk)[5:10] == HIGH, "it sounds again until it is acknowledged")
    act(cell, "air_latched", "acknowledge", occurrence=1)
    until(lambda: heard(kiosk)[-3:] == MEDIUM, "then the medium one sounds")
    act(cell, "air_low", "acknowledge", occurrence=1)
    expect(kiosk.locator(".alarm-line")).to_have_attribute("data-alarm", "")


def test_a_browser_is_silenced_for_the_chosen_time(cell: Server, kiosk: Page) -> None:
    kiosk.clock.install()
    started(kiosk, cell.url)
    kiosk.locator(SILENCE).click()
    kiosk.locator("#silence button[data-minutes='5']").click()
    expect(kiosk.locator(SILENCE)).to_have_attribute("data-state", "silenced")
    expect(kiosk.locator(f"{SILENCE} .left")).to_have_text("5")
    kiosk.evaluate("tones.length = 0")
    kiosk.clock.fast_forward(60_000)
    assert heard(kiosk) == []
    assert kiosk.locator(SILENCE).get_attribute("data-state") == "silenced"
    kiosk.locator(SILENCE).click()
    kiosk.locator("#silence button[data-minutes='0']").click()
    expect(kiosk.locator(SILENCE)).to_have_attribute("data-state", "on")


def test_a_browser_that_permits_no_sound_says_so_until_a_touch(cell: Server, own_page: Page) -> None:
    own_page.add_init_script(TONES)
    started(own_page, cell.url)
    expect(own_page.locator(SILENCE)).to_have_attribute("data-state", "blocked")
    expect(own_page.locator(f"{SILENCE} .of-blocked")).to_be_visible()
    assert heard(own_page) == []
    own_page.mouse.click(5, 400)
    expect(own_page.locator(SILENCE)).to_have_attribute("data-state", "on")
    until(lambda: heard(own_page)[:5] == HIGH, "the high alarm sounds")


def test_there_is_no_sound_unless_the_panel_asks_for_it(tmp_path: Path, page: Page) -> None:
    with server_with(tmp_path) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        requested: list[Any] = []
        page.on("request", lambda request: requested.append(request.url))
        started(page, server.url)
        assert page.locator(SILENCE).count() == 0
        assert not any(url.endswith("alarm-sound.js") for url in requested)

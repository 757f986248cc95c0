"""The page of alarms: its list follows the events, its acts are forms with a receipt."""

import re
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from tests.browser.test_accessibility import violations
from tests.browser.test_alarm_line import SIZES, started
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN, follow
from tests.support.parts import TAP_AGAIN_MS, Server, until
from tests.support.servers import demo_server
from tests.web.test_alarms import act, listed, server_with

pytestmark = pytest.mark.long("detail")

TABS: Final = """
title = "Cell"
[[page]]
id = "main"
title = "Main"
fit = true
[[page.group]]
title = "Oil"
[[page.group.widget]]
id = "oil"
kind = "readout"
label = "Oil"
topic = "/oil"
type = "std_msgs/msg/Float64"
[[page.group]]
title = "Air"
[[page.group.widget]]
id = "air"
kind = "readout"
label = "Air"
topic = "/air"
type = "std_msgs/msg/Float64"
[demo]
"/air" = { values = [4.5] }
[[alarm]]
id = "air_low"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "Air pressure low"
low = 5.0
"""


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Server]:
    """Both of its alarms are active: `air_latched` of high priority, and `air_low`."""
    with server_with(tmp_path) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        yield server


def ids(page: Page) -> list[str | None]:
    return [row.get_attribute("data-alarm") for row in page.locator("li.alarm").all()]


@pytest.mark.long(None)
def test_the_list_follows_the_events_in_the_servers_order(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/alarms?alarm=air_low")
    assert ids(page) == ["air_latched", "air_low"]
    expect(page.locator(".details")).to_contain_text("Open valve V1")
    act(cell, "air_latched", "acknowledge", occurrence=1)
    first = page.locator("li.alarm").first
    expect(first).to_have_attribute("data-alarm", "air_low")
    act(cell, "air_low", "shelve", reason="Tests", for_s=60)
    expect(first).to_have_attribute("data-alarm", "air_latched")
    expect(page.locator("li.alarm [data-text=state_text]").last).to_have_text("Shelved")
    page.get_by_role("link", name="Shelved 1", exact=True).click()
    expect(page.locator("li.alarm:visible")).to_have_count(1)


def counts(page: Page) -> list[str]:
    return page.locator(".choices [data-count]").all_text_contents()


def test_the_choices_count_and_events_keep_the_filter(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/alarms")
    assert counts(page) == ["2", "2", "0"]
    page.locator(".filters").click()
    page.locator("#only-priority").select_option("2")
    page.locator("#only-sort").select_option("newest")
    page.locator(".filter-sheet button[type=submit]").click()
    expect(page.locator(".filters")).to_have_text("Filter: Medium, Newest first")
    started(page, page.url)
    assert ids(page) == ["air_low"]
    assert counts(page) == ["1", "1", "0"]
    act(cell, "air_latched", "acknowledge", occurrence=1)
    act(cell, "air_low", "shelve", reason="Tests", for_s=60)
    expect(page.locator("li.alarm[data-state=shelved]")).to_have_count(1)
    assert ids(page) == ["air_low"]
    assert counts(page) == ["1", "0", "1"]
    follow(page.locator(".choices a", has_text="Unacknowledged"))
    started(page, page.url)
    assert ids(page) == []
    act(cell, "air_low", "unshelve")
    expect(page.locator("li.alarm")).to_have_count(1)
    assert "priority=2" in page.url
    assert "sort=newest" in page.url


def test_the_filter_works_without_scripts_and_follows_to_the_details(
    cell: Server, without_scripts: Page
) -> None:
    page = without_scripts
    page.goto(f"{cell.url}/alarms?group=Air")
    assert ids(page) == ["air_low"]
    follow(page.locator("li.alarm a"))
    assert page.url.endswith("/alarms?group=Air&alarm=air_low")
    assert page.locator("[name^='occurrence.']").count() == 1
    page.goto(f"{cell.url}/alarms?show=latched")
    assert ids(page) == []
    page.goto(f"{cell.url}/alarms?sort=priority")
    assert ids(page) == ["air_latched", "air_low"]


def test_acknowledge_all_shown_leaves_what_the_filter_hides(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/alarms?priority=2")
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.locator(".all-shown button").click()
    until(lambda: listed(cell)["air_low"]["acknowledged"], "it is acknowledged")
    assert not listed(cell)["air_latched"]["acknowledged"]
    expect(page.locator(".all-shown button")).to_be_disabled()


def test_an_alarm_of_its_own_is_acknowledged_and_shelved_from_its_details(
    cell: Server, page: Page
) -> None:
    started(page, f"{cell.url}/alarms")
    page.locator("li.alarm a").last.click()
    expect(page.locator(".details h3").first).to_have_text("Air pressure low")
    page.locator(".acts [popovertarget=sheet-shelve]").last.click()
    page.locator(".sheet:popover-open select[name=reason]").select_option(index=1)
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.locator(".sheet:popover-open button[type=submit]").click()
    until(lambda: listed(cell)["air_low"]["state"] == "shelved", "it is shelved")
    assert listed(cell)["air_low"]["shelf"]["reason"] == "Repair is ordered"
    assert not listed(cell)["air_latched"]["acknowledged"]
    page.goto(f"{cell.url}/alarms?alarm=air_latched")
    expect(page.locator(".acts").get_by_role("button", name="Shelve")).to_be_disabled()


def test_details_show_the_curve_and_lead_to_the_widget(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/alarms?alarm=air_low")

    def has_curve() -> bool:
        page.reload()
        return page.locator(".curve .line").count() == 1

    until(has_curve, "its samples are in the history", every_s=0.3)
    expect(page.locator(".curve-head")).to_contain_text("at the alarm 4.5 bar")
    expect(page.locator(".curve .time")).to_have_text(["\N{MINUS SIGN}8 s", re.compile(":"), "+6 s"])
    page.get_by_role("link", name="Go to Air").click()
    expect(page).to_have_url(f"{cell.url}/pages/main#at-air")
    ring = page.locator(".cell:target").evaluate("(cell) => getComputedStyle(cell).outlineStyle")
    assert ring == "solid"
    expect(page.locator(".cell:target [data-widget=air]")).to_be_visible()


def test_a_way_to_a_widget_shows_its_group(tmp_path: Path, page: Page) -> None:
    """On a small screen the groups of a page that fits take turns."""
    with demo_server(tmp_path, TABS) as server:
        until(lambda: len(listed(server)) == 1, "the alarm is raised")
        sized(page, 800, 480)
        started(page, f"{server.url}/alarms?alarm=air_low")
        page.get_by_role("link", name="Go to Air").click()
        expect(page.locator("[data-widget=air]")).to_be_visible()
        expect(page.locator("[data-widget=oil]")).to_be_hidden()


def test_forms_without_scripts_acknowledge(cell: Server, without_scripts: Page) -> None:
    page = without_scripts
    page.goto(f"{cell.url}/alarms?alarm=air_low")

    def acknowledged() -> bool:
        page.locator(".acts button", has_text="Acknowledge").click()
        return bool(listed(cell)["air_low"]["acknowledged"])

    until(acknowledged, "it is acknowledged", every_s=0.8)
    assert not listed(cell)["air_latched"]["acknowledged"]
    expect(page.locator("li.alarm")).to_have_count(2)


def test_programs_get_json(cell: Server) -> None:
    assert cell.http.get("/alarms").headers["content-type"] == "application/json"
    page = cell.http.get("/alarms", headers={"accept": "text/html"})
    assert page.headers["content-type"].startswith("text/html")


def test_axe_finds_nothing_and_nothing_is_cut_at_any_size(cell: Server, axe_page: Page) -> None:
    for path in ("/alarms", "/alarms?alarm=air_low"):
        started(axe_page, cell.url + path)
        for width, height in SIZES:
            sized(axe_page, width, height).evaluate(DRAWN)
            assert axe_page.evaluate("document.documentElement.scrollWidth") == width
            assert violations(axe_page) == [], (path, width)


def test_what_is_shown_while_the_server_does_not_answer_can_be_read(
    cell: Server, axe_page: Page
) -> None:
    started(axe_page, cell.url + "/alarms?alarm=air_low")
    cell.process.send(signal.SIGSTOP)
    try:
        expect(axe_page.locator("[data-cut] .alarms")).to_be_attached()
        assert violations(axe_page) == []
    finally:
        cell.process.send(signal.SIGCONT)


def test_an_alarm_acknowledged_elsewhere_locks_its_button(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/alarms?alarm=air_latched")
    button = page.locator("[data-act=acknowledge] button")
    expect(button).to_be_enabled()
    expect(page.locator("[data-act=in_service]")).to_be_hidden()
    act(cell, "air_latched", "acknowledge", occurrence=1)
    expect(button).to_be_disabled()
    expect(button).to_be_visible()
    act(cell, "air_latched", "out_of_service", reason="Tests")
    expect(page.locator("[data-act=in_service] button")).to_be_enabled()
    expect(page.locator("[data-act=shelve] button").last).to_be_disabled()
    assert page.locator(".all-shown button").is_enabled()
    act(cell, "air_low", "acknowledge", occurrence=1)
    expect(page.locator(".all-shown button")).to_be_disabled()


@pytest.mark.long(None)
def test_all_shown_are_those_at_the_touch(cell: Server, page: Page) -> None:
    """One that came again under the finger is not acknowledged."""
    act(cell, "air_low", "shelve", reason="Tests", for_s=60)
    started(page, f"{cell.url}/alarms")
    expect(page.locator("li.alarm[data-state=shelved]")).to_have_count(1)
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.locator(".all-shown button").hover()
    page.mouse.down()
    act(cell, "air_low", "unshelve")
    expect(page.locator("li.alarm[data-state=active]")).to_have_count(2)
    with page.expect_request("**/alarms/acknowledge") as sent:
        page.mouse.up()
    assert "occurrence.air_latched=1" in str(sent.value.post_data)
    assert "air_low" not in str(sent.value.post_data)
    until(lambda: listed(cell)["air_latched"]["acknowledged"], "it is acknowledged")
    assert not listed(cell)["air_low"]["acknowledged"]


def test_all_shown_have_the_occurrences_of_now_not_of_loading(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/alarms")
    act(cell, "air_low", "shelve", reason="Tests", for_s=60)
    act(cell, "air_low", "unshelve")
    until(lambda: listed(cell)["air_low"]["occurrence"] == 2, "it was raised again")
    expect(page.locator("li.alarm[data-state=active]")).to_have_count(2)
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.locator(".all-shown button").click()
    until(lambda: listed(cell)["air_low"]["acknowledged"], "its second occurrence is acknowledged")

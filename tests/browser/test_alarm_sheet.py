"""The sheet of a row of alarms: shelve, out of service and back, from the lists themselves."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.test_accessibility import violations
from tests.browser.test_alarm_line import SIZES, started
from tests.browser.test_alarm_widgets import AIR_LIST, WIDGETS
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN, place
from tests.support.parts import TAP_AGAIN_MS, Server, until
from tests.support.servers import demo_server
from tests.support.users import add_user
from tests.web.test_alarms import LOW, PANEL, act, listed

pytestmark = pytest.mark.long("detail")


WITH_LISTS: Final = PANEL.replace("[demo]\n", WIDGETS)
SHEET: Final = "#alarm-sheet"


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("kiosk")
    with demo_server(folder, WITH_LISTS % LOW) as server:
        yield server


@pytest.fixture
def cell(kiosk: Server) -> Server:
    """Its alarms are in service: `air_latched` of high priority, and `air_low`."""
    until(lambda: len(listed(kiosk)) == 2, "the alarms are raised")
    for alarm, row in listed(kiosk).items():
        for name in {"unshelve", "in_service"}.intersection(row["acts"]):
            act(kiosk, alarm, name)
    until(lambda: {row["state"] for row in listed(kiosk).values()} == {"active"}, "both are in service")
    return kiosk


def open_sheet(page: Page, row: str) -> Locator:
    page.locator(f"{row} .more-acts").click()
    sheet = page.locator(SHEET)
    expect(sheet).to_be_visible()
    return sheet


def state(cell: Server, alarm: str) -> str:
    return str(listed(cell)[alarm]["state"])


@pytest.mark.parametrize(("path", "list_"), [("/alarms", ".alarm-list"), ("/", AIR_LIST)])
def test_a_row_is_shelved_and_taken_out_of_service_and_back(
    cell: Server, page: Page, path: str, list_: str
) -> None:
    started(page, cell.url + path)
    row = f"{list_} li[data-alarm=air_low]"
    expect(page.locator(row)).to_have_attribute("data-state", "active")
    sheet = open_sheet(page, row)
    expect(sheet.locator("h3 span")).to_have_text("Air pressure low")
    sheet.get_by_label("For").select_option("3600")
    sheet.get_by_label("Reason").select_option("Sensor is faulty")
    sheet.get_by_role("button", name="Shelve", exact=True).click()
    expect(sheet).to_be_hidden()
    shelf = listed(cell)["air_low"]["shelf"]
    assert (state(cell, "air_low"), shelf["reason"]) == ("shelved", "Sensor is faulty")
    expect(page.locator(row)).to_have_attribute("data-state", "shelved")
    sheet = open_sheet(page, row)
    expect(sheet.locator("[data-taken=reason]")).to_have_text("Sensor is faulty")
    expect(sheet.locator("[data-taken=until_text]")).to_have_text(shelf["until_text"])
    expect(sheet.get_by_role("button", name="Shelve", exact=True)).to_be_hidden()
    sheet.get_by_role("button", name="Out of service").click()
    expect(page.locator(row)).to_have_attribute("data-state", "out_of_service")
    expect(sheet).to_be_hidden()
    open_sheet(page, row).get_by_role("button", name="Back in service").click()
    expect(page.locator(row)).to_have_attribute("data-state", "active")


def test_priority_1_is_never_shelved_but_may_be_taken_out_of_service(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/alarms")
    expect(page.locator("li[data-alarm=air_latched]")).to_have_attribute("data-state", "active")
    sheet = open_sheet(page, "li[data-alarm=air_latched]")
    expect(sheet.get_by_role("button", name="Shelve", exact=False).first).to_be_disabled()
    expect(sheet.locator(".sheet-acts small")).to_be_visible()
    expect(sheet.get_by_label("For")).to_be_hidden()
    expect(sheet.get_by_role("button", name="Out of service")).to_be_enabled()


def test_an_open_sheet_follows_what_others_do(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/alarms")
    expect(page.locator("li[data-alarm=air_low]")).to_have_attribute("data-state", "active")
    sheet = open_sheet(page, "li[data-alarm=air_low]")
    act(cell, "air_low", "shelve", reason="Tests", for_s=60)
    expect(sheet.get_by_role("button", name="End shelving")).to_be_visible()
    expect(sheet.get_by_role("button", name="Shelve", exact=True)).to_be_hidden()
    expect(sheet.locator("h3 span")).to_have_text("Air pressure low")


@pytest.mark.parametrize("path", ["/alarms", "/"])
def test_without_scripts_the_row_leads_to_its_sheet(
    cell: Server, without_scripts: Page, path: str
) -> None:
    page = without_scripts
    page.goto(cell.url + path)
    page.locator("li[data-alarm=air_low] .more-acts").first.click()
    sheet = page.locator(SHEET)
    expect(sheet).to_contain_text("Air pressure low")
    page.wait_for_timeout(TAP_AGAIN_MS)
    sheet.get_by_role("button", name="Shelve", exact=True).click()
    row = page.locator(".alarm-list li[data-alarm=air_low]")
    expect(row).to_have_attribute("data-state", "shelved")
    assert listed(cell)["air_low"]["shelf"]["reason"] == "Maintenance"
    assert listed(cell)["air_latched"]["state"] == "active"


@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_the_sheet_is_within_the_screen_and_axe_finds_nothing(
    cell: Server, axe_page: Page, language: str
) -> None:
    axe_page.set_extra_http_headers({"accept-language": language})
    for path, row in (("/alarms", "li[data-alarm=air_low]"), ("/", f"{AIR_LIST} li")):
        started(axe_page, cell.url + path)
        for width, height in SIZES:
            sized(axe_page, width, height).evaluate(DRAWN)
            expect(axe_page.locator(row)).to_have_attribute("data-state", "active")
            opens = place(axe_page.locator(f"{row} .more-acts"))
            assert min(opens["width"], opens["height"]) >= 44
            sheet = open_sheet(axe_page, row)
            shown = place(sheet)
            assert shown["x"] >= 0
            assert shown["x"] + shown["width"] <= width
            assert shown["y"] + shown["height"] <= height
            for part in sheet.locator("button:visible, select:visible").all():
                box = place(part)
                assert box["height"] >= 44
                assert box["x"] + box["width"] <= shown["x"] + shown["width"]
            assert violations(axe_page) == []
            axe_page.keyboard.press("Escape")
            expect(sheet).to_be_hidden()


def test_an_operator_sees_that_shelving_needs_maintenance(tmp_path: Path, page: Page) -> None:
    data = tmp_path / "data"
    add_user(data, "M. Sato", "operator", pin="2580")
    add_user(data, "K. Novak", "maintenance", pin="1470")
    with demo_server(tmp_path, WITH_LISTS % LOW, KIOSK_DATA=str(data)) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        for user, pin, may in (("M. Sato", "2580", False), ("K. Novak", "1470", True)):
            page.request.post(f"{server.url}/session", data={"user": user, "pin": pin})
            started(page, f"{server.url}/alarms?alarm=air_low")
            expect(page.locator("[data-act=acknowledge] button")).to_be_enabled()
            details = page.locator("[data-act=shelve] button:visible")
            expect(details).to_be_enabled(enabled=may)
            sheet = open_sheet(page, "li[data-alarm=air_low]")
            shelve = sheet.get_by_role("button", name="Shelve", exact=True)
            expect(shelve).to_be_enabled(enabled=may)
            expect(sheet.locator(".role-lock")).to_have_count(0 if may else 1)
            assert listed(server)["air_low"]["state"] == "active"
        shelve.click()
        expect(sheet).to_be_hidden()
        assert listed(server)["air_low"]["state"] == "shelved"

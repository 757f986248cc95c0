"""The page of recipes under a finger: values and names by the panel's own pads, and the question
before a load."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.test_confirm_in_browser import opened, typed
from tests.cell.recipes.panels import CARTON, PANEL, TRAY
from tests.support.browser.browsers import ReusedPage, sized
from tests.support.browser.pages import place
from tests.support.browser.touch import settled
from tests.support.confirmed import add_users
from tests.support.parts import TAP_AGAIN_MS, Server, until
from tests.support.servers import demo_server
from tests.support.users import Browsers
from tests.web.test_recipes_confirmed import FAST, OTHER

pytestmark = pytest.mark.long("detail")

SIZES: Final = ((1280, 800), (1024, 600), (800, 480))
STOP: Final = """
[[frame.widget]]
id = "halt"
kind = "publish"
label = "Stop"
role = "stop"
topic = "/halt"
type = "std_msgs/msg/Bool"
message = { data = true }
"""
CELL: Final = PANEL.replace("confirm_s = 8.0", 'confirm_s = 8.0\nconfirm_press = "pin"').replace(
    '[demo."/palletizer"]', f'{OTHER}{STOP}\n[demo."/palletizer"]'
)
LOAD: Final = ".load > button"


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_users(data)
    browsers = Browsers()
    with demo_server(tmp_path_factory.mktemp("panel"), CELL, KIOSK_DATA=str(data)) as server:
        client = browsers.signed_in(server.url, "J. Brandt", pin="3691")
        made = {"Carton": ("boxes", CARTON), "Tray": ("boxes", TRAY), "Ask": ("asked", FAST)}
        for name, (set_id, values) in made.items():
            answer = client.post(f"/recipes/{set_id}/create", json={"name": name, "values": values})
            assert answer.json()["done"], answer.text
        until(
            lambda: "differ from" in client.get("/recipes/boxes?recipe=tray").text, "the robot reports"
        )
        yield server
    browsers.close()


@pytest.fixture
def screen(chromium: Browser, cell: Server, request: pytest.FixtureRequest) -> Iterator[Page]:
    """A touch screen at which J. Brandt is signed in."""
    mine = ReusedPage(chromium, has_touch=True)
    with mine.taken(request.node) as page:
        opened(page, cell, "J. Brandt")
        yield page
    mine.close()


def shown(page: Page, server: Server, path: str) -> Page:
    page.goto(server.url + path)
    expect(page.locator("html[data-floor]")).to_be_attached()
    if "mode=" in path:
        expect(page.locator("body[data-touch-entry]")).to_be_attached()
    return page


def is_whole(page: Page, selector: str, size: tuple[int, int]) -> bool:
    """Whether an element is on the screen, and does not cover Stop."""
    box, stop = place(page.locator(selector)), place(page.locator("[data-widget=halt]"))
    beside = box["x"] >= stop["x"] + stop["width"] or box["y"] + box["height"] <= stop["y"]
    inside = box["x"] + box["width"] <= size[0] and box["y"] + box["height"] <= size[1]
    return beside and inside and box["x"] >= 0 and box["y"] >= 0


@pytest.mark.parametrize("size", SIZES)
def test_values_are_entered_on_the_pads_and_saved(
    screen: Page, cell: Server, size: tuple[int, int]
) -> None:
    page = shown(sized(screen, *size), cell, "/recipes/boxes?recipe=carton&mode=edit")
    length = str(300 + size[1] // 10)
    page.locator("#input-length").tap()
    expect(page.locator(".sheet.keypad")).to_be_visible()
    for key in page.locator(".sheet.keypad button").all():
        box = place(key)
        assert box["x"] + box["width"] <= size[0]
        assert box["y"] + box["height"] <= size[1]
        assert min(box["width"], box["height"]) >= 44
    assert is_whole(page, ".sheet.keypad", size)
    for digit in length:
        page.locator(f'.sheet [data-key="{digit}"]').tap()
    page.locator(".set-entry").tap()
    expect(page.locator("#input-length")).to_have_value(length)
    settled(page)
    page.locator("#input-note").tap()
    expect(page.locator(".sheet.keyboard")).to_be_visible()
    assert is_whole(page, ".sheet.keyboard", size)
    page.locator('.sheet.keyboard [data-key="k"]').tap()
    page.locator(".sheet.keyboard .set-entry").tap()
    settled(page)
    note = page.locator("#input-note").input_value()
    assert note.endswith("k")
    page.get_by_role("button", name="Save").tap()
    expect(page.locator("[data-row=length] .mine")).to_have_text(f"{length} mm")
    expect(page.locator("[data-row=note] .mine")).to_have_text(note)


def test_a_name_is_typed_on_the_keyboard(screen: Page, cell: Server) -> None:
    page = shown(sized(screen, 800, 480), cell, "/recipes/boxes?recipe=carton&mode=copy")
    page.get_by_label("Name").tap()
    expect(page.locator(".sheet.keyboard")).to_be_visible()
    for key in "box":
        page.locator(f'.sheet.keyboard [data-key="{key}"]').tap()
    page.locator(".sheet.keyboard .set-entry").tap()
    settled(page)
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.get_by_role("button", name="Copy").tap()
    expect(page.locator(".recipe h2")).to_have_text("box")


@pytest.mark.parametrize("size", SIZES)
def test_the_pin_is_asked_beside_what_changes(
    screen: Page, cell: Server, size: tuple[int, int]
) -> None:
    page = shown(sized(screen, *size), cell, "/recipes/boxes?recipe=tray")
    page.locator(LOAD).tap()
    sheet = page.locator("#person")
    expect(sheet.locator(".yes")).to_be_enabled()
    expect(sheet.locator(".sentence")).to_have_text("Load Tray?")
    robot = page.locator("[data-row=note] .robot b").inner_text()
    expect(sheet.locator(".changes div", has_text="Note")).to_contain_text(f"{robot} → x")
    assert is_whole(page, "#person", size)
    assert sheet.evaluate("(sheet) => sheet.scrollHeight <= sheet.clientHeight + 1")
    typed(sheet, "3690")
    sheet.locator(".yes").tap()
    expect(sheet.locator(".said")).to_contain_text("The PIN is wrong")
    typed(sheet, "3691")
    sheet.locator(".yes").tap()
    expect(page.locator(".foot .result")).to_contain_text("Tray is loaded")
    expect(page.locator("[data-state=differs]")).to_have_count(0)
    shown(page, cell, "/recipes/boxes?recipe=carton").locator(LOAD).tap()
    expect(sheet.locator(".yes")).to_be_enabled()
    typed(sheet, "3691")
    sheet.locator(".yes").tap()
    expect(page.locator(".foot .result")).to_contain_text("Carton is loaded")


def test_a_question_follows_what_the_robot_reports(screen: Page, cell: Server) -> None:
    page = shown(sized(screen, 800, 480), cell, "/recipes/asked?recipe=ask")
    page.locator(LOAD).tap()
    dialog = page.locator("dialog.ask:popover-open")
    expect(dialog.locator("h2")).to_have_text("Load Ask?")
    expect(dialog.locator(".changes div", has_text="Speed")).to_contain_text("→ 90 %")
    expect(dialog.locator(".yes")).to_be_enabled()
    dialog.locator(".yes").tap()
    expect(page.locator(".foot .result")).to_contain_text("Ask is loaded")
    expect(page.locator("dialog.ask .changes dl div")).to_have_count(0)
